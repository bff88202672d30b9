//! Photons through a portal, each carrying its response to all SH basis functions at once.
//!
//! A photon starts at a point of the portal, uniform over its area A, in a direction cosine-weighted about its
//! normal. The light that it stands for came from the opposite direction ω, or, where an outer surface is there, from
//! where a path goes on from that. Its flux under the shell radiance yᵢ is π A yᵢ(ω) / N for each i, so that one trace
//! serves every coefficient, and only yᵢ(ω) travels along. At each hit on the front of a triangle the flux goes to
//! the corners by their barycentric weights; divided by a corner's share of area, that is the irradiance there.
//!
//! Photon j is the same whatever their number, so that more photons continue a run, and more bands repeat none.
//!
//! Where it breaks: noise of large flux on small triangles; a final gathering pass smooths it. Light that falls on
//! the back of a one-sided surface bounces on but is not seen there.
//!
//! Based on: H. W. Jensen, Realistic Image Synthesis Using Photon Mapping, 2001; Y. Yue et al., 2009, section 4.1.1.

use std::f32::consts::PI;
use std::ops::Range;

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_relight::sh;
use lunette_scenes::Portal;
use rayon::prelude::*;

use crate::portal::Gates;
use crate::sampling::{Frame, cosine_hemisphere, fractions, hash};
use crate::{Error, Progress, Surface};

/// Photons whose hits are kept at a time: some 20 MB.
const BATCH: u64 = 1 << 16;
/// Photons of one task.
const CHUNK: u64 = 1 << 10;

/// What the photons of one portal need.
pub struct Emission<'a> {
    pub surface: &'a Surface<'a>,
    pub gates: &'a Gates,
    pub portal: &'a Portal,
    pub k: u32,
    /// SH coefficients that are computed.
    pub columns: Range<usize>,
    /// Hits per photon: bounces before the last gathering.
    pub hits: usize,
    pub seed: u64,
}

/// Where a photon arrived, and what was left of it.
struct Arrival {
    triangle: u32,
    weights: [f32; 3],
    throughput: Vec3,
    omega: Vec3,
}

/// Sums of photons `from..to` at the vertices: planes red, green, blue of \[V, columns\] each, not yet divided by the
/// number of photons.
pub fn trace(
    emission: &Emission,
    from: u64,
    to: u64,
    area: &[f32],
    planes: &mut [Vec<f32>; 3],
    progress: &dyn Progress,
) -> Result<(), Error> {
    let n = emission.columns.len();
    let sampler = PortalSampler::new(emission.portal);
    for batch in (from..to).step_by(BATCH as usize) {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let end = to.min(batch + BATCH);
        let chunks: Vec<Vec<Arrival>> = (batch..end)
            .step_by(CHUNK as usize)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|first| {
                (first..end.min(first + CHUNK)).flat_map(|j| photon(emission, &sampler, j)).collect()
            })
            .collect();
        // Each plane takes the hits in their order: the same sums for any number of threads.
        planes.par_iter_mut().enumerate().for_each(|(c, plane)| {
            let mut y = [0.0; sh::MAX_COEFFICIENTS];
            for arrival in chunks.iter().flatten() {
                sh::eval(sh::order_of(emission.columns.end), arrival.omega, &mut y);
                for (&v, w) in
                    emission.surface.mesh.index[arrival.triangle as usize].iter().zip(arrival.weights)
                {
                    let flux = w * arrival.throughput[c] / area[v as usize].max(f32::MIN_POSITIVE);
                    let row = &mut plane[v as usize * n..][..n];
                    row.iter_mut().zip(&y[emission.columns.clone()]).for_each(|(out, y)| *out += flux * y);
                }
            }
        });
        progress.report("photons", end - from, to - from);
    }
    Ok(())
}

