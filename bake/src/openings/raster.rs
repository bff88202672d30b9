//! The border of the open points of a plane.
//!
//! Points are asked on a grid; of those that hang together the border is followed, each of its points found by
//! bisection; what is off the line between others by little is left out, and corners that the grid cut off are put back.
//!
//! Where it breaks: what is finer than the grid.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Halvings of a step between samples: to a thousandth of it.
pub(super) const HALVINGS: usize = 10;

/// How far, in samples, the outline may be off when corners are left out: arcs keep their area to a thousandth.
const STRAIGHT: f32 = 0.1;

/// A plane with axes: right, up, and into the interior.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub origin: Vec3,
    pub right: Vec3,
    pub up: Vec3,
    pub normal: Vec3,
}

impl Plane {
    pub fn new(origin: Vec3, normal: Vec3) -> Plane {
        let right = Vec3::Y.cross(normal);
        let right = if right.length() > 1e-3 {
            right.normalize()
        } else {
            Vec3::X.cross(normal).cross(-normal).normalize()
        };
        Plane { origin, right, up: normal.cross(right), normal }
    }

    pub fn point(&self, at: Vec2) -> Vec3 {
        self.origin + at.x * self.right + at.y * self.up
    }

    pub fn flat(&self, p: Vec3) -> Vec2 {
        Vec2::new((p - self.origin).dot(self.right), (p - self.origin).dot(self.up))
    }
}

/// Open points of a plane, and the parts that hang together.
pub(super) struct Raster {
    low: Vec2,
    step: f32,
    n: [usize; 2],
    open: Vec<bool>,
    /// Numbered from 1; 0 where closed or in no part that was asked for.
    part: Vec<u32>,
    n_parts: u32,
}

impl Raster {
    /// Between two corners, outside of which nothing is open; no parts yet.
    pub fn new((low, high): (Vec2, Vec2), step: f32, is_open: impl Fn(Vec2) -> bool + Sync) -> Raster {
        let n = ((high - low) / step).to_array().map(|n| n as usize + 2);
        let mut raster = Raster { low, step, n, open: Vec::new(), part: vec![0; n[0] * n[1]], n_parts: 0 };
        let is_open = |i: usize| raster.is_inner(i) && is_open(raster.at(i));
        raster.open = (0..n[0] * n[1]).into_par_iter().map(is_open).collect();
        raster
    }

    /// Makes what hangs together with a place a part.
    pub fn add_part(&mut self, with: Vec2) {
        let place = ((with - self.low) / self.step).round();
        self.flood(place.y as usize * self.n[0] + place.x as usize);
    }

    /// Makes everything open some part.
    pub fn add_all(&mut self) {
        (0..self.open.len()).for_each(|i| self.flood(i));
    }

    pub fn n_parts(&self) -> usize {
        self.n_parts as usize
    }

    pub fn n_open(&self) -> usize {
        self.open.iter().filter(|open| **open).count()
    }

    /// Of how many samples something is true.
    pub fn count(&self, of: impl Fn(Vec2) -> bool) -> usize {
        (0..self.open.len()).filter(|i| of(self.at(*i))).count()
    }

    fn flood(&mut self, seed: usize) {
        if !self.open[seed] || self.part[seed] != 0 {
            return;
        }
        self.n_parts += 1;
        let mut front = vec![seed];
        self.part[seed] = self.n_parts;
        while let Some(i) = front.pop() {
            for next in self.neighbours(i) {
                if self.open[next] && self.part[next] == 0 {
                    self.part[next] = self.n_parts;
                    front.push(next);
                }
            }
        }
    }

    fn at(&self, i: usize) -> Vec2 {
        self.low + self.step * Vec2::new((i % self.n[0]) as f32, (i / self.n[0]) as f32)
    }

    fn is_inner(&self, i: usize) -> bool {
        let (x, y) = (i % self.n[0], i / self.n[0]);
        x > 0 && y > 0 && x + 1 < self.n[0] && y + 1 < self.n[1]
    }

    fn neighbours(&self, i: usize) -> [usize; 4] {
        [i + 1, i + self.n[0], i - 1, i - self.n[0]]
    }

    /// Pairs of a sample of a part and the one beside it that is of none.
    pub fn rim(&self) -> Vec<(Vec2, Vec2)> {
        let open = (0..self.part.len()).filter(|&i| self.part[i] != 0);
        open.flat_map(|i| self.neighbours(i).map(|j| (i, j)))
            .filter(|&(_, j)| self.part[j] == 0)
            .map(|(i, j)| (self.at(i), self.at(j)))
            .collect()
    }

