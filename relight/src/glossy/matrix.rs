//! The tensors of glossy vertices as they lie in an asset, checked before anyone follows them.

use half::f16;

use super::DIRECTION_SIDE;
use crate::asset::{Asset, Data, Error, NO_PATCH};
use crate::cubemap::n_texels;

/// Names after `glossy.`.
const NAMES: [&str; 8] = ["vertex", "lobe", "patch", "share", "start", "source", "direction", "weight"];

/// Borrowed from an asset.
pub struct Matrix<'a> {
    pub vertex: &'a [u32],
    /// Ks and exponent.
    pub lobe: &'a [[f32; 4]],
    pub seen: Option<Seen<'a>>,
}

/// Which patches the glossy vertices see.
pub struct Seen<'a> {
    pub patch: &'a [u16],
    pub share: &'a [f16],
    pub share_scale: f32,
    pub n_patches: usize,
    pub start: &'a [u32],
    pub source: &'a [u16],
    pub direction: &'a [u16],
    pub weight: &'a [f16],
    pub scale: f32,
}

/// Checks the glossy tensors of an asset, if it has any.
pub fn check(asset: &Asset) -> Result<(), Error> {
    Matrix::open(asset).map(|_| ())
}

impl<'a> Matrix<'a> {
    /// The tensors; `None` where there is not one of them.
    pub fn open(asset: &'a Asset<'a>) -> Result<Option<Matrix<'a>>, Error> {
        if NAMES.iter().all(|part| asset.tensor(&name(part)).is_none()) {
            return Ok(None);
        }
        let (vertex, lobe) = (words(asset, "vertex")?, lobes(asset)?);
        let n_vertices = asset.n_vertices();
        if vertex.is_empty() || !vertex.is_sorted_by(|a, b| a < b) {
            return Err(wrong("vertex", "not a rising list of vertices"));
        }
        if vertex.last().is_some_and(|&v| v as usize >= n_vertices) {
            return Err(wrong("vertex", &format!("points past vertex {n_vertices}")));
        }
        if lobe.len() != vertex.len() {
            return Err(wrong("lobe", &format!("{} lobes for {} vertices", lobe.len(), vertex.len())));
        }
        let is_lobe = |l: &[f32; 4]| l[..3].iter().all(|k| (0.0..=1.0).contains(k)) && l[3] >= 0.0;
        if let Some(g) = lobe.iter().position(|l| !is_lobe(l) || !l[3].is_finite()) {
            return Err(wrong("lobe", &format!("{:?} of vertex {} reflects no light", lobe[g], vertex[g])));
        }
        let seen = if NAMES[2..].iter().all(|part| asset.tensor(&name(part)).is_none()) {
            None
        } else {
            Some(Seen::open(asset, vertex.len())?)
        };
        Ok(Some(Matrix { vertex, lobe, seen }))
    }
}

impl<'a> Seen<'a> {
    fn open(asset: &'a Asset<'a>, n_rows: usize) -> Result<Seen<'a>, Error> {
        let patch = shorts(asset, "patch")?;
        if patch.len() != asset.n_vertices() {
            return Err(wrong(
                "patch",
                &format!("{} values for {} vertices", patch.len(), asset.n_vertices()),
            ));
        }
        let known = patch.iter().filter(|p| **p != NO_PATCH);
        let (weight, scale) = halves(asset, "weight")?;
        let (share, share_scale) = halves(asset, "share")?;
        if share.len() != patch.len() {
            return Err(wrong("share", &format!("{} values for {} vertices", share.len(), patch.len())));
        }
        let seen = Seen {
            patch,
            share,
            share_scale,
            n_patches: known.max().map_or(0, |&p| usize::from(p) + 1),
            start: words(asset, "start")?,
            source: shorts(asset, "source")?,
            direction: shorts(asset, "direction")?,
            weight,
            scale,
        };
        seen.check(n_rows)?;
        Ok(seen)
    }

    fn check(&self, n_rows: usize) -> Result<(), Error> {
        let n = self.source.len();
        let ends = (self.start.first(), self.start.last());
        if self.start.len() != n_rows + 1 || ends != (Some(&0), Some(&(n as u32))) || !self.start.is_sorted()
        {
            return Err(wrong("start", &format!("not a rising list from 0 to the {n} entries of all rows")));
        }
        for (part, found) in [("direction", self.direction.len()), ("weight", self.weight.len())] {
            if found != n {
                return Err(wrong(part, &format!("{found} values for {n} entries")));
            }
        }
        let n_directions = n_texels(DIRECTION_SIDE);
        if let Some(at) = self.direction.iter().position(|&d| usize::from(d) >= n_directions) {
            return Err(wrong("direction", &format!("entry {at} points past direction {n_directions}")));
        }
        match self.source.iter().position(|&s| usize::from(s) >= self.n_patches) {
            Some(at) => Err(wrong("source", &format!("entry {at} points past patch {}", self.n_patches))),
            None => Ok(()),
        }
    }
}

fn lobes<'a>(asset: &'a Asset<'a>) -> Result<&'a [[f32; 4]], Error> {
    match asset.tensor(&name("lobe")).map(|t| (&t.data, t.shape.as_slice())) {
        Some((Data::F32(values), [_, 4])) if values.len().is_multiple_of(4) => Ok(values.as_chunks().0),
        Some(_) => Err(wrong("lobe", "not floats in rows of four")),
        None => Err(wrong("lobe", "missing")),
    }
}

fn words<'a>(asset: &'a Asset<'a>, part: &str) -> Result<&'a [u32], Error> {
    match asset.tensor(&name(part)).map(|t| &t.data) {
        Some(Data::U32(values)) => Ok(values),
        Some(other) => Err(wrong(part, &format!("{:?} instead of U32", other.dtype()))),
        None => Err(wrong(part, "missing")),
    }
}

fn shorts<'a>(asset: &'a Asset<'a>, part: &str) -> Result<&'a [u16], Error> {
    match asset.tensor(&name(part)).map(|t| &t.data) {
        Some(Data::U16(values)) => Ok(values),
        Some(other) => Err(wrong(part, &format!("{:?} instead of U16", other.dtype()))),
        None => Err(wrong(part, "missing")),
    }
}

fn halves<'a>(asset: &'a Asset<'a>, part: &str) -> Result<(&'a [f16], f32), Error> {
    asset.half(&name(part)).ok_or_else(|| wrong(part, "missing, or not half floats"))
}

fn name(part: &str) -> String {
    format!("glossy.{part}")
}

fn wrong(part: &str, what: &str) -> Error {
    Error::Tensor { name: name(part), what: what.to_string() }
}
