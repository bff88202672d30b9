//! Direct light through one portal: per vertex a cubemap of how much each texel of the shell contributes,
//!
//! T\[t\] = ∫ over texel t of V(ω) max(n·ω, 0) dω,
//!
//! V being 1 where the ray along ω passes the portal first of all and is clear inside and outside: one endless
//! shadow ray answers for both, as portals block nothing.
//!
//! *Direction sampling* sends jittered rays through every texel that the portal touches, so that a texel wholly
//! inside the window is exact but for the cosine, which is what a sun in that texel needs. *Area sampling* aims at
//! points of the portal and sorts the rays into texels. A portal that fills little of the texels it touches (small
//! or seen at an angle) wastes most rays of the first kind, one that fills them makes the second kind noisy; the
//! share of a first few rays that pass decides at each vertex, since the variance of a hit-or-miss estimate is that
//! of the share, f (1 - f), against that of the area's foreshortening.
//!
//! Based on: Y. Yue et al., Interactive Rendering of Interior Scenes with Dynamic Environment Illumination, 2009,
//! section 4.1.2.

use glam::{Vec2, Vec3};
use lunette_ffi as ffi;
use lunette_relight::{cubemap, sh};
use lunette_scenes::Portal;

use super::footprint::mark;
use super::gate::Gates;
use crate::Surface;
use crate::sampling::{LANES, fractions, hash};

/// Jittered rays on a side of a texel, least and most.
const SIDE: (usize, usize) = (2, 24);

/// What the rows of one portal need.
pub struct Aim<'a> {
    pub surface: &'a Surface<'a>,
    pub gates: &'a Gates,
    pub portal: &'a Portal,
    /// Number of the portal.
    pub k: u32,
    /// Texels on a side of a face.
    pub n: usize,
    /// Rays per vertex that sees the whole portal.
    pub rays: usize,
    /// SH bands of the direct light that bounced light starts from; 0 for none.
    pub order: usize,
    pub seed: u64,
    cumulative_area: Vec<f32>,
}

/// A vertex's row, dense, with its touched texels; reused from vertex to vertex.
pub struct Row {
    /// sr, \[6 n²\].
    pub dense: Vec<f32>,
    /// SH transfer of the same light, \[order²\].
    pub sh: Vec<f32>,
    touched: Vec<usize>,
    is_touched: Vec<bool>,
    sums: [[f32; LANES]; sh::MAX_COEFFICIENTS],
    /// Whether area sampling was taken.
    pub by_area: bool,
}

impl Row {
    /// An empty row of 6 n² texels.
    pub fn new(n: usize, order: usize) -> Row {
        let texels = 6 * n * n;
        Row {
            dense: vec![0.0; texels],
            sh: vec![0.0; order * order],
            touched: Vec::new(),
            is_touched: vec![false; texels],
            sums: [[0.0; LANES]; sh::MAX_COEFFICIENTS],
            by_area: false,
        }
    }

    fn clear(&mut self) {
        for t in self.touched.drain(..) {
            self.dense[t] = 0.0;
            self.is_touched[t] = false;
        }
        self.sh.fill(0.0);
        self.sums = [[0.0; LANES]; sh::MAX_COEFFICIENTS];
        self.by_area = false;
    }

    fn touch(&mut self, t: usize) {
        if !self.is_touched[t] {
            self.is_touched[t] = true;
            self.touched.push(t);
        }
    }
}

/// One ray and what it is worth.
#[derive(Clone, Copy, Default)]
struct Sample {
    d: Vec3,
    weight: f32,
    texel: usize,
}

