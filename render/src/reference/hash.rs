//! Random numbers from integer hashes, and point sets that fill the unit square evenly.
//!
//! *Correlated multi-jittered* points: sample i of n lies in a cell of its own of an about sqrt(n) x sqrt(n) grid, and
//! also in a row and a column of its own of n. Permutations come from a hash, so that any sample of any set can be had
//! without the others, in any order, on any thread.
//! Based on: Andrew Kensler, Correlated Multi-Jittered Sampling, Pixar Technical Memo 13-01, 2013.

use glam::Vec2;

/// Hash of a few numbers; every input bit moves every output bit.
pub(crate) fn mix<const N: usize>(parts: [u32; N]) -> u32 {
    parts.iter().fold(0x9e37_79b9, |h, part| scramble(h ^ scramble(part.wrapping_add(0x85eb_ca6b))))
}

/// Two numbers in 0..1 from a seed.
pub(crate) fn uniform_2d(seed: u32) -> Vec2 {
    let x = scramble(seed);
    Vec2::new(unit(x), unit(scramble(x ^ 0x51ab_3cd7)))
}

/// Sample `i` of a set of `n` points in 0..1 squared; another `pattern` is another, independent set.
pub(crate) fn stratified_2d(i: u32, n: u32, pattern: u32) -> Vec2 {
    let columns = n.isqrt().max(1);
    let rows = n.div_ceil(columns);
    let i = permute(i, n, mix([pattern, 0]));
    let column = permute(i % columns, columns, mix([pattern, 1]));
    let row = permute(i / columns, rows, mix([pattern, 2]));
    let jitter = uniform_2d(mix([pattern, 3, i]));
    let x = (column as f32 + (row as f32 + jitter.x) / rows as f32) / columns as f32;
    let y = (i as f32 + jitter.y) / n as f32;
    Vec2::new(x, y).min(Vec2::splat(ALMOST_ONE))
}

/// The largest float under 1.
const ALMOST_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// 24 bits as a number in 0..1.
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / (1u32 << 24) as f32
}

/// An integer finaliser of low bias. Based on: Chris Wellons, Hash Prospector, 2018 ("lowbias32").
fn scramble(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x7feb_352d);
    x = (x ^ (x >> 15)).wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Where `i` of 0..n goes in a permutation: an invertible hash of as many bits as n needs, repeated until it falls
/// under n, then a rotation, so that each place is as likely as any other also where n is small. Kensler's steps: each is
/// invertible modulo a power of two (xor with a constant, product with an odd number, xor with higher bits).
fn permute(i: u32, n: u32, seed: u32) -> u32 {
    let mask = n.next_power_of_two() - 1;
    let mut x = i;
    loop {
        x = (x ^ seed).wrapping_mul(0xe170_893d) ^ (seed >> 16);
        x ^= (x & mask) >> 4;
        x = (x ^ (seed >> 8)).wrapping_mul(0x0929_eb3f) ^ (seed >> 23);
        x ^= (x & mask) >> 1;
        x = x.wrapping_mul(1 | (seed >> 27)).wrapping_mul(0x6935_fa69);
        x ^= (x & mask) >> 11;
        x = x.wrapping_mul(0x74dc_b303);
        x ^= (x & mask) >> 2;
        x = x.wrapping_mul(0x9e50_1cc3);
        x ^= (x & mask) >> 2;
        x = x.wrapping_mul(0xc860_a3df) & mask;
        x ^= x >> 5;
        if x < n {
            return ((u64::from(x) + u64::from(scramble(seed ^ 0x3c6e_f372))) % u64::from(n)) as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn permutations_are_permutations() {
        for n in [1, 2, 3, 7, 16, 33, 100] {
            for seed in 0..20 {
                let mut seen: Vec<u32> = (0..n).map(|i| permute(i, n, seed)).collect();
                seen.sort_unstable();
                assert_eq!(seen, (0..n).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn stratified_points_fill_cells_rows_and_columns() {
        for pattern in 0..10 {
            let points: Vec<Vec2> = (0..64).map(|i| stratified_2d(i, 64, pattern)).collect();
            let distinct = |cell: &dyn Fn(&Vec2) -> (u32, u32)| {
                points.iter().map(cell).collect::<std::collections::HashSet<_>>().len()
            };
            assert_eq!(distinct(&|p| ((p.x * 8.0) as u32, (p.y * 8.0) as u32)), 64);
            assert_eq!(distinct(&|p| ((p.x * 64.0) as u32, 0)), 64);
            assert_eq!(distinct(&|p| (0, (p.y * 64.0) as u32)), 64);
        }
    }

    /// Over patterns, one sample of a set is uniform on the square, whatever n: chi-squared over an 8 x 8 grid.
    #[test]
    fn stratified_sample_is_uniform_over_patterns() {
        for (i, n) in [(0, 1), (3, 5), (12, 13), (7, 64)] {
            let mut counts = [0u32; 64];
            let total = 64_000;
            for pattern in 0..total {
                let p = stratified_2d(i, n, mix([pattern, 77]));
                counts[(p.x * 8.0) as usize * 8 + (p.y * 8.0) as usize] += 1;
            }
            let expected = f64::from(total) / 64.0;
            let chi: f64 = counts.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum();
            // 63 degrees of freedom: 103.4 is exceeded with probability 0.001.
            assert!(chi < 103.4, "sample {i} of {n}: chi-squared {chi}");
        }
    }

    /// Samples with one index in two patterns must be independent: a path uses them for its successive bounces.
    #[test]
    fn patterns_are_independent() {
        let mut counts = [0u32; 64];
        let total = 64_000;
        for k in 0..total {
            let (i, element) = (k % 16, k / 16);
            let a = stratified_2d(i, 16, mix([element, 0])).y;
            let b = stratified_2d(i, 16, mix([element, 1])).y;
            counts[(a * 8.0) as usize * 8 + (b * 8.0) as usize] += 1;
        }
        let expected = f64::from(total) / 64.0;
        let chi: f64 = counts.iter().map(|c| (f64::from(*c) - expected).powi(2) / expected).sum();
        assert!(chi < 103.4, "chi-squared {chi}");
    }
}
