//! Irradiance of an open plane, from the integral and not from the run time's formulas.

use std::f64::consts::PI;

/// Irradiance of a plane under a disc of radiance 1, sr: `zenith` is the angle between its axis and the plane's
/// normal, `radius` the disc's, both radians in 0..=π/2.
///
/// A ring of directions at the angle t from the normal lies within the disc over the azimuths |φ| < Φ(t), so that
/// E = ∫ 2 Φ(t) cos t sin t dt, with cos radius = cos t cos zenith + sin t sin zenith cos Φ.
pub fn disc_over_plane(zenith: f64, radius: f64) -> f64 {
    // Φ has square-root ends; with so many points the midpoint rule still leaves under 1e-6 of the result.
    const N: usize = 100_000;
    let half_width = |t: f64| {
        let (a, b) = (radius.cos() - t.cos() * zenith.cos(), t.sin() * zenith.sin());
        if b.abs() < 1e-12 {
            return if a <= 0.0 { PI } else { 0.0 };
        }
        (a / b).clamp(-1.0, 1.0).acos()
    };
    let (from, to) = ((zenith - radius).max(0.0), (zenith + radius).min(0.5 * PI));
    let step = (to - from) / N as f64;
    (0..N).map(|i| from + (i as f64 + 0.5) * step).map(|t| half_width(t) * (2.0 * t).sin() * step).sum()
}

/// What remains of [`disc_over_plane`] when the plane's response is cut to `n_bands` bands of SH:
/// E = Σ_l A_l λ_l (2l+1) / 4π P_l(cos zenith), with A_l = 2π ∫₀¹ z P_l(z) dz and λ_l = 2π ∫ P_l over the disc.
pub fn disc_over_plane_in_bands(zenith: f64, radius: f64, n_bands: usize) -> f64 {
    const N: usize = 20_000;
    let integral = |from: f64, to: f64, f: &dyn Fn(f64) -> f64| {
        let step = (to - from) / N as f64;
        (0..N).map(|i| f(from + (i as f64 + 0.5) * step) * step).sum::<f64>()
    };
    let band = |l: usize| {
        let response = 2.0 * PI * integral(0.0, 1.0, &|z| z * legendre(l, z));
        let disc = 2.0 * PI * integral(radius.cos(), 1.0, &|z| legendre(l, z));
        response * disc * (2 * l + 1) as f64 / (4.0 * PI) * legendre(l, zenith.cos())
    };
    (0..n_bands).map(band).sum()
}

/// P_l(x)
fn legendre(l: usize, x: f64) -> f64 {
    let (mut before, mut last) = (0.0, 1.0);
    for i in 1..=l {
        let next = ((2 * i - 1) as f64 * x * last - (i - 1) as f64 * before) / i as f64;
        (before, last) = (last, next);
    }
    last
}

/// Irradiance of a level plane under the CIE overcast sky of zenith radiance 1:
/// ∫ (1 + 2 s) / 3 s dω = 2π ∫₀¹ (s + 2 s²) / 3 ds.
pub const OVERCAST_OVER_PLANE: f64 = 7.0 * PI / 9.0;

/// Share of the cosine-weighted hemisphere that a rectangle of `a` x `b` fills over a point whose normal goes through
/// one of its corners, at the distance `c`; odd in `a` and in `b`, so that sums of four give any rectangle of the plane.
///
/// Based on: J. Howell, A Catalog of Radiation Configuration Factors, 1982, B-3.
pub fn facing_rectangle(a: f64, b: f64, c: f64) -> f64 {
    let half = |a: f64, b: f64| a / a.hypot(c) * (b / a.hypot(c)).atan();
    (half(a, b) + half(b, a)) / (2.0 * PI)
}

/// As [`facing_rectangle`], where the point's normal lies in the rectangle's plane, turned by `c`: it runs along `b`,
/// and the nearest corner is at the distance `c`. Odd in `a`, 0 for `b` = 0.
///
/// Based on: Howell, B-4.
pub fn upright_rectangle(a: f64, b: f64, c: f64) -> f64 {
    ((a / c).atan() - c / b.hypot(c) * (a / b.hypot(c)).atan()) / (2.0 * PI)
}

/// The sum of a function of a corner over those of the rectangle from `low` to `high`.
pub fn over_corners(low: [f64; 2], high: [f64; 2], f: impl Fn(f64, f64) -> f64) -> f64 {
    f(high[0], high[1]) - f(low[0], high[1]) - f(high[0], low[1]) + f(low[0], low[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disc_wholly_above_the_plane_has_its_textbook_irradiance() {
        for (zenith, radius) in [(0.0, 0.3), (0.7, 0.2), (1.2, 1e-3), (0.0, PI / 2.0)] {
            let expected = PI * f64::sin(radius).powi(2) * f64::cos(zenith);
            let relative = disc_over_plane(zenith, radius) / expected - 1.0;
            assert!(relative.abs() < 1e-6, "{zenith} {radius}: {relative}");
        }
    }

    #[test]
    fn many_bands_approach_the_whole_disc() {
        // 60 bands leave A_60 of the order of 60^-2.5, times a sum over 60 terms.
        for (zenith, radius) in [(0.0, 0.3), (0.7, 0.2), (1.5, 0.5)] {
            let error = disc_over_plane_in_bands(zenith, radius, 60) - disc_over_plane(zenith, radius);
            assert!(error.abs() < 1e-3 * radius * radius * PI, "{zenith} {radius}: {error}");
        }
    }

    #[test]
    fn rectangles_fill_what_their_points_add_up_to() {
        let (a, b, c) = (0.7, 1.3, 0.9);
        const N: usize = 400;
        let (mut facing, mut upright) = (0.0, 0.0);
        for i in 0..N * N {
            let (x, y) = ((i % N) as f64 + 0.5, (i / N) as f64 + 0.5);
            let (x, y) = (x * a / N as f64, y * b / N as f64);
            let cell = a * b / (N * N) as f64 / (x * x + y * y + c * c).powi(2) / PI;
            facing += c * c * cell;
            upright += y * c * cell;
        }
        // The midpoint rule over a smooth function: 1 / N².
        assert!((facing - facing_rectangle(a, b, c)).abs() < 1e-5, "{facing}");
        assert!((upright - upright_rectangle(a, b, c)).abs() < 1e-5, "{upright}");
    }
}
