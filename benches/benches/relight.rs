//! Relighting against a plain read of the same bytes.
//!
//! A frame of SH relighting reads V n² f16 coefficients and writes V irradiances. The plain read sums the same bytes
//! in wide vectors, by the same threads. Targets: 1 M vertices x 25 coefficients at most 1.5 times the plain read;
//! 14,467 vertices x 25 under 50 µs on one thread.
//!
//!     cargo bench -p lunette-benches --bench relight

use std::hint::black_box;

use half::f16;
use lunette_benches::duel;
use lunette_relight::dot;
use rayon::prelude::*;

const COEFFICIENTS: usize = 25;
const ROUNDS: usize = 40;

fn main() {
    let threads = rayon::current_num_threads();
    println!("{:<34} {:>9} {:>9} {:>6}", "", "read µs", "relit µs", "ratio");
    case("1,000,000 x 25, all threads", 1_000_000, threads);
    case("1,000,000 x 25, one thread", 1_000_000, 1);
    case("14,467 x 25, one thread", 14_467, 1);
    coloured("14,467 x 25 x 3, one thread", 14_467);
    portable("14,467 x 25, one thread, portable", 14_467);
}

fn transfer(values: usize) -> Vec<f16> {
    (0..values).map(|i| f16::from_f32(((i * 7919) % 1000) as f32 / 1000.0 - 0.4)).collect()
}

fn light() -> Vec<[f32; 3]> {
    (0..COEFFICIENTS).map(|i| [1.0 / (i + 1) as f32, 0.5, (i as f32).sin()]).collect()
}

fn case(name: &str, vertices: usize, threads: usize) {
    let (transfer, light) = (transfer(vertices * COEFFICIENTS), light());
    let mut out = vec![[0.0f32; 3]; vertices];
    let times = if threads == 1 {
        duel(ROUNDS, || read(&transfer), || dot::sh(&transfer, &light, black_box(&mut out)))
    } else {
        duel(
            ROUNDS,
            || transfer.par_chunks(1 << 18).for_each(read),
            || dot::sh_parallel(&transfer, &light, black_box(&mut out)),
        )
    };
    print(name, times);
}

fn coloured(name: &str, vertices: usize) {
    let (transfer, light) = (transfer(3 * vertices * COEFFICIENTS), light());
    let mut out = vec![[0.0f32; 3]; vertices];
    print(name, duel(ROUNDS, || read(&transfer), || dot::sh_rgb_add(&transfer, &light, black_box(&mut out))));
}

fn portable(name: &str, vertices: usize) {
    let (transfer, light) = (transfer(vertices * COEFFICIENTS), light());
    let mut out = vec![[0.0f32; 3]; vertices];
    print(
        name,
        duel(ROUNDS, || read(&transfer), || dot::portable::sh(&transfer, &light, black_box(&mut out))),
    );
}

/// Sums the bits in 64 strands, so that memory is the limit and not the adder.
fn read(values: &[f16]) {
    let mut sums = [0u16; 64];
    for chunk in values.chunks_exact(64) {
        for (s, v) in sums.iter_mut().zip(chunk) {
            *s = s.wrapping_add(v.to_bits());
        }
    }
    black_box(sums);
}

fn print(name: &str, (read, relit): (f64, f64)) {
    println!("{name:<34} {:>9.1} {:>9.1} {:>6.2}", read * 1e6, relit * 1e6, relit / read);
}
