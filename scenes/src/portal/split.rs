//! Portals cut up until one shell serves all of each, and the light that they throw back out.
//!
//! A point q outside, at distance r from the middle of a portal of extent l, is seen from the portal's points under
//! directions that differ by θ ≈ l / r, at most θ / 2 from the middle's; one shell is valid where
//!
//! > l / (2 r) < θ_M  \[radians\].
//!
//! What is outside receives little light back from an interior that shows it the area A at distance d where
//!
//! > A / (4 π d²) < R_ω.
//!
//! Based on: Yue et al., Interactive Rendering of Interior Scenes with Dynamic Environment Illumination, 2009,
//! section 6.

use std::collections::HashMap;
use std::f32::consts::PI;

use glam::Vec3;

use super::{Portal, area, merge};
use crate::scene::Error;

/// R_ω: the share of the sphere around an exterior point from which on light thrown back is worth a warning. As in
/// the paper.
pub const MOST_THROWN_BACK: f32 = 0.02;

/// Windows that look the same way: cosine of the largest angle, two and a half degrees.
const SAME_WALL: f32 = 0.999;

/// Most portals that splitting makes: each has a shell to be captured every frame, and rows of its own.
const MOST_PORTALS: usize = 256;

/// Points of which all pairs are compared for an extent; of more, only those that are outermost in some direction.
const ALL_PAIRS: usize = 512;

/// Directions for that: four degrees apart, so that a diameter between two of them is missed by a thousandth at most.
const N_DIRECTIONS: usize = 1024;

/// What [`split_portals`] made.
#[derive(Clone, Debug)]
pub struct Split {
    /// In the order of those they were cut from; pieces are numbered from 1.
    pub portals: Vec<Portal>,
    /// The largest A / (4 π d²) that an exterior object at the nearest distance sees, as [`thrown_back`] has it.
    pub thrown_back: f32,
    /// One line for each portal that was cut, and a warning where too much light is thrown back.
    pub report: Vec<String>,
}

/// Cuts portals until `l / (2 r) < theta_max` holds (radians; the paper's example is 5 degrees) with exterior objects
/// no nearer than `nearest_exterior` metres to a portal's middle: first between windows, then through them.
///
/// # Errors
/// [`Error::Invalid`] if a limit is not a positive number, or if it would take more than 256 portals.
pub fn split_portals(portals: Vec<Portal>, theta_max: f32, nearest_exterior: f32) -> Result<Split, Error> {
    let positive = |x: f32| x > 0.0 && x.is_finite();
    if !positive(theta_max) || !positive(nearest_exterior) {
        return Err(invalid(format!(
            "angle and distance have to be positive numbers, not {theta_max} and {nearest_exterior}"
        )));
    }
    let longest = 2.0 * nearest_exterior * theta_max;
    let mut split = Split {
        portals: Vec::new(),
        thrown_back: thrown_back(&portals, nearest_exterior),
        report: Vec::new(),
    };
    for portal in portals {
        let room = MOST_PORTALS.saturating_sub(split.portals.len());
        let pieces = pieces(&portal, longest, room).ok_or_else(|| too_many(&portal, longest))?;
        if pieces.len() > 1 {
            split.report.push(format!(
                "portal '{}' is {:.2} m across, too much for objects at {nearest_exterior} m: cut into {}",
                portal.name,
                portal.extent(),
                pieces.len()
            ));
        }
        split.portals.extend(pieces);
    }
    if split.thrown_back >= MOST_THROWN_BACK {
        split.report.push(format!(
            "an object {nearest_exterior} m away sees the interior on {:.1} % of its sphere (over {:.1} %): light \
             thrown back to it is left out",
            100.0 * split.thrown_back,
            100.0 * MOST_THROWN_BACK
        ));
    }
    Ok(split)
}

