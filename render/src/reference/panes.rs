//! Directions aimed at the openings through which light enters.
//!
//! Panes are triangles that block nothing. Neighbours are held together in at most [`MAX_GROUPS`] groups; seen from a
//! point with a normal, a group is drawn with a probability of about the light that a uniform sky sends through it,
//! area cos cos / r², and then a point on its panes uniformly. The density of a direction, 1/sr, is the sum over all
//! panes on the ray, `P(group) t² / (area of the group · cos)`: exact also where panes lie behind each other.
//!
//! The same panes aim *beams*: for a given direction to the light, a group is drawn by its area as seen along it, and
//! a point on its panes uniformly; the density of that, 1/m² on a plane across the beam, is the sum over all panes on
//! the ray of `P(group) / (area of the group · cos)`.
//!
//! Where it breaks: nowhere, as other densities cover what this one leaves out; but from nearer to a large pane than
//! its own width it fits badly, and then aims no better than a cosine lobe.
//!
//! Based on: Shirley, Wang and Zimmerman, Monte Carlo Techniques for Direct Lighting Calculations, 1996.

use glam::{Vec2, Vec3};

/// Groups at most: choosing among them then costs about as much as a ray.
const MAX_GROUPS: usize = 64;

/// A window of two triangles is not split.
const SMALLEST_SPLIT: usize = 2;

/// Cosines between a direction and a pane under this count as a miss, for sampling and density alike: the density
/// has no end there.
const GRAZING: f32 = 1e-5;

/// Part of a group's area that counts also edge-on, where the mean of its corners misjudges it.
const LEAST_FACING: f32 = 0.05;

/// Triangles to aim at.
pub(crate) struct Panes {
    panes: Vec<Pane>,
    /// Area up to and with each pane, of its group, m².
    running_area: Vec<f32>,
    groups: Vec<Group>,
    nodes: Vec<Node>,
    is_clear: bool,
}

struct Pane {
    corner: Vec3,
    edges: [Vec3; 2],
    normal: Vec3,
    /// m².
    area: f32,
    /// Share of light let through.
    transmission: Vec3,
}

struct Group {
    first: usize,
    end: usize,
    area: f32,
    centre: Vec3,
    /// Sum of area times normal, all turned to one side.
    facing: Vec3,
    low: Vec3,
    high: Vec3,
}

/// Of a tree of boxes around all panes, parents before their children.
struct Node {
    low: Vec3,
    high: Vec3,
    /// The node after this one and all below it.
    next: usize,
    /// A leaf's panes, and their group; empty above.
    first: usize,
    end: usize,
    group: usize,
}

/// The panes as seen from one point.
pub(crate) struct View<'a> {
    panes: &'a Panes,
    origin: Vec3,
    shares: Shares,
}

/// The panes as seen from infinitely far away.
pub(crate) struct Beam<'a> {
    panes: &'a Panes,
    direction: Vec3,
    shares: Shares,
}

/// Running sums of the groups' weights, not scaled.
struct Shares {
    running: [f32; MAX_GROUPS],
    total: f32,
}

impl Panes {
    /// `None` where no triangle has an area.
    pub fn new(triangles: &[[Vec3; 3]], transmission: &[Vec3]) -> Option<Panes> {
        let panes: Vec<Pane> = triangles.iter().zip(transmission).filter_map(pane).collect();
        let n = panes.len();
        let is_clear = panes.iter().all(|p| p.transmission == Vec3::ONE);
        let mut all =
            Panes { panes, running_area: Vec::new(), groups: Vec::new(), nodes: Vec::new(), is_clear };
        if n > 0 {
            all.split(0, n, n.div_ceil(MAX_GROUPS / 2).max(SMALLEST_SPLIT), None);
        }
        // Once all are in their order.
        for group in &all.groups {
            let mut sum = 0.0;
            let areas = all.panes[group.first..group.end].iter().map(|pane| pane.area);
            all.running_area.extend(areas.map(|area| (sum += area, sum).1));
        }
        (n > 0).then_some(all)
    }

