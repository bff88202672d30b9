//! Given portals against the scene: which side of each is inside, and how much light enters elsewhere.

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_scenes::{Portal, Scene};
use rayon::prelude::*;

use super::rays::{Rays, portal_tree, sphere};
use crate::Error;
use crate::sampling::{Frame, hash};

/// Rays from each point: over the sphere, or over the hemisphere of a surface.
const RAYS: usize = 256;

/// Points of a window that are asked which side is inside.
const MOST_POINTS: usize = 9;

/// Paths into the interior, and how often each goes on from where it arrives: light that enters through a far door
/// is seen only from around the corner.
const PATHS: usize = 4096;
const BOUNCES: usize = 3;
/// Rays that are looked after from each place that a path reaches.
const LOOKS: usize = 16;

/// Winds every window of every portal so that its normals point inside, to the side from which fewer rays escape;
/// says how many windows were turned. A portal of which some were has its triangles sorted by window. `scene` is without the portals' triangles.
///
/// # Errors
/// When the scene has nothing that blocks light, or Embree cannot be had.
pub fn orient(scene: &Scene, portals: &mut [Portal]) -> Result<usize, Error> {
    let rays = Rays::solid(scene)?;
    let lift = lift(scene);
    let mut n_turned = 0;
    for portal in portals {
        let mut windows = portal.windows();
        let turned = windows.par_iter().map(|w| looks_out(&rays, w, lift)).collect::<Vec<_>>();
        let n = turned.iter().filter(|t| **t).count();
        if n == 0 {
            continue;
        }
        n_turned += n;
        windows.iter_mut().zip(turned).filter(|(_, turned)| *turned).for_each(|(w, _)| w.flip());
        let triangles = windows.into_iter().flat_map(|w| w.triangles).collect();
        *portal = Portal::new(&portal.name, triangles, portal.transmission).unwrap_or_else(|| portal.clone());
    }
    Ok(n_turned)
}

/// Whether more rays escape from a window's front than from its back.
fn looks_out(rays: &Rays, window: &Portal, lift: f32) -> bool {
    let directions = sphere(2 * RAYS);
    let every = window.triangles.len().div_ceil(MOST_POINTS);
    let mut balance = 0.0;
    for [a, b, c] in window.triangles.iter().step_by(every) {
        let cross = (*b - *a).cross(*c - *a);
        let (middle, normal) = ((*a + *b + *c) / 3.0, cross.normalize_or_zero());
        let front: Vec<Vec3> = directions.iter().copied().filter(|d| d.dot(normal) > 0.0).collect();
        let back: Vec<Vec3> = front.iter().map(|d| -*d).collect();
        let escaping =
            |directions: &[Vec3], side: f32| rays.view(middle + side * lift * normal, directions).clear;
        balance += cross.length() * (escaping(&front, 1.0) - escaping(&back, -1.0));
    }
    balance > 0.0
}

/// The share of the rays escaping from inside that do not pass a portal: 0 where portals part inside from outside.
/// Inside is what is reached from the portals by paths that stay inside. `scene` is without the portals' triangles,
/// the portals' normals point inside. 0 where no ray escapes at all.
///
/// # Errors
/// When the scene has nothing that blocks light, or Embree cannot be had.
pub fn leak_share(scene: &Scene, portals: &[Portal]) -> Result<f32, Error> {
    let rays = Rays::solid(scene)?;
    let Some(gates) = portal_tree(portals)? else { return Ok(0.0) };
    let gates = &gates;
    let lift = lift(scene);
    let sums: Vec<f64> = portals
        .iter()
        .flat_map(|p| &p.triangles)
        .scan(0.0, |sum, [a, b, c]| {
            *sum += f64::from((*b - *a).cross(*c - *a).length());
            Some(*sum)
        })
        .collect();
    let triangles: Vec<[Vec3; 3]> = portals.iter().flat_map(|p| p.triangles.iter().copied()).collect();
    let counts = (0..PATHS).into_par_iter().map(|i| {
        let mut random = Random { seed: i as u64, n: 0 };
        let at = f64::from(random.next()) * sums.last().copied().unwrap_or(0.0);
        let t = triangles[sums.partition_point(|s| *s <= at).min(triangles.len() - 1)];
        walk(&rays, gates, t, lift, &mut random)
    });
    let (escaped, leaked) = counts.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    Ok(if escaped == 0 { 0.0 } else { leaked as f32 / escaped as f32 })
}

/// From a portal inwards, from surface to surface: how many rays escape, and how many of them by no portal.
fn walk(rays: &Rays, gates: &ffi::Scene, [a, b, c]: [Vec3; 3], lift: f32, random: &mut Random) -> (u64, u64) {
    let (r, s) = (random.next().sqrt(), random.next());
    let mut p = a * (1.0 - r) + b * (r * (1.0 - s)) + c * (r * s);
    let mut normal = (b - a).cross(c - a).normalize_or_zero();
    let (mut escaped, mut leaked) = (0, 0);
    for _ in 0..BOUNCES {
        // A path that leaves by a portal is outside from there on.
        let (origin, onwards) = (p + lift * normal, random.cosine(normal));
        let Some((wall, facing)) = rays.surface(origin, onwards) else { break };
        let gate = gates.intersect(&ffi::Ray::new(origin.into(), onwards.into()));
        if gate.is_some_and(|gate| gate.t < wall.distance(origin)) {
            break;
        }
        (p, normal) = (wall, facing);
        for _ in 0..LOOKS {
            let (origin, d) = (p + lift * normal, random.cosine(normal));
            if rays.surface(origin, d).is_none() {
                escaped += 1;
                leaked += u64::from(!gates.occluded(&ffi::Ray::new(origin.into(), d.into())));
            }
        }
    }
    (escaped, leaked)
}

/// Height of a ray's origin over a surface, metres: above the rounding of the scene's coordinates.
fn lift(scene: &Scene) -> f32 {
    let (low, high) = scene.mesh.bounds();
    1e-5 * (high - low).length()
}

struct Random {
    seed: u64,
    n: u64,
}

impl Random {
    /// From 0 up to 1, without it.
    fn next(&mut self) -> f32 {
        self.n += 1;
        (hash(self.seed, self.n) >> 40) as f32 / (1u64 << 24) as f32
    }

    fn cosine(&mut self, normal: Vec3) -> Vec3 {
        let (r2, phi) = (self.next(), std::f32::consts::TAU * self.next());
        let (sin, cos) = phi.sin_cos();
        let r = r2.sqrt();
        Frame::around(normal, 0.0).to_world(Vec3::new(r * cos, r * sin, (1.0 - r2).sqrt()))
    }
}
