//! Outer surfaces that a portal looks out on: the outer half of a window's reveal, a sill, the ground before it.
//!
//! They are lit by the sky itself, not through a portal, and what they throw back enters with the rest. Such a vertex
//! belongs to the portal that it lights most, by the form factor Σ A cos cos / r² over a few points of the nearest panes, and
//! its row is that of the open sky in that portal's shell: tinted or closed glass then tints or stops its light too.
//! Seen from outside, such surfaces look as if they lay behind the glass.
//!
//! What lies outside and is seen from no portal may light what is: a wall stands over the roof before its window. Of a vertex
//! there few rays say how much of what it gets it sends in over others,
//!
//! f(v) = ρ(v) Σ_u F\[v,u\] f(u),
//!
//! F\[v,u\] being the share of its hemisphere that u fills, and f of what sees panes its reflectance ρ times the form factor
//! above. Those with the largest f have light, so many that the others would add less than [`LEFT_OUT`] to what comes in
//! straight.
//!
//! Where it breaks: exterior objects that are captured into the shell are not seen to shade these surfaces other than
//! from the portal's centre.

use std::f32::consts::PI;

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_scenes::Portal;
use rayon::prelude::*;

use super::Gates;
use crate::Surface;
use crate::gather::{fronts, packet};
use crate::sampling::{HemisphereSets, LANES, fractions, hash};

/// Points of a pane that a vertex looks at.
const POINTS: usize = 8;

/// Panes that a vertex looks at, the largest in its view.
const MOST_PANES: usize = 8;

/// A pane that fills less of a vertex's cosine-weighted view, sr, takes nothing worth its rays from it.
const LEAST_SEEN: f32 = 1e-4;

/// Vertices that lie outside.
pub struct Outside {
    /// The portal to which each vertex belongs of those that send light in; [`NONE`] for the others.
    pub owners: Vec<u32>,
    /// Vertices outside that send nothing in that is worth computing.
    pub unlit: Vec<bool>,
}

/// Share of the light that comes in straight under an even sky, which what is left out would add to at most.
const LEFT_OUT: f32 = 0.0005;

/// Times that light is followed from one to the next of vertices that see no portal.
const STEPS: usize = 2;

/// Finds out what lies outside and sends light in; `sets` are of few directions, `rho` is the grey reflectance of each
/// vertex.
pub fn outside(
    surface: &Surface,
    gates: &Gates,
    portals: &[Portal],
    sets: &HemisphereSets,
    rho: &[f32],
    seed: u64,
) -> Outside {
    let polygons =
        portals.iter().enumerate().flat_map(|(k, p)| p.convex_polygons().into_iter().map(move |p| (k, p)));
    let panes: Vec<Pane> = polygons
        .enumerate()
        .map(|(i, (k, polygon))| Pane::new(k, &polygon, hash(seed, 0x0d + i as u64)))
        .collect();
    let mut sent: Vec<Sent> = (0..surface.origin.len())
        .into_par_iter()
        .map_init(Vec::new, |open, v| owner(surface, gates, (&panes, portals.len()), v, open).times(rho[v]))
        .collect();
    let others = (0..sent.len()).into_par_iter().filter(|&v| sent[v].portal == NONE);
    let mut others: Vec<usize> = others.filter(|&v| is_outer(surface, gates, sets, v)).collect();
    let mut unlit = vec![false; sent.len()];
    others.iter().for_each(|&v| unlit[v] = true);
    for _ in 0..STEPS {
        let next: Vec<Sent> =
            others.par_iter().map(|&v| sent_on(surface, sets, &sent, v).times(rho[v])).collect();
        others.iter().zip(next).for_each(|(&v, next)| sent[v] = next);
    }
    // What sends least, first.
    others.sort_by(|&a, &b| sent[a].factor.total_cmp(&sent[b].factor).then(a.cmp(&b)));
    let area = surface.mesh.vertex_area();
    let mut left = LEFT_OUT * PI * portals.iter().map(Portal::area).sum::<f32>();
    for v in others {
        left -= area[v] * sent[v].factor;
        if left > 0.0 || sent[v].portal == NONE {
            sent[v] = Sent::default();
        } else {
            unlit[v] = false;
        }
    }
    Outside { owners: sent.into_iter().map(|sent| sent.portal).collect(), unlit }
}

/// A vertex of whose hemisphere more than this sees the sky beside all portals is outside, and not only near a gap.
const OUTER: f32 = 0.25;

fn is_outer(surface: &Surface, gates: &Gates, sets: &HemisphereSets, v: usize) -> bool {
    let (set, frame) = sets.at(v, surface.mesh.normal[v]);
    let escaping = set.iter().map(|local| {
        let (rays, _) = packet(surface.origin[v], &frame, local);
        let mut shadow = rays;
        surface.tree.occluded_packet(&ffi::Mask::all(), &mut shadow);
        let passes = gates.any(&ffi::Mask::all(), &rays);
        (0..LANES).filter(|&lane| !shadow.is_occluded(lane) && !passes[lane]).count()
    });
    escaping.sum::<usize>() as f32 > OUTER * sets.n_rays() as f32
}

/// Through which portal a vertex sends most of what it sends in.
#[derive(Clone, Copy)]
struct Sent {
    /// [`NONE`] for none.
    portal: u32,
    /// f, sr.
    factor: f32,
}

impl Sent {
    fn times(self, rho: f32) -> Sent {
        Sent { factor: rho * self.factor, ..self }
    }
}

impl Default for Sent {
    fn default() -> Sent {
        Sent { portal: NONE, factor: 0.0 }
    }
}

/// What a vertex that reflects all sends in over those that its rays meet.
fn sent_on(surface: &Surface, sets: &HemisphereSets, sent: &[Sent], v: usize) -> Sent {
    let mut by_portal: Vec<Sent> = Vec::new();
    let all = fronts(surface, sets, (v, v), |corners, weights, _, z| {
        for (corner, weight) in corners.map(|u| sent[u as usize]).into_iter().zip(weights) {
            let factor = z * weight * corner.factor;
            match by_portal.iter_mut().find(|sum| sum.portal == corner.portal) {
                Some(sum) => sum.factor += factor,
                None => by_portal.push(Sent { factor, ..corner }),
            }
        }
    });
    let best = by_portal.into_iter().filter(|sum| sum.portal != NONE && sum.factor > 0.0);
    let best = best.max_by(|a, b| a.factor.total_cmp(&b.factor).then(b.portal.cmp(&a.portal)));
    best.map_or(Sent::default(), |best| Sent { factor: best.factor / all, ..best })
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

/// What a vertex that reflects all sends in straight; `open` is room to work in.
fn owner(
    surface: &Surface,
    gates: &Gates,
    (panes, n_portals): (&[Pane], usize),
    v: usize,
    open: &mut Vec<(f32, usize)>,
) -> Sent {
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
    best.map_or(Sent::default(), |(k, factor)| Sent { portal: k as u32, factor })
}
