//! The dot products of a frame: rows of f16 transfer coefficients times one light vector.
//!
//! E(v) = Σᵢ T(v, i) L(i), for the three colours of the light at once. The transfer is read once, so a frame
//! costs little more than reading the bytes of the asset. Two implementations give the same sums up to the
//! rounding of f32: [`portable`], and one for x86-64 with AVX2, FMA and F16C, chosen at run time.
//!
//! Sums run in f32 over at most a hundred coefficients: relative error of a row under 1e-5 of Σ |T L|.

pub mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

use half::f16;

/// Rows of one task when threads share the work: a few hundred kilobytes, so that stealing is cheap to start
/// and every task still streams.
#[cfg(feature = "rayon")]
pub(crate) const ROWS_PER_TASK: usize = 1024;

/// `out[v] = Σᵢ transfer[v n + i] light[i]` with n = `light.len()`: colourless transfer, coloured light.
///
/// `out` is irradiance in the unit of the light, \[V\]; V = `out.len()`.
///
/// # Panics
/// When `transfer.len() != out.len() * light.len()`.
pub fn sh(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) {
    check(transfer.len(), light.len(), out.len());
    #[cfg(target_arch = "x86_64")]
    if x86::sh(transfer, light, out) {
        return;
    }
    portable::sh(transfer, light, out);
}

/// `out[v][c] += Σᵢ transfer[(v n + i) 3 + c] light[i][c]`: transfer that has taken on the scene's colours.
///
/// # Panics
/// When `transfer.len() != out.len() * light.len() * 3`.
pub fn sh_rgb_add(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) {
    check(transfer.len(), light.len() * 3, out.len());
    #[cfg(target_arch = "x86_64")]
    if x86::sh_rgb_add(transfer, light, out) {
        return;
    }
    portable::sh_rgb_add(transfer, light, out);
}

/// [`sh`] over all threads of the current rayon pool.
///
/// # Panics
/// As [`sh`].
#[cfg(feature = "rayon")]
pub fn sh_parallel(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) {
    use rayon::prelude::*;
    check(transfer.len(), light.len(), out.len());
    let rows = transfer.par_chunks(ROWS_PER_TASK * light.len());
    out.par_chunks_mut(ROWS_PER_TASK).zip(rows).for_each(|(out, rows)| sh(rows, light, out));
}

/// [`sh_rgb_add`] over all threads of the current rayon pool.
///
/// # Panics
/// As [`sh_rgb_add`].
#[cfg(feature = "rayon")]
pub fn sh_rgb_add_parallel(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) {
    use rayon::prelude::*;
    check(transfer.len(), light.len() * 3, out.len());
    let rows = transfer.par_chunks(ROWS_PER_TASK * light.len() * 3);
    out.par_chunks_mut(ROWS_PER_TASK).zip(rows).for_each(|(out, rows)| sh_rgb_add(rows, light, out));
}

fn check(coefficients: usize, row: usize, rows: usize) {
    assert!(row > 0, "a light needs at least one coefficient");
    assert_eq!(coefficients, row * rows, "transfer rows and vertices do not match");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(count: usize, seed: u32) -> Vec<f32> {
        let mut state = seed;
        let step = |_| {
            state = state.wrapping_mul(747796405).wrapping_add(2891336453);
            (state >> 8) as f32 / (1 << 24) as f32 * 2.0 - 1.0
        };
        (0..count).map(step).collect()
    }

    fn case(order: usize, vertices: usize, channels: usize) -> (Vec<f16>, Vec<[f32; 3]>) {
        rows(order * order, vertices, channels)
    }

    fn rows(n: usize, vertices: usize, channels: usize) -> (Vec<f16>, Vec<[f32; 3]>) {
        let transfer = noise(vertices * n * channels, 7).into_iter().map(f16::from_f32).collect();
        let light = noise(n * 3, 11).chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        (transfer, light)
    }

    fn assert_close(a: &[[f32; 3]], b: &[[f32; 3]]) {
        for (a, b) in a.iter().zip(b) {
            for (a, b) in a.iter().zip(b) {
                // Reordered f32 sums of at most 100 terms below one: 100 * 2^-24 * 100 / 2.
                assert!((a - b).abs() < 3e-4, "{a} {b}");
            }
        }
    }

    #[test]
    fn dispatch_agrees_with_the_portable_sum_at_every_order_and_tail() {
        for order in 1..=10 {
            for vertices in [0, 1, 2, 3, 4, 5, 7, 8, 9, 31, 64] {
                let (transfer, light) = case(order, vertices, 1);
                let (mut a, mut b) = (vec![[9.0; 3]; vertices], vec![[0.0; 3]; vertices]);
                sh(&transfer, &light, &mut a);
                portable::sh(&transfer, &light, &mut b);
                assert_close(&a, &b);

                let (transfer, light) = case(order, vertices, 3);
                let (mut a, mut b) = (vec![[0.5; 3]; vertices], vec![[0.5; 3]; vertices]);
                sh_rgb_add(&transfer, &light, &mut a);
                portable::sh_rgb_add(&transfer, &light, &mut b);
                assert_close(&a, &b);
            }
        }
    }

    #[test]
    fn dispatch_agrees_with_the_portable_sum_at_any_length() {
        for n in [8, 10, 31, 128, 200, 512, 513] {
            for vertices in [0, 1, 4, 5, 8, 31] {
                let (transfer, light) = rows(n, vertices, 1);
                let (mut a, mut b) = (vec![[9.0; 3]; vertices], vec![[0.0; 3]; vertices]);
                sh(&transfer, &light, &mut a);
                portable::sh(&transfer, &light, &mut b);
                assert_close(&a, &b);
            }
        }
    }

    #[test]
    fn portable_sum_is_the_definition() {
        let (transfer, light) = case(2, 3, 1);
        let mut out = vec![[0.0; 3]; 3];
        portable::sh(&transfer, &light, &mut out);
        let expected: f32 = (0..4).map(|i| transfer[4 + i].to_f32() * light[i][2]).sum();
        assert!((out[1][2] - expected).abs() < 1e-6);
    }

    #[test]
    #[should_panic(expected = "do not match")]
    fn mismatched_lengths_are_the_callers_bug() {
        sh(&[f16::ONE; 5], &[[1.0; 3]; 4], &mut [[0.0; 3]]);
    }

    #[cfg(feature = "rayon")]
    #[test]
    fn parallel_equals_serial_to_the_bit() {
        let (transfer, light) = case(5, 3 * ROWS_PER_TASK + 5, 1);
        let (mut a, mut b) = (vec![[0.0; 3]; transfer.len() / 25], vec![[0.0; 3]; transfer.len() / 25]);
        sh(&transfer, &light, &mut a);
        sh_parallel(&transfer, &light, &mut b);
        assert_close(&a, &b);
    }
}
