//! The dot products with AVX2, FMA and F16C.
//!
//! Colourless rows: eight coefficients at a time are widened to f32 and multiplied into three accumulators, one
//! per colour. Four rows share their horizontal sums: three `hadd` and one fold leave the sums of four rows in
//! four lanes. n² leaves 0, 1 or 4 coefficients beyond the last full eight; these columns are gathered over the
//! four rows and join after the fold, so that no lane is wasted on them. Rows of other lengths (bounced light carried
//! from direct light) read on past their end instead.
//!
//! Coloured rows: coefficients are interleaved r g b, so that the light is laid out once in the same way and
//! three accumulators take every third eight; their lanes hold fixed colours and are sorted at the end, four rows then
//! added to the sums at once. A last
//! partial eight reads on into the next row against a light of zero; the last row is left to the portable sum.
#![allow(unsafe_code, reason = "twice the speed of the portable sum, see benches")]

use std::arch::x86_64::*;

use half::f16;

use super::portable;
use crate::sh::MAX_COEFFICIENTS;

/// Rows that share their horizontal sums.
const ROWS: usize = 4;
/// Lanes of a 256-bit vector.
const LANES: usize = 8;
/// Longest colourless row: its light lies on the stack, in three planes.
const LONGEST: usize = 512;

/// Whether the work was done: false leaves it to the portable sum.
pub fn sh(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) -> bool {
    if !supported(light.len(), LONGEST) {
        return false;
    }
    // SAFETY: `supported` saw the features that `sh_avx2` is compiled for.
    unsafe {
        match light.len() {
            9 => sh_avx2::<9>(transfer, light, out),
            16 => sh_avx2::<16>(transfer, light, out),
            25 => sh_avx2::<25>(transfer, light, out),
            36 => sh_avx2::<36>(transfer, light, out),
            49 => sh_avx2::<49>(transfer, light, out),
            64 => sh_avx2::<64>(transfer, light, out),
            81 => sh_avx2::<81>(transfer, light, out),
            100 => sh_avx2::<100>(transfer, light, out),
            _ => any_avx2(transfer, light, out),
        }
    }
    true
}

/// Whether the work was done: false leaves it to the portable sum.
pub fn sh_rgb_add(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) -> bool {
    if !supported(light.len(), MAX_COEFFICIENTS) {
        return false;
    }
    // SAFETY: `supported` saw the features that these are compiled for.
    unsafe {
        match light.len() {
            16 => sh_rgb_add_whole::<48>(transfer, light, out),
            64 => sh_rgb_add_whole::<192>(transfer, light, out),
            _ => sh_rgb_add_avx2(transfer, light, out),
        }
    }
    true
}

fn supported(n: usize, most: usize) -> bool {
    let features = is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("f16c");
    features && (LANES..=most).contains(&n)
}

/// Rows of `N` coefficients, known when this is compiled, so that the loops unroll and need no checks.
#[target_feature(enable = "avx2,fma,f16c")]
fn sh_avx2<const N: usize>(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) {
    let mut planes = [[0.0f32; N]; 3];
    for (i, l) in light.iter().enumerate() {
        for (plane, l) in planes.iter_mut().zip(l) {
            plane[i] = *l;
        }
    }
    let full = N / LANES * LANES;
    let (rows, _) = transfer.as_chunks::<N>();
    let (rows, rest_rows) = rows.as_chunks::<ROWS>();
    let (groups, rest) = out.as_chunks_mut::<ROWS>();
    for (rows, out) in rows.iter().zip(groups) {
        let mut wide = [[_mm256_setzero_ps(); ROWS]; 3];
        for i in (0..full).step_by(LANES) {
            for r in 0..ROWS {
                let t = load_f16(&rows[r][i..i + LANES]);
                for c in 0..3 {
                    wide[c][r] = _mm256_fmadd_ps(t, load_f32(&planes[c][i..i + LANES]), wide[c][r]);
                }
            }
        }
        let mut sums = [fold(wide[0]), fold(wide[1]), fold(wide[2])];
        for i in full..N {
            let column = [bits(rows[0][i]), bits(rows[1][i]), bits(rows[2][i]), bits(rows[3][i])];
            let t = _mm_cvtph_ps(_mm_set_epi16(0, 0, 0, 0, column[3], column[2], column[1], column[0]));
            for c in 0..3 {
                sums[c] = _mm_fmadd_ps(t, _mm_set1_ps(planes[c][i]), sums[c]);
            }
        }
        store_transposed(sums, out);
    }
    portable::sh(rest_rows.as_flattened(), light, rest);
}

