//! Rows as they lie in an asset, checked before anyone follows them.

use std::ops::Range;

use super::{Basis, LONGEST_RUN, Row, SparseLight, dot, n_entries};
use crate::asset::{Asset, Data, Error};
use crate::cubemap;

/// The sparse rows of an asset under one prefix, borrowed from it.
#[derive(Clone, Debug)]
pub struct Rows<'a> {
    n: usize,
    pub(super) start: &'a [u32],
    /// First run of each row, and the number of all: not in the file, since the lengths of the runs say it.
    pub(super) first_run: Vec<u32>,
    pub(super) runs: &'a [[u8; 2]],
    pub(super) value: &'a [u8],
    pub(super) scale: &'a [f32],
    pub(super) basis: &'a [u8],
}

impl<'a> Rows<'a> {
    /// The rows under `prefix`, or `None` where there is no `{prefix}.start`. One pass over the runs.
    ///
    /// # Errors
    /// When a tensor is missing, has the wrong type or length, or a run leaves its row.
    pub fn open(asset: &'a Asset, prefix: &str) -> Result<Option<Rows<'a>>, Error> {
        if asset.tensor(&format!("{prefix}.start")).is_none() {
            return Ok(None);
        }
        let parts = Parts { asset, prefix };
        let runs = parts.bytes("index")?;
        let mut rows = Rows {
            n: parts.resolution()?,
            start: parts.words("start")?,
            first_run: Vec::new(),
            runs: bytemuck::try_cast_slice(runs)
                .map_err(|_| parts.wrong("index", "an odd number of bytes"))?,
            value: parts.bytes("value")?,
            scale: parts.floats("scale")?,
            basis: parts.bytes("basis")?,
        };
        rows.check(&parts)?;
        Ok(Some(rows))
    }

    fn check(&mut self, parts: &Parts) -> Result<(), Error> {
        let n_rows = self.scale.len();
        if n_rows != parts.asset.n_vertices() || self.basis.len() != n_rows || self.start.len() != n_rows + 1
        {
            return Err(
                parts.wrong("start", "its length and those of scale and basis do not fit the vertices")
            );
        }
        if self.start[0] != 0 || self.start[n_rows] as usize != self.value.len() || !self.start.is_sorted() {
            return Err(parts.wrong("start", "not a rising list from 0 to the number of values"));
        }
        if let Some(v) = self.basis.iter().position(|&b| Basis::from_byte(b).is_none()) {
            return Err(parts.wrong("basis", &format!("vertex {v} has a basis that does not exist")));
        }
        if let Some(v) = self.scale.iter().position(|s| !(s.is_finite() && *s >= 0.0)) {
            return Err(
                parts.wrong("scale", &format!("vertex {v} has a scale that is not a positive number"))
            );
        }
        self.first_run = Vec::with_capacity(n_rows + 1);
        let mut run = 0;
        for v in 0..n_rows {
            self.first_run.push(run as u32);
            run = self.check_row(v, run).ok_or_else(|| {
                parts.wrong("index", &format!("the runs of vertex {v} do not fit its values"))
            })?;
        }
        self.first_run.push(run as u32);
        if run == self.runs.len() && u32::try_from(run).is_ok() {
            Ok(())
        } else {
            Err(parts.wrong("index", "runs are left over"))
        }
    }

    /// The run after those of row `v`; `None` when they leave the row or the cubemap.
    fn check_row(&self, v: usize, mut run: usize) -> Option<usize> {
        let limit = n_entries(self.basis(v), self.n);
        let mut left = (self.start[v + 1] - self.start[v]) as usize;
        let mut at = 0;
        while left > 0 {
            let [gap, length] = *self.runs.get(run)?;
            at += usize::from(gap) + usize::from(length);
            left = left.checked_sub(usize::from(length))?;
            run += 1;
            if at > limit || usize::from(length) > LONGEST_RUN {
                return None;
            }
        }
        Some(run)
    }

    /// Texels on a side.
    pub fn n(&self) -> usize {
        self.n
    }

    /// V.
    pub fn n_rows(&self) -> usize {
        self.scale.len()
    }

    /// The basis of row `v`.
    ///
    /// # Panics
    /// When there is no such row.
    pub fn basis(&self, v: usize) -> Basis {
        Basis::from_byte(self.basis[v]).unwrap_or_default()
    }

    /// Bytes of all rows: runs, values, and nine each for start, scale and basis.
    pub fn bytes(&self) -> usize {
        self.bytes_of(0..self.n_rows())
    }

    /// Of some of them.
    pub(crate) fn bytes_of(&self, rows: Range<usize>) -> usize {
        let runs = self.first_run[rows.end] - self.first_run[rows.start];
        let values = self.start[rows.end] - self.start[rows.start];
        2 * runs as usize + values as usize + 9 * rows.len()
    }

    /// Row `v` as the encoder made it, without its error.
    ///
    /// # Panics
    /// When there is no such row.
    pub fn row(&self, v: usize) -> Row {
        let (from, to) = (self.start[v] as usize, self.start[v + 1] as usize);
        let runs = self.runs[self.first_run[v] as usize..self.first_run[v + 1] as usize].to_vec();
        let values = self.value[from..to].to_vec();
        Row { basis: self.basis(v), scale: self.scale[v], runs, values, error: 0.0 }
    }

    /// Adds E = Σ T L of the vertices from `first` on.
    ///
    /// # Panics
    /// When there are not that many vertices, or the light has another resolution.
    pub fn add(&self, first: usize, light: &SparseLight, out: &mut [[f32; 3]]) {
        dot::add(&self.slices(first, light, out.len()), light.planes(), out);
    }

    /// As [`Rows::add`], without the processor's special instructions: what the fast way is held against.
    ///
    /// # Panics
    /// As [`Rows::add`].
    pub fn add_portable(&self, first: usize, light: &SparseLight, out: &mut [[f32; 3]]) {
        dot::add_portable(&self.slices(first, light, out.len()), light.planes(), out);
    }

    fn slices(&self, first: usize, light: &SparseLight, count: usize) -> dot::Slices<'_> {
        assert_eq!(light.n(), self.n, "rows and light have different resolutions");
        dot::Slices {
            start: &self.start[first..=first + count],
            first_run: &self.first_run[first..=first + count],
            runs: self.runs,
            value: self.value,
            scale: &self.scale[first..first + count],
            basis: &self.basis[first..first + count],
        }
    }
}

