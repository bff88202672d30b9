//! Rows gathered in the order of vertices, and turned into tensors.

use std::borrow::Cow;

use super::{Basis, Row};
use crate::asset::{Asset, Data};

/// Encoded rows of consecutive vertices.
#[derive(Clone, Debug, Default)]
pub struct RowStore {
    start: Vec<usize>,
    index: Vec<u8>,
    value: Vec<u8>,
    scale: Vec<f32>,
    basis: Vec<u8>,
}

/// More than 4 GiB of values, which `.start` cannot count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge {
    /// Bytes of values.
    pub bytes: usize,
}

impl std::fmt::Display for TooLarge {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{} bytes of transfer rows, more than 4 GiB: lower the resolution or split the scene",
            self.bytes
        )
    }
}

impl std::error::Error for TooLarge {}

impl RowStore {
    /// Appends the next vertex's row.
    pub fn push(&mut self, row: &Row) {
        self.start.push(self.value.len());
        self.index.extend_from_slice(row.runs.as_flattened());
        self.value.extend_from_slice(&row.values);
        self.scale.push(row.scale);
        self.basis.push(row.basis as u8);
    }

    /// Rows so far.
    pub fn n_rows(&self) -> usize {
        self.scale.len()
    }

    /// Bytes in the file so far.
    pub fn bytes(&self) -> usize {
        self.index.len() + self.value.len() + 9 * self.n_rows() + 4
    }

    /// How many rows are in Haar wavelets.
    pub fn n_haar(&self) -> usize {
        self.basis.iter().filter(|&&b| b == Basis::Haar as u8).count()
    }

    /// Moves the tensors into an asset under `prefix` (`portal.K.direct` or `sky.direct`); `n` is the resolution.
    ///
    /// # Errors
    /// When there are more bytes than 32 bits count.
    pub fn insert_into(mut self, asset: &mut Asset, prefix: &str, n: usize) -> Result<(), TooLarge> {
        self.start.push(self.value.len());
        let start = self.start.iter().map(|&s| u32::try_from(s)).collect::<Result<Vec<u32>, _>>();
        let start = start.map_err(|_| TooLarge { bytes: self.value.len() })?;
        let (n_rows, n_runs, n_values) = (self.scale.len(), self.index.len() / 2, self.value.len());
        let mut insert =
            |name: &str, shape: &[usize], data| asset.insert(&format!("{prefix}.{name}"), shape, data);
        insert("resolution", &[1], Data::U32(Cow::Owned(vec![n as u32])));
        insert("start", &[n_rows + 1], Data::U32(Cow::Owned(start)));
        insert("index", &[n_runs, 2], Data::U8(Cow::Owned(self.index)));
        insert("value", &[n_values], Data::U8(Cow::Owned(self.value)));
        insert("scale", &[n_rows], Data::F32(Cow::Owned(self.scale)));
        insert("basis", &[n_rows], Data::U8(Cow::Owned(self.basis)));
        Ok(())
    }
}
