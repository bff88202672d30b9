//! The two-dimensional Haar transform of a cubemap's faces, orthonormal.
//!
//! Each level turns blocks of 2 x 2 values (a b / c d) into a mean and three details,
//!
//! ```text
//! mean = (a + b + c + d) / 2     across rows    = (a + b - c - d) / 2
//!                                across columns = (a - b + c - d) / 2     crosswise = (a - b - c + d) / 2
//! ```
//!
//! and the means go on to the next level while their number on a side is even (down to 1 x 1 where N is a power of
//! two). Orthonormal: dot products stay what they are, so a row and a light may both be transformed and multiplied,
//! and dropping coefficients of the row is the least error, in the mean over all lights, when the smallest are
//! dropped.
//!
//! Order of a face's N² coefficients: the last means row by row, then level by level from coarse to fine the details
//! across rows (stored row by row), across columns (column by column) and crosswise (row by row). So the
//! coefficients along a window's edges, upright or level, are neighbours, and run-length coding finds them together.
//!
//! Where it breaks: nothing is weighted by the texels' solid angles, which differ by up to 5.2.
//!
//! Values are numbers or vectors of them (a colour per texel).
//!
//! Based on: Ng, Ramamoorthi and Hanrahan, All-Frequency Shadows Using Non-linear Wavelet Lighting Approximation,
//! 2003.

use std::ops::{Add, Mul, Sub};

/// What can be transformed.
pub trait Value: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<f32, Output = Self> {}

impl<T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>> Value for T {}

/// Levels of the transform of an n x n face.
pub fn n_levels(n: usize) -> u32 {
    n.trailing_zeros()
}

/// Last means on a face: 1 where `n` is a power of two.
pub fn n_means(n: usize) -> usize {
    let side = n >> n_levels(n);
    side * side
}

/// Coefficients of one face, n² in and out.
///
/// # Panics
/// When a slice is shorter than n², or n is 0.
pub fn forward<T: Value>(n: usize, texels: &[T], scratch: &mut [T], out: &mut [T]) {
    let scratch = &mut scratch[..n * n];
    scratch.copy_from_slice(&texels[..n * n]);
    let mut side = n;
    while side.is_multiple_of(2) {
        side /= 2;
        split_level(side, scratch, &mut out[side * side..4 * side * side]);
    }
    out[..side * side].copy_from_slice(&scratch[..side * side]);
}

/// The face that has these coefficients: the inverse of [`forward`].
///
/// # Panics
/// When a slice is shorter than n², or n is 0.
pub fn inverse<T: Value>(n: usize, coefficients: &[T], scratch: &mut [T], out: &mut [T]) {
    let mut side = n >> n_levels(n);
    out[..side * side].copy_from_slice(&coefficients[..side * side]);
    while side < n {
        scratch[..side * side].copy_from_slice(&out[..side * side]);
        join_level(side, &scratch[..side * side], &coefficients[side * side..4 * side * side], out);
        side *= 2;
    }
}

/// Calls `met` with each coefficient that a texel of a face takes part in, and what of it the texel is worth: the row of
/// the inverse for one texel.
pub(crate) fn for_each_of_texel(n: usize, [column, row]: [usize; 2], mut met: impl FnMut(usize, f32)) {
    let (mut side, mut column, mut row, mut weight) = (n, column, row, 1.0);
    while side.is_multiple_of(2) {
        side /= 2;
        weight *= 0.5;
        let [x, y] = [column, row].map(|i| if i.is_multiple_of(2) { weight } else { -weight });
        (column, row) = (column / 2, row / 2);
        met(side * side + row * side + column, y);
        met(2 * side * side + column * side + row, x);
        met(3 * side * side + row * side + column, x * y / weight);
    }
    met(row * side + column, weight);
}

/// 2 side x 2 side values -> side² means in place of them, and three times side² details.
fn split_level<T: Value>(side: usize, values: &mut [T], details: &mut [T]) {
    let (across_rows, rest) = details.split_at_mut(side * side);
    let (across_columns, crosswise) = rest.split_at_mut(side * side);
    for row in 0..side {
        for column in 0..side {
            let at = 4 * row * side + 2 * column;
            let (a, b) = (values[at], values[at + 1]);
            let (c, d) = (values[at + 2 * side], values[at + 2 * side + 1]);
            let (top, bottom, left, right) = (a + b, c + d, a - b, c - d);
            across_rows[row * side + column] = (top - bottom) * 0.5;
            across_columns[column * side + row] = (left + right) * 0.5;
            crosswise[row * side + column] = (left - right) * 0.5;
            // Written behind what is still to be read: row side + column <= 4 row side + 2 column.
            values[row * side + column] = (top + bottom) * 0.5;
        }
    }
}

