//! Fractal mountains.
//!
//! Octaves of gradient-aware value noise: each octave adds `a n / (1 + |d|²)`, with `n` the noise, `a` its
//! amplitude and `d` the slope summed so far, so that steep ground stays smooth and flat ground grows detail, as
//! erosion has it; the two widest octaves are folded into ridges. Octaves go on down to the spacing of the grid.
//!
//! Based on: Quilez, Morenoise, 2008 (slope damping); Musgrave, Kolb & Mace, The Synthesis and Rendering of
//! Eroded Fractal Terrains, 1989 (ridges). It breaks where true drainage is asked for: no rivers.

use glam::{Mat2, Vec2, vec2};

use super::spec::Values;
use crate::Scene;
use crate::terrain::{Heights, heights_to_scene};

/// Widest features: this many over the side of the terrain.
const WIDEST: f32 = 2.3;

/// How many octaves are folded into ridges.
const RIDGED: usize = 2;

/// Turn between octaves, cos and sin of 36.87 degrees, so that their lattices do not line up.
const TURN: [f32; 2] = [0.8, 0.6];

pub fn terrain(values: &Values) -> Result<Scene, String> {
    let n = values.count("n");
    let spacing = f64::from(values.get("size")) / (n - 1) as f64;
    let mut height = vec![0.0; n * n];
    let (roughness, seed) = (values.get("roughness"), values.count("seed") as u32);
    let octaves = (((n - 1) as f32 / WIDEST).log2().floor() as usize).max(1);
    // Rows are independent of each other, so threads do not change the result.
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let rows = n.div_ceil(threads);
    std::thread::scope(|scope| {
        for (band, part) in height.chunks_mut(rows * n).enumerate() {
            scope.spawn(move || {
                for (i, h) in part.iter_mut().enumerate() {
                    let (row, column) = (band * rows + i / n, i % n);
                    let at = vec2(column as f32, row as f32) * (WIDEST / (n - 1) as f32);
                    *h = mountain(at, octaves, roughness, seed);
                }
            });
        }
    });
    stretch(&mut height, values.get("height"));
    heights_to_scene(Heights::new(n, n, [spacing; 2], height)).map_err(|e| e.to_string())
}

/// Relative height at a point, features of size 1 being the widest.
fn mountain(at: Vec2, octaves: usize, roughness: f32, seed: u32) -> f32 {
    let turn = Mat2::from_cols(vec2(TURN[0], TURN[1]), vec2(-TURN[1], TURN[0]));
    let (mut p, mut height, mut slope, mut amplitude) = (at, 0.0, Vec2::ZERO, 1.0);
    for octave in 0..octaves {
        let (mut value, gradient) = noise(p, seed.wrapping_add(octave as u32 * 0x9e37));
        if octave < RIDGED {
            // Folded at its middle, with the fold on top: a ridge. The slope stays that of the unfolded noise, which
            // does not jump at the fold.
            value = 1.0 - (2.0 * value - 1.0).abs();
        }
        slope += amplitude * gradient;
        height += amplitude * value / (1.0 + slope.length_squared());
        amplitude *= roughness;
        p = 2.0 * (turn * p);
    }
    height
}

/// Value noise in 0..=1 with its gradient, quintic between lattice points.
fn noise(p: Vec2, seed: u32) -> (f32, Vec2) {
    let cell = p.floor();
    let f = p - cell;
    let w = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let dw = 30.0 * f * f * (f * (f - 2.0) + 1.0);
    let (x, y) = (cell.x as i32, cell.y as i32);
    let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| lattice(x + i, y + j, seed));
    let twist = a - b - c + d;
    let value = a + (b - a) * w.x + (c - a) * w.y + twist * w.x * w.y;
    (value, dw * vec2(b - a + twist * w.y, c - a + twist * w.x))
}

/// A number in 0..1 for a lattice point: an integer hash (Wellons' lowbias32 constants).
fn lattice(x: i32, y: i32, seed: u32) -> f32 {
    let mut h = (x as u32).wrapping_mul(0x85eb_ca6b) ^ (y as u32).wrapping_mul(0xc2b2_ae35) ^ seed;
    h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    h ^= h >> 16;
    // The upper 24 bits are what an f32 holds exactly.
    (h >> 8) as f32 / 16_777_216.0
}

/// To heights from 0 to `top`.
fn stretch(height: &mut [f32], top: f32) {
    let (lo, hi) = height.iter().fold((f32::MAX, f32::MIN), |(lo, hi), &h| (lo.min(h), hi.max(h)));
    let scale = if hi > lo { top / (hi - lo) } else { 0.0 };
    height.iter_mut().for_each(|h| *h = (*h - lo) * scale);
}
