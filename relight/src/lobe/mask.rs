//! Which part of a lamp the blockers hide: a square grid around the lamp's cap, as bits, and its quad-tree.
//!
//! The square is the paper's: perpendicular to the direction of the lamp, just as wide as the lamp's cone. A
//! blocker's cone cuts its plane in a conic, whose chord with a row of grid corners is a quadratic:
//! with the blocker at c = (x, y, z) in the square's frame, radius r, row v,
//!
//! ```text
//! u = (x (y v + z) ± √((|c|² - r²) (r² (1 + v²) - (y - z v)²))) / (y² + z² - r²)
//! ```
//!
//! in which nothing cancels, however small the lamp. A chord is a run of bits; blockers are united by `or`, so
//! that two of them may hide a cell together; four corners hide a cell, four cells their parent. Lamps wider than
//! 70° (which a plane cannot hold), and blockers that reach behind the rim of the cone or into the lamp, are
//! tested corner by corner with a ray, in an equal-area square for the wide ones.
//!
//! What is smaller than a cell of the deepest level is seen only by [`Policy::Conservative`].
//!
//! Based on: Meunier et al., Cosine Lobes for Interactive Direct Lighting in Dynamic Scenes, 2009.

use glam::Vec3;

use super::blockers::{Body, Eight, LANES};
use super::relation::{Relation, SKIN, reaching, relation};
use super::{Blockers, Sphere};

/// Deepest mask: 32 × 32 cells over the lamp.
pub const MAX_DEPTH: u32 = 5;
/// Cells along a side at [`MAX_DEPTH`].
pub(super) const MAX_CELLS: usize = 1 << MAX_DEPTH;
/// Rows of corners, and as many more as fill the lanes.
const ROWS: usize = (MAX_CELLS + 1).next_multiple_of(LANES);
/// tan 70°: wider lamps use the equal-area square.
pub(super) const MAX_SPREAD: f32 = 2.747_477;
/// See [`super::fast`].
const ROUNDING: f32 = 12_582_912.0;

/// What becomes of a cell that the blockers hide in part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Policy {
    /// It shines: shadows are up to a cell too small. The fewest lobes, the paper's choice.
    Aggressive,
    /// It is dark: shadows are up to a cell too large.
    Conservative,
    /// It is dark in proportion to its hidden corners: more lobes, no bias.
    #[default]
    Proportional,
}

/// A lamp seen from a point: the cone's frame and size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    pub apex: Vec3,
    pub across: Vec3,
    pub up: Vec3,
    /// Towards the lamp's centre.
    pub axis: Vec3,
    pub distance: f32,
    pub lamp_radius: f32,
    pub sin: f32,
    pub cos: f32,
    /// tan σ: half the side of the square at distance 1.
    pub spread: f32,
    /// Whether the equal-area square is used.
    pub wide: bool,
}

impl Cone {
    /// `axis` of unit length; the point must be outside the lamp.
    pub fn new(apex: Vec3, axis: Vec3, distance: f32, lamp_radius: f32) -> Cone {
        let (across, up) = axis.any_orthonormal_pair();
        let sin = (lamp_radius / distance).min(1.0);
        let cos = (1.0 - sin * sin).sqrt();
        let spread = sin / cos.max(1e-6);
        Cone { apex, across, up, axis, distance, lamp_radius, sin, cos, spread, wide: spread > MAX_SPREAD }
    }

    /// A world vector in the cone's frame.
    #[inline(always)]
    pub fn local(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.across.dot(v), self.up.dot(v), self.axis.dot(v))
    }

    /// Direction, in the cone's frame, of a place in the square -1..=1 × -1..=1; the lamp's rim is the unit circle.
    #[inline(always)]
    pub fn direction(&self, p: f32, q: f32) -> Vec3 {
        if self.wide {
            // Equal area: 1 - cos α = ρ² (1 - cos σ).
            let z = 1.0 - (p * p + q * q) * (1.0 - self.cos);
            let stretch = ((1.0 - self.cos) * (1.0 + z)).max(0.0).sqrt();
            Vec3::new(p * stretch, q * stretch, z)
        } else {
            let (u, v) = (p * self.spread, q * self.spread);
            Vec3::new(u, v, 1.0) * (1.0 / (1.0 + u * u + v * v).sqrt())
        }
    }
}

/// How the blockers leave a lamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cover {
    Lit,
    Dark,
    /// Some of it: the mask says which.
    Partial,
}

/// Corners and cells that blockers hide, one bit each; bit 0 is the column at u = -1.
#[derive(Clone, Debug)]
pub(super) struct Mask {
    pub corners: [u64; ROWS],
    /// Cells touched at all; kept by [`Policy::Conservative`] only.
    pub touched: [u32; MAX_CELLS],
    pub cells: usize,
    pub policy: Policy,
}

impl Mask {
    pub fn new(depth: u32, policy: Policy) -> Mask {
        Mask { corners: [0; ROWS], touched: [0; MAX_CELLS], cells: 1 << depth, policy }
    }

