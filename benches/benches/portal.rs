//! A frame of an interior against a plain read of the same bytes, and the share of each of its parts.
//!
//! The transfer is that of one window seen from a box-shaped room: rows of texels that the window covers, cosine
//! included, encoded as a bake does. The plain read sums the same bytes in wide vectors. Target: sparse dot products
//! at most 2 times the plain read on one core.
//!
//!     cargo bench -p lunette-benches --bench portal

use std::hint::black_box;

use glam::{Vec2, Vec3};
use half::f16;
use lunette_benches::duel;
use lunette_relight::asset::{Asset, Metadata};
use lunette_relight::cubemap::{self, ShTable};
use lunette_relight::dot;
use lunette_relight::light::{Light, Sky, Source};
use lunette_relight::shell::Blur;
use lunette_relight::sparse::{Basis, Choice, Encoder, Encoding, RowStore, Rows, SparseLight};

const ROUNDS: usize = 30;
const N: usize = 32;
/// Vertices along a side of a side of the room.
const PER_SIDE: usize = 24;
/// Different rows; vertices repeat them.
const DIFFERENT: usize = 4 * PER_SIDE * PER_SIDE;

fn main() {
    println!("{:<44} {:>9} {:>9} {:>6} {:>9}", "", "read µs", "relit µs", "ratio", "B/vertex");
    for vertices in [45_000, 400_000] {
        for (name, choice) in [
            ("smaller of both", Choice::Smaller),
            ("pulse", Choice::Only(Basis::Pulse)),
            ("haar", Choice::Only(Basis::Haar)),
        ] {
            sparse(&format!("direct, {name}, {vertices} vertices"), vertices, choice);
        }
    }
    bounced("bounced, SH order 4, 45000 vertices", 45_000, 48);
    bounced("bounced, carried, k = 128, 45000 vertices", 45_000, 128);
    println!("\n{:<44} {:>9}", "once per frame and portal, N = 32", "µs");
    shell();
}

/// Vertices in the order of a mesh on four sides of a room 4 m x 3 m x 4 m with a window of 2 m x 1.5 m in the wall at
/// +X.
fn rows() -> Vec<Vec<f32>> {
    let row = |i: usize| {
        let (side, at) = (i / PER_SIDE.pow(2), i % PER_SIDE.pow(2));
        let [s, t] = [at % PER_SIDE, at / PER_SIDE].map(|k| (k as f32 + 0.5) / PER_SIDE as f32);
        match side {
            0 => window_row(Vec3::new(4.0 * s, 0.0, 4.0 * t), Vec3::Y),
            1 => window_row(Vec3::new(4.0 * s, 3.0, 4.0 * t), Vec3::NEG_Y),
            2 => window_row(Vec3::new(0.0, 3.0 * s, 4.0 * t), Vec3::X),
            _ => window_row(Vec3::new(4.0 * s, 3.0 * t, 0.0), Vec3::Z),
        }
    };
    (0..DIFFERENT).map(row).collect()
}

fn window_row(p: Vec3, normal: Vec3) -> Vec<f32> {
    const SIDE: usize = 4;
    let mut row = vec![0.0; cubemap::n_texels(N)];
    for (t, out) in row.iter_mut().enumerate() {
        for i in 0..SIDE * SIDE {
            let within = Vec2::new((i % SIDE) as f32 + 0.5, (i / SIDE) as f32 + 0.5) / SIDE as f32;
            let (d, solid_angle) = cubemap::sample(N, t, within);
            let hit = p + d * ((4.0 - p.x) / d.x);
            if d.x > 0.0 && (0.75..2.25).contains(&hit.y) && (1.0..3.0).contains(&hit.z) {
                *out += normal.dot(d).max(0.0) * solid_angle / (SIDE * SIDE) as f32;
            }
        }
    }
    row
}