    /// Halves a range of panes along the longest side of its box until each part is small: first a group, then a leaf.
    fn split(&mut self, first: usize, end: usize, largest: usize, group_above: Option<usize>) {
        let part = &mut self.panes[first..end];
        let group = group_above.or_else(|| {
            (part.len() <= largest).then(|| {
                self.groups.push(group(part, first));
                self.groups.len() - 1
            })
        });
        let (low, high) = bounds(part.iter().flat_map(Pane::corners));
        let slot = self.nodes.len();
        self.nodes.push(Node { low, high, next: 0, first, end: first, group: 0 });
        match group {
            Some(group) if part.len() <= SMALLEST_SPLIT => {
                (self.nodes[slot].end, self.nodes[slot].group) = (end, group);
            }
            _ => {
                let (low, high) = bounds(part.iter().map(Pane::middle));
                let axis = (high - low).max_position();
                part.sort_by(|a, b| a.middle()[axis].total_cmp(&b.middle()[axis]));
                let half = first + part.len() / 2;
                self.split(first, half, largest, group);
                self.split(half, end, largest, group);
            }
        }
        self.nodes[slot].next = self.nodes.len();
    }

    /// As seen from just above a surface with the unit normal `n`.
    pub fn seen_from(&self, origin: Vec3, n: Vec3) -> View<'_> {
        View { panes: self, origin, shares: self.shares(|group| group.weight(origin, n)) }
    }

    /// As seen from infinitely far away in the unit direction `d`.
    pub fn beam(&self, direction: Vec3) -> Beam<'_> {
        let seen = |group: &Group| group.facing.dot(direction).abs() + LEAST_FACING * group.area;
        Beam { panes: self, direction, shares: self.shares(seen) }
    }

    fn shares(&self, weight: impl Fn(&Group) -> f32) -> Shares {
        let mut running = [0.0; MAX_GROUPS];
        let mut total = 0.0;
        for (slot, group) in running.iter_mut().zip(&self.groups) {
            total += weight(group);
            *slot = total;
        }
        Shares { running, total }
    }

    /// A pane, and a point on it.
    fn point(&self, shares: &Shares, u: Vec2) -> (&Pane, Vec3) {
        let (k, inside) = pick(&shares.running[..self.groups.len()], u.x * shares.total);
        // The rest of u.x goes on: a pane by area, then the pane's first coordinate.
        let group = &self.groups[k];
        let panes = &self.panes[group.first..group.end];
        let (i, x) = pick(&self.running_area[group.first..group.end], inside * group.area);
        let side = x.sqrt();
        let [a, b] = panes[i].edges;
        (&panes[i], panes[i].corner + side * (1.0 - u.y) * a + side * u.y * b)
    }

    /// What the panes on a ray let through within a distance.
    pub fn transmission(&self, origin: Vec3, d: Vec3, distance: f32) -> Vec3 {
        let (mut through, mut i) = (Vec3::ONE, 0);
        if self.is_clear {
            return through;
        }
        let inverse = d.recip();
        while let Some(node) = self.nodes.get(i) {
            if !node.meets(origin, inverse) {
                i = node.next;
                continue;
            }
            for pane in &self.panes[node.first..node.end] {
                if pane.crossing(origin, d).is_some_and(|crossing| crossing.t < distance) {
                    through *= pane.transmission;
                }
            }
            i += 1;
        }
        through
    }

    /// Sum over the panes on a ray of `P(group) / area of the group`, times t² / cos or 1 / cos.
    fn density(&self, shares: &Shares, origin: Vec3, d: Vec3, factor: fn(Crossing) -> f32) -> f32 {
        if shares.total <= 0.0 {
            return 0.0;
        }
        let inverse = d.recip();
        let (mut density, mut i) = (0.0, 0);
        while let Some(node) = self.nodes.get(i) {
            if !node.meets(origin, inverse) {
                i = node.next;
                continue;
            }
            let crossings = self.panes[node.first..node.end].iter().filter_map(|p| p.crossing(origin, d));
            for crossing in crossings {
                density += shares.of(node.group) / self.groups[node.group].area * factor(crossing);
            }
            i += 1;
        }
        density / shares.total
    }
}

impl Shares {
    fn of(&self, group: usize) -> f32 {
        self.running[group] - if group > 0 { self.running[group - 1] } else { 0.0 }
    }
}

/// Where a ray passes a pane.
struct Crossing {
    t: f32,
    /// Between ray and normal, above 0.
    cos: f32,
}

