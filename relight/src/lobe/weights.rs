//! The overlap weights of shadow leaves, calibrated by the program.
//!
//! A leaf is a square of the mask; its lobe c spreads beyond it, and the lamp's lobe l is brighter in the middle
//! than at the rim, where the lamp is neither. The weight of a leaf makes up for both: with f the share of the
//! lamp's cap that lies in the leaf,
//!
//! ```text
//! w ∫ c l dv = f ∫ l dv
//! ```
//!
//! so that the leaves of a full mask, of whatever sizes, take away all of the light. f is the exact solid
//! angle (by sampling the cell); the integral is the same [`product_integral`] that the frame uses, so that its
//! error cancels. Weights depend on the leaf's level and place and on the lamp's angular radius; they are made
//! once, in a few milliseconds, at fifteen radii, and interpolated.
//!
//! The paper sets such weights by hand, per level and distance.
//!
//! Based on: Meunier et al., Cosine Lobes for Interactive Direct Lighting in Dynamic Scenes, 2009.

use std::sync::OnceLock;

use glam::Vec3;

use super::lamp::cap_exponent;
use super::mask::{Cone, MAX_CELLS, MAX_DEPTH, MAX_SPREAD, row_mask};
use super::product_integral;

/// tan σ at which the plane square is calibrated; below the first, weights no longer change.
const SPREADS: [f32; 11] = [0.02, 0.15, 0.3, 0.5, 0.75, 1.0, 1.3, 1.6, 1.95, 2.35, MAX_SPREAD];
/// cos σ at which the equal-area square is calibrated.
const COSINES: [f32; 4] = [0.343, 0.23, 0.115, 0.0];
/// Samples along a side of a cell of the deepest level.
const SAMPLES: usize = 4;
/// Cells of all levels, the root's place included.
const N_CELLS: usize = {
    let (mut n, mut level) = (0, 0);
    while level <= MAX_DEPTH {
        n += 1 << (2 * level);
        level += 1;
    }
    n
};

/// Weight and share of one cell.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cell {
    /// w of the module's documentation, for the lamp's lobe against Lambert.
    pub weight: f32,
    /// f of the module's documentation, 0..=1; all cells of a level add up to 1.
    pub share: f32,
}

/// The calibration at all radii, and which corners and cells lie on the lamp.
pub(super) struct Weights {
    planes: Vec<[Cell; N_CELLS]>,
    /// Per depth: corners that count, as rows of bits: those within the lamp's rim, and all four of a cell that
    /// holds some of the lamp but has no corner on it.
    pub on_lamp: [Corners; MAX_DEPTH as usize + 1],
    /// Per depth: cells that hold nothing of the lamp, as rows of bits.
    pub outside: [Cells; MAX_DEPTH as usize + 1],
}

/// Between which calibrations a lamp lies.
#[derive(Clone, Copy)]
pub(super) struct Between<'a> {
    below: &'a [Cell; N_CELLS],
    above: &'a [Cell; N_CELLS],
    t: f32,
}

impl Between<'_> {
    #[inline(always)]
    pub fn cell(&self, index: usize) -> Cell {
        let (a, b) = (self.below[index], self.above[index]);
        Cell {
            weight: a.weight + self.t * (b.weight - a.weight),
            share: a.share + self.t * (b.share - a.share),
        }
    }
}

/// The calibration, made on first use.
pub(super) fn weights() -> &'static Weights {
    static WEIGHTS: OnceLock<Weights> = OnceLock::new();
    WEIGHTS.get_or_init(Weights::calibrate)
}

/// Where a level's cells begin.
#[inline(always)]
pub(super) fn first_cell(level: u32) -> usize {
    ((1usize << (2 * level)) - 1) / 3
}

/// Centre of a cell along one side of the square.
#[inline(always)]
pub(super) fn place(i: usize, level: u32) -> f32 {
    (2 * i + 1) as f32 / (1u32 << level) as f32 - 1.0
}

