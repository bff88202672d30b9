//! How deep the wall around a pane is, found with rays.
//!
//! From points of the pane beside an edge, rays turn from along the pane, away over the edge, to straight out of the
//! window: where what they meet comes to an end, the wall does. An edge has a [`Reveal`] where that is the same line all along
//! it, and where rays that would cross what the line hides, drawn at random from all over the pane, are blocked
//! before they reach it; else it has none, and rows say by themselves what is in the way, less sharply. A wall may end in steps,
//! behind each of which more of it shows; those are kept that hide most as seen from some part of the pane. A line goes on
//! without end: a roof below the window is a step of its wall only where it is as long as one sees past the nearer ones.
//!
//! Where it breaks: more than [`STEPS`] steps; walls that bend.

use std::f32::consts::FRAC_PI_2;

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_relight::portal_frame::{Reveal, plane_of};
use rayon::prelude::*;

use crate::Surface;
use crate::sampling::{fractions, hash};

/// Points along an edge.
const POINTS: usize = 5;

/// Steps by which the angle is halved: to 1e-6 radians.
const HALVINGS: usize = 20;

/// How far from the edge rays start, in parts of the way from it to the pane's middle.
const STARTS: [f32; 3] = [0.2, 0.8, 1.6];

/// Steps of a wall that are kept, and ends that rays from one place look for.
pub const STEPS: usize = 2;
const MOST_ENDS: usize = 16;

/// What is met this much farther away than an end is not of its wall.
const WALL: f32 = 4.0;

/// Places across a pane by which ends are compared.
const VIEWS: usize = 64;

/// The nearest to the pane that rays look for a wall, radians.
const LEAST_ANGLE: f32 = 0.02;

/// Steps in which they turn.
const TURNS: usize = 64;

/// Two hits that are this far apart, in sizes of the pane, are not of one wall, however near their rays are.
const JUMP: f32 = 0.02;

/// How far rays look for it, in sizes of the pane.
const FARTHEST: f32 = 4.0;

/// The ends found along an edge agree within this part of the pane's size.
const AGREE: f32 = 8e-3;

/// Rays by which a wall is put to the test, and how many of them have to end at it: real walls have cracks.
const TRIALS: usize = 256;
const LEAST_HELD: usize = 250;

/// What fewer of them come to at all, past what stands before it, hides nothing.
const LEAST_PASSING: usize = 8;

/// Half of them slant along the edge by up to this, radians.
const MOST_SLANT: f32 = 1.1;

