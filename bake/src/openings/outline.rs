//! From cut links to the flat polygon of a hole.
//!
//! In a plane near the hole a point is *open* where a short straight line through it, along the plane's normal,
//! meets nothing and leads from the inside to the outside. Around the open points lies the rim: where the wall's outer
//! face is there, measured by rays, moves and tilts the plane into it. Then the border of the open points is followed,
//! each of its points found by bisection. Glass closes a hole: a pane is a portal of its own.
//!
//! Where it breaks: a hole that is not flat gets the flat polygon that its rim lies nearest to.

use glam::{Mat3, Vec2, Vec3};
use rayon::prelude::*;

use super::cut::{CutLink, Side};
use super::grid::Grid;
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

/// Halvings of a step between samples: to a thousandth of it.
const HALVINGS: usize = 10;

/// How far, in samples, the outline may be off when corners are left out: arcs keep their area to a thousandth.
const STRAIGHT: f32 = 0.1;

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

/// A plane with axes: right, up, and into the interior.
#[derive(Clone, Copy, Debug)]
struct Plane {
    origin: Vec3,
    right: Vec3,
    up: Vec3,
    normal: Vec3,
}

impl Plane {
    fn new(origin: Vec3, normal: Vec3) -> Plane {
        let right = Vec3::Y.cross(normal);
        let right = if right.length() > 1e-3 {
            right.normalize()
        } else {
            Vec3::X.cross(normal).cross(-normal).normalize()
        };
        Plane { origin, right, up: normal.cross(right), normal }
    }

    fn point(&self, at: Vec2) -> Vec3 {
        self.origin + at.x * self.right + at.y * self.up
    }

    fn flat(&self, p: Vec3) -> Vec2 {
        Vec2::new((p - self.origin).dot(self.right), (p - self.origin).dot(self.up))
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
        let raster = Raster::new(space, &plane, links, reach);
        best = best.or(raster.measured(space, &plane));
        let Some(moved) = settled(space, &plane, &raster.rim(), reach) else { break };
        plane = moved;
        reach = (0.6 * reach).max(0.5 * size);
    }
    let raster = Raster::new(space, &plane, links, NEAR * size);
    best.or(raster.measured(space, &plane)).polygons
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

/// Open points of a plane, and which of them belong to the hole.
struct Raster {
    low: Vec2,
    step: f32,
    n: [usize; 2],
    reach: f32,
    /// Numbered from 1 by the part that hangs together with the links; 0 where closed or elsewhere.
    part: Vec<u32>,
    n_parts: u32,
}

impl Raster {
    fn new(space: &Space, plane: &Plane, links: &[CutLink], reach: f32) -> Raster {
        let size = space.grid.size;
        let flat: Vec<Vec2> = links.iter().map(|l| plane.flat(l.at)).collect();
        let low = flat.iter().copied().fold(Vec2::INFINITY, Vec2::min) - 2.5 * size;
        let high = flat.iter().copied().fold(Vec2::NEG_INFINITY, Vec2::max) + 2.5 * size;
        let step = (size / SAMPLES_PER_CELL).max((high - low).max_element() / MOST_SAMPLES);
        let n = ((high - low) / step).to_array().map(|n| n as usize + 2);
        let mut raster = Raster { low, step, n, reach, part: Vec::new(), n_parts: 0 };
        let open: Vec<bool> =
            (0..n[0] * n[1]).into_par_iter().map(|i| is_open(space, plane, raster.at(i), reach)).collect();
        raster.part = vec![0; open.len()];
        for p in flat {
            raster.flood(&open, p);
        }
        raster
    }

    fn at(&self, i: usize) -> Vec2 {
        self.low + self.step * Vec2::new((i % self.n[0]) as f32, (i / self.n[0]) as f32)
    }

    fn inner(&self, i: usize) -> bool {
        let (x, y) = (i % self.n[0], i / self.n[0]);
        x > 0 && y > 0 && x + 1 < self.n[0] && y + 1 < self.n[1]
    }

    fn neighbours(&self, i: usize) -> [usize; 4] {
        [i + 1, i + self.n[0], i - 1, i - self.n[0]]
    }

    fn flood(&mut self, open: &[bool], from: Vec2) {
        let place = ((from - self.low) / self.step).round();
        let seed = place.y as usize * self.n[0] + place.x as usize;
        if !open[seed] || self.part[seed] != 0 {
            return;
        }
        self.n_parts += 1;
        let mut front = vec![seed];
        self.part[seed] = self.n_parts;
        while let Some(i) = front.pop() {
            for next in self.neighbours(i) {
                if open[next] && self.part[next] == 0 && self.inner(next) {
                    self.part[next] = self.n_parts;
                    front.push(next);
                }
            }
        }
    }

    /// Pairs of an open sample and the closed one beside it.
    fn rim(&self) -> Vec<(Vec2, Vec2)> {
        let open = (0..self.part.len()).filter(|&i| self.part[i] != 0);
        open.flat_map(|i| self.neighbours(i).map(|j| (i, j)))
            .filter(|&(_, j)| self.part[j] == 0)
            .map(|(i, j)| (self.at(i), self.at(j)))
            .collect()
    }

    /// The outer border of each part, counter-clockwise.
    fn measured(&self, space: &Space, plane: &Plane) -> Measured {
        let outlines: Vec<Vec<Vec2>> =
            (1..=self.n_parts).filter_map(|part| self.outline(part, space, plane)).collect();
        let area =
            |o: &Vec<Vec2>| (1..o.len()).map(|i| (o[i - 1] - o[0]).perp_dot(o[i] - o[0]) / 2.0).sum::<f32>();
        Measured {
            area: outlines.iter().map(area).sum(),
            polygons: outlines.iter().map(|o| o.iter().map(|&p| plane.point(p)).collect()).collect(),
        }
    }

    /// Walks along the squares of four samples with the part on its left, from its lowest sample.
    fn outline(&self, part: u32, space: &Space, plane: &Plane) -> Option<Vec<Vec2>> {
        let start = self.part.iter().position(|p| *p == part)?;
        // From the open sample `i`, `d` points at the closed one; turning right means towards it.
        let (mut i, mut d) = (start, 3);
        let mut ring = Vec::new();
        loop {
            ring.push(self.border(i, self.neighbours(i)[d], space, plane));
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

    /// Where between an open and a closed sample the border is.
    fn border(&self, open: usize, closed: usize, space: &Space, plane: &Plane) -> Vec2 {
        let (mut open, mut closed) = (self.at(open), self.at(closed));
        for _ in 0..HALVINGS {
            let middle = 0.5 * (open + closed);
            if is_open(space, plane, middle, self.reach) { open = middle } else { closed = middle }
        }
        0.5 * (open + closed)
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
fn fitted(samples: &[(Vec2, f32)], scale: f32) -> Option<[f32; 3]> {
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
