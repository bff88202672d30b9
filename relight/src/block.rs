//! Rows in blocks of sixteen that read the same entries of the light.
//!
//! E(v) = scale(v) Σ_j value(share(j, v)) light\[entry(j)\] for the sixteen rows v of a block at once: an entry of the light
//! is read once for all of them, and its byte of each row lies beside those of the others, so that a sum is one vector
//! product per entry and colour whatever entries there are. Where rows have an entry that others lack, those hold a 0.
//!
//! A byte is a small float ([`value`]), four bits of exponent and four of fraction, which is the top of any larger float: no
//! conversion takes time.
//!
//! It is worth it where neighbours see the same: vertices go into blocks by where they lie and face ([`order`]), within
//! groups of [`GROUP`] consecutive ones, so that a frame may still be computed part by part. Where it breaks: of a mesh
//! whose vertices come in no order at all, sixteen neighbours within a group lie far apart and share little.

use glam::{Vec3, Vec4};

#[cfg(target_arch = "x86_64")]
mod x86;

/// Rows of a block.
pub const LANES: usize = 16;

/// Vertices of a group, from whose vertices a block is: parts of a frame are best computed by multiples of it, since a
/// block is computed whole.
pub const GROUP: usize = 1024;

/// Blocks of a group.
pub const BLOCKS: usize = GROUP / LANES;

/// In a block's list of rows: no row.
pub const NO_ROW: u16 = u16::MAX;

/// Largest value of a byte.
pub const LARGEST: f32 = 1.9375;

/// The lowest bit of a byte in a float of 32 bits, and what its exponent is less there than it should be.
const SHIFT: u32 = 19;
const BIAS: u32 = 112;

/// Bytes of blocks that are asked for before their turn: what a processor foresees by itself ends with each block.
#[cfg(target_arch = "x86_64")]
pub(crate) const AHEAD: usize = 3072;

/// By colour and row.
pub(crate) type Sums = [[f32; LANES]; 3];

/// What a byte stands for: 0, or with the exponent e = 1..=15 in its upper half and m in its lower, 2^(e - 15) (1 + m / 16),
/// up to [`LARGEST`]. What has no exponent but a fraction is no share.
pub fn value(byte: u8) -> f32 {
    f32::from_bits(u32::from(byte) << SHIFT) * f32::from_bits((127 + BIAS) << 23)
}

/// Whether [`byte`] ever gives this.
pub(crate) fn is_share(byte: u8) -> bool {
    byte == 0 || byte >= 16
}

/// The byte whose value is nearest to `x`.
pub fn byte(x: f32) -> u8 {
    // Half of the least.
    if x < 0.5 * value(16) {
        return 0;
    }
    let bits = (x.clamp(value(16), LARGEST).to_bits() + (1 << (SHIFT - 1))) >> SHIFT;
    (bits - (BIAS << (23 - SHIFT))).min(255) as u8
}

/// Some blocks.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blocks<'a> {
    /// Block b has the entries `start[b]..start[b + 1]`.
    pub start: &'a [u32],
    pub entry: &'a [u16],
    /// Of each entry, and of each row of the block.
    pub share: &'a [[u8; LANES]],
    /// Of each block.
    pub scale: &'a [[f32; LANES]],
}

impl Blocks<'_> {
    /// The sums of block `b` by colour and row, but for the rows' scale.
    ///
    /// # Panics
    /// When there is no such block, or an entry is not in the light.
    #[inline]
    pub fn sums(&self, b: usize, light: &[Vec4], sums: &mut Sums) {
        let range = self.start[b] as usize..self.start[b + 1] as usize;
        let (entries, shares) = (&self.entry[range.clone()], &self.share[range]);
        sums.as_flattened_mut().fill(0.0);
        #[cfg(target_arch = "x86_64")]
        if x86::add(entries, shares, light, sums) {
            return;
        }
        add_portable(entries, shares, light, sums);
    }
}

/// The vertex from which the rows of block `b` are counted.
pub(crate) fn first_row(b: usize) -> usize {
    b / BLOCKS * GROUP
}

