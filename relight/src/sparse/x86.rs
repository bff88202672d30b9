//! The dot products of sparse rows with AVX-512, or with AVX2 and FMA.
//!
//! A run, sixteen values at most, is loaded under a mask, widened to f32 at once and multiplied with the light's reds,
//! greens and blues. Lanes behind the run's end are 0, so that no value is handled alone and nothing is decided within a
//! run, which a processor would often foretell wrongly: the light is read on past the run, into other entries or the
//! padding, to be multiplied by those zeros.
#![allow(unsafe_code, reason = "faster than the portable sum, see the portal bench")]

use std::arch::x86_64::*;

use super::dot::{Planes, Slices};
use super::light::PADDING;
use super::{Basis, LONGEST_RUN};

/// Values of a 512-bit vector: a run.
const LANES: usize = 16;

/// Values of a 256-bit vector.
const HALF: usize = 8;

// The kernels read a whole run's worth of light whatever its length.
const _: () = assert!(LONGEST_RUN == LANES && PADDING >= LONGEST_RUN);

/// Haar rows in `basis`: their values have a sign.
const HAAR: u8 = Basis::Haar as u8;

/// Rows of pulses, in either order: their values have none.
const PULSE: u8 = Basis::Pulse as u8;

/// Whether the work was done: false leaves it to the portable sum.
pub fn add(rows: &Slices, light: Planes, out: &mut [[f32; 3]]) -> bool {
    let has_avx2 = is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi2");
    let has_avx512 = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl");
    if has_avx2 && has_avx512 {
        // SAFETY: the processor has the features that `add_avx512` is compiled for.
        unsafe { add_avx512(rows, light, out) };
    } else if has_avx2 {
        // SAFETY: the processor has the features that `add_avx2` is compiled for.
        unsafe { add_avx2(rows, light, out) };
    }
    has_avx2
}

#[target_feature(enable = "avx2,fma,bmi2,avx512f,avx512bw,avx512vl")]
fn add_avx512(rows: &Slices, light: Planes, out: &mut [[f32; 3]]) {
    for (v, out) in out.iter_mut().enumerate() {
        let (row, entries) = (rows.row(v), light[usize::from(rows.basis[v])]);
        let sum = match rows.basis[v] {
            HAAR => row_avx512::<HAAR>(row, entries),
            _ => row_avx512::<PULSE>(row, entries),
        };
        for (o, s) in out.iter_mut().zip(sum) {
            *o += rows.scale[v] * s;
        }
    }
}

