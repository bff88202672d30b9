//! How many rays a second Embree traces here, by query, packet width and ray order.
//!
//! The rays are those of a sky-visibility bake: hemisphere rays from the vertices of a
//! fractal terrain. Orders: `random` (one vertex after another, its directions shuffled),
//! `sorted` (one vertex after another, its directions along a space-filling curve) and
//! `shared` (one direction for a whole run of neighbouring vertices, then the next).
//!
//!     cargo run --release -p lunette-ffi --example rays_per_second

use std::time::{Duration, Instant};

use lunette_ffi::{Device, Error, Hits, Lanes, Mask, Packet, Ray, Scene, SceneBuilder, Width};

/// Vertices along each side of the terrain: 2 * 511^2 = 522,242 triangles.
const SIDE: usize = 512;
/// Rays from each vertex: 16 x 16 strata of the hemisphere.
const STRATA: usize = 16;
/// How many vertices send rays, in runs of `RUN` neighbours.
const N_SENDERS: usize = 4096;
/// Neighbours that share a direction in the `shared` order: the widest packet.
const RUN: usize = 16;
/// Each measurement is the best of this many.
const ROUNDS: usize = 3;

fn main() -> Result<(), Error> {
    let device = Device::new()?;
    let positions = terrain();
    let start = Instant::now();
    let mut builder = SceneBuilder::new(&device)?;
    builder.add_triangles(&positions, &grid_triangles())?;
    let scene = builder.commit()?;
    let (major, minor, patch) = device.version();
    println!("Embree {major}.{minor}.{patch} at {}", device.library().display());
    println!("built {} triangles in {:.0?}", 2 * (SIDE - 1) * (SIDE - 1), start.elapsed());
    println!("million rays a second on one thread:\n");
    println!("{:8} {:>9} {:>7} {:>7} {:>7}", "order", "query", "single", "8", "16");

    lunette_ffi::flush_to_zero();
    for (order, rays) in orders(&positions) {
        let count = rays.len();
        let closest = [
            best(count, || rays.iter().filter(|ray| scene.intersect(ray).is_some()).count()),
            best(count, || closest_in_packets::<8>(&scene, &rays)),
            best(count, || closest_in_packets::<16>(&scene, &rays)),
        ];
        let occluded = [
            best(count, || rays.iter().filter(|ray| scene.occluded(ray)).count()),
            best(count, || occluded_in_packets::<8>(&scene, &rays)),
            best(count, || occluded_in_packets::<16>(&scene, &rays)),
        ];
        for (query, [single, eight, sixteen]) in [("closest", closest), ("occluded", occluded)] {
            println!("{order:8} {query:>9} {single:7.2} {eight:7.2} {sixteen:7.2}");
        }
    }
    Ok(())
}

/// Million rays a second of the fastest round.
fn best(n_rays: usize, mut trace: impl FnMut() -> usize) -> f64 {
    let mut least = Duration::MAX;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        std::hint::black_box(trace());
        least = least.min(start.elapsed());
    }
    n_rays as f64 / least.as_secs_f64() * 1e-6
}

fn closest_in_packets<const N: usize>(scene: &Scene, rays: &[Ray]) -> usize
where
    Lanes<N>: Width,
{
    let (mask, mut packet, mut hits) = (Mask::all(), Packet::<N>::default(), Hits::default());
    let mut n_hits = 0;
    for chunk in rays.chunks_exact(N) {
        fill(&mut packet, chunk);
        scene.intersect_packet(&mask, &mut packet, &mut hits);
        n_hits += hits.geometry.iter().filter(|&&geometry| geometry != lunette_ffi::NO_HIT).count();
    }
    n_hits
}