fn join_level<T: Value>(side: usize, means: &[T], details: &[T], out: &mut [T]) {
    let (across_rows, rest) = details.split_at(side * side);
    let (across_columns, crosswise) = rest.split_at(side * side);
    for row in 0..side {
        for column in 0..side {
            let at = row * side + column;
            let (mean, h, v, d) =
                (means[at], across_rows[at], across_columns[column * side + row], crosswise[at]);
            let to = 4 * row * side + 2 * column;
            out[to] = (mean + h + v + d) * 0.5;
            out[to + 1] = (mean + h - v - d) * 0.5;
            out[to + 2 * side] = (mean - h + v - d) * 0.5;
            out[to + 2 * side + 1] = (mean - h - v + d) * 0.5;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(count: usize) -> Vec<f32> {
        (0..count).map(|i| ((i * 7919 + i * i * 31) % 1009) as f32 / 500.0 - 1.0).collect()
    }

    fn transformed(n: usize, face: &[f32]) -> Vec<f32> {
        let (mut scratch, mut out) = (vec![0.0; n * n], vec![0.0; n * n]);
        forward(n, face, &mut scratch, &mut out);
        out
    }

    #[test]
    fn haar_inverse_undoes_forward_at_every_resolution() {
        for n in 8..=64 {
            let face = noise(n * n);
            let (mut scratch, mut back) = (vec![0.0; n * n], vec![0.0; n * n]);
            inverse(n, &transformed(n, &face), &mut scratch, &mut back);
            for (a, b) in face.iter().zip(&back) {
                // Six levels of sums of four values below one.
                assert!((a - b).abs() < 1e-5, "{a} {b} at {n}");
            }
        }
    }

    #[test]
    fn one_texel_of_the_inverse_is_that_of_the_whole() {
        for n in [8, 12, 32] {
            let coefficients = noise(n * n);
            let (mut scratch, mut whole) = (vec![0.0; n * n], vec![0.0; n * n]);
            inverse(n, &coefficients, &mut scratch, &mut whole);
            for (t, expected) in whole.iter().enumerate() {
                let mut sum = 0.0;
                for_each_of_texel(n, [t % n, t / n], |at, weight| sum += weight * coefficients[at]);
                // Sixteen products below one.
                assert!((sum - expected).abs() < 1e-5, "{sum} {expected} at {t} of {n}");
            }
        }
    }

    #[test]
    fn haar_keeps_dot_products() {
        for n in [8, 24, 32] {
            let (a, b): (Vec<f32>, Vec<f32>) = (noise(n * n), noise(2 * n * n)[n * n..].to_vec());
            let dot = |a: &[f32], b: &[f32]| -> f64 {
                a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
            };
            let (plain, turned) = (dot(&a, &b), dot(&transformed(n, &a), &transformed(n, &b)));
            // Rounding of n² products below one in f32.
            assert!((plain - turned).abs() < 1e-4, "{plain} {turned}");
        }
    }

    #[test]
    fn haar_of_a_constant_is_one_mean() {
        let coefficients = transformed(16, &[3.0; 256]);
        assert_eq!(coefficients[0], 48.0, "N times the constant");
        assert!(coefficients[1..].iter().all(|&c| c == 0.0));
    }

    #[test]
    fn haar_edges_lie_side_by_side() {
        // An upright edge after an odd column touches details across columns only, of one column of blocks.
        let upright: Vec<f32> = (0..64).map(|i| if i % 8 < 3 { 1.0 } else { 0.0 }).collect();
        let finest = &transformed(8, &upright)[16..];
        assert_eq!(finest[16..32].iter().filter(|&&c| c != 0.0).count(), 4);
        assert!(finest[16 + 4..16 + 8].iter().all(|&c| c != 0.0), "{finest:?}");
        assert!(finest[..16].iter().chain(&finest[32..]).all(|&c| c == 0.0));
    }
}
