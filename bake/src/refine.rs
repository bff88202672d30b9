//! Finer triangles where the shadow of something near by ends.
//!
//! Rows of vertices say which directions to a window are free, and between them a shadow's edge is found where the corners of
//! a triangle agree about what casts it. About what is nearer than a few lengths of the triangle they cannot: they see it in
//! quite other directions, past the window's edge. There the mesh itself must be finer: where a table's foot stands on a
//! floor, not on the floor around it.
//!
//! From both ends of an edge of length l the same points on the windows' panes are looked at. The edge is cut in its middle
//! where, of the points that both may see, one end sees more than a quarter of them and something nearer than 3 l hides
//! them from the other.
//!
//! Where it breaks: what is thinner than an edge is long, and stands between its ends, is not noticed.

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_scenes::{Mesh, Portal, Scene, cut_edges};
use rayon::prelude::*;

use crate::sampling::LANES;
use crate::{Error, Surface, openings};

/// Points on panes.
const POINTS: usize = 64;

/// Part of them that must differ.
const PART: f32 = 0.25;

/// What hides them is nearer than so many lengths of an edge.
const NEAR: f32 = 3.0;

/// How far each point is hidden, metres: 0 where it is not, not a number where it cannot be seen at all.
type View = [f32; POINTS];

/// Cuts edges where shadows of near things end, `levels` times; says how many triangles more there are. Portals may face
/// either side; `scene` is without their triangles.
///
/// # Errors
/// When Embree cannot be had, the scene has nothing that blocks light, or it would have too many triangles.
pub fn refine(scene: &mut Scene, portals: &[Portal], levels: usize) -> Result<usize, Error> {
    let mut portals = portals.to_vec();
    openings::orient(scene, &mut portals)?;
    let points = points(&portals);
    let mut n_more = 0;
    for _ in 0..levels {
        let views: Vec<View> = {
            let mut surface = Surface::new(scene)?;
            surface.keep_inside(&portals);
            (0..scene.mesh.position.len()).into_par_iter().map(|v| view(&surface, v, &points)).collect()
        };
        let differ = |mesh: &Mesh, a: u32, b: u32| {
            let [a, b] = [a as usize, b as usize];
            do_differ(&views[a], &views[b], NEAR * mesh.position[a].distance(mesh.position[b]))
        };
        match cut_edges(scene, differ).map_err(Error::Scene)? {
            0 => break,
            more => n_more += more,
        }
    }
    Ok(n_more)
}

/// Spread evenly over all panes, with the normal that faces inside.
fn points(portals: &[Portal]) -> Vec<(Vec3, Vec3)> {
    let panes: Vec<[Vec3; 3]> = portals.iter().flat_map(|p| p.triangles.iter().copied()).collect();
    let cross = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
    let whole: f32 = panes.iter().map(|t| cross(*t).length()).sum();
    let (mut points, mut sum) = (Vec::with_capacity(POINTS), 0.0);
    for pane in panes {
        sum += cross(pane).length() / whole;
        while points.len() < POINTS && (points.len() as f32 + 0.5) / POINTS as f32 <= sum {
            // A sequence that fills a square evenly, folded into the triangle.
            let [mut x, mut y] = [0.754_877_7, 0.569_840_3].map(|step| (step * points.len() as f32).fract());
            if x + y > 1.0 {
                [x, y] = [1.0 - x, 1.0 - y];
            }
            let [a, b, c] = pane;
            points.push((a + x * (b - a) + y * (c - a), cross(pane).normalize_or_zero()));
        }
    }
    points
}

fn view(surface: &Surface, v: usize, points: &[(Vec3, Vec3)]) -> View {
    /// A ray ends this much before its point, as a part of its way.
    const BEFORE: f32 = 1e-3;
    let (origin, normal) = (surface.origin[v], surface.mesh.normal[v]);
    let mut view = [f32::NAN; POINTS];
    for (view, points) in view.chunks_mut(LANES).zip(points.chunks(LANES)) {
        let way = |lane: usize| points.get(lane).map_or(Vec3::ZERO, |(p, _)| *p - origin);
        let is_seen = |lane: usize| {
            let facing = points.get(lane).map_or(0.0, |(_, inwards)| -inwards.dot(way(lane)));
            facing > 0.0 && normal.dot(way(lane)) > 0.0
        };
        let mut rays = ffi::Packet::<LANES>::default();
        for lane in 0..LANES {
            let ray = ffi::Ray::new(origin.into(), way(lane).into());
            rays.set(lane, &ffi::Ray { tfar: 1.0 - BEFORE, ..ray });
        }
        let mut hits = ffi::Hits::<LANES>::default();
        surface.tree.intersect_packet(&ffi::Mask::from_fn(is_seen), &mut rays, &mut hits);
        for (lane, view) in view.iter_mut().enumerate().filter(|(lane, _)| is_seen(*lane)) {
            *view = hits.get(&rays, lane).map_or(0.0, |hit| hit.t * way(lane).length());
        }
    }
    view
}

fn do_differ(a: &View, b: &View, near: f32) -> bool {
    let both = || a.iter().zip(b).filter(|(a, b)| !a.is_nan() && !b.is_nan());
    let differ = both().filter(|(a, b)| (**a == 0.0) != (**b == 0.0) && a.max(**b) < near).count();
    differ as f32 > PART * both().count() as f32
}
