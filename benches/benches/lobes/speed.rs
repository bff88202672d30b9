//! Frames a second, beside the paper's, and where the time goes.

use std::time::Instant;

use glam::Vec3;
use lunette_benches::{duel, least};
use lunette_relight::lobe::reflectance::{Cosine, Reflectance, ShapedLobe};
use lunette_relight::lobe::{
    Blockers, Options, Points, Policy, Probe, Scene, Scratch, SphereSet, Stage, Surface, Target, add_light,
    add_radiance,
};

use super::scene::{HEIGHTS, aggressive, blockers, frame, lamp, plane, proportional};

/// The paper's frames a second at 16,384 points for its three heights (Fig. 17).
const PAPER: [f64; 3] = [15.9, 10.1, 4.75];
/// The paper's at 65,536 points of Lafortune materials without a blocker (Fig. 14).
const PAPER_MATERIALS: f64 = 13.73;
const ROUNDS: usize = 15;

pub fn frames(body: &SphereSet) {
    println!("\nframes a second, 64 spheres, depth 5, threshold 0.001 (paper at 16,384 points: {PAPER:?})");
    println!(
        "{:>8} {:>7} {:>14} {:>10} {:>10} {:>12}",
        "points", "height", "policy", "one core", "two", "x paper"
    );
    for n in [64, 128, 256] {
        for (height, paper) in HEIGHTS.into_iter().zip(PAPER) {
            for options in [aggressive(), proportional()] {
                let (one, two) = rates(n, body, height, &options);
                let ratio = if n == 128 { format!("{:.1}", one / paper) } else { String::new() };
                let policy = format!("{:?}", options.policy);
                println!("{:>8} {height:>7} {policy:>14} {one:>10.1} {two:>10.1} {ratio:>12}", n * n);
            }
        }
    }
}

/// Frames a second on one core and on two, taken in turn.
fn rates(n: usize, body: &SphereSet, height: f32, options: &Options) -> (f64, f64) {
    let (plane, blockers) = (plane(n), blockers(body, height));
    let mut scratch = [Scratch::default(), Scratch::default(), Scratch::default()];
    let (one, two) = scratch.split_at_mut(1);
    let [mut light, mut other] = [vec![[0.0; 3]; n * n], vec![[0.0; 3]; n * n]];
    let (one, two) = duel(
        ROUNDS,
        || frame(&plane, &blockers, options, one, &mut light),
        || frame(&plane, &blockers, options, two, &mut other),
    );
    (1.0 / one, 1.0 / two)
}

/// Four Lafortune materials in a checker: mirror-like, retro-reflective, anisotropic, off-specular.
pub fn checker() -> [Reflectance; 4] {
    let material = |albedo: [f32; 3], direction: [f32; 3], exponent: f32| {
        let scale = Vec3::splat(0.4);
        let lobe = ShapedLobe { direction: direction.into(), exponent, scale, cosine: Cosine::Times };
        Reflectance::lafortune(albedo.into(), &[lobe])
    };
    [
        material([0.5, 0.3, 0.2], [-1.0, -1.0, 1.0], 80.0),
        material([0.2, 0.3, 0.5], [1.0, 1.0, 1.0], 15.0),
        material([0.3, 0.3, 0.3], [-1.0, -0.7, 0.9], 40.0),
        material([0.4, 0.4, 0.1], [-1.0, -1.0, 0.7], 25.0),
    ]
}

pub fn materials() {
    let n = 256;
    let plane = plane(n);
    let materials = checker();
    let material: Vec<u32> = (0..n * n).map(|k| ((k / 16) % 2 + 2 * (k / n / 16 % 2)) as u32).collect();
    let eye = Vec3::new(0.0, 3.0, 5.0);
    let surface = Surface { materials: &materials, material: &material, tangent: &[], eye };
    let points = Points { position: &plane.position, normal: &plane.normal };
    let (mut light, mut scratch) = (vec![[0.0; 3]; n * n], Scratch::default());
    let (blockers, options) = (Blockers::default(), Options::default());
    let scene = Scene { lamps: &[lamp()], blockers: &blockers };
    let mut shares = Shares::default();
    let seconds = least(ROUNDS, || {
        let mut target = Target { light: &mut light, products: None };
        add_radiance(&points, &surface, &scene, &options, &mut scratch, &mut target);
    });
    let mut target = Target { light: &mut light, products: None };
    shares.start();
    add_light(&points, Some(&surface), &scene, &options, &mut scratch, &mut target, &mut shares);
    println!(
        "\n65,536 points, Lafortune materials, no blocker: {:.1} frames a second on one core, {:.1} x the paper's {PAPER_MATERIALS}",
        1.0 / seconds,
        1.0 / seconds / PAPER_MATERIALS
    );
    println!("{}", shares.line());
}

/// Where the time of a frame goes, as in the paper's Table 1.
pub fn shares(body: &SphereSet) {
    println!("\nshares of the time, % (a) reflectance (b) lamps (c) masks (d) leaves (e) products");
    println!("paper, Fig. 17: 2.6 2.7 76.2 8.1 10.4 | 1.5 1.5 63 15.8 18.2 | 0.7 0.7 54 20.3 24.3");
    for height in HEIGHTS {
        for policy in [Policy::Aggressive, Policy::Proportional] {
            let options = Options { policy, ..aggressive() };
            println!("height {height}, {policy:?}: {}", share(body, height, &options).line());
        }
    }
}

fn share(body: &SphereSet, height: f32, options: &Options) -> Shares {
    let (plane, blockers) = (plane(128), blockers(body, height));
    let points = Points { position: &plane.position, normal: &plane.normal };
    let (mut light, mut scratch) = (vec![[0.0; 3]; plane.position.len()], Scratch::default());
    let mut shares = Shares::default();
    for _ in 0..ROUNDS {
        shares.start();
        let mut target = Target { light: &mut light, products: None };
        let scene = Scene { lamps: &[lamp()], blockers: &blockers };
        add_light(&points, None, &scene, options, &mut scratch, &mut target, &mut shares);
    }
    shares
}

/// Seconds of each stage.
struct Shares {
    seconds: [f64; 5],
    last: Instant,
    /// What one look at the clock costs.
    clock: f64,
}

impl Default for Shares {
    fn default() -> Self {
        let started = Instant::now();
        (0..1000).for_each(|_| {
            std::hint::black_box(Instant::now());
        });
        let clock = started.elapsed().as_secs_f64() / 1000.0;
        Shares { seconds: [0.0; 5], last: Instant::now(), clock }
    }
}

impl Shares {
    fn start(&mut self) {
        self.last = Instant::now();
    }

    fn line(&self) -> String {
        let sum: f64 = self.seconds.iter().sum();
        self.seconds.map(|s| format!("{:.1}", 100.0 * s / sum)).join(" ")
    }
}

impl Probe for Shares {
    fn end(&mut self, stage: Stage) {
        let now = Instant::now();
        let spent = now.duration_since(self.last).as_secs_f64() - self.clock;
        self.seconds[stage as usize] += spent.max(0.0);
        self.last = now;
    }
}
