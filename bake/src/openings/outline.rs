//! From cut links to the flat polygon of a hole.
//!
//! In a plane near the hole a point is *open* where a short straight line through it, along the plane's normal,
//! meets nothing and leads from the inside to the outside. Around the open points lies the rim: where the wall's outer
//! face is there, measured by rays, moves and tilts the plane into it. Then the border of the open points is followed
//! ([`raster`](super::raster)). Glass closes a hole: a pane is a portal of its own.
//!
//! Where it breaks: a hole that is not flat gets the flat polygon that its rim lies nearest to.

use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;

use super::cut::{CutLink, Side};
use super::grid::Grid;
use super::raster::{HALVINGS, Plane, Raster};
use super::rays::Rays;

/// Half the length of the lines at first, in cells: the cut lies within a cell of the hole.
const REACH: f32 = 1.5;
/// And in the end, when the plane lies in the wall: things near the hole are then no longer in the way.
const NEAR: f32 = 0.1;

/// Rounds of finding the rim and moving the plane; the last ones change nothing on a flat wall.
const ROUNDS: usize = 3;

/// A round whose plane has so much less of the hole open went astray.
const LEAST_KEPT: f32 = 0.9;

/// Samples to a cell and along the longest side of a hole.
const SAMPLES_PER_CELL: f32 = 4.0;
const MOST_SAMPLES: f32 = 160.0;

/// Most by which one round tilts the plane, as a tangent.
const MOST_TILT: f32 = 0.3;

/// What is asked about points.
pub(super) struct Space<'a> {
    pub rays: &'a Rays,
    pub grid: &'a Grid,
    pub sides: &'a [Side],
}

impl Space<'_> {
    /// Whether a point sees the middle of a cell of that side near it.
    pub fn is_on(&self, p: Vec3, side: Side) -> bool {
        let seen = |c: usize| self.sides[c] == side && self.rays.empty(p, self.grid.middle(c));
        self.grid.around(p).any(seen)
    }
}

/// The polygons of the hole that these links go through, m, counter-clockwise seen from inside. None where it is
/// finer than the samples.
pub(super) fn polygons(space: &Space, links: &[CutLink]) -> Vec<Vec<Vec3>> {
    let size = space.grid.size;
    let Some(normal) = links.iter().map(|l| l.inwards).sum::<Vec3>().try_normalize() else {
        return Vec::new();
    };
    let mut depth: Vec<f32> = links.iter().map(|l| l.at.dot(normal)).collect();
    let middle = depth.len() / 2;
    let depth = *depth.select_nth_unstable_by(middle, f32::total_cmp).1;
    let mean = links.iter().map(|l| l.at).sum::<Vec3>() / links.len() as f32;
    let mut plane = Plane::new(mean + (depth - mean.dot(normal)) * normal, normal);
    let mut reach = REACH * size;
    let mut best = Measured::default();
    for _ in 0..ROUNDS {
        let raster = raster(space, &plane, links, reach);
        best = best.or(measured(&raster, space, &plane, reach));
        let Some(moved) = settled(space, &plane, &raster.rim(), reach) else { break };
        plane = moved;
        reach = (0.6 * reach).max(0.5 * size);
    }
    let reach = NEAR * size;
    best.or(measured(&raster(space, &plane, links, reach), space, &plane, reach)).polygons
}

/// Outlines, and the area within.
#[derive(Default)]
struct Measured {
    polygons: Vec<Vec<Vec3>>,
    area: f32,
}

impl Measured {
    /// The later one, unless it has lost too much of the hole.
    fn or(self, later: Measured) -> Measured {
        if later.area >= LEAST_KEPT * self.area { later } else { self }
    }
}

/// Open points of a plane, those that hang together with the links in parts.
fn raster(space: &Space, plane: &Plane, links: &[CutLink], reach: f32) -> Raster {
    let size = space.grid.size;
    let flat: Vec<Vec2> = links.iter().map(|l| plane.flat(l.at)).collect();
    let low = flat.iter().copied().fold(Vec2::INFINITY, Vec2::min) - 2.5 * size;
    let high = flat.iter().copied().fold(Vec2::NEG_INFINITY, Vec2::max) + 2.5 * size;
    let step = (size / SAMPLES_PER_CELL).max((high - low).max_element() / MOST_SAMPLES);
    let mut raster = Raster::new((low, high), step, |at| is_open(space, plane, at, reach));
    flat.into_iter().for_each(|at| raster.add_part(at));
    raster
}

