//! The classic baseline: light comes unshadowed from around the bent normal, dimmed by ambient occlusion.
//!
//! ```text
//! E = ao × E_open(bent normal)
//! ```
//!
//! where E_open is what an unoccluded surface facing that way would receive: SH of order 3 for skies and
//! pictures, the closed form of a disc clipped by the horizon for caps.
//!
//! Where it breaks: there are no shadows. The size of a light makes no difference, and a sun behind a
//! mountain still shines.
//!
//! Based on: Landis, Production-Ready Global Illumination, 2002; Ramamoorthi and Hanrahan, An Efficient
//! Representation for Irradiance Environment Maps, 2001.

use glam::Vec3;

use crate::cap;
use crate::light::{Cap, SMOOTH_ORDER};
use crate::sh::{self, MAX_COEFFICIENTS};

/// A light as the baseline sees it; [`crate::light::split`] makes both parts.
#[derive(Clone, Copy, Debug)]
pub struct BentLight<'a> {
    /// Discs of light.
    pub caps: &'a [Cap],
    /// SH coefficients, order 3, of everything else.
    pub smooth: &'a [[f32; 3]; SMOOTH_ORDER * SMOOTH_ORDER],
}

/// Irradiance without the receiver's albedo, per vertex, written over `out`.
///
/// `ao`: visible part of the cosine-weighted hemisphere, 0 to 1; `bent`: unit bent normal, zero where nothing
/// is visible (then E = 0). Cost per vertex: nine coefficients, and per cap one arc tangent (three where the
/// horizon cuts it).
///
/// # Panics
/// When the slices differ in length.
pub fn irradiance(ao: &[f32], bent: &[[f32; 3]], light: &BentLight, out: &mut [[f32; 3]]) {
    assert!(
        ao.len() == out.len() && bent.len() == out.len(),
        "bent::irradiance: slices of different lengths"
    );
    for ((e, &ao), &bent) in out.iter_mut().zip(ao).zip(bent) {
        *e = (ao * open_irradiance(light, Vec3::from(bent))).to_array();
    }
}

/// Irradiance of an unoccluded surface with unit `normal`; 0 for a zero normal.
pub fn open_irradiance(light: &BentLight, normal: Vec3) -> Vec3 {
    if normal == Vec3::ZERO {
        return Vec3::ZERO;
    }
    let discs: Vec3 = light.caps.iter().map(|c| c.radiance * cap_irradiance(c, normal)).sum();
    discs + smooth_irradiance(light.smooth, normal)
}

/// What radiance 1 in the disc of `cap` gives an unoccluded surface with unit `normal`, in sr: exact for
/// every radius and tilt.
pub fn cap_irradiance(cap: &Cap, normal: Vec3) -> f32 {
    cap::plane_irradiance(normal.as_dvec3(), cap.axis.as_dvec3(), f64::from(cap.radius)) as f32
}

/// Irradiance from SH coefficients of order 3, never negative.
pub fn smooth_irradiance(smooth: &[[f32; 3]; SMOOTH_ORDER * SMOOTH_ORDER], normal: Vec3) -> Vec3 {
    let mut y = [0.0; MAX_COEFFICIENTS];
    sh::eval(SMOOTH_ORDER, normal, &mut y);
    let mut sum = Vec3::ZERO;
    for (l, factor) in COSINE_FACTORS.into_iter().enumerate() {
        for i in l * l..(l + 1) * (l + 1) {
            sum += factor * y[i] * Vec3::from(smooth[i]);
        }
    }
    sum.max(Vec3::ZERO)
}

/// Factors A_l by which a clamped cosine scales the bands.
const COSINE_FACTORS: [f32; SMOOTH_ORDER] =
    [std::f32::consts::PI, 2.0 * std::f32::consts::FRAC_PI_3, std::f32::consts::FRAC_PI_4];

#[cfg(test)]
mod tests;