    /// Clears and draws all blockers, and the other lamps.
    #[inline(always)]
    pub fn draw(&mut self, cone: &Cone, blockers: &Blockers, others: impl Iterator<Item = Sphere>) -> Cover {
        let mut cover = Cover::Lit;
        for sphere in others {
            match relation(cone, &sphere) {
                Relation::Apart => {}
                Relation::Covers => return Cover::Dark,
                meets => self.draw_one(cone, &sphere, meets, &mut cover),
            }
        }
        for body in &blockers.bodies {
            if relation(cone, &body.bound) != Relation::Apart
                && self.draw_body(cone, blockers, body, &mut cover) == Cover::Dark
            {
                return Cover::Dark;
            }
        }
        cover
    }

    /// What is left of a lamp for a point in it: all, unless the point is in a blocker too.
    pub fn draw_inside(&self, point: Vec3, blockers: &Blockers) -> Cover {
        let holds = |sphere: Sphere| sphere.centre.distance(point) < sphere.radius * (1.0 - SKIN);
        let any = |eight: &Eight| (0..LANES).any(|lane| holds(eight.sphere(lane)));
        if blockers.eights.iter().any(any) { Cover::Dark } else { Cover::Lit }
    }

    #[inline(always)]
    fn draw_body(&mut self, cone: &Cone, blockers: &Blockers, body: &Body, cover: &mut Cover) -> Cover {
        for eight in &blockers.eights[body.first..body.end] {
            if relation(cone, &eight.bound) == Relation::Apart {
                continue;
            }
            for lane in reaching(cone, eight) {
                let sphere = eight.sphere(lane);
                match relation(cone, &sphere) {
                    Relation::Apart => {}
                    Relation::Covers => return Cover::Dark,
                    meets => self.draw_one(cone, &sphere, meets, cover),
                }
            }
        }
        *cover
    }

    #[inline(always)]
    fn draw_one(&mut self, cone: &Cone, sphere: &Sphere, meets: Relation, cover: &mut Cover) {
        if *cover == Cover::Lit {
            self.corners = [0; ROWS];
            self.touched = [0; MAX_CELLS];
            *cover = Cover::Partial;
        }
        let centre = cone.local(sphere.centre - cone.apex);
        // The conic is an ellipse in front of the square if the blocker stays above the plane's horizon.
        let ellipse = centre.z > 1.000_1 * sphere.radius;
        if meets == Relation::InFront && ellipse && !cone.wide {
            self.draw_conic(cone, centre, sphere.radius);
        } else {
            self.draw_rays(cone, centre, sphere.radius);
        }
    }

    /// Chords of the conic with every row of corners it may meet.
    #[inline(always)]
    fn draw_conic(&mut self, cone: &Cone, centre: Vec3, radius: f32) {
        // Everything in units of the distance to the blocker, so that squares stay in range.
        let unit = 1.0 / centre.length();
        let (c, r) = (centre * unit, radius * unit);
        let last = self.cells as f32;
        let in_cells = |w: f32| (w / cone.spread + 1.0) * 0.5 * last;
        let (low, high) = extent(c.y, c.z, r);
        let (low_row, high_row) = (in_cells(low), in_cells(high));
        if !(low_row <= last && high_row >= 0.0) {
            return;
        }
        let first = (low_row.max(0.0) as usize).min(self.cells);
        let end = (high_row.min(last) as usize).min(self.cells) + 1;
        let chords = Chords::new(c, r, cone.spread, self.cells);
        for block in (first / LANES)..end.div_ceil(LANES) {
            let bits = chords.corner_bits(block * LANES);
            for (row, bits) in self.corners[block * LANES..].iter_mut().zip(bits) {
                *row |= bits;
            }
        }
        if self.policy == Policy::Conservative {
            let (left, right) = extent(c.x, c.z, r);
            let extremes = [
                (left, opposite(left, c.x, c.y, c.z, r)),
                (right, opposite(right, c.x, c.y, c.z, r)),
                (opposite(low, c.y, c.x, c.z, r), low),
                (opposite(high, c.y, c.x, c.z, r), high),
            ];
            let extremes = extremes.map(|(u, v)| (in_cells(u), in_cells(v)));
            self.touch(&chords, extremes, (low_row, high_row));
        }
    }

    /// Marks all cells that the ellipse meets: over each band of rows its widest run lies at the band's edges or
    /// at one of the ellipse's four extreme points.
    fn touch(&mut self, chords: &Chords, extremes: [(f32, f32); 4], rows: (f32, f32)) {
        let last = self.cells as f32;
        let (first, end) = (rows.0.clamp(0.0, last - 1.0), rows.1.clamp(0.0, last - 1.0));
        for band in first as usize..=end as usize {
            let (floor, ceiling) = (band as f32, band as f32 + 1.0);
            let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
            let inside = extremes.iter().filter(|p| p.1 >= floor && p.1 <= ceiling).map(|p| (p.0, p.0));
            let edges = [chords.ends(floor), chords.ends(ceiling)];
            for (a, b) in inside.chain(edges).filter(|(a, b)| a <= b) {
                (low, high) = (low.min(a), high.max(b));
            }
            if low <= high && high >= 0.0 && low <= last {
                let (low, high) = (low.clamp(0.0, last - 1.0) as u32, high.clamp(0.0, last - 1.0) as u32);
                self.touched[band] |= (((1u64 << (high + 1)) - 1) & !((1u64 << low) - 1)) as u32;
            }
        }
    }

