//! Ambient aperture lighting: per vertex one cap of visible directions, intersected with caps of light.
//!
//! ```text
//! E = Σ over light caps L max(n·M, 0) + sky max(n·(M_aperture - Σ M), 0)
//! ```
//!
//! where M = ∫ ω dω over the overlap of aperture and light cap. The paper writes area × (n · centroid); with
//! the centroid taken as the mean direction M / area, not normalised, the product is n·M, the irradiance of
//! the overlap without any approximation. So an open plane, whose aperture is the hemisphere, receives
//! exactly π L from a uniform sky of radiance L, and exactly the clipped disc's irradiance from a cap of any
//! size and tilt.
//!
//! Where it breaks: visibility is one round hole. A vertex that sees a band around the horizon, or sky on
//! both sides of a tower, gets a hole of the right size in the wrong place. A hole that dips under the
//! vertex's horizon is not clipped.
//!
//! Based on: Oat and Sander, Ambient Aperture Lighting, 2007.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use crate::cap;
use crate::light::{Cap, Light, split};

/// How overlaps are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Intersection {
    /// Exact area and centroid.
    #[default]
    Exact,
    /// The paper's smoothstep for the area, and for the centroid the middle of the overlap along the arc
    /// between the axes, shortened as if the overlap were the smaller cap.
    Smoothstep,
}

/// A light as apertures see it.
#[derive(Clone, Copy, Debug)]
pub struct ApertureLight<'a> {
    /// Discs of light, each with all the radiance inside of it.
    pub caps: &'a [Cap],
    /// Radiance of the part of the aperture that no disc covers: the average colour of the sky.
    pub sky: Vec3,
}

/// Vertices with their apertures: slices of one length V.
#[derive(Clone, Copy, Debug)]
pub struct Apertures<'a> {
    /// Axis of the aperture (the bent normal), unit or zero where nothing is visible.
    pub axis: &'a [[f32; 3]],
    /// Radius of the aperture, radians, 0 where nothing is visible.
    pub radius: &'a [f32],
    /// Unit normal.
    pub normal: &'a [[f32; 3]],
}

/// Turns any light into caps and an average sky colour; `caps` is cleared first and keeps its capacity from
/// frame to frame.
///
/// The average is the one that gives an unoccluded surface facing `up` the right irradiance: E / π, from SH
/// of order 3. The discs receive it on top of their own radiance, since the sky shines behind a lamp as well,
/// and what they cover is taken out of the sky's part later.
pub fn simplify(light: &Light, up: Vec3, caps: &mut Vec<Cap>) -> Vec3 {
    let smooth = split(light, caps);
    let sky = crate::bent::smooth_irradiance(&smooth, up) / std::f32::consts::PI;
    for cap in caps.iter_mut() {
        cap.radiance += sky;
    }
    sky
}

/// Irradiance without the receiver's albedo, per vertex, written over `out`.
///
/// Cost per vertex: one arc tangent per light cap, four more and as many square roots where rims cross.
///
/// # Panics
/// When the slices differ in length.
pub fn irradiance(
    apertures: Apertures,
    light: &ApertureLight,
    intersection: Intersection,
    out: &mut [[f32; 3]],
) {
    let n = out.len();
    assert!(
        apertures.axis.len() == n && apertures.radius.len() == n && apertures.normal.len() == n,
        "aperture::irradiance: slices of different lengths"
    );
    for (i, e) in out.iter_mut().enumerate() {
        let aperture = Aperture {
            axis: Vec3::from(apertures.axis[i]).as_dvec3(),
            radius: f64::from(apertures.radius[i]).clamp(0.0, PI),
        };
        *e = vertex(&aperture, Vec3::from(apertures.normal[i]).as_dvec3(), light, intersection).to_array();
    }
}

struct Aperture {
    axis: DVec3,
    radius: f64,
}

fn vertex(aperture: &Aperture, normal: DVec3, light: &ApertureLight, intersection: Intersection) -> Vec3 {
    let sin_radius = aperture.radius.sin();
    let mut free = PI * sin_radius * sin_radius * normal.dot(aperture.axis);
    let mut sum = Vec3::ZERO;
    for cap in light.caps {
        let share = match intersection {
            Intersection::Exact => exact_share(aperture, cap, normal),
            Intersection::Smoothstep => smoothstep_share(aperture, cap, normal),
        };
        sum += cap.radiance * share.max(0.0) as f32;
        free -= share;
    }
    sum + light.sky * free.max(0.0) as f32
}

/// n·M of the overlap.
fn exact_share(aperture: &Aperture, cap: &Cap, normal: DVec3) -> f64 {
    cap::intersection_moment(aperture.axis, aperture.radius, cap.axis.as_dvec3(), f64::from(cap.radius))
        .dot(normal)
}

/// Smoothstep area × (n · estimated mean direction).
fn smoothstep_share(aperture: &Aperture, cap: &Cap, normal: DVec3) -> f64 {
    let (a, b) = (aperture.axis, cap.axis.as_dvec3());
    let (r1, r2) = (aperture.radius, f64::from(cap.radius));
    let d = cap::angle_between(a, b);
    let area = cap::smoothstep_area(d, r1, r2);
    if area <= 0.0 {
        return 0.0;
    }

    // Along the arc from a to b the aperture spans -r1..r1 and the light d-r2..d+r2: aim at the middle of
    // both.
    let middle = 0.5 * ((-r1).max(d - r2) + r1.min(d + r2));
    let towards = (b - a * d.cos()).normalize_or_zero();
    let centroid = a * middle.cos() + towards * middle.sin();

    // |M| / area of a whole cap is (1 + cos r) / 2.
    let length = 0.5 * (1.0 + r1.min(r2).cos());
    area * length * normal.dot(centroid)
}

#[cfg(test)]
mod tests;