/// Tensors by the last part of their name.
struct Parts<'a, 'b> {
    asset: &'a Asset<'a>,
    prefix: &'b str,
}

impl<'a> Parts<'a, '_> {
    fn data(&self, part: &str) -> Result<&'a Data<'a>, Error> {
        let tensor = self.asset.tensor(&format!("{}.{part}", self.prefix));
        tensor.map(|t| &t.data).ok_or_else(|| self.wrong(part, "missing"))
    }

    fn bytes(&self, part: &str) -> Result<&'a [u8], Error> {
        match self.data(part)? {
            Data::U8(values) => Ok(values),
            other => Err(self.wrong(part, &format!("{:?} instead of U8", other.dtype()))),
        }
    }

    fn words(&self, part: &str) -> Result<&'a [u32], Error> {
        match self.data(part)? {
            Data::U32(values) => Ok(values),
            other => Err(self.wrong(part, &format!("{:?} instead of U32", other.dtype()))),
        }
    }

    fn floats(&self, part: &str) -> Result<&'a [f32], Error> {
        match self.data(part)? {
            Data::F32(values) => Ok(values),
            other => Err(self.wrong(part, &format!("{:?} instead of F32", other.dtype()))),
        }
    }

    fn resolution(&self) -> Result<usize, Error> {
        match self.words("resolution")? {
            &[n] if cubemap::RESOLUTIONS.contains(&(n as usize)) => Ok(n as usize),
            _ => Err(self.wrong("resolution", "not one number in 8..=64")),
        }
    }

    fn wrong(&self, part: &str, what: &str) -> Error {
        Error::Tensor { name: format!("{}.{part}", self.prefix), what: what.to_string() }
    }
}
