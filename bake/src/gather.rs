//! Passes of rays over every vertex.
//!
//! With N rays ω_k uniform over the hemisphere of the normal n, V their visibility and z = n·ω, [`direct`] sums
//!
//! - open = Σ V / N, the share of the hemisphere that sees the sky;
//! - ao = Σ z V / Σ z;
//! - bent = Σ ω V / N, the unnormalised bent normal;
//! - direct Tᵢ = π Σ z V yᵢ(ω) / Σ z.
//!
//! Dividing by Σ z instead of its mean N / 2 makes an open vertex exactly white with any number of rays.
//!
//! [`bounced`] asks its rays, fewer of them, what they meet: where that is the point h of albedo ρ,
//!
//! - indirect Tᵢ = r · 2 Σ z (1 - V) ρ Sᵢ(h) / N,
//!
//! with S(h) the transfer of all light arriving at h in the pass before, interpolated between the vertices of
//! the triangle met, and r = (1 - ao) / (2 Σ z (1 - V) / N) the covered share of the hemisphere by the many rays
//! over that by the few: a ratio estimator, less noisy than either, under which a white furnace stays exactly
//! white.
//!
//! The interpolation is good where the triangle looks small from the vertex. Where it is longer than the ray, or
//! seen from its back (where its vertices say nothing), the path goes on instead in a cosine-weighted direction,
//! which is noisier and free of that error.
//!
//! Based on: P.-P. Sloan, J. Kautz, J. Snyder, Precomputed Radiance Transfer, 2002 (section 5);
//! G. Ward et al., A Ray Tracing Solution for Diffuse Interreflection, 1988 (going on where a cache is too near).

use std::f32::consts::PI;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_relight::sh;
use rayon::prelude::*;

use crate::sampling::{Directions, Frame, HemisphereSets, LANES, cosine_hemisphere, fractions, hash};
use crate::{Error, Progress, Surface};

/// Vertices of one task: enough to hide the cost of a task, few enough to stop soon and share evenly.
const VERTICES_PER_TASK: usize = 64;

/// A path that keeps meeting backs of triangles is inside something, as from a vertex that is partly buried; after
/// this many steps it takes the light of the front where it stands, so that no light is lost.
const LONGEST_PATH: u64 = 4;

/// Where the numbers of a vertex stand in its row of [`direct`].
pub const OPEN: usize = 0;
pub const AO: usize = 1;
pub const BENT: usize = 2;
pub const SH: usize = 5;

/// Numbers per vertex of [`direct`] at an order, 0 for no SH.
pub fn direct_width(order: usize) -> usize {
    SH + order * order
}

/// What every pass needs.
pub struct Pass<'a> {
    pub surface: &'a Surface<'a>,
    pub sets: &'a HemisphereSets,
    /// SH bands of direct light.
    pub order: usize,
    pub seed: u64,
    /// For progress: its name, rays done before it and in all.
    pub stage: &'a str,
    pub total: u64,
    pub done: &'a AtomicU64,
}

/// The rays of [`direct`].
pub struct Many<'a> {
    pub sets: &'a HemisphereSets,
    /// Ambient occlusion of each vertex, \[V\].
    pub ao: &'a [f32],
}

/// Transfer of the light that arrives at each vertex, red, green, blue: rows of three times the columns. Empty means
/// dark.
pub struct Arriving<'a> {
    /// SH coefficients that are computed.
    pub columns: Range<usize>,
    /// For what a vertex's own rays meet: all light of up to b-1 bounces.
    pub last: &'a [f32],
    /// For what paths meet that went on: of up to b-2 bounces.
    pub before_last: &'a [f32],
    /// What the many rays of [`direct`] found, for the ratio estimate.
    pub many: Option<Many<'a>>,
    /// Whether a path that escapes from a point of a triangle in a direction brings light: always under the open sky.
    pub escapes: &'a (dyn Fn(u32, Vec3, Vec3) -> bool + Sync),
    /// Vertices to leave dark; empty for none.
    pub unlit: &'a [bool],
}

