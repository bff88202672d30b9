//! Eight points of a frame.
//!
//! What all points need runs over eight lanes in straight lines, for the compiler to make vectors of; masks are
//! drawn for one point after the other, and only where a body's cone meets the lamp's.

use std::f32::consts::TAU;

use glam::Vec3;

use super::blockers::{LANES, Sphere};
use super::frame::{Options, Points, Probe, Scene, Scratch, Stage, Surface, Target};
use super::lamp::cap_exponent;
use super::leaves::{Order, Profiles};
use super::mask::{Cone, Cover};
use super::product::{product_axis, product_shape};
use super::reflectance::{Column, Columns, Frames, MAX_LOBES, Reflectance, lane_of};
use super::weights::weights;
use super::{Lamp, product_integral};

/// Sine of the angular radius below which a lamp is a brighter or darker one of this size: its exponents stay in
/// the range of f32.
const LEAST_SIN: f32 = 1e-6;

/// What a frame is made of.
pub(super) struct Job<'a> {
    pub points: &'a Points<'a>,
    pub surface: Option<&'a Surface<'a>>,
    pub scene: &'a Scene<'a>,
    pub options: &'a Options,
}

/// All points, all lamps.
#[inline(always)]
pub(super) fn run(job: &Job<'_>, scratch: &mut Scratch, target: &mut Target<'_>, probe: &mut impl Probe) {
    let mut chunk = Chunk::default();
    for first in (0..job.points.position.len()).step_by(LANES) {
        let n = LANES.min(job.points.position.len() - first);
        chunk.gather(job.points, first, n);
        match job.surface {
            None => chunk.diffuse(),
            Some(surface) => chunk.reflect(surface, first, n),
        }
        probe.end(Stage::Reflectance);
        for current in 0..job.scene.lamps.len() {
            chunk.lamp(job, current, n, scratch, probe);
        }
        chunk.scatter(target, first, n);
    }
}

/// A lamp as eight points see it.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    axis: Columns,
    distance: [f32; LANES],
    sin_squared: [f32; LANES],
    /// The lamp's solid angle over that of `sin_squared`; 1 but for the tiniest lamps.
    dim: [f32; LANES],
}

/// Products of one reflectance lobe and the lamp, for eight points.
#[derive(Clone, Copy, Debug, Default)]
struct Products {
    light: [f32; LANES],
    versine: [f32; LANES],
    /// 0 where it is below the threshold.
    integral: [f32; LANES],
}

/// Eight points.
#[derive(Clone, Debug, Default)]
struct Chunk {
    position: Columns,
    normal: Columns,
    /// The first is diffuse.
    lobes: [Column; MAX_LOBES],
    n_lobes: usize,
    products: [Products; MAX_LOBES],
    sum: Columns,
    count: [u32; LANES],
}

impl Chunk {
    #[inline(always)]
    fn gather(&mut self, points: &Points<'_>, first: usize, n: usize) {
        for lane in 0..LANES {
            // Empty places repeat the last point.
            let i = first + lane.min(n - 1);
            for c in 0..3 {
                self.position[c][lane] = points.position[i][c];
                self.normal[c][lane] = points.normal[i][c];
            }
        }
        self.sum = [[0.0; LANES]; 3];
        self.count = [0; LANES];
    }

    #[inline(always)]
    fn diffuse(&mut self) {
        self.lobes[0] = Column { axis: self.normal, exponent: [1.0; LANES], scale: [[1.0; LANES]; 3] };
        self.n_lobes = 1;
    }

    #[inline(always)]
    fn reflect(&mut self, surface: &Surface<'_>, first: usize, n: usize) {
        let at = |lane: usize| first + lane.min(n - 1);
        let material = |lane: usize| &surface.materials[surface.material[at(lane)] as usize];
        let materials: [&Reflectance; LANES] = std::array::from_fn(material);
        let mut tangent = [[0.0; LANES]; 3];
        if !surface.tangent.is_empty() {
            for lane in 0..LANES {
                (0..3).for_each(|c| tangent[c][lane] = surface.tangent[at(lane)][c]);
            }
        }
        let mut view = [[0.0; LANES]; 3];
        for lane in 0..LANES {
            let to = surface.eye - lane_of(&self.position, lane);
            let to = to * (1.0 / to.length_squared().max(1e-30).sqrt());
            (0..3).for_each(|c| view[c][lane] = to[c]);
        }
        let frames = Frames::new(&self.normal, &tangent, &view);
        self.lobes[0] = frames.diffuse(&materials);
        self.n_lobes = 1;
        while self.n_lobes < MAX_LOBES
            && materials.iter().any(|m| m.shaped[self.n_lobes - 1].scale != Vec3::ZERO)
        {
            self.lobes[self.n_lobes] = frames.shaped(&materials, self.n_lobes - 1);
            self.n_lobes += 1;
        }
    }

