//! Spherical caps: how much of two of them overlaps, where, and what light that gives.
//!
//! With radii r1, r2 and angle d between the axes a, b, two circles that cross form a spherical triangle with
//! sides d, r1, r2: axis, axis, crossing. Let α be its angle at a, β that at b and E its excess. The overlap
//! is two circle sectors less that triangle, twice,
//!
//! ```text
//! area   = 2 (α (1 - cos r1) + β (1 - cos r2) - E)                                 [sr]
//! moment = ∫ ω dω = sin² r1 (α - sin α cos α) a + sin² r2 (β - sin β cos β) b      [sr]
//! ```
//!
//! the second by Stokes: ∫ ω dω = ½ ∮ x × dx, which over an arc with its chord is the circular segment that
//! it cuts off, projected. α, β and E come from half-angle formulas (tangents of half the sides'
//! differences), which keep their digits for tiny caps and at every tangency, where the cosine forms of the
//! literature lose them.
//!
//! The dot product of the moment with a normal is the irradiance from a uniformly bright overlap, exactly, as
//! long as the overlap is above the horizon; with a hemisphere for the second cap it is the irradiance from a
//! clipped cap.
//!
//! Everything is f64 inside; angles in radians, radii in 0..=π. A radius that is NaN gives area 0.
//!
//! Based on: Oat and Sander, Ambient Aperture Lighting, 2007; Tovchigrechko and Vakser, How common is the
//! funnel-like energy landscape in protein-protein interactions?, 2001 (the area).

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

/// Solid angle 2π (1 - cos r) of a cap, without cancellation for small r.
pub fn area(r: f64) -> f64 {
    let half = (0.5 * r).sin();
    4.0 * PI * half * half
}

/// Radius of the cap with this solid angle, in 0..=4π.
pub fn radius_of_area(area: f64) -> f64 {
    2.0 * (area / (4.0 * PI)).clamp(0.0, 1.0).sqrt().asin()
}

/// Angle between two directions of any length, accurate also near 0 and π; 0 when one has no length.
pub fn angle_between(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// How two caps lie to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Overlap {
    /// They share nothing but perhaps one point.
    Disjoint,
    /// The first lies in the second.
    FirstInside,
    /// The second lies in the first.
    SecondInside,
    /// Together they cover the sphere: what they share is a band.
    Covering,
    /// Their rims cross.
    Lens {
        /// Half the part of the first rim, seen from its axis, that lies in the second cap.
        alpha: f64,
        /// The same for the second rim.
        beta: f64,
        /// Excess of the triangle of axis, axis and crossing.
        excess: f64,
    },
}

/// How caps of radii `r1`, `r2`, with axes the angle `d` apart, overlap.
pub fn overlap(d: f64, r1: f64, r2: f64) -> Overlap {
    // Differences of half the triangle's perimeter s with its sides: the distances to the four boundary
    // cases.
    let s = 0.5 * (d + r1 + r2);
    let to_disjoint = 0.5 * (r1 + r2 - d);
    let to_second_inside = 0.5 * (d + r2 - r1);
    let to_first_inside = 0.5 * (d + r1 - r2);
    let to_covering = 0.5 * (2.0 * PI - d - r1 - r2);
    if to_first_inside <= 0.0 {
        return Overlap::FirstInside;
    }
    if to_second_inside <= 0.0 {
        return Overlap::SecondInside;
    }
    if to_covering <= 0.0 {
        return Overlap::Covering;
    }
    if to_disjoint <= 0.0 || r1.is_nan() || r2.is_nan() || d.is_nan() {
        return Overlap::Disjoint;
    }

    // tan²(α/2) = sin(s-d) sin(s-r1) / (sin s sin(s-r2)), and L'Huilier's tan²(E/4) = product of half
    // tangents.
    let (sin_s, half_s) = perimeter(s, to_covering);
    let (sin_d, sin_1, sin_2) = (to_disjoint.sin(), to_second_inside.sin(), to_first_inside.sin());
    let alpha = 2.0 * (sin_d * sin_1).sqrt().atan2((sin_s * sin_2).sqrt());
    let beta = 2.0 * (sin_d * sin_2).sqrt().atan2((sin_s * sin_1).sqrt());
    let halves = [to_disjoint, to_second_inside, to_first_inside].map(|x| (0.5 * x).sin_cos());
    let sines = half_s.0 * halves[0].0 * halves[1].0 * halves[2].0;
    let cosines = half_s.1 * halves[0].1 * halves[1].1 * halves[2].1;
    let excess = 4.0 * sines.max(0.0).sqrt().atan2(cosines.max(0.0).sqrt());
    Overlap::Lens { alpha, beta, excess }
}

