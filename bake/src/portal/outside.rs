//! Outer surfaces that a portal looks out on: the outer half of a window's reveal, a sill, the ground before it.
//!
//! They are lit by the sky itself, not through a portal, and what they throw back enters with the rest. Such a vertex
//! belongs to the portal that it lights most, by the form factor Σ A cos cos / r² over a few points of the nearest panes, and
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

/// Points of a pane that a vertex looks at.
const POINTS: usize = 8;

/// Panes that a vertex looks at, the largest in its view.
const MOST_PANES: usize = 8;

/// A pane that fills less of a vertex's cosine-weighted view, sr, takes nothing worth its rays from it.
const LEAST_SEEN: f32 = 1e-4;

/// The portal to which each vertex belongs that lies outside and is seen from one; [`NONE`] for the others.
pub fn owners(surface: &Surface, gates: &Gates, portals: &[Portal], seed: u64) -> Vec<u32> {
    let polygons =
        portals.iter().enumerate().flat_map(|(k, p)| p.convex_polygons().into_iter().map(move |p| (k, p)));
    let panes: Vec<Pane> = polygons
        .enumerate()
        .map(|(i, (k, polygon))| Pane::new(k, &polygon, hash(seed, 0x0d + i as u64)))
        .collect();
    (0..surface.origin.len())
        .into_par_iter()
        .map_init(Vec::new, |open, v| owner(surface, gates, (&panes, portals.len()), v, open))
        .collect()
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

/// A polygon of a portal.
struct Pane {
    portal: usize,
    centre: Vec3,
    /// Into the interior, m².
    area: Vec3,
    /// No corner is farther from the centre, squared, m².
    reach: f32,
    points: [Point; POINTS],
}

/// A point of a pane.
#[derive(Clone, Copy, Default)]
struct Point {
    at: Vec3,
    /// Into the interior, times the area that it stands for.
    area: Vec3,
}

impl Pane {
    fn new(portal: usize, polygon: &[Vec3], seed: u64) -> Pane {
        let centre = polygon.iter().sum::<Vec3>() / polygon.len() as f32;
        let triangles: Vec<[Vec3; 3]> =
            polygon.windows(2).skip(1).map(|w| [polygon[0], w[0], w[1]]).collect();
        let cross = |[a, b, c]: [Vec3; 3]| 0.5 * (b - a).cross(c - a);
        let area: Vec3 = triangles.iter().map(|t| cross(*t)).sum();
        let (mut points, mut n, mut sum) = ([Point::default(); POINTS], 0, 0.0);
        for (i, &[a, b, c]) in triangles.iter().enumerate() {
            sum += cross([a, b, c]).length();
            // As many points as make the area up to here full.
            let wanted = (sum / area.length() * POINTS as f32 + 0.5) as usize;
            for (j, point) in points.iter_mut().enumerate().take(wanted).skip(n) {
                let u = fractions(hash(seed ^ i as u64, j as u64));
                let root = u.x.sqrt();
                let at = a * (1.0 - root) + b * (root * (1.0 - u.y)) + c * (root * u.y);
                *point = Point { at, area: area / POINTS as f32 };
            }
            n = n.max(wanted);
        }
        let reach = polygon.iter().map(|c| c.distance_squared(centre)).fold(0.0, f32::max);
        Pane { portal, centre, area, reach, points }
    }

    /// About how much of the view from `p` it fills, sr; from outside, its normal points away from who looks at it.
    fn size(&self, p: Vec3) -> f32 {
        let to = self.centre - p;
        let square = to.length_squared();
        to.dot(self.area) / (square.sqrt() * square.max(self.reach)).max(f32::MIN_POSITIVE)
    }
}

/// `open` is room to work in.
fn owner(
    surface: &Surface,
    gates: &Gates,
    (panes, n_portals): (&[Pane], usize),
    v: usize,
    open: &mut Vec<(f32, usize)>,
) -> u32 {
    let (origin, normal) = (surface.origin[v], surface.mesh.normal[v]);
    open.clear();
    open.extend(panes.iter().enumerate().map(|(i, p)| (p.size(origin), i)).filter(|(f, _)| *f > LEAST_SEEN));
    let by_size = |a: &(f32, usize), b: &(f32, usize)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
    if open.len() > MOST_PANES {
        open.select_nth_unstable_by(MOST_PANES, by_size);
        open.truncate(MOST_PANES);
    }
    let factor = |p: &Point| {
        let to = p.at - origin;
        let square = to.length_squared().max(f32::MIN_POSITIVE);
        to.dot(normal).max(0.0) * to.dot(p.area).max(0.0) / (square * square)
    };
    let is_seen = |p: &&Point| {
        let to = p.at - origin;
        let ray = ffi::Ray { tfar: 0.999, ..ffi::Ray::new(origin.into(), to.into()) };
        factor(p) > 0.0 && !surface.tree.occluded(&ray) && gates.first_before(origin, to, 0.999).is_none()
    };
    let mut seen = vec![0.0; if open.is_empty() { 0 } else { n_portals }];
    open.sort_unstable_by_key(|pane| pane.1);
    for pane in open.iter().map(|&(_, i)| &panes[i]) {
        seen[pane.portal] += pane.points.iter().filter(is_seen).map(factor).sum::<f32>();
    }
    let seen = seen.into_iter().enumerate().filter(|(_, f)| *f > LEAST_SEEN);
    let best = seen.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
    best.map_or(NONE, |(k, _)| k as u32)
}
