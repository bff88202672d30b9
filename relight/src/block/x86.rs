//! The sums of a block with AVX-512, best with its products of pairs of 16-bit floats, or with AVX2 and FMA.
//!
//! Entries, or pairs of them, are taken two at a time into sums of their own, since a product takes longer than its turn.
#![allow(unsafe_code, reason = "several times as fast as the portable sum, see the portal bench")]

use std::arch::x86_64::*;

use glam::Vec4;

use super::{BIAS, LANES, Light, SHIFT, Sums};

/// Bytes of shares that are asked for before their turn: what a processor foresees by itself ends with each block.
const AHEAD: usize = 3072;

/// Pairs of entries that are put side by side before their shares are read.
const PAIRS: usize = 32;

/// By how much a byte lies higher in a float of 16 bits.
const HALF_SHIFT: u32 = SHIFT - 16;

/// Whether the light is wanted in floats of 16 bits.
pub fn has_half() -> bool {
    is_x86_feature_detected!("avx512bf16")
        && is_x86_feature_detected!("avx512vbmi")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
}

/// Writes the light times `factor` in floats of 16 bits whose exponents are as much higher as those of shares are lower.
///
/// # Panics
/// When the processor has none.
pub fn halve(light: &[Vec4], factor: f32, half: &mut [[u16; 4]]) {
    assert!(has_half(), "this processor has no floats of 16 bits");
    // SAFETY: the processor has the features that the function is compiled for.
    unsafe { halve_avx512(light, factor, half) }
}

/// `false`, and nothing done, where the processor lacks what it takes.
#[inline]
pub fn add(entries: &[u16], shares: &[[u8; LANES]], light: &Light, sums: &mut Sums) -> bool {
    if has_half() {
        add_half(entries, shares, light, sums);
    } else if has_wide() {
        add_wide(entries, shares, light, sums);
    } else if has_narrow() {
        add_narrow(entries, shares, light, sums);
    } else {
        return false;
    }
    true
}

fn has_wide() -> bool {
    is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx2")
}

fn has_narrow() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

fn add_half(entries: &[u16], shares: &[[u8; LANES]], light: &Light, sums: &mut Sums) {
    assert!(has_half(), "this processor has no floats of 16 bits");
    // SAFETY: the processor has the features that the function is compiled for.
    unsafe { add_avx512_half(entries, shares, light, sums) }
}

fn add_wide(entries: &[u16], shares: &[[u8; LANES]], light: &Light, sums: &mut Sums) {
    assert!(has_wide(), "this processor has no AVX-512");
    // SAFETY: the processor has the features that the function is compiled for.
    unsafe { add_avx512(entries, shares, &light.entries, sums) }
}

fn add_narrow(entries: &[u16], shares: &[[u8; LANES]], light: &Light, sums: &mut Sums) {
    assert!(has_narrow(), "this processor has no AVX2");
    // SAFETY: the processor has the features that the function is compiled for.
    unsafe { add_avx2(entries, shares, &light.entries, sums) }
}

/// The ways that this processor has, and whether they round the light.
#[cfg(test)]
#[expect(clippy::type_complexity, reason = "of one test")]
pub fn every_kind() -> Vec<(bool, fn(&[u16], &[[u8; LANES]], &Light, &mut Sums))> {
    let mut kinds: Vec<(bool, fn(&[u16], &[[u8; LANES]], &Light, &mut Sums))> = Vec::new();
    if has_half() {
        kinds.push((true, add_half));
    }
    if has_wide() {
        kinds.push((false, add_wide));
    }
    if has_narrow() {
        kinds.push((false, add_narrow));
    }
    kinds
}

