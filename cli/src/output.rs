//! What is written: pictures and irradiance per vertex.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail, ensure};
use lunette_relight::asset::{Asset, Data, Metadata};
use lunette_render::{Exposure, Image};

/// Kinds of output, by the file's ending.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Png,
    Exr,
    Safetensors,
    Ply,
}

impl Kind {
    /// Whether it is a picture.
    pub fn is_picture(self) -> bool {
        matches!(self, Kind::Png | Kind::Exr)
    }
}

/// The kind of a file by its ending.
pub fn kind(path: &Path) -> Result<Kind> {
    match path.extension().and_then(|e| e.to_str()).map(str::to_lowercase).as_deref() {
        Some("png") => Ok(Kind::Png),
        Some("exr") => Ok(Kind::Exr),
        Some("safetensors") => Ok(Kind::Safetensors),
        Some("ply") => Ok(Kind::Ply),
        _ => bail!("{}: the ending must be .png, .exr, .safetensors or .ply", path.display()),
    }
}

/// That a file can be written where it is asked for: better known before the work than after it.
pub fn check_folder(path: &Path) -> Result<()> {
    let folder = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    ensure!(folder.is_dir(), "{}: there is no folder {}; make it first", path.display(), folder.display());
    ensure!(!path.is_dir(), "{}: is a folder; name a file", path.display());
    Ok(())
}

/// Makes a folder for several files, and those that it lies in, where there is none.
pub fn make_folder(path: &Path) -> Result<()> {
    ensure!(!path.is_file(), "{}: is a file; name a folder", path.display());
    std::fs::create_dir_all(path).with_context(|| path.display().to_string())
}

/// The path of one frame: `%d`, `%02d`, ... is its number, from 0.
pub fn frame_path(pattern: &Path, frame: usize, frames: usize) -> Result<PathBuf> {
    let text = pattern.to_string_lossy();
    let Some(at) = text.find('%') else {
        ensure!(frames == 1, "{text}: {frames} frames need a number in the name, like day.%02d.png");
        return Ok(pattern.to_path_buf());
    };
    let rest = &text[at + 1..];
    let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let width = if digits == 0 { 0 } else { rest[..digits].parse::<usize>().unwrap_or(99) };
    ensure!(rest[digits..].starts_with('d') && width <= 9, "{text}: write the frame's number as %d or %02d");
    Ok(PathBuf::from(format!("{}{frame:0width$}{}", &text[..at], &rest[digits + 1..])))
}

/// Writes a picture.
pub fn picture(path: &Path, image: &Image, exposure: Exposure) -> Result<()> {
    let written = match kind(path)? {
        Kind::Exr => lunette_render::write_exr(path, image),
        _ => lunette_render::write_png(path, &lunette_render::tone_map(image, exposure)),
    };
    written.map_err(|e| anyhow!("{e}"))
}

/// Irradiance per vertex, \[V\] each.
pub struct Lit<'a> {
    pub direct: &'a [[f32; 3]],
    pub indirect: &'a [[f32; 3]],
    /// Standard error of the sum, where it was estimated.
    pub error: Option<&'a [[f32; 3]]>,
}

/// Writes irradiance per vertex, with the mesh of `asset`.
pub fn vertices(path: &Path, asset: &Asset, lit: &Lit) -> Result<()> {
    let total: Vec<[f32; 3]> =
        lit.direct.iter().zip(lit.indirect).map(|(d, i)| [d[0] + i[0], d[1] + i[1], d[2] + i[2]]).collect();
    let bytes = match kind(path)? {
        Kind::Ply => ply(asset, &total),
        _ => safetensors(asset, lit, &total)?,
    };
    lunette_render::write_atomically(path, &bytes).map_err(|e| anyhow!("{e}"))
}

fn safetensors(asset: &Asset, lit: &Lit, total: &[[f32; 3]]) -> Result<Vec<u8>> {
    let mut metadata = Metadata::new(&asset.metadata.scene);
    metadata.scene_hash.clone_from(&asset.metadata.scene_hash);
    let mut out = Asset::new(metadata);
    for (name, tensor) in asset.tensors().filter(|(name, _)| name.starts_with("mesh.")) {
        out.insert(name, &tensor.shape, tensor.data.clone());
    }
    let parts = [
        ("irradiance", Some(total)),
        ("direct", Some(lit.direct)),
        ("indirect", Some(lit.indirect)),
        ("standard_error", lit.error),
    ];
    for (name, values) in parts {
        if let Some(values) = values {
            out.insert(name, &[values.len(), 3], Data::F32(Cow::Borrowed(values.as_flattened())));
        }
    }
    out.to_bytes().map_err(|e| anyhow!("{e}"))
}

/// Binary little-endian PLY: position, normal, irradiance as float red, green, blue.
fn ply(asset: &Asset, total: &[[f32; 3]]) -> Vec<u8> {
    let mut header = String::from(
        "ply\nformat binary_little_endian 1.0\ncomment irradiance without albedo, linear Rec.709\n",
    );
    let _ = writeln!(header, "element vertex {}", total.len());
    for property in ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"] {
        let _ = writeln!(header, "property float {property}");
    }
    let _ = writeln!(
        header,
        "element face {}\nproperty list uchar uint vertex_indices\nend_header",
        asset.triangles().len()
    );
    let mut bytes = header.into_bytes();
    for ((p, n), e) in asset.positions().iter().zip(asset.normals()).zip(total) {
        for value in [p, n, e].into_iter().flatten() {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
    }
    for triangle in asset.triangles() {
        bytes.push(3);
        triangle.iter().for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_numbers_follow_the_pattern() {
        let path =
            |pattern: &str, frame| frame_path(Path::new(pattern), frame, 24).map(|p| p.display().to_string());
        assert_eq!(path("day.%02d.png", 7).unwrap(), "day.07.png");
        assert_eq!(path("d%d.png", 17).unwrap(), "d17.png");
        assert!(path("day.png", 0).is_err());
        assert!(path("day.%s.png", 0).is_err());
    }
}
