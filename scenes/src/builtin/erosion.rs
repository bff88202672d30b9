//! Ground that rises and is worn down by rivers: a drainage network with ridges between its branches.
//!
//! The height h of each cell follows dh/dt = U - K √A |∇h| + D ∇²h: uplift U, a river's cut with the catchment A
//! above it, and the creep of soil. The domain is the unit square, its border stays at height 0, and units of height
//! and time are free: only the shape counts. Each step floods the hollows from the border inwards (which orders the
//! cells from mouth to source), sums catchments upstream, and solves the river's cut implicitly along that order.
//!
//! Based on: Braun & Willett, A Very Efficient O(n), Implicit and Parallel Method to Solve the Stream Power Equation,
//! 2013; Barnes, Lehman & Mulla, Priority-Flood, 2014; Cordonnier et al., Large Scale Terrain Generation from
//! Tectonic Uplift and Fluvial Erosion, 2016. It breaks where lakes, glaciers or layers of rock are asked for.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::fractal::{TURN, lattice, noise};
use glam::{Mat2, Vec2, vec2};

/// Cells along a side: the rivers find their way on the coarse grid, their side valleys on the fine one.
const COARSE: usize = 129;
/// Cells along a side of the result.
pub const FINE: usize = 2 * COARSE - 1;

/// Steps on either grid: more change little that the eye can see.
const COARSE_STEPS: usize = 60;
const FINE_STEPS: usize = 20;

/// K, D and the time step: rivers cut to the border within the steps above, and creep rounds two cells of a ridge.
const CUT: f32 = 4.0;
const CREEP: f32 = 3.5e-4;
const TIME_STEP: f32 = 0.05;

/// Massifs along a side.
const MASSIFS: f32 = 2.6;
/// Octaves of noise in the uplift.
const UPLIFT_OCTAVES: u32 = 4;

/// Height of the noise that the rivers start on, and that hides the seams of the refined grid.
const FIRST_NOISE: f32 = 0.3;
const REFINED_NOISE: f32 = 6e-4;

/// The eight neighbours.
const AROUND: [(i32, i32); 8] = [(0, -1), (-1, 0), (1, 0), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];

/// Heights of [`FINE`]² cells, row by row, 0 at the border. `roughness` is what each octave of the uplift keeps of
/// the last one.
pub fn mountains(roughness: f32, seed: u32) -> Vec<f32> {
    let mut coarse = Ground::new(COARSE, vec![0.0; COARSE * COARSE], roughness, seed);
    coarse.shake(FIRST_NOISE, seed);
    (0..COARSE_STEPS).for_each(|_| coarse.step());
    let mut fine = Ground::new(FINE, refined(&coarse), roughness, seed);
    fine.shake(REFINED_NOISE, seed);
    (0..FINE_STEPS).for_each(|_| fine.step());
    fine.height
}

/// A square of ground on its way.
struct Ground {
    n: usize,
    height: Vec<f32>,
    uplift: Vec<f32>,
    seed: u32,
    /// Height of the water that would stand in every hollow.
    flooded: Vec<f32>,
    /// Cells from mouth to source.
    order: Vec<usize>,
    /// The cell that each one drains into; border cells drain into themselves.
    drain: Vec<usize>,
    catchment: Vec<f32>,
}

impl Ground {
    fn new(n: usize, height: Vec<f32>, roughness: f32, seed: u32) -> Ground {
        let uplift = (0..n * n).map(|i| uplift(place(i, n), roughness, seed)).collect();
        let (flooded, catchment) = (vec![0.0; n * n], vec![0.0; n * n]);
        Ground { n, height, uplift, seed, flooded, order: Vec::new(), drain: Vec::new(), catchment }
    }

    fn step(&mut self) {
        self.flood();
        self.choose_drains();
        self.collect();
        self.cut();
        self.creep();
    }

    /// Adds a little noise inside of the border.
    fn shake(&mut self, amplitude: f32, seed: u32) {
        for i in self.inner() {
            self.height[i] += amplitude * lattice((i % self.n) as i32, (i / self.n) as i32, seed);
        }
    }

    /// Fills `order`, `flooded` and a first `drain`: water rises from the border over the lowest pass.
    fn flood(&mut self) {
        let n = self.n;
        self.order.clear();
        self.drain = vec![usize::MAX; n * n];
        // Heights are not negative, so their bits sort as they do.
        let mut front = BinaryHeap::new();
        for i in (0..n * n).filter(|&i| is_border(i, n)) {
            self.drain[i] = i;
            front.push(Reverse((self.height[i].to_bits(), i)));
        }
        while let Some(Reverse((level, i))) = front.pop() {
            self.order.push(i);
            self.flooded[i] = f32::from_bits(level);
            for (_, j) in neighbours(i, n) {
                if self.drain[j] == usize::MAX {
                    self.drain[j] = i;
                    // One bit higher, so that flooded ground still slopes to its outlet.
                    front.push(Reverse((self.height[j].to_bits().max(level + 1), j)));
                }
            }
        }
    }

