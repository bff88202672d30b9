//! Outer surfaces that a portal looks out on: the outer half of a window's reveal, a sill, the ground before it.
//!
//! They are lit by the sky itself, not through a portal, and what they throw back enters with the rest. Such a vertex
//! belongs to the portal that it lights most, by the form factor Σ A cos cos / r² over a few points of the pane, and
//! its row is that of the open sky in that portal's shell: tinted or closed glass then tints or stops its light too.
//! Seen from outside, such surfaces look as if they lay behind the glass.
//!
//! Where it breaks: exterior objects that are captured into the shell are not seen to shade these surfaces other than
//! from the portal's centre.

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_scenes::Portal;
use rayon::prelude::*;

use super::Gates;
use crate::Surface;
use crate::gather::packet;
use crate::sampling::{HemisphereSets, LANES, fractions, hash};

/// Points of a portal that a vertex looks at.
const POINTS: usize = 8;

/// Portals that a vertex looks at, the largest in its view.
const MOST_PORTALS: usize = 4;

/// A portal that fills less of a vertex's cosine-weighted view, sr, takes nothing worth its rays from it.
const LEAST_SEEN: f32 = 1e-4;

/// The portal to which each vertex belongs that lies outside and is seen from one; [`NONE`] for the others.
pub fn owners(surface: &Surface, gates: &Gates, portals: &[Portal], seed: u64) -> Vec<u32> {
    let points: Vec<Vec<Point>> =
        portals.iter().enumerate().map(|(k, p)| points_of(p, hash(seed, 0x0d + k as u64))).collect();
    (0..surface.origin.len()).into_par_iter().map(|v| owner(surface, gates, &points, v)).collect()
}

/// A vertex of whose hemisphere more than this sees the sky beside all portals is outside, and not only near a gap.
const OUTER: f32 = 0.25;

/// Whether each vertex lies outside and is seen from no portal: no light that enters comes from there, and none is
/// worth computing there.
pub fn unlit(surface: &Surface, gates: &Gates, owners: &[u32], sets: &HemisphereSets) -> Vec<bool> {
    let is_outer = |v: usize| {
        let (set, frame) = sets.at(v, surface.mesh.normal[v]);
        let escaping = set.iter().map(|local| {
            let (rays, _) = packet(surface.origin[v], &frame, local);
            let mut shadow = rays;
            surface.tree.occluded_packet(&ffi::Mask::all(), &mut shadow);
            let passes = gates.any(&ffi::Mask::all(), &rays);
            (0..LANES).filter(|&lane| !shadow.is_occluded(lane) && !passes[lane]).count()
        });
        escaping.sum::<usize>() as f32 > OUTER * sets.n_rays() as f32
    };
    (0..owners.len()).into_par_iter().map(|v| owners[v] == NONE && is_outer(v)).collect()
}

/// No portal.
pub const NONE: u32 = u32::MAX;

/// A point of a portal.
struct Point {
    at: Vec3,
    /// Into the interior, times the area that it stands for.
    area: Vec3,
}

fn points_of(portal: &Portal, seed: u64) -> Vec<Point> {
    let total = portal.area();
    let mut sum = 0.0;
    let mut list = Vec::new();
    for (i, [a, b, c]) in portal.triangles.iter().enumerate() {
        let cross = 0.5 * (*b - *a).cross(*c - *a);
        sum += cross.length();
        // As many points as make the area up to here full.
        let wanted = (sum / total * POINTS as f32 + 0.5) as usize;
        for j in list.len()..wanted.min(POINTS) {
            let u = fractions(hash(seed ^ i as u64, j as u64));
            let root = u.x.sqrt();
            let at = *a * (1.0 - root) + *b * (root * (1.0 - u.y)) + *c * (root * u.y);
            list.push(Point { at, area: cross.normalize_or_zero() * (total / POINTS as f32) });
        }
    }
    list
}

fn owner(surface: &Surface, gates: &Gates, portals: &[Vec<Point>], v: usize) -> u32 {
    let (origin, normal) = (surface.origin[v], surface.mesh.normal[v]);
    let factor = |p: &Point| {
        let to = p.at - origin;
        let square = to.length_squared().max(f32::MIN_POSITIVE);
        // From outside, a portal's normal points away from who looks at it.
        to.dot(normal).max(0.0) * to.dot(p.area).max(0.0) / (square * square)
    };
    let mut open: Vec<(f32, usize)> = portals
        .iter()
        .enumerate()
        .map(|(k, points)| (points.iter().map(factor).sum(), k))
        .filter(|(f, _)| *f > LEAST_SEEN)
        .collect();
    open.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    open.truncate(MOST_PORTALS);
    let is_seen = |p: &&Point| {
        let to = p.at - origin;
        let ray = ffi::Ray { tfar: 0.999, ..ffi::Ray::new(origin.into(), to.into()) };
        factor(p) > 0.0 && !surface.tree.occluded(&ray) && gates.first_before(origin, to, 0.999).is_none()
    };
    let seen = open.iter().map(|&(_, k)| (portals[k].iter().filter(is_seen).map(factor).sum::<f32>(), k));
    let best = seen.filter(|(f, _)| *f > LEAST_SEEN).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
    best.map_or(NONE, |(_, k)| k as u32)
}
