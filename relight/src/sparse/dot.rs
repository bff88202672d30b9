//! E(v) += scale Σ value\[i\] L\[i\] over the runs of each row, three colours at once: the sums as they are defined,
//! and the choice of a faster implementation. All agree up to the rounding of f32.

use super::Basis;

/// Parts of some consecutive rows, checked by [`Rows`](super::Rows): the runs of a row add up to its values, are no
/// longer than [`LONGEST_RUN`](super::LONGEST_RUN), and the light goes on behind them by
/// [`PADDING`](super::light::PADDING) entries.
pub struct Slices<'a> {
    /// Rows + 1.
    pub start: &'a [u32],
    /// Rows + 1.
    pub first_run: &'a [u32],
    /// Of all rows.
    pub runs: &'a [[u8; 2]],
    /// Of all rows.
    pub value: &'a [u8],
    /// Per row.
    pub scale: &'a [f32],
    /// Per row.
    pub basis: &'a [u8],
}

/// Entries of the light by basis and colour.
pub type Planes<'a> = [[&'a [f32]; 3]; 3];

impl<'a> Slices<'a> {
    /// Runs and values of a row.
    #[inline(always)]
    pub fn row(&self, v: usize) -> (&'a [[u8; 2]], &'a [u8]) {
        let runs = &self.runs[self.first_run[v] as usize..self.first_run[v + 1] as usize];
        (runs, &self.value[self.start[v] as usize..self.start[v + 1] as usize])
    }
}

/// Adds the rows' dot products with the light to `out`.
pub fn add(rows: &Slices, light: Planes, out: &mut [[f32; 3]]) {
    #[cfg(target_arch = "x86_64")]
    if super::x86::add(rows, light, out) {
        return;
    }
    add_portable(rows, light, out);
}

/// For any processor.
pub fn add_portable(rows: &Slices, light: Planes, out: &mut [[f32; 3]]) {
    for (v, out) in out.iter_mut().enumerate() {
        let basis = rows.basis[v];
        let planes = light[usize::from(basis)];
        let sum = if basis == Basis::Haar as u8 {
            row(rows.row(v), planes, |byte| f32::from(byte as i8))
        } else {
            row(rows.row(v), planes, f32::from)
        };
        for (o, s) in out.iter_mut().zip(sum) {
            *o += rows.scale[v] * s;
        }
    }
}

/// Σ value L of one row.
#[inline(always)]
fn row((runs, mut values): (&[[u8; 2]], &[u8]), light: [&[f32]; 3], widen: impl Fn(u8) -> f32) -> [f32; 3] {
    let mut sums = [0.0; 3];
    let mut at = 0;
    for &[gap, length] in runs {
        at += usize::from(gap);
        let (run, rest) = values.split_at(usize::from(length));
        for (sum, light) in sums.iter_mut().zip(light) {
            for (byte, l) in run.iter().zip(&light[at..]) {
                *sum += widen(*byte) * l;
            }
        }
        at += run.len();
        values = rest;
    }
    sums
}