#[target_feature(enable = "avx512f,avx512bf16,avx512vl")]
fn halve_avx512(light: &[Vec4], factor: f32, half: &mut [[u16; 4]]) {
    // One after the other: together they may be more than a float is.
    let [factor, bias] = [factor, f32::from_bits((127 + BIAS) << 23)].map(|x| _mm512_set1_ps(x));
    let (fours, last) = light.as_chunks::<4>();
    let (half_fours, half_last) = half.as_chunks_mut::<4>();
    let convert = |four: &[Vec4; 4], half: &mut [[u16; 4]; 4]| {
        // SAFETY: sixteen numbers are read and written; neither asks for alignment.
        unsafe {
            let scaled = _mm512_mul_ps(_mm512_mul_ps(_mm512_loadu_ps(four.as_ptr().cast()), factor), bias);
            let rounded = std::mem::transmute::<__m256bh, __m256i>(_mm512_cvtneps_pbh(scaled));
            _mm256_storeu_si256(half.as_mut_ptr().cast(), rounded);
        }
    };
    fours.iter().zip(half_fours).for_each(|(four, half)| convert(four, half));
    if !last.is_empty() {
        let (mut four, mut half) = ([Vec4::ZERO; 4], [[0; 4]; 4]);
        four[..last.len()].copy_from_slice(last);
        convert(&four, &mut half);
        half_last.copy_from_slice(&half[..last.len()]);
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512bf16")]
fn add_avx512_half(entries: &[u16], shares: &[[u8; LANES]], light: &Light, out: &mut Sums) {
    let most = entries.iter().fold(0, |most, entry| most.max(*entry));
    assert!(usize::from(most) < light.half.len(), "entries lie beyond the light");
    // SAFETY: all entries are in the light.
    let half = |entry: u16| unsafe { *light.half.get_unchecked(usize::from(entry)) };
    let mut sums = [[_mm512_setzero_ps(); 3]; 2];
    // Byte 16 i + l of two entries' becomes the lower byte of word 2 l + i.
    let places: [u8; 64] = std::array::from_fn(|i| (16 * (i / 2 % 2) + i / 4) as u8);
    // SAFETY: 64 bytes are what is read; the load asks for no alignment.
    let places = unsafe { _mm512_loadu_si512(places.as_ptr().cast()) };
    let (pairs, last) = entries.as_chunks::<2>();
    let (share_pairs, last_shares) = shares.as_chunks::<2>();
    let mut beside = [[0u32; 4]; PAIRS];
    for (pairs, shares) in pairs.chunks(PAIRS).zip(share_pairs.chunks(PAIRS)) {
        for (beside, pair) in beside.iter_mut().zip(pairs) {
            *beside = side_by_side(pair.map(half));
        }
        let (twos, rest) = shares.as_chunks::<2>();
        let (beside_twos, beside_rest) = beside[..shares.len()].as_chunks::<2>();
        for (shares, beside) in twos.iter().zip(beside_twos) {
            _mm_prefetch::<_MM_HINT_T0>(shares.as_ptr().wrapping_byte_add(AHEAD).cast());
            for ((sums, shares), beside) in sums.iter_mut().zip(shares).zip(beside) {
                add_pair(sums, shares, beside, places);
            }
        }
        for (shares, beside) in rest.iter().zip(beside_rest) {
            add_pair(&mut sums[0], shares, beside, places);
        }
    }
    for (entry, shares) in last.iter().zip(last_shares) {
        let beside = side_by_side([half(*entry), [0; 4]]);
        add_pair(&mut sums[0], &[*shares, [0; LANES]], &beside, places);
    }
    for (c, out) in out.iter_mut().enumerate() {
        let sum = _mm512_mul_ps(_mm512_add_ps(sums[0][c], sums[1][c]), _mm512_set1_ps(light.unit));
        // SAFETY: a colour is sixteen numbers; neither asks for alignment.
        unsafe { _mm512_storeu_ps(out.as_mut_ptr(), _mm512_add_ps(_mm512_loadu_ps(out.as_ptr()), sum)) };
    }
}

/// Two entries, colour by colour.
#[inline]
#[target_feature(enable = "sse2")]
fn side_by_side(light: [[u16; 4]; 2]) -> [u32; 4] {
    let [a, b] = light.map(|entry| _mm_cvtsi64_si128(bytemuck::cast(entry)));
    let mut out = [0; 4];
    // SAFETY: sixteen bytes are what is written; the store asks for no alignment.
    unsafe { _mm_storeu_si128(out.as_mut_ptr().cast(), _mm_unpacklo_epi16(a, b)) };
    out
}

#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vbmi,avx512bf16")]
fn add_pair(sums: &mut [__m512; 3], shares: &[[u8; LANES]; 2], beside: &[u32; 4], places: __m512i) {
    // SAFETY: 32 bytes are what is read; the load asks for no alignment.
    let bytes = unsafe { _mm256_loadu_si256(shares.as_ptr().cast()) };
    let words = _mm512_permutexvar_epi8(places, _mm512_castsi256_si512(bytes));
    let values =
        _mm512_and_si512(_mm512_slli_epi16::<HALF_SHIFT>(words), _mm512_set1_epi16(0xff << HALF_SHIFT));
    for (sum, two) in sums.iter_mut().zip(beside) {
        let light = _mm512_set1_epi32(two.cast_signed());
        // SAFETY: vectors of as many bits, of which any are numbers.
        let [values, light] = unsafe { [values, light].map(|v| std::mem::transmute::<__m512i, __m512bh>(v)) };
        *sum = _mm512_dpbf16_ps(*sum, values, light);
    }
}

#[target_feature(enable = "avx512f,avx2")]
fn add_avx512(entries: &[u16], shares: &[[u8; LANES]], light: &[Vec4], out: &mut Sums) {
    let mut sums = [[_mm512_setzero_ps(); 3]; 2];
    let (pairs, last) = entries.as_chunks::<2>();
    let (share_pairs, last_share) = shares.as_chunks::<2>();
    for (entries, shares) in pairs.iter().zip(share_pairs) {
        _mm_prefetch::<_MM_HINT_T0>(shares.as_ptr().wrapping_byte_add(AHEAD).cast());
        for ((sums, entry), share) in sums.iter_mut().zip(entries).zip(shares) {
            add_entry(sums, light[usize::from(*entry)], share);
        }
    }
    for (entry, share) in last.iter().zip(last_share) {
        add_entry(&mut sums[0], light[usize::from(*entry)], share);
    }
    for (c, out) in out.iter_mut().enumerate() {
        let sum = _mm512_add_ps(sums[0][c], sums[1][c]);
        // SAFETY: a colour is sixteen numbers; neither asks for alignment.
        unsafe { _mm512_storeu_ps(out.as_mut_ptr(), _mm512_add_ps(_mm512_loadu_ps(out.as_ptr()), sum)) };
    }
}

#[inline]
#[target_feature(enable = "avx512f,avx2")]
fn add_entry(sums: &mut [__m512; 3], light: Vec4, share: &[u8; LANES]) {
    // SAFETY: sixteen bytes are what is read; the load asks for no alignment.
    let bytes = unsafe { _mm_loadu_si128(share.as_ptr().cast()) };
    let top = _mm512_castsi512_ps(_mm512_slli_epi32::<SHIFT>(_mm512_cvtepu8_epi32(bytes)));
    let value = _mm512_mul_ps(top, _mm512_set1_ps(f32::from_bits((127 + BIAS) << 23)));
    for (sum, l) in sums.iter_mut().zip(light.truncate().to_array()) {
        *sum = _mm512_fmadd_ps(value, _mm512_set1_ps(l), *sum);
    }
}

#[target_feature(enable = "avx2,fma")]
fn add_avx2(entries: &[u16], shares: &[[u8; LANES]], light: &[Vec4], out: &mut Sums) {
    let mut sums = [[_mm256_setzero_ps(); 2]; 3];
    let bias = _mm256_set1_ps(f32::from_bits((127 + BIAS) << 23));
    for (entry, bytes) in entries.iter().zip(shares) {
        let light = light[usize::from(*entry)].truncate().to_array().map(|l| _mm256_set1_ps(l));
        // SAFETY: sixteen bytes are what is read; the load asks for no alignment.
        let bytes = unsafe { _mm_loadu_si128(bytes.as_ptr().cast()) };
        for (half, bytes) in [bytes, _mm_unpackhi_epi64(bytes, bytes)].into_iter().enumerate() {
            let top = _mm256_slli_epi32::<{ SHIFT as i32 }>(_mm256_cvtepu8_epi32(bytes));
            let value = _mm256_mul_ps(_mm256_castsi256_ps(top), bias);
            for (sums, l) in sums.iter_mut().zip(light) {
                sums[half] = _mm256_fmadd_ps(value, l, sums[half]);
            }
        }
    }
    for (out, sums) in out.iter_mut().zip(sums) {
        for (out, sum) in out.as_chunks_mut::<8>().0.iter_mut().zip(sums) {
            // SAFETY: half a colour is eight numbers; neither asks for alignment.
            unsafe { _mm256_storeu_ps(out.as_mut_ptr(), _mm256_add_ps(_mm256_loadu_ps(out.as_ptr()), sum)) };
        }
    }
}
