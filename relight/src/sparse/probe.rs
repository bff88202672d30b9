//! Some texels of a row, without unpacking the rest.
//!
//! The light that is 1 in one texel has few entries in any basis: one pulse, or with L levels 3 L + 1 wavelets and
//! their repetitions. Sorted by entry they are met in one walk along the runs of a row.

use super::{Basis, N_COARSE, Rows, TIER};
use crate::{cubemap, haar};

/// Which texels are asked for.
#[derive(Clone, Debug, Default)]
pub(crate) struct Probe {
    /// By [`Basis`], rising.
    lists: [Vec<Entry>; 3],
}

/// Part of a texel that an entry of a row is worth.
#[derive(Clone, Copy, Debug)]
struct Entry {
    at: u32,
    slot: u32,
    weight: f32,
}

impl Probe {
    /// Asks for these texels of an `n` x `n` x 6 cubemap. Allocates only for more than ever before.
    pub fn set(&mut self, n: usize, texels: impl Iterator<Item = usize>) {
        self.lists.iter_mut().for_each(Vec::clear);
        for (slot, texel) in texels.enumerate() {
            let (face, [column, row]) = cubemap::place(n, texel);
            let mut push = |basis: Basis, at: usize, weight: f32| {
                self.lists[basis as usize].push(Entry { at: at as u32, slot: slot as u32, weight });
            };
            push(Basis::Pulse, texel, 1.0);
            push(Basis::Columns, (face * n + column) * n + row, 1.0);
            let (all, n_means) = (cubemap::n_texels(n), haar::n_means(n));
            haar::for_each_of_texel(n, [column, row], |at, weight| {
                push(Basis::Haar, face * n * n + at, weight);
                if at < N_COARSE {
                    push(Basis::Haar, all + face * N_COARSE + at, weight * TIER);
                }
                if at < n_means {
                    push(Basis::Haar, all + 6 * N_COARSE + face * n_means + at, weight / TIER);
                }
            });
        }
        self.lists.iter_mut().for_each(|list| list.sort_unstable_by_key(|entry| (entry.at, entry.slot)));
    }
}

impl Rows<'_> {
    /// Whether row `v` has no texel.
    pub(crate) fn is_dark(&self, v: usize) -> bool {
        self.start[v] == self.start[v + 1]
    }

    /// Writes the texels of row `v` that `probe` asks for, steradians; `out` has one place for each.
    pub(crate) fn probe(&self, v: usize, probe: &Probe, out: &mut [f32]) {
        out.fill(0.0);
        let basis = self.basis[v];
        let list = &probe.lists[usize::from(basis)];
        let (mut next, mut at, mut from) = (0, 0, self.start[v] as usize);
        for &[gap, length] in &self.runs[self.first_run[v] as usize..self.first_run[v + 1] as usize] {
            at += usize::from(gap);
            let end = at + usize::from(length);
            while let Some(entry) = list.get(next)
                && (entry.at as usize) < end
            {
                if entry.at as usize >= at {
                    let byte = self.value[from + entry.at as usize - at];
                    let value =
                        if basis == Basis::Haar as u8 { f32::from(byte as i8) } else { f32::from(byte) };
                    out[entry.slot as usize] += value * entry.weight;
                }
                next += 1;
            }
            from += usize::from(length);
            at = end;
        }
        out.iter_mut().for_each(|value| *value *= self.scale[v]);
    }
}
