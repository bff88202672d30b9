//! Directions aimed at the bright parts of a light.
//!
//! Each [`Aim`] is a density on the sphere, in 1/sr, that can be sampled and evaluated:
//!
//! - a cap: uniform, `1 / (2 pi (1 - cos r))`; also for the sun of a clear sky;
//! - the dome of a clear sky: a table of its luminance on equal-area cells (azimuth, sine of elevation);
//! - an equirect: a table of the luminance of its pixels times their solid angle.
//!
//! Uniform and overcast light have none: cosine sampling alone fits them.

use super::table::Table;
use crate::image::luminance;
use glam::{Quat, Vec2, Vec3};
use lunette_relight::light::{Cap, Equirect, Light, Sky, Source};
use std::f32::consts::{PI, TAU};

/// A density on the sphere.
pub(crate) enum Aim {
    Cap { axis: Vec3, radius: f32 },
    Dome { table: Table, to_world: Quat },
    Equirect { table: Table, image: Equirect },
}

/// Cells of the sky dome's table: fine enough for the glow around the sun.
const DOME_CELLS: (usize, usize) = (128, 64);

/// Radius in radians from which a cap is like a sky.
const BROAD: f32 = 0.5;

/// The aims of a light.
pub(crate) fn aims(light: &Light) -> Vec<Aim> {
    let mut aims = Vec::new();
    for source in &light.sources {
        match source {
            Source::Cap(cap) => aims.push(cap_aim(cap)),
            Source::Sky(sky) => {
                aims.extend(sky.sun().as_ref().map(cap_aim));
                aims.extend(dome_aim(sky));
            }
            Source::Equirect(image) => aims.extend(equirect_aim(image)),
            _ => {}
        }
    }
    aims
}

impl Aim {
    /// A direction with this density, from a uniform point.
    pub fn sample(&self, u: Vec2) -> Vec3 {
        match self {
            Aim::Cap { axis, radius } => uniform_cap(*axis, *radius, u),
            Aim::Dome { table, to_world } => {
                let p = table.sample(u);
                let (sin, cos) = (TAU * p.x).sin_cos();
                let horizontal = (1.0 - p.y * p.y).sqrt();
                *to_world * Vec3::new(horizontal * cos, p.y, horizontal * sin)
            }
            Aim::Equirect { table, image } => {
                let p = table.sample(u);
                image.direction(p.x, p.y)
            }
        }
    }

    /// Whether it may hold a sun: behind a window, that is a bright patch which paths would find by chance. A dome or a
    /// broad cap lights all that the window shows it.
    pub fn is_peaked(&self) -> bool {
        match self {
            Aim::Cap { radius, .. } => *radius < BROAD,
            Aim::Dome { .. } => false,
            Aim::Equirect { .. } => true,
        }
    }

    /// Density at a unit direction, 1/sr.
    pub fn pdf(&self, d: Vec3) -> f32 {
        match self {
            Aim::Cap { axis, radius } => {
                let rim = 2.0 * (0.5 * radius).sin() + RIM_ROUNDING;
                if d.distance_squared(*axis) <= rim * rim { 1.0 / cap_solid_angle(*radius) } else { 0.0 }
            }
            Aim::Dome { table, to_world } => {
                let local = to_world.conjugate() * d;
                if local.y <= 0.0 {
                    return 0.0;
                }
                let azimuth = local.z.atan2(local.x) / TAU;
                table.density_at(Vec2::new(azimuth - azimuth.floor(), local.y)) / TAU
            }
            Aim::Equirect { table, image } => {
                let (column, row) = image.pixel_at(d);
                let up = (image.orientation().conjugate() * d).y;
                let sin_theta = (1.0 - up * up).max(SMALLEST_SIN_SQUARED).sqrt();
                table.density(column, row) / (2.0 * PI * PI * sin_theta)
            }
        }
    }
}

/// By which a direction on the rim of a cap may be off after being drawn or turned. A light that counts it in where the
/// density left it out would weigh a hundred-thousandth of a sun's samples some thousand times too much.
const RIM_ROUNDING: f32 = 4e-7;

/// Keeps the density finite where a direction is rounded to the pole.
const SMALLEST_SIN_SQUARED: f32 = 1e-12;

fn cap_aim(cap: &Cap) -> Aim {
    Aim::Cap { axis: cap.axis, radius: cap.radius }
}

/// Cells are weighed by the largest of five luminances in them, so that none is much too small where the dome is
/// steep; the density need not be exact.
fn dome_aim(sky: &Sky) -> Option<Aim> {
    let (width, height) = DOME_CELLS;
    let to_world = sky.orientation();
    let direction = |u: f32, v: f32| {
        let (sin, cos) = (TAU * u).sin_cos();
        let horizontal = (1.0 - v * v).max(0.0).sqrt();
        to_world * Vec3::new(horizontal * cos, v, horizontal * sin)
    };
    const PLACES: [(f32, f32); 5] = [(0.5, 0.5), (0.1, 0.1), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9)];
    let cell = |i: usize| {
        let (column, row) = ((i % width) as f32, (i / width) as f32);
        let values = PLACES.map(|(x, y)| {
            luminance(sky.dome_radiance(direction((column + x) / width as f32, (row + y) / height as f32)))
        });
        values.into_iter().fold(0.0, f32::max)
    };
    let weights: Vec<f32> = (0..width * height).map(cell).collect();
    Some(Aim::Dome { table: Table::new(width, height, &weights)?, to_world })
}

