//! The sums of a block with AVX-512, or with AVX2 and FMA.
//!
//! Entries are taken two at a time into sums of their own, since a product takes longer than its turn.
#![allow(unsafe_code, reason = "several times as fast as the portable sum, see the portal bench")]

use std::arch::x86_64::*;

use glam::Vec4;

use super::{AHEAD, BIAS, LANES, SHIFT, Sums};

/// `false`, and nothing done, where the processor lacks what it takes.
#[inline]
pub fn add(entries: &[u16], shares: &[[u8; LANES]], light: &[Vec4], sums: &mut Sums) -> bool {
    if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the features that the function is compiled for.
        unsafe { add_avx512(entries, shares, light, sums) };
        return true;
    }
    add_narrow(entries, shares, light, sums)
}

fn add_narrow(entries: &[u16], shares: &[[u8; LANES]], light: &[Vec4], sums: &mut Sums) -> bool {
    if !(is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")) {
        return false;
    }
    // SAFETY: the processor has the features that the function is compiled for.
    unsafe { add_avx2(entries, shares, light, sums) };
    true
}

/// By each of the ways that this processor has.
#[cfg(test)]
pub fn add_by_every_kind(entries: &[u16], shares: &[[u8; LANES]], light: &[Vec4], sums: Sums) -> Vec<Sums> {
    let mut all = [sums; 2];
    let [widest, narrow] = &mut all;
    let is_there = [add(entries, shares, light, widest), add_narrow(entries, shares, light, narrow)];
    all.into_iter().zip(is_there).filter_map(|(sums, is_there)| is_there.then_some(sums)).collect()
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
