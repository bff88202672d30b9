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
const BOUNCES: usize = 8;
/// Rays that are looked after from each place that a path reaches.
const LOOKS: u64 = 16;

/// Winds every window of every portal so that its normals point inside, to the side from which fewer rays escape;
/// says how many windows were turned. A portal of which some were has its triangles sorted by window. `scene` is without the portals' triangles.
///
/// # Errors
/// When the scene has nothing that blocks light, or Embree cannot be had.
pub fn orient(scene: &Scene, portals: &mut [Portal]) -> Result<usize, Error> {
    Ok(orient_by(&Rays::solid(scene)?, lift(scene), portals))
}

/// As [`orient`], by rays against what blocks light in the scene.
pub(super) fn orient_by(rays: &Rays, lift: f32, portals: &mut [Portal]) -> usize {
    let mut n_turned = 0;
    for portal in portals {
        let mut windows = portal.windows();
        let turned: Vec<bool> = windows.par_iter().map(|w| looks_out(rays, w, lift)).collect();
        let n = turned.iter().filter(|t| **t).count();
        if n == 0 {
            continue;
        }
        n_turned += n;
        windows.iter_mut().zip(turned).filter(|(_, turned)| *turned).for_each(|(w, _)| w.flip());
        let triangles = windows.into_iter().flat_map(|w| w.triangles).collect();
        *portal = Portal::new(&portal.name, triangles, portal.transmission).unwrap_or_else(|| portal.clone());
    }
    n_turned
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
/// the portals' normals point inside; glass that is in no portal counts as a hole. 0 where no ray escapes at all.
///
/// Where it breaks: what opens beyond eight corners is not found; a room whose walls are seen from behind, in a scene
/// whose other walls are not, is taken for solid matter; and since paths begin at the portals, what enters beside them
/// counts the less, the less the same walls see of both.
///
/// # Errors
/// When the scene has nothing that blocks light, or Embree cannot be had.
pub fn leak_share(scene: &Scene, portals: &[Portal]) -> Result<f32, Error> {
    let rays = Rays::solid(scene)?;
    let Some(gates) = portal_tree(portals)? else { return Ok(0.0) };
    let start = Start::new(portals);
    let paths = Paths { rays: &rays, gates: &gates, lift: lift(scene), backs: Backs::Solid };
    let pool = crate::pool(0)?;
    let mut count = pool.install(|| paths.count(&start));
    if 2 * count.ended > PATHS as u64 {
        count = pool.install(|| Paths { backs: Backs::Walls, ..paths }.count(&start));
    }
    Ok(if count.escaped == 0 { 0.0 } else { count.leaked as f32 / count.escaped as f32 })
}

/// The portals' triangles, to be picked by area.
struct Start {
    triangles: Vec<[Vec3; 3]>,
    /// Twice the area up to and with each.
    sums: Vec<f64>,
}

impl Start {
    fn new(portals: &[Portal]) -> Start {
        let triangles: Vec<[Vec3; 3]> = portals.iter().flat_map(|p| p.triangles.iter().copied()).collect();
        let add = |sum: &mut f64, t: &[Vec3; 3]| {
            *sum += f64::from((t[1] - t[0]).cross(t[2] - t[0]).length());
            Some(*sum)
        };
        let sums = triangles.iter().scan(0.0, add).collect();
        Start { triangles, sums }
    }

    /// A point, and the unit normal into the interior.
    fn pick(&self, random: &mut Random) -> (Vec3, Vec3) {
        let at = f64::from(random.next()) * self.sums.last().copied().unwrap_or(0.0);
        let t = self.sums.partition_point(|s| *s <= at).min(self.triangles.len() - 1);
        let [a, b, c] = self.triangles[t];
        let (r, s) = (random.next().sqrt(), random.next());
        let p = a * (1.0 - r) + b * (r * (1.0 - s)) + c * (r * s);
        (p, (b - a).cross(c - a).normalize_or_zero())
    }
}

/// What surfaces seen from behind are.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Backs {
    /// The inside of solid matter: of a window's bars, through which its portal passes.
    Solid,
    /// Walls like any other, in a scene that is inside out.
    Walls,
}

#[derive(Clone, Copy, Default)]
struct Count {
    /// Rays that escape, and those of them that pass no portal.
    escaped: u64,
    leaked: u64,
    /// Paths that ended in solid matter.
    ended: u64,
}

struct Paths<'a> {
    rays: &'a Rays,
    gates: &'a ffi::Scene,
    lift: f32,
    backs: Backs,
}

impl Paths<'_> {
    fn count(&self, start: &Start) -> Count {
        let sum = |a: Count, b: Count| Count {
            escaped: a.escaped + b.escaped,
            leaked: a.leaked + b.leaked,
            ended: a.ended + b.ended,
        };
        let walk = |i: usize| self.walk(start, &mut Random { seed: i as u64, n: 0 });
        (0..PATHS).into_par_iter().map(walk).reduce(Count::default, sum)
    }

    /// From a portal inwards, from surface to surface.
    fn walk(&self, start: &Start, random: &mut Random) -> Count {
        let (mut p, mut normal) = start.pick(random);
        let mut count = Count::default();
        for _ in 0..=BOUNCES {
            let (origin, onwards) = (p + self.lift * normal, random.cosine(normal));
            let next = self.rays.surface(origin, onwards);
            if self.backs == Backs::Solid && next.is_some_and(|next| next.is_back) {
                count.ended = 1;
                break;
            }
            let (escaped, leaked) = self.look(origin, normal, random);
            if 2 * leaked > LOOKS {
                // It is outside already, and the ray that led here leaked; or it has no roof.
                count.escaped += 1;
                count.leaked += 1;
                break;
            }
            count.escaped += escaped;
            count.leaked += leaked;
            // A path that leaves by a portal is outside from there on.
            let Some(next) = next.filter(|next| !self.passes(origin, onwards, next.distance)) else { break };
            (p, normal) = (origin + next.distance * onwards, next.normal);
        }
        count
    }

    /// How many rays escape, and how many of them by no portal.
    fn look(&self, origin: Vec3, normal: Vec3, random: &mut Random) -> (u64, u64) {
        let (mut escaped, mut leaked) = (0, 0);
        for _ in 0..LOOKS {
            let d = random.cosine(normal);
            if self.rays.surface(origin, d).is_none() {
                escaped += 1;
                leaked += u64::from(!self.passes(origin, d, f32::INFINITY));
            }
        }
        (escaped, leaked)
    }

    /// Whether a portal is on the way.
    fn passes(&self, origin: Vec3, d: Vec3, distance: f32) -> bool {
        let mut ray = ffi::Ray::new(origin.into(), d.into());
        ray.tfar = ray.tfar.min(distance);
        self.gates.occluded(&ray)
    }
}

/// Height of a ray's origin over a surface, metres: above the rounding of the scene's coordinates.
pub(super) fn lift(scene: &Scene) -> f32 {
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
