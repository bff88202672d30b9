//! Suns between vertices: what the light of small discs is at a point of a triangle, sharper than interpolation has it.
//!
//! The portal's rim and the depth of its wall are known from any point, not from vertices alone. What else hides the disc
//! is told by the rows of the triangle's corners: T/F of a texel is the share of it that is visible, and where it is
//! partial, the edge of the shadow in it is found as at a vertex ([`beam`](super::beam)). If what hides the disc is at
//! x = p + t ω, ω a direction from point p to the disc, corner v sees it in the direction x - v. So it sees a disc of its
//! own, whose T and F are added up over its texels, cut by their edges, and
//!
//! ```text
//! E = E if only these hid the disc x Σ over corners w T(v) / Σ over corners w F(v)
//! ```
//!
//! How far t is, rows do not say; but seen at the right distance the corners agree. Some distances are tried for each
//! triangle, as parts and multiples of the way to the window's plane, and that one is taken at which they do most.
//!
//! Where it breaks: where things at several distances hide the disc, those at others are blurred between the corners, as
//! plain interpolation has it; what no corner sees, as a leaf's shadow smaller than a triangle, is not there.

use glam::{Vec2, Vec3};

use super::beam::{Beam, Cut, Growth, Panes, Receivers, Scratch, line};
use super::{Lit, PortalFrame, Shaft};
use crate::cubemap::footprint::{Eye, Footprint};
use crate::cubemap::{self, face_axes, flat, n_texels, on_face};
use crate::sparse::{Rows, decode};

/// A point on a triangle, and of how much around it the mean is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Vertices of the triangle.
    pub corners: [u32; 3],
    /// Of each corner, at least 0; they add up to 1.
    pub weights: [f32; 3],
    /// Of a disc about the point, metres; 0 for the point alone.
    pub radius: f32,
}

/// Light between the vertices of a [`PortalFrame`]: for one thread, and best asked for all points of a triangle in a row.
/// It allocates.
pub struct Detail<'f, 'a> {
    frame: &'f PortalFrame<'a>,
    scratch: Box<Scratch>,
    /// Of each portal's beams, about the triangle that was asked for last.
    known: Vec<Known>,
    /// Of the point whose beams were asked for last.
    beams: Vec<(Vec3, Vec3)>,
}

/// What the corners of a triangle know about a beam.
#[derive(Default)]
struct Known {
    triangle: Option<[u32; 3]>,
    /// What arrives at each, and what would if nothing hid it.
    arrivals: [(f32, f32); 3],
    /// Asked for where something does.
    corners: [Corner; 3],
    depth: Option<Depth>,
}

/// What a corner knows about what hides a beam.
#[derive(Default)]
struct Corner {
    /// F and T/F of all texels, only about the beam; T/F is not a number where F is 0.
    whole: Vec<f32>,
    share: Vec<f32>,
    /// What has been asked for of what is lit within texels.
    edges: Vec<Option<Edge>>,
    /// What of texels the portal takes up: cells in the order of their texels, of which t has those from `start[t]` on.
    footprint: Footprint,
    order: Vec<u32>,
    start: Vec<u32>,
    position: Vec3,
    normal: Vec3,
    /// Room for a disc, and its texels.
    disc: Vec<Vec3>,
    pieces: Footprint,
}

/// What of a texel is lit.
#[derive(Clone, Copy)]
enum Edge {
    /// The same part everywhere.
    Even(f32),
    /// Before this side, in the face's coordinates.
    Line(Vec3),
}

/// Less than this part of what the disc sends through the window to the point says nothing, where corners see it.
const LEAST: f32 = 1e-3;

/// Distances that are tried, as parts of the way to the window's plane.
const PARTS: [f32; 11] = [1.0, 1.2, 1.5, 2.5, 0.8, 0.6, 0.4, 0.25, 0.15, 0.1, 0.06];

/// What corners see of a window counts where the least of them is this part of their mean.
const COMMON: f32 = 0.5;

/// Part of the doubt about the window's frame that another distance must stay below.
const CLEARLY: f32 = 0.85;

/// Part of what corners see of the window together at its frame's distance that they must see at others.
const MOST: f32 = 0.8;

/// Cosine of how far apart directions may be in which two points see the same.
const WIDEST: f32 = 0.92;

/// A texel is taken for lit or dark within this.
const LEAST_SHARE: f32 = 0.01;

/// Seen to this part a disc is seen whole.
const WHOLE: f32 = 0.999;

impl Point {
    /// Mean of what the corners have.
    pub(crate) fn mean(&self, of: &[[f32; 3]]) -> Vec3 {
        self.corners.iter().zip(self.weights).map(|(v, weight)| weight * Vec3::from(of[*v as usize])).sum()
    }
}

