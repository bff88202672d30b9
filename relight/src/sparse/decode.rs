//! From bytes back to a dense row.

use super::{Basis, N_COARSE, Row, TIER, n_entries, transpose};
use crate::{cubemap, haar};

/// The 6 n² texels of a row, steradians. For work that is done once: it allocates.
pub fn decode(n: usize, row: &Row) -> Vec<f32> {
    let mut entries = entries(n, row);
    match row.basis {
        Basis::Pulse => entries,
        Basis::Columns => {
            let mut rows = entries.clone();
            transpose(n, &entries, &mut rows);
            rows
        }
        Basis::Haar => {
            let (face, all, means) = (n * n, cubemap::n_texels(n), haar::n_means(n));
            for f in 0..6 {
                for i in 0..N_COARSE {
                    entries[f * face + i] += TIER * entries[all + f * N_COARSE + i];
                }
                for i in 0..means {
                    entries[f * face + i] += entries[all + 6 * N_COARSE + f * means + i] / TIER;
                }
            }
            let (mut scratch, mut out) = (vec![0.0; face], vec![0.0; all]);
            for (c, out) in entries[..all].chunks_exact(face).zip(out.chunks_exact_mut(face)) {
                haar::inverse(n, c, &mut scratch, out);
            }
            out
        }
    }
}

/// All entries of a row as its runs have them; what a broken row has beyond its basis is left out.
fn entries(n: usize, row: &Row) -> Vec<f32> {
    let mut entries = vec![0.0f32; n_entries(row.basis, n)];
    for_each_entry(&row.runs, &row.values, |at, byte| {
        let q = if row.basis == Basis::Haar { f32::from(byte as i8) } else { f32::from(byte) };
        if let Some(entry) = entries.get_mut(at) {
            *entry = q * row.scale;
        }
    });
    entries
}

/// Calls `met` with each entry in a row's runs and its byte.
pub(super) fn for_each_entry(runs: &[[u8; 2]], values: &[u8], mut met: impl FnMut(usize, u8)) {
    let (mut at, mut values) = (0, values.iter());
    for [gap, length] in runs {
        at += usize::from(*gap);
        for byte in values.by_ref().take(usize::from(*length)) {
            met(at, *byte);
            at += 1;
        }
    }
}
