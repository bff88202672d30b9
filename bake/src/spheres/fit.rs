//! Balls that fill the inside cells of a grid.

use std::collections::BinaryHeap;

use glam::{IVec3, Vec3};
use lunette_relight::lobe::Sphere;

use super::grid::Grid;

/// Steps of the descent, in cells: from coarse moves to a quarter of a cell.
const STEPS: [f32; 4] = [2.0, 1.0, 0.5, 0.25];
/// Sweeps over all balls for each step; most stop gaining after three.
const SWEEPS: usize = 4;
/// Most rounds of relocation, each with a descent of the finer steps; a rabbit's 64 balls gain nothing after
/// some fifty.
const RELOCATIONS: usize = 200;
/// Medial balls that the greedy step chooses from.
const CANDIDATES: usize = 6000;
/// Smallest ball, in cells.
const LEAST_RADIUS: f32 = 0.6;

/// Balls, in cells, at most `n` of them.
pub fn fit(grid: &Grid, n: usize) -> Vec<Sphere> {
    let depth = distances(grid);
    let candidates = candidates(grid, &depth);
    let mut state = State { grid, covered: vec![0; grid.n_cells()], balls: Vec::new() };
    state.take_greedily(&candidates, n);
    STEPS.iter().for_each(|&step| state.descend(step));
    for _ in 0..RELOCATIONS {
        if !state.relocate(&candidates) {
            break;
        }
        STEPS[1..].iter().for_each(|&step| state.descend(step));
    }
    state.balls
}

/// Volumes outside and missing, over the inside volume, of spheres in metres.
pub fn error(grid: &Grid, spheres: &[Sphere]) -> (f32, f32) {
    let mut state = State { grid, covered: vec![0; grid.n_cells()], balls: Vec::new() };
    spheres.iter().for_each(|sphere| state.add(&grid.to_cells(sphere), 1));
    let (mut outside, mut missing, mut volume) = (0.0, 0.0, 0.0f32);
    for (&inside, &covered) in grid.inside.iter().zip(&state.covered) {
        match (inside, covered > 0) {
            (false, true) => outside += 1.0,
            (true, false) => missing += 1.0,
            _ => {}
        }
        volume += if inside { 1.0 } else { 0.0 };
    }
    (outside / volume, missing / volume)
}

struct State<'a> {
    grid: &'a Grid,
    /// Balls over each cell.
    covered: Vec<u16>,
    balls: Vec<Sphere>,
}

impl State<'_> {
    fn add(&mut self, ball: &Sphere, change: i32) {
        let covered = &mut self.covered;
        cells_in(self.grid, ball, |at| covered[at] = (i32::from(covered[at]) + change) as u16);
    }

    /// Cells that would be right, less those that would be wrong, were this ball added.
    fn gain(&self, ball: &Sphere) -> i64 {
        let mut gain = 0;
        cells_in(self.grid, ball, |at| {
            if self.covered[at] == 0 {
                gain += if self.grid.inside[at] { 1 } else { -1 };
            }
        });
        gain
    }

    /// Lazy greedy: a gain worked out earlier is an upper bound.
    fn take_greedily(&mut self, candidates: &[Sphere], n: usize) {
        let mut queue: BinaryHeap<(i64, usize)> =
            candidates.iter().enumerate().map(|(k, ball)| (self.gain(ball), k)).collect();
        while self.balls.len() < n {
            let Some((bound, k)) = queue.pop().filter(|top| top.0 > 0) else { break };
            let gain = self.gain(&candidates[k]);
            if gain == bound || queue.peek().is_none_or(|next| gain >= next.0) {
                self.add(&candidates[k], 1);
                self.balls.push(candidates[k]);
            } else {
                queue.push((gain, k));
            }
        }
    }

    fn descend(&mut self, step: f32) {
        for _ in 0..SWEEPS {
            let moved = (0..self.balls.len()).filter(|&k| self.improve(k, step)).count();
            if moved == 0 {
                break;
            }
        }
    }

    /// Tries a step of the centre along each axis, of the radius, and of both; keeps the best.
    fn improve(&mut self, k: usize, step: f32) -> bool {
        let ball = self.balls[k];
        self.add(&ball, -1);
        let mut best = (self.gain(&ball), ball);
        for direction in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z, Vec3::ZERO] {
            for growth in [-step, 0.0, step] {
                let centre = ball.centre + direction * step;
                let moved = Sphere { centre, radius: (ball.radius + growth).max(LEAST_RADIUS) };
                let gain = self.gain(&moved);
                if gain > best.0 {
                    best = (gain, moved);
                }
            }
        }
        self.add(&best.1, 1);
        self.balls[k] = best.1;
        best.1 != ball
    }

    /// Puts the ball that gives least where most is missing.
    fn relocate(&mut self, candidates: &[Sphere]) -> bool {
        let worth = |k: usize| {
            let mut worth = 0i64;
            cells_in(self.grid, &self.balls[k], |at| {
                if self.covered[at] == 1 {
                    worth += if self.grid.inside[at] { 1 } else { -1 };
                }
            });
            worth
        };
        let Some((least, k)) = (0..self.balls.len()).map(|k| (worth(k), k)).min() else { return false };
        let best = candidates.iter().map(|ball| self.gain(ball)).enumerate().max_by_key(|(_, gain)| *gain);
        let Some((at, gain)) = best.filter(|(_, gain)| *gain > least) else { return false };
        let old = self.balls[k];
        self.add(&old, -1);
        // Without the old ball the new one gains at least as much as with it.
        debug_assert!(self.gain(&candidates[at]) >= gain);
        self.add(&candidates[at], 1);
        self.balls[k] = candidates[at];
        true
    }
}