/// How far what hides a beam from a triangle is.
#[derive(Clone, Copy)]
struct Depth {
    /// Centre and normal of the window; none for what is far beyond it.
    plane: Option<(Vec3, Vec3)>,
    /// Of the way to it.
    part: f32,
}

impl<'f, 'a> Detail<'f, 'a> {
    /// Of a frame, as its portals are lit.
    pub fn new(frame: &'f PortalFrame<'a>) -> Detail<'f, 'a> {
        Detail { frame, scratch: Box::default(), known: Vec::new(), beams: Vec::new() }
    }

    /// What is to be added to the direct irradiance that a point has by interpolation between its triangle's corners, as
    /// [`PortalFrame::direct`] wrote it: suns given as discs then are as sharp on the triangle as the portal is.
    ///
    /// # Panics
    /// When there are no such vertices.
    pub fn at(&mut self, point: &Point) -> [f32; 3] {
        let mut more = Vec3::ZERO;
        self.each(point, |shaft, known, found, _| {
            if let Some(found) = found {
                let corners = known.arrivals.iter().zip(point.weights);
                let plain: f32 = corners.map(|((seen, _), weight)| weight * seen).sum();
                more += (found - plain) * shaft.radiance;
            }
        });
        more.to_array()
    }

    /// The direction to each beam, and its irradiance of a point.
    pub(crate) fn beams(&mut self, point: &Point) -> &[(Vec3, Vec3)] {
        let mut beams = std::mem::take(&mut self.beams);
        beams.clear();
        self.each(point, |shaft, _, found, scratch| {
            let corners = || point.corners.iter().zip(point.weights);
            let mut plain =
                || corners().map(|(v, weight)| weight * shaft.irradiance(*v as usize, scratch)).sum();
            let irradiance = found.map_or_else(&mut plain, |found| found * shaft.radiance);
            beams.push((shaft.axis(), irradiance));
        });
        self.beams = beams;
        &self.beams
    }

    /// Of each beam what it sends to a point at radiance 1, as [`Known::transfer`] has it.
    fn each(&mut self, point: &Point, mut met: impl FnMut(&Shaft, &Known, Option<f32>, &mut Scratch)) {
        let frame = self.frame;
        let lit = frame.portals.iter().filter(|p| p.lit == Lit::Bright);
        let shafts = lit.flat_map(|portal| portal.shafts(&frame.receivers));
        for (i, shaft) in shafts.enumerate() {
            if self.known.len() == i {
                self.known.push(Known::default());
            }
            let found = self.known[i].transfer(&shaft, point, &mut self.scratch);
            met(&shaft, &self.known[i], found, &mut self.scratch);
        }
    }
}

impl Known {
    /// What a beam of radiance 1 sends to a point; `None` where that is best interpolated between its triangle's corners. Else
    /// `arrivals` are theirs.
    fn transfer(&mut self, shaft: &Shaft, point: &Point, scratch: &mut Scratch) -> Option<f32> {
        let Shaft { beam, receivers, panes, rows, .. } = *shaft;
        let vertices = point.corners.map(|v| v as usize);
        let n_open = vertices.iter().filter(|v| panes.is_open(**v)).count();
        let p = point.mean(receivers.position);
        let place = |v: usize| Vec3::from(receivers.position[v]);
        let is_reached =
            || beam.may_reach(p, panes) || vertices.iter().any(|&v| beam.may_reach(place(v), panes));
        // Triangles that reach from inside to outside are left as they are.
        if !(n_open == 3 || (n_open == 0 && is_reached())) || vertices.iter().all(|&v| rows.is_dark(v)) {
            return None;
        }
        if self.triangle != Some(point.corners) {
            self.triangle = Some(point.corners);
            self.arrivals = vertices.map(|v| beam.arrival(v, receivers, (panes, rows), scratch));
            self.depth = None;
        }
        if self.arrivals.iter().all(|(seen, open)| *seen == 0.0 && *open > 0.0) {
            return None;
        }
        let spot = (p, point.mean(receivers.normal).normalize_or_zero(), point.radius);
        let window = (panes, receivers);
        let Some((open, rim)) = beam.open_transfer(spot, n_open == 3, window, scratch) else {
            return Some(0.0);
        };
        if self.arrivals.iter().all(|(seen, open)| *open > 0.0 && *seen >= WHOLE * open) {
            return Some(open);
        }
        let depth = match self.depth {
            Some(depth) => depth,
            None => {
                for (corner, v) in self.corners.iter_mut().zip(vertices) {
                    corner.learn((beam, panes), rows, (place(v), receivers.normal[v].into()), v);
                }
                *self.depth.insert(find_depth(
                    &mut self.corners,
                    beam,
                    window,
                    (point.corners, rows.n()),
                    scratch,
                ))
            }
        };
        let (mut light, mut whole) = (0.0, 0.0);
        for (corner, weight) in self.corners.iter_mut().zip(point.weights).filter(|(_, weight)| *weight > 0.0)
        {
            let at = corner.position;
            let (t, f) = corner.see(rows.n(), rim.iter().map(|d| depth.seen_from(p, *d, at)));
            light += weight * t;
            whole += weight * f;
        }
        if whole <= LEAST * open {
            // Seen from the corners, nothing of the window is there: what they have themselves must do.
            let corners = self.arrivals.iter().zip(point.weights);
            (light, whole) =
                corners.fold((0.0, 0.0), |(t, f), ((seen, open), w)| (t + w * seen, f + w * open));
        }
        let share = if whole > 0.0 { (light / whole).min(1.0) } else { 0.0 };
        Some(share * open)
    }
}

