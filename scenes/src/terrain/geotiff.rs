//! GeoTIFF elevation models: one band of integers or floats.
//!
//! Read are the pixel scale (or an unturned transformation), the tie point, whether the grid is geographic
//! (degrees, made metres by latitude) or projected in metres or feet, the vertical unit, and GDAL's no-data value.
//! NaN is void. Turned grids, several bands and sub-images are not read.
//!
//! Based on: OGC GeoTIFF Standard 1.1, 2019; GDAL documentation, GTiff driver.

use std::io::Cursor;

use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;

use super::{Heights, MOST_POSTS, Wrong, check_size, metres_per_degree};

type Tiff<'a> = Decoder<Cursor<&'a [u8]>>;

/// GeoKeys: model type, projected linear unit, vertical unit.
const MODEL_TYPE: u16 = 1024;
const LINEAR_UNITS: u16 = 3076;
const VERTICAL_UNITS: u16 = 4099;
/// The model type that means latitude and longitude.
const GEOGRAPHIC: u16 = 2;
/// Deflate's best ratio: what the smallest file of so many samples can be.
const DEFLATE: usize = 1100;

pub fn read(bytes: &[u8]) -> Result<Heights, Wrong> {
    let unread = |e: tiff::TiffError| Wrong::from(format!("is no TIFF that can be read: {e}"));
    let mut limits = Limits::default();
    // 8 bytes a sample is the widest kind.
    limits.decoding_buffer_size = 8 * MOST_POSTS;
    limits.intermediate_buffer_size = 8 * MOST_POSTS;
    let mut tiff = Decoder::new(Cursor::new(bytes)).map_err(unread)?.with_limits(limits);
    let (width, height) = tiff.dimensions().map_err(unread)?;
    let (columns, rows) = check_size(width.into(), height.into(), bytes.len().saturating_mul(DEFLATE), 1)?;
    let (spacing, notes) = spacing(&mut tiff, rows)?;
    let nodata = nodata(&mut tiff);
    let vertical = feet_or_metres(geo_key(&mut tiff, VERTICAL_UNITS));
    let colour = tiff.colortype().map_err(unread)?;
    let samples = samples(tiff.read_image().map_err(unread)?, nodata)?;
    if samples.len() != columns * rows {
        return Err(format!("holds {colour:?} samples; an elevation model has one band").into());
    }
    let heights = samples.into_iter().map(|h| (f64::from(h) * vertical) as f32).collect();
    let mut heights = Heights::new(columns, rows, spacing, heights);
    heights.notes = notes;
    Ok(heights)
}

/// Metres between columns and rows.
fn spacing(tiff: &mut Tiff, rows: usize) -> Result<([f64; 2], Vec<String>), Wrong> {
    let scale = numbers(tiff, Tag::ModelPixelScaleTag).filter(|s| s.len() >= 2);
    let tie = numbers(tiff, Tag::ModelTiepointTag).filter(|t| t.len() >= 6);
    let matrix = numbers(tiff, Tag::ModelTransformationTag).filter(|m| m.len() >= 8);
    // Northing of the middle of the grid, where the tags tell it.
    let middle = 0.5 * rows as f64;
    let (dx, dy, north) = match (scale, matrix) {
        (Some(s), _) => (s[0].abs(), s[1].abs(), tie.map(|t| t[4] - (middle - t[1]) * s[1])),
        (None, Some(m)) if m[1] == 0.0 && m[4] == 0.0 => (m[0].abs(), m[5].abs(), Some(m[7] + middle * m[5])),
        (None, Some(_)) => {
            return Err("is turned against its map grid, which is not read; resample it".to_string().into());
        }
        (None, None) => {
            return Ok((
                [1.0, 1.0],
                vec!["the file has no pixel scale: pixels are taken as 1 m apart".into()],
            ));
        }
    };
    if geo_key(tiff, MODEL_TYPE) == Some(GEOGRAPHIC) {
        let latitude = north.filter(|y| y.abs() <= 90.0);
        let latitude =
            latitude.ok_or_else(|| "is geographic but tells no latitude (no tie point)".to_string())?;
        let [east, north] = metres_per_degree(latitude);
        return Ok(([dx * east, dy * north], Vec::new()));
    }
    let unit = feet_or_metres(geo_key(tiff, LINEAR_UNITS));
    Ok(([dx * unit, dy * unit], Vec::new()))
}

fn numbers(tiff: &mut Tiff, tag: Tag) -> Option<Vec<f64>> {
    let numbers = tiff.get_tag_f64_vec(tag).ok()?;
    numbers.iter().all(|x| x.is_finite()).then_some(numbers)
}

/// A short GeoKey, if the directory has it in itself.
fn geo_key(tiff: &mut Tiff, key: u16) -> Option<u16> {
    let directory = tiff.get_tag_u16_vec(Tag::GeoKeyDirectoryTag).ok()?;
    // Entries of key, where its value is (0: here), count, value, after a head of the same size.
    let entry = directory.chunks_exact(4).skip(1).find(|entry| entry[0] == key && entry[1] == 0)?;
    Some(entry[3])
}

/// Metres in a unit by its EPSG code; metres where it is another or none.
fn feet_or_metres(code: Option<u16>) -> f64 {
    match code {
        Some(9002) => 0.3048,
        Some(9003) => 1200.0 / 3937.0,
        _ => 1.0,
    }
}

fn nodata(tiff: &mut Tiff) -> Option<f64> {
    let text = tiff.get_tag_ascii_string(Tag::GdalNodata).ok()?;
    text.trim_matches(['\0', ' ']).parse().ok()
}

fn samples(image: DecodingResult, nodata: Option<f64>) -> Result<Vec<f32>, Wrong> {
    fn all<T: Copy + PartialEq>(samples: Vec<T>, nodata: Option<T>, metres: impl Fn(T) -> f32) -> Vec<f32> {
        let height = |h: T| if Some(h) == nodata { f32::NAN } else { metres(h) };
        samples.into_iter().map(height).collect()
    }
    // A no-data value that the sample's type cannot hold matches nothing.
    let whole = nodata.filter(|x| x.fract() == 0.0).map(|x| x as i64);
    Ok(match image {
        DecodingResult::U8(s) => all(s, whole.and_then(|x| x.try_into().ok()), f32::from),
        DecodingResult::I8(s) => all(s, whole.and_then(|x| x.try_into().ok()), f32::from),
        DecodingResult::U16(s) => all(s, whole.and_then(|x| x.try_into().ok()), f32::from),
        DecodingResult::I16(s) => all(s, whole.and_then(|x| x.try_into().ok()), f32::from),
        DecodingResult::U32(s) => all(s, whole.and_then(|x| x.try_into().ok()), |h| h as f32),
        DecodingResult::I32(s) => all(s, whole.and_then(|x| x.try_into().ok()), |h| h as f32),
        DecodingResult::F32(s) => all(s, nodata.map(|x| x as f32), |h| h),
        DecodingResult::F64(s) => all(s, nodata, |h| h as f32),
        _ => {
            return Err("holds samples of 16-bit floats or 64-bit integers, which are not read"
                .to_string()
                .into());
        }
    })
}