/// Exponent of the lobe of a leaf: of the cap around its corners, of the same solid angle.
#[inline(always)]
pub(super) fn leaf_exponent(cone: &Cone, level: u32) -> f32 {
    // Half the diagonal of the cell, squared, relative to the square's half side.
    let diagonal = 2.0 / (1u32 << (2 * level)) as f32;
    let versine = if cone.wide {
        diagonal * (1.0 - cone.cos)
    } else {
        let squared = diagonal * cone.spread * cone.spread;
        squared / (1.0 + squared + (1.0 + squared).sqrt())
    };
    (1.0 / versine - 1.0).max(0.0)
}

impl Weights {
    fn calibrate() -> Weights {
        let on_lamp = |depth: usize| std::array::from_fn(|row| corner_row(depth, row));
        let mut on_lamp: [Corners; MAX_DEPTH as usize + 1] = std::array::from_fn(on_lamp);
        let outside = outside_cells(&on_lamp[MAX_DEPTH as usize]);
        for (depth, (corners, outside)) in on_lamp.iter_mut().zip(&outside).enumerate() {
            need_all_corners(corners, outside, 1 << depth);
        }
        let plane = SPREADS.iter().map(|&spread| cone_of(1.0 / (1.0 + spread * spread).sqrt(), false));
        let wide = COSINES.iter().map(|&cos| cone_of(cos, true));
        let planes = plane.chain(wide).map(|cone| calibrate_one(&cone, &outside)).collect();
        Weights { planes, on_lamp, outside }
    }

    /// The calibrations around a lamp's angular radius.
    pub fn between(&self, cone: &Cone) -> Between<'_> {
        let (first, nodes, x): (_, &[f32], _) =
            if cone.wide { (SPREADS.len(), &COSINES, cone.cos) } else { (0, &SPREADS, cone.spread) };
        let descends = nodes[0] > nodes[1];
        let beyond = |node: f32| if descends { node <= x } else { node >= x };
        let k = (1..nodes.len() - 1).find(|&k| beyond(nodes[k])).unwrap_or(nodes.len() - 1);
        let t = ((x - nodes[k - 1]) / (nodes[k] - nodes[k - 1])).clamp(0.0, 1.0);
        Between { below: &self.planes[first + k - 1], above: &self.planes[first + k], t }
    }
}

fn cone_of(cos: f32, wide: bool) -> Cone {
    let sin = (1.0 - cos * cos).sqrt();
    let mut cone = Cone::new(Vec3::ZERO, Vec3::Z, 1.0, sin);
    (cone.wide, cone.cos, cone.sin) = (wide, cos, sin);
    cone
}

fn corner_row(depth: usize, row: usize) -> u64 {
    let cells = 1 << depth;
    let place = |i: usize| 2.0 * i as f32 / cells as f32 - 1.0;
    let inside = |i: usize| place(i).powi(2) + place(row).powi(2) < 1.0 + 1e-5;
    (0..=cells).filter(|&i| row <= cells && inside(i)).fold(0, |bits, i| bits | (1 << i))
}

/// Rows of corners, and rows of cells, as bits.
type Corners = [u64; MAX_CELLS + 1];
type Cells = [u32; MAX_CELLS];

/// Cells that hold nothing of the lamp, for every depth: those of the deepest level with no corner on it, and
/// those above that hold only such.
fn outside_cells(deepest: &Corners) -> [Cells; MAX_DEPTH as usize + 1] {
    let mut outside = [[0; MAX_CELLS]; MAX_DEPTH as usize + 1];
    for (row, cells) in outside[MAX_DEPTH as usize].iter_mut().enumerate() {
        let any = deepest[row] | deepest[row + 1];
        *cells = !(any | (any >> 1)) as u32;
    }
    for depth in (0..MAX_DEPTH as usize).rev() {
        for j in 0..1 << depth {
            let pair = outside[depth + 1][2 * j] & outside[depth + 1][2 * j + 1];
            outside[depth][j] = compact(pair & (pair >> 1));
        }
    }
    outside
}

