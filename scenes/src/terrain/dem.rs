//! USGS native ASCII digital elevation models: profiles from south to north.
//!
//! One record A, then a record B for each profile, all in blocks of 1,024 bytes of fixed-width Fortran fields. A
//! profile has its own start, so that a quadrangle which leans against its map grid is not a rectangle of
//! posts: what no profile covers is void. Height = datum + value * z-resolution, in feet or metres.
//!
//! Based on: U.S. Geological Survey, Standards for Digital Elevation Models, part 2: Specifications, 1998.

use super::{Heights, MOST_POSTS, Wrong, metres_per_degree};

/// Bytes of a block.
const BLOCK: usize = 1024;
/// Where a profile's heights begin in its first block; in further ones they begin at once.
const FIRST_HEIGHT: usize = 144;
/// Bytes of a height.
const WIDTH: usize = 6;
/// Heights in a profile's first block and in each further one.
const IN_FIRST: usize = 146;
const IN_OTHER: usize = 170;
/// No height: the usual value and the one that 16 bits suggest.
const VOIDS: [i64; 2] = [-32767, -32768];
/// A grid so many times the heights in the file is not a quadrangle: its profiles' starts are wrong.
const EMPTIEST: usize = 16;
/// How many steps the corners of a quadrangle may be beyond the ends of its profiles.
const CORNER_STEPS: f64 = 2.0;
const FOOT: f64 = 0.3048;

/// What record A says.
struct Header {
    profiles: usize,
    /// Distance between profiles and along them, in the file's horizontal unit, and step of the heights.
    resolution: [f64; 3],
    /// Southernmost and northernmost corner of the quadrangle.
    north: [f64; 2],
    /// Metres in a horizontal unit, `None` for arc-seconds.
    ground: Option<f64>,
    /// Metres in a vertical unit.
    vertical: f64,
}

struct Profile {
    x: f64,
    y: f64,
    /// Metres, from south to north.
    height: Vec<f32>,
}

pub fn read(bytes: &[u8]) -> Result<Heights, Wrong> {
    if bytes.len() < 2 * BLOCK {
        let found = bytes.len();
        return Err(
            format!("is no USGS DEM: {found} bytes, and its first two records have {BLOCK} each").into()
        );
    }
    let header = header(bytes)?;
    let mut at = BLOCK;
    let mut profiles = Vec::new();
    for _ in 0..header.profiles {
        if bytes[at.min(bytes.len())..].trim_ascii().is_empty() {
            let (found, all) = (profiles.len(), header.profiles);
            return Err(Wrong::byte(
                at,
                format!("ends after {found} of {all} profiles; is the file cut off?"),
            ));
        }
        profiles.push(profile(bytes, &mut at, &header)?);
    }
    lay_out(&header, &profiles)
}

fn header(bytes: &[u8]) -> Result<Header, Wrong> {
    let [dx, dy, dz] = [real(bytes, 816, 12)?, real(bytes, 828, 12)?, real(bytes, 840, 12)?];
    for (at, resolution) in [(816, dx), (828, dy), (840, dz)] {
        if !(resolution > 0.0 && resolution.is_finite()) {
            return Err(Wrong::byte(at, format!("a resolution of {resolution} is none")));
        }
    }
    let ground = match integer(bytes, 528, 6)? {
        1 => Some(FOOT),
        2 => Some(1.0),
        3 => None,
        unit => {
            return Err(Wrong::byte(
                528,
                format!("horizontal unit {unit} is not feet, metres or arc-seconds"),
            ));
        }
    };
    let vertical = match integer(bytes, 534, 6)? {
        1 => FOOT,
        2 => 1.0,
        unit => return Err(Wrong::byte(534, format!("vertical unit {unit} is neither feet nor metres"))),
    };
    let turned = real(bytes, 786, 24)?;
    if turned != 0.0 {
        return Err(Wrong::byte(
            786,
            format!("profiles turned by {turned} against the map grid are not read"),
        ));
    }
    let profiles = integer(bytes, 858, 6)?;
    // Each takes a block at least.
    let most = bytes.len().div_ceil(BLOCK) as i64 - 1;
    if profiles < 2 || profiles > most {
        let what = format!("{profiles} profiles do not go with a file that has room for {most}");
        return Err(Wrong::byte(858, what));
    }
    // Four corners, each east and north.
    let mut north = [f64::INFINITY, f64::NEG_INFINITY];
    for corner in 0..4 {
        let y = real(bytes, 546 + 48 * corner + 24, 24)?;
        north = [north[0].min(y), north[1].max(y)];
    }
    Ok(Header { profiles: profiles as usize, resolution: [dx, dy, dz], north, ground, vertical })
}