/// Where the corners agree most about what hides a beam.
fn find_depth(
    corners: &mut [Corner; 3],
    beam: &Beam,
    (panes, receivers): (&Panes, &Receivers),
    (triangle, n): ([u32; 3], usize),
    scratch: &mut Scratch,
) -> Depth {
    let at = triangle.map(|v| Vec3::from(receivers.position[v as usize]));
    let middle = at.iter().sum::<Vec3>() / 3.0;
    let plane = beam.plane(middle, panes, scratch);
    let far = Depth { plane: None, part: 1.0 };
    let near = PARTS.map(|part| Depth { plane, part });
    let (mut best, mut most) = ((f32::INFINITY, far), 0.0f32);
    for depth in near.into_iter().filter(|_| plane.is_some()).chain([far]) {
        let (doubt, all) = find_doubt(corners, beam, (middle, at), &depth, n);
        // The first is the window's frame, and likelier than others; and no others may be looked at past the window.
        if doubt < best.0 * all && all > MOST * most {
            best = (doubt / all * if most > 0.0 { 1.0 } else { CLEARLY }, depth);
            most = most.max(all);
        }
    }
    best.1
}

/// How much the corners contradict each other, if what hides the beam is there, and of how much that is all; of nothing
/// where they look in too different directions.
fn find_doubt(
    corners: &mut [Corner; 3],
    beam: &Beam,
    (p, at): (Vec3, [Vec3; 3]),
    depth: &Depth,
    n: usize,
) -> (f32, f32) {
    let (mut doubt, mut all) = (0.0, 0.0);
    for direction in beam.middles() {
        let seen = at.map(|v| depth.seen_from(p, direction, v));
        if seen.iter().any(|d| d.dot(direction) < WIDEST * d.length() * direction.length()) {
            return (0.0, 0.0);
        }
        let looks: [(f32, f32); 3] = std::array::from_fn(|i| corners[i].look(n, seen[i]));
        let (light, whole) = looks.iter().fold((0.0, 0.0), |(t, f), look| (t + look.0, f + look.1));
        let least = looks.iter().map(|look| look.1).fold(f32::INFINITY, f32::min);
        // Who looks past the window has no say.
        if 3.0 * least > COMMON * whole {
            let share = light / whole;
            doubt += looks.iter().map(|(t, f)| (t - share * f).abs()).sum::<f32>();
            all += whole;
        }
    }
    (doubt, all)
}

impl Depth {
    /// The direction in which another point sees what `p` sees in this one.
    fn seen_from(&self, p: Vec3, direction: Vec3, other: Vec3) -> Vec3 {
        let Some((centre, normal)) = self.plane else { return direction };
        let way = self.part * normal.dot(centre - p) / normal.dot(direction);
        let seen = p + way * direction - other;
        if way > 0.0 && seen.is_finite() { seen } else { direction }
    }
}

impl Corner {
    fn learn(&mut self, (beam, panes): (&Beam, &Panes), rows: &Rows, (p, n): (Vec3, Vec3), v: usize) {
        let side = rows.n();
        let light = decode(side, &rows.row(v));
        self.whole.clear();
        self.whole.resize(n_texels(side), 0.0);
        self.footprint.clear();
        let eye = Eye { origin: p, normal: n, n: side };
        if panes.is_open(v) {
            self.footprint.add_hemisphere(&eye);
        } else {
            let footprint = &mut self.footprint;
            beam.for_each_near(p, panes, |origin, polygon| {
                footprint.add_polygon(&Eye { origin, ..eye }, 0, polygon);
            });
        }
        self.footprint.cells.iter().for_each(|cell| self.whole[cell.texel] += cell.worth);
        (self.position, self.normal) = (p, n);
        self.order.clear();
        self.order.extend(0..self.footprint.cells.len() as u32);
        self.order.sort_unstable_by_key(|&c| (self.footprint.cells[c as usize].texel, c));
        self.start.clear();
        self.start.resize(n_texels(side) + 1, 0);
        self.footprint.cells.iter().for_each(|cell| self.start[cell.texel + 1] += 1);
        (0..n_texels(side)).for_each(|t| self.start[t + 1] += self.start[t]);
        let share = |(t, f): (&f32, &f32)| if *f > 0.0 { (t / f).clamp(0.0, 1.0) } else { f32::NAN };
        self.share.clear();
        self.share.extend(light.iter().zip(&self.whole).map(share));
        self.edges.clear();
        self.edges.resize(n_texels(side), None);
    }

