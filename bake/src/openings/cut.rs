//! The smallest surface that parts inside from outside: a minimum cut of the grid.
//!
//! Cells from which hardly a ray escapes are inside, cells from which most do are outside. The links between
//! neighbours are pipes, as wide as the area of the surfaces that cut them (in 26 directions, so that slanted surfaces
//! cost what level ones do); the most that flows through them from inside to outside fills the narrowest places, and
//! where several are as narrow, the outermost is taken. A pipe through glass is thinner, so that the surface settles
//! on a pane rather than elsewhere in its reveal.
//!
//! Based on: Boykov & Kolmogorov, Computing Geodesics and Minimal Surfaces via Graph Cuts, 2003; Dinitz, Algorithm
//! for Solution of a Problem of Maximum Flow, 1970.
//!
//! Where it breaks: an opening narrower than a cell may be missed; an interior with an opening that shows its
//! deepest corner much of the sky has no inside.

use super::grid::{FREE, GLASS, Grid, N_HALF, STEPS};
use crate::Error;
use crate::sampling::hash;

/// Directions from a cell.
const N_ALL: usize = 2 * N_HALF;

/// Widths of the links to neighbours across faces, edges and corners: the solid angle nearest to each direction over
/// its length, 0.0457, 0.0366 / √2 and 0.0352 / √3 of the sphere, in whole numbers.
const WIDTH: [u8; 3] = [9, 5, 4];
/// The same through glass: a fifth.
const GLASS_WIDTH: [u8; 3] = [2, 1, 1];
/// What a unit of area, in cell faces, cuts of them: 9 + 4 · 5 + 4 · 4.
const WIDTH_PER_FACE: f32 = 45.0;

/// Inside, where fewer rays escape past glass in its place. The deepest point of a room whose whole wall is missing
/// has 0.064 if it is a cube.
const INSIDE: f32 = 0.08;
/// And where walls are at least so far away in the mean, as a share of the edge of a cube of the grid's size: the
/// hollow of a wall is no inside.
const ROOMY: f32 = 0.1;
/// Outside, where more rays escape past glass in its place. A plane hole in a wall has 0.5, the air between the open
/// windows of a car up to 0.6.
const OUTSIDE: f32 = 0.7;
/// The same on the border of the grid, where something outside may hide much.
const OUTSIDE_ON_BORDER: f32 = 0.1;

/// What may be inside presses outwards: gained volume counts like this much area for each cubic metre, over the edge
/// of a cube of the grid's size. Else the surface would shrink onto the furniture of a room whose whole wall is missing,
/// or onto the belt of a car. Of a hole smaller than the room it bulges only a little.
const PUSH: f32 = 3.0;
/// What may be: where fewer rays escape, with all glass away. It ends at a window's plane.
const PUSHED: f32 = 0.45;

/// Of an interior's parts that no free way joins, those smaller than this share of the largest one that has openings
/// are none: a wheel's housing is no room.
const SMALLEST_PART: f32 = 0.1;

/// What a cell is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Inside,
    Outside,
    /// In solid matter, in a cavity without openings, or in a nook too small to be a room.
    Neither,
}

/// A link that the surface cuts.
#[derive(Clone, Copy, Debug)]
pub(super) struct CutLink {
    /// The cell inside.
    pub inside: usize,
    /// From the one outside to the one inside, in cells, times the link's width.
    pub inwards: glam::Vec3,
    /// Middle between the two.
    pub at: glam::Vec3,
    /// Whether a pane is there.
    pub through_glass: bool,
}

/// Of each cell which side it is on.
///
/// # Errors
/// [`Error::NoInterior`] where no cell is surely inside.
pub(super) fn sides(grid: &Grid, seed: u64) -> Result<Vec<Side>, Error> {
    let n = grid.link.len();
    let source: Vec<bool> = (0..n).map(|c| is_inside(grid, c)).collect();
    if !source.contains(&true) {
        return Err(Error::NoInterior);
    }
    let sink: Vec<bool> = (0..n).map(|c| is_outside(grid, c)).collect();
    let push = PUSH * WIDTH_PER_FACE / (n as f32).cbrt();
    let pushed = |c: usize| match grid.view[c] {
        _ if source[c] => ENDLESS,
        view if view.clear <= PUSHED && is_roomy(grid, c) => {
            // Rounded up or down at random: the mean counts.
            let random = (hash(seed, c as u64) >> 40) as f32 / (1u64 << 24) as f32;
            (push + random) as u32
        }
        _ => 0,
    };
    let mut flow = Flow::new(grid, (0..n).map(pushed).collect());
    while flow.advance(&sink) {}
    let outside = flow.reaching(&sink);
    Ok(rooms(grid, &source, &sink, &outside))
}