/// The outer border of each part, counter-clockwise.
fn measured(raster: &Raster, space: &Space, plane: &Plane, reach: f32) -> Measured {
    let outlines = raster.outlines(|at| is_open(space, plane, at, reach));
    let area =
        |o: &Vec<Vec2>| (1..o.len()).map(|i| (o[i - 1] - o[0]).perp_dot(o[i] - o[0]) / 2.0).sum::<f32>();
    Measured {
        area: outlines.iter().map(area).sum(),
        polygons: outlines.iter().map(|o| o.iter().map(|&p| plane.point(p)).collect()).collect(),
    }
}

fn is_open(space: &Space, plane: &Plane, at: Vec2, reach: f32) -> bool {
    let p = plane.point(at);
    let (inner, outer) = (p + reach * plane.normal, p - reach * plane.normal);
    p.y > space.grid.ground
        && space.rays.empty(inner, outer)
        && space.is_on(inner, Side::Inside)
        && space.is_on(outer, Side::Outside)
}

/// The plane moved into the wall around the rim; `None` where no wall is met.
fn settled(space: &Space, plane: &Plane, rim: &[(Vec2, Vec2)], reach: f32) -> Option<Plane> {
    let depth =
        |&(open, closed): &(Vec2, Vec2)| Some((closed, wall_depth(space, plane, open, closed, reach)?));
    let samples: Vec<(Vec2, f32)> = rim.par_iter().filter_map(depth).collect();
    if samples.is_empty() {
        return None;
    }
    let [a, b, c] = fitted(&samples, 0.1 * reach)?;
    let tilt = Vec2::new(b, c).clamp_length_max(MOST_TILT);
    let origin = plane.origin + a * plane.normal;
    let normal = (plane.normal - tilt.x * plane.right - tilt.y * plane.up).normalize();
    Some(Plane::new(origin, normal))
}

/// How far along the normal from the plane the outer face of the wall is, just beside the hole.
fn wall_depth(space: &Space, plane: &Plane, open: Vec2, closed: Vec2, reach: f32) -> Option<f32> {
    let (beside, within) = (plane.point(closed), plane.point(open));
    let way = reach * plane.normal;
    match space.rays.first(beside - way, beside + way) {
        Some(t) => Some(reach * (2.0 * t - 1.0)),
        None => end_of_wall(space, plane.normal, within, beside, reach),
    }
}

/// Where the wall is not met head on, it runs along the normal: the height of its outer end.
fn end_of_wall(space: &Space, normal: Vec3, within: Vec3, beside: Vec3, reach: f32) -> Option<f32> {
    const STEPS: i32 = 8;
    let blocked = |height: f32| !space.rays.clear(within + height * normal, beside + height * normal);
    let height = |i: i32| reach * i as f32 / STEPS as f32;
    let first = (-STEPS..=STEPS).find(|&i| blocked(height(i)))?;
    if first == -STEPS {
        return None;
    }
    let (mut free, mut wall) = (height(first - 1), height(first));
    for _ in 0..HALVINGS {
        let middle = 0.5 * (free + wall);
        if blocked(middle) { wall = middle } else { free = middle }
    }
    Some(wall)
}

/// Height a + b x + c y that fits most samples: least squares again and again, with what is far off (`scale`,
/// metres) weighing less. Only a where the samples say nothing about the tilt.
pub(super) fn fitted(samples: &[(Vec2, f32)], scale: f32) -> Option<[f32; 3]> {
    const REPEATS: usize = 20;
    let n = samples.len() as f32;
    let middle = samples.iter().map(|s| s.0).sum::<Vec2>() / n;
    let spread = (samples.iter().map(|s| s.0.distance_squared(middle)).sum::<f32>() / n).sqrt();
    let mut heights: Vec<f32> = samples.iter().map(|s| s.1).collect();
    let half = heights.len() / 2;
    let mut fit = Vec3::new(*heights.select_nth_unstable_by(half, f32::total_cmp).1, 0.0, 0.0);
    for _ in 0..REPEATS {
        let (mut left, mut right) = (Mat3::ZERO, Vec3::ZERO);
        for &(p, height) in samples {
            let q = (p - middle) / spread.max(f32::MIN_POSITIVE);
            let row = Vec3::new(1.0, q.x, q.y);
            let off = (height - fit.dot(row)) / scale;
            let weight = 1.0 / (1.0 + off * off);
            left += Mat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
            right += weight * height * row;
        }
        // Samples on one line leave the tilt open: the determinant of normalised samples then vanishes.
        let trace = left.x_axis.x.max(f32::MIN_POSITIVE);
        if (left * (1.0 / trace)).determinant() < 1e-3 {
            fit = Vec3::new(right.x / trace, 0.0, 0.0);
        } else {
            fit = left.inverse() * right;
        }
    }
    let slope = Vec2::new(fit.y, fit.z) / spread.max(f32::MIN_POSITIVE);
    fit.is_finite().then_some([fit.x - slope.dot(middle), slope.x, slope.y])
}
