//! How far one result is from another.
//!
//! For elements i (pixels, or vertices) of weight w_i (1, or the area around the vertex), with |x| the sum of the
//! absolute linear R, G and B:
//!
//! - *relative difference* `sum w_i |a_i - b_i| / sum w_i |b_i|`, the papers' "average difference";
//! - *99th percentile*: the smallest e that 99 % of the weight does not exceed, of
//!   `e_i = |a_i - b_i| / m` with `m = sum w_i |b_i| / sum w_i`. The error is measured against the mean of the
//!   reference, not against b_i itself, which is zero in black places;
//! - *noise*: the relative difference that the reference's own noise alone brings. For normal errors of standard
//!   deviation s, the mean of |error| is `s sqrt(2 / pi)`.
//!
//! It breaks where the reference is black everywhere: then the measures are 0 for a black candidate, else infinite.

use crate::error::Error;
use glam::Vec3;

/// How far `a` is from the reference `b`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Relative difference, 0 and up; 0.01 is one percent.
    pub relative: f64,
    /// 99th percentile of the error, in units of the reference's mean.
    pub percentile_99: f64,
}

/// How many times smaller the reference's noise must be than the error it judges.
pub const NOISE_MARGIN: f64 = 5.0;

/// Compares `a` with the reference `b`; `weight` (areas of vertices, or 0 for pixels to leave out) is 1 where not
/// given.
///
/// # Errors
/// [`Error::Options`] where lengths differ, nothing is there to compare, or a value is not finite: a NaN must not
/// vanish in a mean.
pub fn difference(a: &[Vec3], b: &[Vec3], weight: Option<&[f32]>) -> Result<Difference, Error> {
    check("candidate", a, b.len())?;
    check("reference", b, b.len())?;
    let weights = weights(weight, b.len())?;

    let distance: Vec<f64> = a.iter().zip(b).map(|(a, b)| size(*a - *b)).collect();
    let error = weighted_sum(distance.iter().copied(), &weights);
    let total = weighted_sum(b.iter().map(|b| size(*b)), &weights);
    let mean = total / weights.iter().sum::<f64>();
    Ok(Difference {
        relative: ratio(error, total),
        percentile_99: ratio(percentile(&distance, &weights, 0.99), mean),
    })
}

/// Error of each element in units of the reference's mean: what [`Difference::percentile_99`] is taken of.
///
/// # Errors
/// As [`difference`].
pub fn element_errors(a: &[Vec3], b: &[Vec3], weight: Option<&[f32]>) -> Result<Vec<f32>, Error> {
    check("candidate", a, b.len())?;
    check("reference", b, b.len())?;
    let weights = weights(weight, b.len())?;
    let mean = weighted_sum(b.iter().map(|b| size(*b)), &weights) / weights.iter().sum::<f64>();
    Ok(a.iter().zip(b).map(|(a, b)| ratio(size(*a - *b), mean) as f32).collect())
}

/// Relative difference that the reference's noise alone brings, from the standard error of each element.
///
/// # Errors
/// As [`difference`].
pub fn noise(standard_error: &[Vec3], reference: &[Vec3], weight: Option<&[f32]>) -> Result<f64, Error> {
    check("standard error", standard_error, reference.len())?;
    check("reference", reference, reference.len())?;
    let weights = weights(weight, reference.len())?;
    let error = weighted_sum(standard_error.iter().map(|e| size(*e)), &weights);
    let total = weighted_sum(reference.iter().map(|b| size(*b)), &weights);
    Ok(ratio(error, total) * std::f64::consts::FRAC_2_PI.sqrt())
}

/// Whether a reference with this noise may judge this relative difference.
pub fn may_judge(noise: f64, relative_difference: f64) -> bool {
    noise * NOISE_MARGIN <= relative_difference
}

/// Sum of absolute channels.
fn size(x: Vec3) -> f64 {
    x.abs().to_array().map(f64::from).iter().sum()
}

/// 0 / 0 is 0: black against black agrees.
fn ratio(a: f64, b: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a / b }
}

fn weighted_sum(x: impl Iterator<Item = f64>, weights: &[f64]) -> f64 {
    x.zip(weights).map(|(x, w)| x * w).sum()
}

/// Smallest element that `share` of the weight does not exceed.
fn percentile(x: &[f64], weights: &[f64], share: f64) -> f64 {
    let mut order: Vec<usize> = (0..x.len()).filter(|&i| weights[i] > 0.0).collect();
    order.sort_by(|&i, &j| x[i].total_cmp(&x[j]));
    // A hair less than the share: sums of weights are rounded.
    let enough = share * weights.iter().sum::<f64>() * (1.0 - 1e-12);
    let mut sum = 0.0;
    let found = order.iter().find(|&&i| {
        sum += weights[i];
        sum >= enough
    });
    found.or(order.last()).map_or(0.0, |&i| x[i])
}