    /// One ray to every corner: hidden where the blocker is met before the lamp.
    fn draw_rays(&mut self, cone: &Cone, centre: Vec3, radius: f32) {
        let step = 2.0 / self.cells as f32;
        let tangent = (centre.length_squared() - radius * radius).max(0.0);
        let lamp_tangent = (cone.distance + cone.lamp_radius) * (cone.distance - cone.lamp_radius).max(0.0);
        for j in 0..=self.cells {
            let mut bits = 0u64;
            for i in 0..=self.cells {
                let direction = cone.direction(i as f32 * step - 1.0, j as f32 * step - 1.0);
                let along = centre.dot(direction);
                let inside = along * along - tangent;
                // Outside its rim the lamp counts as far as the rim.
                let depth = direction.z * cone.distance;
                let lamp = depth - (depth * depth - lamp_tangent).max(0.0).sqrt();
                let hit = inside > 0.0 && along > 0.0 && along - inside.sqrt() < lamp;
                bits |= u64::from(hit) << i;
            }
            self.corners[j] |= bits;
        }
        if self.policy == Policy::Conservative {
            for j in 0..self.cells {
                let any = self.corners[j] | self.corners[j + 1];
                self.touched[j] |= (any | (any >> 1)) as u32 & row_mask(self.cells);
            }
        }
    }
}

/// The lowest `cells` bits.
pub(super) fn row_mask(cells: usize) -> u32 {
    ((1u64 << cells) - 1) as u32
}

/// Where, along one axis of the square, the conic of a sphere begins and ends; `along` and `depth` are the
/// sphere's coordinates. Solves r² (1 + w²) = (along - depth w)².
fn extent(along: f32, depth: f32, r: f32) -> (f32, f32) {
    let a = depth * depth - r * r;
    let root = r * (along * along + a).max(0.0).sqrt();
    ((along * depth - root) / a, (along * depth + root) / a)
}

/// The other coordinate of the conic's point that is extreme along one axis, at w there.
fn opposite(w: f32, along: f32, across: f32, depth: f32, r: f32) -> f32 {
    across * (along * w + depth) / (along * along + depth * depth - r * r)
}

/// The chords of one conic with the rows of corners, in cells.
struct Chords {
    c: Vec3,
    reach: f32,
    tangent: f32,
    /// Cells per unit of u, over the chord's denominator.
    scale: f32,
    step: f32,
    spread: f32,
    half: f32,
    last: f32,
}

impl Chords {
    fn new(c: Vec3, r: f32, spread: f32, cells: usize) -> Chords {
        let half = 0.5 * cells as f32;
        let scale = half / (spread * (c.y * c.y + c.z * c.z - r * r));
        Chords {
            c,
            reach: r * r,
            tangent: c.length_squared() - r * r,
            scale,
            step: spread / half,
            spread,
            half,
            last: cells as f32,
        }
    }

    /// First and last corner of the chord in row j, as real numbers; the first behind the last where there is none.
    #[inline(always)]
    fn ends(&self, j: f32) -> (f32, f32) {
        let v = j * self.step - self.spread;
        let q = self.c.y * v + self.c.z;
        let off = self.c.y - self.c.z * v;
        let discriminant = self.reach * (1.0 + v * v) - off * off;
        let root = (self.tangent * discriminant.max(0.0)).sqrt();
        let (low, high) = ((self.c.x * q - root) * self.scale, (self.c.x * q + root) * self.scale);
        let none = if discriminant < 0.0 || q <= 0.0 { 1e6 } else { 0.0 };
        (low + self.half + none, high + self.half - none)
    }

    /// Hidden corners of eight rows.
    #[inline(always)]
    fn corner_bits(&self, first: usize) -> [u64; LANES] {
        let mut from = [0u32; LANES];
        let mut to = [0u32; LANES];
        for k in 0..LANES {
            let (low, high) = self.ends((first + k) as f32);
            // The least whole number from `low` up, and one more than the greatest up to `high`; a corner on the
            // very edge may go either way.
            let low = (low + 0.499_99).clamp(0.0, self.last + 1.0) + ROUNDING;
            let high = (high + 0.500_01).clamp(0.0, self.last + 1.0) + ROUNDING;
            from[k] = low.to_bits() & 63;
            to[k] = high.to_bits() & 63;
        }
        std::array::from_fn(|k| ((1u64 << to[k]) - 1) & !((1u64 << from[k]) - 1))
    }
}
