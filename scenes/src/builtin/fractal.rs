//! Fractal mountains, worn by rivers.
//!
//! The large forms come from [`erosion`](super::erosion), always on the same grid, so that the same seed gives the
//! same mountains at every resolution; they are drawn through that grid's heights by cubic splines. On finer grids,
//! octaves of value noise go on from there down to the spacing asked for, each with `roughness` times the amplitude of
//! the last one.
//!
//! It breaks where fine detail is looked at closely: it is noise, without drainage of its own.

use glam::{Mat2, Vec2, vec2};

use super::erosion::{self, FINE};
use super::spec::Values;
use crate::Scene;
use crate::terrain::{Heights, heights_to_scene};

/// Height of the widest octave of detail over the relief of the whole: about a tenth of what two cells of the eroded
/// grid differ by.
const DETAIL: f32 = 0.006;

/// Turn between octaves, cos and sin of 36.87 degrees, so that their lattices do not line up.
pub const TURN: [f32; 2] = [0.8, 0.6];

pub fn terrain(values: &Values) -> Result<Scene, String> {
    let n = values.count("n");
    let spacing = f64::from(values.get("size")) / (n - 1) as f64;
    let (roughness, seed) = (values.get("roughness"), values.count("seed") as u32);
    let mut mountains = erosion::mountains(roughness, seed);
    stretch(&mut mountains, 1.0);
    let octaves = ((n - 1) as f32 / (FINE - 1) as f32).log2().max(0.0).floor() as u32;
    let mut height = vec![0.0; n * n];
    // Rows are independent of each other, so threads do not change the result.
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let rows = n.div_ceil(threads);
    std::thread::scope(|scope| {
        for (band, part) in height.chunks_mut(rows * n).enumerate() {
            let mountains = &mountains;
            scope.spawn(move || {
                for (i, h) in part.iter_mut().enumerate() {
                    let (row, column) = (band * rows + i / n, i % n);
                    let at = vec2(column as f32, row as f32) * ((FINE - 1) as f32 / (n - 1) as f32);
                    *h = cubic(mountains, at) + detail(at, octaves, roughness, seed);
                }
            });
        }
    });
    stretch(&mut height, values.get("height"));
    heights_to_scene(Heights::new(n, n, [spacing; 2], height)).map_err(|e| e.to_string())
}

/// Catmull-Rom spline through the eroded heights, `at` in its cells.
fn cubic(height: &[f32], at: Vec2) -> f32 {
    let corner = at.floor().min(Vec2::splat((FINE - 2) as f32));
    let f = at - corner;
    let (x, y) = (corner.x as isize, corner.y as isize);
    let (wx, wy) = (spline(f.x), spline(f.y));
    let inside = |c: isize| c.clamp(0, FINE as isize - 1) as usize;
    let row = |j: usize| {
        let start = inside(y + j as isize - 1) * FINE;
        (0..4).map(|i| wx[i] * height[start + inside(x + i as isize - 1)]).sum::<f32>()
    };
    (0..4).map(|j| wy[j] * row(j)).sum()
}

/// Weights of the four points around.
fn spline(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * (t3 - t2)]
}

/// What is finer than the eroded grid.
fn detail(at: Vec2, octaves: u32, roughness: f32, seed: u32) -> f32 {
    let turn = Mat2::from_cols(vec2(TURN[0], TURN[1]), vec2(-TURN[1], TURN[0]));
    let (mut p, mut amplitude, mut sum) = (turn * at, DETAIL, 0.0);
    for octave in 0..octaves {
        sum += amplitude * (noise(p, seed.wrapping_add(octave * 0x85eb)) - 0.5);
        amplitude *= roughness;
        p = 2.0 * (turn * p);
    }
    sum
}

/// Value noise in 0..=1, quintic between lattice points.
pub fn noise(p: Vec2, seed: u32) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let w = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let (x, y) = (cell.x as i32, cell.y as i32);
    let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| lattice(x + i, y + j, seed));
    a + (b - a) * w.x + (c - a) * w.y + (a - b - c + d) * w.x * w.y
}

/// A number in 0..1 for a lattice point: an integer hash (Wellons' lowbias32 constants).
pub fn lattice(x: i32, y: i32, seed: u32) -> f32 {
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