    /// Water takes the steepest way down; a fixed whim of each way keeps rivers off the lines of the grid.
    fn choose_drains(&mut self) {
        let n = self.n;
        for i in self.inner() {
            let (x, y) = ((i % n) as i32, (i / n) as i32);
            let mut steepest = 0.0;
            for ((dx, dy), j) in neighbours(i, n) {
                let whim = 0.6 + 0.8 * lattice(2 * x + dx, 2 * y + dy, self.seed);
                let slope = whim * (self.flooded[i] - self.flooded[j]) / length(dx, dy);
                if slope > steepest {
                    (steepest, self.drain[i]) = (slope, j);
                }
            }
        }
    }

    /// Sums each cell's area into all cells below it.
    fn collect(&mut self) {
        let cell = cell(self.n);
        self.catchment.fill(cell * cell);
        for &i in self.order.iter().rev() {
            let below = self.drain[i];
            if below != i {
                self.catchment[below] += self.catchment[i];
            }
        }
    }

    /// Uplift and the river's cut, implicit in time: h' = (h + U dt + f h'_below) / (1 + f), f = K √A dt / distance.
    fn cut(&mut self) {
        let (n, cell) = (self.n, cell(self.n));
        for &i in &self.order {
            let below = self.drain[i];
            if below == i {
                continue;
            }
            let (dx, dy) = ((i % n).abs_diff(below % n) as i32, (i / n).abs_diff(below / n) as i32);
            let f = CUT * TIME_STEP * self.catchment[i].sqrt() / (cell * length(dx, dy));
            let raised = self.height[i] + TIME_STEP * self.uplift[i];
            // The floor of a lake lies under its outlet: nothing is cut there, and nothing filled.
            self.height[i] = ((raised + f * self.height[below]) / (1.0 + f)).min(raised);
        }
    }

    /// Soil moves from humps to hollows, explicitly: the factor stays under the stable 1/4.
    fn creep(&mut self) {
        let (n, cell) = (self.n, cell(self.n));
        let factor = (CREEP * TIME_STEP / (cell * cell)).min(0.2);
        let old = self.height.clone();
        for i in self.inner() {
            self.height[i] += factor * (old[i - 1] + old[i + 1] + old[i - n] + old[i + n] - 4.0 * old[i]);
        }
    }

    /// All cells but those of the border.
    fn inner(&self) -> impl Iterator<Item = usize> + use<> {
        let n = self.n;
        (0..n * n).filter(move |&i| !is_border(i, n))
    }
}

/// Massifs: octaves of noise about a mean, never sinking.
fn uplift(at: Vec2, roughness: f32, seed: u32) -> f32 {
    let turn = Mat2::from_cols(vec2(TURN[0], TURN[1]), vec2(-TURN[1], TURN[0]));
    let (mut p, mut amplitude, mut sum) = (MASSIFS * at, 1.0, 0.0);
    for octave in 0..UPLIFT_OCTAVES {
        sum += amplitude * (2.0 * noise(p, seed.wrapping_add(octave * 0x9e37)) - 1.0);
        amplitude *= roughness;
        p = 2.0 * (turn * p);
    }
    (0.55 + 0.9 * sum).clamp(0.05, 1.5)
}

/// The same ground with a cell between every two.
fn refined(ground: &Ground) -> Vec<f32> {
    let at = |x: usize, y: usize| ground.height[y * ground.n + x];
    let between = |i: usize| {
        let (x, y) = (i % FINE, i / FINE);
        let ([x0, x1], [y0, y1]) = ([x / 2, x.div_ceil(2)], [y / 2, y.div_ceil(2)]);
        0.25 * (at(x0, y0) + at(x1, y0) + at(x0, y1) + at(x1, y1))
    };
    (0..FINE * FINE).map(between).collect()
}

/// The neighbours of a cell that are on the map, with the way to them.
fn neighbours(i: usize, n: usize) -> impl Iterator<Item = ((i32, i32), usize)> {
    let (x, y) = ((i % n) as i32, (i / n) as i32);
    let inside = move |c: i32| (0..n as i32).contains(&c);
    AROUND
        .into_iter()
        .filter(move |(dx, dy)| inside(x + dx) && inside(y + dy))
        .map(move |(dx, dy)| ((dx, dy), (y + dy) as usize * n + (x + dx) as usize))
}

fn is_border(i: usize, n: usize) -> bool {
    let (x, y) = (i % n, i / n);
    x == 0 || y == 0 || x == n - 1 || y == n - 1
}

fn length(dx: i32, dy: i32) -> f32 {
    ((dx * dx + dy * dy) as f32).sqrt()
}

/// Side of a cell.
fn cell(n: usize) -> f32 {
    1.0 / (n - 1) as f32
}

/// Of a cell, in the unit square.
fn place(i: usize, n: usize) -> Vec2 {
    cell(n) * vec2((i % n) as f32, (i / n) as f32)
}
