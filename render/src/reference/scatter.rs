//! What a point makes of arriving light: diffuse and Phong reflection.
//!
//! `f(wi) = ρ/π + Ks (Ns + 2)/(2π) max(r·wi, 0)^Ns`, 1/sr, where r is the mirror direction of the viewer's; so that
//! the point sends out `∫ f L_i cosθ dwi`. The factor (Ns + 2)/(2π) makes Ks the share of light that the specular lobe
//! sends back from straight above, and no more than that from elsewhere: ρ + Ks <= 1 keeps energy.
//!
//! A direction is drawn from the mixture of a cosine lobe, `cosθ/π`, and a lobe around the mirror direction,
//! `(Ns + 1)/(2π) max(r·wi, 0)^Ns`. What falls below the surface brings nothing.
//!
//! Based on: Lafortune and Willems, Using the Modified Phong Reflectance Model for Physically Based Rendering, 1994.

use crate::image::luminance;
use glam::{Vec2, Vec3};
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// Reflection at a point, for one viewer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scatter {
    /// ρ/π.
    diffuse: Vec3,
    /// Ks (Ns + 2)/(2π).
    specular: Vec3,
    exponent: f32,
    /// Unit, of the viewer's direction.
    mirror: Vec3,
    /// Probability of the mirror lobe.
    share: f32,
}

/// A drawn direction, what share of its radiance times cosine over density is sent on.
pub(crate) struct Scattered {
    pub direction: Vec3,
    pub weight: Vec3,
}

impl Scatter {
    /// Weighs all directions alike: what it sends out is the irradiance.
    pub const RECEIVER: Scatter =
        Scatter { diffuse: Vec3::ONE, specular: Vec3::ZERO, exponent: 0.0, mirror: Vec3::Y, share: 0.0 };

    /// A matt surface.
    pub fn matt(albedo: Vec3) -> Scatter {
        Scatter { diffuse: albedo * FRAC_1_PI, ..Scatter::RECEIVER }
    }

    /// A surface with unit normal `n`, seen along the unit direction `d` (from the viewer to the point).
    pub fn glossy(albedo: Vec3, specular: Vec3, exponent: f32, n: Vec3, d: Vec3) -> Scatter {
        let (matt, gloss) = (luminance(albedo), luminance(specular));
        if gloss <= 0.0 {
            return Scatter::matt(albedo);
        }
        Scatter {
            diffuse: albedo * FRAC_1_PI,
            specular: specular * ((exponent + 2.0) / TAU),
            exponent,
            mirror: d.reflect(n).normalize(),
            share: gloss / (gloss + matt),
        }
    }

    /// Whether it sends out nothing.
    pub fn is_black(&self) -> bool {
        self.diffuse == Vec3::ZERO && self.share == 0.0
    }

    /// Reflection of light from the unit direction `d`, and the density with which `sample` draws it, 1/sr.
    pub fn of(&self, n: Vec3, d: Vec3) -> (Vec3, f32) {
        let cosine_density = n.dot(d) * FRAC_1_PI;
        if self.share == 0.0 {
            return (self.diffuse, cosine_density);
        }
        let cos = self.mirror.dot(d);
        // Not behind the mirror direction's plane, also for exponent 0.
        let lobe = if cos > 0.0 { cos.powf(self.exponent) } else { 0.0 };
        let mirror_density = lobe * ((self.exponent + 1.0) / TAU);
        let density = (1.0 - self.share) * cosine_density + self.share * mirror_density;
        (self.diffuse + lobe * self.specular, density)
    }

    /// A direction above the surface, and the factor for the radiance that comes from it.
    pub fn sample(&self, n: Vec3, u: Vec2) -> Option<Scattered> {
        if self.share == 0.0 {
            let direction = cosine_lobe(n, u);
            return (n.dot(direction) > 0.0).then_some(Scattered { direction, weight: self.diffuse * PI });
        }
        let direction = if u.x < self.share {
            phong_lobe(self.mirror, self.exponent, Vec2::new(u.x / self.share, u.y))
        } else {
            cosine_lobe(n, Vec2::new((u.x - self.share) / (1.0 - self.share), u.y))
        };
        let cos = n.dot(direction);
        let (reflected, density) = self.of(n, direction);
        (cos > 0.0 && density > 0.0).then(|| Scattered { direction, weight: reflected * (cos / density) })
    }
}

/// Direction with density cos / pi around a unit vector.
pub(crate) fn cosine_lobe(n: Vec3, u: Vec2) -> Vec3 {
    let disk = concentric_disk(u);
    let (tangent, bitangent) = n.any_orthonormal_pair();
    let height = (1.0 - disk.length_squared()).max(0.0).sqrt();
    (disk.x * tangent + disk.y * bitangent + height * n).normalize()
}

/// Direction with density `(e + 1)/(2 pi) cos^e` around a unit vector.
fn phong_lobe(axis: Vec3, exponent: f32, u: Vec2) -> Vec3 {
    let cos = (1.0 - u.x).powf(1.0 / (exponent + 1.0));
    let radius = (1.0 - cos * cos).max(0.0).sqrt();
    let (sin_turn, cos_turn) = (TAU * u.y).sin_cos();
    let (tangent, bitangent) = axis.any_orthonormal_pair();
    (radius * cos_turn * tangent + radius * sin_turn * bitangent + cos * axis).normalize()
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
    use crate::reference::hash;

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

    /// Means of the sampled weights against a fine sum of f cos over the half sphere; straight above, the specular
    /// part is Ks, and never more.
    #[test]
    fn scattered_weights_sum_to_the_reflectance() {
        let n = Vec3::new(0.6, 0.0, 0.8);
        let (albedo, specular) = (Vec3::new(0.5, 0.2, 0.0), Vec3::new(0.3, 0.4, 0.6));
        for exponent in [0.0, 1.0, 10.0, 60.0] {
            for tilt in [0.0f32, 0.7, 1.3] {
                let (tangent, _) = n.any_orthonormal_pair();
                let seen_along = -(tilt.cos() * n + tilt.sin() * tangent);
                let scatter = Scatter::glossy(albedo, specular, exponent, n, seen_along);
                let count = 65_536;
                let (mut sampled, mut summed) = (Vec3::ZERO, Vec3::ZERO);
                for i in 0..count {
                    let u = hash::stratified_2d(i, count, 1);
                    if let Some(s) = scatter.sample(n, u) {
                        sampled += s.weight / count as f32;
                    }
                    // Uniform in the projected disk: f times pi.
                    summed += scatter.of(n, cosine_lobe(n, u)).0 * PI / count as f32;
                }
                // The sharpest lobe covers some 4,000 of the sum's samples.
                assert!(
                    (sampled - summed).abs().max_element() < 4e-3,
                    "{exponent} {tilt}: {sampled} {summed}"
                );
                assert!((sampled - albedo).cmple(specular + 4e-3).all());
                if tilt == 0.0 {
                    assert!((sampled - albedo - specular).abs().max_element() < 4e-3, "{sampled}");
                }
            }
        }
    }

    /// f(wi, wo) = f(wo, wi).
    #[test]
    fn reflection_is_reciprocal() {
        let n = Vec3::Y;
        let (a, b) = (Vec3::new(0.3, 0.8, 0.1).normalize(), Vec3::new(-0.5, 0.4, 0.2).normalize());
        let glossy = |from: Vec3| Scatter::glossy(Vec3::splat(0.2), Vec3::splat(0.5), 7.0, n, -from);
        let (there, back) = (glossy(a).of(n, b).0, glossy(b).of(n, a).0);
        assert!((there - back).abs().max_element() < 1e-6, "{there} {back}");
    }
}
