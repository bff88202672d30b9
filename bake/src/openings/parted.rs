//! Windows parted into their panes by the bars in them.
//!
//! A window's rim is known exactly wherever light comes from; of what stands in it, rows know the share of a texel that it
//! hides, and bars are finer than that: a sun's spot on the floor would lose them. So what is open of a window's plane,
//! where a short line along the normal meets nothing, becomes a polygon for each part that hangs together, moved along the
//! normal into what stands around it, if it does not lie there already: a point just beside its edges lies *within* something
//! at the heights at which every line through it is blocked near by, and the pane takes the plane that lies nearest to the
//! middles of those. Sashes so have planes of their own, from which the depths of their bars are found as those of walls are.
//!
//! Lines drawn at random through the window are asked whether all that pass do so through one of the panes; where more
//! than [`MOST_LOST`] do not, as beside a curtain or leaves before the window, it is left whole.
//!
//! Where it breaks: bars finer than [`FINEST`] or than a [`SAMPLES`]th of their window; glass that bends.

use glam::{Vec2, Vec3};
use lunette_scenes::{Portal, Scene};
use rayon::prelude::*;

use super::outline::fitted;
use super::raster::{HALVINGS, Plane, Raster};
use super::rays::{Rays, sphere};
use super::sides::{lift, orient_by};
use crate::sampling::{fractions, hash};
use crate::{Error, Progress};

/// Samples along a window's longest side, and the smallest step between two, metres.
const SAMPLES: f32 = 256.0;
const FINEST: f32 = 4e-3;

/// Half the length of the lines, in sizes of the window, and at most, metres: bars are no farther from its plane.
const REACH: f32 = 0.1;
const LONGEST: f32 = 0.15;

/// A window is flat to this share of its size.
const FLAT: f32 = 1e-3;

/// Less of a window's samples blocked than this share is no bar.
const LEAST_BLOCKED: f32 = 0.005;

/// A window of more panes than this, or panes of more corners, are leaves or a grille.
const MOST_PANES: usize = 256;
const MOST_CORNERS: usize = 64;

/// Heights over the window's plane that are tried for a pane, and the share of the points beside its edges that have to lie
/// within something there.
const HEIGHTS: usize = 41;
const LEAST_WITHIN: f32 = 0.5;

/// The window's own plane is kept where this share of the most points lies within something there.
const ENOUGH: f32 = 0.9;

/// Middles of what is around a pane that are farther off its plane than this, metres, weigh less; and the most by which that is
/// tilted against the window's, as a tangent.
const MISFIT: f32 = 1e-3;
const MOST_TILT: f32 = 0.05;

/// Directions of the lines through a point, no flatter to the window's plane than this sine.
const LINES: usize = 48;
const LEAST_SLOPE: f32 = 0.3;

/// Lines through the whole window, and the share of those that pass that may do so beside the panes.
const TRIALS: usize = 16384;
const MOST_LOST: f32 = 0.01;

/// Portals wound as by [`orient`](super::orient), with every window that has bars replaced by its panes, and how many windows
/// had. `scene` is without the portals' triangles.
///
/// # Errors
/// When the scene has nothing that blocks light, Embree cannot be had, or `progress` asks to stop.
pub fn parted(
    scene: &Scene,
    portals: &[Portal],
    progress: &dyn Progress,
) -> Result<(Vec<Portal>, usize), Error> {
    let rays = Rays::solid(scene)?;
    let mut portals = portals.to_vec();
    orient_by(&rays, lift(scene), &mut portals);
    let windows: Vec<Vec<Portal>> = portals.iter().map(Portal::windows).collect();
    let total = TRIALS * windows.iter().map(Vec::len).sum::<usize>();
    let (mut done, mut n_parted) = (0, 0);
    for (portal, windows) in portals.iter_mut().zip(windows) {
        let mut triangles = Vec::new();
        let before = n_parted;
        for window in windows {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let panes = panes(&rays, &window);
            n_parted += usize::from(panes.is_some());
            triangles.extend(panes.unwrap_or(window).triangles);
            done += TRIALS;
            progress.report("bars in windows", done as u64, total as u64);
        }
        if n_parted > before
            && let Some(parted) = Portal::new(&portal.name, triangles, portal.transmission)
        {
            *portal = parted;
        }
    }
    Ok((portals, n_parted))
}

fn panes(rays: &Rays, window: &Portal) -> Option<Portal> {
    let panes = Window::new(rays, window)?.panes()?;
    Portal::from_polygons(&window.name, &panes, window.transmission)
}

struct Window<'a> {
    rays: &'a Rays,
    plane: Plane,
    /// In the plane.
    polygons: Vec<Vec<Vec2>>,
    low: Vec2,
    high: Vec2,
    step: f32,
    reach: f32,
    /// Unit, into the interior.
    lines: Vec<Vec3>,
}

