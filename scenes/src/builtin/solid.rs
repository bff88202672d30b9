//! Walls, slabs and rooms as boxes that are filled and carved, and then skinned.
//!
//! All box faces together cut space into a rectilinear grid; each cell holds matter or nothing, and the skin is
//! every face between the two. So there are no holes, no overlaps and no hidden faces, and since each grid line is
//! divided once for all, no T-junctions: the skin is closed. A cell may also be `Hidden`: something round stands
//! there (a column, an arch), drawn by another hand; no face is drawn against it.
//!
//! Coordinates are rounded to 0.1 mm. Skin that is bent by a map stays closed.

use std::collections::HashMap;

use glam::{IVec3, Vec3};

use super::draft::{Draft, Facing, Grid, Paint, has_area, mean_normals, split};

/// Coordinates are whole multiples of this many metres, so that box faces that should meet do.
const STEP: f64 = 1e-4;

/// What a box holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fill {
    /// Air.
    Empty,
    /// Something that is drawn elsewhere, up to the borders of the box.
    Hidden,
    /// Stone, with this skin.
    Matter(Paint),
}

/// Boxes, later ones in place of earlier ones.
#[derive(Debug, Default)]
pub struct Solid {
    blocks: Vec<(IVec3, IVec3, Fill)>,
    sheets: Vec<Sheet>,
    cuts: [Vec<i32>; 3],
}

/// A flat pane without thickness.
#[derive(Debug)]
struct Sheet {
    lo: Vec3,
    hi: Vec3,
    facing: Vec3,
    paint: Paint,
}

/// Where the grid's lines are, in metres.
#[derive(Debug)]
pub struct Lines {
    /// Ascending coordinates along x, y, z: box faces and what lies between them.
    fine: [Vec<f32>; 3],
    /// Which of these are box faces.
    coarse: [Vec<usize>; 3],
}

impl Solid {
    /// Fills the box between two opposite corners, over what was there.
    pub fn fill(&mut self, lo: impl Into<Vec3>, hi: impl Into<Vec3>, fill: Fill) {
        let (a, b) = (snap(lo.into()), snap(hi.into()));
        self.blocks.push((a.min(b), a.max(b), fill));
    }

    /// Fills with matter.
    pub fn add(&mut self, lo: impl Into<Vec3>, hi: impl Into<Vec3>, paint: Paint) {
        self.fill(lo, hi, Fill::Matter(paint));
    }

    /// Takes away.
    pub fn carve(&mut self, lo: impl Into<Vec3>, hi: impl Into<Vec3>) {
        self.fill(lo, hi, Fill::Empty);
    }

    /// Hangs a pane, flat in the axis in which both corners agree, seen from where `facing` points.
    pub fn sheet(&mut self, lo: impl Into<Vec3>, hi: impl Into<Vec3>, facing: Vec3, paint: Paint) {
        self.sheets.push(Sheet { lo: lo.into(), hi: hi.into(), facing, paint });
    }

    /// Asks for `n` equal parts between two coordinates of an axis (0, 1, 2 for x, y, z).
    pub fn divide(&mut self, axis: usize, lo: f32, hi: f32, n: usize) {
        let at = |i: usize| snap(Vec3::splat(lo + (hi - lo) * i as f32 / n as f32)).x;
        self.cuts[axis].extend((0..=n).map(at));
    }

    /// Where the grid's lines run when no edge is longer than `edge` metres.
    pub fn lines(&self, edge: f32) -> Lines {
        let coarse: [Vec<i32>; 3] = std::array::from_fn(|axis| self.coarse(axis));
        let divided = coarse.map(|keys| divide(&keys, edge));
        let [x, y, z] = divided;
        Lines { fine: [x.0, y.0, z.0], coarse: [x.1, y.1, z.1] }
    }

