//! Small discs of light through a portal, a sun above all, sharper than the texels of its cubemap.
//!
//! A row says how much of a texel's light arrives, not from where in the texel. Two things are known besides. The
//! portal's own rim: seen from a vertex, a convex polygon is the cone within the planes through the vertex and the
//! polygon's edges, so that the portal's part of texel t, and what all of it would send, can be worked out:
//! F\[t\] = ∫ over t ∩ portal of max(n·ω, 0) dω; the depth of the wall around it cuts the cone as exactly
//! ([`reveal`]). And the row: T/F is the share of that part which nothing hides. Where
//! it lies between 0 and 1, the edge of the shadow is taken for a straight line that leaves this share on its lit
//! side, and that lies across the way in which the shares of the texels around grow. Then
//!
//! ```text
//! E = L Σ over texels t of ∫ over disc ∩ t ∩ portal ∩ lit side of max(n·ω, 0) dω
//! ```
//!
//! A vertex stands for its cell of the mesh, a third of its triangles, and where the beam's edge crosses the cell the mean
//! over it is wanted: a beam sampled at points here and there has not its own power, which shows in all that it lights.
//! Cells are blurred as if the disc were so much larger as the cell is, seen from the window; discs of a few sizes are
//! kept ready.
//!
//! Which polygons the disc may shine through is told by balls around some of them together; only the rows of vertices that
//! it reaches are read, at the few texels that it touches and around them.
//!
//! Where it breaks: of three polygons in a row, what all have in common is taken off once too often; what hides the sun
//! from near by is blurred as if it were as far as the window; shadows whose edge bends within a texel, or that have two;
//! bars and leaves finer than texels dim the disc evenly; a share within [`ROUNDING`] of nothing or of all counts as that,
//! since rows are rounded; integrals over cut texels take the middle for the mean, which is 1e-3 off at 32 texels on a
//! side and 1e-2 at 8.
//!
//! Based on: D. L. Youngs, Time-Dependent Multi-Material Flow with Large Fluid Distortion, 1982 (edges from shares).

use std::f32::consts::PI;
use std::ops::Range;

use glam::{Vec2, Vec3};

use crate::asset::{Asset, Data, Error};
use crate::cubemap::footprint::{Eye, Footprint, clip, clip_each, vector_area};
use crate::cubemap::{face_axes, flat, place};
use crate::indirect::vertex_area;
use crate::light::Cap;
use crate::portal_frame::reveal::{Pane, Reveal};
use crate::sparse::{Basis, Probe, Rows};

/// Discs of a larger radius than this, radians, are left to the texels, against which they are broad.
const LARGEST: f32 = 0.125;

/// By how much discs are enlarged for cells, radians: at first, and then twice as much each time up to [`LARGEST`].
const LEAST_BLUR: f32 = 0.004;

/// Corners of the polygon that stands for a disc.
const CORNERS: usize = 24;

/// Polygons that share a ball.
const GROUP: usize = 16;

/// A share of what is visible that is this near to 0 or 1 is taken for it: what rows lose of a texel, in pulses and in
/// wavelets, of which small ones are dropped.
const ROUNDING: [f32; 2] = [0.02, 0.06];

/// Of that, what is so near that no edge is looked for.
const CLEAR: f32 = 0.25;

/// How much shares grow from texel to texel, below which there is no edge, but bars or leaves; and above which there is
/// one: across a straight edge they grow by 0.5.
const GROWTH: (f32, f32) = (0.1, 0.3);

/// A texel of which the portal takes less than this part of what it takes of its neighbour says little about an edge.
const SMALL: f32 = 0.1;

/// Among more polygons than this about a disc, as the panes of a rose from afar, no shadow has one straight edge.
const MOST_FOR_A_LINE: usize = 16;

/// Steps by which the line is found that leaves a given share: to 1/1024 of a texel.
const HALVINGS: usize = 10;

/// A vertex nearer to a polygon's plane than this part of its size counts as that far inside: a bake has it there.
const LEVEL: f32 = 1e-4;

/// Points that a cut polygon has at most.
const MOST_POINTS: usize = 64;

/// Polygons that one disc may shine through at once on a vertex, and edges of them that cross its texels: a disc of the
/// largest size lies in a quarter of a radian. What is more is left out.
const MOST_CONES: usize = 128;
const MOST_SIDES: usize = 512;

/// Texels of the largest disc at the finest resolution, and those around them: 10 x 10 and 44.
const MOST_TEXELS: usize = 256;

/// The vertices that a beam may fall on: once for all portals.
pub struct Receivers<'a> {
    pub position: &'a [[f32; 3]],
    pub normal: &'a [[f32; 3]],
    /// No two vertices are farther apart, metres.
    size: f32,
    /// Of a disc as large as each vertex's cell, metres.
    cell: Vec<f32>,
}

/// Where a portal is.
pub struct Panes<'a> {
    polygons: Vec<Window>,
    /// Around all, and around each [`GROUP`] of them.
    all: Ball,
    groups: Vec<Ball>,
    /// Vertices outside, which see the sky past the portal; rising.
    open: &'a [u32],
}

/// A pane, and what it lies within.
struct Window {
    pane: Pane,
    ball: Ball,
    /// The first that lies in the same plane: from nowhere is one of these seen through another.
    plane: usize,
}

