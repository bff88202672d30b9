//! One path, and the light it brings.
//!
//! Irradiance at an oriented point, `E = integral of L_i(w) max(n.w, 0) dw`, where `L_i` is the light's radiance if
//! nothing is in the way, else `albedo E' / pi` of the point that is. At each point one direction is drawn with a cosine
//! lobe and one from each [`Aim`]; the light is weighed with the balance heuristic over all of them, so that the sum
//! over samples x of `L(x) cos(x) V(x) / sum of all densities at x` is unbiased. The cosine direction also is the way
//! on: if it hits a surface, the path goes on there.
//!
//! Based on: Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997, ch. 9 (multi-sample balance
//! heuristic); Shirley and Chiu, A Low Distortion Map Between Disk and Square, 1997 (cosine lobe).

use super::aim::Aim;
use super::hash;
use crate::tracer::{Contact, Tracer};
use glam::{Vec2, Vec3};
use lunette_relight::light::Light;
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4};

/// What all paths share.
pub(crate) struct World<'a> {
    pub tracer: &'a Tracer<'a>,
    pub light: &'a Light,
    pub aims: &'a [Aim],
    pub bounces: u32,
}

/// Which sample of which stratified set a path is.
#[derive(Clone, Copy)]
pub(crate) struct Draw {
    /// Sample in the set, below `n`.
    pub index: u32,
    /// Size of the set.
    pub n: u32,
    /// Tells sets apart: a hash of seed, element and batch.
    pub set: u32,
}

impl Draw {
    /// Uniform in the unit square; each dimension is stratified over the set, and independent of the others.
    pub fn point(&self, dimension: u32) -> Vec2 {
        hash::stratified_2d(self.index, self.n, hash::mix([self.set, dimension]))
    }
}

/// Irradiance by one path: straight from the light, and by way of other surfaces.
#[derive(Clone, Copy, Default)]
pub(crate) struct Gathered {
    pub direct: Vec3,
    pub indirect: Vec3,
}

/// One estimate of the irradiance at a point just above a surface, with unit normal `n`.
pub(crate) fn gather(world: &World, mut origin: Vec3, mut n: Vec3, draw: Draw) -> Gathered {
    let mut gathered = Gathered::default();
    let mut throughput = Vec3::ONE;
    for depth in 0..=world.bounces {
        let first_dimension = depth * (1 + world.aims.len() as u32);
        let aimed = aimed_light(world, origin, n, draw, first_dimension + 1);
        let (lobe, contact) = lobe_light(world, origin, n, draw.point(first_dimension), depth);
        let light = throughput * (aimed + lobe);
        if depth == 0 {
            gathered.direct = light;
        } else {
            gathered.indirect += light;
        }

        // On along the cosine direction: E' albedo / pi times cos over its density, cos / pi.
        let Some(contact) = contact else { break };
        throughput *= world.tracer.albedo(&contact);
        if throughput == Vec3::ZERO {
            break;
        }
        n = contact.geometric_normal;
        origin = world.tracer.lift(contact.position, n);
    }
    gathered
}

/// Light from the directions drawn from the aims.
fn aimed_light(world: &World, origin: Vec3, n: Vec3, draw: Draw, first_dimension: u32) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for (k, aim) in world.aims.iter().enumerate() {
        let d = aim.sample(draw.point(first_dimension + k as u32));
        if n.dot(d) <= 0.0 {
            continue;
        }
        let weighed = weighed_radiance(world, n, d);
        if weighed != Vec3::ZERO && !world.tracer.is_blocked(origin, d) {
            sum += weighed;
        }
    }
    sum
}

/// Light from a direction drawn with the cosine lobe, and what is in its way.
fn lobe_light(world: &World, origin: Vec3, n: Vec3, u: Vec2, depth: u32) -> (Vec3, Option<Contact>) {
    let d = cosine_lobe(n, u);
    if n.dot(d) <= 0.0 {
        return (Vec3::ZERO, None);
    }
    if depth == world.bounces {
        let blocked = world.tracer.is_blocked(origin, d);
        return (if blocked { Vec3::ZERO } else { weighed_radiance(world, n, d) }, None);
    }
    match world.tracer.first_contact(origin, d) {
        None => (weighed_radiance(world, n, d), None),
        contact => (Vec3::ZERO, contact),
    }
}

/// `L cos / sum of all densities` at a direction above the surface.
fn weighed_radiance(world: &World, n: Vec3, d: Vec3) -> Vec3 {
    let cos = n.dot(d);
    let density: f32 = cos * FRAC_1_PI + world.aims.iter().map(|aim| aim.pdf(d)).sum::<f32>();
    world.light.radiance(d) * (cos / density)
}

/// Direction with density cos / pi around a unit vector.
fn cosine_lobe(n: Vec3, u: Vec2) -> Vec3 {
    let disk = concentric_disk(u);
    let (tangent, bitangent) = n.any_orthonormal_pair();
    let height = (1.0 - disk.length_squared()).max(0.0).sqrt();
    (disk.x * tangent + disk.y * bitangent + height * n).normalize()
}

/// From the unit square to the unit disk, areas kept, squares around the centre to circles.
fn concentric_disk(u: Vec2) -> Vec2 {
    let p = 2.0 * u - 1.0;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (radius, angle) = if p.x.abs() > p.y.abs() {
        (p.x, FRAC_PI_4 * (p.y / p.x))
    } else {
        (p.y, FRAC_PI_2 - FRAC_PI_4 * (p.x / p.y))
    };
    radius * Vec2::from_angle(angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of cos^k over the lobe are 2 / (k + 2); the mean direction lies along the normal.
    #[test]
    fn cosine_lobe_has_its_moments() {
        let n = Vec3::new(-0.36, 0.48, -0.8);
        let count = 65_536;
        let (mut cos, mut cos_4, mut mean) = (0.0, 0.0, Vec3::ZERO);
        for i in 0..count {
            let d = cosine_lobe(n, hash::stratified_2d(i, count, 1));
            cos += f64::from(n.dot(d)) / f64::from(count);
            cos_4 += f64::from(n.dot(d)).powi(4) / f64::from(count);
            mean += d / count as f32;
        }
        // Stratified over 256 x 256 cells: errors of the order 1 / 65,536.
        assert!((cos - 2.0 / 3.0).abs() < 1e-4 && (cos_4 - 1.0 / 3.0).abs() < 1e-4, "{cos} {cos_4}");
        assert!(mean.distance(n * 2.0 / 3.0) < 1e-3, "{mean}");
    }
}
