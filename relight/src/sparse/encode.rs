//! From a dense row to bytes.

use super::{Basis, LONGEST_GAP, LONGEST_RUN, N_COARSE, TIER, n_haar_entries, transpose};
use crate::{cubemap, haar};

/// How rows are encoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoding {
    /// Share of a Haar row that may be dropped: √(Σ dropped² / Σ all²) over its coefficients, the expected relative
    /// error under light that differs in every texel. Costs bytes: 0.01 is three to five times smaller than 0.
    /// Rounding to 8 bits comes on top, in both bases.
    pub tolerance: f32,
    /// Which basis.
    pub choice: Choice,
}

/// Which basis a row is encoded in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The one that takes fewer bytes.
    #[default]
    Smaller,
    /// Always this one; of [`Basis::Pulse`] the smaller of its two orders.
    Only(Basis),
}

impl Default for Encoding {
    fn default() -> Self {
        Encoding { tolerance: 0.01, choice: Choice::Smaller }
    }
}

/// One encoded row; see [`sparse`](super) for the meaning of runs and values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// What the values are coefficients of.
    pub basis: Basis,
    /// One step of a value, steradians.
    pub scale: f32,
    /// Skipped and following coefficients.
    pub runs: Vec<[u8; 2]>,
    /// As many as the runs say.
    pub values: Vec<u8>,
    /// What encoding cost: √(Σ (stored - given)² / Σ given²) over the texels; 0 for an empty row.
    pub error: f32,
}

impl Row {
    /// Bytes in the file: runs, values, and nine for start, scale and basis.
    pub fn bytes(&self) -> usize {
        2 * self.runs.len() + self.values.len() + 9
    }
}

/// Encodes rows of one resolution; keeps its scratch space from row to row (one per thread).
#[derive(Clone, Debug)]
pub struct Encoder {
    n: usize,
    /// Of the rows to come.
    pub encoding: Encoding,
    coefficients: Vec<f32>,
    scratch: Vec<f32>,
    order: Vec<u32>,
    steps: Vec<i32>,
}

impl Encoder {
    /// For rows of 6 n² texels.
    ///
    /// # Panics
    /// When `n` is not in [`cubemap::RESOLUTIONS`].
    pub fn new(n: usize, encoding: Encoding) -> Encoder {
        assert!(cubemap::RESOLUTIONS.contains(&n), "a cubemap has 8 to 64 texels on a side, not {n}");
        Encoder {
            n,
            encoding,
            coefficients: vec![0.0; cubemap::n_texels(n)],
            scratch: vec![0.0; n * n],
            order: Vec::new(),
            steps: vec![0; n_haar_entries(n)],
        }
    }

    /// Encodes a row of 6 n² texels, each finite and not negative, steradians.
    ///
    /// # Panics
    /// When the row has another length.
    pub fn encode(&mut self, row: &[f32]) -> Row {
        assert_eq!(row.len(), cubemap::n_texels(self.n), "a row has one value per texel");
        let square = sum(row.iter().map(|x| x * x));
        if square == 0.0 {
            return Row::default();
        }
        match self.encoding.choice {
            Choice::Only(Basis::Pulse) => self.either_pulse(row, square),
            Choice::Only(Basis::Columns) => self.columns(row, square),
            Choice::Only(Basis::Haar) => self.haar(row, square),
            Choice::Smaller => {
                let (pulse, haar) = (self.either_pulse(row, square), self.haar(row, square));
                if haar.bytes() < pulse.bytes() { haar } else { pulse }
            }
        }
    }

    fn either_pulse(&mut self, row: &[f32], square: f64) -> Row {
        let (rows, columns) = (self.pulse(Basis::Pulse, row, square), self.columns(row, square));
        if columns.bytes() < rows.bytes() { columns } else { rows }
    }

    fn columns(&mut self, row: &[f32], square: f64) -> Row {
        let mut turned = std::mem::take(&mut self.coefficients);
        transpose(self.n, row, &mut turned);
        let encoded = self.pulse(Basis::Columns, &turned, square);
        self.coefficients = turned;
        encoded
    }

    /// The largest texel becomes 255; the rounding error of each goes on to the next lit one.
    fn pulse(&mut self, basis: Basis, row: &[f32], square: f64) -> Row {
        let step = row.iter().fold(0.0f32, |a, x| a.max(*x)) / 255.0;
        let mut carry = 0.0f32;
        let steps = &mut self.steps[..row.len()];
        for (q, x) in steps.iter_mut().zip(row) {
            *q = 0;
            if *x > 0.0 {
                let wanted = x / step + carry;
                // The carry is at least -1/2, so that cutting off rounds.
                *q = ((wanted + 0.5) as i32).min(255);
                carry = wanted - *q as f32;
            }
        }
        let total = steps.iter().map(|q| f64::from(*q)).sum::<f64>();
        let scale = (sum(row.iter().copied()) / total) as f32;
        let error = sum(row.iter().zip(steps.iter()).map(|(x, q)| (x - scale * *q as f32).powi(2)));
        finish(basis, scale, steps, error, square)
    }

    fn haar(&mut self, row: &[f32], square: f64) -> Row {
        let face = self.n * self.n;
        for (texels, out) in row.chunks_exact(face).zip(self.coefficients.chunks_exact_mut(face)) {
            if texels.iter().any(|x| *x != 0.0) {
                haar::forward(self.n, texels, &mut self.scratch, out);
            } else {
                out.fill(0.0);
            }
        }
        let dropped = self.drop_small(square);
        let step = self.step();
        self.quantise(step);
        let error = self.rounding_error(step) + dropped;
        finish(Basis::Haar, step * self.sum_correction(row, step), &self.steps, error, square)
    }

