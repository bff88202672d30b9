//! The rows of an asset in blocks of neighbours ([`block`](crate::block)), for a frame.
//!
//! A row of its own is some twenty short runs, each a vector of which a part is used; sixteen neighbours, which see the
//! same window, have nearly the same entries, and read them two by two ([`pairs`]). A group of vertices stays in rows where
//! that would cost less, since neighbours share little. The file knows nothing of blocks.

use super::decode::for_each_entry;
use super::fixed::WHOLE;
use super::light::sections;
use super::pairs::{self, List, Pair};
use super::{Basis, Rows, SparseLight, n_haar_entries};
use crate::block::{self, GROUP, LANES, NO_ROW, Sums};

/// What a row costs beside its runs, what a run does, and a pair of entries of a block, by a measurement of each; in turns of
/// an AVX-512 unit.
const ROW: usize = 8;
const RUN: usize = 3;
const PAIR: usize = 3;

/// Rows in blocks, where that is worth it.
pub(crate) struct Together {
    /// Whether each group is in blocks.
    is_blocked: Vec<bool>,
    kinds: [Kind; 2],
}

/// The blocks of rows whose bytes mean the same.
struct Kind {
    is_haar: bool,
    /// Where sections of entries end; a block has a list of pairs in each.
    ends: Vec<usize>,
    /// Group g has the blocks `group[g]..group[g + 1]`.
    group: Vec<u32>,
    rows: Vec<[u16; LANES]>,
    scale: Vec<[f32; LANES]>,
    /// List i, of block i / sections, has the pairs `start[i]..start[i + 1]`.
    start: Vec<u32>,
    /// Of each pair its first entry, and the bytes.
    first: Vec<u16>,
    pairs: Vec<Pair>,
}

impl Together {
    /// Of rows whose vertices go into blocks in the [`order`](crate::block::order).
    pub fn new(rows: &Rows, order: &[u16]) -> Together {
        let kinds = [false, true].map(|is_haar| Kind::new(rows.n(), is_haar));
        let mut together = Together { is_blocked: Vec::new(), kinds };
        let mut union = Union::new(rows.n());
        for (g, order) in order.chunks(GROUP).enumerate() {
            together.add_group(rows, g * GROUP, order, &mut union);
        }
        together
    }

    fn add_group(&mut self, rows: &Rows, first: usize, order: &[u16], union: &mut Union) {
        let before = self.kinds.each_ref().map(|kind| kind.rows.len());
        let mut cost = 0;
        for kind in &mut self.kinds {
            let has_some = |row: &&u16| {
                let v = first + usize::from(**row);
                rows.start[v] < rows.start[v + 1] && (rows.basis(v) == Basis::Haar) == kind.is_haar
            };
            let list: Vec<u16> = order.iter().filter(has_some).copied().collect();
            for list in list.chunks(LANES) {
                cost += PAIR * kind.push(rows, first, list, union) + ROW * LANES / 2;
            }
        }
        let runs = rows.first_run[first + order.len()] - rows.first_run[first];
        let is_blocked = cost < RUN * runs as usize + ROW * order.len();
        if !is_blocked {
            self.kinds.iter_mut().zip(before).for_each(|(kind, before)| kind.truncate(before));
        }
        self.is_blocked.push(is_blocked);
        self.kinds.iter_mut().for_each(|kind| kind.group.push(kind.rows.len() as u32));
    }

    /// What a frame reads: of rows in blocks their pairs, zeros too, and what each block has beside them.
    pub fn bytes(&self, rows: &Rows) -> usize {
        let of_kind = |kind: &Kind| {
            size_of_val(&kind.pairs[..])
                + size_of_val(&kind.first[..])
                + size_of_val(&kind.start[..])
                + size_of_val(&kind.rows[..])
                + size_of_val(&kind.scale[..])
        };
        let apart = (0..self.is_blocked.len()).filter(|g| !self.is_blocked[*g]);
        let in_rows = apart.map(|g| rows.bytes_of(g * GROUP..rows.n_rows().min((g + 1) * GROUP)));
        self.kinds.iter().map(of_kind).sum::<usize>() + in_rows.sum::<usize>()
    }

    /// As [`Rows::add`], of the rows that this was made of; best by multiples of [`GROUP`].
    ///
    /// # Panics
    /// As [`Rows::add`].
    pub fn add(&self, rows: &Rows, first: usize, light: &SparseLight, out: &mut [[f32; 3]]) {
        let end = first + out.len();
        for g in first / GROUP..end.div_ceil(GROUP) {
            if self.is_blocked[g] {
                self.kinds.iter().for_each(|kind| kind.add(g, first, light, out));
            } else {
                let (from, to) = (first.max(g * GROUP), end.min((g + 1) * GROUP));
                rows.add(from, light, &mut out[from - first..to - first]);
            }
        }
    }
}

