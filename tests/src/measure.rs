//! Measures of error. Each panics on nothing: a test that finds nothing to compare must fail.

use glam::Vec3;

/// Mean of the numbers.
///
/// # Panics
/// When there are none.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, n) = values.into_iter().fold((0.0, 0), |(sum, n), v| (sum + v, n + 1));
    assert!(n > 0, "nothing to compare");
    sum / f64::from(n)
}

/// Root mean square of the numbers.
///
/// # Panics
/// When there are none.
pub fn rms(values: impl IntoIterator<Item = f64>) -> f64 {
    mean(values.into_iter().map(|v| v * v)).sqrt()
}

/// Angle between two directions of any length, degrees.
pub fn degrees_between(a: Vec3, b: Vec3) -> f64 {
    let (a, b) = (a.as_dvec3().normalize(), b.as_dvec3().normalize());
    (2.0 * (0.5 * (a - b).length()).min(1.0).asin()).to_degrees()
}

/// Indices of about `n` of `total` things, evenly spread.
///
/// # Panics
/// When there are none.
pub fn spread(total: usize, n: usize) -> impl Iterator<Item = usize> {
    assert!(total > 0 && n > 0, "nothing to compare");
    (0..total).step_by(total.div_ceil(n))
}