fn sparse(name: &str, vertices: usize, choice: Choice) {
    let mut encoder = Encoder::new(N, Encoding { choice, ..Encoding::default() });
    let encoded: Vec<_> = rows().iter().map(|row| encoder.encode(row)).collect();
    let mut store = RowStore::default();
    (0..vertices).for_each(|v| store.push(&encoded[v % DIFFERENT]));
    let mut asset = Asset::new(Metadata::new("room"));
    let zeros = lunette_relight::asset::Data::F32(vec![0.0; 3 * vertices].into());
    asset.insert("mesh.position", &[vertices, 3], zeros);
    store.insert_into(&mut asset, "portal.0.direct", N).expect("less than 4 GiB");
    let rows = Rows::open(&asset, "portal.0.direct").expect("good rows").expect("there are rows");
    let mut light = SparseLight::new(N);
    light.set(&day());
    let bytes: Vec<u8> = vec![1; rows.bytes()];
    let mut out = vec![[0.0f32; 3]; vertices];
    let times = duel(ROUNDS, || read(&bytes), || rows.add(0, &light, black_box(&mut out)));
    print(name, times, rows.bytes() as f32 / vertices as f32);
}

fn bounced(name: &str, vertices: usize, k: usize) {
    let transfer: Vec<f16> =
        (0..vertices * k).map(|i| f16::from_f32((i % 997) as f32 / 997.0 - 0.4)).collect();
    let bytes = vec![1u8; 2 * transfer.len()];
    let mut out = vec![[0.0f32; 3]; vertices];
    let light = vec![[1.0, 0.5, 0.25]; k];
    let run = |out: &mut [[f32; 3]]| match k {
        48 => dot::sh_rgb_add(&transfer, &light[..16], out),
        _ => dot::sh(&transfer, &light, out),
    };
    print(name, duel(ROUNDS, || read(&bytes), || run(black_box(&mut out))), 2.0 * k as f32);
}

fn day() -> Vec<[f32; 3]> {
    let mut texels = vec![[0.0; 3]; cubemap::n_texels(N)];
    cubemap::project_light(&sky(), N, &mut texels);
    texels
}

fn sky() -> Light {
    Light::new(Source::Sky(Sky::new(1.0, 0.6, 3.0).expect("a good sky")))
}

fn shell() {
    let (light, mut texels, mut out) = (sky(), day(), day());
    let time = |name: &str, mut work: Box<dyn FnMut() + '_>| {
        let (least, _) = duel(ROUNDS, &mut work, || {});
        println!("{name:<44} {:>9.1}", least * 1e6);
    };
    time("sky onto the cubemap", Box::new(|| cubemap::project_light(&light, N, &mut texels)));
    let mut wide = Blur::new(N, 0.3);
    time("frosted, 0.3 radians", Box::new(|| wide.apply(black_box(&texels), &mut out)));
    let mut sparse = SparseLight::new(N);
    time("planes and Haar transform", Box::new(|| sparse.set(black_box(&out))));
    let table = ShTable::new(N, 4);
    let mut sh = [[0.0; 3]; 16];
    time("SH of order 4", Box::new(|| table.project(black_box(&out), black_box(&mut sh))));
    let table = ShTable::new(N, 10);
    let mut sh = [[0.0; 3]; 100];
    time("SH of order 10", Box::new(|| table.project(black_box(&out), black_box(&mut sh))));
}

/// Sums the bytes in 128 strands, so that memory is the limit and not the adder.
fn read(values: &[u8]) {
    let mut sums = [0u8; 128];
    for chunk in values.chunks_exact(128) {
        for (s, v) in sums.iter_mut().zip(chunk) {
            *s = s.wrapping_add(*v);
        }
    }
    black_box(sums);
}

fn print(name: &str, (read, relit): (f64, f64), bytes: f32) {
    println!("{name:<44} {:>9.1} {:>9.1} {:>6.2} {bytes:>9.0}", read * 1e6, relit * 1e6, relit / read);
}