fn is_inside(grid: &Grid, cell: usize) -> bool {
    grid.view[cell].empty <= INSIDE && is_roomy(grid, cell)
}

fn is_roomy(grid: &Grid, cell: usize) -> bool {
    grid.view[cell].reach >= ROOMY * grid.extent
}

fn is_outside(grid: &Grid, cell: usize) -> bool {
    let open = grid.view[cell].empty;
    open >= OUTSIDE || open >= OUTSIDE_ON_BORDER && grid.on_border(cell)
}

/// The links between the sides.
pub(super) fn cut_links(grid: &Grid, sides: &[Side]) -> Vec<CutLink> {
    let mut cut = Vec::new();
    for inside in (0..sides.len()).filter(|c| sides[*c] == Side::Inside) {
        for direction in 0..N_ALL {
            let Some((outside, link)) = grid.step(inside, direction) else { continue };
            if link & FREE == 0 || sides[outside] != Side::Outside {
                continue;
            }
            let (p, q) = (grid.middle(inside), grid.middle(outside));
            let inwards = (p - q) / grid.size * f32::from(WIDTH[rank(direction)]);
            let through_glass = link & GLASS != 0;
            cut.push(CutLink { inside, inwards, at: 0.5 * (p + q), through_glass });
        }
    }
    cut
}

/// 0 across a face, 1 across an edge, 2 across a corner.
fn rank(direction: usize) -> usize {
    STEPS[direction % N_HALF].iter().filter(|s| **s != 0).count() - 1
}

struct Flow<'a> {
    grid: &'a Grid,
    stride: [isize; N_ALL],
    /// What each cell can still feed in.
    fed: Vec<u32>,
    /// What each link still carries, by cell and direction; nothing where it would leave the grid.
    left: Vec<[u8; N_ALL]>,
    level: Vec<u32>,
}

const UNSEEN: u32 = u32::MAX;
/// A source that never runs dry.
const ENDLESS: u32 = u32::MAX;