/// The reveals of each polygon's edges, [`STEPS`] of each, which are counter-clockwise as seen from inside.
pub fn reveals(surface: &Surface, polygons: &[Vec<Vec3>], seed: u64) -> Vec<Vec<Reveal>> {
    let of_polygon = |(i, polygon): (usize, &Vec<Vec3>)| {
        let pane = Pane::new(surface, polygon, hash(seed, i as u64));
        (0..polygon.len()).flat_map(|edge| pane.reveals(edge)).collect()
    };
    polygons.par_iter().enumerate().map(of_polygon).collect()
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

impl End {
    fn distance(&self, other: &End) -> f32 {
        (self.depth - other.depth).abs().max((self.offset - other.offset).abs())
    }
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

    /// Unit, in the pane's plane, and how far that way the edge is from the middle.
    fn away(&self, edge: usize) -> (Vec3, f32) {
        let (a, b) = self.edge(edge);
        let away = (b - a).cross(self.normal).normalize_or_zero();
        (away, away.dot(a - self.centre))
    }

    fn reveals(&self, edge: usize) -> [Reveal; STEPS] {
        let [outer, inner] = [-self.normal, self.normal].map(|out| self.ends(edge, out));
        std::array::from_fn(|i| [outer[i].depth, outer[i].offset, inner[i].depth, inner[i].offset])
    }

    /// Where the wall beside an edge ends, the steps that hide most first; no depth where there are no more.
    fn ends(&self, edge: usize, out: Vec3) -> [End; STEPS] {
        let within = AGREE * self.size;
        let mut found: Vec<End> = Vec::new();
        for end in STARTS.into_iter().flat_map(|start| self.agreed(&self.ends_from(edge, start, out))) {
            // What is no deeper than that is the pane's own rim.
            let is_new = end.depth > within && found.iter().all(|known| known.distance(&end) > within);
            if is_new && self.holds(edge, out, end, &found) {
                found.push(end);
            }
        }
        // Each hides most as seen from some part of the pane, from its edge to the other side.
        let across = 2.0 * self.away(edge).1;
        let mut wins = vec![0; found.len()];
        for i in 0..VIEWS {
            let from = across * (i as f32 + 0.5) / VIEWS as f32;
            let slope = |end: &End| (end.offset + from) / end.depth;
            let least = (0..found.len()).min_by(|&i, &j| slope(&found[i]).total_cmp(&slope(&found[j])));
            least.into_iter().for_each(|i| wins[i] += 1);
        }
        let mut order: Vec<usize> = (0..found.len()).filter(|&i| wins[i] > 0).collect();
        order.sort_by_key(|&i| std::cmp::Reverse(wins[i]));
        let end = |i: usize| order.get(i).map_or(End { depth: 0.0, offset: 0.0 }, |&i| found[i]);
        std::array::from_fn(end)
    }

    /// The ends of the wall as seen from points along an edge.
    fn ends_from(&self, edge: usize, start: f32, out: Vec3) -> [Vec<End>; POINTS] {
        let ((a, b), (away, from_middle)) = (self.edge(edge), self.away(edge));
        let inset = start * from_middle;
        std::array::from_fn(|i| {
            let along = (i as f32 + 0.5) / POINTS as f32;
            let from = a.lerp(b, along) - inset * away + self.surface.lift * out;
            let end = |(depth, offset): (f32, f32)| End {
                depth: depth + self.surface.lift,
                offset: offset - inset,
            };
            self.ends_of_wall(from, away, out, inset).into_iter().map(end).collect()
        })
    }

    /// Ends that are the same line all along the edge; what hides least there.
    fn agreed(&self, ends: &[Vec<End>; POINTS]) -> Vec<End> {
        let within = AGREE * self.size;
        let at = |end: &End, ends: &Vec<End>| {
            let off = |e: &End| e.distance(end);
            ends.iter().copied().filter(|e| off(e) <= within).min_by(|a, b| off(a).total_cmp(&off(b)))
        };
        let least = |a: End, b: End| End { depth: a.depth.min(b.depth), offset: a.offset.max(b.offset) };
        let along =
            |end: &End| ends.iter().map(|ends| at(end, ends)).try_fold(*end, |a, b| Some(least(a, b?)));
        ends[POINTS / 2].iter().filter_map(along).collect()
    }

    /// How far out and how far away from a point, `inset` from the edge, the wall ends, and what shows behind it, and so on.
    fn ends_of_wall(&self, from: Vec3, away: Vec3, out: Vec3, inset: f32) -> Vec<(f32, f32)> {
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
        // By how far it is from the edge.
        let is_near = |here: (f32, f32), there: (f32, f32)| {
            there.0.hypot(there.1 - inset) < WALL * here.0.hypot(here.1 - inset)
        };
        let (step, last) = (FRAC_PI_2 / TURNS as f32, FRAC_PI_2 - LEAST_ANGLE);
        let mut ends = Vec::new();
        let Some(mut here) = hit(LEAST_ANGLE) else { return ends };
        let mut low = LEAST_ANGLE;
        while low < last && ends.len() < MOST_ENDS {
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
            if !goes_on(here, beyond) {
                ends.push(here);
            }
            match beyond {
                Some(there) if goes_on(here, beyond) || is_near(here, there) => (low, here) = (high, there),
                _ => break,
            }
        }
        ends
    }

    /// Whether rays from the pane to beyond the end are blocked on their way, of those that come past the nearer ends that are
    /// known.
    fn holds(&self, edge: usize, out: Vec3, end: End, known: &[End]) -> bool {
        let ((a, b), (away, _)) = (self.edge(edge), self.away(edge));
        let along = (b - a).normalize_or_zero();
        let nearer =
            known.iter().map(|known| known.depth).filter(|depth| *depth < end.depth).fold(0.0, f32::max);
        // How deep out of the window a ray is blocked; `None` where it is not.
        let blocked = |i: usize| {
            let h = hash(self.seed, (edge * TRIALS + i) as u64);
            let [u, v] = [fractions(h), fractions(hash(h, 1))];
            // A point of the pane, and one beyond the end, near or far.
            let corner = (u.x * self.polygon.len() as f32) as usize % self.polygon.len();
            let (c, d) = self.edge(corner);
            let root = u.y.sqrt();
            let from = self.centre + root * (c.lerp(d, v.x) - self.centre) + self.surface.lift * out;
            let far = h as u8 as f32 / 256.0;
            let beyond = end.offset + AGREE * self.size + far / (1.0 - far) * (end.depth + self.size);
            let mut to = a.lerp(b, v.y) + beyond * away + end.depth * out;
            if i % 2 == 1 {
                // Slantwise: what stands farther off may be no longer than the edge.
                let straight = to + (from - to).project_onto_normalized(along);
                let slope = (MOST_SLANT * (2.0 * v.y - 1.0)).tan();
                to = straight + slope * straight.distance(from) * along;
            }
            let ray = ffi::Ray { tfar: 1.0, ..ffi::Ray::new(from.into(), (to - from).into()) };
            self.surface.tree.intersect(&ray).map(|hit| hit.t * (to - from).dot(out))
        };
        let passes = |depth: &Option<f32>| depth.is_none_or(|depth| depth > nearer);
        let passing: Vec<Option<f32>> = (0..TRIALS).map(blocked).filter(passes).collect();
        let held = passing.iter().flatten().count();
        passing.len() >= LEAST_PASSING && held * TRIALS >= passing.len() * LEAST_HELD
    }
}

#[cfg(test)]
mod tests;