/// Calls back for every cell whose middle is in the ball.
fn cells_in(grid: &Grid, ball: &Sphere, mut each: impl FnMut(usize)) {
    let size = grid.size.as_ivec3();
    let low = (ball.centre - ball.radius - 0.5).ceil().as_ivec3().max(IVec3::ZERO);
    let high = (ball.centre + ball.radius - 0.5).floor().as_ivec3().min(size - 1);
    for z in low.z..=high.z {
        for y in low.y..=high.y {
            let across = Vec3::new(0.0, y as f32 + 0.5, z as f32 + 0.5) - ball.centre.with_x(0.0);
            let left = ball.radius * ball.radius - across.length_squared();
            if left < 0.0 {
                continue;
            }
            let half = left.sqrt();
            let from = ((ball.centre.x - half - 0.5).ceil() as i32).max(0);
            let to = ((ball.centre.x + half - 0.5).floor() as i32).min(size.x - 1);
            let row = grid.at(IVec3::new(0, y, z));
            (from..=to).for_each(|x| each(row + x as usize));
        }
    }
}

/// The largest balls around inside cells: those deepest among their neighbours, and an even share of the others.
fn candidates(grid: &Grid, depth: &[f32]) -> Vec<Sphere> {
    let inside: Vec<usize> = (0..grid.n_cells()).filter(|&at| grid.inside[at]).collect();
    let stride = inside.len().div_ceil(CANDIDATES).max(1);
    let deepest = |at: usize| {
        let cell = grid.cell_of(at);
        let around = (0..27).map(|k| cell + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
        around.map(|c| depth[grid.at(c)]).all(|d| d <= depth[at])
    };
    let chosen = inside.iter().enumerate().filter(|&(k, &at)| k % stride == 0 || deepest(at));
    let ball = |(_, &at): (usize, &usize)| {
        let centre = grid.cell_of(at).as_vec3() + 0.5;
        // Depth is to the middle of the first outside cell; the surface is half a cell before.
        Sphere { centre, radius: (depth[at] - 0.5).max(LEAST_RADIUS) }
    };
    chosen.map(ball).collect()
}

/// Distance of every cell from the nearest outside cell, in cells, exact.
///
/// Based on: Felzenszwalb and Huttenlocher, Distance transforms of sampled functions, 2012.
fn distances(grid: &Grid) -> Vec<f32> {
    let far = (grid.size.length_squared()) as f32;
    let mut squared: Vec<f32> = grid.inside.iter().map(|&inside| if inside { far } else { 0.0 }).collect();
    let strides = [1, grid.size.x as usize, (grid.size.x * grid.size.y) as usize];
    for axis in 0..3 {
        let n = grid.size[axis] as usize;
        let mut line = vec![0.0; n];
        for first in (0..grid.n_cells()).filter(|&at| grid.cell_of(at)[axis] == 0) {
            (0..n).for_each(|k| line[k] = squared[first + k * strides[axis]]);
            let out = lower_envelope(&line);
            (0..n).for_each(|k| squared[first + k * strides[axis]] = out[k]);
        }
    }
    squared.into_iter().map(f32::sqrt).collect()
}

/// min over j of (i - j)² + f(j), for every i.
fn lower_envelope(f: &[f32]) -> Vec<f32> {
    let mut hull: Vec<(usize, f32)> = Vec::with_capacity(f.len());
    for j in 0..f.len() {
        let meets = |k: usize| {
            let (j, k) = (j as f32, k as f32);
            ((f[j as usize] + j * j) - (f[k as usize] + k * k)) / (2.0 * (j - k))
        };
        while hull.last().is_some_and(|&(k, from)| meets(k) <= from) {
            hull.pop();
        }
        let from = hull.last().map_or(f32::NEG_INFINITY, |&(k, _)| meets(k));
        hull.push((j, from));
    }
    let mut at = 0;
    let nearest = |i: usize| {
        while at + 1 < hull.len() && hull[at + 1].1 < i as f32 {
            at += 1;
        }
        let j = hull[at].0;
        (i as f32 - j as f32).powi(2) + f[j]
    };
    (0..f.len()).map(nearest).collect()
}