/// No corner of what it is around is farther from its centre than its radius, metres.
#[derive(Clone, Copy)]
struct Ball {
    centre: Vec3,
    radius: f32,
}

/// A disc through a portal.
pub struct Beam {
    disc: Cap,
    /// As it is, then larger and larger, of which the first `n_sizes` are meant.
    sizes: Vec<Size>,
    n_sizes: usize,
    /// Sine and tangent of the angle within which all texels of all sizes lie.
    sine: f32,
    spread: f32,
}

/// The disc, enlarged for cells that it cannot tell apart, cut into texels.
#[derive(Default)]
struct Size {
    radius: f32,
    /// Directions of the polygon that stands for it.
    rim: [Vec3; CORNERS],
    /// Those that the disc touches, then those around them on the same face.
    pieces: Vec<Piece>,
    n_touched: usize,
    points: Vec<Vec2>,
    probe: Probe,
    /// Cosine below which a direction is in no texel of the disc.
    reach: f32,
    footprint: Footprint,
    /// What is to be multiplied to have the disc's own power.
    power: f32,
}

/// A texel, and the part of the disc in it.
#[derive(Clone, Debug)]
struct Piece {
    texel: usize,
    face: usize,
    column: usize,
    row: usize,
    axes: [Vec3; 3],
    corners: [Vec2; 4],
    /// Of the disc's part.
    points: Range<usize>,
    /// ∫ ω dω over the texel and the disc's part of it.
    whole: Vec3,
    part: Vec3,
}

impl<'a> Receivers<'a> {
    /// The vertices of an asset.
    pub fn new(asset: &'a Asset<'a>) -> Receivers<'a> {
        let (position, normal) = (asset.positions(), asset.normals());
        let (low, high) = position.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| {
            (l.min(Vec3::from(*p)), h.max(Vec3::from(*p)))
        });
        let cell =
            vertex_area(asset).iter().map(|area| (area / std::f64::consts::PI).sqrt() as f32).collect();
        Receivers { position, normal, size: (high - low).length(), cell }
    }
}

/// How shares grow around a texel, by least squares: sums over neighbours of weight x their places' squares, and of weight
/// x growth x place.
#[derive(Default)]
pub struct Growth {
    xx: f32,
    xy: f32,
    yy: f32,
    growth: Vec2,
}

impl Growth {
    /// A neighbour `to` there, by its F and one's own, with so much more of a share.
    pub fn add(&mut self, to: Vec2, whole: f32, own: f32, more: f32) {
        // Shares of small parts are not less true, until they are very small.
        let weight = whole / (whole + SMALL * own) / to.length_squared();
        self.xx += weight * to.x * to.x;
        self.xy += weight * to.x * to.y;
        self.yy += weight * to.y * to.y;
        self.growth += weight * more * to;
    }

    /// Where they grow, and how much that looks like an edge, 0..=1.
    pub fn way(&self) -> (Vec2, f32) {
        // A little stiffness where texels lie on one line.
        let stiff = 1e-3 * (self.xx + self.yy);
        let (a, b, growth) = (self.xx + stiff, self.yy + stiff, self.growth);
        let way = Vec2::new(b * growth.x - self.xy * growth.y, a * growth.y - self.xy * growth.x);
        let way = way / (a * b - self.xy * self.xy).max(f32::MIN_POSITIVE);
        let trust = ((way.length() - GROWTH.0) / (GROWTH.1 - GROWTH.0)).clamp(0.0, 1.0);
        (way.normalize_or_zero(), trust)
    }
}

/// What may be lost of a visible share in the row of this vertex.
fn rounding(rows: &Rows, v: usize) -> f32 {
    ROUNDING[usize::from(rows.basis(v) == Basis::Haar)]
}

impl<'a> Panes<'a> {
    /// Whether vertex `v` is outside.
    pub fn is_open(&self, v: usize) -> bool {
        self.open.binary_search(&(v as u32)).is_ok()
    }