    /// Adds the skin, each vertex moved by `bend`, which must keep left and right as they are.
    pub fn skin(&self, draft: &mut Draft, lines: &Lines, bend: impl Fn(Vec3) -> Vec3) {
        let cells = self.cells();
        for axis in 0..3 {
            for front in [false, true] {
                skin_side(draft, lines, &cells, Side { axis, front }, &bend);
            }
        }
        for sheet in &self.sheets {
            hang(draft, lines, sheet, &bend);
        }
    }

    fn coarse(&self, axis: usize) -> Vec<i32> {
        let mut keys = self.cuts[axis].clone();
        keys.extend(self.blocks.iter().flat_map(|(lo, hi, _)| [lo[axis], hi[axis]]));
        keys.sort_unstable();
        keys.dedup();
        keys
    }

    fn cells(&self) -> Cells {
        let keys: [Vec<i32>; 3] = std::array::from_fn(|axis| self.coarse(axis));
        let count = [0, 1, 2].map(|axis| keys[axis].len().saturating_sub(1));
        let mut cells = Cells { count, fill: vec![Fill::Empty; count.iter().product()] };
        for &(lo, hi, fill) in &self.blocks {
            let range = |axis: usize| {
                let at = |key: i32| keys[axis].partition_point(|&k| k < key);
                at(lo[axis])..at(hi[axis])
            };
            for z in range(2) {
                for y in range(1) {
                    let row = (z * count[1] + y) * count[0];
                    let x = range(0);
                    cells.fill[row + x.start..row + x.end].fill(fill);
                }
            }
        }
        cells
    }
}

impl Lines {
    /// The lines of an axis from one coordinate to another, both included.
    pub fn between(&self, axis: usize, lo: f32, hi: f32) -> Vec<f32> {
        // Half a step of slack takes in the ends whatever their rounding.
        let slack = 0.5 * STEP as f32;
        self.fine[axis].iter().copied().filter(|&c| c > lo - slack && c < hi + slack).collect()
    }
}

/// What each cell of the coarse grid holds.
struct Cells {
    count: [usize; 3],
    fill: Vec<Fill>,
}

impl Cells {
    fn at(&self, cell: [usize; 3]) -> Fill {
        let [x, y, z] = cell;
        self.fill[(z * self.count[1] + y) * self.count[0] + x]
    }

    /// The cell's neighbour across one of its sides; there is air outside.
    fn beyond(&self, mut cell: [usize; 3], side: Side) -> Fill {
        let edge = if side.front { self.count[side.axis] - 1 } else { 0 };
        if cell[side.axis] == edge {
            return Fill::Empty;
        }
        if side.front {
            cell[side.axis] += 1
        } else {
            cell[side.axis] -= 1
        }
        self.at(cell)
    }
}

/// One of the six sides of a cell: towards the end of an axis (`front`), or its beginning.
#[derive(Clone, Copy)]
struct Side {
    axis: usize,
    front: bool,
}

/// The faces of one side, welded where they lie in one plane and have one paint.
#[derive(Default)]
struct Skin {
    known: HashMap<([u32; 3], Paint), u32>,
    position: Vec<Vec3>,
    triangles: Vec<([u32; 3], Paint)>,
}

fn skin_side(draft: &mut Draft, lines: &Lines, cells: &Cells, side: Side, bend: &impl Fn(Vec3) -> Vec3) {
    let mut skin = Skin::default();
    let [nx, ny, nz] = cells.count;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let cell = [x, y, z];
                if let Fill::Matter(paint) = cells.at(cell)
                    && cells.beyond(cell, side) == Fill::Empty
                {
                    skin_face(&mut skin, lines, cell, side, paint, bend);
                }
            }
        }
    }
    add_skin(draft, skin);
}