/// Visibility of all vertices; `rows` is \[V, [`direct_width`]\].
pub fn direct(pass: &Pass, rows: &mut [f32], progress: &dyn Progress) -> Result<(), Error> {
    vertices(pass, direct_width(pass.order), rows, progress, |v, row| {
        let (set, frame) = pass.sets.at(v, pass.surface.mesh.normal[v]);
        let zero = [0.0; LANES];
        let mut sums =
            Sums { all_z: zero, open: zero, z: zero, bent: [zero; 3], sh: [zero; sh::MAX_COEFFICIENTS] };
        for local in set {
            (0..LANES).for_each(|i| sums.all_z[i] += local.z[i]);
            let (mut rays, world) = packet(pass.surface.origin[v], &frame, local);
            pass.surface.tree.occluded_packet(&ffi::Mask::all(), &mut rays);
            see(pass.order, local, &world, std::array::from_fn(|i| !rays.is_occluded(i)), &mut sums);
        }
        finish(pass, &sums, row);
    })
}

/// Light that has bounced, at all vertices; `rows` is \[V, 3 columns\], red, green, blue.
pub fn bounced(
    pass: &Pass,
    arriving: &Arriving,
    rows: &mut [f32],
    progress: &dyn Progress,
) -> Result<(), Error> {
    vertices(pass, 3 * arriving.columns.len(), rows, progress, |v, row| {
        row.fill(0.0);
        if arriving.unlit.get(v) == Some(&true) {
            return;
        }
        let mut covered = bounce(pass, arriving, pass.sets, v, row);
        let Some(many) = &arriving.many else { return };
        let truly_covered = (1.0 - many.ao[v]).max(0.0);
        if covered == 0.0 && truly_covered > 0.0 {
            // So little is covered that the few rays missed it; the many did not.
            covered = bounce(pass, arriving, many.sets, v, row);
        }
        if covered > 0.0 {
            row.iter_mut().for_each(|value| *value *= truly_covered / covered);
        }
    })
}

/// Adds what the rays of one vertex bring back; the share of its hemisphere, weighted by cosine, that is covered.
fn bounce(pass: &Pass, arriving: &Arriving, sets: &HemisphereSets, v: usize, row: &mut [f32]) -> f32 {
    let n_rays = sets.n_rays();
    let origin = pass.surface.origin[v];
    let mut covered = 0.0;
    trace(pass.surface, sets, (v, v), |i, z, d, hit| {
        if let Some(hit) = hit {
            let weight = 2.0 * z / n_rays as f32;
            covered += weight;
            let id = hash(pass.seed ^ 0xb0, (v * n_rays + i) as u64);
            follow(pass, arriving, Path { origin, d, weight: Vec3::splat(weight), hit, id }, row);
        }
    });
    covered
}

/// Fills a row of `width` numbers for each vertex, over all threads.
pub fn vertices(
    pass: &Pass,
    width: usize,
    rows: &mut [f32],
    progress: &dyn Progress,
    work: impl Fn(usize, &mut [f32]) + Sync,
) -> Result<(), Error> {
    let n_rays = pass.sets.n_rays() as u64;
    rows.par_chunks_mut(width * VERTICES_PER_TASK).enumerate().try_for_each(|(task, rows)| {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let n_vertices = (rows.len() / width) as u64;
        for (i, row) in rows.chunks_exact_mut(width).enumerate() {
            work(task * VERTICES_PER_TASK + i, row);
        }
        let done = pass.done.fetch_add(n_vertices * n_rays, Ordering::Relaxed);
        progress.report(pass.stage, done + n_vertices * n_rays, pass.total);
        Ok(())
    })
}