/// Rows of any length. A last partial eight reads on into the next row against a light of zero.
#[target_feature(enable = "avx2,fma,f16c")]
fn any_avx2(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) {
    let n = light.len();
    let mut planes = [[0.0f32; LONGEST + LANES]; 3];
    for (i, l) in light.iter().enumerate() {
        for (plane, l) in planes.iter_mut().zip(l) {
            plane[i] = *l;
        }
    }
    // A group may read on by less than eight, which the row behind it has.
    let fast = out.len().saturating_sub(1) / ROWS * ROWS;
    let (groups, _) = out[..fast].as_chunks_mut::<ROWS>();
    for (group, out) in groups.iter_mut().enumerate() {
        let rows = &transfer[group * ROWS * n..];
        let mut wide = [[_mm256_setzero_ps(); ROWS]; 3];
        for i in (0..n).step_by(LANES) {
            for r in 0..ROWS {
                let t = load_f16(&rows[r * n + i..r * n + i + LANES]);
                for c in 0..3 {
                    wide[c][r] = _mm256_fmadd_ps(t, load_f32(&planes[c][i..i + LANES]), wide[c][r]);
                }
            }
        }
        store_transposed([fold(wide[0]), fold(wide[1]), fold(wide[2])], out);
    }
    portable::sh(&transfer[fast * n..], light, &mut out[fast..]);
}

/// Rows of `ROW` numbers, a multiple of 24, known when this is compiled.
#[target_feature(enable = "avx2,fma,f16c")]
fn sh_rgb_add_whole<const ROW: usize>(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) {
    let mut flat = [0.0f32; ROW];
    flat.copy_from_slice(light.as_flattened());
    let (rows, _) = transfer.as_chunks::<ROW>();
    let (rows, rest_rows) = rows.as_chunks::<ROWS>();
    let (groups, rest) = out.as_chunks_mut::<ROWS>();
    for (rows, out) in rows.iter().zip(groups) {
        let mut sums = [_mm_setzero_ps(); ROWS];
        for (row, sum) in rows.iter().zip(&mut sums) {
            *sum = sum_rgb(row, &flat);
        }
        add_triples(sums, out);
    }
    portable::sh_rgb_add(rest_rows.as_flattened(), light, rest);
}

#[target_feature(enable = "avx2,fma,f16c")]
fn sh_rgb_add_avx2(transfer: &[f16], light: &[[f32; 3]], out: &mut [[f32; 3]]) {
    let row = light.len() * 3;
    let mut flat = [0.0f32; 3 * MAX_COEFFICIENTS + 3 * LANES];
    for (f, l) in flat.chunks_exact_mut(3).zip(light) {
        f.copy_from_slice(l);
    }
    // Reading on past the end of a row by less than 24 needs that much transfer behind it.
    let behind = (3 * LANES).div_ceil(row);
    let fast = out.len().saturating_sub(behind) / ROWS * ROWS;
    let light_of_row = &flat[..row.next_multiple_of(3 * LANES)];
    let (groups, _) = out[..fast].as_chunks_mut::<ROWS>();
    for (group, out) in groups.iter_mut().enumerate() {
        let mut sums = [_mm_setzero_ps(); ROWS];
        for (r, sum) in sums.iter_mut().enumerate() {
            *sum = sum_rgb(&transfer[(group * ROWS + r) * row..], light_of_row);
        }
        add_triples(sums, out);
    }
    portable::sh_rgb_add(&transfer[fast * row..], light, &mut out[fast..]);
}

#[inline]
#[target_feature(enable = "avx2,fma,f16c")]
fn load_f16(from: &[f16]) -> __m256 {
    assert!(from.len() == LANES);
    // SAFETY: the slice holds the sixteen bytes read; the load asks for no alignment.
    _mm256_cvtph_ps(unsafe { _mm_loadu_si128(from.as_ptr().cast()) })
}

#[inline]
#[target_feature(enable = "avx2,fma,f16c")]
fn load_f32(from: &[f32]) -> __m256 {
    assert!(from.len() == LANES);
    // SAFETY: the slice holds the thirty-two bytes read; the load asks for no alignment.
    unsafe { _mm256_loadu_ps(from.as_ptr()) }
}

fn bits(value: f16) -> i16 {
    value.to_bits() as i16
}

/// The sums of the lanes of four vectors, in four lanes.
#[inline]
#[target_feature(enable = "avx2,fma,f16c")]
fn fold(v: [__m256; ROWS]) -> __m128 {
    let pairs = _mm256_hadd_ps(_mm256_hadd_ps(v[0], v[1]), _mm256_hadd_ps(v[2], v[3]));
    _mm_add_ps(_mm256_castps256_ps128(pairs), _mm256_extractf128_ps::<1>(pairs))
}