impl<'a> Window<'a> {
    /// `None` where it is not flat.
    fn new(rays: &'a Rays, portal: &Portal) -> Option<Window<'a>> {
        let plane = Plane::new(portal.centre(), portal.normal);
        let polygons = portal.polygons();
        let size = portal.extent();
        let is_flat =
            polygons.iter().flatten().all(|c| (*c - plane.origin).dot(plane.normal).abs() <= FLAT * size);
        if !is_flat {
            return None;
        }
        let polygons: Vec<Vec<Vec2>> =
            polygons.iter().map(|p| p.iter().map(|c| plane.flat(*c)).collect()).collect();
        let low = polygons.iter().flatten().copied().fold(Vec2::INFINITY, Vec2::min);
        let high = polygons.iter().flatten().copied().fold(Vec2::NEG_INFINITY, Vec2::max);
        let step = ((high - low).max_element() / SAMPLES).max(FINEST);
        let reach = (REACH * size).min(LONGEST);
        let lines = sphere(LINES).into_iter().filter(|d| d.dot(plane.normal) > LEAST_SLOPE).collect();
        Some(Window { rays, plane, polygons, low, high, step, reach, lines })
    }

    fn holds(&self, at: Vec2) -> bool {
        self.polygons.iter().any(|p| holds(p, at))
    }

    /// Whether light comes straight through there.
    fn is_open(&self, at: Vec2) -> bool {
        let (p, way) = (self.plane.point(at), self.reach * self.plane.normal);
        self.holds(at) && self.rays.clear(p - way, p + way)
    }

    /// The polygons between its bars, counter-clockwise as seen from inside; `None` where there are none, or light
    /// would be lost beside them.
    fn panes(&self) -> Option<Vec<Vec<Vec3>>> {
        // Samples at the middles of cells, and a closed one around.
        let (low, high) = (self.low - 1.5 * self.step, self.high + 1.5 * self.step);
        let mut raster = Raster::new((low, high), self.step, |at| self.is_open(at));
        let n_held = raster.count(|at| self.holds(at));
        let n_open = raster.n_open();
        if n_held == 0 || (n_held - n_open) as f32 <= LEAST_BLOCKED * n_held as f32 {
            return None;
        }
        raster.add_all();
        if raster.n_parts() > MOST_PANES {
            return None;
        }
        let outlines = raster.outlines(|at| self.is_open(at));
        if outlines.is_empty() || outlines.iter().any(|outline| outline.len() > MOST_CORNERS) {
            return None;
        }
        let heights: Vec<Height> = outlines.par_iter().map(|o| self.height(o)).collect::<Option<_>>()?;
        let tilt = tilt(&heights);
        let panes: Vec<Pane> =
            outlines.into_iter().zip(&heights).map(|(outline, height)| height.pane(outline, tilt)).collect();
        (self.lost(&panes) <= MOST_LOST).then(|| panes.iter().map(|pane| self.polygon(pane)).collect())
    }

    fn polygon(&self, pane: &Pane) -> Vec<Vec3> {
        let corner = |at: &Vec2| self.plane.point(*at) + pane.height_at(*at) * self.plane.normal;
        pane.outline.iter().map(corner).collect()
    }

    /// Where an outline lies in the middle of what is around it.
    fn height(&self, outline: &[Vec2]) -> Option<Height> {
        let mut beside = Vec::new();
        for (i, a) in outline.iter().enumerate() {
            let b = outline[(i + 1) % outline.len()];
            if a.distance(b) > self.step {
                let out = 0.5 * self.step * -(b - *a).normalize_or_zero().perp();
                beside.extend([0.25, 0.5, 0.75].map(|along| a.lerp(b, along) + out));
            }
        }
        let height = |i: usize| self.reach * (2.0 * (i as f32 + 0.5) / HEIGHTS as f32 - 1.0);
        let within =
            |at: Vec2| -> Vec<bool> { (0..HEIGHTS).map(|i| self.is_within(at, height(i))).collect() };
        let within: Vec<Vec<bool>> = beside.iter().map(|at| within(*at)).collect();
        let counts: Vec<usize> = (0..HEIGHTS).map(|i| within.iter().filter(|w| w[i]).count()).collect();
        let most = *counts.iter().max()?;
        if most == 0 || (most as f32) < LEAST_WITHIN * beside.len() as f32 {
            return None;
        }
        if counts[HEIGHTS / 2] as f32 >= ENOUGH * most as f32 {
            return Some(Height::Kept);
        }
        // The longest run of them.
        let runs = counts.chunk_by(|a, b| (*a == most) == (*b == most));
        let starts = runs.clone().scan(0, |at, run| Some(std::mem::replace(at, *at + run.len())));
        let best = runs.zip(starts).filter(|(run, _)| run[0] == most).max_by_key(|(run, _)| run.len());
        let (run, start) = best?;
        let common = start + run.len() / 2;
        // Each point's own middle, where what it is within ends on both sides.
        let middle = |(at, within): (&Vec2, &Vec<bool>)| {
            let low = (0..common).rev().find(|i| !within[*i]).filter(|_| within[common])?;
            let high = (common..HEIGHTS).find(|i| !within[*i])?;
            let end = |inside: usize, outside: usize| {
                let mut ends = (height(inside), height(outside));
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (ends.0 + ends.1);
                    if self.is_within(*at, middle) { ends.0 = middle } else { ends.1 = middle }
                }
                ends.0
            };
            Some((*at, 0.5 * (end(low + 1, low) + end(high - 1, high))))
        };
        let (low, high) = (height(start), height(start + run.len() - 1));
        let common = 0.5 * (low + high);
        // Those of the deep wall are not those of the bars.
        let is_common = |m: &(Vec2, f32)| (m.1 - common).abs() <= 0.5 * (high - low);
        let middles = beside.iter().zip(&within).filter_map(middle).filter(is_common).collect();
        Some(Height::Moved { common, middles })
    }