    /// The polygons of portal `k`; `None` where the asset has none.
    ///
    /// # Errors
    /// When its tensors do not hold together.
    pub fn open(asset: &'a Asset<'a>, k: usize) -> Result<Option<Panes<'a>>, Error> {
        let names = ["corner", "polygon", "open", "reveal"].map(|part| format!("portal.{k}.{part}"));
        let wrong = |i: usize, what: &str| Error::Tensor { name: names[i].clone(), what: what.to_string() };
        let Some(corner) = asset.tensor(&names[0]) else { return Ok(None) };
        let Data::F32(corner) = &corner.data else { return Err(wrong(0, "not F32")) };
        let corner: &[Vec3] =
            bytemuck::try_cast_slice(corner).map_err(|_| wrong(0, "not three numbers each"))?;
        let words = |i: usize| match asset.tensor(&names[i]).map(|t| &t.data) {
            Some(Data::U32(values)) => Ok(&values[..]),
            _ => Err(wrong(i, "missing, or not U32")),
        };
        let (start, open) = (words(1)?, words(2)?);
        let fits = start.first() == Some(&0) && start.last().is_some_and(|&n| n as usize == corner.len());
        if !fits || start.windows(2).any(|w| w[1] < w[0].saturating_add(3)) {
            return Err(wrong(1, "not a list from 0 to the number of corners that rises by at least 3"));
        }
        if !open.is_sorted() || open.last().is_some_and(|&v| v as usize >= asset.n_vertices()) {
            return Err(wrong(2, "not a rising list of vertices"));
        }
        let reveals: &[Reveal] = match asset.tensor(&names[3]) {
            None => &[],
            Some(tensor) => {
                let values = tensor.data.as_f32().and_then(|values| bytemuck::try_cast_slice(values).ok());
                let is_good = |r: &&[Reveal]| {
                    r.len().is_multiple_of(corner.len()) && r.iter().all(|r| r[0] >= 0.0 && r[2] >= 0.0)
                };
                let what = "not so many times four floats for each corner, the depths not below 0";
                values.filter(is_good).ok_or_else(|| wrong(3, what))?
            }
        };
        let polygon = |w: &[u32]| {
            let range = w[0] as usize..w[1] as usize;
            let steps = reveals.len() / corner.len();
            let of_edges = range.start * steps..range.end * steps;
            Window::new(Pane::new(&corner[range], &reveals[of_edges]))
        };
        let mut polygons: Vec<Window> = start.windows(2).map(polygon).collect();
        let mut planes: Vec<usize> = Vec::new();
        for i in 0..polygons.len() {
            let known = planes.iter().copied().find(|&k| polygons[k].holds(&polygons[i]));
            polygons[i].plane = known.unwrap_or_else(|| {
                planes.push(i);
                i
            });
        }
        Ok(Some(Panes {
            all: Ball::around(&polygons),
            groups: polygons.chunks(GROUP).map(Ball::around).collect(),
            polygons,
            open,
        }))
    }
}

impl Window {
    fn new(pane: Pane) -> Window {
        let centre = pane.centre();
        let radius = pane.corners().iter().map(|c| c.distance(centre)).fold(0.0, f32::max);
        Window { pane, ball: Ball { centre, radius }, plane: 0 }
    }

    /// Whether the other lies in its plane.
    fn holds(&self, other: &Window) -> bool {
        let level = LEVEL * (self.ball.radius + other.ball.radius);
        other.pane.corners().iter().all(|c| self.pane.height(*c).abs() < level)
    }

    /// `p`, but on the inside where it lies in the pane's plane.
    fn inside(&self, p: Vec3) -> Vec3 {
        let height = self.pane.height(p);
        let level = LEVEL * self.ball.radius;
        if height.abs() < level { p + (level - height) * self.pane.normal() } else { p }
    }

    /// The normals, of any length and towards the inside, of the planes that bound the pane and its wall as seen from `p`.
    fn sides(&self, p: Vec3) -> impl Iterator<Item = Vec3> + '_ {
        let p = self.inside(p);
        let towards = if self.pane.height(p) < 0.0 { 1.0 } else { -1.0 };
        let corners = self.pane.corners();
        let edge = move |i: usize| {
            let a = corners[if i == 0 { corners.len() - 1 } else { i - 1 }];
            towards * (a - p).cross(corners[i] - p)
        };
        (0..corners.len()).map(edge).chain(self.pane.walls(p))
    }
}

impl Ball {
    fn around(panes: &[Window]) -> Ball {
        let n = panes.len().max(1) as f32;
        let centre = panes.iter().map(|pane| pane.ball.centre).sum::<Vec3>() / n;
        let radius = panes.iter().map(|p| p.ball.centre.distance(centre) + p.ball.radius).fold(0.0, f32::max);
        Ball { centre, radius }
    }

    /// Whether something of it may lie within an angle about the direction `d` from `p`.
    fn is_near(&self, p: Vec3, d: Vec3, tangent: f32) -> bool {
        let to = self.centre - p;
        let along = to.dot(d);
        let aside = self.radius + (along + self.radius).max(0.0) * tangent;
        along >= -self.radius && to.length_squared() - along * along <= aside * aside
    }
}

impl Beam {
    /// A beam of no light.
    pub fn new() -> Beam {
        Beam {
            disc: Cap { axis: Vec3::Y, radius: 0.0, radiance: Vec3::ZERO },
            sizes: Vec::new(),
            n_sizes: 0,
            sine: 0.0,
            spread: 0.0,
        }
    }

    /// Whether a disc is better off as a beam.
    pub fn suits(disc: &Cap) -> bool {
        disc.radius <= LARGEST && disc.radius > 0.0 && disc.radiance != Vec3::ZERO
    }

    /// Takes on a disc that shines through a portal of `n` x `n` x 6 texels.
    pub fn set(&mut self, disc: &Cap, n: usize) {
        self.disc = *disc;
        let blurs = std::iter::successors(Some(LEAST_BLUR), |blur| Some(2.0 * blur));
        let larger = blurs.map(|blur| blur.hypot(disc.radius)).take_while(|radius| *radius <= LARGEST);
        self.n_sizes = 0;
        for radius in std::iter::once(disc.radius).chain(larger.filter(|r| *r > 1.1 * disc.radius)) {
            if self.sizes.len() == self.n_sizes {
                self.sizes.push(Size::default());
            }
            self.sizes[self.n_sizes].cut(disc, radius, n);
            self.n_sizes += 1;
        }
        let reach = self.sizes[..self.n_sizes].iter().fold(1.0, |least: f32, size| least.min(size.reach));
        let reach = reach.clamp(0.1, 1.0);
        self.sine = (1.0 - reach * reach).sqrt();
        self.spread = self.sine / reach;
    }