    #[inline(always)]
    fn lamp(
        &mut self,
        job: &Job<'_>,
        current: usize,
        n: usize,
        scratch: &mut Scratch,
        probe: &mut impl Probe,
    ) {
        let lamp = &job.scene.lamps[current];
        let seen = see(lamp, &self.position);
        probe.end(Stage::Lighting);
        let mut kept = [0u32; LANES];
        for k in 0..self.n_lobes {
            self.products[k] =
                if k == 0 { against_lambert(&seen, &self.lobes[0]) } else { multiply(&seen, &self.lobes[k]) };
            self.drop_small(k, &seen, job.options.threshold, &mut kept);
        }
        probe.end(Stage::Integration);
        let touched = touched(&seen, &self.position, job, current);
        let mut part = [[1.0; LANES]; MAX_LOBES];
        for lane in (0..n).filter(|&lane| touched[lane] && kept[lane] > 0) {
            let parts = self.visible(job, current, &seen, lane, scratch, probe);
            (0..MAX_LOBES).for_each(|k| part[k][lane] = parts[k]);
        }
        for k in 0..self.n_lobes {
            for lane in 0..LANES {
                let reflected = self.products[k].integral[lane] * part[k][lane];
                for c in 0..3 {
                    self.sum[c][lane] += self.lobes[k].scale[c][lane] * lamp.radiance[c] * reflected;
                }
            }
        }
        (0..LANES).for_each(|lane| self.count[lane] += kept[lane]);
        probe.end(Stage::Integration);
    }

    /// Products below the threshold become 0, the others are counted.
    #[inline(always)]
    fn drop_small(&mut self, k: usize, seen: &Seen, threshold: f32, kept: &mut [u32; LANES]) {
        let (products, scale) = (&mut self.products[k], &self.lobes[k].scale);
        for lane in 0..LANES {
            let solid_angle = TAU * versine(seen.sin_squared[lane]) * seen.dim[lane];
            let brightest = scale[0][lane].max(scale[1][lane]).max(scale[2][lane]);
            let keep = products.integral[lane] * brightest > threshold * solid_angle;
            products.integral[lane] = if keep { products.integral[lane] } else { 0.0 };
            kept[lane] += u32::from(keep);
        }
    }

    /// What is left of each product where something may stand before the lamp.
    #[inline(always)]
    fn visible(
        &mut self,
        job: &Job<'_>,
        current: usize,
        seen: &Seen,
        lane: usize,
        scratch: &mut Scratch,
        probe: &mut impl Probe,
    ) -> [f32; MAX_LOBES] {
        let position = lane_of(&self.position, lane);
        let lamps = job.scene.lamps;
        let lamp = &lamps[current];
        let cone = Cone::new(position, lane_of(&seen.axis, lane), seen.distance[lane], lamp.radius);
        let mut cover = if seen.distance[lane] > lamp.radius {
            let others =
                lamps.iter().enumerate().filter(|(i, _)| *i != current).map(|(_, lamp)| lamp.sphere());
            scratch.mask.draw(&cone, job.scene.blockers, others)
        } else {
            scratch.mask.draw_inside(position, job.scene.blockers)
        };
        probe.end(Stage::Mask);
        if cover == Cover::Partial {
            cover = scratch.leaves.collect(&scratch.mask, &cone, weights(), job.options.threshold);
        }
        if cover == Cover::Partial {
            scratch.full.collect_full(&cone, weights());
        }
        probe.end(Stage::Leaves);
        let parts = match cover {
            Cover::Lit => [1.0; MAX_LOBES],
            Cover::Dark => [0.0; MAX_LOBES],
            Cover::Partial => self.parts(lane, &cone, scratch),
        };
        probe.end(Stage::Integration);
        parts
    }

    #[inline(always)]
    fn parts(&mut self, lane: usize, cone: &Cone, scratch: &Scratch) -> [f32; MAX_LOBES] {
        let mut parts = [0.0; MAX_LOBES];
        for k in (0..self.n_lobes).filter(|&k| self.products[k].integral[lane] > 0.0) {
            parts[k] = self.part(k, lane, cone, scratch);
            self.count[lane] += scratch.leaves.n + scratch.full.n;
        }
        parts
    }

    /// What the leaves leave of one lobe's product with the lamp, 0..=1.
    #[inline(always)]
    fn part(&self, k: usize, lane: usize, cone: &Cone, scratch: &Scratch) -> f32 {
        let (products, lobe) = (&self.products[k], &self.lobes[k]);
        let (exponent, light, versine) = (lobe.exponent[lane], products.light[lane], products.versine[lane]);
        let lobe_axis = cone.local(lane_of(&lobe.axis, lane));
        let shape = product_shape(exponent, light, versine);
        let axis = product_axis(&shape, lobe_axis, Vec3::Z);
        let (axis, exponent, order) = match k {
            0 if 1.0 - versine < cone.sin => (lobe_axis, exponent, Order::LampFirst),
            0 => (axis, shape.exponent, Order::Tabulated),
            _ => (axis, shape.exponent, Order::Weighed { light }),
        };
        let profiles = Profiles::new(&scratch.leaves, &scratch.full, axis, exponent, order);
        let full = scratch.full.overlap(axis, exponent, order, &profiles);
        let hidden = scratch.leaves.overlap(axis, exponent, order, &profiles);
        // Nothing of the product within the lamp: there is no more to hide.
        let hidden = if full > 1e-20 { hidden / full } else { 0.0 };
        (1.0 - hidden - scratch.leaves.rest).clamp(0.0, 1.0)
    }