    /// T and F of a convex polygon, by directions to its corners.
    fn see(&mut self, n: usize, directions: impl Iterator<Item = Vec3>) -> (f32, f32) {
        self.disc.clear();
        self.disc.extend(directions);
        let mut pieces = std::mem::take(&mut self.pieces);
        pieces.clear();
        pieces.add_polygon(&Eye { origin: Vec3::ZERO, normal: self.normal, n }, 0, &self.disc);
        let (mut light, mut whole) = (0.0, 0.0);
        for piece in &pieces.cells {
            let (face, [column, row]) = cubemap::place(n, piece.texel);
            if self.start[piece.texel] == self.start[piece.texel + 1] {
                continue;
            }
            let horizon = flat(face_axes(face), self.normal);
            let edge = self.edge(n, [face, column, row]);
            for cell in self.cells(piece.texel) {
                let part = within(Cut::new(pieces.points(piece)), cell);
                let all = part.worth(horizon);
                whole += all;
                light += edge.lit(&part, all, horizon);
            }
        }
        self.pieces = pieces;
        (light, whole)
    }

    /// Where the shadow's edge is in a texel.
    fn edge(&mut self, n: usize, place: [usize; 3]) -> Edge {
        let texel = (place[0] * n + place[2]) * n + place[1];
        let edge = self.edges[texel].unwrap_or_else(|| self.find_edge(n, place));
        self.edges[texel] = Some(edge);
        edge
    }

    /// T and F of a square as large as a texel about a direction.
    fn look(&mut self, n: usize, direction: Vec3) -> (f32, f32) {
        let (face, at) = on_face(n, direction);
        let low = (at - 0.5).clamp(Vec2::ZERO, Vec2::splat(n as f32 - 1.0));
        let [axis, s, t] = face_axes(face);
        let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y].map(|corner| {
            let p = (low + corner) * (2.0 / n as f32) - 1.0;
            axis + p.x * s + p.y * t
        });
        self.see(n, corners.into_iter())
    }

    /// What of a texel the portal takes up.
    fn cells(&self, texel: usize) -> impl Iterator<Item = &[Vec2]> {
        let cells = &self.order[self.start[texel] as usize..self.start[texel + 1] as usize];
        cells.iter().map(|&c| self.footprint.points(&self.footprint.cells[c as usize]))
    }

    /// Where the shadow's edge is in a texel, by the shares of those around it on its face.
    fn find_edge(&self, n: usize, [face, column, row]: [usize; 3]) -> Edge {
        let at = |x: usize, y: usize| (face * n + y) * n + x;
        let own = self.share[at(column, row)];
        if own <= LEAST_SHARE || own >= 1.0 - LEAST_SHARE {
            return Edge::Even(own);
        }
        let mut growth = Growth::default();
        for y in row.saturating_sub(1)..(row + 2).min(n) {
            for x in column.saturating_sub(1)..(column + 2).min(n) {
                let to = Vec2::new(x as f32 - column as f32, y as f32 - row as f32);
                let share = self.share[at(x, y)];
                if share.is_finite() && to != Vec2::ZERO {
                    growth.add(to, self.whole[at(x, y)], self.whole[at(column, row)], share - own);
                }
            }
        }
        let (way, trust) = growth.way();
        if trust < 0.5 {
            return Edge::Even(own);
        }
        let cells: Vec<Cut> = self.cells(at(column, row)).map(Cut::new).collect();
        Edge::Line(line(&cells, way, own, flat(face_axes(face), self.normal)))
    }
}

impl Edge {
    /// What of a part of the texel, worth `all`, is lit.
    fn lit(self, part: &Cut, all: f32, horizon: Vec3) -> f32 {
        match self {
            Edge::Even(share) => share * all,
            Edge::Line(side) => part.clipped(side).worth(horizon),
        }
    }
}

/// The part of a convex polygon in another.
fn within(part: Cut, polygon: &[Vec2]) -> Cut {
    let middle = polygon.iter().sum::<Vec2>() / polygon.len().max(1) as f32;
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().zip(next).fold(part, |part, (a, b)| {
        let along = *b - *a;
        let side = Vec3::new(-along.y, along.x, along.y * a.x - along.x * a.y);
        let side = if side.dot(middle.extend(1.0)) < 0.0 { -side } else { side };
        part.clipped(side)
    })
}