/// The largest share of an exterior point's sphere that the interior takes, A / (4 π d²), at `distance` metres: A is
/// the area of all windows, m², as seen from in front of the one that shows most of it.
pub fn thrown_back(portals: &[Portal], distance: f32) -> f32 {
    let windows: Vec<Portal> = portals.iter().flat_map(Portal::windows).collect();
    let facing = |from: Vec3| windows.iter().map(|w| w.area() * w.normal.dot(from).max(0.0)).sum::<f32>();
    // Windows of one wall look the same way; there are few walls.
    let mut walls: Vec<Vec3> = Vec::new();
    for window in &windows {
        if walls.iter().all(|wall| wall.dot(window.normal) < SAME_WALL) {
            walls.push(window.normal);
        }
    }
    let most = walls.into_iter().map(facing).fold(0.0, f32::max);
    most / (4.0 * PI * distance * distance)
}

/// The largest distance between two corners.
pub(super) fn extent(triangles: &[[Vec3; 3]]) -> f32 {
    let outer = outermost(triangles);
    let pairs = outer.iter().enumerate().flat_map(|(i, p)| outer[..i].iter().map(|q| p.distance(*q)));
    pairs.fold(0.0, f32::max)
}

fn outermost(triangles: &[[Vec3; 3]]) -> Vec<Vec3> {
    let (position, _) = merge::weld(triangles);
    if position.len() <= ALL_PAIRS {
        return position;
    }
    let farthest =
        |d: Vec3| position.iter().copied().max_by(|p, q| p.dot(d).total_cmp(&q.dot(d))).unwrap_or_default();
    let mut outer: Vec<Vec3> = (0..N_DIRECTIONS).map(|i| farthest(spiral(i))).collect();
    outer.sort_by_key(|p| p.to_array().map(f32::to_bits));
    outer.dedup();
    outer
}

/// Directions evenly over the sphere: a Fibonacci spiral.
fn spiral(i: usize) -> Vec3 {
    let y = 1.0 - (2 * i + 1) as f32 / N_DIRECTIONS as f32;
    let (sin, cos) = (i as f32 * PI * (3.0 - 5f32.sqrt())).sin_cos();
    let r = (1.0 - y * y).sqrt();
    Vec3::new(r * cos, y, r * sin)
}

/// The portal in pieces shorter than `longest`, or `None` if it takes more than `room`.
fn pieces(portal: &Portal, longest: f32, room: usize) -> Option<Vec<Portal>> {
    let mut done = Vec::new();
    let mut open = vec![windows(&portal.triangles)];
    while let Some(windows) = open.pop() {
        let all = windows.concat();
        if extent(&all) < longest {
            done.push(all);
        } else {
            // The first half is taken up next, so that pieces come in order.
            let [first, second] = if windows.len() > 1 { apart(windows) } else { through(&all) };
            open.extend([second, first]);
        }
        if done.len() + open.len() > room {
            return None;
        }
    }
    if done.len() == 1 {
        return Some(vec![portal.clone()]);
    }
    let named =
        |(i, triangles)| Portal::new(&format!("{} {}", portal.name, i + 1), triangles, portal.transmission);
    Some(done.into_iter().enumerate().filter_map(named).collect())
}

pub(super) type Triangles = Vec<[Vec3; 3]>;

/// Triangles that hang together by corners.
pub(super) fn windows(triangles: &[[Vec3; 3]]) -> Vec<Triangles> {
    let mut place = HashMap::new();
    let mut windows: Vec<Triangles> = Vec::new();
    for (label, corners) in labels(triangles).into_iter().zip(triangles) {
        let at = *place.entry(label).or_insert(windows.len());
        if at == windows.len() {
            windows.push(Vec::new());
        }
        windows[at].push(*corners);
    }
    windows
}

/// A number for each triangle, the same for those that hang together by corners.
pub(super) fn labels(triangles: &[[Vec3; 3]]) -> Vec<u32> {
    let (position, index) = merge::weld(triangles);
    let mut parent: Vec<u32> = (0..position.len() as u32).collect();
    for t in &index {
        let root = root(&mut parent, t[0]);
        for &v in &t[1..] {
            let other = self::root(&mut parent, v);
            parent[other as usize] = root;
        }
    }
    index.iter().map(|t| root(&mut parent, t[0])).collect()
}

fn root(parent: &mut [u32], mut v: u32) -> u32 {
    while parent[v as usize] != v {
        parent[v as usize] = parent[parent[v as usize] as usize];
        v = parent[v as usize];
    }
    v
}