impl<'a> Flow<'a> {
    fn new(grid: &'a Grid, fed: Vec<u32>) -> Flow<'a> {
        let width = |cell: usize, direction: usize| match grid.step(cell, direction) {
            Some((_, link)) if link & GLASS != 0 => GLASS_WIDTH[rank(direction)],
            Some((_, link)) if link & FREE != 0 => WIDTH[rank(direction)],
            _ => 0,
        };
        let left = (0..fed.len()).map(|c| std::array::from_fn(|d| width(c, d))).collect();
        Flow { grid, stride: grid.strides(), level: vec![UNSEEN; fed.len()], fed, left }
    }

    /// The cell at the other end of a link that carries something.
    fn next(&self, cell: usize, direction: usize) -> usize {
        cell.wrapping_add_signed(self.stride[direction])
    }

    /// Sends as much as goes along shortest ways; false once nothing goes.
    fn advance(&mut self, sink: &[bool]) -> bool {
        if !self.find_levels(sink) {
            return false;
        }
        let mut tried = vec![0_u8; sink.len()];
        let mut way = Vec::new();
        for start in 0..sink.len() {
            while self.fed[start] > 0 && self.send(start, sink, &mut tried, &mut way) {}
        }
        true
    }

    /// Steps from the sources to each cell, as far as the sink.
    fn find_levels(&mut self, sink: &[bool]) -> bool {
        self.level.fill(UNSEEN);
        let mut front: Vec<usize> = (0..sink.len()).filter(|c| self.fed[*c] > 0 && !sink[*c]).collect();
        front.iter().for_each(|&c| self.level[c] = 0);
        for level in 1.. {
            let mut further = Vec::new();
            let mut arrived = false;
            for &cell in &front {
                for direction in (0..N_ALL).filter(|d| self.left[cell][*d] > 0) {
                    let next = self.next(cell, direction);
                    if self.level[next] == UNSEEN {
                        self.level[next] = level;
                        arrived |= sink[next];
                        further.push(next);
                    }
                }
            }
            if arrived || further.is_empty() {
                return arrived;
            }
            front = further;
        }
        false
    }

    /// Sends along one way from `start` to the sink; `tried` remembers directions that lead nowhere.
    fn send(&mut self, start: usize, sink: &[bool], tried: &mut [u8], way: &mut Vec<(usize, usize)>) -> bool {
        way.clear();
        let mut cell = start;
        while !sink[cell] {
            let direction = tried[cell] as usize;
            if direction == N_ALL {
                let Some((before, _)) = way.pop() else { return false };
                tried[before] += 1;
                cell = before;
                continue;
            }
            let leads_on = self.left[cell][direction] > 0
                && self.level[self.next(cell, direction)] == self.level[cell].wrapping_add(1);
            if leads_on {
                way.push((cell, direction));
                cell = self.next(cell, direction);
            } else {
                tried[cell] += 1;
            }
        }
        let narrowest = way.iter().map(|&(c, d)| self.left[c][d]).min().unwrap_or(0);
        let sent = u32::from(narrowest).min(self.fed[start]);
        if self.fed[start] != ENDLESS {
            self.fed[start] -= sent;
        }
        for &(c, d) in way.iter() {
            self.left[c][d] -= sent as u8;
            let next = self.next(c, d);
            self.left[next][(d + N_HALF) % N_ALL] += sent as u8;
        }
        sent > 0
    }

    /// Cells from which the sink can still be reached: outside of the outermost narrowest surface.
    fn reaching(&self, sink: &[bool]) -> Vec<bool> {
        let mut reaches = sink.to_vec();
        let mut open: Vec<usize> = (0..sink.len()).filter(|c| sink[*c]).collect();
        while let Some(cell) = open.pop() {
            for direction in 0..N_ALL {
                let Some((before, _)) = self.grid.step(cell, direction) else { continue };
                if !reaches[before] && self.left[before][(direction + N_HALF) % N_ALL] > 0 {
                    reaches[before] = true;
                    open.push(before);
                }
            }
        }
        reaches
    }
}

/// Inside are the cells that hang together with a source within the surface, if they are many and have an opening.
///
/// Beside a pane single cells are cut off from the pane's own side, where the surface is rounder than the pane; a side
/// is what air joins, not what glass lets see.
fn rooms(grid: &Grid, source: &[bool], sink: &[bool], outside: &[bool]) -> Vec<Side> {
    let mut part_of = vec![NONE; outside.len()];
    flood(grid, (0..outside.len()).filter(|c| sink[*c]).collect(), OPEN_AIR, &mut part_of, |c| outside[c]);
    let mut sizes = Vec::new();
    for seed in 0..outside.len() {
        if source[seed] && !outside[seed] && part_of[seed] == NONE {
            sizes.push(flood(grid, vec![seed], sizes.len() as u32, &mut part_of, |c| !outside[c]));
        }
    }
    // The cells that are cut off go to the side that air joins them to.
    let known: Vec<usize> = (0..outside.len()).filter(|c| part_of[*c] != NONE).collect();
    for cell in known {
        let part = part_of[cell];
        flood(grid, vec![cell], part, &mut part_of, |_| true);
    }
    let is_open = opened(grid, &part_of, sizes.len());
    let largest = sizes.iter().zip(&is_open).filter(|(_, open)| **open).map(|(n, _)| *n).max().unwrap_or(0);
    let is_room = |part: u32| {
        let part = part as usize;
        is_open.get(part) == Some(&true) && sizes[part] as f32 >= SMALLEST_PART * largest as f32
    };
    let side = |&part: &u32| match part {
        OPEN_AIR => Side::Outside,
        part if is_room(part) => Side::Inside,
        _ => Side::Neither,
    };
    part_of.iter().map(side).collect()
}

/// Neither outside nor in a part of the interior.
const NONE: u32 = u32::MAX;
/// Outside.
const OPEN_AIR: u32 = u32::MAX - 1;

/// Marks the cells that air joins to `open` and that may be marked; how many are.
fn flood(
    grid: &Grid,
    mut open: Vec<usize>,
    part: u32,
    part_of: &mut [u32],
    may: impl Fn(usize) -> bool,
) -> usize {
    open.iter().for_each(|&c| part_of[c] = part);
    let mut n = 0;
    while let Some(cell) = open.pop() {
        n += 1;
        for (next, link) in (0..N_ALL).filter_map(|d| grid.step(cell, d)) {
            if link == FREE && part_of[next] == NONE && may(next) {
                part_of[next] = part;
                open.push(next);
            }
        }
    }
    n
}

/// Of each part whether air or glass joins it to the open air.
fn opened(grid: &Grid, part_of: &[u32], n: usize) -> Vec<bool> {
    let mut is_open = vec![false; n];
    for (cell, &part) in part_of.iter().enumerate().filter(|(_, part)| (**part as usize) < n) {
        let mut links = (0..N_ALL).filter_map(|d| grid.step(cell, d));
        is_open[part as usize] |= links.any(|(next, link)| link & FREE != 0 && part_of[next] == OPEN_AIR);
    }
    is_open
}
