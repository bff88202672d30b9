//! SRTM tiles: one degree square, 1,201 or 3,601 posts a side, big-endian 16-bit metres, north first.
//!
//! The name, such as `N46W123.hgt`, is the south-west corner; from its latitude come the metres of a cell.
//!
//! Based on: Farr et al., The Shuttle Radar Topography Mission, 2007, and its documentation of the .hgt format.

use super::{Heights, Wrong, metres_per_degree};

/// Posts of a side at 3 and at 1 arc-second.
const SIDES: [usize; 2] = [1201, 3601];
const VOID: i16 = -32768;

pub fn read(bytes: &[u8], name: &str) -> Result<Heights, Wrong> {
    let Some(side) = SIDES.into_iter().find(|n| 2 * n * n == bytes.len()) else {
        let [three, one] = SIDES.map(|n| 2 * n * n);
        let found = bytes.len();
        return Err(
            format!("has {found} bytes; a tile has {three} (3\") or {one} (1\"): is it cut off?").into()
        );
    };
    let corner = latitude(name);
    let cell = metres_per_degree(corner.unwrap_or(0.0) + 0.5).map(|metres| metres / (side - 1) as f64);
    let posts = bytes.as_chunks::<2>().0.iter().map(|&pair| i16::from_be_bytes(pair));
    let height = posts.map(|h| if h == VOID { f32::NAN } else { f32::from(h) }).collect();
    let mut heights = Heights::new(side, side, cell, height);
    if corner.is_none() {
        heights.notes.push(
            "the name is not that of a tile (N46W123.hgt), so that its latitude is unknown: cells are as wide as \
             at the equator"
                .into(),
        );
    }
    Ok(heights)
}

/// Degrees north of a tile's southern border, from its name.
fn latitude(name: &str) -> Option<f64> {
    let sign = match name.bytes().next()? {
        b'N' | b'n' => 1.0,
        b'S' | b's' => -1.0,
        _ => return None,
    };
    let degrees: u32 = name.get(1..3)?.parse().ok()?;
    let side = name.get(3..4)?;
    let east = matches!(side, "E" | "e" | "W" | "w");
    (east && degrees <= 90).then(|| sign * f64::from(degrees))
}
