//! Terrains: grids of heights from survey and image files, as a mesh.
//!
//! Posts become vertices in grid order, row by row from the north-west: x is east, z is -north, y is up, and the
//! middle of the grid is the origin. [`LoadOptions::scale`] multiplies the spacing, `vertical_scale` the heights.
//! Voids are filled by a membrane (see `voids`) and reported, borders included, so that the grid stays whole.
//!
//! Units: metres throughout. Geographic grids are taken as rectangular, with the lengths that a degree has at the
//! middle of the grid: good to a few metres in a one-degree tile, not for continents.

mod asc;
mod dem;
mod geotiff;
mod hgt;
mod mesh;
mod png;
#[cfg(test)]
mod tests;
mod voids;

use std::path::Path;

use crate::{Error, LoadOptions, Scene};
pub use mesh::heights_to_scene;

/// The endings of file names that [`load`] reads.
pub const EXTENSIONS: [&str; 6] = ["asc", "dem", "hgt", "png", "tif", "tiff"];

/// More posts than this are refused: the mesh alone would be over 8 GB.
const MOST_POSTS: usize = 100_000_000;

/// Heights beyond this, in metres, are not heights; mostly a no-data value that the file does not declare.
const HIGHEST: f32 = 1e6;

/// A grid of heights.
#[derive(Clone, Debug, PartialEq)]
pub struct Heights {
    /// Posts from west to east, 2 and more.
    pub columns: usize,
    /// Posts from north to south, 2 and more.
    pub rows: usize,
    /// Metres from column to column.
    pub spacing_x: f32,
    /// Metres from row to row.
    pub spacing_z: f32,
    /// Metres, NaN where void; the first row is the northernmost, \[rows * columns\].
    pub height: Vec<f32>,
    /// What the reader had to assume, for the user.
    pub notes: Vec<String>,
}

impl Heights {
    /// A grid of `columns` by `rows` with the given metres between columns and between rows.
    pub fn new(columns: usize, rows: usize, spacing: [f64; 2], height: Vec<f32>) -> Heights {
        let [spacing_x, spacing_z] = spacing.map(|s| s as f32);
        Heights { columns, rows, spacing_x, spacing_z, height, notes: Vec::new() }
    }
}

/// Reads a terrain; the ending of the name says which kind it is.
///
/// # Errors
/// [`Error::Io`] for a file that cannot be read; [`Error::Invalid`], with line or byte, for one that is not what
/// its name says, has no height at all, or has more posts than can be held.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, Error> {
    let mut heights = read(path)?;
    scale(&mut heights, options).map_err(|what| invalid(path, what))?;
    heights_to_scene(heights).map_err(|what| invalid(path, what))
}

/// The heights of a file in metres, without any scaling; voids are NaN.
///
/// # Errors
/// As [`load`].
pub fn read(path: &Path) -> Result<Heights, Error> {
    let bytes = std::fs::read(path).map_err(|source| Error::Io { path: path.into(), source })?;
    let name = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    let ending = path.extension().and_then(|s| s.to_str()).unwrap_or_default().to_ascii_lowercase();
    if bytes.is_empty() {
        return Err(invalid(path, "is empty".into()));
    }
    let heights = match ending.as_str() {
        "asc" => asc::read(&bytes),
        "dem" => dem::read(&bytes),
        "hgt" => hgt::read(&bytes, name),
        "png" => png::read(&bytes),
        "tif" | "tiff" => geotiff::read(&bytes),
        _ => Err(format!("is no terrain known here; these are: .{}", EXTENSIONS.join(" .")).into()),
    };
    let heights = heights.and_then(check).map_err(|wrong| wrong.at(path))?;
    Ok(heights)
}

/// What is wrong with a file, and at which line or byte.
#[derive(Debug)]
struct Wrong {
    place: Option<String>,
    what: String,
}

impl Wrong {
    fn line(line: usize, what: impl Into<String>) -> Wrong {
        Wrong { place: Some(line.to_string()), what: what.into() }
    }