/// Red, green and blue of four rows -> four interleaved triples.
#[inline]
#[target_feature(enable = "avx2,fma,f16c")]
fn store_transposed([r, g, b]: [__m128; 3], out: &mut [[f32; 3]; ROWS]) {
    let low = _mm_unpacklo_ps(r, g); // r0 g0 r1 g1
    let high = _mm_unpackhi_ps(r, g); // r2 g2 r3 g3
    let b0_r1 = _mm_shuffle_ps::<{ order([0, 0, 2, 2]) }>(b, low);
    let g1_b1 = _mm_shuffle_ps::<{ order([3, 3, 1, 1]) }>(low, b);
    let b2_r3 = _mm_shuffle_ps::<{ order([2, 2, 2, 2]) }>(b, high);
    let g3_b3 = _mm_shuffle_ps::<{ order([3, 3, 3, 3]) }>(high, b);
    let triples = [
        _mm_shuffle_ps::<{ order([0, 1, 0, 2]) }>(low, b0_r1),
        _mm_shuffle_ps::<{ order([0, 2, 0, 1]) }>(g1_b1, high),
        _mm_shuffle_ps::<{ order([0, 2, 0, 2]) }>(b2_r3, g3_b3),
    ];
    for (out, part) in out.as_flattened_mut().chunks_exact_mut(4).zip(triples) {
        // SAFETY: the chunk holds the sixteen bytes written; the store asks for no alignment.
        unsafe { _mm_storeu_ps(out.as_mut_ptr(), part) };
    }
}

/// The immediate of `_mm_shuffle_ps` that takes these lanes, the first two from its first operand.
const fn order([a, b, c, d]: [i32; 4]) -> i32 {
    a | b << 2 | c << 4 | d << 6
}

/// The sums of a row's products with a light, a multiple of 24 numbers, and anything.
#[inline]
#[target_feature(enable = "avx2,fma,f16c")]
fn sum_rgb(row: &[f16], light: &[f32]) -> __m128 {
    let mut wide = [_mm256_setzero_ps(); 3];
    for i in (0..light.len()).step_by(3 * LANES) {
        for (k, w) in wide.iter_mut().enumerate() {
            let at = i + k * LANES;
            *w = _mm256_fmadd_ps(load_f16(&row[at..at + LANES]), load_f32(&light[at..at + LANES]), *w);
        }
    }
    fold_rgb(wide)
}

/// Twenty-four lanes r g b r g b ... -> their three sums, and anything.
#[inline]
#[target_feature(enable = "avx2,fma,f16c")]
fn fold_rgb([a, b, c]: [__m256; 3]) -> __m128 {
    // Twelve lanes are four whole triples, so quarter k and quarter k + 3 hold the same colours.
    let low = |v| _mm256_castps256_ps128(v);
    let quarters = [
        _mm_add_ps(low(a), _mm256_extractf128_ps::<1>(b)),
        _mm_add_ps(_mm256_extractf128_ps::<1>(a), low(c)),
        _mm_add_ps(low(b), _mm256_extractf128_ps::<1>(c)),
    ];
    let [p, q, r] = quarters.map(|v| _mm_castps_si128(v));
    // Lanes 3.., 6.. and 9.. of the twelve.
    let second = _mm_castsi128_ps(_mm_alignr_epi8::<12>(q, p));
    let third = _mm_castsi128_ps(_mm_alignr_epi8::<8>(r, q));
    let fourth = _mm_castsi128_ps(_mm_srli_si128::<4>(r));
    _mm_add_ps(_mm_add_ps(quarters[0], second), _mm_add_ps(third, fourth))
}

/// Adds four triples, of whose lanes the last are anything, to four that follow each other.
#[inline]
#[target_feature(enable = "avx2,fma,f16c")]
fn add_triples([a, b, c, d]: [__m128; ROWS], out: &mut [[f32; 3]; ROWS]) {
    let b_c = _mm_shuffle_ps::<{ order([1, 2, 0, 1]) }>(b, c);
    let rotated = _mm_shuffle_ps::<{ order([0, 0, 1, 2]) }>(d, d);
    // Red of b behind a; blue of c before d.
    let parts = [_mm_insert_ps::<0x30>(a, b), b_c, _mm_insert_ps::<0x80>(rotated, c)];
    for (out, part) in out.as_flattened_mut().chunks_exact_mut(4).zip(parts) {
        // SAFETY: the chunk holds the sixteen bytes read and written; neither asks for alignment.
        unsafe { _mm_storeu_ps(out.as_mut_ptr(), _mm_add_ps(_mm_loadu_ps(out.as_ptr()), part)) };
    }
}