fn occluded_in_packets<const N: usize>(scene: &Scene, rays: &[Ray]) -> usize
where
    Lanes<N>: Width,
{
    let (mask, mut packet) = (Mask::all(), Packet::<N>::default());
    let mut n_hits = 0;
    for chunk in rays.chunks_exact(N) {
        fill(&mut packet, chunk);
        scene.occluded_packet(&mask, &mut packet);
        n_hits += (0..N).filter(|&lane| packet.is_occluded(lane)).count();
    }
    n_hits
}

fn fill<const N: usize>(packet: &mut Packet<N>, rays: &[Ray]) {
    for (lane, ray) in rays.iter().enumerate() {
        packet.set(lane, ray);
    }
}

/// The same rays three times over: see the top of this file.
fn orders(positions: &[[f32; 3]]) -> [(&'static str, Vec<Ray>); 3] {
    let step = positions.len() / N_SENDERS * RUN;
    let runs = (0..N_SENDERS / RUN).map(|run| &positions[run * step..run * step + RUN]);
    let curve = directions();
    let mut shuffled = curve.clone();
    // An odd stride visits every element of a power-of-two list once, far from the last.
    (0..curve.len()).for_each(|i| shuffled[i] = curve[i * 167 % curve.len()]);

    let fan = |directions: &[[f32; 3]]| {
        let one =
            |origin| directions.iter().map(move |&direction| ray(origin, direction)).collect::<Vec<_>>();
        runs.clone().flatten().flat_map(|&origin| one(origin)).collect::<Vec<_>>()
    };
    let beam = |run: &[[f32; 3]]| {
        let run = run.to_vec();
        curve
            .iter()
            .flat_map(move |&d| run.iter().map(move |&p| ray(p, d)).collect::<Vec<_>>())
            .collect::<Vec<_>>()
    };
    [("random", fan(&shuffled)), ("sorted", fan(&curve)), ("shared", runs.clone().flat_map(beam).collect())]
}

/// Starts a little above the surface, so as not to meet the sender's own triangles.
fn ray([x, y, z]: [f32; 3], direction: [f32; 3]) -> Ray {
    Ray::new([x, y + 1e-3, z], direction)
}

/// Uniform over the upper hemisphere, one in each stratum, along a Morton curve.
fn directions() -> Vec<[f32; 3]> {
    let bits = |code: usize| (0..4).map(|bit| (code >> (2 * bit) & 1) << bit).sum::<usize>();
    let stratum = |code: usize| {
        let (i, j) = (bits(code), bits(code >> 1));
        let height = (i as f32 + 0.5) / STRATA as f32;
        let (sin, cos) = ((j as f32 + 0.5) / STRATA as f32 * std::f32::consts::TAU).sin_cos();
        let radius = (1.0 - height * height).sqrt();
        [radius * cos, height, radius * sin]
    };
    (0..STRATA * STRATA).map(stratum).collect()
}

/// Octaves of tilted waves, each half as high and about twice as fine as the last.
fn terrain() -> Vec<[f32; 3]> {
    let height = |x: f32, z: f32| -> f32 {
        let octave = |k: i32| {
            let frequency = 0.013 * 1.93_f32.powi(k);
            let (sin, cos) = (k as f32 * 2.4).sin_cos();
            40.0 * 0.55_f32.powi(k)
                * ((x * cos + z * sin) * frequency).sin()
                * ((z * cos - x * sin) * frequency).cos()
        };
        (0..8).map(octave).sum()
    };
    let at = |i: usize| ((i % SIDE) as f32, (i / SIDE) as f32);
    (0..SIDE * SIDE).map(at).map(|(x, z)| [x, height(x, z), z]).collect()
}

fn grid_triangles() -> Vec<[u32; 3]> {
    let side = SIDE as u32;
    let cell = move |x: u32, z: u32| {
        let corner = z * side + x;
        [[corner, corner + side, corner + 1], [corner + 1, corner + side, corner + side + 1]]
    };
    (0..side - 1).flat_map(|z| (0..side - 1).flat_map(move |x| cell(x, z))).collect()
}
