//! Spheres of light, and the lobe that a spherical cap turns into.
//!
//! From a point, a sphere is a cap of angular radius σ, c = cos σ. A lobe for it has two free numbers, s and E.
//! They are chosen for the reflectance lobe of exponent e that the light meets next, so that both the solid
//! angle and the product with an aligned lobe of that exponent are exact:
//!
//! ```text
//! 2π s / (E + 1)     = 2π (1 - c)
//! 2π s / (E + 1 + e) = 2π (1 - c^(e+1)) / (e + 1)
//! ```
//!
//! With ρ = (1 - c^(e+1)) / ((e + 1)(1 - c)): E + 1 = e ρ / (1 - ρ), s = (1 - c)(E + 1). Against Lambert (e = 1)
//! this is s = 1 + c, E = 2c / (1 - c), and the unshadowed irradiance of a cap above the horizon is exact; against
//! a mirror-like lobe s tends to 1, so that highlights have the lamp's radiance. The paper fixes s = 1 and fits E
//! alone ([`cap_lobe_least_squares`]), which gives 4 % too much light for small caps.
//!
//! Based on: Meunier et al., Cosine Lobes for Interactive Direct Lighting in Dynamic Scenes, 2009.

use glam::Vec3;

use super::fast::{exp2, log2_1p};
use super::{Error, Lobe, Sphere};

/// A sphere that shines alike in all directions, on the outside and, for a point in it, on the inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Metres.
    pub centre: Vec3,
    /// Metres, above 0.
    pub radius: f32,
    /// Emitted radiance, linear Rec.709, from 0 up.
    pub radiance: Vec3,
}

impl Lamp {
    /// # Errors
    /// When the radius is not above 0, or a number is not finite, or the radiance is below 0.
    pub fn new(centre: Vec3, radius: f32, radiance: Vec3) -> Result<Lamp, Error> {
        if !(radius > 0.0 && radius.is_finite()) {
            return Err(Error::Radius(radius));
        }
        if !centre.is_finite() {
            return Err(Error::NotANumber("lamp's centre"));
        }
        if !radiance.is_finite() || radiance.min_element() < 0.0 {
            return Err(Error::NotANumber("lamp's radiance"));
        }
        Ok(Lamp { centre, radius, radiance })
    }

    #[inline(always)]
    pub(super) fn sphere(&self) -> Sphere {
        Sphere { centre: self.centre, radius: self.radius }
    }
}

/// Exponents below this meet the light like this one: the formula's 0/0 at e = 0 loses digits before.
const LEAST_PARTNER: f32 = 0.02;

/// Exponent and scale of a cap of unit radiance for a partner of exponent e; `sin_squared` = sin² σ, σ up to π/2.
#[inline(always)]
pub(super) fn cap_exponent(sin_squared: f32, partner: f32) -> (f32, f32) {
    let cos = (1.0 - sin_squared).max(0.0).sqrt();
    let versine = sin_squared / (1.0 + cos);
    let e = partner.max(LEAST_PARTNER);
    // c^(e+1) = 2^(-(e+1) log2(1/c)), and 1/c = 1 + (1-c)/c; for tiny caps 1 - c^(e+1) by its series.
    let log_inverse = log2_1p(versine / cos.max(1e-20));
    let y = (e + 1.0) * log_inverse * std::f32::consts::LN_2;
    let power = exp2(-(e + 1.0) * log_inverse);
    // 1 - ρ: small when y is, so there from the series ρ = 1 - e/2 (1-c) + e(e-1)/6 (1-c)² - ….
    let series = e * versine * (0.5 - (e - 1.0) * versine * (1.0 / 6.0 - (e - 2.0) * versine / 24.0));
    let direct = 1.0 - (1.0 - power) / ((e + 1.0) * versine + 1e-30);
    let missing = if y < 0.1 { series } else { direct };
    let plus_one = (e * (1.0 - missing) / missing.max(1e-30)).max(1.0);
    (plus_one - 1.0, versine * plus_one)
}

/// The lobe of unit radiance for a cap of angular radius σ in (0, π/2] around `axis`, exact in solid angle and
/// against an aligned lobe of exponent `partner`.
pub fn cap_lobe(axis: Vec3, radius: f32, partner: f32) -> Lobe {
    let sin = radius.clamp(0.0, std::f32::consts::FRAC_PI_2).sin();
    let (exponent, scale) = cap_exponent((sin * sin).max(1e-12), partner);
    Lobe { axis, exponent, scale }
}

/// The paper's lobe for a cap (its equation 32): scale 1, exponent by least squares.
///
/// Minimises ∫ (cap - lobe)² = 2π [(1 - c) - 2 (1 - c^(e+1)) / (e + 1) + 1 / (2e + 1)] over e by golden section
/// in ln e. Radius in (0, π/2]; kept for comparison, it does not conserve light.
pub fn cap_lobe_least_squares(axis: Vec3, radius: f32) -> Lobe {
    let cos = f64::from(radius.clamp(1e-3, std::f32::consts::FRAC_PI_2)).cos();
    let error = |ln_e: f64| {
        let e = ln_e.exp();
        1.0 / (2.0 * e + 1.0) - 2.0 * (1.0 - cos.powf(e + 1.0)) / (e + 1.0)
    };
    let golden = 0.618_033_988_749_895;
    let (mut low, mut high) = ((1e-4f64).ln(), (1e8f64).ln());
    for _ in 0..80 {
        let (left, right) = (high - golden * (high - low), low + golden * (high - low));
        if error(left) < error(right) { high = right } else { low = left }
    }
    Lobe { axis, exponent: (0.5 * (low + high)).exp() as f32, scale: 1.0 }
}
