//! A mesh as cells that are inside or outside.
//!
//! Every column of cells, along each of the three axes, is a ray through the mesh; the crossings before a cell and
//! those after it are two opinions on whether it is inside: their winding number, or, if a mesh turns its triangles
//! this way and that, their parity. Four opinions of six decide, so that a hole that some rays leak through
//! does no harm.

use glam::{IVec3, UVec3, Vec3};
use lunette_relight::lobe::Sphere;

/// Empty cells around the mesh, for spheres that bulge.
const MARGIN: f32 = 3.0;
/// Opinions of six that make a cell inside.
const MAJORITY: u8 = 4;
/// Fewer cells than this are no body.
const LEAST_CELLS: usize = 8;

/// Cells of a box around a mesh; coordinates in cells have the first cell's corner at 0.
pub struct Grid {
    pub size: UVec3,
    /// Per cell, x fastest.
    pub inside: Vec<bool>,
    origin: Vec3,
    cell: f32,
}

/// One crossing of a column with the mesh: where, in cells, and whether it enters.
type Crossing = (f32, i32);

impl Grid {
    /// None when the mesh has no inside.
    pub fn new(position: &[Vec3], index: &[[u32; 3]], resolution: usize, shift: Vec3) -> Option<Grid> {
        let (low, high) = bounds(position, index);
        let cell = (high - low).max_element() / resolution as f32;
        if !(cell > 0.0 && cell.is_finite()) {
            return None;
        }
        let origin = low - cell * (Vec3::splat(MARGIN) + shift * 0.5);
        let size = ((high - origin) / cell + MARGIN).ceil().as_uvec3();
        let mut grid = Grid { size, inside: Vec::new(), origin, cell };
        let triangles: Vec<[Vec3; 3]> =
            index.iter().map(|t| t.map(|v| (position[v as usize] - origin) / cell)).collect();
        grid.inside = grid.decide(&triangles, parity);
        let by_parity = grid.n_inside();
        let wound = grid.decide(&triangles, winding);
        // Shells that overlap confuse parity, triangles turned this way and that confuse winding, and both lose.
        if wound.iter().filter(|&&inside| inside).count() >= by_parity {
            grid.inside = wound;
        }
        (grid.n_inside() >= LEAST_CELLS).then_some(grid)
    }

    fn n_inside(&self) -> usize {
        self.inside.iter().filter(|&&inside| inside).count()
    }

    /// Volume of the mesh \[m³\].
    pub fn volume(&self) -> f32 {
        self.n_inside() as f32 * self.cell.powi(3)
    }

    pub fn n_cells(&self) -> usize {
        self.size.element_product() as usize
    }

    pub fn at(&self, cell: IVec3) -> usize {
        (cell.x + self.size.x as i32 * (cell.y + self.size.y as i32 * cell.z)) as usize
    }

    pub fn cell_of(&self, at: usize) -> IVec3 {
        let (x, y) = (self.size.x as usize, self.size.y as usize);
        IVec3::new((at % x) as i32, (at / x % y) as i32, (at / (x * y)) as i32)
    }

    /// From cells to metres.
    pub fn to_world(&self, ball: &Sphere) -> Sphere {
        Sphere { centre: self.origin + ball.centre * self.cell, radius: ball.radius * self.cell }
    }

    /// From metres to cells.
    pub fn to_cells(&self, sphere: &Sphere) -> Sphere {
        Sphere { centre: (sphere.centre - self.origin) / self.cell, radius: sphere.radius / self.cell }
    }

