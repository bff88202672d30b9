//! A frame of an interior against a plain read of the same bytes, and the share of each of its parts.
//!
//! First a whole frame of the built-in room with everything on: a Hosek-Wilkie sky with its sun captured, projected,
//! direct light and its beam, and bounced light, over all threads; target: 10 ms. Then dot products alone.
//!
//! Their transfer is that of one window seen from a box-shaped room: rows of texels that the window covers, cosine
//! included, encoded as a bake does. The plain read sums bytes in wide vectors: those of the rows in the file, and those
//! that a frame reads, of rows in blocks, which hold what any of sixteen has. Target: dot products at most 2 times the plain
//! read of the same bytes on one core.
//!
//!     cargo bench -p lunette-benches --bench portal

use std::hint::black_box;

use glam::{Vec2, Vec3};
use half::f16;
use lunette_bake as bake;
use lunette_benches::duel;
use lunette_relight::asset::{Asset, Data, Metadata};
use lunette_relight::cubemap::{self, ShTable};
use lunette_relight::dot;
use lunette_relight::indirect::Indirect;
use lunette_relight::light::{CieOvercast, Light, Sky, Source};
use lunette_relight::portal_frame::PortalFrame;
use lunette_relight::shell::{Blur, Shell};
use lunette_relight::sparse::{Basis, Choice, Encoder, Encoding, RowStore, SparseLight};
use lunette_render::{Backdrop, capture, seen_discs};
use lunette_scenes::{builtin, take_portals};
use rayon::prelude::*;

const ROUNDS: usize = 30;
const N: usize = 32;
/// Vertices along a side of a side of the room.
const PER_SIDE: usize = 48;
/// Different rows; vertices repeat them.
const DIFFERENT: usize = 4 * PER_SIDE * PER_SIDE;

fn main() {
    let room = bake_room();
    let asset = Asset::from_bytes(&room).expect("an asset");
    frame(&asset);
    println!("{:<56} {:>9} {:>9} {:>6} {:>9}", "", "read µs", "relit µs", "ratio", "B/vertex");
    baked(&asset);
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
    println!("\n{:<56} {:>9}", "once per frame and portal, N = 32", "µs");
    shell();
}

/// Vertex `i` on four sides of a room 4 m x 3 m x 4 m with a window of 2 m x 1.5 m in the wall at +X, in the order of a
/// mesh, and its normal.
fn vertex(i: usize) -> (Vec3, Vec3) {
    let (side, at) = (i % DIFFERENT / PER_SIDE.pow(2), i % PER_SIDE.pow(2));
    let [s, t] = [at % PER_SIDE, at / PER_SIDE].map(|k| (k as f32 + 0.5) / PER_SIDE as f32);
    match side {
        0 => (Vec3::new(4.0 * s, 0.0, 4.0 * t), Vec3::Y),
        1 => (Vec3::new(4.0 * s, 3.0, 4.0 * t), Vec3::NEG_Y),
        2 => (Vec3::new(0.0, 3.0 * s, 4.0 * t), Vec3::X),
        _ => (Vec3::new(4.0 * s, 3.0 * t, 0.0), Vec3::Z),
    }
}

/// Texels that the window covers, cosine included.
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
    let encoding = Encoding { choice, ..Encoding::default() };
    let encode = |encoder: &mut Encoder, i: usize| {
        let (p, normal) = vertex(i);
        encoder.encode(&window_row(p, normal))
    };
    let encoded: Vec<_> =
        (0..DIFFERENT).into_par_iter().map_init(|| Encoder::new(N, encoding), encode).collect();
    let mut store = RowStore::default();
    (0..vertices).for_each(|v| store.push(&encoded[v % DIFFERENT]));
    let mut asset = Asset::new(Metadata::new("room"));
    let triples = |of: &dyn Fn(usize) -> Vec3| {
        let list: Vec<f32> = (0..vertices).flat_map(|v| of(v).to_array()).collect();
        Data::F32(list.into())
    };
    asset.insert("mesh.position", &[vertices, 3], triples(&|v| vertex(v).0));
    asset.insert("mesh.normal", &[vertices, 3], triples(&|v| vertex(v).1));
    store.insert_into(&mut asset, "portal.0.direct", N).expect("less than 4 GiB");
    let mut frame = PortalFrame::new(&asset).expect("good rows");
    frame.set_shell(0, Shell::new(N, &day()).expect("a shell")).expect("its side");
    direct(name, &frame, vertices);
}

/// Direct rows against a read of what the file holds of them, and of what they are in blocks.
fn direct(name: &str, frame: &PortalFrame, vertices: usize) {
    let mut out = vec![[0.0f32; 3]; vertices];
    for (kind, per_vertex) in
        [("in the file", frame.bytes_per_vertex().0), ("in blocks", frame.direct_bytes_read())]
    {
        let bytes: Vec<u8> = vec![1; (per_vertex * vertices as f32) as usize];
        let times = duel(ROUNDS, || read(&bytes), || frame.direct(0, black_box(&mut out)));
        print(&format!("{name}, {kind}"), times, per_vertex);
    }
}