impl Group {
    /// About the cosine-weighted solid angle, from a point with a normal.
    fn weight(&self, origin: Vec3, n: Vec3) -> f32 {
        let to = self.centre - origin;
        let half = 0.5 * (self.high - self.low);
        // The highest corner of the box above the surface.
        let height = n.dot(0.5 * (self.low + self.high) - origin) + n.abs().dot(half);
        if height <= 0.0 {
            return 0.0;
        }
        let square = to.length_squared() + self.area;
        let distance = square.sqrt();
        let facing = self.facing.dot(to).abs() / distance + LEAST_FACING * self.area;
        facing * (height / distance).min(1.0) / square
    }
}

impl View<'_> {
    /// A direction to a point of a pane; `None` where no pane is above the surface, or one is seen edge-on.
    pub fn sample(&self, u: Vec2) -> Option<Vec3> {
        if self.shares.total <= 0.0 {
            return None;
        }
        let (pane, point) = self.panes.point(&self.shares, u);
        let direction = (point - self.origin).try_normalize()?;
        (pane.normal.dot(direction).abs() > GRAZING).then_some(direction)
    }

    /// Density of a unit direction, 1/sr.
    pub fn pdf(&self, d: Vec3) -> f32 {
        self.panes.density(&self.shares, self.origin, d, |crossing| crossing.t * crossing.t / crossing.cos)
    }
}

impl Beam<'_> {
    /// A point of a pane; `None` where that is seen edge-on.
    pub fn sample(&self, u: Vec2) -> Option<Vec3> {
        let (pane, point) = self.panes.point(&self.shares, u);
        (pane.normal.dot(self.direction).abs() > GRAZING).then_some(point)
    }

    /// Density of the beam through a point inside, 1/m² across the beam.
    pub fn pdf(&self, point: Vec3) -> f32 {
        self.panes.density(&self.shares, point, self.direction, |crossing| crossing.cos.recip())
    }
}

/// The slot in which running sums pass `aim`, and how far into it, 0..=1.
fn pick(running: &[f32], aim: f32) -> (usize, f32) {
    let slot = running.partition_point(|s| *s <= aim).min(running.len() - 1);
    let before = if slot > 0 { running[slot - 1] } else { 0.0 };
    (slot, ((aim - before) / (running[slot] - before)).clamp(0.0, 1.0))
}

impl Node {
    /// Whether a ray passes through the box, widened by rounding.
    fn meets(&self, origin: Vec3, inverse: Vec3) -> bool {
        let margin = 1e-5 * (self.high.abs().max(self.low.abs()) + origin.abs());
        let (a, b) = ((self.low - margin - origin) * inverse, (self.high + margin - origin) * inverse);
        // A NaN (0 times infinity: in the plane of a side) is dropped by min and max.
        let (near, far) = (a.min(b).max_element(), a.max(b).min_element());
        !(near > far || far < 0.0)
    }
}

impl Pane {
    fn corners(&self) -> [Vec3; 3] {
        [self.corner, self.corner + self.edges[0], self.corner + self.edges[1]]
    }

    fn middle(&self) -> Vec3 {
        self.corner + (self.edges[0] + self.edges[1]) / 3.0
    }

    fn crossing(&self, origin: Vec3, d: Vec3) -> Option<Crossing> {
        let cos = self.normal.dot(d).abs();
        if cos <= GRAZING {
            return None;
        }
        let [a, b] = self.edges;
        let p = d.cross(b);
        let scale = a.dot(p).recip();
        let from = origin - self.corner;
        let u = from.dot(p) * scale;
        let q = from.cross(a);
        let v = d.dot(q) * scale;
        let t = b.dot(q) * scale;
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(Crossing { t, cos })
    }
}

fn pane((&[a, b, c], &transmission): (&[Vec3; 3], &Vec3)) -> Option<Pane> {
    let cross = (b - a).cross(c - a);
    let normal = cross.try_normalize()?;
    Some(Pane { corner: a, edges: [b - a, c - a], normal, area: 0.5 * cross.length(), transmission })
}