/// All arrivals of photon `j`; its flux is π A.
fn photon(emission: &Emission, sampler: &PortalSampler, j: u64) -> Vec<Arrival> {
    let surface = emission.surface;
    let h = hash(emission.seed ^ 0xf0 ^ u64::from(emission.k) << 32, j);
    let (point, normal) = sampler.point(h);
    let mut d = Frame::around(normal, 0.0).to_world(cosine_hemisphere(fractions(hash(h, 1))));
    let mut arrivals = Vec::new();
    let Some((omega, share)) = backwards(emission, point, -d, hash(h, 0x6a)) else { return arrivals };
    let mut origin = point + surface.lift * d;
    let mut throughput = PI * sampler.area * share;
    for step in 0..emission.hits {
        let Some(hit) = surface.tree.intersect(&ffi::Ray::new(origin.into(), d.into())) else { break };
        if step == 0 && emission.gates.first_before(origin, d, hit.t).is_some() {
            break;
        }
        let ng = Vec3::from(hit.normal).normalize_or_zero();
        let is_front = d.dot(ng) < 0.0;
        if is_front {
            let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
            arrivals.push(Arrival { triangle: hit.primitive, weights, throughput, omega });
        }
        throughput *= surface.albedo[hit.primitive as usize];
        if throughput == Vec3::ZERO {
            break;
        }
        let ng = if is_front { ng } else { -ng };
        origin = origin + d * hit.t + ng * surface.lift;
        d = Frame::around(ng, 0.0).to_world(cosine_hemisphere(fractions(hash(h, 2 + step as u64))));
    }
    arrivals
}

/// Where the light came from that arrives at a portal's point against `d`: straight from outside, or by way of outer
/// surfaces, which take their share. None where it is lost, or came through a portal, whose light it then is.
fn backwards(emission: &Emission, point: Vec3, d: Vec3, h: u64) -> Option<(Vec3, Vec3)> {
    let surface = emission.surface;
    let (mut origin, mut d, mut share) = (point + surface.lift * d, d, Vec3::ONE);
    for step in 0..=emission.hits {
        let hit = surface.tree.intersect(&ffi::Ray::new(origin.into(), d.into()));
        let way = hit.map_or(f32::INFINITY, |hit| hit.t);
        if step > 0 && emission.gates.first_before(origin, d, way).is_some() {
            return None;
        }
        let Some(hit) = hit else { return Some((d, share)) };
        share *= surface.albedo[hit.primitive as usize];
        let ng = Vec3::from(hit.normal).normalize_or_zero();
        let ng = if d.dot(ng) < 0.0 { ng } else { -ng };
        origin = origin + d * hit.t + ng * surface.lift;
        d = Frame::around(ng, 0.0).to_world(cosine_hemisphere(fractions(hash(h, step as u64))));
    }
    None
}

/// Points of a portal, uniform over its area.
struct PortalSampler<'a> {
    triangles: &'a [[Vec3; 3]],
    cumulative: Vec<f32>,
    area: f32,
}

impl<'a> PortalSampler<'a> {
    fn new(portal: &'a Portal) -> Self {
        let mut area = 0.0;
        let sum = |[a, b, c]: &[Vec3; 3]| {
            area += 0.5 * (*b - *a).cross(*c - *a).length();
            area
        };
        let cumulative = portal.triangles.iter().map(sum).collect();
        PortalSampler { triangles: &portal.triangles, cumulative, area }
    }

    /// A point and the normal there, into the interior.
    fn point(&self, h: u64) -> (Vec3, Vec3) {
        let at = (h >> 40) as f32 / (1 << 24) as f32 * self.area;
        let i = self.cumulative.partition_point(|&a| a <= at).min(self.triangles.len() - 1);
        let [a, b, c] = self.triangles[i];
        let u = fractions(hash(h, 0));
        let root = u.x.sqrt();
        let point = a * (1.0 - root) + b * (root * (1.0 - u.y)) + c * (root * u.y);
        (point, (b - a).cross(c - a).normalize_or_zero())
    }
}
