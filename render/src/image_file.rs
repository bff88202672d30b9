//! Image files: `.png` for the eye, `.exr` for numbers, `.exr` and `.hdr` equirects as lights.
//!
//! Files are written whole or not at all: into a temporary file in the same folder, flushed to the disk, then
//! renamed. Reading trusts no length: claimed sizes are checked before memory is asked for.

use crate::error::Error;
use crate::image::{Image, Picture};
use exr::prelude as ex;
use exr::prelude::{ReadChannels, ReadLayers, WritableImage};
use glam::Vec3;
use image::{ImageDecoder, ImageEncoder};
use lunette_relight::light::Equirect;
use std::fs::{self, File};
use std::io::{BufReader, Cursor, Write};
use std::path::{Path, PathBuf};

/// Most pixels of an image: 16,384 x 8,192, the largest equirect in use, 1.5 GiB in memory.
pub(crate) const MOST_PIXELS: usize = 1 << 27;

/// Writes an 8-bit sRGB PNG.
///
/// # Errors
/// [`Error::Io`] where the folder is missing or the disk full; nothing is left behind then.
pub fn write_png(path: &Path, picture: &Picture) -> Result<(), Error> {
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes)
        .write_image(
            picture.pixels.as_flattened(),
            picture.width as u32,
            picture.height as u32,
            image::ExtendedColorType::Rgb8,
        )
        .map_err(|e| wrong(path, format!("cannot be written as PNG: {}", one_line(&e))))?;
    write_atomically(path, &bytes)
}

/// Writes linear radiance as a lossless 32-bit float OpenEXR image with channels R, G and B.
///
/// # Errors
/// [`Error::Io`] where the folder is missing or the disk full; nothing is left behind then.
pub fn write_exr(path: &Path, image: &Image) -> Result<(), Error> {
    let at = |p: ex::Vec2<usize>| image.pixels[p.1 * image.width + p.0];
    let channels = ex::SpecificChannels::rgb(|p| {
        let Vec3 { x, y, z } = at(p);
        (x, y, z)
    });
    let encoding = ex::Encoding { compression: ex::Compression::ZIP16, ..ex::Encoding::FAST_LOSSLESS };
    let attributes = ex::LayerAttributes::default();
    let layer = ex::Layer::new((image.width, image.height), attributes, encoding, channels);
    let mut bytes = Cursor::new(Vec::new());
    ex::Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(|e| wrong(path, format!("cannot be written as OpenEXR: {}", one_line(&e))))?;
    write_atomically(path, bytes.get_ref())
}

/// Writes a file whole or not at all: a temporary file beside it, fsync, rename.
///
/// # Errors
/// [`Error::Io`] with the folder where that is missing, else with the file.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let folder = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        let source = std::io::Error::new(std::io::ErrorKind::NotFound, "no such folder; create it first");
        return Err(Error::Io { path: folder.into(), source });
    }
    let temporary = temporary_name(path)?;
    let written = write_and_rename(&temporary, path, bytes);
    if written.is_err() {
        // It may never have been created; what failed first is what the user must hear.
        let _ = fs::remove_file(&temporary);
    }
    written.map_err(|source| Error::Io { path: path.into(), source })
}

fn write_and_rename(temporary: &Path, path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let mut file = File::create(temporary)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(temporary, path)
}

/// Beside the file, so that the rename stays on one disk; the process id keeps two runs apart.
fn temporary_name(path: &Path) -> Result<PathBuf, Error> {
    let Some(name) = path.file_name() else {
        return Err(wrong(path, "is not the name of a file".into()));
    };
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.part", std::process::id()));
    Ok(path.with_file_name(hidden))
}

/// Reads an equirect `.exr` or `.hdr` as a light. Negative samples become 0, see [`Equirect::n_negative`].
///
/// # Errors
/// [`Error::Io`] where it cannot be opened; [`Error::Image`] where it is not such a file, is empty, claims an absurd
/// size, or holds samples that are not finite.
pub fn read_light(path: &Path) -> Result<Equirect, Error> {
    let Image { width, height, pixels } = read_image(path)?;
    let pixels = pixels.into_iter().map(|p| p.to_array()).collect();
    Equirect::new(width, height, pixels).map_err(|e| wrong(path, one_line(&e)))
}

/// Reads an `.exr` (R, G, B of any depth and compression) or Radiance `.hdr` image, samples as they are.
///
/// # Errors
/// As [`read_light`], but for the values of samples, which are not looked at.
pub fn read_image(path: &Path) -> Result<Image, Error> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    match extension.as_str() {
        "exr" => read_exr(path),
        "hdr" | "pic" => read_hdr(path),
        _ => Err(wrong(path, "is neither .exr nor .hdr; convert it to one of these".into())),
    }
}

fn read_exr(path: &Path) -> Result<Image, Error> {
    let bad = |e: ex::Error| wrong(path, format!("is not a readable OpenEXR image: {}", one_line(&e)));
    let meta = exr::meta::MetaData::read_from_buffered(open(path)?, false).map_err(bad)?;
    for header in &meta.headers {
        check_size(path, header.layer_size.0, header.layer_size.1)?;
    }

    // Arrays of plain floats are handed out as zeroed pages, untouched until a block has really been decoded.
    let create = |size: ex::Vec2<usize>, _: &_| (size, vec![[0.0f32; 3]; size.0 * size.1]);
    let set =
        |(size, pixels): &mut (ex::Vec2<usize>, Vec<[f32; 3]>), at: ex::Vec2<usize>, (r, g, b, _): Rgba| {
            pixels[at.1 * size.0 + at.0] = [r, g, b];
        };
    let read = ex::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(create, set)
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(open(path)?)
        .map_err(bad)?;
    let (size, pixels) = read.layer_data.channel_data.pixels;
    Ok(Image { width: size.0, height: size.1, pixels: pixels.into_iter().map(Vec3::from).collect() })
}

/// A pixel as the `exr` crate converts it.
type Rgba = (f32, f32, f32, f32);

fn read_hdr(path: &Path) -> Result<Image, Error> {
    let bad =
        |e: image::ImageError| wrong(path, format!("is not a readable Radiance image: {}", one_line(&e)));
    let decoder = image::codecs::hdr::HdrDecoder::new_nonstrict(open(path)?).map_err(bad)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(path, width, height)?;
    let mut bytes = vec![0u8; width * height * 12];
    decoder.read_image(&mut bytes).map_err(bad)?;
    let pixels = bytes.as_chunks::<12>().0.iter().map(|p| {
        let c = p.as_chunks::<4>().0;
        Vec3::new(f32::from_ne_bytes(c[0]), f32::from_ne_bytes(c[1]), f32::from_ne_bytes(c[2]))
    });
    Ok(Image { width, height, pixels: pixels.collect() })
}

fn check_size(path: &Path, width: usize, height: usize) -> Result<(), Error> {
    match width.checked_mul(height) {
        Some(0) => Err(wrong(path, format!("is empty ({width} x {height} pixels)"))),
        Some(n) if n <= MOST_PIXELS => Ok(()),
        _ => Err(wrong(
            path,
            format!("claims {width} x {height} pixels, more than {MOST_PIXELS}; scale it down"),
        )),
    }
}

fn open(path: &Path) -> Result<BufReader<File>, Error> {
    File::open(path).map(BufReader::new).map_err(|source| Error::Io { path: path.into(), source })
}

fn wrong(path: &Path, what: String) -> Error {
    Error::Image { path: path.into(), what }
}

/// Messages of other crates may hold line breaks; ours may not.
fn one_line(message: &dyn std::fmt::Display) -> String {
    message.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests;