#[target_feature(enable = "avx2,fma,bmi2")]
fn add_avx2(rows: &Slices, light: Planes, out: &mut [[f32; 3]]) {
    for (v, out) in out.iter_mut().enumerate() {
        let (row, entries) = (rows.row(v), light[usize::from(rows.basis[v])]);
        let sum = match rows.basis[v] {
            HAAR => row_avx2::<HAAR>(row, entries),
            _ => row_avx2::<PULSE>(row, entries),
        };
        for (o, s) in out.iter_mut().zip(sum) {
            *o += rows.scale[v] * s;
        }
    }
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi2,avx512f,avx512bw,avx512vl")]
fn row_avx512<const BASIS: u8>((runs, values): (&[[u8; 2]], &[u8]), light: [&[f32]; 3]) -> [f32; 3] {
    let mut sums = [_mm512_setzero_ps(); 3];
    let (mut from, mut entry) = (values.as_ptr(), 0);
    for &[gap, length] in runs {
        let (gap, length) = (usize::from(gap), usize::from(length));
        let mask = _bzhi_u32(0xffff, length as u32) as __mmask16;
        // SAFETY: the lengths of a row's runs add up to its values (`Slices`), and masked lanes are not read.
        let bytes = unsafe { _mm_maskz_loadu_epi8(mask, from.cast()) };
        let wide = if BASIS == HAAR { _mm512_cvtepi8_epi32(bytes) } else { _mm512_cvtepu8_epi32(bytes) };
        let value = _mm512_cvtepi32_ps(wide);
        entry += gap;
        for (sum, light) in sums.iter_mut().zip(light) {
            // SAFETY: runs end within the light, which goes on by `LONGEST_RUN` entries and more (`Slices`).
            let l = unsafe { _mm512_loadu_ps(light.as_ptr().add(entry)) };
            *sum = _mm512_fmadd_ps(value, l, *sum);
        }
        // SAFETY: at most one past the row's last value.
        from = unsafe { from.add(length) };
        entry += length;
    }
    fold(sums.map(|sum| {
        let high = _mm256_castpd_ps(_mm512_extractf64x4_pd::<1>(_mm512_castps_pd(sum)));
        _mm256_add_ps(_mm512_castps512_ps256(sum), high)
    }))
}

#[inline]
#[target_feature(enable = "avx2,fma,bmi2")]
fn row_avx2<const BASIS: u8>((runs, mut values): (&[[u8; 2]], &[u8]), light: [&[f32]; 3]) -> [f32; 3] {
    let mut sums = [_mm256_setzero_ps(); 3];
    let mut at = 0;
    for &[gap, length] in runs {
        at += usize::from(gap);
        let length = usize::from(length);
        for first in (0..length).step_by(HALF) {
            let value = widen::<BASIS>(first_bytes(&values[first..], length - first));
            for (sum, light) in sums.iter_mut().zip(light) {
                let eight = &light[at + first..at + first + HALF];
                // SAFETY: eight entries are the numbers read; the load asks for no alignment.
                let l = unsafe { _mm256_loadu_ps(eight.as_ptr()) };
                *sum = _mm256_fmadd_ps(value, l, *sum);
            }
        }
        at += length;
        values = &values[length..];
    }
    fold(sums)
}

/// Eight bytes as numbers.
#[inline]
#[target_feature(enable = "avx2")]
fn widen<const BASIS: u8>(bytes: u64) -> __m256 {
    let bytes = _mm_cvtsi64_si128(bytes as i64);
    let wide = if BASIS == HAAR { _mm256_cvtepi8_epi32(bytes) } else { _mm256_cvtepu8_epi32(bytes) };
    _mm256_cvtepi32_ps(wide)
}

/// The first `count` bytes, 8 at most, and zeros.
#[inline]
#[target_feature(enable = "bmi2")]
fn first_bytes(values: &[u8], count: usize) -> u64 {
    let count = count.min(HALF);
    let bytes = match values.first_chunk::<HALF>() {
        Some(eight) => u64::from_le_bytes(*eight),
        None => values[..count].iter().rev().fold(0, |all, byte| all << 8 | u64::from(*byte)),
    };
    _bzhi_u64(bytes, 8 * count as u32)
}

/// The sum of each of three vectors.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn fold([r, g, b]: [__m256; 3]) -> [f32; 3] {
    // Pairs of neighbours: r r g g, then r g b b, each in both halves.
    let (rg, bb) = (_mm256_hadd_ps(r, g), _mm256_hadd_ps(b, b));
    let all = _mm256_hadd_ps(rg, bb);
    let sum = _mm_add_ps(_mm256_castps256_ps128(all), _mm256_extractf128_ps::<1>(all));
    let [r, g, b, _] = glam::Vec4::from(sum).to_array();
    [r, g, b]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of every run length, the last of which end at the end of all values.
    fn case() -> (Vec<[u8; 2]>, Vec<u8>, Vec<u32>, Vec<u32>) {
        let (mut runs, mut value, mut start, mut first_run) = (Vec::new(), Vec::new(), vec![0], vec![0]);
        for v in 0..70u8 {
            let length = 16 - v % 16;
            runs.extend([[v % 7, length], [255, 0], [3, 1]]);
            value.extend((0..=length).map(|i| i.wrapping_mul(37).wrapping_add(v)));
            start.push(value.len() as u32);
            first_run.push(runs.len() as u32);
        }
        (runs, value, start, first_run)
    }

    #[test]
    fn every_instruction_set_agrees_with_the_portable_sum() {
        let (runs, value, start, first_run) = case();
        let basis: Vec<u8> = (0..70).map(|v| v % 3).collect();
        let scale: Vec<f32> = (0..70).map(|v| 1.0 + v as f32).collect();
        let (start, first_run, runs, value) = (&start[..], &first_run[..], &runs[..], &value[..]);
        let rows = Slices { start, first_run, runs, value, scale: &scale, basis: &basis };
        let plane = |entry: fn(f32) -> f32| (0..400).map(|i| entry(i as f32)).collect::<Vec<f32>>();
        let planes = [plane(|i| (i * 0.03).sin()), plane(|i| (i * 0.05).cos()), plane(|i| i * 0.01)];
        let planes = [0, 1, 2].map(|from| planes.each_ref().map(|plane| &plane[from..]));
        let mut portable = vec![[0.5; 3]; 70];
        super::super::dot::add_portable(&rows, planes, &mut portable);
        assert!(portable.iter().flatten().any(|e| e.abs() > 100.0), "there is something to compare");
        let close = |found: &[[f32; 3]]| {
            for (a, b) in found.iter().flatten().zip(portable.iter().flatten()) {
                // Sums of up to 17 products below 255 x 4, scaled by up to 70.
                assert!((a - b).abs() < 1e-6 * 70.0 * 17.0 * 1020.0, "{a} {b}");
            }
        };
        let mut out = vec![[0.5; 3]; 70];
        if !add(&rows, planes, &mut out) {
            println!("skipped: this processor has no AVX2");
            return;
        }
        close(&out);
        let mut out = vec![[0.5; 3]; 70];
        // SAFETY: `add` has found AVX2, FMA and BMI2.
        unsafe { add_avx2(&rows, planes, &mut out) };
        close(&out);
    }
}
