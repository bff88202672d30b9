//! Projection of lights into spherical harmonics: Lᵢ = ∫ L(ω) yᵢ(ω) dω, per RGB channel.
//!
//! | source | how | cost at order n |
//! |---|---|---|
//! | uniform | closed form | nothing |
//! | CIE overcast | zonal, Gauss-Legendre over the upper half (exact: a polynomial) | n² |
//! | cap | zonal, closed form | n² |
//! | sky | dome by product quadrature split at horizon and sun, sun as a cap | 4,608 looks at it + a rotation |
//! | equirect | exact integral over box pixels, once per picture, then kept and rotated | a rotation |
//!
//! Nothing allocates, except the first projection of a picture.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::LazyLock;

use glam::{Mat3, Quat, Vec3};

use super::quadrature::{gauss_legendre, legendre, over};
use super::{Cap, CieOvercast, Equirect, Light, Sky, Source, sky};
use crate::sh::{self, MAX_COEFFICIENTS, MAX_ORDER};

/// SH coefficients of `light` in the world's frame, written over `out[..order²]`.
///
/// # Panics
/// When `order` is not in 1..=[`MAX_ORDER`] or `out` is shorter than order².
pub fn project_sh(light: &Light, order: usize, out: &mut [[f32; 3]]) {
    out[..order * order].fill([0.0; 3]);
    for source in &light.sources {
        project_source_sh(source, order, out);
    }
}

/// Adds the SH coefficients of one source to `out[..order²]`.
///
/// # Panics
/// As [`project_sh`].
pub fn project_source_sh(source: &Source, order: usize, out: &mut [[f32; 3]]) {
    match source {
        Source::Uniform(l) => add_uniform(*l, out),
        Source::CieOvercast(overcast) => add_overcast(overcast, order, out),
        Source::Cap(cap) => add_cap(cap, order, out),
        Source::Sky(sky) => {
            add_dome(sky, order, out);
            if let Some(sun) = sky.sun_above_horizon() {
                add_cap(&sun, order, out);
            }
        }
        Source::Equirect(image) => add_equirect(image, order, out),
    }
}

/// Only y_00 = 1/√(4π) sees a constant: ∫ y_00 dω = √(4π).
fn add_uniform(radiance: Vec3, out: &mut [[f32; 3]]) {
    let dc = (4.0 * PI).sqrt() as f32;
    out[0] = (Vec3::from(out[0]) + radiance * dc).to_array();
}

/// z_l = 2π √((2l+1)/4π) ∫₀¹ P_l(t) (1 + 2t)/3 dt. Degree 10 at most: six points are exact.
fn add_overcast(overcast: &CieOvercast, order: usize, out: &mut [[f32; 3]]) {
    static RULE: LazyLock<[(f64, f64); 6]> = LazyLock::new(gauss_legendre);
    let mut integrals = [0.0; MAX_ORDER];
    for (t, weight) in over(&RULE, 0.0, 1.0) {
        let p = legendre::<MAX_ORDER>(t);
        for l in 0..MAX_ORDER {
            integrals[l] += weight * p[l] * (1.0 + 2.0 * t) / 3.0;
        }
    }
    sh::add_zonal(&zonal(&integrals)[..order], overcast.up, overcast.zenith, out);
}

/// z_l = 2π √((2l+1)/4π) ∫_c¹ P_l(t) dt, c = cos radius; the integral is (P_{l-1}(c) - P_{l+1}(c)) / (2l+1).
pub(super) fn add_cap(cap: &Cap, order: usize, out: &mut [[f32; 3]]) {
    let radius = f64::from(cap.radius);
    let p = legendre::<{ MAX_ORDER + 1 }>(radius.cos());
    let mut integrals = [0.0; MAX_ORDER];
    integrals[0] = crate::cap::area(radius) / (2.0 * PI);
    for l in 1..MAX_ORDER {
        integrals[l] = (p[l - 1] - p[l + 1]) / (2 * l + 1) as f64;
    }
    sh::add_zonal(&zonal(&integrals)[..order], cap.axis, cap.radiance, out);
}

/// Zonal SH coefficients from the integrals of f P_l over the cosine.
fn zonal(integrals: &[f64; MAX_ORDER]) -> [f32; MAX_ORDER] {
    std::array::from_fn(|l| (2.0 * PI * ((2 * l + 1) as f64 / (4.0 * PI)).sqrt() * integrals[l]) as f32)
}

