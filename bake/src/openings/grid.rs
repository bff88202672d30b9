//! The space in and around the interior as cells, and which of them see each other.
//!
//! Every cell is linked to its 26 neighbours where nothing solid is between their middles, so that walls without
//! thickness part cells as well as thick ones. Of each pair of opposite directions one is kept. The scene stands on
//! solid ground: hollow walls and floors are often left open below.

use glam::Vec3;
use lunette_scenes::Scene;
use rayon::prelude::*;

use super::Options;
use super::rays::{Rays, View, sphere};
use crate::sampling::hash;
use crate::{Error, LANES, Progress};

/// Nothing solid is between two cells.
pub(super) const FREE: u8 = 1;
/// Glass is between two cells.
pub(super) const GLASS: u8 = 2;

/// Half of the neighbours; the other half are their opposites.
pub(super) const N_HALF: usize = 13;
#[rustfmt::skip]
pub(super) const STEPS: [[i32; 3]; N_HALF] = [
    [1, 0, 0], [0, 1, 0], [0, 0, 1],
    [1, 1, 0], [1, -1, 0], [1, 0, 1], [1, 0, -1], [0, 1, 1], [0, 1, -1],
    [1, 1, 1], [1, 1, -1], [1, -1, 1], [1, -1, -1],
];

/// A ray set of a point: enough that a window of a hundredth of the sphere is not missed.
const SPHERE_RAYS: usize = 64;

/// Points on surfaces that are asked where the inside is.
const SURFACE_POINTS: usize = 8192;

/// Where fewer rays than this escape, a point may be inside, for the sake of the grid's size.
const MAYBE_INSIDE: f32 = 0.25;

/// Cells around what may be inside, on each side.
const MARGIN: f32 = 3.0;

/// Cells lower than this over the ground, in cells, count as ground: outer walls seldom end at exactly one height.
const SILL: f32 = 0.1;

/// How far, in cells, each cell's middle is moved at random along each axis, so that no wall passes through the middles
/// of a whole layer.
const JITTER: f32 = 0.15;

/// Edge of a cell where nobody asks for another, metres: panes between bars are seldom narrower. With the least number
/// of cells for small models, and the most for large ones or those in centimetres.
const USUAL_CELL: f32 = 0.15;
const USUAL_CELLS: [usize; 2] = [300_000, 1_000_000];

/// Cubes of space.
pub(super) struct Grid {
    /// Middle of the first cell.
    pub low: Vec3,
    /// Edge of a cell, metres.
    pub size: f32,
    /// Cells along x, y and z.
    pub n: [usize; 3],
    /// By cell and step: [`FREE`], [`GLASS`], or 0 where something solid is between.
    pub link: Vec<[u8; N_HALF]>,
    /// By cell.
    pub view: Vec<View>,
    /// Edge of a cube of the size of the region that may be inside, metres.
    pub extent: f32,
    /// Height of the ground, the scene's lowest point, metres.
    pub ground: f32,
    seed: u64,
}

impl Grid {
    /// # Errors
    /// When `progress` asks to stop. `None` where nothing can be inside.
    pub fn new(
        scene: &Scene,
        rays: &Rays,
        options: &Options,
        progress: &dyn Progress,
    ) -> Result<Option<Grid>, Error> {
        let Some((low, high)) = region(scene, rays, options.seed) else { return Ok(None) };
        let volume = (high - low).max(Vec3::splat(1e-3 * (high - low).max_element()));
        let cubic_metres = f64::from(volume.x) * f64::from(volume.y) * f64::from(volume.z);
        let cells = options.cells.unwrap_or_else(|| usual_cells(cubic_metres));
        let size = (cubic_metres / cells as f64).cbrt() as f32;
        let low = low - MARGIN * size;
        let n = ((high - low) / size + MARGIN).to_array().map(|n| n.ceil() as usize);
        let extent = size * (cells as f32).cbrt();
        let ground = scene.mesh.bounds().0.y;
        let mut grid =
            Grid { low, size, n, link: Vec::new(), view: Vec::new(), extent, ground, seed: options.seed };
        grid.trace(rays, progress)?;
        Ok(Some(grid))
    }

    /// Layer by layer.
    fn trace(&mut self, rays: &Rays, progress: &dyn Progress) -> Result<(), Error> {
        let directions = sphere(SPHERE_RAYS);
        let layer = self.n[0] * self.n[1];
        let total = (layer * self.n[2] * (SPHERE_RAYS + N_HALF)) as u64;
        for z in 0..self.n[2] {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let cells = z * layer..(z + 1) * layer;
            let traced: Vec<_> = cells
                .into_par_iter()
                .map(|cell| (self.links(rays, cell), rays.view(self.middle(cell), &directions)))
                .collect();
            self.link.extend(traced.iter().map(|t| t.0));
            self.view.extend(traced.iter().map(|t| t.1));
            progress.report("inside and outside", total / self.n[2] as u64 * (z as u64 + 1), total);
        }
        Ok(())
    }

    fn links(&self, rays: &Rays, cell: usize) -> [u8; N_HALF] {
        let from = self.middle(cell);
        let mut segments = [(from, from); LANES];
        let mut n = 0;
        let above = |c: &usize| self.middle(*c).y > self.ground + SILL * self.size;
        let there = STEPS.map(|step| self.neighbour(cell, step).filter(above).filter(|_| above(&cell)));
        for next in there.iter().flatten() {
            segments[n].1 = self.middle(*next);
            n += 1;
        }
        let free = rays.clear_each(&segments[..n]);
        let mut at = 0;
        there.map(|next| {
            if next.is_none() {
                return 0;
            }
            at += 1;
            match free[at - 1] {
                (false, _) => 0,
                (true, false) => FREE | GLASS,
                (true, true) => FREE,
            }
        })
    }

