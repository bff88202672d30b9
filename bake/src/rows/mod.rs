//! Direct light on a cubemap: per vertex how much each texel of a shell contributes,
//!
//! T\[t\] = ∫ over texel t of V(ω) max(n·ω, 0) dω,
//!
//! V being 1 where the ray along ω is clear to infinity; for a portal's shell, where it also passes that portal first
//! of all portals. One endless shadow ray answers for the inside and for backward occlusion outside, as portals block
//! nothing.
//!
//! The share of each texel that the opening covers, and what the depth of the wall around it leaves of that, is known
//! exactly ([`footprint`](lunette_relight::cubemap::footprint), [`Pane`]), so that rays are spent on what is in the way alone: T = Σ over openings F (Σ w V / Σ w), with a few stratified rays
//! within each piece, and more where a piece or its neighbour is seen in part. Where nothing is in the way the row is
//! exact, however small or near the window, on its very plane too.
//!
//! Where it breaks: what is in the way and thinner than the few rays of a texel are apart may be missed.
//!
//! Based on: Y. Yue et al., Interactive Rendering of Interior Scenes with Dynamic Environment Illumination, 2009,
//! section 4.1.2, which samples directions, or points of the portal, and sorts the rays into texels: here each texel
//! samples its own part of the portal, which has less variance than either.

mod store;

use glam::{Vec2, Vec3};
use lunette_ffi as ffi;
use lunette_relight::cubemap::footprint::{Cell, Eye, Footprint};
use lunette_relight::portal_frame::Pane;

use crate::Surface;
use crate::portal::Gates;
use crate::sampling::{LANES, fractions, hash};
pub use store::{Lies, Stage, encode};

/// Rays of a vertex, in the mean, that look for what is in the way.
const FIRST: usize = 256;

/// Rays of a piece: at first at least, and where something is in the way at least and at most: a rose of hundreds of panes
/// has as many pieces.
const FEWEST: usize = 2;
const REFINED: (usize, usize) = (2, 128);

/// Rays at edges of shadows for each ray that a vertex is granted: suns are as straight as these find edges to be.
const EDGE_SHARE: usize = 2;

/// How near to a portal's plane, as a share of the way to it, another portal counts as lying in it. Nearer to the plane than the
/// lift of rays, rounding is more than that.
const SAME_PLANE: f32 = 1e-4;

/// What of a texel has been found.
const SEEN: u8 = 1;
const HIDDEN: u8 = 2;

/// Through what light enters.
pub enum Opening<'a> {
    /// From everywhere but through portals, if there are any.
    Sky(Option<&'a Gates>),
    /// Through a portal.
    Portal {
        /// All portals.
        gates: &'a Gates,
        /// Of this one.
        panes: Vec<Pane>,
    },
}

/// What the rows of one shell need.
pub struct Aim<'a> {
    pub surface: &'a Surface<'a>,
    pub opening: Opening<'a>,
    /// Texels on a side of a face.
    pub n: usize,
    /// Rays that a vertex spends on edges of shadows.
    pub rays: usize,
    pub seed: u64,
}

/// A vertex's row, dense; reused from vertex to vertex.
pub struct Row {
    /// sr, \[6 n²\].
    pub dense: Vec<f32>,
    /// Where it is not 0.
    texels: Vec<usize>,
    footprint: Footprint,
    /// What is seen of a polygon.
    seen: [Vec<Vec3>; 2],
    /// Of each texel whether something of it is seen, or hidden.
    state: Vec<u8>,
    /// Of each cell: sum of weights, and of those that see.
    sums: Vec<[f32; 2]>,
}

impl Row {
    /// An empty row of 6 n² texels.
    pub fn new(n: usize) -> Row {
        let texels = 6 * n * n;
        Row {
            dense: vec![0.0; texels],
            texels: Vec::new(),
            footprint: Footprint::default(),
            seen: Default::default(),
            state: vec![0; texels],
            sums: Vec::new(),
        }
    }

    /// Texels from which light comes, each once, and what they contribute, sr.
    fn lit(&self) -> impl Iterator<Item = (usize, f32)> {
        self.texels.iter().map(|&t| (t, self.dense[t]))
    }

    /// Whether any light comes.
    pub fn is_lit(&self) -> bool {
        !self.texels.is_empty()
    }

    /// Adds what another opening sends to the same vertex.
    pub fn add(&mut self, other: &Row) {
        for (t, value) in other.lit() {
            if self.dense[t] == 0.0 {
                self.texels.push(t);
            }
            self.dense[t] += value;
        }
    }

    /// Makes it dark.
    pub fn clear(&mut self) {
        self.texels.iter().for_each(|&t| self.dense[t] = 0.0);
        for cell in &self.footprint.cells {
            self.state[cell.texel] = 0;
        }
        self.texels.clear();
        self.footprint.clear();
    }
}