/// The profile at `at`, which then points to the next one.
fn profile(bytes: &[u8], at: &mut usize, header: &Header) -> Result<Profile, Wrong> {
    let start = *at;
    let count = integer(bytes, start + 12, 6)?;
    let room = (bytes.len() - start) / WIDTH;
    if count < 1 || count as usize > room {
        return Err(Wrong::byte(start + 12, format!("a profile of {count} heights, with room for {room}")));
    }
    let [x, y, datum] =
        [real(bytes, start + 24, 24)?, real(bytes, start + 48, 24)?, real(bytes, start + 72, 24)?];
    let count = count as usize;
    let mut height = Vec::with_capacity(count);
    for i in 0..count {
        let place = place(i);
        let value = integer(bytes, start + place, WIDTH)?;
        let h = (datum + value as f64 * header.resolution[2]) * header.vertical;
        height.push(if VOIDS.contains(&value) { f32::NAN } else { h as f32 });
    }
    *at = start + BLOCK * (1 + count.saturating_sub(IN_FIRST).div_ceil(IN_OTHER));
    Ok(Profile { x, y, height })
}

/// Where the i-th height of a profile is, from the profile's first byte.
fn place(i: usize) -> usize {
    if i < IN_FIRST {
        return FIRST_HEIGHT + WIDTH * i;
    }
    let further = i - IN_FIRST;
    BLOCK * (1 + further / IN_OTHER) + WIDTH * (further % IN_OTHER)
}

/// Profiles side by side on one grid.
fn lay_out(header: &Header, profiles: &[Profile]) -> Result<Heights, Wrong> {
    let [dx, dy, _] = header.resolution;
    let end = |p: &Profile| p.y + dy * (p.height.len() - 1) as f64;
    let west = profiles.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
    let top = profiles.iter().map(end).fold(f64::NEG_INFINITY, f64::max);
    let east = profiles.iter().map(|p| p.x).fold(f64::NEG_INFINITY, f64::max);
    let bottom = profiles.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
    // Whole steps on to the corners of the quadrangle, as GDAL has it, if they are near: a blank corner is not.
    let steps = |distance: f64| Some((distance / dy).ceil()).filter(|n| (0.0..=CORNER_STEPS).contains(n));
    let bottom = bottom - dy * steps(bottom - header.north[0]).unwrap_or(0.0);
    let top = top + dy * steps(header.north[1] - top).unwrap_or(0.0);
    let [columns, rows] = [(east - west) / dx, (top - bottom) / dy].map(|n| n.round() + 1.0);
    let posts: usize = profiles.iter().map(|p| p.height.len()).sum();
    let most = (EMPTIEST * posts).min(MOST_POSTS) as f64;
    // Written so that it refuses NaN too.
    if !(columns >= 2.0 && rows >= 2.0 && columns * rows <= most) {
        return Err(format!(
            "{posts} heights do not make a grid of {columns} x {rows}; a profile's start is off"
        )
        .into());
    }
    let (columns, rows) = (columns as usize, rows as usize);
    let mut height = vec![f32::NAN; columns * rows];
    for p in profiles {
        let column = ((p.x - west) / dx).round() as usize;
        let first = ((top - p.y) / dy).round() as usize;
        for (i, &h) in p.height.iter().enumerate() {
            height[first.saturating_sub(i) * columns + column] = h;
        }
    }
    let spacing = match header.ground {
        Some(metres) => [dx * metres, dy * metres],
        None => {
            let degree = metres_per_degree((0.5 * (top + bottom) / 3600.0).clamp(-89.0, 89.0));
            [dx * degree[0] / 3600.0, dy * degree[1] / 3600.0]
        }
    };
    Ok(Heights::new(columns, rows, spacing, height))
}

/// A fixed-width field without its blanks.
fn field(bytes: &[u8], at: usize, width: usize) -> Result<&str, Wrong> {
    let field = bytes
        .get(at..at + width)
        .ok_or_else(|| Wrong::byte(bytes.len(), "ends here: the file is cut off"))?;
    let text =
        std::str::from_utf8(field).map_err(|_| Wrong::byte(at, "is not text, as a USGS DEM should be"))?;
    Ok(text.trim())
}

fn integer(bytes: &[u8], at: usize, width: usize) -> Result<i64, Wrong> {
    let text = field(bytes, at, width)?;
    text.parse().map_err(|_| Wrong::byte(at, format!("`{text}` is not the whole number of a USGS DEM")))
}

/// A Fortran real, whose exponent may be a `D`; blank is 0.
fn real(bytes: &[u8], at: usize, width: usize) -> Result<f64, Wrong> {
    let text = field(bytes, at, width)?;
    if text.is_empty() {
        return Ok(0.0);
    }
    let number = text.replace(['D', 'd'], "E").parse().ok().filter(|x: &f64| x.is_finite());
    number.ok_or_else(|| Wrong::byte(at, format!("`{text}` is not the number of a USGS DEM")))
}