    /// The outer border of each part, counter-clockwise, where `is_open` ends.
    pub fn outlines(&self, is_open: impl Fn(Vec2) -> bool + Sync) -> Vec<Vec<Vec2>> {
        let mut starts = vec![None; self.n_parts as usize + 1];
        self.part.iter().enumerate().rev().for_each(|(i, part)| starts[*part as usize] = Some(i));
        let starts: Vec<usize> = starts.into_iter().skip(1).flatten().collect();
        starts.into_par_iter().filter_map(|start| self.outline(start, &is_open)).collect()
    }

    /// Walks along the squares of four samples with the part on its left, from its lowest sample, `start`.
    fn outline(&self, start: usize, is_open: impl Fn(Vec2) -> bool) -> Option<Vec<Vec2>> {
        let part = self.part[start];
        // From the open sample `i`, `d` points at the closed one; turning right means towards it.
        let (mut i, mut d) = (start, 3);
        let mut ring = Vec::new();
        loop {
            ring.push(border(self.at(i), self.at(self.neighbours(i)[d]), &is_open));
            // Beside the pair, in walking direction: straight on if the next open sample has its closed one there.
            let ahead = self.neighbours(i)[(d + 1) % 4];
            if self.part[ahead] == part {
                let beside = self.neighbours(ahead)[d];
                if self.part[beside] == part {
                    (i, d) = (beside, (d + 3) % 4);
                } else {
                    i = ahead;
                }
            } else {
                d = (d + 1) % 4;
            }
            if i == start && d == 3 {
                break;
            }
        }
        let ring = simplified(&ring, STRAIGHT * self.step);
        let ring = with_corners(&ring, self.step);
        (ring.len() >= 3).then_some(ring)
    }
}

/// Where between an open and a closed place the border is.
fn border(mut open: Vec2, mut closed: Vec2, is_open: impl Fn(Vec2) -> bool) -> Vec2 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (open + closed);
        if is_open(middle) { open = middle } else { closed = middle }
    }
    0.5 * (open + closed)
}

/// Douglas and Peucker's: corners that are off the line between their neighbours by more than `off`.
fn simplified(ring: &[Vec2], off: f32) -> Vec<Vec2> {
    let farthest = |from: Vec2| {
        let distance = |i: &usize| ring[*i].distance_squared(from);
        (0..ring.len()).max_by(|i, j| distance(i).total_cmp(&distance(j))).unwrap_or(0)
    };
    let first = farthest(ring[0]);
    let second = farthest(ring[first]);
    let (a, b) = (first.min(second), first.max(second));
    let mut kept = vec![false; ring.len()];
    let turned: Vec<Vec2> = (0..=ring.len()).map(|i| ring[(a + i) % ring.len()]).collect();
    let mut keep = |i: usize| kept[(a + i) % ring.len()] = true;
    let mut open = vec![(0, b - a), (b - a, ring.len())];
    while let Some((from, to)) = open.pop() {
        keep(from);
        let (p, q) = (turned[from], turned[to]);
        let along = (q - p).normalize_or_zero();
        let distance = |i: &usize| along.perp_dot(turned[*i] - p).abs();
        let worst = (from + 1..to).max_by(|i, j| distance(i).total_cmp(&distance(j)));
        if let Some(i) = worst.filter(|i| distance(i) > off) {
            open.extend([(from, i), (i, to)]);
        }
    }
    ring.iter().zip(kept).filter(|(_, k)| *k).map(|(p, _)| *p).collect()
}

/// Samples cut off the tips of corners: an edge shorter than two steps between two longer ones goes, and they are
/// made longer until they meet.
fn with_corners(ring: &[Vec2], step: f32) -> Vec<Vec2> {
    let n = ring.len();
    let edge = |i: usize| (ring[i % n], ring[(i + 1) % n]);
    let length = |i: usize| edge(i).0.distance(edge(i).1);
    let tip = |i: usize| {
        let is_cut =
            n > 3 && length(i) < 2.0 * step && length(i + n - 1) > 2.0 * step && length(i + 1) > 2.0 * step;
        let ((a, b), (c, d)) = (edge(i + n - 1), edge(i + 1));
        let (u, v) = ((b - a).normalize_or_zero(), (d - c).normalize_or_zero());
        let sine = u.perp_dot(v);
        // A corner of the hole, not a kink of an arc.
        let tip = b + u * ((c - b).perp_dot(v) / sine);
        (is_cut && sine.abs() > 0.5 && tip.distance(b) < 2.0 * step).then_some(tip)
    };
    let mut out = Vec::new();
    for (i, corner) in ring.iter().enumerate() {
        match (tip(i), tip(i + n - 1)) {
            (Some(tip), _) => out.push(tip),
            (None, None) => out.push(*corner),
            (None, Some(_)) => {}
        }
    }
    out
}
