//! The shadow leaves of a mask, and how much of a product of lobes they take away.
//!
//! Cells whose corners are all hidden are dark; four dark cells make a dark parent; a leaf is the largest dark
//! cell. Each is a lobe with a weight ([`super::weights`]). Against the lobe r of reflectance times lamp,
//!
//! ```text
//! visible = 1 - Σ leaves w ∫ c r / F,     F = Σ over all cells of level 2 of w ∫ c r
//! ```
//!
//! (a lamp that the horizon cuts is the exception: r, a round lobe, would spill over it. There lamp and leaf are
//! multiplied first, which is exact in the leaf's share, and reflectance last.)
//!
//! F is 1 for a lamp high above the horizon of a diffuse surface; dividing by it makes a full mask dark also for
//! a narrow highlight or a lamp that is half set.
//!
//! Based on: Meunier et al., Cosine Lobes for Interactive Direct Lighting in Dynamic Scenes, 2009.

use std::f32::consts::TAU;

use glam::Vec3;

use super::blockers::LANES;
use super::mask::{Cone, Cover, MAX_CELLS, MAX_DEPTH, Mask, Policy, row_mask};
use super::profile::Profile;
use super::weights::{Between, Weights, compact, first_cell, leaf_exponent, place, relative_overlap};

/// Most leaves of a mask, in whole vectors per level.
const MAX_LEAVES: usize = MAX_CELLS * MAX_CELLS + LANES * (MAX_DEPTH as usize + 1);
/// Level whose full mask normalises; 16 cells.
const FULL_LEVEL: u32 = 2;
const LEVELS: usize = MAX_DEPTH as usize + 1;
/// Vectors of leaves from which on a profile, which costs as much as one, saves time.
const WORTH_A_PROFILE: usize = 2;

/// Leaves, as columns, level by level, each level padded to whole vectors with weight 0.
#[derive(Clone, Debug)]
pub(super) struct Leaves {
    x: [f32; MAX_LEAVES],
    y: [f32; MAX_LEAVES],
    z: [f32; MAX_LEAVES],
    weight: [f32; MAX_LEAVES],
    share: [f32; MAX_LEAVES],
    /// Where each level's leaves begin; ends where the next begins.
    begin: [usize; LEVELS + 1],
    exponent: [f32; LEVELS],
    /// Chord from the middle of the square to its corner, on the unit sphere.
    corner: f32,
    /// Leaves without the padding.
    pub n: u32,
    /// Share of the lamp in leaves too small for a lobe of their own.
    pub rest: f32,
}

/// In which order a leaf meets the other lobes, and so which weight it has.
#[derive(Clone, Copy, Debug)]
pub(super) enum Order {
    /// With the product of lamp and Lambert, by the weights of the calibration.
    Tabulated,
    /// With the product of a lamp of exponent `light` and a glossy lobe: w = f / (∫ c l / ∫ l), worked out here.
    Weighed {
        /// The lamp's exponent against that lobe.
        light: f32,
    },
    /// Lamp and leaf are one, the lobe c of the share f of the lamp; then with the reflectance lobe itself.
    LampFirst,
}

/// Overlaps with leaves of each level, where there are enough of them to be worth a profile.
pub(super) struct Profiles {
    /// With the product of lamp and reflectance.
    product: [Option<Profile>; LEVELS],
    /// With the lamp alone, for [`Order::Weighed`].
    light: [Option<Profile>; LEVELS],
}

impl Profiles {
    /// For the leaves of a mask and the full mask together.
    #[inline(always)]
    pub fn new(leaves: &Leaves, full: &Leaves, axis: Vec3, exponent: f32, order: Order) -> Profiles {
        let mut profiles = Profiles { product: [None; LEVELS], light: [None; LEVELS] };
        let light = match order {
            Order::LampFirst => return profiles,
            Order::Tabulated => None,
            Order::Weighed { light } => Some(light),
        };
        let corner = leaves.corner;
        let reach = axis.distance(Vec3::Z) + corner;
        for level in 1..LEVELS {
            if leaves.n_vectors(level) + full.n_vectors(level) < WORTH_A_PROFILE {
                continue;
            }
            let leaf =
                if leaves.n_vectors(level) > 0 { leaves.exponent[level] } else { full.exponent[level] };
            profiles.product[level] = profile(exponent, leaf, reach);
            profiles.light[level] = light.and_then(|light| profile(light, leaf, corner));
        }
        profiles
    }
}

/// Of [`relative_overlap`], up to a chord.
#[inline(always)]
fn profile(light: f32, leaf: f32, chord: f32) -> Option<Profile> {
    Profile::new(light, leaf, 0.5 * chord * chord, (light + 1.0) / TAU)
}

/// 1 - cos of the angle between unit vectors, which keeps small angles where both are near an axis.
#[inline(always)]
fn half_chord(a: Vec3, b: Vec3) -> f32 {
    0.5 * (a - b).length_squared()
}

/// Dark cells of all levels, as rows of bits.
struct Tree {
    dark: [[u32; MAX_CELLS]; LEVELS],
}