/// Points of the dome's quadrature: twice this in height, once in half the azimuth.
const N_DOME: usize = 48;

/// The dome, without the sun's disc.
///
/// In a frame with the zenith at z and the sun's azimuth at x the dome is even in y, so half the azimuths and
/// the cosine terms are enough. The radiance has a root at the horizon (√cos θ), removed by cos θ = u², and a
/// kink at the sun, put into a corner of the grid: the height is split there and azimuths φ = π t² crowd
/// towards it.
pub(super) fn add_dome(sky: &Sky, order: usize, out: &mut [[f32; 3]]) {
    static RULE: LazyLock<[(f64, f64); N_DOME]> = LazyLock::new(gauss_legendre);
    let to_sun = sky::compass_direction(sky.azimuth(), 0.0);
    let frame = Mat3::from_cols(to_sun, Vec3::Y.cross(to_sun), Vec3::Y);
    let split = f64::from(sky.elevation().max(0.0)).sin().sqrt();

    let mut local = [[0.0_f64; 3]; MAX_COEFFICIENTS];
    for (u, weight_u) in over(&RULE, 0.0, split).chain(over(&RULE, split, 1.0)) {
        let cos_theta = (u * u).min(1.0);
        let sin_theta = (1.0 - cos_theta * cos_theta).sqrt();
        let mut fourier = [[0.0_f64; 3]; MAX_ORDER];
        for (t, weight_t) in over(&RULE, 0.0, 1.0) {
            let (sin_phi, cos_phi) = (PI * t * t).sin_cos();
            let d = Vec3::new((sin_theta * cos_phi) as f32, (sin_theta * sin_phi) as f32, cos_theta as f32);
            let radiance = sky.dome_local(frame * d).as_dvec3().to_array();
            // dφ = 2π t dt, twice for the other half; d(cos θ) = 2u du.
            let weight = weight_t * 2.0 * PI * t * 2.0 * weight_u * 2.0 * u;
            add_cosine_terms(cos_phi, weight, radiance, &mut fourier[..order]);
        }
        add_ring(sin_theta, cos_theta, order, |m| (fourier[m], [0.0; 3]), &mut local);
    }
    let turn = sky.orientation() * Quat::from_mat3(&frame);
    add_rotated(order, turn, 1.0, &local.map(|c| c.map(|x| x as f32)), out);
}

/// fourier[m] += weight radiance cos mφ, by Chebyshev's recurrence in cos φ.
fn add_cosine_terms(cos_phi: f64, weight: f64, radiance: [f64; 3], fourier: &mut [[f64; 3]]) {
    let (mut before, mut current) = (cos_phi, 1.0);
    for sums in fourier {
        for (sum, l) in sums.iter_mut().zip(radiance) {
            *sum += weight * current * l;
        }
        (before, current) = (current, 2.0 * cos_phi * current - before);
    }
}

/// Adds a ring of constant θ, given as its Fourier terms m -> (∫ L cos mφ, ∫ L sin mφ), to coefficients about
/// +z.
fn add_ring(
    sin_theta: f64,
    cos_theta: f64,
    order: usize,
    fourier: impl Fn(usize) -> ([f64; 3], [f64; 3]),
    out: &mut [[f64; 3]; MAX_COEFFICIENTS],
) {
    // At φ = 0 the basis function (l, m), m >= 0, is the factor that both (l, m) and (l, -m) have of θ.
    let mut y = [0.0; MAX_COEFFICIENTS];
    sh::eval(order, Vec3::new(sin_theta as f32, 0.0, cos_theta as f32), &mut y);
    for m in 0..order {
        let (cosine, sine) = fourier(m);
        for l in m..order {
            let centre = l * (l + 1);
            let factor = f64::from(y[centre + m]);
            for c in 0..3 {
                out[centre + m][c] += factor * cosine[c];
                if m > 0 {
                    out[centre - m][c] += factor * sine[c];
                }
            }
        }
    }
}