fn equirect_aim(image: &Equirect) -> Option<Aim> {
    let (width, height) = (image.width(), image.height());
    let weigh = |(i, pixel): (usize, &[f32; 3])| {
        let theta = ((i / width) as f32 + 0.5) / height as f32 * PI;
        luminance(Vec3::from(*pixel)) * theta.sin()
    };
    let weights: Vec<f32> = image.pixels().iter().enumerate().map(weigh).collect();
    Some(Aim::Equirect { table: Table::new(width, height, &weights)?, image: image.clone() })
}

/// Uniform in a cap: the height above the axis' plane is uniform. Written with half-angle sines, which keep their
/// digits for the smallest cap.
pub(crate) fn uniform_cap(axis: Vec3, radius: f32, u: Vec2) -> Vec3 {
    let rim = (0.5 * radius).sin();
    // 1 - cos of the angle from the axis.
    let depth = 2.0 * rim * rim * u.x;
    let (sin, cos) = (TAU * u.y).sin_cos();
    let side = (depth * (2.0 - depth)).max(0.0).sqrt();
    let (tangent, bitangent) = axis.any_orthonormal_pair();
    (side * cos * tangent + side * sin * bitangent + (1.0 - depth) * axis).normalize()
}

/// 2 pi (1 - cos r).
fn cap_solid_angle(radius: f32) -> f32 {
    let rim = (0.5 * radius).sin();
    4.0 * PI * rim * rim
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::hash;

    fn all_aims() -> Vec<(&'static str, Aim)> {
        let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 0.7);
        let sky = Sky::new(1.0, 0.5, 3.0).unwrap().rotated(turn);
        let pixels =
            (0..32 * 16).map(|i| [1.0 + (i % 7) as f32, if i == 77 { 900.0 } else { 0.5 }, 0.0]).collect();
        let image = Equirect::new(32, 16, pixels).unwrap().rotated(turn);
        let cap = |radius| Cap { axis: Vec3::new(0.6, 0.0, -0.8), radius, radiance: Vec3::ONE };
        let mut all = vec![
            ("half sphere", cap_aim(&cap(0.5 * PI))),
            ("small cap", cap_aim(&cap(0.05))),
            ("sphere", cap_aim(&cap(PI))),
        ];
        all.push(("dome", dome_aim(&sky).unwrap()));
        all.push(("equirect", equirect_aim(&image).unwrap()));
        all
    }

    /// Mean of f / pdf over samples is the integral of f; here f = 1 + d.z / 2 over the support of the density, against
    /// a fine sum over the sphere.
    #[test]
    fn aims_sample_the_density_they_claim() {
        for (name, aim) in all_aims() {
            let f = |d: Vec3| f64::from(1.0 + 0.5 * d.z);
            let n = 400_000;
            let mut sampled = 0.0;
            for i in 0..n {
                let d = aim.sample(hash::stratified_2d(i, n, 9));
                assert!((d.length() - 1.0).abs() < 1e-5, "{name}: {d}");
                let pdf = aim.pdf(d);
                // A direction may be rounded over the rim of its cap or cell.
                sampled += if pdf > 0.0 { f(d) / f64::from(pdf) / f64::from(n) } else { 0.0 };
            }
            let (rows, columns) = (1500, 3000);
            let mut summed = 0.0;
            for row in 0..rows {
                let z = 1.0 - 2.0 * (row as f32 + 0.5) / rows as f32;
                for column in 0..columns {
                    let (sin, cos) = (TAU * column as f32 / columns as f32).sin_cos();
                    let r = (1.0 - z * z).sqrt();
                    let d = Vec3::new(r * cos, z, r * sin);
                    summed += if aim.pdf(d) > 0.0 { f(d) } else { 0.0 };
                }
            }
            summed *= 4.0 * std::f64::consts::PI / f64::from(rows * columns);
            // The rim of the small cap is 2,800 cells of the sum's grid around, a hundredth of them decides.
            assert!((sampled / summed - 1.0).abs() < 0.01, "{name}: {sampled} {summed}");
        }
    }

    /// Solid angles of small caps keep their digits: area of a disc, pi r^2 (1 - r^2 / 12).
    #[test]
    fn sun_sized_cap_has_its_solid_angle() {
        let r = 0.004_653f32;
        assert!((cap_solid_angle(r) / (PI * r * r * (1.0 - r * r / 12.0)) - 1.0).abs() < 1e-6);
    }

    /// A ring of directions as near to a turned sky's sun as rounding goes: whatever the sky counts as sun has a density.
    #[test]
    fn what_a_sky_counts_as_sun_has_a_density() {
        for turn in 0..50 {
            let q = Quat::from_euler(glam::EulerRot::XYZ, 0.3 * turn as f32, -1.1, 0.7 + turn as f32);
            let sky = Sky::new(0.1 * turn as f32, 0.5, 3.0).unwrap().rotated(q);
            let sun = sky.sun().unwrap();
            let aim = cap_aim(&sun);
            let count = 4000;
            let on_rim = |i: u32| uniform_cap(sun.axis, sun.radius, Vec2::new(1.0, i as f32 / count as f32));
            for d in (0..count).map(on_rim) {
                let is_sun = sky.radiance(d) != sky.dome_radiance(d);
                assert!(!is_sun || aim.pdf(d) > 0.0, "turn {turn}: {d}");
            }
        }
    }

    #[test]
    fn smooth_lights_need_no_aim() {
        assert!(aims(&Light::new(Source::Uniform(Vec3::ONE))).is_empty());
        assert!(aims(&Light::dark()).is_empty());
        let sky = Light::new(Source::Sky(Sky::new(0.0, 0.6, 3.0).unwrap()));
        assert_eq!(aims(&sky).len(), 2);
    }
}