/// Of `n_blocks`, those of the groups of `count` vertices from `first` on.
pub(crate) fn range(first: usize, count: usize, n_blocks: usize) -> std::ops::Range<usize> {
    first / GROUP * BLOCKS..((first + count).div_ceil(GROUP) * BLOCKS).min(n_blocks)
}

/// Adds the sums of a block times the scale of each row, those being counted from vertex `group`, to vertices from `first` on.
#[inline]
pub(crate) fn add_to(
    sums: &Sums,
    scale: &[f32; LANES],
    rows: &[u16; LANES],
    (group, first): (usize, usize),
    out: &mut [[f32; 3]],
) {
    let start = group.wrapping_sub(first);
    for (i, (&row, &scale)) in rows.iter().zip(scale).enumerate() {
        // Rows before the first wrap round to where there are none.
        if let Some([r, g, b]) = out.get_mut(start.wrapping_add(usize::from(row))) {
            *r += scale * sums[0][i];
            *g += scale * sums[1][i];
            *b += scale * sums[2][i];
        }
    }
}

/// The sums as they are defined, for any processor.
fn add_portable(entries: &[u16], shares: &[[u8; LANES]], light: &[Vec4], sums: &mut Sums) {
    for (entry, bytes) in entries.iter().zip(shares) {
        let values = bytes.map(value);
        let light = light[usize::from(*entry)].truncate().to_array();
        for (sums, l) in sums.iter_mut().zip(light) {
            sums.iter_mut().zip(&values).for_each(|(sum, value)| *sum += value * l);
        }
    }
}

/// The rows of each group in the order in which they go into blocks, counted within the group: by the side that a vertex
/// faces, and then along a curve that visits neighbours one after the other.
///
/// # Panics
/// When there are not as many normals as positions.
pub fn order(position: &[[f32; 3]], normal: &[[f32; 3]]) -> Vec<u16> {
    assert_eq!(position.len(), normal.len(), "one normal per vertex");
    let groups = position.chunks(GROUP).zip(normal.chunks(GROUP));
    groups.flat_map(|(position, normal)| order_group(position, normal)).collect()
}

fn order_group(position: &[[f32; 3]], normal: &[[f32; 3]]) -> Vec<u16> {
    const STEPS: f32 = 1023.0;
    let at = |v: usize| Vec3::from(position[v]);
    let low = (0..position.len()).map(at).fold(Vec3::INFINITY, Vec3::min);
    let high = (0..position.len()).map(at).fold(Vec3::NEG_INFINITY, Vec3::max);
    // Steps are as long in all directions.
    let step = ((high - low).max_element() / STEPS).max(f32::MIN_POSITIVE);
    let key = |v: u16| {
        let v = usize::from(v);
        let [x, y, z] = ((at(v) - low) / step).to_array().map(|x| spread(x as u32));
        let n = Vec3::from(normal[v]);
        let axis = if n.x.abs() >= n.y.abs().max(n.z.abs()) {
            0
        } else if n.y.abs() >= n.z.abs() {
            1
        } else {
            2
        };
        (axis, n[axis] < 0.0, x | y << 1 | z << 2)
    };
    let mut order: Vec<u16> = (0..position.len() as u16).collect();
    order.sort_by_cached_key(|&v| (key(v), v));
    order
}