impl Leaves {
    pub fn new() -> Leaves {
        let zeros = [0.0; MAX_LEAVES];
        Leaves {
            x: zeros,
            y: zeros,
            z: zeros,
            weight: zeros,
            share: zeros,
            begin: [0; LEVELS + 1],
            exponent: [0.0; LEVELS],
            corner: 0.0,
            n: 0,
            rest: 0.0,
        }
    }

    /// Collects the leaves of a mask, and says whether it is dark all over, or lit.
    ///
    /// Leaves that hold less than `least` of the lamp get no lobe, and are added up in `rest`.
    #[inline(always)]
    pub fn collect(&mut self, mask: &Mask, cone: &Cone, weights: &Weights, least: f32) -> Cover {
        let depth = mask.cells.ilog2();
        let tree = Tree::new(mask, &weights.outside[depth as usize]);
        if tree.dark[0][0] & 1 != 0 {
            return Cover::Dark;
        }
        let between = weights.between(cone);
        self.start(cone);
        for level in 1..=depth {
            self.begin_level(level, cone);
            for j in 0..1 << level {
                let bits = tree.dark[level as usize][j] & !spread(tree.dark[level as usize - 1][j / 2]);
                self.add_row(bits & row_mask(1 << level), j, level, 1.0, (cone, &between, least));
            }
            if level == depth && mask.policy == Policy::Proportional {
                self.add_partial(mask, &tree, cone, weights, (&between, least));
            }
        }
        self.finish(depth);
        if self.n > 0 || self.rest > 0.0 { Cover::Partial } else { Cover::Lit }
    }

    /// The 16 cells of the full mask.
    #[inline(always)]
    pub fn collect_full(&mut self, cone: &Cone, weights: &Weights) {
        let between = weights.between(cone);
        self.start(cone);
        for level in 1..=FULL_LEVEL {
            self.begin_level(level, cone);
        }
        for j in 0..1 << FULL_LEVEL {
            self.add_row(row_mask(1 << FULL_LEVEL), j, FULL_LEVEL, 1.0, (cone, &between, 0.0));
        }
        self.finish(FULL_LEVEL);
    }

    fn start(&mut self, cone: &Cone) {
        self.corner = cone.direction(1.0, 1.0).distance(Vec3::Z);
        self.begin = [0; LEVELS + 1];
        self.n = 0;
        self.rest = 0.0;
    }

    /// Ends the level before and begins this one.
    fn begin_level(&mut self, level: u32, cone: &Cone) {
        let end = self.padded(self.begin[level as usize]);
        self.begin[level as usize] = end;
        self.begin[level as usize + 1] = end;
        self.exponent[level as usize] = leaf_exponent(cone, level);
    }

    /// Ends the deepest level; those below are empty.
    fn finish(&mut self, deepest: u32) {
        let end = self.padded(self.begin[deepest as usize + 1]);
        self.begin[deepest as usize + 1..].fill(end);
    }

    /// Fills up a vector with leaves of no weight.
    fn padded(&mut self, end: usize) -> usize {
        let whole = end.next_multiple_of(LANES);
        for k in end..whole {
            (self.weight[k], self.share[k]) = (0.0, 0.0);
            (self.x[k], self.y[k], self.z[k]) = (0.0, 0.0, 1.0);
        }
        whole
    }