impl<'a> Aim<'a> {
    /// `rays`: per vertex and portal.
    pub fn new(
        surface: &'a Surface<'a>,
        gates: &'a Gates,
        portals: &'a [Portal],
        k: usize,
        n: usize,
    ) -> Aim<'a> {
        let portal = &portals[k];
        let mut sum = 0.0;
        let cumulative_area = portal
            .triangles
            .iter()
            .map(|[a, b, c]| {
                sum += 0.5 * (*b - *a).cross(*c - *a).length();
                sum
            })
            .collect();
        Aim { surface, gates, portal, k: k as u32, n, rays: 1024, order: 0, seed: 1, cumulative_area }
    }

    /// Computes the row of vertex `v` as if it lay where vertex `at` lies.
    pub fn row(&self, v: usize, at: usize, row: &mut Row) {
        row.clear();
        let (origin, normal) = (self.surface.origin[at], self.surface.mesh.normal[at]);
        for triangle in &self.portal.triangles {
            if triangle.iter().any(|c| (*c - origin).dot(normal) > 0.0) {
                mark(triangle, origin, self.n, |t| row.touch(t));
            }
        }
        if row.touched.is_empty() {
            return;
        }
        row.touched.sort_unstable();
        row.by_area = self.prefers_area(v, origin, normal, &row.touched);
        if row.by_area {
            self.by_area(v, origin, normal, row);
        } else {
            self.by_direction(v, origin, normal, row);
        }
        for (out, lanes) in row.sh.iter_mut().zip(&row.sums) {
            *out = lanes.iter().sum();
        }
    }

    fn by_direction(&self, v: usize, origin: Vec3, normal: Vec3, row: &mut Row) {
        let side = ((self.rays as f32 / row.touched.len() as f32).sqrt() as usize).clamp(SIDE.0, SIDE.1);
        let mut samples = Samples::default();
        for i in 0..row.touched.len() {
            let texel = row.touched[i];
            for j in 0..side * side {
                let jitter = fractions(hash(self.seed ^ (v as u64) << 20, (texel * side * side + j) as u64));
                let within = (Vec2::new((j % side) as f32, (j / side) as f32) + jitter) / side as f32;
                let (d, solid_angle) = cubemap::sample(self.n, texel, within);
                let weight = solid_angle / (side * side) as f32 * normal.dot(d);
                if weight > 0.0 && samples.push(Sample { d, weight, texel }) {
                    self.trace(origin, &mut samples, row);
                }
            }
        }
        self.trace(origin, &mut samples, row);
    }

    fn by_area(&self, v: usize, origin: Vec3, normal: Vec3, row: &mut Row) {
        let mut samples = Samples::default();
        for j in 0..self.rays {
            let Some((d, weight)) = self.towards(v, j, origin, normal) else { continue };
            let texel = cubemap::texel_of(self.n, d);
            row.touch(texel);
            if samples.push(Sample { d, weight: weight / self.rays as f32, texel }) {
                self.trace(origin, &mut samples, row);
            }
        }
        self.trace(origin, &mut samples, row);
    }

    /// A direction to a stratified point of the portal, and cosine over density; none below the horizon.
    fn towards(&self, v: usize, j: usize, origin: Vec3, normal: Vec3) -> Option<(Vec3, f32)> {
        let h = hash(self.seed ^ 0xa5ea ^ (v as u64) << 20, j as u64);
        let total = *self.cumulative_area.last()?;
        let at = (j as f32 + (h >> 40) as f32 / (1 << 24) as f32) / self.rays as f32 * total;
        let i = self.cumulative_area.partition_point(|&a| a <= at).min(self.portal.triangles.len() - 1);
        let [a, b, c] = self.portal.triangles[i];
        let u = fractions(h);
        let root = u.x.sqrt();
        let point = a * (1.0 - root) + b * (root * (1.0 - u.y)) + c * (root * u.y);
        let to = point - origin;
        let (distance2, facing) = (to.length_squared(), (b - a).cross(c - a).normalize_or_zero());
        let d = to.normalize_or_zero();
        let weight = normal.dot(d) * total * d.dot(facing).abs() / distance2.max(f32::MIN_POSITIVE);
        (weight > 0.0).then_some((d, weight))
    }

    /// Whether area sampling has less variance here: a first few rays of both kinds are held against the openings
    /// alone, which needs no shadow ray.
    fn prefers_area(&self, v: usize, origin: Vec3, normal: Vec3, touched: &[usize]) -> bool {
        const PILOT: usize = 2 * LANES;
        let mut moments = [[0.0f64; 2]; 2];
        for first in (0..PILOT).step_by(LANES) {
            let mut samples = [Samples::default(), Samples::default()];
            for j in first..first + LANES {
                let h = hash(self.seed ^ 0x9107 ^ (v as u64) << 20, j as u64);
                let (d, solid_angle) =
                    cubemap::sample(self.n, touched[j * touched.len() / PILOT], fractions(h));
                let weight = solid_angle * touched.len() as f32 * normal.dot(d).max(0.0);
                samples[0].push(Sample { d, weight, texel: 0 });
                let (d, weight) =
                    self.towards(v, j * self.rays / PILOT, origin, normal).unwrap_or((normal, 0.0));
                samples[1].push(Sample { d, weight, texel: 0 });
            }
            for (samples, moments) in samples.iter().zip(&mut moments) {
                let passes = self.gates.pass(self.k, &samples.packet(origin));
                for (sample, pass) in samples.list.iter().zip(passes) {
                    let value = if pass { f64::from(sample.weight) } else { 0.0 };
                    moments[0] += value;
                    moments[1] += value * value;
                }
            }
        }
        let variance = |[sum, squares]: [f64; 2]| squares / PILOT as f64 - (sum / PILOT as f64).powi(2);
        variance(moments[1]) < variance(moments[0])
    }

    /// Adds the rays that pass the portal and are clear.
    fn trace(&self, origin: Vec3, samples: &mut Samples, row: &mut Row) {
        if samples.n == 0 {
            return;
        }
        let mut rays = samples.packet(origin);
        let passes = self.gates.pass(self.k, &rays);
        if passes[..samples.n].contains(&true) {
            let mask = ffi::Mask::from_fn(|lane| lane < samples.n && passes[lane]);
            self.surface.tree.occluded_packet(&mask, &mut rays);
            let mut weight = [0.0; LANES];
            for (lane, sample) in samples.list[..samples.n].iter().enumerate() {
                if passes[lane] && !rays.is_occluded(lane) {
                    row.dense[sample.texel] += sample.weight;
                    weight[lane] = sample.weight;
                }
            }
            if self.order > 0 {
                let world = [rays.direction_x, rays.direction_y, rays.direction_z];
                sh::accumulate(self.order, &world, &weight, &mut row.sums);
            }
        }
        samples.n = 0;
    }
}

/// Up to a packet of samples.
#[derive(Clone, Copy, Default)]
struct Samples {
    list: [Sample; LANES],
    n: usize,
}

impl Samples {
    /// Adds one; whether the packet is full.
    fn push(&mut self, sample: Sample) -> bool {
        self.list[self.n] = sample;
        self.n += 1;
        self.n == LANES
    }

    fn packet(&self, origin: Vec3) -> ffi::Packet<LANES> {
        let mut rays = ffi::Packet::<LANES>::default();
        for (lane, sample) in self.list[..self.n].iter().enumerate() {
            rays.set(lane, &ffi::Ray::new(origin.into(), sample.d.into()));
        }
        rays
    }
}