    /// Whether no line through a point leads from one side to the other.
    fn is_within(&self, at: Vec2, height: f32) -> bool {
        let p = self.plane.point(at) + height * self.plane.normal;
        self.lines.iter().all(|d| !self.rays.clear(p - self.way(*d), p + self.way(*d)))
    }

    /// As far along a direction as leads out of reach.
    fn way(&self, d: Vec3) -> Vec3 {
        self.reach / d.dot(self.plane.normal) * d
    }

    /// Of lines that pass the window, the share that pass none of the panes.
    fn lost(&self, panes: &[Pane]) -> f32 {
        let count = |i: usize| {
            let h = hash(0x9a, i as u64);
            let at = self.low + fractions(h) * (self.high - self.low);
            let d = self.lines[hash(h, 1) as usize % self.lines.len()];
            let (p, way) = (self.plane.point(at), self.way(d));
            if !self.holds(at) || !self.rays.clear(p - way, p + way) {
                return [0, 0];
            }
            let slide = self.plane.flat(self.plane.origin + way) / self.reach;
            let passes = panes.iter().any(|pane| holds(&pane.outline, at + pane.height_at(at) * slide));
            [1, u32::from(!passes)]
        };
        let add = |a: [u32; 2], b: [u32; 2]| [a[0] + b[0], a[1] + b[1]];
        let [all, lost] = (0..TRIALS).into_par_iter().map(count).reduce(|| [0; 2], add);
        lost as f32 / all.max(1) as f32
    }
}

/// Where what is around a part of a window is, over the window's plane, metres.
enum Height {
    /// In it.
    Kept,
    Moved {
        /// Most of it is there.
        common: f32,
        /// The middle of what points beside the edges are within, where that ends on both sides and is about there.
        middles: Vec<(Vec2, f32)>,
    },
}

impl Height {
    fn middles(&self) -> &[(Vec2, f32)] {
        match self {
            Height::Kept => &[],
            Height::Moved { middles, .. } => middles,
        }
    }

    /// A pane there, tilted against the window's plane where it is not in that.
    fn pane(&self, outline: Vec<Vec2>, tilt: Vec2) -> Pane {
        let Height::Moved { common, middles } = self else {
            return Pane { outline, height: 0.0, tilt: Vec2::ZERO };
        };
        let mut heights: Vec<f32> = middles.iter().map(|(at, height)| height - tilt.dot(*at)).collect();
        let middle = heights.len() / 2;
        let height = match heights.is_empty() {
            true => *common,
            false => *heights.select_nth_unstable_by(middle, f32::total_cmp).1,
        };
        Pane { outline, height, tilt }
    }
}

/// By how much the panes are tilted together, as tangents: sashes may be side by side at different heights, and bars are
/// not as deep as the frame.
fn tilt(heights: &[Height]) -> Vec2 {
    let centred = |height: &Height| {
        let middles = height.middles();
        let n = middles.len().max(1) as f32;
        let at = middles.iter().map(|m| m.0).sum::<Vec2>() / n;
        let mean = middles.iter().map(|m| m.1).sum::<f32>() / n;
        middles.iter().map(move |m| (m.0 - at, m.1 - mean)).collect::<Vec<_>>()
    };
    let samples: Vec<(Vec2, f32)> = heights.iter().flat_map(centred).collect();
    let fit = if samples.is_empty() { None } else { fitted(&samples, MISFIT) };
    fit.map(|[_, x, y]| Vec2::new(x, y)).filter(|tilt| tilt.length() < MOST_TILT).unwrap_or_default()
}

/// A part of a window, in a plane of its own.
struct Pane {
    outline: Vec<Vec2>,
    /// Over the middle of the window's plane, metres, and its tilt against that.
    height: f32,
    tilt: Vec2,
}

impl Pane {
    fn height_at(&self, at: Vec2) -> f32 {
        self.height + self.tilt.dot(at)
    }
}

/// Whether a point is within a polygon.
fn holds(polygon: &[Vec2], at: Vec2) -> bool {
    let mut inside = false;
    for (i, a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if (a.y > at.y) != (b.y > at.y) && at.x < a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x) {
            inside = !inside;
        }
    }
    inside
}