fn need_all_corners(corners: &mut Corners, outside: &Cells, n_cells: usize) {
    let counted = *corners;
    for row in 0..n_cells {
        let any = counted[row] | counted[row + 1];
        let cells = u64::from(!((any | (any >> 1)) as u32 | outside[row]) & row_mask(n_cells));
        corners[row] |= cells | (cells << 1);
        corners[row + 1] |= cells | (cells << 1);
    }
}

/// The even bits, moved together.
pub(super) fn compact(bits: u32) -> u32 {
    let mut b = bits & 0x5555_5555;
    b = (b | (b >> 1)) & 0x3333_3333;
    b = (b | (b >> 2)) & 0x0f0f_0f0f;
    b = (b | (b >> 4)) & 0x00ff_00ff;
    (b | (b >> 8)) & 0x0000_ffff
}

/// Shares from the deepest level up, then weights.
fn calibrate_one(cone: &Cone, outside: &[Cells; MAX_DEPTH as usize + 1]) -> [Cell; N_CELLS] {
    let mut cells = [Cell::default(); N_CELLS];
    let first = first_cell(MAX_DEPTH);
    for (index, cell) in cells[first..].iter_mut().enumerate() {
        let (i, j) = (index % MAX_CELLS, index / MAX_CELLS);
        let counts = outside[MAX_DEPTH as usize][j] >> i & 1 == 0;
        cell.share = if counts { solid_angle(cone, i, j) } else { 0.0 };
    }
    let total: f32 = cells[first..].iter().map(|cell| cell.share).sum();
    cells[first..].iter_mut().for_each(|cell| cell.share /= total);
    for level in (0..MAX_DEPTH).rev() {
        let n = 1 << level;
        for (i, j) in (0..n * n).map(|k| (k % n, k / n)) {
            let below = first_cell(level + 1) + 4 * n * j + 2 * i;
            let children = [below, below + 1, below + 2 * n, below + 2 * n + 1];
            cells[first_cell(level) + n * j + i].share = children.iter().map(|&k| cells[k].share).sum();
        }
    }
    (0..=MAX_DEPTH).for_each(|level| weigh(cone, level, &mut cells));
    cells
}

/// Solid angle of the part of a deepest cell that lies on the lamp, up to a constant.
fn solid_angle(cone: &Cone, i: usize, j: usize) -> f32 {
    let at = |i: usize, k: usize| (2 * (SAMPLES * i + k) + 1) as f32 / (SAMPLES * MAX_CELLS) as f32 - 1.0;
    let density = |p: f32, q: f32| match p * p + q * q {
        rho if rho > 1.0 => 0.0,
        _ if cone.wide => 1.0,
        rho => (1.0 + rho * cone.spread * cone.spread).powf(-1.5),
    };
    (0..SAMPLES * SAMPLES).map(|k| density(at(i, k % SAMPLES), at(j, k / SAMPLES))).sum()
}

fn weigh(cone: &Cone, level: u32, cells: &mut [Cell; N_CELLS]) {
    let (light, _) = cap_exponent(cone.sin * cone.sin, 1.0);
    let exponent = leaf_exponent(cone, level);
    let n = 1usize << level;
    for (i, j) in (0..n * n).map(|k| (k % n, k / n)) {
        let cell = &mut cells[first_cell(level) + n * j + i];
        let leaf = cone.direction(place(i, level), place(j, level));
        let overlap = relative_overlap(light, exponent, Vec3::Z, leaf);
        cell.weight = cell.share / overlap.max(1e-20);
    }
}

/// ∫ l c dv / ∫ l dv for lobes of scale 1, in the cone's frame, with the small angle between axes kept exact.
#[inline(always)]
pub(super) fn relative_overlap(light: f32, leaf: f32, axis: Vec3, direction: Vec3) -> f32 {
    let dot = axis.dot(direction);
    let versine = if dot > 0.0 { axis.cross(direction).length_squared() / (1.0 + dot) } else { 1.0 - dot };
    product_integral(light, leaf, versine.clamp(0.0, 2.0)) * (light + 1.0) * std::f32::consts::FRAC_1_PI * 0.5
}