    #[inline(always)]
    fn add_row(
        &mut self,
        mut bits: u32,
        j: usize,
        level: u32,
        part: f32,
        (cone, between, least): (&Cone, &Between<'_>, f32),
    ) {
        let row = first_cell(level) + (j << level);
        let q = place(j, level);
        while bits != 0 {
            let i = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let cell = between.cell(row + i);
            if cell.share * part <= least {
                self.rest += cell.share * part;
                continue;
            }
            let direction = cone.direction(place(i, level), q);
            let end = &mut self.begin[level as usize + 1];
            let k = *end;
            (self.x[k], self.y[k], self.z[k]) = (direction.x, direction.y, direction.z);
            (self.weight[k], self.share[k]) = (cell.weight * part, cell.share * part);
            *end += 1;
            self.n += 1;
        }
    }

    /// Cells of the deepest level with some corners hidden, in proportion.
    fn add_partial(
        &mut self,
        mask: &Mask,
        tree: &Tree,
        cone: &Cone,
        weights: &Weights,
        (between, least): (&Between<'_>, f32),
    ) {
        let depth = mask.cells.ilog2();
        let on_lamp = &weights.on_lamp[depth as usize];
        for j in 0..mask.cells {
            let hidden = [mask.corners[j] & on_lamp[j], mask.corners[j + 1] & on_lamp[j + 1]];
            let any = hidden[0] | hidden[1];
            let mut bits = (any | (any >> 1)) as u32 & !tree.dark[depth as usize][j] & row_mask(mask.cells);
            while bits != 0 {
                let i = bits.trailing_zeros();
                bits &= bits - 1;
                let count = |rows: [u64; 2]| {
                    ((rows[0] >> i & 3).count_ones() + (rows[1] >> i & 3).count_ones()) as f32
                };
                let part = count(hidden) / count([on_lamp[j], on_lamp[j + 1]]);
                self.add_row(1 << i, j, depth, part, (cone, between, least));
            }
        }
    }

    /// Σ w ∫ c r / ∫ r for the lobe r with this axis (in the cone's frame) and exponent; `profiles` were made for it.
    #[inline(always)]
    pub fn overlap(&self, axis: Vec3, exponent: f32, order: Order, profiles: &Profiles) -> f32 {
        let mut sum = [0.0; LANES];
        for level in 1..LEVELS {
            let leaf = self.exponent[level];
            let lanes = (self.begin[level]..self.begin[level + 1]).step_by(LANES);
            match (order, &profiles.product[level], &profiles.light[level]) {
                (Order::Tabulated, Some(profile), _) => lanes.for_each(|first| {
                    self.add(first, &mut sum, |weight, _, v| weight * profile.at(half_chord(axis, v)))
                }),
                (Order::Tabulated, None, _) => lanes.for_each(|first| {
                    self.add(first, &mut sum, |weight, _, v| {
                        weight * relative_overlap(exponent, leaf, axis, v)
                    })
                }),
                (Order::Weighed { .. }, Some(profile), Some(light)) => lanes.for_each(|first| {
                    self.add(first, &mut sum, |_, share, v| {
                        let whole = light.at(half_chord(Vec3::Z, v));
                        share * profile.at(half_chord(axis, v)) / whole.max(1e-20)
                    })
                }),
                (Order::Weighed { light }, ..) => lanes.for_each(|first| {
                    self.add(first, &mut sum, |_, share, v| {
                        let whole = relative_overlap(light, leaf, Vec3::Z, v);
                        share * relative_overlap(exponent, leaf, axis, v) / whole.max(1e-20)
                    })
                }),
                (Order::LampFirst, ..) => lanes.for_each(|first| {
                    self.add(first, &mut sum, |_, share, v| share * relative_overlap(leaf, exponent, axis, v))
                }),
            }
        }
        sum.iter().sum()
    }

    /// Axis, exponent and weight of every leaf's lobe, for the tests' own integrals.
    #[cfg(test)]
    pub fn lobes(&self, order: Order) -> Vec<(Vec3, f32, f32)> {
        let mut out = Vec::new();
        for level in 1..LEVELS {
            let leaf = self.exponent[level];
            for k in self.begin[level]..self.begin[level + 1] {
                let axis = Vec3::new(self.x[k], self.y[k], self.z[k]);
                let weight = match order {
                    Order::Weighed { light } => self.share[k] / relative_overlap(light, leaf, Vec3::Z, axis),
                    _ => self.weight[k],
                };
                if weight > 0.0 {
                    out.push((axis, leaf, weight));
                }
            }
        }
        out
    }

    fn n_vectors(&self, level: usize) -> usize {
        (self.begin[level + 1] - self.begin[level]) / LANES
    }

    /// Adds eight leaves: a function of weight, share and direction.
    #[inline(always)]
    fn add(&self, first: usize, sum: &mut [f32; LANES], term: impl Fn(f32, f32, Vec3) -> f32) {
        let lanes = first..first + LANES;
        let (x, y, z) = (&self.x[lanes.clone()], &self.y[lanes.clone()], &self.z[lanes.clone()]);
        let (weight, share) = (&self.weight[lanes.clone()], &self.share[lanes]);
        for k in 0..LANES {
            sum[k] += term(weight[k], share[k], Vec3::new(x[k], y[k], z[k]));
        }
    }
}

impl Tree {
    fn new(mask: &Mask, outside: &[u32; MAX_CELLS]) -> Tree {
        let depth = mask.cells.ilog2() as usize;
        let mut dark = [[0; MAX_CELLS]; LEVELS];
        for j in 0..mask.cells {
            let cells = match mask.policy {
                Policy::Conservative => mask.touched[j],
                Policy::Aggressive | Policy::Proportional => all_corners(mask, j),
            };
            dark[depth][j] = cells | outside[j];
        }
        for level in (0..depth).rev() {
            for j in 0..1 << level {
                let pair = dark[level + 1][2 * j] & dark[level + 1][2 * j + 1];
                dark[level][j] = compact(pair & (pair >> 1));
            }
        }
        Tree { dark }
    }
}

/// Cells whose corners are all hidden; corners beyond the lamp's rim do not matter.
fn all_corners(mask: &Mask, j: usize) -> u32 {
    let on_lamp = &super::weights::weights().on_lamp[mask.cells.ilog2() as usize];
    let row = |j: usize| mask.corners[j] | !on_lamp[j];
    let both = row(j) & row(j + 1);
    (both & (both >> 1)) as u32
}

/// Every one of the lower 16 bits twice.
fn spread(bits: u32) -> u32 {
    let mut b = bits & 0xffff;
    b = (b | (b << 8)) & 0x00ff_00ff;
    b = (b | (b << 4)) & 0x0f0f_0f0f;
    b = (b | (b << 2)) & 0x3333_3333;
    b = (b | (b << 1)) & 0x5555_5555;
    b | (b << 1)
}