/// sin s and (sin s/2, cos s/2) of half the perimeter, from s or from π - s, whichever is small and so has
/// all its digits.
fn perimeter(s: f64, to_covering: f64) -> (f64, (f64, f64)) {
    if s < FRAC_PI_2 {
        (s.sin(), (0.5 * s).sin_cos())
    } else {
        let (sin, cos) = (0.5 * to_covering).sin_cos();
        (to_covering.sin(), (cos, sin))
    }
}

/// Solid angle of the overlap of caps of radii `r1`, `r2` with axes the angle `d` apart.
pub fn intersection_area(d: f64, r1: f64, r2: f64) -> f64 {
    match overlap(d, r1, r2) {
        Overlap::Disjoint => 0.0,
        Overlap::FirstInside => area(r1),
        Overlap::SecondInside => area(r2),
        Overlap::Covering => (area(r1.min(r2)) - area(PI - r1.max(r2))).max(0.0),
        Overlap::Lens { alpha, beta, excess } => {
            let sectors = (alpha * area(r1) + beta * area(r2)) / PI;
            (sectors - 2.0 * excess).clamp(0.0, area(r1.min(r2)))
        }
    }
}

/// Oat and Sander's cheap stand-in for [`intersection_area`]: a smoothstep from full overlap to the least
/// possible one as the axes move apart.
///
/// They meant small caps, for which the least is 0. Where r1 + r2 > π even opposite caps overlap; the curve
/// then ends at that overlap, so that it stays continuous over all radii.
pub fn smoothstep_area(d: f64, r1: f64, r2: f64) -> f64 {
    let inside_until = (r1 - r2).abs();
    let least_from = (r1 + r2).min(2.0 * PI - r1 - r2);
    let most = area(r1.min(r2));
    let least = (area(r1) + area(r2) - 4.0 * PI).max(0.0);
    let width = least_from - inside_until;
    // A cap of radius 0 or π has no transition: its overlap does not depend on d.
    let t = if width > 0.0 { 1.0 - ((d - inside_until) / width).clamp(0.0, 1.0) } else { 1.0 };
    least + (most - least) * t * t * (3.0 - 2.0 * t)
}

/// ∫ ω dω over the overlap of two caps with unit axes `a`, `b`. Its direction is that of the overlap's
/// centroid.
pub fn intersection_moment(a: DVec3, r1: f64, b: DVec3, r2: f64) -> DVec3 {
    let (along_a, along_b) = moment_factors(overlap(angle_between(a, b), r1, r2), r1, r2);
    along_a * a + along_b * b
}

/// The moment of [`intersection_moment`] as multiples of the two axes.
pub fn moment_factors(overlap: Overlap, r1: f64, r2: f64) -> (f64, f64) {
    let (sin_1, sin_2) = (r1.sin(), r2.sin());
    let (disc_1, disc_2) = (PI * sin_1 * sin_1, PI * sin_2 * sin_2);
    match overlap {
        Overlap::Disjoint => (0.0, 0.0),
        Overlap::FirstInside => (disc_1, 0.0),
        Overlap::SecondInside => (0.0, disc_2),
        Overlap::Covering => (disc_1, disc_2),
        Overlap::Lens { alpha, beta, .. } => (sin_1 * sin_1 * segment(alpha), sin_2 * sin_2 * segment(beta)),
    }
}

/// Irradiance on an open plane with unit `normal` from a cap of radiance 1, clipped by the plane's horizon:
/// exact for every tilt and radius.
pub fn plane_irradiance(normal: DVec3, axis: DVec3, radius: f64) -> f64 {
    intersection_moment(axis, radius, normal, FRAC_PI_2).dot(normal).max(0.0)
}

/// x - sin x cos x: twice the area of the segment that an arc of half-angle x cuts off the unit disc.
fn segment(x: f64) -> f64 {
    if x > 0.1 {
        return x - 0.5 * (2.0 * x).sin();
    }
    // (y - sin y) / 2 for y = 2x by its series; the next term is under 1e-16 of the first here.
    let y2 = 4.0 * x * x;
    let tail = 1.0 - y2 / 20.0 * (1.0 - y2 / 42.0 * (1.0 - y2 / 72.0 * (1.0 - y2 / 110.0)));
    y2 * x / 6.0 * tail
}

#[cfg(test)]
mod tests;