    /// Middle of a cell.
    pub fn middle(&self, cell: usize) -> Vec3 {
        let random = hash(self.seed, cell as u64);
        let part = |axis: usize| {
            let moved = JITTER * ((random >> (20 * axis) & 0xfffff) as f32 / 524_288.0 - 1.0);
            self.place(cell)[axis] as f32 + moved
        };
        self.low + self.size * Vec3::new(part(0), part(1), part(2))
    }

    fn place(&self, cell: usize) -> [usize; 3] {
        [cell % self.n[0], cell / self.n[0] % self.n[1], cell / self.n[0] / self.n[1]]
    }

    /// The cell a step away, if it is in the grid.
    pub fn neighbour(&self, cell: usize, step: [i32; 3]) -> Option<usize> {
        let place = self.place(cell);
        let mut to = [0; 3];
        for axis in 0..3 {
            to[axis] = place[axis].checked_add_signed(step[axis] as isize).filter(|&i| i < self.n[axis])?;
        }
        Some((to[2] * self.n[1] + to[1]) * self.n[0] + to[0])
    }

    /// How much the number of a cell grows with a step in each of the 26 directions, those from [`N_HALF`] on being
    /// opposites.
    pub fn strides(&self) -> [isize; 2 * N_HALF] {
        let [nx, ny] = [self.n[0], self.n[1]].map(|n| n as isize);
        std::array::from_fn(|d| {
            let [x, y, z] = STEPS[d % N_HALF].map(|s| if d < N_HALF { s as isize } else { -s as isize });
            (z * ny + y) * nx + x
        })
    }

    /// The neighbour in one of those directions, and the link to it.
    pub fn step(&self, cell: usize, direction: usize) -> Option<(usize, u8)> {
        let half = direction % N_HALF;
        if direction < N_HALF {
            return Some((self.neighbour(cell, STEPS[half])?, self.link[cell][half]));
        }
        let next = self.neighbour(cell, STEPS[half].map(|s| -s))?;
        Some((next, self.link[next][half]))
    }

    /// Whether a cell has no neighbour on some side.
    pub fn on_border(&self, cell: usize) -> bool {
        let place = self.place(cell);
        (0..3).any(|axis| place[axis] == 0 || place[axis] + 1 == self.n[axis])
    }

    /// Cells whose middles are within one and a half cells of a point along each axis.
    pub fn around(&self, p: Vec3) -> impl Iterator<Item = usize> + '_ {
        let at = ((p - self.low) / self.size).round();
        let steps =
            (0..27).map(|i: i32| Vec3::new((i % 3 - 1) as f32, (i / 3 % 3 - 1) as f32, (i / 9 - 1) as f32));
        steps.filter_map(move |step| {
            let q = (at + step).to_array();
            let inside = (0..3).all(|axis| q[axis] >= 0.0 && q[axis] < self.n[axis] as f32);
            let [x, y, z] = q.map(|c| c as usize);
            inside.then_some((z * self.n[1] + y) * self.n[0] + x)
        })
    }
}

/// Cells of [`USUAL_CELL`], within the limits of what takes seconds.
fn usual_cells(cubic_metres: f64) -> usize {
    let [low, high] = USUAL_CELLS;
    ((cubic_metres / f64::from(USUAL_CELL).powi(3)) as usize).clamp(low, high)
}

/// A box around the points on surfaces from which few rays escape, half of them spread by triangles and half by
/// area: neither a ground that reaches to the horizon nor a finely made chair then hides the rest.
fn region(scene: &Scene, rays: &Rays, seed: u64) -> Option<(Vec3, Vec3)> {
    let mesh = &scene.mesh;
    let corners = |t: usize| mesh.index[t].map(|v| mesh.position[v as usize]);
    let area = |t: usize| {
        let [a, b, c] = corners(t);
        (b - a).cross(c - a).length()
    };
    let sums: Vec<f64> = (0..mesh.index.len())
        .scan(0.0, |sum, t| {
            *sum += f64::from(area(t));
            Some(*sum)
        })
        .collect();
    let (low, high) = mesh.bounds();
    let lift = 1e-4 * (high - low).length();
    let directions = sphere(SPHERE_RAYS);
    let point = |i: usize| {
        let random = |k: u64| (hash(seed, 4 * i as u64 + k) >> 40) as f32 / (1u64 << 24) as f32;
        let total = sums.last()?;
        let by_area = sums.partition_point(|s| *s <= f64::from(random(0)) * total);
        let by_number = (random(0) * mesh.index.len() as f32) as usize;
        let t = if i.is_multiple_of(2) { by_area } else { by_number }.min(mesh.index.len() - 1);
        let [a, b, c] = corners(t);
        let (r, s) = (random(1).sqrt(), random(2));
        let p = a * (1.0 - r) + b * (r * (1.0 - s)) + c * (r * s);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let inside = |p: Vec3| rays.view(p, &directions).empty < MAYBE_INSIDE;
        (inside(p + lift * normal) || inside(p - lift * normal)).then_some(p)
    };
    let inside: Vec<Vec3> = (0..SURFACE_POINTS).into_par_iter().filter_map(point).collect();
    let first = *inside.first()?;
    Some(inside.iter().fold((first, first), |(low, high), &p| (low.min(p), high.max(p))))
}
