//! The share of each texel that a disc of light covers.
//!
//! A texel that the rim crosses is cut in four, and so on, down to boxes much smaller than the disc and the texel;
//! there the rim is a straight line and the share a ramp. In the end all shares are scaled by the disc's exact solid
//! angle over the one found, so that the energy is exact.

use glam::{DVec3, Vec3};

use super::{box_solid_angle, face_axes, n_texels, place};
use crate::cap;
use crate::light::Cap;

/// The smallest boxes are this part of the disc's radius: then the rim bends by 1/500 of a box within it.
const BOX_OF_RADIUS: f64 = 1.0 / 16.0;

/// And at most this part of a texel: a share is then right to 1/100 of the texel or better.
const BOX_OF_TEXEL: f64 = 1.0 / 8.0;

/// A disc, and the horizon that cuts it.
struct Disc {
    axis: DVec3,
    radius: f64,
    up: Option<DVec3>,
    /// Side of the smallest boxes, on a face of side 2.
    smallest: f64,
}

/// Adds a disc. Where `up` is given, only its part above that horizon is lit, and the part sends out what
/// `cap.radiance` times the whole disc's solid angle would (as [`Sky::sun_above_horizon`] gives it).
///
/// [`Sky::sun_above_horizon`]: crate::light::Sky::sun_above_horizon
pub(crate) fn add_disc(n: usize, cap: &Cap, up: Option<Vec3>, out: &mut [[f32; 3]]) {
    let radius = f64::from(cap.radius);
    let cell = 2.0 / n as f64;
    let disc = Disc {
        axis: cap.axis.as_dvec3().normalize(),
        radius,
        up: up.map(|up| up.as_dvec3()),
        smallest: (radius * BOX_OF_RADIUS).min(cell * BOX_OF_TEXEL),
    };
    // Texels farther from the axis than this, by cosine, cannot touch the disc: a texel's corner is at most as far from
    // its middle as in the middle of a face.
    let aside = cap.radius + std::f32::consts::SQRT_2 * (1.0 / n as f32).atan() + 1e-3;
    let least = if aside < std::f32::consts::PI { aside.cos() } else { -1.1 };
    let axis = cap.axis.normalize();
    let near = |t: &usize| super::direction(n, *t, glam::Vec2::splat(0.5)).dot(axis) >= least;
    let found: f64 = (0..n_texels(n)).filter(near).map(|t| disc.covered_texel(n, t)).sum();
    if found <= 0.0 {
        return;
    }
    let scale = cap::area(radius) / found;
    for t in (0..n_texels(n)).filter(near) {
        let covered = disc.covered_texel(n, t);
        if covered > 0.0 {
            let share = covered * scale / f64::from(super::solid_angle(n, t));
            super::project::add(&mut out[t], cap.radiance * share as f32);
        }
    }
}

impl Disc {
    fn covered_texel(&self, n: usize, texel: usize) -> f64 {
        let (face, [column, row]) = place(n, texel);
        let cell = 2.0 / n as f64;
        let corner = [column, row].map(|i| i as f64 * cell - 1.0);
        self.covered(&face_axes(face).map(|a| a.as_dvec3()), corner, cell)
    }

    /// Solid angle of the lit part of a box.
    fn covered(&self, axes: &[DVec3; 3], [x, y]: [f64; 2], size: f64) -> f64 {
        let half = 0.5 * size;
        let p = axes[0] + (x + half) * axes[1] + (y + half) * axes[2];
        let distance = p.length();
        let centre = p / distance;
        let angle = 2.0 * (0.5 * (centre - self.axis).length()).min(1.0).asin();
        // No corner is farther from the middle than this angle.
        let reach = half * std::f64::consts::SQRT_2 / (distance - half * std::f64::consts::SQRT_2).max(1.0);
        let height = self.up.map_or(f64::MAX, |up| up.dot(centre));
        if angle >= self.radius + reach || height <= -reach {
            return 0.0;
        }
        if angle + reach <= self.radius && height >= reach {
            return box_solid_angle([x, y], [x + size, y + size]);
        }
        if size <= self.smallest {
            let ramp = |inside: f64| (0.5 + inside * distance / size).clamp(0.0, 1.0);
            return ramp(self.radius - angle) * ramp(height) * size * size / distance.powi(3);
        }
        let quarters = [[x, y], [x + half, y], [x, y + half], [x + half, y + half]];
        quarters.into_iter().map(|corner| self.covered(axes, corner, half)).sum()
    }
}