impl Kind {
    fn new(n: usize, is_haar: bool) -> Kind {
        Kind {
            is_haar,
            ends: sections(n, is_haar),
            group: vec![0],
            rows: Vec::new(),
            scale: Vec::new(),
            start: vec![0],
            first: Vec::new(),
            pairs: Vec::new(),
        }
    }

    /// A block more, of up to sixteen rows; its pairs.
    fn push(&mut self, rows: &Rows, first: usize, list: &[u16], union: &mut Union) -> usize {
        let (mut members, mut scale) = ([NO_ROW; LANES], [0.0; LANES]);
        for (lane, &row) in list.iter().enumerate() {
            let v = first + usize::from(row);
            (members[lane], scale[lane]) = (row, rows.scale[v]);
            rows.each(v, |entry, byte| union.set(entry, lane, byte));
        }
        let before = self.pairs.len();
        let list = union.sorted();
        let mut entries = list.iter().peekable();
        for &end in &self.ends {
            while let Some((entry, bytes)) = entries.next_if(|(entry, _)| usize::from(*entry) < end) {
                let is_next = |e: &u16| *e == entry + 1 && usize::from(*e) < end;
                let next = entries.next_if(|(e, _)| is_next(e)).map_or([0; LANES], |(_, bytes)| *bytes);
                self.first.push(*entry);
                self.pairs.push(std::array::from_fn(|lane| [bytes[lane], next[lane]]));
            }
            self.start.push(self.pairs.len() as u32);
        }
        union.clear();
        self.rows.push(members);
        self.scale.push(scale);
        self.pairs.len() - before
    }

    fn truncate(&mut self, n_blocks: usize) {
        self.rows.truncate(n_blocks);
        self.scale.truncate(n_blocks);
        self.start.truncate(n_blocks * self.ends.len() + 1);
        let n = self.start.last().map_or(0, |end| *end as usize);
        self.first.truncate(n);
        self.pairs.truncate(n);
    }

    fn add(&self, g: usize, first: usize, light: &SparseLight, out: &mut [[f32; 3]]) {
        let mut sums = [[0.0; LANES]; 3];
        for b in self.group[g] as usize..self.group[g + 1] as usize {
            self.sums(b, light, &mut sums);
            block::add_to(&sums, &self.scale[b], &self.rows[b], (g * GROUP, first), out);
        }
    }

    /// The products of a block's rows with the light, but for their scale.
    fn sums(&self, b: usize, light: &SparseLight, all: &mut Sums) {
        let light = light.fixed(self.is_haar);
        let (coarse, rest) = light.parts();
        all.as_flattened_mut().fill(0.0);
        for section in 0..self.ends.len() {
            let list = b * self.ends.len() + section;
            let range = self.start[list] as usize..self.start[list + 1] as usize;
            if range.is_empty() {
                continue;
            }
            let steps = light.steps(section);
            let list = List { first: &self.first[range.clone()], pairs: &self.pairs[range], steps };
            pairs::add(self.is_haar, list, coarse, all);
            if let Some(rest) = rest {
                let steps = steps.map(|step| step / WHOLE);
                pairs::add(self.is_haar, List { steps, ..list }, rest, all);
            }
        }
    }
}

impl Rows<'_> {
    /// Each entry of row `v` that is not 0, columns by their texels, and its byte.
    fn each(&self, v: usize, mut take: impl FnMut(usize, u8)) {
        let n = self.n();
        let is_columns = self.basis(v) == Basis::Columns;
        let runs = &self.runs[self.first_run[v] as usize..self.first_run[v + 1] as usize];
        let values = &self.value[self.start[v] as usize..self.start[v + 1] as usize];
        for_each_entry(runs, values, |p, byte| {
            let texel = if is_columns { p / (n * n) * n * n + p % n * n + p % (n * n) / n } else { p };
            if byte != 0 {
                take(texel, byte);
            }
        });
    }
}

/// The entries of some rows together.
struct Union {
    /// 1 + the place of each entry in the list, of texels or of the more there are of a Haar row; 0: none.
    place: Vec<u16>,
    list: Vec<(u16, [u8; LANES])>,
}