fn bounced(name: &str, vertices: usize, k: usize) {
    let transfer: Vec<f16> =
        (0..vertices * k).map(|i| f16::from_f32((i % 997) as f32 / 997.0 - 0.4)).collect();
    let bytes = vec![1u8; 2 * transfer.len()];
    let mut out = vec![[0.0f32; 3]; vertices];
    let light = vec![[1.0, 0.5, 0.25]; k];
    let run = |out: &mut [[f32; 3]]| dot::sh_rgb_add(&transfer, &light[..k / 3], out);
    print(name, duel(ROUNDS, || read(&bytes), || run(black_box(&mut out))), 2.0 * k as f32);
}

/// The bytes of the built-in room, everything baked.
fn bake_room() -> Vec<u8> {
    let mut room = builtin::build("box-room:edge=0.082").expect("a built-in scene");
    let portals = take_portals(&mut room, &["glass*".into()]).expect("a window");
    let basis = vec![bake::Basis::Sh, bake::Basis::DirectToIndirect];
    let options = bake::Options {
        basis,
        order: 4,
        indirect_order: 4,
        rays: 256,
        bounces: 9,
        ..bake::Options::default()
    };
    let (baked, _) =
        bake::bake_portals(&room, &portals, &options, &bake::PortalOptions::default(), &bake::Silent)
            .expect("a bake");
    baked.to_bytes().expect("bytes")
}

/// Direct light and links of the room on one core.
fn baked(asset: &Asset) {
    let mut frame = PortalFrame::new(asset).expect("portals");
    frame.set_shell(0, Shell::new(N, &day()).expect("a shell")).expect("its side");
    frame.set_indirect(Indirect::DirectToIndirect).expect("baked");
    let vertices = asset.n_vertices();
    let mut out = vec![[0.0f32; 3]; vertices];
    frame.direct(0, &mut out);
    frame.reflect(&out);
    direct(&format!("direct, the room, {vertices} vertices"), &frame, vertices);
    let bounced = frame.bytes_per_vertex().1;
    let read_bytes = vec![1u8; (bounced * vertices as f32) as usize];
    let times = duel(ROUNDS, || read(&read_bytes), || frame.add_indirect(0, black_box(&mut out)));
    print(&format!("links, the room, {vertices} vertices"), times, bounced);
}

/// Everything on, part by part.
fn frame(asset: &Asset) {
    let mut frame = PortalFrame::new(asset).expect("portals");
    let centre = asset.metadata.shells[1].centre.unwrap_or_default().into();
    let light = sky();
    let (mut texels, mut discs) = (day(), Vec::new());
    let (mut direct, mut bounced) =
        (vec![[0.0f32; 3]; asset.n_vertices()], vec![[0.0f32; 3]; asset.n_vertices()]);
    let threads = rayon::current_num_threads();
    println!("a frame of {} vertices, {threads} threads, everything on, µs", asset.n_vertices());
    let mut total = [0.0; 2];
    let mut time = |name: &str, of: [bool; 2], work: &mut dyn FnMut()| {
        let (least, _) = duel(ROUNDS, work, || {});
        println!("    {name:<40} {:>9.1}", least * 1e6);
        (0..2).filter(|&i| of[i]).for_each(|i| total[i] += least);
    };
    let mut backdrop = Backdrop::new(&light, N).expect("a backdrop");
    time("light projected", [true; 2], &mut || backdrop = Backdrop::new(&light, N).expect("a backdrop"));
    time("shell captured", [true; 2], &mut || {
        capture(&backdrop, None, centre, &mut texels).expect("a shell");
        seen_discs(&backdrop, None, centre, &mut discs);
    });
    time("shell into all bases, and beams", [true; 2], &mut || {
        frame.set_shell_with_discs(0, Shell::new(N, &texels).expect("a shell"), &discs).expect("its side");
    });
    time("direct", [true; 2], &mut || parts(&mut direct, |first, out| frame.direct(first, out)));
    frame.set_indirect(Indirect::DirectToIndirect).expect("baked");
    time("direct to indirect: patches", [true, false], &mut || frame.reflect_parallel(&direct));
    time("direct to indirect: links", [true, false], &mut || {
        parts(&mut bounced, |first, out| frame.add_indirect(first, out));
    });
    frame.set_indirect(Indirect::Sh).expect("baked");
    time("or SH of order 4", [false, true], &mut || {
        parts(&mut bounced, |first, out| frame.add_indirect(first, out));
    });
    println!("    together {:.0}, with SH {:.0}\n", total[0] * 1e6, total[1] * 1e6);
}

fn parts(out: &mut [[f32; 3]], work: impl Fn(usize, &mut [[f32; 3]]) + Sync) {
    let task = 2048;
    out.par_chunks_mut(task).enumerate().for_each(|(i, out)| work(i * task, out));
}

/// An overcast sky.
fn day() -> Vec<[f32; 3]> {
    let mut texels = vec![[0.0; 3]; cubemap::n_texels(N)];
    cubemap::project_light(&Light::new(Source::CieOvercast(CieOvercast::new(Vec3::ONE))), N, &mut texels);
    texels
}

fn sky() -> Light {
    Light::new(Source::Sky(Sky::new(1.0, 0.6, 3.0).expect("a good sky")))
}

fn shell() {
    let (light, mut texels, mut out) = (sky(), day(), day());
    let time = |name: &str, mut work: Box<dyn FnMut() + '_>| {
        let (least, _) = duel(ROUNDS, &mut work, || {});
        println!("{name:<56} {:>9.1}", least * 1e6);
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
    println!("{name:<56} {:>9.1} {:>9.1} {:>6.2} {bytes:>9.0}", read * 1e6, relit * 1e6, relit / read);
}