fn weights(weight: Option<&[f32]>, n: usize) -> Result<Vec<f64>, Error> {
    let weights: Vec<f64> = match weight {
        None => vec![1.0; n],
        Some(w) => w.iter().map(|w| f64::from(*w)).collect(),
    };
    let usable = weights.iter().all(|w| w.is_finite() && *w >= 0.0);
    if weights.len() != n || !usable || weights.iter().sum::<f64>() <= 0.0 {
        let what = format!("comparison: needs {n} weights, at least 0 and not all 0, got {}", weights.len());
        return Err(Error::Options { what });
    }
    Ok(weights)
}

fn check(name: &str, x: &[Vec3], n: usize) -> Result<(), Error> {
    if x.len() != n || n == 0 {
        let what = format!("comparison: {name} has {} elements, the reference {n}", x.len());
        return Err(Error::Options { what });
    }
    match x.iter().position(|x| !x.is_finite()) {
        Some(i) => Err(Error::Options { what: format!("comparison: element {i} of the {name} is {}", x[i]) }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(x: &[f32]) -> Vec<Vec3> {
        x.iter().map(|x| Vec3::splat(*x)).collect()
    }

    #[test]
    fn relative_difference_weighs_elements() {
        let (a, b) = (grey(&[1.0, 3.0]), grey(&[2.0, 2.0]));
        let plain = difference(&a, &b, None).unwrap();
        assert_eq!(plain.relative, 0.5);
        let biased = difference(&grey(&[1.0, 2.0]), &b, Some(&[3.0, 1.0])).unwrap();
        assert_eq!(biased.relative, 3.0 / 8.0);
    }

    #[test]
    fn relative_difference_of_black_is_zero_or_infinite() {
        let black = grey(&[0.0; 4]);
        assert_eq!(
            difference(&black, &black, None).unwrap(),
            Difference { relative: 0.0, percentile_99: 0.0 }
        );
        assert_eq!(difference(&grey(&[1.0; 4]), &black, None).unwrap().relative, f64::INFINITY);
    }

    #[test]
    fn percentile_of_ramp_is_its_99th_element() {
        let ramp: Vec<f32> = (1..=200).map(|i| 1.0 + i as f32).collect();
        let found = difference(&grey(&ramp), &grey(&[1.0; 200]), None).unwrap();
        // 198 of 200 elements are at most 198 times the mean away.
        assert!((found.percentile_99 - 198.0).abs() < 1e-9);
    }

    #[test]
    fn percentile_ignores_weightless_elements() {
        let mut a = vec![1.5; 10];
        a[0] = 100.0;
        let mut w = [1.0; 10];
        w[0] = 0.0;
        let found = difference(&grey(&a), &grey(&[1.0; 10]), Some(&w)).unwrap();
        assert_eq!((found.relative, found.percentile_99), (0.5, 0.5));
    }

    #[test]
    fn noise_predicts_difference_of_two_noisy_images() {
        // Sums of 12 uniform numbers have a variance of 1: nearly normal.
        let mut state = 1u64;
        let mut normal = || {
            let mut uniform = || {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                (state >> 40) as f32 / (1 << 24) as f32
            };
            (0..12).map(|_| uniform()).sum::<f32>() - 6.0
        };
        let truth = vec![Vec3::splat(10.0); 20_000];
        let noisy: Vec<Vec3> =
            truth.iter().map(|t| *t + 0.3 * Vec3::new(normal(), normal(), normal())).collect();
        let expected = noise(&vec![Vec3::splat(0.3); truth.len()], &truth, None).unwrap();
        let found = difference(&noisy, &truth, None).unwrap().relative;
        // 60,000 samples: 0.4 % of the mean deviation, and the sum of 12 is 0.4 % from normal in this measure.
        assert!((found / expected - 1.0).abs() < 0.015, "{found} {expected}");
        assert!(may_judge(expected, 0.13) && !may_judge(expected, 0.11));
    }

    #[test]
    fn nan_is_an_error_and_not_a_number() {
        let message = difference(&grey(&[1.0, f32::NAN]), &grey(&[1.0, 1.0]), None).unwrap_err().to_string();
        assert!(message.contains("element 1 of the candidate"), "{message}");
        assert!(difference(&grey(&[1.0]), &grey(&[1.0, 1.0]), None).is_err());
        assert!(difference(&[], &[], None).is_err());
        assert!(difference(&grey(&[1.0]), &grey(&[1.0]), Some(&[0.0])).is_err());
    }
}