/// Adds `scale` times the turned coefficients.
fn add_rotated(order: usize, turn: Quat, scale: f32, from: &[[f32; 3]], out: &mut [[f32; 3]]) {
    let mut turned = [[0.0; 3]; MAX_COEFFICIENTS];
    sh::rotate(order, turn, from, &mut turned);
    for (sum, c) in out.iter_mut().zip(&turned[..order * order]) {
        *sum = (Vec3::from(*sum) + scale * Vec3::from(*c)).to_array();
    }
}

fn add_equirect(image: &Equirect, order: usize, out: &mut [[f32; 3]]) {
    add_rotated(order, image.orientation(), image.scale(), image.image_sh(), out);
}

/// The rows of a picture with fewer are cut until there are this many strips: eight points per strip then
/// integrate band 9 (degree 10 with sin θ, over 22 degrees) to rounding.
const MIN_STRIPS: usize = 8;

/// SH coefficients of a picture in its own frame, to the highest order: Σ over pixels of ∫ over the pixel's
/// box of yᵢ dω.
///
/// Per row the integral over azimuth is a Fourier sum with the box's own factor sin(m Δφ/2) / (m Δφ/2), and
/// that over the row's height is Gauss-Legendre. Cost: 2 n operations per pixel.
pub(super) fn equirect_sh(width: usize, height: usize, pixels: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let rule = gauss_legendre::<8>();
    let n_strips = MIN_STRIPS.div_ceil(height);
    let columns = column_factors(width);
    let mut local = [[0.0; 3]; MAX_COEFFICIENTS];
    for (row, line) in pixels.chunks_exact(width).enumerate() {
        let fourier = row_fourier(line, &columns);
        for strip in row * n_strips..(row + 1) * n_strips {
            let theta = |strip: usize| PI * strip as f64 / (n_strips * height) as f64;
            for (theta, weight) in over(&rule, theta(strip), theta(strip + 1)) {
                let (sin_theta, cos_theta) = theta.sin_cos();
                let weighted = |m: usize| {
                    let scale = |v: [f64; 3]| v.map(|x| x * weight * sin_theta);
                    (scale(fourier[m].0), scale(fourier[m].1))
                };
                add_ring(sin_theta, cos_theta, MAX_ORDER, weighted, &mut local);
            }
        }
    }
    // About +z: x is the centre column (-Z), y the left quarter (-X), z the top (+Y).
    let to_image = Quat::from_mat3(&Mat3::from_cols(Vec3::NEG_Z, Vec3::NEG_X, Vec3::Y));
    let mut out = vec![[0.0; 3]; MAX_COEFFICIENTS];
    add_rotated(MAX_ORDER, to_image, 1.0, &local.map(|c| c.map(|x| x as f32)), &mut out);
    out
}

/// Per column and m: ∫ cos mφ dφ and ∫ sin mφ dφ over the column, φ counted from the centre to the left.
fn column_factors(width: usize) -> Vec<[(f64, f64); MAX_ORDER]> {
    let step = 2.0 * PI / width as f64;
    let column = |i: usize| {
        let phi = PI - (i as f64 + 0.5) * step;
        std::array::from_fn(|m| {
            let half = 0.5 * m as f64 * step;
            let box_factor = if m == 0 { step } else { step * half.sin() / half };
            let (sin, cos) = (m as f64 * phi).sin_cos();
            (box_factor * cos, box_factor * sin)
        })
    };
    (0..width).map(column).collect()
}

fn row_fourier(line: &[[f32; 3]], columns: &[[(f64, f64); MAX_ORDER]]) -> [([f64; 3], [f64; 3]); MAX_ORDER] {
    let mut sums = [([0.0; 3], [0.0; 3]); MAX_ORDER];
    for (pixel, factors) in line.iter().zip(columns) {
        let pixel = pixel.map(f64::from);
        for (sum, (cos, sin)) in sums.iter_mut().zip(factors) {
            for (c, x) in pixel.into_iter().enumerate() {
                sum.0[c] += x * cos;
                sum.1[c] += x * sin;
            }
        }
    }
    sums
}

/// Solid angle of a pixel in `row` of a picture: a box in azimuth and height.
pub(super) fn pixel_solid_angle(width: usize, height: usize, row: usize) -> f64 {
    let elevation = |row: usize| FRAC_PI_2 - PI * row as f64 / height as f64;
    2.0 * PI / width as f64 * (elevation(row).sin() - elevation(row + 1).sin())
}
