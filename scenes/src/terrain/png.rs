//! Height maps in grey PNG images, 16 or 8 bits deep.
//!
//! A sample of n is n metres high and pixels are 1 m apart: the caller's scales, horizontal and vertical, say
//! what they are in truth. The top row is north. There are no voids.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader};

use super::{Heights, Wrong, check_size};

pub fn read(bytes: &[u8]) -> Result<Heights, Wrong> {
    let reader = || ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    let unread = |e: image::ImageError| Wrong::from(format!("is no PNG that can be read: {e}"));
    let (width, height) = reader().into_dimensions().map_err(unread)?;
    // Compressed: any file size may hold any image, up to what deflate can do.
    check_size(width.into(), height.into(), bytes.len().saturating_mul(DEFLATE), 1)?;
    let samples: Vec<f32> = match reader().decode().map_err(unread)? {
        DynamicImage::ImageLuma16(image) => image.into_raw().into_iter().map(f32::from).collect(),
        DynamicImage::ImageLuma8(image) => image.into_raw().into_iter().map(f32::from).collect(),
        other => {
            let kind = other.color();
            return Err(format!("holds {kind:?} samples; a height map is grey, best of 16 bits").into());
        }
    };
    Ok(Heights::new(width as usize, height as usize, [1.0, 1.0], samples))
}

/// Deflate's best ratio is 1032 to 1; a little more for images of less than a byte a pixel.
const DEFLATE: usize = 10_000;
