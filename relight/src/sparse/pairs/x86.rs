//! Sums of pairs with AVX-512 and its products of whole numbers (VNNI), or with AVX2: a pair is one vector, or two.
#![allow(unsafe_code, reason = "several times as fast as the portable sum, see the portal bench")]

use std::arch::x86_64::*;

use super::{LANES, List, MOST, Pair, Planes, Sums};
use crate::block::AHEAD;

/// `false`, and nothing done, where the processor lacks what it takes.
#[inline]
pub fn add(is_signed: bool, list: List, light: Planes, out: &mut Sums) -> bool {
    if is_x86_feature_detected!("avx512bw") && is_x86_feature_detected!("avx512vnni") {
        // SAFETY: the processor has the features that the function is compiled for.
        unsafe {
            if is_signed {
                add_avx512::<true>(list, light, out);
            } else {
                add_avx512::<false>(list, light, out);
            }
        }
        return true;
    }
    add_narrow(is_signed, list, light, out)
}

fn add_narrow(is_signed: bool, list: List, light: Planes, out: &mut Sums) -> bool {
    if !is_x86_feature_detected!("avx2") {
        return false;
    }
    // SAFETY: the processor has the features that the function is compiled for.
    unsafe {
        if is_signed {
            add_avx2::<true>(list, light, out);
        } else {
            add_avx2::<false>(list, light, out);
        }
    }
    true
}

/// By each of the ways that this processor has.
#[cfg(test)]
pub fn add_by_every_kind(is_signed: bool, list: List, light: Planes, out: Sums) -> Vec<Sums> {
    let way = |add: fn(bool, List, Planes, &mut Sums) -> bool| {
        let mut out = out;
        add(is_signed, list, light, &mut out).then_some(out)
    };
    [add, add_narrow].into_iter().filter_map(way).collect()
}

/// That all entries are in the light.
#[inline(always)]
fn check(first: &[u16], light: Planes) -> [*const i16; 3] {
    let most = first.iter().fold(0, |most, first| most.max(*first));
    assert!(light.iter().all(|plane| usize::from(most) + 1 < plane.len()), "entries lie beyond the light");
    light.map(<[i16]>::as_ptr)
}

/// Both entries of a pair.
///
/// # Safety
/// They are in the plane.
#[inline(always)]
unsafe fn entries(plane: *const i16, first: u16) -> i32 {
    // SAFETY: the caller's.
    unsafe { plane.add(usize::from(first)).cast::<i32>().read_unaligned() }
}

#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
fn add_avx512<const SIGNED: bool>(List { first, pairs, steps }: List, light: Planes, out: &mut Sums) {
    let light = check(first, light);
    let mut all = [_mm512_setzero_ps(); 3];
    for (first, pairs) in first.chunks(MOST).zip(pairs.chunks(MOST)) {
        // Two at a time into sums of their own, since a product takes longer than its turn.
        let mut sums = [[_mm512_setzero_si512(); 3]; 2];
        let (firsts, last_first) = first.as_chunks::<2>();
        let (twos, last) = pairs.as_chunks::<2>();
        for (firsts, two) in firsts.iter().zip(twos) {
            _mm_prefetch::<_MM_HINT_T0>(two.as_ptr().wrapping_byte_add(AHEAD).cast());
            for ((sums, first), pair) in sums.iter_mut().zip(firsts).zip(two) {
                // SAFETY: entries were checked.
                unsafe { add_pair::<SIGNED>(sums, *first, pair, light) };
            }
        }
        for (first, pair) in last_first.iter().zip(last) {
            // SAFETY: entries were checked.
            unsafe { add_pair::<SIGNED>(&mut sums[0], *first, pair, light) };
        }
        for (c, all) in all.iter_mut().enumerate() {
            *all = _mm512_add_ps(*all, _mm512_cvtepi32_ps(_mm512_add_epi32(sums[0][c], sums[1][c])));
        }
    }
    for ((out, all), step) in out.iter_mut().zip(all).zip(steps) {
        // SAFETY: a colour is sixteen numbers; neither asks for alignment.
        unsafe {
            let sum = _mm512_add_ps(_mm512_loadu_ps(out.as_ptr()), _mm512_mul_ps(_mm512_set1_ps(step), all));
            _mm512_storeu_ps(out.as_mut_ptr(), sum);
        }
    }
}

/// # Safety
/// The entries are in the light.
#[inline]
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
unsafe fn add_pair<const SIGNED: bool>(
    sums: &mut [__m512i; 3],
    first: u16,
    pair: &Pair,
    light: [*const i16; 3],
) {
    // SAFETY: a pair is 32 bytes; the load asks for no alignment.
    let bytes = unsafe { _mm256_loadu_si256(pair.as_ptr().cast()) };
    let values = if SIGNED { _mm512_cvtepi8_epi16(bytes) } else { _mm512_cvtepu8_epi16(bytes) };
    for (sum, plane) in sums.iter_mut().zip(light) {
        // SAFETY: the caller's.
        let two = unsafe { entries(plane, first) };
        *sum = _mm512_dpwssd_epi32(*sum, values, _mm512_set1_epi32(two));
    }
}

#[target_feature(enable = "avx2")]
fn add_avx2<const SIGNED: bool>(List { first, pairs, steps }: List, light: Planes, out: &mut Sums) {
    let light = check(first, light);
    let mut all = [[_mm256_setzero_ps(); 2]; 3];
    for (first, pairs) in first.chunks(MOST).zip(pairs.chunks(MOST)) {
        let mut sums = [[_mm256_setzero_si256(); 2]; 3];
        for (first, pair) in first.iter().zip(pairs) {
            // SAFETY: entries were checked.
            let light = light.map(|plane| _mm256_set1_epi32(unsafe { entries(plane, *first) }));
            for (half, bytes) in pair.as_flattened().as_chunks::<LANES>().0.iter().enumerate() {
                // SAFETY: sixteen bytes are what is read; the load asks for no alignment.
                let bytes = unsafe { _mm_loadu_si128(bytes.as_ptr().cast()) };
                let values = if SIGNED { _mm256_cvtepi8_epi16(bytes) } else { _mm256_cvtepu8_epi16(bytes) };
                for (sums, l) in sums.iter_mut().zip(light) {
                    sums[half] = _mm256_add_epi32(sums[half], _mm256_madd_epi16(values, l));
                }
            }
        }
        for (all, sum) in all.as_flattened_mut().iter_mut().zip(sums.as_flattened()) {
            *all = _mm256_add_ps(*all, _mm256_cvtepi32_ps(*sum));
        }
    }
    for ((out, all), step) in out.iter_mut().zip(all).zip(steps) {
        for (out, all) in out.as_chunks_mut::<8>().0.iter_mut().zip(all) {
            // SAFETY: half a colour is eight numbers; neither asks for alignment.
            unsafe {
                let sum =
                    _mm256_add_ps(_mm256_loadu_ps(out.as_ptr()), _mm256_mul_ps(_mm256_set1_ps(step), all));
                _mm256_storeu_ps(out.as_mut_ptr(), sum);
            }
        }
    }
}