/// The lowest ten bits, each followed by two zeros.
fn spread(x: u32) -> u32 {
    (0..10).fold(0, |all, bit| all | (x >> bit & 1) << (3 * bit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_small_floats() {
        assert_eq!((value(0), value(255), value(0xf0), value(0x18)), (0.0, LARGEST, 1.0, 1.5 / 16384.0));
        for b in (16..=255).chain([0]) {
            assert_eq!(byte(value(b)), b);
        }
        assert!((0..=255).all(|b| is_share(b) == (byte(value(b)) == b)));
        for i in 1..4000 {
            let x = i as f32 * 5e-4;
            let nearest = (0..=255).map(|b| (value(b) - x).abs()).fold(f32::MAX, f32::min);
            assert!((value(byte(x)) - x).abs() <= nearest * 1.0001, "{x}");
        }
        assert_eq!((byte(-1.0), byte(1e9), byte(1e-9)), (0, 255, 0));
    }

    #[test]
    fn every_instruction_set_agrees_with_the_portable_sum() {
        for strength in [1.0, 3e-9, 7e8] {
            let colour = |i: usize| Vec4::new((i as f32 * 0.3).sin(), 1.0 + i as f32, -(i as f32), 9.0);
            let light: Vec<Vec4> = (0..300).map(|i| strength * colour(i)).collect();
            for n in [0usize, 1, 2, 3, 8, 77, 1000] {
                let entries: Vec<u16> = (0..n).map(|i| (i * 37 % 300) as u16).collect();
                let share = |i: usize, lane: usize| match (i * 59 + lane * 31) as u8 {
                    low @ 0..16 => low / 15 * 16,
                    high => high,
                };
                let shares: Vec<[u8; LANES]> =
                    (0..n).map(|i| std::array::from_fn(|lane| share(i, lane))).collect();
                let before = [[2.0 * strength; LANES]; 3];
                let mut plain = before;
                add_portable(&entries, &shares, &light, &mut plain);
                assert!(n < 8 || plain.as_flattened().iter().any(|x| x.abs() > 5.0 * strength));
                #[cfg(target_arch = "x86_64")]
                let found = x86::add_by_every_kind(&entries, &shares, &light, before);
                #[cfg(not(target_arch = "x86_64"))]
                let found: Vec<Sums> = Vec::new();
                if found.is_empty() {
                    println!("skipped: this processor has no AVX2");
                }
                for found in found {
                    // Sums of n products, each rounded once or twice.
                    let largest = LARGEST * 300.0 * strength * n.max(1) as f32;
                    for (a, b) in found.as_flattened().iter().zip(plain.as_flattened()) {
                        assert!((a - b).abs() <= 1e-6 * largest, "{a} {b}, {n} entries");
                    }
                }
            }
        }
    }

    #[test]
    fn order_visits_each_once_and_neighbours_together() {
        // A floor and a wall of 40 x 40, vertices in rows.
        let (mut position, mut normal) = (Vec::new(), Vec::new());
        for i in 0..3200 {
            let [x, y] = [i % 1600 % 40, i % 1600 / 40].map(|x| x as f32);
            let is_floor = i < 1600;
            position.push(if is_floor { [x, 0.0, y] } else { [x, y, 0.0] });
            normal.push(if is_floor { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] });
        }
        let order = order(&position, &normal);
        let mut seen = vec![false; 3200];
        let rows: Vec<usize> =
            order.iter().enumerate().map(|(i, &row)| i / GROUP * GROUP + usize::from(row)).collect();
        rows.iter().for_each(|&v| assert!(!std::mem::replace(&mut seen[v], true), "{v} twice"));
        assert!(seen.iter().all(|s| *s));
        let widths: Vec<f32> = rows
            .chunks(LANES)
            .map(|block| {
                let at = |&v: &usize| Vec3::from(position[v]);
                let low = block.iter().map(at).fold(Vec3::INFINITY, Vec3::min);
                let high = block.iter().map(at).fold(Vec3::NEG_INFINITY, Vec3::max);
                (high - low).length()
            })
            .collect();
        // In rows they would be 15 wide; a square of 4 x 4 is 4.2.
        let mean = widths.iter().sum::<f32>() / widths.len() as f32;
        assert!(mean < 9.0, "{mean}");
    }

    #[test]
    fn sums_reach_the_rows_that_are_asked_for() {
        let sums = [[1.0; LANES]; 3];
        let mut rows = [NO_ROW; LANES];
        rows[..4].copy_from_slice(&[0, 5, 6, 9]);
        let mut out = [[0.0; 3]; 3];
        // Vertices 1029 to 1031 are rows 5 to 7 of the second group.
        add_to(&sums, &[0.5; LANES], &rows, (GROUP, 1029), &mut out);
        assert_eq!(out, [[0.5; 3], [0.5; 3], [0.0; 3]]);
    }
}
