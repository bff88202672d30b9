//! Rows in blocks of sixteen that read the same entries of the light.
//!
//! E(v) = scale(v) Σ_j value(j, v) light\[entry(j)\] for the sixteen rows v of a block at once: an entry of the light is
//! read once for all of them, and its byte of each row lies beside those of the others, so that a sum is one vector
//! product per entry and colour whatever entries there are. Where rows have an entry that others lack, those hold a 0.
//!
//! It is worth it where neighbours see the same: vertices go into blocks by where they lie and face ([`order`]), within
//! groups of [`GROUP`] consecutive ones, so that a frame may still be computed part by part. Where it breaks: of a mesh
//! whose vertices come in no order at all, sixteen neighbours within a group lie far apart and share little.

use std::borrow::Cow;

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

/// What a byte stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Value {
    /// 0..=255.
    Unsigned,
    /// -128..=127.
    Signed,
    /// The square of 0..=255.
    Square,
}

/// Some blocks.
#[derive(Clone, Debug)]
pub(crate) struct Blocks<'a> {
    pub value_of_byte: Value,
    /// Block b has the entries `start[b]..start[b + 1]`.
    pub start: Cow<'a, [u32]>,
    pub entry: Cow<'a, [u16]>,
    /// Of each entry, and of each row of the block.
    pub value: Cow<'a, [[u8; LANES]]>,
    /// Of each block.
    pub scale: Cow<'a, [[f32; LANES]]>,
}

impl Blocks<'_> {
    /// The sums of block `b` by colour and row.
    ///
    /// # Panics
    /// When there is no such block, or an entry is not in the light.
    pub fn sums(&self, b: usize, light: &[Vec4]) -> [[f32; LANES]; 3] {
        let (entries, values) = self.block(b);
        #[cfg(target_arch = "x86_64")]
        if let Some(sums) = x86::sums(self.value_of_byte, entries, values, light) {
            return scaled(sums, &self.scale[b]);
        }
        scaled(portable(self.value_of_byte, entries, values, light), &self.scale[b])
    }

    /// Entries and values of a block.
    pub fn block(&self, b: usize) -> (&[u16], &[[u8; LANES]]) {
        let range = self.start[b] as usize..self.start[b + 1] as usize;
        (&self.entry[range.clone()], &self.value[range])
    }
}

fn scaled(mut sums: [[f32; LANES]; 3], scale: &[f32; LANES]) -> [[f32; LANES]; 3] {
    for colour in &mut sums {
        colour.iter_mut().zip(scale).for_each(|(sum, scale)| *sum *= scale);
    }
    sums
}

/// The vertex from which the rows of block `b` are counted.
pub(crate) fn first_row(b: usize) -> usize {
    b / BLOCKS * GROUP
}

/// Of `n_blocks`, those of the groups of `count` vertices from `first` on.
pub(crate) fn range(first: usize, count: usize, n_blocks: usize) -> std::ops::Range<usize> {
    first / GROUP * BLOCKS..((first + count).div_ceil(GROUP) * BLOCKS).min(n_blocks)
}

/// Adds the sums of a block whose rows are counted from vertex `group` to vertices from `first` on.
#[inline]
pub(crate) fn add_to(
    sums: &[[f32; LANES]; 3],
    rows: &[u16; LANES],
    group: usize,
    first: usize,
    out: &mut [[f32; 3]],
) {
    for (i, &row) in rows.iter().enumerate() {
        // Rows before the first wrap round to where there are none.
        if let Some(out) = out.get_mut((group + usize::from(row)).wrapping_sub(first)) {
            out.iter_mut().zip(sums).for_each(|(out, sums)| *out += sums[i]);
        }
    }
}

/// The sums as they are defined, for any processor.
fn portable(of: Value, entries: &[u16], values: &[[u8; LANES]], light: &[Vec4]) -> [[f32; LANES]; 3] {
    let mut sums = [[0.0; LANES]; 3];
    for (entry, bytes) in entries.iter().zip(values) {
        let value = match of {
            Value::Unsigned => bytes.map(f32::from),
            Value::Signed => bytes.map(|byte| f32::from(byte as i8)),
            Value::Square => bytes.map(|byte| f32::from(byte) * f32::from(byte)),
        };
        let light = light[usize::from(*entry)].truncate().to_array();
        for (sums, l) in sums.iter_mut().zip(light) {
            sums.iter_mut().zip(&value).for_each(|(sum, value)| *sum += value * l);
        }
    }
    sums
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
    fn every_instruction_set_agrees_with_the_portable_sum() {
        let light: Vec<Vec4> =
            (0..300).map(|i| Vec4::new((i as f32 * 0.3).sin(), 1.0 + i as f32, -(i as f32), 9.0)).collect();
        for n in [0usize, 1, 2, 3, 8, 77] {
            let entries: Vec<u16> = (0..n).map(|i| (i * 37 % 300) as u16).collect();
            let values: Vec<[u8; LANES]> =
                (0..n).map(|i| std::array::from_fn(|lane| (i * 59 + lane * 31) as u8)).collect();
            for of in [Value::Unsigned, Value::Signed, Value::Square] {
                let plain = portable(of, &entries, &values, &light);
                assert!(
                    n == 0 || plain.as_flattened().iter().any(|x| x.abs() > 10.0),
                    "something to compare"
                );
                // Sums of n products, each rounded once or twice.
                let largest = if of == Value::Square { 65025.0 } else { 255.0 } * 300.0 * n as f32;
                let close = |found: &[[f32; LANES]; 3]| {
                    for (a, b) in found.as_flattened().iter().zip(plain.as_flattened()) {
                        assert!((a - b).abs() <= 1e-6 * largest, "{a} {b}, {n} entries, {of:?}");
                    }
                };
                #[cfg(target_arch = "x86_64")]
                match x86::sums_of_every_kind(of, &entries, &values, &light) {
                    found if found.is_empty() => println!("skipped: this processor has no AVX2"),
                    found => found.iter().for_each(close),
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
        add_to(&sums, &rows, GROUP, 1029, &mut out);
        assert_eq!(out, [[1.0; 3], [1.0; 3], [0.0; 3]]);
    }
}
