//! The sums of a block with AVX-512, or with AVX2 and FMA: an entry's bytes are one vector, or two.
//!
//! Entries are taken two at a time into sums of their own, since a product takes longer than its turn.
#![allow(unsafe_code, reason = "several times as fast as the portable sum, see the portal bench")]

use std::arch::x86_64::*;

use glam::Vec4;

use super::{LANES, Value};

const UNSIGNED: u8 = Value::Unsigned as u8;
const SIGNED: u8 = Value::Signed as u8;
const SQUARE: u8 = Value::Square as u8;

/// Bytes of values that are asked for before their turn: what a processor foresees by itself ends with each block.
const AHEAD: usize = 3072;

type Sums = [[f32; LANES]; 3];

/// `None` where the processor lacks what it takes.
#[inline]
pub fn sums(of: Value, entries: &[u16], values: &[[u8; LANES]], light: &[Vec4]) -> Option<Sums> {
    if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the features that `sums_avx512` is compiled for.
        return Some(unsafe {
            match of {
                Value::Unsigned => sums_avx512::<UNSIGNED>(entries, values, light),
                Value::Signed => sums_avx512::<SIGNED>(entries, values, light),
                Value::Square => sums_avx512::<SQUARE>(entries, values, light),
            }
        });
    }
    sums_narrow(of, entries, values, light)
}

fn sums_narrow(of: Value, entries: &[u16], values: &[[u8; LANES]], light: &[Vec4]) -> Option<Sums> {
    if !(is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")) {
        return None;
    }
    // SAFETY: the processor has the features that `sums_avx2` is compiled for.
    Some(unsafe {
        match of {
            Value::Unsigned => sums_avx2::<UNSIGNED>(entries, values, light),
            Value::Signed => sums_avx2::<SIGNED>(entries, values, light),
            Value::Square => sums_avx2::<SQUARE>(entries, values, light),
        }
    })
}

/// By each of the ways that this processor has.
#[cfg(test)]
pub fn sums_of_every_kind(of: Value, entries: &[u16], values: &[[u8; LANES]], light: &[Vec4]) -> Vec<Sums> {
    sums(of, entries, values, light).into_iter().chain(sums_narrow(of, entries, values, light)).collect()
}

#[target_feature(enable = "avx512f,avx2")]
fn sums_avx512<const VALUE: u8>(entries: &[u16], values: &[[u8; LANES]], light: &[Vec4]) -> Sums {
    let mut sums = [[_mm512_setzero_ps(); 3]; 2];
    let (pairs, last) = entries.as_chunks::<2>();
    let (value_pairs, last_value) = values.as_chunks::<2>();
    for (entries, values) in pairs.iter().zip(value_pairs) {
        _mm_prefetch::<_MM_HINT_T0>(values.as_ptr().wrapping_byte_add(AHEAD).cast());
        for ((sums, entry), value) in sums.iter_mut().zip(entries).zip(values) {
            add_avx512::<VALUE>(sums, light[usize::from(*entry)], value);
        }
    }
    for (entry, value) in last.iter().zip(last_value) {
        add_avx512::<VALUE>(&mut sums[0], light[usize::from(*entry)], value);
    }
    let mut out = [[0.0; LANES]; 3];
    for (c, out) in out.iter_mut().enumerate() {
        // SAFETY: a colour is sixteen numbers; the store asks for no alignment.
        unsafe { _mm512_storeu_ps(out.as_mut_ptr(), _mm512_add_ps(sums[0][c], sums[1][c])) };
    }
    out
}

#[inline]
#[target_feature(enable = "avx512f,avx2")]
fn add_avx512<const VALUE: u8>(sums: &mut [__m512; 3], light: Vec4, value: &[u8; LANES]) {
    // SAFETY: sixteen bytes are what is read; the load asks for no alignment.
    let bytes = unsafe { _mm_loadu_si128(value.as_ptr().cast()) };
    let wide = if VALUE == SIGNED { _mm512_cvtepi8_epi32(bytes) } else { _mm512_cvtepu8_epi32(bytes) };
    let value = _mm512_cvtepi32_ps(wide);
    let value = if VALUE == SQUARE { _mm512_mul_ps(value, value) } else { value };
    for (sum, l) in sums.iter_mut().zip(light.truncate().to_array()) {
        *sum = _mm512_fmadd_ps(value, _mm512_set1_ps(l), *sum);
    }
}

#[target_feature(enable = "avx2,fma")]
fn sums_avx2<const VALUE: u8>(entries: &[u16], values: &[[u8; LANES]], light: &[Vec4]) -> Sums {
    let mut sums = [[_mm256_setzero_ps(); 2]; 3];
    for (entry, bytes) in entries.iter().zip(values) {
        let light = light[usize::from(*entry)].truncate().to_array().map(|l| _mm256_set1_ps(l));
        // SAFETY: sixteen bytes are what is read; the load asks for no alignment.
        let bytes = unsafe { _mm_loadu_si128(bytes.as_ptr().cast()) };
        for (half, bytes) in [bytes, _mm_unpackhi_epi64(bytes, bytes)].into_iter().enumerate() {
            let wide =
                if VALUE == SIGNED { _mm256_cvtepi8_epi32(bytes) } else { _mm256_cvtepu8_epi32(bytes) };
            let value = _mm256_cvtepi32_ps(wide);
            let value = if VALUE == SQUARE { _mm256_mul_ps(value, value) } else { value };
            for (sums, l) in sums.iter_mut().zip(light) {
                sums[half] = _mm256_fmadd_ps(value, l, sums[half]);
            }
        }
    }
    let mut out = [[0.0; LANES]; 3];
    for (out, sums) in out.iter_mut().zip(sums) {
        for (out, sum) in out.as_chunks_mut::<8>().0.iter_mut().zip(sums) {
            // SAFETY: half a colour is eight numbers; the store asks for no alignment.
            unsafe { _mm256_storeu_ps(out.as_mut_ptr(), sum) };
        }
    }
    out
}