/// The quadrilaterals of one face of one cell.
fn skin_face(
    skin: &mut Skin,
    lines: &Lines,
    cell: [usize; 3],
    side: Side,
    paint: Paint,
    bend: &impl Fn(Vec3) -> Vec3,
) {
    // u, v and the axis are right-handed in this order: u, v counter-clockwise is seen from the front.
    let (u, v) = ((side.axis + 1) % 3, (side.axis + 2) % 3);
    let plane = lines.coarse[side.axis][cell[side.axis] + usize::from(side.front)];
    let range = |axis: usize| lines.coarse[axis][cell[axis]]..lines.coarse[axis][cell[axis] + 1];
    for j in range(v) {
        for i in range(u) {
            let mut corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
            if !side.front {
                corners.reverse();
            }
            let quad = corners.map(|[cu, cv]| {
                let mut at = [plane; 3];
                (at[u], at[v]) = (cu, cv);
                vertex(skin, lines, at, paint, bend)
            });
            let two = split(quad, &skin.position);
            skin.triangles.extend(two.map(|t| (t, paint)));
        }
    }
}

fn vertex(skin: &mut Skin, lines: &Lines, at: [usize; 3], paint: Paint, bend: &impl Fn(Vec3) -> Vec3) -> u32 {
    *skin.known.entry((at.map(|i| i as u32), paint)).or_insert_with(|| {
        let point = Vec3::from_array(std::array::from_fn(|axis| lines.fine[axis][at[axis]]));
        skin.position.push(bend(point));
        skin.position.len() as u32 - 1
    })
}

fn add_skin(draft: &mut Draft, mut skin: Skin) {
    skin.triangles.retain(|(t, _)| has_area(t, &skin.position));
    let triangles: Vec<[u32; 3]> = skin.triangles.iter().map(|(t, _)| *t).collect();
    let normal = mean_normals(&triangles, &skin.position);
    let Some(&(_, paint)) = skin.triangles.first() else { return };
    let first = draft.scene.mesh.index.len();
    draft.add(paint, &skin.position, &normal, &triangles);
    for (i, (_, paint)) in skin.triangles.iter().enumerate() {
        draft.scene.mesh.material[first + i] = paint.material;
        draft.scene.mesh.group[first + i] = paint.group;
    }
}

fn hang(draft: &mut Draft, lines: &Lines, sheet: &Sheet, bend: &impl Fn(Vec3) -> Vec3) {
    let axis = sheet.facing.abs().max_position();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let across = lines.between(u, sheet.lo[u], sheet.hi[u]);
    let mut grid = Grid { columns: across.len(), point: Vec::new() };
    for &cv in &lines.between(v, sheet.lo[v], sheet.hi[v]) {
        grid.point.extend(across.iter().map(|&cu| {
            let mut p = sheet.lo;
            (p[u], p[v]) = (cu, cv);
            bend(p)
        }));
    }
    // The facing is bent as well: what a step of 1 mm becomes.
    let centre = 0.5 * (sheet.lo + sheet.hi);
    let facing = bend(centre + 1e-3 * sheet.facing) - bend(centre);
    draft.patch(sheet.paint, &grid, Facing::Along(facing));
}

fn snap(p: Vec3) -> IVec3 {
    (p.as_dvec3() / STEP).round().as_ivec3()
}

/// Lines no further apart than `edge`, and which of them are the given ones.
fn divide(keys: &[i32], edge: f32) -> (Vec<f32>, Vec<usize>) {
    let metres = |key: f64| (key * STEP) as f32;
    let (mut fine, mut coarse) = (Vec::new(), Vec::new());
    for pair in keys.windows(2) {
        let (a, b) = (f64::from(pair[0]), f64::from(pair[1]));
        // A hair less than the quotient, or rounding would make two of one exact edge.
        let n = ((b - a) * STEP / f64::from(edge) - 1e-6).ceil().max(1.0);
        coarse.push(fine.len());
        fine.extend((0..n as usize).map(|i| metres(a + (b - a) * i as f64 / n)));
    }
    coarse.push(fine.len());
    fine.extend(keys.last().map(|&key| metres(f64::from(key))));
    (fine, coarse)
}