    /// Radiance of the disc; to be multiplied by the glass.
    pub fn radiance(&self) -> Vec3 {
        self.disc.radiance
    }

    /// Direction to the disc.
    pub fn axis(&self) -> Vec3 {
        self.disc.axis
    }

    /// E = L x this of vertex `v`, steradians.
    pub fn transfer(
        &self,
        v: usize,
        receivers: &Receivers,
        place: (&Panes, &Rows),
        scratch: &mut Scratch,
    ) -> f32 {
        let size = self.seen_from(v, receivers, place, scratch);
        size.map_or(0.0, |size| size.transfer(receivers.normal[v].into(), rounding(place.1, v), scratch))
    }

    /// As [`transfer`](Self::transfer), and what it would be if nothing but the portal's rim and wall hid the disc; where that is
    /// not asked for, of rows without light, 0.
    pub fn arrival(
        &self,
        v: usize,
        receivers: &Receivers,
        place: (&Panes, &Rows),
        scratch: &mut Scratch,
    ) -> (f32, f32) {
        let Some(size) = self.seen_from(v, receivers, place, scratch) else { return (0.0, 0.0) };
        let n = receivers.normal[v].into();
        (size.transfer(n, rounding(place.1, v), scratch), size.open(n, scratch))
    }

    /// The disc as large as the cell of vertex `v` asks for, with its cones and T of its texels; `None` where none of it
    /// can arrive.
    fn seen_from(
        &self,
        v: usize,
        receivers: &Receivers,
        (panes, rows): (&Panes, &Rows),
        scratch: &mut Scratch,
    ) -> Option<&Size> {
        let (p, n) = (Vec3::from(receivers.position[v]), Vec3::from(receivers.normal[v]));
        let cosine = n.dot(self.disc.axis);
        if cosine <= -self.sizes[self.n_sizes - 1].radius.sin() {
            return None;
        }
        let is_open = panes.is_open(v);
        if !is_open && (!panes.all.is_near(p, self.disc.axis, self.spread) || rows.is_dark(v)) {
            return None;
        }
        if !is_open && panes.polygons.len() > GROUP {
            // A look at the row is sooner done than one at hundreds of polygons.
            let size = &self.sizes[self.n_sizes - 1];
            let texels = &mut scratch.texels[..size.pieces.len()];
            rows.probe(v, &size.probe, texels);
            if texels[..size.n_touched].iter().all(|t| *t <= 0.0) {
                return None;
            }
        }
        let across = receivers.cell[v] * cosine.max(0.0).sqrt();
        let size = self.size(p, is_open, across, (panes, receivers), scratch)?;
        rows.probe(v, &size.probe, &mut scratch.texels[..size.pieces.len()]);
        Some(size)
    }

    /// As [`transfer`](Self::transfer), of a point with this normal, the mean over so many metres around it, if nothing but
    /// the portal's rim and wall hid the disc; and directions to the disc's own rim, as large as it is for that. `None` where it
    /// is not seen.
    pub fn open_transfer(
        &self,
        (p, n, around): (Vec3, Vec3, f32),
        is_open: bool,
        place: (&Panes, &Receivers),
        scratch: &mut Scratch,
    ) -> Option<(f32, &[Vec3])> {
        let cosine = n.dot(self.disc.axis);
        if cosine <= -self.sizes[self.n_sizes - 1].radius.sin() {
            return None;
        }
        let size = self.size(p, is_open, around * cosine.max(0.0).sqrt(), place, scratch)?;
        let open = size.open(n, scratch);
        (open > 0.0).then_some((open, &size.rim))
    }

    /// Whether anything of it may fall on `p`.
    pub fn may_reach(&self, p: Vec3, panes: &Panes) -> bool {
        panes.all.is_near(p, self.disc.axis, self.spread)
    }

    /// Calls `met` with `p`, as it is on the inside, and what it sees of each polygon that the light of a part of the sky
    /// about the disc may come through to it.
    pub fn for_each_near(&self, p: Vec3, panes: &Panes, mut met: impl FnMut(Vec3, &[Vec3])) {
        let (s, wide) = (self.disc.axis, 4.0 * self.spread);
        let is_near = |window: &&Window| panes.polygons.len() <= GROUP || window.ball.is_near(p, s, wide);
        let mut lists = Default::default();
        let mut before: Vec<&Window> = Vec::new();
        for window in panes.polygons.iter().filter(is_near) {
            let at = window.inside(p);
            window.pane.seen_from(at, &mut lists);
            let mut parts = vec![std::mem::take(&mut lists[0])];
            for other in before.iter().filter(|other| other.plane != window.plane) {
                let sides: Vec<Vec3> = other.sides(p).collect();
                let is_apart = |part: &[Vec3]| are_apart(p, (part, &[]), (other.pane.corners(), &sides));
                parts = parts
                    .into_iter()
                    .flat_map(|part| match is_apart(&part) {
                        true => vec![part],
                        false => without(p, &part, &sides),
                    })
                    .collect();
            }
            parts.iter().for_each(|part| met(at, part));
            before.push(window);
        }
    }

