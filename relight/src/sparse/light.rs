//! A shell's light as the dot product wants it.

use glam::Vec4;

use super::dot::Planes;
use super::fixed::{Fixed, has_rest};
use super::{LONGEST_RUN, N_COARSE, TIER, n_haar_entries, transpose};
use crate::{cubemap, haar};

/// Entries of zero behind each list: a run is read as if it were the longest.
pub(super) const PADDING: usize = LONGEST_RUN;

/// The light of a cubemap, for each basis. The colours of an entry lie together (and a zero) where it is transformed, each
/// for itself where rows read it.
#[derive(Clone, Debug)]
pub struct SparseLight {
    n: usize,
    pulse: Vec<Vec4>,
    haar: Vec<Vec4>,
    scratch: Vec<Vec4>,
    /// By basis and colour.
    planes: [[Vec<f32>; 3]; 3],
    /// For rows in blocks: texels, and entries of Haar rows.
    fixed: [Fixed; 2],
}

impl SparseLight {
    /// Darkness on an `n` x `n` x 6 cubemap.
    ///
    /// # Panics
    /// When `n` is not in [`cubemap::RESOLUTIONS`].
    pub fn new(n: usize) -> SparseLight {
        assert!(cubemap::RESOLUTIONS.contains(&n), "a cubemap has 8 to 64 texels on a side, not {n}");
        let entries = |count: usize| vec![Vec4::ZERO; count];
        SparseLight {
            n,
            pulse: entries(cubemap::n_texels(n)),
            haar: entries(n_haar_entries(n)),
            scratch: entries(n * n),
            planes: [cubemap::n_texels(n), n_haar_entries(n), cubemap::n_texels(n)]
                .map(|count| std::array::from_fn(|_| vec![0.0; count + PADDING])),
            fixed: [false, true].map(|is_haar| Fixed::new(sections(n, is_haar))),
        }
    }

    /// Texels on a side.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Takes on the average radiance of each texel and transforms it. Does not allocate.
    ///
    /// # Panics
    /// When there are not 6 n² texels.
    pub fn set(&mut self, texels: &[[f32; 3]]) {
        assert_eq!(texels.len(), cubemap::n_texels(self.n), "a shell has one radiance per texel");
        for (to, &[r, g, b]) in self.pulse.iter_mut().zip(texels) {
            *to = Vec4::new(r, g, b, 0.0);
        }
        transform(self.n, &self.pulse, &mut self.scratch, &mut self.haar);
        let [pulse, haar, columns] = &mut self.planes;
        for (entries, [r, g, b]) in [(&self.pulse, &mut *pulse), (&self.haar, haar)] {
            for (((entry, r), g), b) in entries.iter().zip(r).zip(g).zip(b) {
                [*r, *g, *b] = entry.truncate().to_array();
            }
        }
        for (from, to) in pulse.iter().zip(columns) {
            transpose(self.n, &from[..texels.len()], &mut to[..texels.len()]);
        }
        let [pulse, haar] = [pulse, haar].map(|planes| planes.each_ref().map(Vec::as_slice));
        let has_rest = has_rest(pulse.map(|plane| &plane[..texels.len()]));
        self.fixed[0].set(pulse, has_rest);
        self.fixed[1].set(haar, has_rest);
    }

    /// In whole numbers: texels, or entries of Haar rows, whose tiers are its [`sections`].
    pub(super) fn fixed(&self, is_haar: bool) -> &Fixed {
        &self.fixed[usize::from(is_haar)]
    }

    /// Entries and zeros behind them, by [`Basis`](super::Basis) and colour.
    pub(super) fn planes(&self) -> Planes<'_> {
        self.planes.each_ref().map(|planes| planes.each_ref().map(Vec::as_slice))
    }
}

/// Where entries end that are of one size: all texels, or each tier of Haar entries.
pub(super) fn sections(n: usize, is_haar: bool) -> Vec<usize> {
    let texels = cubemap::n_texels(n);
    if is_haar { vec![texels, texels + 6 * N_COARSE, n_haar_entries(n)] } else { vec![texels] }
}

/// Haar entries: coefficients, coarse ones times [`TIER`], means divided by it.
fn transform(n: usize, texels: &[Vec4], scratch: &mut [Vec4], out: &mut [Vec4]) {
    let (face, n_means) = (n * n, haar::n_means(n));
    let (plain, repeated) = out.split_at_mut(texels.len());
    let (large, small) = repeated.split_at_mut(6 * N_COARSE);
    for f in 0..6 {
        let coefficients = &mut plain[f * face..(f + 1) * face];
        haar::forward(n, &texels[f * face..(f + 1) * face], scratch, coefficients);
        for (l, c) in large[f * N_COARSE..(f + 1) * N_COARSE].iter_mut().zip(&*coefficients) {
            *l = *c * TIER;
        }
        for (s, c) in small[f * n_means..(f + 1) * n_means].iter_mut().zip(&*coefficients) {
            *s = *c / TIER;
        }
    }
}