impl Aim<'_> {
    /// Computes the row of vertex `v` as if it lay where vertex `at` lies.
    pub fn row(&self, v: usize, at: usize, row: &mut Row) {
        row.clear();
        let eye = Eye { origin: self.surface.origin[at], normal: self.surface.mesh.normal[at], n: self.n };
        match &self.opening {
            Opening::Sky(_) => row.footprint.add_hemisphere(&eye),
            Opening::Portal { panes, .. } => {
                for (i, pane) in panes.iter().enumerate() {
                    pane.seen_from(eye.origin, &mut row.seen);
                    row.footprint.add_polygon(&eye, i, &row.seen[0]);
                }
            }
        }
        let n_cells = row.footprint.cells.len();
        row.sums.clear();
        row.sums.resize(n_cells, [0.0; 2]);
        let first = (FIRST / n_cells.max(1)).max(FEWEST);
        self.look(v, &eye, 0..n_cells, 0..first, row);
        // A piece whose first rays all agree may have an edge all the same, which shows once its neighbours are refined.
        let mut is_refined = vec![false; n_cells];
        let mut more = 0;
        loop {
            let is_new = |c: &usize| !is_refined[*c] && is_edge(&row.state, self.n, &row.footprint.cells[*c]);
            let edges: Vec<usize> = (0..n_cells).filter(is_new).collect();
            if edges.is_empty() {
                break;
            }
            if more == 0 {
                more = (EDGE_SHARE * self.rays / edges.len()).clamp(REFINED.0, REFINED.1);
            }
            edges.iter().for_each(|&c| is_refined[c] = true);
            self.look(v, &eye, edges.into_iter(), first..first + more, row);
        }
        for (cell, [all, seen]) in row.footprint.cells.iter().zip(&row.sums) {
            if *seen > 0.0 {
                if row.dense[cell.texel] == 0.0 {
                    row.texels.push(cell.texel);
                }
                row.dense[cell.texel] += cell.worth * (seen / all).min(1.0);
            }
        }
    }

    /// Sends rays `samples` through each of some cells.
    fn look(
        &self,
        v: usize,
        eye: &Eye,
        cells: impl Iterator<Item = usize>,
        samples: std::ops::Range<usize>,
        row: &mut Row,
    ) {
        let mut rays = Rays::default();
        for c in cells {
            let cell = row.footprint.cells[c];
            let id = (cell.texel * 64 + cell.polygon) as u64;
            let start = fractions(hash(self.seed ^ (v as u64) << 20, id));
            for j in samples.clone() {
                let (d, weight) = row.footprint.sample(eye, &cell, spread(start, j));
                if weight > 0.0 && rays.push(c, d, weight) {
                    self.trace(eye, &mut rays, row);
                }
            }
        }
        self.trace(eye, &mut rays, row);
    }

    /// Adds up the rays that are clear and meet no portal before their own.
    fn trace(&self, eye: &Eye, rays: &mut Rays, row: &mut Row) {
        let n = std::mem::take(&mut rays.n);
        if n == 0 {
            return;
        }
        let mut packet = ffi::Packet::<LANES>::default();
        for lane in 0..n {
            packet.set(lane, &ffi::Ray::new(eye.origin.into(), rays.d[lane].into()));
        }
        let mask = ffi::Mask::first(n);
        let is_barred = self.is_barred((eye, row), rays, n, &packet);
        self.surface.tree.occluded_packet(&mask, &mut packet);
        for (lane, is_barred) in is_barred.into_iter().enumerate().take(n) {
            let cell = rays.cell[lane];
            let is_seen = !packet.is_occluded(lane) && !is_barred;
            let sums = &mut row.sums[cell];
            sums[0] += rays.weight[lane];
            sums[1] += if is_seen { rays.weight[lane] } else { 0.0 };
            row.state[row.footprint.cells[cell].texel] |= if is_seen { SEEN } else { HIDDEN };
        }
    }

    /// For each ray whether another portal lies before its own, to which the light then belongs.
    fn is_barred(
        &self,
        (eye, row): (&Eye, &Row),
        rays: &Rays,
        n: usize,
        packet: &ffi::Packet<LANES>,
    ) -> [bool; LANES] {
        let (gates, panes) = match &self.opening {
            Opening::Sky(None) => return [false; LANES],
            Opening::Sky(Some(gates)) => return gates.any(&ffi::Mask::first(n), packet),
            Opening::Portal { gates, .. } if gates.lie_in_one_plane() => return [false; LANES],
            Opening::Portal { gates, panes } => (gates, panes),
        };
        let mut packet = *packet;
        for lane in 0..n {
            let pane = &panes[row.footprint.cells[rays.cell[lane]].polygon];
            let height = pane.height(eye.origin) * (1.0 - SAME_PLANE) - self.surface.lift;
            let way = -height / rays.d[lane].dot(pane.normal());
            packet.tfar[lane] = if way.is_finite() { way.max(0.0) } else { 0.0 };
        }
        gates.any(&ffi::Mask::first(n), &packet)
    }
}

/// Whether a cell's texel, or a neighbour of it on its face, is seen in part, or else than it.
fn is_edge(state: &[u8], n: usize, cell: &Cell) -> bool {
    let (at, row, column) = (cell.texel, cell.texel / n % n, cell.texel % n);
    let neighbours = [
        (column > 0).then(|| at - 1),
        (column + 1 < n).then(|| at + 1),
        (row > 0).then(|| at - n),
        (row + 1 < n).then(|| at + n),
    ];
    let around = neighbours.into_iter().flatten().fold(state[at], |s, t| s | state[t]);
    around == SEEN | HIDDEN
}

/// Point `j` of a sequence that fills the unit square evenly from a random start.
///
/// Based on: M. Roberts, The Unreasonable Effectiveness of Quasirandom Sequences, 2018.
fn spread(start: Vec2, j: usize) -> Vec2 {
    const STEP: Vec2 = Vec2::new(0.754_877_7, 0.569_840_3);
    (start + j as f32 * STEP).fract()
}

/// Up to a packet of rays.
#[derive(Default)]
struct Rays {
    cell: [usize; LANES],
    d: [Vec3; LANES],
    weight: [f32; LANES],
    n: usize,
}

impl Rays {
    /// Adds one; whether the packet is full.
    fn push(&mut self, cell: usize, d: Vec3, weight: f32) -> bool {
        (self.cell[self.n], self.d[self.n], self.weight[self.n]) = (cell, d, weight);
        self.n += 1;
        self.n == LANES
    }
}