    /// Centre and normal of the polygon that the disc is seen through from `p`.
    pub fn plane(&self, p: Vec3, panes: &Panes, scratch: &mut Scratch) -> Option<(Vec3, Vec3)> {
        scratch.clear();
        self.find(p, panes, self.sizes[self.n_sizes - 1].radius, scratch);
        scratch.plane
    }

    /// Directions to the middles of the texels that the disc touches, and of those around.
    pub fn middles(&self) -> impl Iterator<Item = Vec3> {
        self.sizes[0].pieces.iter().map(Piece::middle)
    }

    /// The disc as it is seen from `p`, the mean over so many metres across it wanted; `None` where no polygon can hold a
    /// part of it. Lists the polygons.
    fn size(
        &self,
        p: Vec3,
        is_open: bool,
        across: f32,
        (panes, receivers): (&Panes, &Receivers),
        scratch: &mut Scratch,
    ) -> Option<&Size> {
        scratch.clear();
        if is_open {
            scratch.push_cone(0, 0, 1.0);
            return self.sizes.first();
        }
        let way = self.find(p, panes, self.sizes[self.n_sizes - 1].radius, scratch)?;
        let way = way.min(2.0 * receivers.size);
        // As large as the cell looks from the window.
        let wanted = (across / way).hypot(self.disc.radius);
        let sizes = &self.sizes[..self.n_sizes];
        let above = sizes.partition_point(|size| size.radius < wanted).min(sizes.len() - 1);
        let below = above.saturating_sub(1);
        let is_nearer = wanted * wanted < sizes[below].radius * sizes[above].radius;
        sizes.get(if is_nearer { below } else { above })
    }

    /// Lists the sides of all polygons near the disc; the way to the nearest one that may hold a part of it at its widest.
    fn find(&self, p: Vec3, panes: &Panes, widest: f32, scratch: &mut Scratch) -> Option<f32> {
        let (s, sine) = (self.disc.axis, widest.sin());
        let groups = panes.groups.iter().zip(panes.polygons.chunks(GROUP));
        let near = groups.enumerate().filter(|(_, (ball, _))| ball.is_near(p, s, self.spread));
        let near = near.flat_map(|(g, (_, panes))| (g * GROUP..).zip(panes));
        let mut nearest: Option<f32> = None;
        for (window, Window { pane, ball, .. }) in near.filter(|(_, w)| w.ball.is_near(p, s, self.spread)) {
            let first = scratch.n_sides;
            let (mut may_hold, mut may_touch) = (true, true);
            for side in panes.polygons[window].sides(p) {
                let (inside, square) = (side.dot(s), side.length_squared());
                let is_within = |sine: f32| inside * inside < sine * sine * square;
                may_hold &= inside > 0.0 || is_within(sine);
                let crosses = is_within(self.sine);
                may_touch &= inside > 0.0 || crosses;
                if !may_touch {
                    break;
                }
                // The others have all texels on their inside.
                if crosses {
                    scratch.push_side(side);
                }
            }
            if !may_touch {
                scratch.n_sides = first;
                continue;
            }
            scratch.push_apart((p, first), panes, window);
            if may_hold {
                // Where the axis meets the pane's plane.
                let to = pane.centre() - p;
                let way = pane.normal().dot(to) / pane.normal().dot(s);
                let way = if way.is_finite() { way } else { to.dot(s) };
                let way = way.max(1e-3 * ball.radius);
                if nearest.is_none_or(|n| way < n) {
                    nearest = Some(way);
                    scratch.plane = Some((pane.centre(), pane.normal()));
                }
            }
        }
        nearest
    }
}

impl Size {
    /// Cuts a disc of another radius and the same power into texels.
    fn cut(&mut self, disc: &Cap, radius: f32, n: usize) {
        self.radius = radius;
        let axis = disc.axis;
        let (s, t) = axis.any_orthonormal_pair();
        let step = 2.0 * PI / CORNERS as f32;
        // As large as the disc: N/2 sin(2π/N) r² = π tan² radius.
        let rim = radius.tan() * (step / step.sin()).sqrt();
        self.rim = std::array::from_fn(|i| {
            let (sine, cosine) = (i as f32 * step).sin_cos();
            axis + rim * (cosine * s + sine * t)
        });
        self.footprint.clear();
        self.footprint.add_polygon(&Eye { origin: Vec3::ZERO, normal: axis, n }, 0, &self.rim);
        self.pieces.clear();
        self.points.clear();
        for cell in self.footprint.cells.iter().take(MOST_TEXELS) {
            let first = self.points.len();
            self.points.extend(self.footprint.points(cell));
            let (face, [column, row]) = place(n, cell.texel);
            self.pieces.push(Piece::new(n, [face, column, row], &self.points, first..self.points.len()));
        }
        // The vector of the disc as it is: π sin² radius along its axis.
        let found = self.pieces.iter().map(|piece| piece.part).sum::<Vec3>().dot(axis);
        self.power = PI * disc.radius.sin().powi(2) / found.max(f32::MIN_POSITIVE);
        self.n_touched = self.pieces.len();
        for i in 0..self.n_touched {
            let (face, column, row) = (self.pieces[i].face, self.pieces[i].column, self.pieces[i].row);
            for (x, y) in (0..9).map(|k| (column + k % 3, row + k / 3)) {
                let is_on_face = (1..=n).contains(&x) && (1..=n).contains(&y);
                let is_here = |p: &Piece| (p.face, p.column + 1, p.row + 1) == (face, x, y);
                if is_on_face && self.pieces.len() < MOST_TEXELS && !self.pieces.iter().any(is_here) {
                    self.pieces.push(Piece::new(n, [face, x - 1, y - 1], &self.points, 0..0));
                }
            }
        }
        let corners = self.pieces.iter().flat_map(|p| p.corners.map(|c| (p.axes, c)));
        let cosine = corners.map(|(a, c)| (a[0] + c.x * a[1] + c.y * a[2]).normalize().dot(axis));
        self.reach = cosine.fold(1.0, f32::min);
        self.probe.set(n, self.pieces.iter().map(|piece| piece.texel));
    }