fn bounds(points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

/// Sums a group up.
fn group(panes: &[Pane], first: usize) -> Group {
    let (low, high) = bounds(panes.iter().flat_map(Pane::corners));
    let (mut area, mut centre, mut facing) = (0.0, Vec3::ZERO, Vec3::ZERO);
    for pane in panes {
        area += pane.area;
        centre += pane.area * pane.middle();
        facing += pane.area * if facing.dot(pane.normal) < 0.0 { -pane.normal } else { pane.normal };
    }
    Group { first, end: first + panes.len(), area, centre: centre / area, facing, low, high }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::hash;

    /// Two windows in different walls, one behind another, and a fan of many small panes.
    fn windows() -> Vec<[Vec3; 3]> {
        let rectangle = |a: Vec3, u: Vec3, v: Vec3| [[a, a + u, a + u + v], [a, a + u + v, a + v]];
        let mut all = Vec::new();
        all.extend(rectangle(Vec3::new(-1.0, 1.0, -3.0), Vec3::X, Vec3::Y));
        all.extend(rectangle(Vec3::new(-0.5, 1.0, -3.5), 2.0 * Vec3::X, 1.5 * Vec3::Y));
        all.extend(rectangle(Vec3::new(2.0, 0.5, 0.0), 0.6 * Vec3::Z, 2.0 * Vec3::Y));
        for i in 0..150 {
            let (sin, cos) = (i as f32 * 0.04).sin_cos();
            let at = Vec3::new(3.0 * cos, 3.0, 3.0 * sin);
            all.push([at, at + Vec3::new(0.1, 0.0, 0.0), at + Vec3::new(0.0, 0.0, 0.15)]);
        }
        all
    }

    /// Mean of 1 / pdf over samples that hit is the solid angle of the union; compared with the share of uniform
    /// directions that have a density.
    #[test]
    fn panes_sample_the_density_they_claim() {
        let panes = Panes::new(&windows(), &vec![Vec3::ONE; windows().len()]).unwrap();
        for (origin, n) in [
            (Vec3::new(0.3, 0.0, 0.2), Vec3::Y),
            (Vec3::new(-0.5, 1.2, -2.9), Vec3::new(0.0, 0.6, 0.8)),
            (Vec3::new(1.95, 1.0, 0.3), Vec3::NEG_X),
        ] {
            let view = panes.seen_from(origin, n);
            let n_samples = 200_000;
            let (mut sampled, mut counted) = (0.0, 0.0);
            for i in 0..n_samples {
                let u = hash::stratified_2d(i, n_samples, 3);
                let found = view.sample(u).map_or(0.0, |d| view.pdf(d));
                // Points on an edge may be rounded out of their pane.
                sampled += if found > 0.0 { 1.0 / f64::from(found) } else { 0.0 };
                let z = 1.0 - 2.0 * u.x;
                let (sin, cos) = (std::f32::consts::TAU * u.y).sin_cos();
                let r = (1.0 - z * z).sqrt();
                counted += f64::from(u8::from(view.pdf(Vec3::new(r * cos, r * sin, z)) > 0.0));
            }
            sampled /= f64::from(n_samples);
            counted *= 4.0 * std::f64::consts::PI / f64::from(n_samples);
            // Both sums are good to some thousandths.
            assert!(
                counted > 0.05 && (sampled / counted - 1.0).abs() < 0.015,
                "{origin}: {sampled} {counted}"
            );
        }
    }

    #[test]
    fn groups_are_few_and_hold_every_pane_once() {
        let panes = Panes::new(&windows(), &vec![Vec3::ONE; windows().len()]).unwrap();
        assert!(panes.groups.len() <= MAX_GROUPS);
        let mut at = 0;
        for group in &panes.groups {
            assert_eq!(group.first, at);
            at = group.end;
        }
        assert_eq!(at, windows().len());
    }

    #[test]
    fn panes_below_the_surface_are_not_aimed_at() {
        let panes = Panes::new(&windows(), &vec![Vec3::ONE; windows().len()]).unwrap();
        let view = panes.seen_from(Vec3::new(0.0, 5.0, 0.0), Vec3::Y);
        assert!(view.sample(Vec2::splat(0.5)).is_none());
        assert_eq!(view.pdf(Vec3::NEG_Y), 0.0);
        assert!(Panes::new(&[[Vec3::ZERO; 3]], &[Vec3::ONE]).is_none());
    }
}