/// Half of the windows on either side, along the axis on which their middles lie farthest apart.
fn apart(mut windows: Vec<Triangles>) -> [Vec<Triangles>; 2] {
    let middle = |w: &Triangles| {
        let (low, high) = bounds(w);
        0.5 * (low + high)
    };
    let middles: Vec<Vec3> = windows.iter().map(middle).collect();
    let (low, high) = limits(middles.iter().copied());
    let axis = (high - low).max_position();
    windows.sort_by(|a, b| middle(a)[axis].total_cmp(&middle(b)[axis]));
    // At the widest gap, so that what is together stays together.
    let gap = |i: &usize| middle(&windows[*i])[axis] - middle(&windows[i - 1])[axis];
    let at = (1..windows.len()).max_by(|i, j| gap(i).total_cmp(&gap(j))).unwrap_or(1);
    let second = windows.split_off(at);
    [windows, second]
}

fn bounds(triangles: &[[Vec3; 3]]) -> (Vec3, Vec3) {
    limits(triangles.iter().flatten().copied())
}

fn limits(points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

/// One window cut across its longer side, the middle of which both halves keep exactly.
fn through(triangles: &[[Vec3; 3]]) -> [Vec<Triangles>; 2] {
    let along = longer_side(triangles);
    let at = |p: Vec3| p.dot(along);
    let corners = || triangles.iter().flatten().map(|&p| at(p));
    let middle =
        0.5 * (corners().fold(f32::INFINITY, f32::min) + corners().fold(f32::NEG_INFINITY, f32::max));
    let half = |sign: f32| triangles.iter().flat_map(|t| clipped(t, |p| sign * (at(p) - middle))).collect();
    [vec![half(-1.0)], vec![half(1.0)]]
}

/// Along the longest edge of the window's outline or across it, where the window reaches farther.
fn longer_side(triangles: &[[Vec3; 3]]) -> Vec3 {
    let outlines = merge::outlines(triangles);
    let edges = outlines.iter().flat_map(|p| (0..p.len()).map(|i| p[(i + 1) % p.len()] - p[i]));
    let edge = edges.max_by(|a, b| a.length_squared().total_cmp(&b.length_squared())).unwrap_or(Vec3::X);
    let largest = triangles.iter().max_by(|a, b| area(a).total_cmp(&area(b))).copied().unwrap_or_default();
    let normal = crate::repair::cross(largest).as_vec3();
    let axes = [edge, normal.cross(edge)].map(Vec3::normalize_or_zero);
    let reach = |axis: &Vec3| {
        let at = || triangles.iter().flatten().map(|p| p.dot(*axis));
        at().fold(f32::NEG_INFINITY, f32::max) - at().fold(f32::INFINITY, f32::min)
    };
    if reach(&axes[0]) >= reach(&axes[1]) { axes[0] } else { axes[1] }
}

/// What of a triangle lies where `height` is not negative, as triangles.
pub(super) fn clipped(t: &[Vec3; 3], height: impl Fn(Vec3) -> f32) -> Triangles {
    let h = t.map(&height);
    let mut ring = Vec::new();
    for i in 0..3 {
        let j = (i + 1) % 3;
        if h[i] >= 0.0 {
            ring.push(t[i]);
        }
        if (h[i] < 0.0) != (h[j] < 0.0) {
            // From the lower end always, so that both halves get the same point.
            let (a, b) = if h[i].abs() < h[j].abs() { (i, j) } else { (j, i) };
            ring.push(t[a].lerp(t[b], h[a] / (h[a] - h[b])));
        }
    }
    (2..ring.len()).map(|i| [ring[0], ring[i - 1], ring[i]]).collect()
}

fn too_many(portal: &Portal, longest: f32) -> Error {
    invalid(format!(
        "'{}' is {:.2} m across and pieces under {longest:.3} m are over {MOST_PORTALS} portals; allow a larger angle, or \
         exterior objects only farther away",
        portal.name,
        portal.extent()
    ))
}

fn invalid(what: String) -> Error {
    Error::Invalid { at: "portals".into(), what }
}