    #[inline(always)]
    fn scatter(&self, target: &mut Target<'_>, first: usize, n: usize) {
        for (lane, out) in target.light[first..first + n].iter_mut().enumerate() {
            (0..3).for_each(|c| out[c] += self.sum[c][lane]);
        }
        if let Some(products) = &mut target.products {
            for (out, count) in products[first..first + n].iter_mut().zip(&self.count) {
                *out += count;
            }
        }
    }
}

/// Lanes whose cone a body or another lamp may reach into, or that are in the lamp.
#[inline(always)]
fn touched(seen: &Seen, position: &Columns, job: &Job<'_>, current: usize) -> [bool; LANES] {
    let radius = job.scene.lamps[current].radius;
    let mut reach = [f32::NEG_INFINITY; LANES];
    for body in &job.scene.blockers.bodies {
        reach_into(seen, position, &body.bound, &mut reach);
    }
    for (i, lamp) in job.scene.lamps.iter().enumerate() {
        if i != current {
            reach_into(seen, position, &lamp.sphere(), &mut reach);
        }
    }
    std::array::from_fn(|lane| reach[lane] > 0.0 || seen.distance[lane] <= radius)
}

/// Raises `reach` above 0 where the sphere's cone meets the lamp's; see [`super::mask`].
#[inline(always)]
fn reach_into(seen: &Seen, position: &Columns, sphere: &Sphere, reach: &mut [f32; LANES]) {
    for lane in 0..LANES {
        let to = sphere.centre - lane_of(position, lane);
        let squared = to.length_squared();
        let r = sphere.radius;
        let tangent = (squared - r * r).max(0.0).sqrt();
        let (sin, cos) = (seen.sin_squared[lane].sqrt(), (1.0 - seen.sin_squared[lane]).sqrt());
        let beyond = to.dot(lane_of(&seen.axis, lane)) - (cos * tangent - sin * r);
        let inside = r * r - squared;
        reach[lane] = reach[lane].max(beyond).max(inside);
    }
}

/// 1 - cos of the angle with this squared sine, without cancellation.
#[inline(always)]
fn versine(sin_squared: f32) -> f32 {
    sin_squared / (1.0 + (1.0 - sin_squared).max(0.0).sqrt())
}

#[inline(always)]
fn see(lamp: &Lamp, position: &Columns) -> Seen {
    let mut seen = Seen::default();
    for lane in 0..LANES {
        let to = lamp.centre - lane_of(position, lane);
        let squared = to.length_squared().max(1e-30);
        let inverse = 1.0 / squared.sqrt();
        (0..3).for_each(|c| seen.axis[c][lane] = to[c] * inverse);
        seen.distance[lane] = squared * inverse;
        let sin = (lamp.radius * inverse).min(1.0);
        seen.sin_squared[lane] = (sin * sin).max(LEAST_SIN * LEAST_SIN);
        let small = (sin / LEAST_SIN).min(1.0);
        seen.dim[lane] = small * small;
    }
    seen
}

/// Reflectance lobe times lamp, for eight points.
#[inline(always)]
fn multiply(seen: &Seen, lobe: &Column) -> Products {
    let mut out = Products::default();
    for lane in 0..LANES {
        let light = cap_exponent(seen.sin_squared[lane], lobe.exponent[lane]);
        multiply_lane(seen, lobe, lane, light, &mut out);
    }
    out
}

/// [`multiply`] for exponent 1, where [`cap_exponent`] is E = 2c / (1 - c), s = 1 + c.
#[inline(always)]
fn against_lambert(seen: &Seen, lobe: &Column) -> Products {
    let mut out = Products::default();
    for lane in 0..LANES {
        let cos = (1.0 - seen.sin_squared[lane]).max(0.0).sqrt();
        let light = (2.0 * cos * (1.0 + cos) / seen.sin_squared[lane], 1.0 + cos);
        multiply_lane(seen, lobe, lane, light, &mut out);
    }
    out
}

/// A point in the lamp has light from everywhere.
#[inline(always)]
fn multiply_lane(seen: &Seen, lobe: &Column, lane: usize, (light, scale): (f32, f32), out: &mut Products) {
    // From the chord between the axes, which keeps small angles.
    let chord = lane_of(&seen.axis, lane) - lane_of(&lobe.axis, lane);
    let versine = (0.5 * chord.length_squared()).min(2.0);
    let partner = lobe.exponent[lane];
    let integral = scale * product_integral(partner, light, versine) * seen.dim[lane];
    let inside = seen.sin_squared[lane] >= 1.0;
    out.light[lane] = light;
    out.versine[lane] = versine;
    out.integral[lane] = if inside { TAU / (partner + 1.0) } else { integral };
}