    fn byte(byte: usize, what: impl Into<String>) -> Wrong {
        Wrong { place: Some(format!("byte {byte}")), what: what.into() }
    }

    fn at(self, path: &Path) -> Error {
        let place = self.place.map(|place| format!(":{place}")).unwrap_or_default();
        // One line, whatever a library's message holds.
        let what = self.what.replace(['\n', '\r'], " ");
        Error::Invalid { at: format!("{}{place}", path.display()), what }
    }
}

impl From<String> for Wrong {
    fn from(what: String) -> Wrong {
        Wrong { place: None, what }
    }
}

fn invalid(path: &Path, what: String) -> Error {
    Wrong::from(what).at(path)
}

/// Refuses a grid that is too small, too large, or larger than its file can hold at `least` bytes a post.
fn check_size(columns: u64, rows: u64, bytes: usize, least: usize) -> Result<(usize, usize), String> {
    let posts = columns.saturating_mul(rows);
    if columns < 2 || rows < 2 {
        return Err(format!("{columns} x {rows} posts are no grid; 2 x 2 are the least"));
    }
    if posts > MOST_POSTS as u64 {
        return Err(format!("{columns} x {rows} posts are more than {MOST_POSTS}; resample to fewer"));
    }
    if posts.saturating_mul(least as u64) > bytes as u64 + 1 {
        return Err(format!("{columns} x {rows} posts do not fit into {bytes} bytes; is the file cut off?"));
    }
    Ok((columns as usize, rows as usize))
}

/// What must hold for every format.
fn check(heights: Heights) -> Result<Heights, Wrong> {
    let Heights { columns, rows, spacing_x, spacing_z, .. } = heights;
    check_spacing(spacing_x, spacing_z)?;
    if columns < 2 || rows < 2 || heights.height.len() != columns * rows {
        let found = heights.height.len();
        return Err(format!("{columns} x {rows} posts, but {found} heights").into());
    }
    let wild = heights.height.iter().position(|h| h.is_infinite() || h.abs() > HIGHEST);
    if let Some(i) = wild {
        let (h, row, column) = (heights.height[i], i / columns + 1, i % columns + 1);
        return Err(format!(
            "{h} m in row {row}, column {column} is no height; if it means no data, the file must declare it"
        )
        .into());
    }
    Ok(heights)
}

fn check_spacing(x: f32, z: f32) -> Result<(), String> {
    // From a scanned pebble to a planet in two posts.
    let sound = |s: &f32| (1e-6..=1e8).contains(s);
    if [x, z].iter().all(sound) {
        return Ok(());
    }
    Err(format!("a spacing of {x} x {z} m is none; it should be from 1e-6 to 1e8"))
}

/// Applies the options, whose factors the caller has found to be positive numbers.
fn scale(heights: &mut Heights, options: &LoadOptions) -> Result<(), String> {
    heights.spacing_x *= options.scale;
    heights.spacing_z *= options.scale;
    check_spacing(heights.spacing_x, heights.spacing_z)?;
    heights.height.iter_mut().for_each(|h| *h *= options.vertical_scale);
    if heights.height.iter().any(|h| h.abs() > HIGHEST * 1e3) {
        return Err(format!("a vertical scale of {} makes heights that are none", options.vertical_scale));
    }
    Ok(())
}

/// Metres east and metres north that a degree is at a latitude (degrees), on the WGS84 ellipsoid.
///
/// The usual series; good to a metre or so a degree.
fn metres_per_degree(latitude: f64) -> [f64; 2] {
    let phi = latitude.to_radians();
    let east = 111_412.84 * phi.cos() - 93.5 * (3.0 * phi).cos() + 0.118 * (5.0 * phi).cos();
    let north = 111_132.92 - 559.82 * (2.0 * phi).cos() + 1.175 * (4.0 * phi).cos();
    [east, north]
}