    /// Sets the smallest coefficients to 0 and gives the sum of their squares. Means stay: they are the row's sum.
    fn drop_small(&mut self, square: f64) -> f64 {
        let (face, n_means) = (self.n * self.n, haar::n_means(self.n));
        let c = &mut self.coefficients;
        self.order.clear();
        self.order
            .extend((0..c.len() as u32).filter(|&i| c[i as usize] != 0.0 && i as usize % face >= n_means));
        self.order
            .sort_unstable_by(|&i, &j| c[i as usize].abs().total_cmp(&c[j as usize].abs()).then(i.cmp(&j)));
        let allowed = f64::from(self.encoding.tolerance).powi(2) * square;
        let mut dropped = 0.0;
        for &i in &self.order {
            let more = f64::from(c[i as usize]).powi(2);
            if dropped + more > allowed {
                break;
            }
            dropped += more;
            c[i as usize] = 0.0;
        }
        dropped
    }

    /// The smallest step with which every coefficient fits: fine ones into 7 bits and a sign, coarse ones into 14.
    fn step(&self) -> f32 {
        let largest_coarse = 127.0 * TIER + 0.5 * TIER - 1.0;
        let mut step = 0.0f32;
        for face in self.coefficients.chunks_exact(self.n * self.n) {
            let largest = |c: &[f32]| c.iter().fold(0.0f32, |a, x| a.max(x.abs()));
            step =
                step.max(largest(&face[..N_COARSE]) / largest_coarse).max(largest(&face[N_COARSE..]) / 127.0);
        }
        step
    }

    /// Fills `steps` with the bytes of all entries.
    fn quantise(&mut self, step: f32) {
        let (face, n_means) = (self.n * self.n, haar::n_means(self.n));
        let (plain, repeated) = self.steps.split_at_mut(self.coefficients.len());
        repeated.fill(0);
        let (large, small) = repeated.split_at_mut(6 * N_COARSE);
        for (i, (q, c)) in plain.iter_mut().zip(&self.coefficients).enumerate() {
            *q = 0;
            if *c == 0.0 {
                continue;
            }
            let (f, at) = (i / face, i % face);
            let wanted = c / step;
            *q = wanted.round() as i32;
            if at < n_means {
                small[f * n_means + at] = ((wanted - *q as f32) * TIER).round() as i32;
            }
            if at < N_COARSE {
                let high = (*q as f32 / TIER).round() as i32;
                large[f * N_COARSE + at] = high;
                *q -= high * TIER as i32;
            }
        }
    }

    /// Σ (stored - wanted)² over the coefficients.
    fn rounding_error(&self, step: f32) -> f64 {
        let lit = self.coefficients.iter().enumerate().filter(|(_, c)| **c != 0.0);
        sum(lit.map(|(i, c)| (c - step * self.stored(i)).powi(2)))
    }

    /// Coefficient `i` as its entries have it, in steps.
    fn stored(&self, i: usize) -> f32 {
        let (face, n_means, all) = (self.n * self.n, haar::n_means(self.n), self.coefficients.len());
        let (f, at) = (i / face, i % face);
        let mut q = self.steps[i] as f32;
        if at < N_COARSE {
            q += TIER * self.steps[all + f * N_COARSE + at] as f32;
        }
        if at < n_means {
            q += self.steps[all + 6 * N_COARSE + f * n_means + at] as f32 / TIER;
        }
        q
    }

    /// Wanted over stored sum of the row: only the means carry any of it.
    fn sum_correction(&self, row: &[f32], step: f32) -> f32 {
        let (face, n_means) = (self.n * self.n, haar::n_means(self.n));
        let per_mean = f64::from(1u32 << haar::n_levels(self.n));
        let means = (0..6).flat_map(|f| f * face..f * face + n_means);
        let stored: f64 = means.map(|i| f64::from(self.stored(i)) * f64::from(step) * per_mean).sum();
        (sum(row.iter().copied()) / stored) as f32
    }
}

fn finish(basis: Basis, scale: f32, steps: &[i32], error: f64, square: f64) -> Row {
    let mut row = Row { basis, scale, error: (error / square).sqrt() as f32, ..Row::default() };
    run_lengths(steps, &mut row);
    row
}

/// Gaps up to this are stored as zeros: a new run costs two bytes.
const BRIDGED: usize = 2;

/// Cuts the entries into runs.
fn run_lengths(steps: &[i32], row: &mut Row) {
    let (mut at, mut end) = (0, 0);
    while let Some(first) = next_lit(steps, at) {
        let mut last = first;
        while let Some(next) = next_lit(steps, last + 1) {
            if next - last - 1 > BRIDGED || next - first >= LONGEST_RUN {
                break;
            }
            last = next;
        }
        let mut gap = first - end;
        while gap > LONGEST_GAP {
            row.runs.push([LONGEST_GAP as u8, 0]);
            gap -= LONGEST_GAP;
        }
        row.runs.push([gap as u8, (last + 1 - first) as u8]);
        // Two's complement for Haar, plain for pulses: the low byte of either.
        row.values.extend(steps[first..=last].iter().map(|&q| q as u8));
        at = last + 1;
        end = at;
    }
}

fn next_lit(steps: &[i32], from: usize) -> Option<usize> {
    steps[from..].iter().position(|&q| q != 0).map(|i| from + i)
}

fn sum(values: impl Iterator<Item = f32>) -> f64 {
    values.map(f64::from).sum()
}