/// Sums over the rays of one vertex, one per lane.
struct Sums {
    /// Of all rays; the others are of those that see the sky.
    all_z: [f32; LANES],
    open: [f32; LANES],
    z: [f32; LANES],
    bent: [[f32; LANES]; 3],
    sh: [[f32; LANES]; sh::MAX_COEFFICIENTS],
}

/// The rays of a vertex and their directions in the world.
pub fn packet(origin: Vec3, frame: &Frame, local: &Directions) -> (ffi::Packet<LANES>, [[f32; LANES]; 3]) {
    let axis = |t: f32, b: f32, n: f32| -> [f32; LANES] {
        std::array::from_fn(|i| t * local.x[i] + b * local.y[i] + n * local.z[i])
    };
    let (t, b, n) = (frame.tangent, frame.bitangent, frame.normal);
    let world = [axis(t.x, b.x, n.x), axis(t.y, b.y, n.y), axis(t.z, b.z, n.z)];
    let mut rays = ffi::Packet::<LANES>::default();
    rays.origin_x = [origin.x; LANES];
    rays.origin_y = [origin.y; LANES];
    rays.origin_z = [origin.z; LANES];
    [rays.direction_x, rays.direction_y, rays.direction_z] = world;
    rays.tnear = [0.0; LANES];
    rays.tfar = [f32::INFINITY; LANES];
    (rays, world)
}

/// Sends out the rays of vertex `v` as if it lay where vertex `at` lies; calls `met` with the number, cosine and direction of
/// each, and what it meets.
pub fn trace(
    surface: &Surface,
    sets: &HemisphereSets,
    (v, at): (usize, usize),
    mut met: impl FnMut(usize, f32, Vec3, Option<ffi::Hit>),
) {
    let (set, frame) = sets.at(v, surface.mesh.normal[at]);
    for (k, local) in set.iter().enumerate() {
        let (mut rays, world) = packet(surface.origin[at], &frame, local);
        let mut hits = ffi::Hits::<LANES>::default();
        surface.tree.intersect_packet(&ffi::Mask::all(), &mut rays, &mut hits);
        for (lane, z) in local.z.into_iter().enumerate() {
            met(k * LANES + lane, z, lane_of(&world, lane), hits.get(&rays, lane));
        }
    }
}

/// As [`trace`], with the corners of what is met, their weights, direction and cosine of each ray that meets a front; gives the
/// sum of all rays' cosines.
pub fn fronts(
    surface: &Surface,
    sets: &HemisphereSets,
    vertex: (usize, usize),
    mut met: impl FnMut([u32; 3], [f32; 3], Vec3, f32),
) -> f32 {
    let mut all = 0.0;
    trace(surface, sets, vertex, |_, z, d, hit| {
        all += z;
        if let Some(hit) = hit
            && d.dot(Vec3::from(hit.normal)) < 0.0
        {
            met(surface.mesh.index[hit.primitive as usize], [1.0 - hit.u - hit.v, hit.u, hit.v], d, z);
        }
    });
    all
}

/// The direction of one ray of a packet.
pub fn lane_of(world: &[[f32; LANES]; 3], lane: usize) -> Vec3 {
    Vec3::new(world[0][lane], world[1][lane], world[2][lane])
}

/// Adds the rays of a packet that see the sky.
fn see(order: usize, local: &Directions, world: &[[f32; LANES]; 3], sees: [bool; LANES], sums: &mut Sums) {
    if !sees.contains(&true) {
        return;
    }
    let open = sees.map(|s| if s { 1.0f32 } else { 0.0 });
    let z: [f32; LANES] = std::array::from_fn(|i| open[i] * local.z[i]);
    for i in 0..LANES {
        sums.open[i] += open[i];
        sums.z[i] += z[i];
    }
    for (sum, d) in sums.bent.iter_mut().zip(world) {
        for i in 0..LANES {
            sum[i] += open[i] * d[i];
        }
    }
    if order > 0 {
        sh::accumulate(order, world, &z, &mut sums.sh);
    }
}

