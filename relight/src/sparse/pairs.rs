//! Sixteen rows that read the same pairs of neighbouring entries of a light in whole numbers.
//!
//! Σ over pairs e of byte(2 e', v) light\[e\] + byte(2 e' + 1, v) light\[e + 1\] for the sixteen rows v at once: a pair is
//! one instruction per colour. Sums of 32 bits are exact, and added up as floats before they could overflow, at the same
//! places by every way to compute them, which so agree to the last bit.

use super::fixed::Planes;
use crate::block::{LANES, Sums};

#[cfg(target_arch = "x86_64")]
mod x86;

/// Two bytes of each row.
pub type Pair = [[u8; 2]; LANES];

/// Pairs whose sums fit in 32 bits: 2 * 128 * 255 * 32767 does.
const MOST: usize = 128;

/// Pairs of a block.
#[derive(Clone, Copy)]
pub struct List<'a> {
    /// First entry of each.
    pub first: &'a [u16],
    /// Bytes, of 0..=255 or -128..=127.
    pub pairs: &'a [Pair],
    /// What a product counts in each colour.
    pub steps: [f32; 3],
}

/// Adds the products of a list with a light.
///
/// # Panics
/// When an entry is not in the light, or is its last.
#[inline]
pub fn add(is_signed: bool, list: List, light: Planes, out: &mut Sums) {
    #[cfg(target_arch = "x86_64")]
    if x86::add(is_signed, list, light, out) {
        return;
    }
    add_portable(is_signed, list, light, out);
}

/// As they are defined, for any processor.
fn add_portable(is_signed: bool, List { first, pairs, steps }: List, light: Planes, out: &mut Sums) {
    let mut all = [[0.0; LANES]; 3];
    for (first, pairs) in first.chunks(MOST).zip(pairs.chunks(MOST)) {
        let mut sums = [[0i32; LANES]; 3];
        for (&first, pair) in first.iter().zip(pairs) {
            let first = usize::from(first);
            let values =
                pair.map(|two| two.map(|b| if is_signed { i32::from(b as i8) } else { i32::from(b) }));
            for (sums, light) in sums.iter_mut().zip(light) {
                let [a, b] = [light[first], light[first + 1]].map(i32::from);
                sums.iter_mut().zip(&values).for_each(|(sum, two)| *sum += two[0] * a + two[1] * b);
            }
        }
        let sums = sums.as_flattened().iter();
        all.as_flattened_mut().iter_mut().zip(sums).for_each(|(all, sum)| *all += *sum as f32);
    }
    for ((out, all), step) in out.iter_mut().zip(&all).zip(steps) {
        out.iter_mut().zip(all).for_each(|(out, all)| *out += step * all);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_instruction_set_agrees_with_the_portable_sum() {
        let plane = |k: i32| -> Vec<i16> { (0..300).map(|i| ((i * i * k) % 65535 - 32767) as i16).collect() };
        let mut planes = [plane(3), plane(71), vec![32767; 300]];
        planes[2][5] = -32767;
        let light = planes.each_ref().map(Vec::as_slice);
        for n in [0usize, 1, 2, 3, 7, 127, 128, 129, 400] {
            let first: Vec<u16> = (0..n).map(|i| (i * 37 % 299) as u16).collect();
            for is_bright in [false, true] {
                let byte = |i: usize| if is_bright { 255 } else { (i * 59) as u8 };
                let pairs: Vec<Pair> = (0..n)
                    .map(|i| std::array::from_fn(|lane| [byte(i + 31 * lane), byte(7 * i + lane)]))
                    .collect();
                for is_signed in [false, true] {
                    let list = List { first: &first, pairs: &pairs, steps: [1.0, 0.3, 7.0] };
                    let before = [[2.5; LANES]; 3];
                    let mut plain = before;
                    add_portable(is_signed, list, light, &mut plain);
                    assert!(n == 0 || plain.as_flattened().iter().any(|x| x.abs() > 1e3), "to compare");
                    if is_bright && !is_signed && n == 128 {
                        // As many as there may be of the largest: no overflow.
                        let all = 7.0 * 255.0 * 32767.0 * 256.0;
                        assert!(plain[2].iter().all(|x| (x - all).abs() < 0.02 * all), "{plain:?}");
                    }
                    let mut chosen = before;
                    add(is_signed, list, light, &mut chosen);
                    assert_eq!(chosen, plain, "{n}");
                    #[cfg(target_arch = "x86_64")]
                    {
                        let found = x86::add_by_every_kind(is_signed, list, light, before);
                        if found.is_empty() {
                            println!("skipped: this processor has no AVX2");
                        }
                        found.iter().for_each(|found| assert_eq!(*found, plain, "{n} {is_signed}"));
                    }
                }
            }
        }
    }

    #[test]
    #[should_panic(expected = "beyond the light")]
    fn no_entry_beyond_the_light() {
        let plane = [1i16; 20];
        let list = List { first: &[19], pairs: &[[[1; 2]; LANES]], steps: [1.0; 3] };
        add(false, list, [&plane; 3], &mut [[0.0; LANES]; 3]);
    }
}