impl Union {
    fn new(n: usize) -> Union {
        Union { place: vec![0; n_haar_entries(n)], list: Vec::new() }
    }

    fn set(&mut self, entry: usize, lane: usize, byte: u8) {
        if self.place[entry] == 0 {
            self.list.push((entry as u16, [0; LANES]));
            self.place[entry] = self.list.len() as u16;
        }
        self.list[usize::from(self.place[entry]) - 1].1[lane] = byte;
    }

    /// All, by rising entries.
    fn sorted(&mut self) -> &[(u16, [u8; LANES])] {
        self.list.sort_unstable_by_key(|(entry, _)| *entry);
        &self.list
    }

    fn clear(&mut self) {
        for (entry, _) in self.list.drain(..) {
            self.place[usize::from(entry)] = 0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::{Asset, Data, Metadata};
    use crate::cubemap;
    use crate::sparse::{Choice, Encoder, Encoding, RowStore};

    #[test]
    fn blocks_add_what_rows_do() {
        const N: usize = 16;
        const V: usize = 2 * GROUP + 37;
        let choices = [Choice::Smaller, Choice::Only(Basis::Pulse), Choice::Only(Basis::Haar)];
        let mut encoders = choices.map(|choice| Encoder::new(N, Encoding { choice, ..Encoding::default() }));
        let mut store = RowStore::default();
        for v in 0..V {
            // A window, tall or wide, that moves with the vertex; some see none of it. In the last group each sees some texels of
            // its own.
            let (x, y) = (v % 5 + v / 300, v % 3);
            let mut row = vec![0.0; cubemap::n_texels(N)];
            let inside = |t: usize| match v / GROUP {
                2 => t / 32 == 2 * (v % 24),
                _ if v % 11 == 0 => false,
                _ => t / (N * N) == 2 && (x..x + 3).contains(&(t % N)) && (y..y + 9).contains(&(t / N % N)),
            };
            let worth = |t: usize| if inside(t) { 0.01 + 0.001 * ((t * 7 + v) % 9) as f32 } else { 0.0 };
            row.iter_mut().enumerate().for_each(|(t, r)| *r = worth(t));
            store.push(&encoders[v % 3].encode(&row));
        }
        let mut asset = Asset::new(Metadata::new("room"));
        asset.insert("mesh.position", &[V, 3], Data::F32(vec![0.0; 3 * V].into()));
        store.insert_into(&mut asset, "portal.0.direct", N).unwrap();
        let rows = Rows::open(&asset, "portal.0.direct").unwrap().unwrap();
        let position: Vec<[f32; 3]> =
            (0..V).map(|v| [(v % 5) as f32, (v % 3) as f32, (v / 300) as f32]).collect();
        let order = block::order(&position, &vec![[0.0, 1.0, 0.0]; V]);
        let together = Together::new(&rows, &order);
        assert_eq!(together.is_blocked, [true, true, false], "windows in blocks, what is not shared in rows");
        assert!(together.kinds.iter().all(|kind| !kind.rows.is_empty()), "both kinds");
        let mut light = SparseLight::new(N);
        let texels: Vec<[f32; 3]> =
            (0..cubemap::n_texels(N)).map(|t| [1.0 + (t % 13) as f32, (t % 7) as f32, 0.5]).collect();
        // And with a texel of which most rows see nothing, bright enough to drown all others in 16 bits.
        let mut glaring = texels.clone();
        glaring[2 * N * N] = [1e5; 3];
        for (texels, tolerance) in [(&texels, 3e-5), (&glaring, 1e-6)] {
            light.set(texels);
            for (first, count) in
                [(0, V), (5, 20), (GROUP - 3, 9), (GROUP, GROUP), (2 * GROUP - 1, 38), (V, 0)]
            {
                let (mut expected, mut found) = (vec![[0.25; 3]; count], vec![[0.25; 3]; count]);
                rows.add_portable(first, &light, &mut expected);
                together.add(&rows, first, &light, &mut found);
                let largest = light_of(texels);
                for (a, b) in found.iter().flatten().zip(expected.iter().flatten()) {
                    // Each entry is rounded to half a step of 1/32767 of the largest, or to 32 bits; then a row of up to 27
                    // texels of 0.02 steradians by rounding of its sum.
                    assert!((a - b).abs() <= tolerance * 0.5 * largest, "{a} {b}, from {first}");
                }
            }
        }
    }

    fn light_of(texels: &[[f32; 3]]) -> f32 {
        texels.iter().flatten().fold(0.0, |a, x| a.max(*x))
    }
}