    /// What of it arrives at a vertex with this normal, through the cones and T of texels found for it.
    fn transfer(&self, n: Vec3, rounding: f32, scratch: &mut Scratch) -> f32 {
        let mut is_plain = true;
        for i in 0..self.n_touched {
            if scratch.texels[i] > 0.0 {
                scratch.set_share(self, i, n);
                let share = scratch.share[i];
                is_plain &= share <= CLEAR * rounding || share >= 1.0 - CLEAR * rounding;
            } else {
                (scratch.share[i], scratch.part[i]) = (0.0, 0.0);
            }
        }
        let rounded = |share: f32| match share {
            share if share < rounding => 0.0,
            share if share > 1.0 - rounding => 1.0,
            share => share,
        };
        if is_plain || scratch.n_cones > MOST_FOR_A_LINE {
            let parts = scratch.share.iter().zip(&scratch.part).take(self.n_touched);
            return self.power * parts.map(|(share, part)| rounded(*share) * part).sum::<f32>();
        }
        // Now the dark ones and the texels around are asked for the edge's way.
        for i in 0..self.pieces.len() {
            if i >= self.n_touched || scratch.texels[i] <= 0.0 {
                scratch.set_share(self, i, n);
            }
        }
        let scratch = &*scratch;
        let lit = |i: usize| {
            let (share, part) = (scratch.share[i], scratch.part[i]);
            let plain = rounded(share) * part;
            match share > CLEAR * rounding && share < 1.0 - CLEAR * rounding && part > 0.0 {
                true => self.lit_part(i, plain, n, scratch),
                false => plain,
            }
        };
        self.power * (0..self.n_touched).map(lit).sum::<f32>()
    }

    /// What would arrive if nothing but the portal's rim and wall hid the disc.
    fn open(&self, n: Vec3, scratch: &Scratch) -> f32 {
        let touched = &self.pieces[..self.n_touched];
        self.power * touched.iter().map(|piece| self.portal_part(piece, n, scratch).1).sum::<f32>()
    }

    /// Of a texel and of the disc's part in it what lies within the portal.
    fn portal_part(&self, piece: &Piece, normal: Vec3, scratch: &Scratch) -> (f32, f32) {
        let mut sums = (0.0, 0.0);
        for (sides, sign) in scratch.cones() {
            let (whole, part) = match self.cut_piece(piece, normal, sides) {
                Within::None => continue,
                Within::All => (normal.dot(piece.whole), normal.dot(piece.part)),
                Within::Cut(whole, part) => {
                    let horizon = piece.flat(normal);
                    (whole.worth(horizon), part.worth(horizon))
                }
            };
            sums = (sums.0 + sign * whole, sums.1 + sign * part);
        }
        sums
    }

    /// What of the disc's part in texel `i` lies on the lit side of the shadow's edge, as its share of the texel does;
    /// `plain` where the texels around do not tell which side is lit.
    fn lit_part(&self, i: usize, plain: f32, normal: Vec3, scratch: &Scratch) -> f32 {
        let (piece, share) = (&self.pieces[i], scratch.share[i]);
        let mut growth = Growth::default();
        for (k, other) in self.pieces.iter().enumerate() {
            let to =
                Vec2::new(other.column as f32 - piece.column as f32, other.row as f32 - piece.row as f32);
            if other.face != piece.face || to.abs().max_element() != 1.0 {
                continue;
            }
            growth.add(to, scratch.whole[k], scratch.whole[i], scratch.share[k].min(1.0) - share);
        }
        let (way, trust) = growth.way();
        if trust == 0.0 {
            return plain;
        }
        let horizon = piece.flat(normal);
        let mut lit = 0.0;
        for (sides, sign) in scratch.cones() {
            let (whole, part) = match self.cut_piece(piece, normal, sides) {
                Within::None => continue,
                Within::All => (Cut::new(&piece.corners), Cut::new(&self.points[piece.points.clone()])),
                Within::Cut(whole, part) => (whole, part),
            };
            lit += sign * part.clipped(line(&[whole], way, share, horizon)).worth(horizon);
        }
        trust * lit + (1.0 - trust) * plain
    }

