//! Error against time over depth, policy and threshold.

use glam::Vec3;
use lunette_benches::chart::{Chart, Page, Point, Series};
use lunette_benches::least;
use lunette_relight::lobe::{Options, Policy, Scratch, Sphere, SphereSet};

use super::scene::{HEIGHTS, blockers, frame, lamp, plane};

/// Points along a side: few, for the truth takes 3,600 rays past 64 spheres at each.
const SIDE: usize = 56;

pub fn error_against_time(body: &SphereSet, page: &mut Page) -> Result<(), Box<dyn std::error::Error>> {
    let height = HEIGHTS[1];
    let truth = traced(body, height);
    println!("\nerror against time, height {height}, {} points, one core", SIDE * SIDE);
    println!("{:>14} {:>6} {:>10} {:>8} {:>10}", "policy", "depth", "threshold", "ms", "relative");
    let mut series = Vec::new();
    for policy in [Policy::Aggressive, Policy::Conservative, Policy::Proportional] {
        for threshold in [0.0, 1e-3, 1e-2] {
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

/// Irradiance by 30 × 120 rays over the lamp's cap, in equal-area coordinates.
fn traced(body: &SphereSet, height: f32) -> Vec<f32> {
    let turn = glam::Quat::from_rotation_y(0.4);
    let moved = |s: &Sphere| Sphere { centre: turn * s.centre + Vec3::Y * height, radius: s.radius };
    let spheres: Vec<Sphere> = body.spheres().iter().map(moved).collect();
    plane(SIDE).position.iter().map(|&p| traced_at(p.into(), &spheres)).collect()
}

fn traced_at(point: Vec3, spheres: &[Sphere]) -> f32 {
    let lamp = lamp();
    let to = lamp.centre - point;
    let sin = lamp.radius / to.length();
    let versine = sin * sin / (1.0 + (1.0 - sin * sin).sqrt());
    let axis = to.normalize();
    let (across, up) = axis.any_orthonormal_pair();
    let (rings, spokes) = (30, 120);
    let mut sum = 0.0f64;
    for k in 0..rings * spokes {
        let drop = versine * ((k / spokes) as f32 + 0.5) / rings as f32;
        let (s, c) = (std::f32::consts::TAU * ((k % spokes) as f32 + 0.5) / spokes as f32).sin_cos();
        let direction = axis * (1.0 - drop) + (across * c + up * s) * (drop * (2.0 - drop)).sqrt();
        let hit = |s: &Sphere| {
            let to = s.centre - point;
            let along = to.dot(direction);
            along > 0.0 && (to - along * direction).length_squared() < s.radius * s.radius
        };
        if !spheres.iter().any(hit) {
            sum += f64::from(direction.y);
        }
    }
    (sum / f64::from(rings * spokes) * f64::from(versine) * std::f64::consts::TAU) as f32
}
