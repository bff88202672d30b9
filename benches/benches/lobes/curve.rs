//! Error against time over depth, policy and threshold.

use lunette_benches::chart::{Chart, Page, Point, Series};
use lunette_benches::least;
use lunette_relight::lobe::{Options, Policy, Scratch, SphereSet};

use super::mesh::{Rays, hits_spheres, moved};
use super::scene::{HEIGHTS, blockers, frame, lamp, plane};

/// Points along a side: few, for the truth takes 3,600 rays past 64 spheres at each.
const SIDE: usize = 56;

pub fn error_against_time(body: &SphereSet, page: &mut Page) -> Result<(), Box<dyn std::error::Error>> {
    let height = HEIGHTS[1];
    let spheres = moved(body, height);
    let rays = Rays { rings: 30, lamp: lamp() };
    let truth: Vec<f32> =
        plane(SIDE).position.iter().map(|&p| rays.light(p.into(), hits_spheres(&spheres))).collect();
    println!("\nerror against time, height {height}, {} points, one core", SIDE * SIDE);
    println!("{:>14} {:>6} {:>10} {:>8} {:>10}", "policy", "depth", "threshold", "ms", "relative");
    let mut series = Vec::new();
    for policy in [Policy::Aggressive, Policy::Conservative, Policy::Proportional] {
        for threshold in [0.0, 1e-2, 1e-1] {
            let name = format!("{policy:?}, threshold {threshold}");
            let point = |depth| measure(body, height, &truth, &Options { depth, policy, threshold });
            series.push(Series { name, points: (1..=5).map(point).collect() });
        }
    }
    page.section(
        "Error against time",
        "A rabbit of 64 spheres over a plane; each point is a depth of the mask.",
    );
    page.chart(&Chart {
        title: "Relative difference from rays against time, depth 1 to 5".into(),
        x: "time of a frame of 3,136 points, ms".into(),
        y: "relative difference".into(),
        series,
    })
}

fn measure(body: &SphereSet, height: f32, truth: &[f32], options: &Options) -> Point {
    let (plane, blockers) = (plane(SIDE), blockers(body, height));
    let mut scratch = [Scratch::default()];
    let mut light = vec![[0.0; 3]; truth.len()];
    frame(&plane, &blockers, options, &mut scratch, &mut light);
    let off: f64 = light.iter().zip(truth).map(|(a, b)| f64::from((a[0] - b).abs())).sum();
    let relative = off / truth.iter().map(|b| f64::from(*b)).sum::<f64>();
    let ms = 1e3 * least(9, || frame(&plane, &blockers, options, &mut scratch, &mut light));
    let (policy, depth, threshold) = (format!("{:?}", options.policy), options.depth, options.threshold);
    println!("{policy:>14} {depth:>6} {threshold:>10} {ms:>8.3} {relative:>10.5}");
    Point { x: ms, y: relative, label: depth.to_string() }
}