    /// What of the texel and of the disc's part in it lies within the sides and above the horizon.
    fn cut_piece(&self, piece: &Piece, normal: Vec3, sides: &[Vec3]) -> Within {
        let mut cut: Option<(Cut, Cut)> = None;
        for side in sides.iter().chain([&normal]) {
            let side = piece.flat(*side);
            let height = piece.corners.map(|c| side.dot(c.extend(1.0)));
            if height.iter().all(|h| *h <= 0.0) {
                return Within::None;
            }
            if height.iter().any(|h| *h < 0.0) {
                let (whole, part) = cut.get_or_insert_with(|| {
                    (Cut::new(&piece.corners), Cut::new(&self.points[piece.points.clone()]))
                });
                *whole = whole.clipped(side);
                *part = part.clipped(side);
            }
        }
        cut.map_or(Within::All, |(whole, part)| Within::Cut(whole, part))
    }
}

impl Piece {
    /// The texel `[face, column, row]`, and these of the points.
    fn new(n: usize, [face, column, row]: [usize; 3], points: &[Vec2], range: Range<usize>) -> Piece {
        let axes = face_axes(face);
        let corner =
            |x: usize, y: usize| Vec2::new((column + x) as f32, (row + y) as f32) * (2.0 / n as f32) - 1.0;
        let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        let area = |points: &[Vec2]| {
            let a = vector_area(points).as_vec3();
            let a = if a.z < 0.0 { -a } else { a };
            a.x * axes[1] + a.y * axes[2] + a.z * axes[0]
        };
        let (whole, part) = (area(&corners), area(&points[range.clone()]));
        Piece {
            texel: (face * n + row) * n + column,
            face,
            column,
            row,
            axes,
            corners,
            points: range,
            whole,
            part,
        }
    }

    /// Direction of its middle.
    fn middle(&self) -> Vec3 {
        let [axis, s, t] = self.axes;
        let c = 0.5 * (self.corners[0] + self.corners[2]);
        axis + c.x * s + c.y * t
    }

    /// The normal of a plane through the vertex, in the face's coordinates.
    fn flat(&self, side: Vec3) -> Vec3 {
        flat(self.axes, side)
    }
}

/// How much of a texel and of the disc in it is meant.
#[allow(clippy::large_enum_variant, reason = "lives on the stack for a moment")]
enum Within {
    None,
    All,
    Cut(Cut, Cut),
}

/// What is seen through one polygon, all that lies within some sides; of no side it is all that is above the horizon.
#[derive(Clone, Copy, Default)]
struct Cone {
    from: u16,
    to: u16,
    polygon: usize,
    /// -1 for what two others have in common, and counted twice.
    sign: f32,
}

/// Room to work in, for one thread; on the stack, so that no frame allocates.
pub struct Scratch {
    sides: [Vec3; MOST_SIDES],
    n_sides: usize,
    cones: [Cone; MOST_CONES],
    n_cones: usize,
    /// Centre and normal of the nearest polygon that may hold a part of the disc.
    plane: Option<(Vec3, Vec3)>,
    /// T, F, that of the disc's part, and T/F, of pieces.
    texels: [f32; MOST_TEXELS],
    whole: [f32; MOST_TEXELS],
    part: [f32; MOST_TEXELS],
    share: [f32; MOST_TEXELS],
}

impl Default for Scratch {
    fn default() -> Scratch {
        Scratch {
            sides: [Vec3::ZERO; MOST_SIDES],
            n_sides: 0,
            cones: [Cone::default(); MOST_CONES],
            n_cones: 0,
            plane: None,
            texels: [0.0; MOST_TEXELS],
            whole: [0.0; MOST_TEXELS],
            part: [0.0; MOST_TEXELS],
            share: [0.0; MOST_TEXELS],
        }
    }
}

impl Scratch {
    fn clear(&mut self) {
        (self.n_sides, self.n_cones, self.plane) = (0, 0, None);
    }

    fn push_side(&mut self, side: Vec3) {
        if let Some(slot) = self.sides.get_mut(self.n_sides) {
            *slot = side;
            self.n_sides += 1;
        }
    }

    /// Makes a cone of the sides from `first` on, unless there was no room for all of them.
    fn push_cone(&mut self, first: usize, polygon: usize, sign: f32) {
        if let Some(slot) = self.cones.get_mut(self.n_cones)
            && self.n_sides < MOST_SIDES
        {
            *slot = Cone { from: first as u16, to: self.n_sides as u16, polygon, sign };
            self.n_cones += 1;
        }
    }

    /// Makes a cone of the sides from `first` on, and takes off what it has in common with others: of polygons in a row, as a
    /// window behind a glass door, each direction counts once.
    fn push_apart(&mut self, (p, first): (Vec3, usize), panes: &Panes, polygon: usize) {
        let (own, n_before) = (&panes.polygons[polygon], self.n_cones);
        self.push_cone(first, polygon, 1.0);
        let Some(&cone) = self.cones[..self.n_cones].get(n_before) else { return };
        for k in 0..n_before {
            let other = self.cones[k];
            let window = &panes.polygons[other.polygon];
            let is_in_a_row = other.sign > 0.0 && window.plane != own.plane && {
                let [a, b] =
                    [(own, cone), (window, other)].map(|(w, c)| (w.pane.corners(), self.sides_of(c)));
                !are_apart(p, a, b)
            };
            if is_in_a_row {
                let first = self.n_sides;
                let both = (cone.from..cone.to).chain(other.from..other.to);
                both.for_each(|i| self.push_side(self.sides[usize::from(i)]));
                self.push_cone(first, polygon, -1.0);
            }
        }
    }