fn finish(pass: &Pass, sums: &Sums, row: &mut [f32]) {
    let per_ray = 1.0 / pass.sets.n_rays() as f32;
    let total = |lanes: &[f32; LANES]| lanes.iter().sum::<f32>() * per_ray;
    row[OPEN] = total(&sums.open);
    let per_z = 1.0 / total(&sums.all_z);
    row[AO] = per_z * total(&sums.z);
    for (out, sum) in row[BENT..].iter_mut().zip(&sums.bent) {
        *out = total(sum);
    }
    for (out, sum) in row[SH..].iter_mut().zip(&sums.sh) {
        *out = PI * per_z * total(sum);
    }
}

/// A ray that met something, and the factor of what arrives there.
struct Path {
    origin: Vec3,
    d: Vec3,
    weight: Vec3,
    hit: ffi::Hit,
    id: u64,
}

/// Adds what a path brings back from where it went: the cached transfer at its end, or the sky.
fn follow(pass: &Pass, arriving: &Arriving, mut path: Path, indirect: &mut [f32]) {
    let surface = pass.surface;
    for step in 0..LONGEST_PATH {
        let triangle = path.hit.primitive;
        path.weight *= surface.albedo[triangle as usize];
        let cache = if step == 0 { arriving.last } else { arriving.before_last };
        if path.weight == Vec3::ZERO || (step > 0 && cache.is_empty()) {
            return;
        }
        let ng = Vec3::from(path.hit.normal).normalize_or_zero();
        let is_front = path.d.dot(ng) < 0.0;
        let is_fine = step > 0 || surface.longest_edge[triangle as usize] < path.hit.t;
        if (is_front && is_fine) || step + 1 == LONGEST_PATH {
            add_cached(surface, cache, &path, indirect);
            return;
        }
        // Go on from the side that was met.
        let ng = if is_front { ng } else { -ng };
        let h = hash(path.id, step);
        let d = Frame::around(ng, 0.0).to_world(cosine_hemisphere(fractions(h)));
        // A hair back towards where it came from: a contact in a corner may be rounded to behind the other wall.
        let t = path.hit.t - surface.lift.min(0.5 * path.hit.t);
        let at = path.origin + path.d * t + ng * surface.lift;
        match surface.tree.intersect(&ffi::Ray::new(at.into(), d.into())) {
            Some(hit) => path = Path { origin: at, d, hit, ..path },
            None => {
                if (arriving.escapes)(triangle, at, d) {
                    add_sky(&arriving.columns, d, path.weight, indirect);
                }
                return;
            }
        }
    }
}

fn add_sky(columns: &Range<usize>, d: Vec3, weight: Vec3, indirect: &mut [f32]) {
    let mut y = [0.0; sh::MAX_COEFFICIENTS];
    sh::eval(sh::order_of(columns.end), d, &mut y);
    for (plane, w) in indirect.chunks_exact_mut(columns.len()).zip(weight.to_array()) {
        for (out, y) in plane.iter_mut().zip(&y[columns.clone()]) {
            *out += PI * w * y;
        }
    }
}

fn add_cached(surface: &Surface, cache: &[f32], path: &Path, indirect: &mut [f32]) {
    if cache.is_empty() {
        return;
    }
    let width = indirect.len();
    let n = width / 3;
    let (u, v) = (path.hit.u, path.hit.v);
    let rows = surface.mesh.index[path.hit.primitive as usize].map(|v| &cache[v as usize * width..][..width]);
    for (c, w) in path.weight.to_array().into_iter().enumerate() {
        let factors = [w * (1.0 - u - v), w * u, w * v];
        let plane = c * n..(c + 1) * n;
        let [a, b, d] = rows.map(|row| &row[plane.clone()]);
        for (((out, a), b), d) in indirect[plane].iter_mut().zip(a).zip(b).zip(d) {
            *out += factors[0] * a + factors[1] * b + factors[2] * d;
        }
    }
}
