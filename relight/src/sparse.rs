//! Sparse 8-bit transfer rows on a cubemap, in pulses or in Haar wavelets, the smaller per vertex.
//!
//! E(v) = Σ T\[t\] L\[t\] over the 6 N² texels of a shell, T in steradians (solid angle times cosine times
//! visibility), L the light's average radiance per texel. A row is stored as runs of neighbouring coefficients, one
//! byte each, times the row's scale:
//!
//! | basis | coefficient p | byte |
//! |---|---|---|
//! | `pulse` (0) | texel p | 0..=255 |
//! | `pulse` down columns (2) | texel p of faces stored column by column | 0..=255 |
//! | `haar` (1) | p < 6 N²: coefficient p of [`haar`], face after face | two's complement, -128..=127 |
//! | | next 6 x 16: the first 16 coefficients of each face again, times 128 | |
//! | | next 6 x M: the M last means of each face again, divided by 128 | |
//!
//! A mean is a hundred times a detail in one row and a hundredth of it in the next: the repeated entries give the
//! few coarse coefficients as many bits as they need without costing the many fine ones theirs.
//!
//! Tensors under a prefix such as `portal.0.direct` or `sky.direct` (V vertices, R runs, B bytes):
//!
//! | name | type | |
//! |---|---|---|
//! | `.resolution` | u32 \[1\] | N |
//! | `.start` | u32 \[V+1\] | row v has the bytes `value[start[v]..start[v+1]]` |
//! | `.index` | u8 \[R,2\] | runs of all rows: coefficients skipped since the last run (since 0 in a row's first), length (0 to 16); a row has runs until their lengths add up to its bytes; (255, 0) only skips |
//! | `.value` | u8 \[B\] | |
//! | `.scale` | f32 \[V\] | |
//! | `.basis` | u8 \[V\] | |
//!
//! Rounding errors are carried along a pulse row and the scale is set last, so that the row's sum, the irradiance
//! under a uniform light, is kept to the rounding of f32.
//!
//! Where it breaks: a texel of less than a 255th of the row's largest is told from nothing only by carrying; a Haar
//! row may give a little negative light.
//!
//! Based on: Yue, Iwasaki, Chen, Dobashi and Nishita, Interactive Rendering of Interior Scenes with Dynamic
//! Environment Illumination, 2009.

mod decode;
mod dot;
mod encode;
mod fixed;
mod light;
mod pairs;
mod probe;
mod rows;
mod store;
#[cfg(test)]
mod tests;
mod together;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use decode::decode;
pub use encode::{Choice, Encoder, Encoding, Row};
pub use light::SparseLight;
pub(crate) use probe::Probe;
pub use rows::Rows;
pub use store::{RowStore, TooLarge};
pub(crate) use together::Together;

use crate::{cubemap, haar};

/// Which functions a row is a sum of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Basis {
    /// Texels.
    #[default]
    Pulse = 0,
    /// Haar wavelets per face.
    Haar = 1,
    /// Texels, each face column by column: fewer runs for what is taller than wide.
    Columns = 2,
}

impl Basis {
    /// The basis that has this number in a file.
    fn from_byte(byte: u8) -> Option<Basis> {
        [Basis::Pulse, Basis::Haar, Basis::Columns].into_iter().find(|b| *b as u8 == byte)
    }
}

/// Coarse coefficients per face that have a second entry with a larger step.
const N_COARSE: usize = 16;

/// Ratio of the steps of entries for the same coefficient: with seven of eight bits new, no gap between them.
const TIER: f32 = 128.0;

/// Coefficients skipped by the entry (255, 0).
const LONGEST_GAP: usize = 255;

/// Values of a run: one vector's worth, so that the dot product has no inner loop whose end it would have to guess.
const LONGEST_RUN: usize = 16;

/// Entries of a Haar row: plain, large steps, small steps.
fn n_haar_entries(n: usize) -> usize {
    cubemap::n_texels(n) + 6 * N_COARSE + 6 * haar::n_means(n)
}

/// Entries that a row of this basis may have.
fn n_entries(basis: Basis, n: usize) -> usize {
    match basis {
        Basis::Pulse | Basis::Columns => cubemap::n_texels(n),
        Basis::Haar => n_haar_entries(n),
    }
}

/// Turns each face's rows into columns and back.
fn transpose<T: Copy>(n: usize, from: &[T], to: &mut [T]) {
    for (from, to) in from.chunks_exact(n * n).zip(to.chunks_exact_mut(n * n)) {
        for (column, to) in to.chunks_exact_mut(n).enumerate() {
            for (to, from) in to.iter_mut().zip(from[column..].iter().step_by(n)) {
                *to = *from;
            }
        }
    }
}