    fn sides_of(&self, cone: Cone) -> &[Vec3] {
        &self.sides[usize::from(cone.from)..usize::from(cone.to)]
    }

    /// From T of piece `i`, the rest.
    fn set_share(&mut self, size: &Size, i: usize, n: Vec3) {
        (self.whole[i], self.part[i]) = size.portal_part(&size.pieces[i], n, self);
        self.share[i] = self.texels[i] / self.whole[i].max(f32::MIN_POSITIVE);
    }

    /// The sides of each cone, and how often it counts.
    fn cones(&self) -> impl Iterator<Item = (&[Vec3], f32)> {
        self.cones[..self.n_cones].iter().map(|cone| (self.sides_of(*cone), cone.sign))
    }
}

/// Whether a side of one of two convex polygons, as seen from `p`, has the other before it.
fn are_apart(p: Vec3, a: (&[Vec3], &[Vec3]), b: (&[Vec3], &[Vec3])) -> bool {
    let is_before = |side: &Vec3, corners: &[Vec3]| {
        corners.iter().map(|c| *c - p).all(|d| side.dot(d) < LEVEL * side.length() * d.length())
    };
    a.1.iter().any(|side| is_before(side, b.0)) || b.1.iter().any(|side| is_before(side, a.0))
}

/// What of a polygon is not within some sides, as seen from `p`, in convex parts; all of it in one where nothing is.
fn without(p: Vec3, polygon: &[Vec3], sides: &[Vec3]) -> Vec<Vec<Vec3>> {
    let (mut rest, mut parts) = (polygon.to_vec(), Vec::new());
    for side in sides {
        let half = |sign: f32| {
            let mut half = Vec::new();
            clip(&rest, &mut half, |q| sign * side.dot(q - p));
            half
        };
        let before = half(-1.0);
        rest = half(1.0);
        if !has_area(&rest) {
            return vec![polygon.to_vec()];
        }
        parts.push(before);
    }
    parts.retain(|part| has_area(part));
    parts
}

/// Whether a polygon is more than what rounding leaves of an edge: wider than [`LEVEL`] of its length.
fn has_area(polygon: &[Vec3]) -> bool {
    let Some(&first) = polygon.first() else { return false };
    let to = || polygon.iter().map(|q| *q - first);
    let area: Vec3 = to().zip(to().skip(1)).map(|(a, b)| a.cross(b)).sum();
    area.length() > LEVEL * to().map(Vec3::length_squared).fold(0.0, f32::max)
}

/// A convex polygon in a face's plane that is being cut.
pub struct Cut {
    points: [Vec2; MOST_POINTS],
    n: usize,
}

impl Cut {
    /// All of it.
    pub fn new(points: &[Vec2]) -> Cut {
        let mut cut = Cut { points: [Vec2::ZERO; MOST_POINTS], n: 0 };
        points.iter().for_each(|p| cut.push(*p));
        cut
    }

    fn push(&mut self, p: Vec2) {
        if self.n < MOST_POINTS {
            self.points[self.n] = p;
            self.n += 1;
        }
    }

    /// The part where `side` is not negative.
    pub fn clipped(&self, side: Vec3) -> Cut {
        let mut to = Cut::new(&[]);
        clip_each(&self.points[..self.n], |p: Vec2| side.dot(p.extend(1.0)), |p| to.push(p));
        to
    }

    /// ∫ max(n·ω, 0) dω, the middle's value taken for all.
    pub fn worth(&self, normal: Vec3) -> f32 {
        let points = &self.points[..self.n];
        let Some(&origin) = points.first() else { return 0.0 };
        let (mut area, mut centre) = (0.0, Vec2::ZERO);
        for pair in points.windows(2).skip(1) {
            let (a, b) = (pair[0] - origin, pair[1] - origin);
            let twice = a.perp_dot(b);
            area += 0.5 * twice;
            centre += twice / 6.0 * (a + b);
        }
        if area == 0.0 {
            return 0.0;
        }
        let d = (origin + centre / area).extend(1.0);
        (area.abs() * normal.dot(d) / d.length_squared().powi(2)).max(0.0)
    }
}

/// The line across `way` that leaves this share of some polygons together before it, as a side.
pub fn line(cuts: &[Cut], way: Vec2, share: f32, horizon: Vec3) -> Vec3 {
    let along = cuts.iter().flat_map(|cut| &cut.points[..cut.n]).map(|p| p.dot(way));
    let (mut low, mut high) = along.fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)));
    let wanted = share * cuts.iter().map(|cut| cut.worth(horizon)).sum::<f32>();
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        let left: f32 = cuts.iter().map(|cut| cut.clipped(way.extend(-middle)).worth(horizon)).sum();
        if left > wanted { low = middle } else { high = middle }
    }
    way.extend(-0.5 * (low + high))
}

#[cfg(test)]
mod tests;
