//! How deep the wall around a pane is, found with rays.
//!
//! From points of the pane beside an edge, rays turn from along the pane, away over the edge, to straight out of the
//! window: where what they meet comes to an end, the wall does. An edge has a [`Reveal`] where that is the same line all along
//! it, and where rays that would cross what the line hides, drawn at random from all over the pane, are all blocked
//! before they reach it; else it has none, and rows say by themselves what is in the way, less sharply.
//!
//! Where it breaks: of a wall that ends in steps, only the step that hides most from beside the edge is known.

use std::f32::consts::FRAC_PI_2;

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_relight::portal_frame::{Reveal, plane_of};

use crate::Surface;
use crate::sampling::{fractions, hash};

/// Points along an edge.
const POINTS: usize = 5;

/// Steps by which the angle is halved: to 1e-6 radians.
const HALVINGS: usize = 20;

/// How far from the edge rays start, in parts of the way from it to the pane's middle.
const START: f32 = 0.2;

/// The nearest to the pane that rays look for a wall, radians.
const LEAST_ANGLE: f32 = 0.02;

/// Steps in which they turn.
const STEPS: usize = 64;

/// Two hits that are this far apart, in sizes of the pane, are not of one wall, however near their rays are.
const JUMP: f32 = 0.02;

/// How far rays look for it, in sizes of the pane.
const FARTHEST: f32 = 4.0;

/// The ends found along an edge agree within this part of the pane's size.
const AGREE: f32 = 8e-3;

/// Rays by which a wall is put to the test.
const TRIALS: usize = 128;

/// The reveals of each polygon's edges, which are counter-clockwise as seen from inside.
pub fn reveals(surface: &Surface, polygons: &[Vec<Vec3>], seed: u64) -> Vec<Vec<Reveal>> {
    let of_polygon = |(i, polygon): (usize, &Vec<Vec3>)| {
        let pane = Pane::new(surface, polygon, hash(seed, i as u64));
        (0..polygon.len()).map(|edge| pane.reveal(edge)).collect()
    };
    polygons.iter().enumerate().map(of_polygon).collect()
}

struct Pane<'a> {
    surface: &'a Surface<'a>,
    polygon: &'a [Vec3],
    centre: Vec3,
    /// Towards the inside.
    normal: Vec3,
    /// Of a corner, from the centre.
    size: f32,
    seed: u64,
}

/// The end of a wall beside an edge: how far from the pane's plane, and how far from the edge.
#[derive(Clone, Copy)]
struct End {
    depth: f32,
    offset: f32,
}

impl<'a> Pane<'a> {
    fn new(surface: &'a Surface<'a>, polygon: &'a [Vec3], seed: u64) -> Pane<'a> {
        let (centre, normal) = plane_of(polygon);
        let size = polygon.iter().map(|c| c.distance(centre)).fold(0.0, f32::max);
        Pane { surface, polygon, centre, normal, size, seed }
    }

    fn edge(&self, edge: usize) -> (Vec3, Vec3) {
        (self.polygon[edge], self.polygon[(edge + 1) % self.polygon.len()])
    }

    fn reveal(&self, edge: usize) -> Reveal {
        let [outer, inner] = [-self.normal, self.normal].map(|out| {
            let end = self.end(edge, out).filter(|end| self.holds(edge, out, *end));
            end.unwrap_or(End { depth: 0.0, offset: 0.0 })
        });
        [outer.depth, outer.offset, inner.depth, inner.offset]
    }

    /// Where the wall beside an edge ends, if it does so along a line.
    fn end(&self, edge: usize, out: Vec3) -> Option<End> {
        let (a, b) = self.edge(edge);
        let away = (b - a).cross(self.normal).normalize_or_zero();
        let inset = START * away.dot(a - self.centre);
        let ends: Vec<End> = (0..POINTS)
            .map(|i| {
                let along = (i as f32 + 0.5) / POINTS as f32;
                let from = a.lerp(b, along) - inset * away + self.surface.lift * out;
                let end = self.end_from(from, away, out)?;
                Some(End { depth: end.0 + self.surface.lift, offset: end.1 - inset })
            })
            .collect::<Option<_>>()?;
        let spread = |of: fn(&End) -> f32| {
            let values = ends.iter().map(of);
            values.clone().fold(f32::MIN, f32::max) - values.fold(f32::MAX, f32::min)
        };
        let within = AGREE * self.size;
        if spread(|end| end.depth) > within || spread(|end| end.offset) > within {
            return None;
        }
        // The one that hides least.
        let depth = ends.iter().map(|end| end.depth).fold(f32::MAX, f32::min);
        let offset = ends.iter().map(|end| end.offset).fold(f32::MIN, f32::max);
        // What is no deeper than that is the pane's own rim.
        (depth > within).then_some(End { depth, offset })
    }

    /// How far out and how far away from a point the wall ends; `None` where there is none, or no end of it.
    fn end_from(&self, from: Vec3, away: Vec3, out: Vec3) -> Option<(f32, f32)> {
        let hit = |angle: f32| {
            let (sine, cosine) = angle.sin_cos();
            let d = cosine * away + sine * out;
            let ray = ffi::Ray { tfar: FARTHEST * self.size, ..ffi::Ray::new(from.into(), d.into()) };
            self.surface.tree.intersect(&ray).map(|hit| (hit.t * sine, hit.t * cosine))
        };
        // What is met there goes on from what was met here.
        let goes_on = |here: (f32, f32), there: Option<(f32, f32)>| {
            there.is_some_and(|there| (there.1 - here.1).abs().max(there.0 - here.0) < JUMP * self.size)
        };
        let (step, last) = (FRAC_PI_2 / STEPS as f32, FRAC_PI_2 - LEAST_ANGLE);
        let (mut low, mut here) = (LEAST_ANGLE, hit(LEAST_ANGLE)?);
        while low < last {
            let mut high = low + step;
            let mut beyond = hit(high);
            // Nearer and nearer, until the wall goes on or its end is between the two.
            for _ in 0..HALVINGS {
                if goes_on(here, beyond) {
                    break;
                }
                let middle = 0.5 * (low + high);
                match hit(middle) {
                    Some(there) if goes_on(here, Some(there)) => (low, here) = (middle, there),
                    there => (high, beyond) = (middle, there),
                }
            }
            match beyond {
                Some(there) if goes_on(here, beyond) => (low, here) = (high, there),
                _ => return Some(here),
            }
        }
        None
    }

    /// Whether all rays from the pane to beyond the end are blocked on their way.
    fn holds(&self, edge: usize, out: Vec3, end: End) -> bool {
        let (a, b) = self.edge(edge);
        let away = (b - a).cross(self.normal).normalize_or_zero();
        (0..TRIALS).all(|i| {
            let h = hash(self.seed, (edge * TRIALS + i) as u64);
            let [u, v] = [fractions(h), fractions(hash(h, 1))];
            // A point of the pane, and one beyond the end by a part of the pane.
            let corner = (u.x * self.polygon.len() as f32) as usize % self.polygon.len();
            let (c, d) = self.edge(corner);
            let root = u.y.sqrt();
            let from = self.centre + root * (c.lerp(d, v.x) - self.centre) + self.surface.lift * out;
            let beyond = end.offset + AGREE * self.size + h as u8 as f32 / 255.0 * self.size;
            let to = a.lerp(b, v.y) + beyond * away + end.depth * out;
            let ray = ffi::Ray { tfar: 1.0, ..ffi::Ray::new(from.into(), (to - from).into()) };
            self.surface.tree.occluded(&ray)
        })
    }
}

#[cfg(test)]
mod tests;