    fn decide(&self, triangles: &[[Vec3; 3]], opinion: fn(&[Crossing]) -> bool) -> Vec<bool> {
        let turned: f32 = triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c))).sum();
        let sign = if turned < 0.0 { -1 } else { 1 };
        let mut votes = vec![0u8; self.n_cells()];
        for axis in 0..3 {
            self.vote(triangles, axis, sign, opinion, &mut votes);
        }
        votes.into_iter().map(|n| n >= MAJORITY).collect()
    }

    fn vote(
        &self,
        triangles: &[[Vec3; 3]],
        axis: usize,
        sign: i32,
        opinion: fn(&[Crossing]) -> bool,
        votes: &mut [u8],
    ) {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let width = self.size[u] as usize;
        let mut columns: Vec<Vec<Crossing>> = vec![Vec::new(); width * self.size[v] as usize];
        for triangle in triangles {
            cross_columns(triangle, (axis, u, v), sign, width, &mut columns);
        }
        for (at, column) in columns.iter_mut().enumerate().filter(|(_, column)| !column.is_empty()) {
            column.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut cell = IVec3::ZERO;
            (cell[u], cell[v]) = ((at % width) as i32, (at / width) as i32);
            for depth in 0..self.size[axis] as i32 {
                cell[axis] = depth;
                let before = column.partition_point(|c| c.0 < depth as f32 + 0.5);
                let (near, far) = column.split_at(before);
                votes[self.at(cell)] += u8::from(opinion(near)) + u8::from(opinion_after(far, opinion));
            }
        }
    }
}

/// Corners of the box around the vertices that triangles use.
pub fn bounds(position: &[Vec3], index: &[[u32; 3]]) -> (Vec3, Vec3) {
    let used = || index.iter().flatten().map(|&v| position[v as usize]);
    (used().fold(Vec3::INFINITY, Vec3::min), used().fold(Vec3::NEG_INFINITY, Vec3::max))
}

/// Seen from the other end, what leaves enters.
fn opinion_after(far: &[Crossing], opinion: fn(&[Crossing]) -> bool) -> bool {
    if opinion(&[(0.0, 1)]) && opinion(&[(0.0, -1)]) {
        return opinion(far);
    }
    far.iter().map(|c| -c.1).sum::<i32>() > 0
}

fn winding(crossings: &[Crossing]) -> bool {
    crossings.iter().map(|c| c.1).sum::<i32>() > 0
}

fn parity(crossings: &[Crossing]) -> bool {
    crossings.len() % 2 == 1
}

/// Adds a triangle to the columns whose middle it covers.
fn cross_columns(
    triangle: &[Vec3; 3],
    (axis, u, v): (usize, usize, usize),
    sign: i32,
    width: usize,
    columns: &mut [Vec<Crossing>],
) {
    let [a, b, c] = triangle;
    let area = (b[u] - a[u]) * (c[v] - a[v]) - (c[u] - a[u]) * (b[v] - a[v]);
    if area == 0.0 {
        return;
    }
    let range = |k: usize| {
        let low = a[k].min(b[k]).min(c[k]) - 0.5;
        let high = a[k].max(b[k]).max(c[k]) - 0.5;
        (low.ceil() as i32, high.floor() as i32)
    };
    let ((u_low, u_high), (v_low, v_high)) = (range(u), range(v));
    // A positive area faces along the axis: a ray along it leaves there.
    let enters = if area > 0.0 { -sign } else { sign };
    for j in v_low..=v_high {
        for i in u_low..=u_high {
            let (p, q) = (i as f32 + 0.5, j as f32 + 0.5);
            let edge = |s: &Vec3, t: &Vec3| covers(s, t, (u, v), (p, q)) / area;
            let (wa, wb, wc) = (edge(b, c), edge(c, a), edge(a, b));
            if wa >= 0.0 && wb >= 0.0 && wc >= 0.0 {
                let depth = wa * a[axis] + wb * b[axis] + wc * c[axis];
                columns[i as usize + width * j as usize].push((depth, enters));
            }
        }
    }
}

/// Twice the signed area of (s, t, point); one ulp beside 0 where a column meets an edge, so that of the two triangles
/// at an edge only one takes it.
fn covers(s: &Vec3, t: &Vec3, (u, v): (usize, usize), (p, q): (f32, f32)) -> f32 {
    // The same arithmetic whichever way the edge runs.
    let swap = (s[u], s[v]) > (t[u], t[v]);
    let (s, t) = if swap { (t, s) } else { (s, t) };
    let area = (t[u] - s[u]) * (q - s[v]) - (p - s[u]) * (t[v] - s[v]);
    let area = if area == 0.0 { f32::MIN_POSITIVE } else { area };
    if swap { -area } else { area }
}
