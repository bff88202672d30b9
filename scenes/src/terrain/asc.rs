//! ESRI ASCII grids.
//!
//! A header of `key value` lines in any case and order (`ncols`, `nrows`, `xllcorner` or `xllcenter`, likewise y,
//! `cellsize` or `dx` and `dy`, `nodata_value`), then `nrows` lines of `ncols` heights in metres, north first.
//! `nan` is void. The format says nothing of units: spacing is taken as metres, with a note where it looks like
//! degrees.
//!
//! Based on: Esri, ASCII raster format, ArcGIS documentation.

use super::{Heights, Wrong, check_size};

/// What void is where the header does not say.
const USUAL_NODATA: f64 = -9999.0;

/// A height and the space or line end after it: the fewest bytes of a post.
const LEAST_BYTES: usize = 2;

#[derive(Default)]
struct Header {
    columns: Option<u64>,
    rows: Option<u64>,
    dx: Option<f64>,
    dy: Option<f64>,
    corner: [Option<f64>; 2],
    nodata: Option<f64>,
}

pub fn read(bytes: &[u8]) -> Result<Heights, Wrong> {
    let text = std::str::from_utf8(bytes)
        .map_err(|e| Wrong::byte(e.valid_up_to(), "is not text, as an ESRI ASCII grid should be"))?;
    let mut lines = text.lines().enumerate().peekable();
    let mut header = Header::default();
    let mut last = 1;
    // Keys begin with a letter; so does `nan`, which is a height.
    let is_key = |line: &str| {
        let word = line.split_ascii_whitespace().next().unwrap_or_default();
        word.starts_with(|c: char| c.is_alphabetic() || c == '_') && !word.eq_ignore_ascii_case("nan")
    };
    while let Some((i, line)) = lines.next_if(|(_, line)| line.trim().is_empty() || is_key(line)) {
        last = i + 1;
        header.set(line).map_err(|what| Wrong::line(last, what))?;
    }
    let missing = |what: &str| Wrong::line(last, format!("the header ends here without `{what}`"));
    let columns = header.columns.ok_or_else(|| missing("ncols"))?;
    let rows = header.rows.ok_or_else(|| missing("nrows"))?;
    let dx = header.dx.ok_or_else(|| missing("cellsize"))?;
    let dy = header.dy.ok_or_else(|| missing("cellsize"))?;
    let size = check_size(columns, rows, bytes.len(), LEAST_BYTES);
    let (columns, rows) = size.map_err(|what| Wrong::line(last, what))?;

    let nodata = header.nodata.unwrap_or(USUAL_NODATA);
    let mut height = Vec::with_capacity(columns * rows);
    let full = lines.filter(|(_, line)| !line.trim().is_empty());
    for (i, line) in full {
        last = i + 1;
        if height.len() == columns * rows {
            return Err(Wrong::line(last, format!("there is more after the {rows} rows of the header")));
        }
        row(line, columns, nodata, &mut height).map_err(|what| Wrong::line(last, what))?;
    }
    if height.len() < columns * rows {
        let found = height.len() / columns;
        return Err(Wrong::line(last, format!("ends after {found} of {rows} rows; is the file cut off?")));
    }
    let mut heights = Heights::new(columns, rows, [dx, dy], height);
    heights.notes.extend(degrees_note(&header, [dx * columns as f64, dy * rows as f64]));
    Ok(heights)
}

impl Header {
    fn set(&mut self, line: &str) -> Result<(), String> {
        let mut words = line.split_ascii_whitespace();
        let Some(key) = words.next() else { return Ok(()) };
        let value = words.next().ok_or_else(|| format!("`{key}` has no value"))?;
        let wrong = || format!("`{key}` should have a number, not `{value}`");
        let count =
            || value.parse::<u64>().map_err(|_| format!("`{key}` should have a count, not `{value}`"));
        let number = || value.parse::<f64>().map_err(|_| wrong());
        let finite = || number().and_then(|x| if x.is_finite() { Ok(x) } else { Err(wrong()) });
        match key.to_ascii_lowercase().as_str() {
            "ncols" => self.columns = Some(count()?),
            "nrows" => self.rows = Some(count()?),
            "cellsize" => (self.dx, self.dy) = (Some(finite()?), Some(finite()?)),
            "dx" | "xdim" => self.dx = Some(finite()?),
            "dy" | "ydim" => self.dy = Some(finite()?),
            "xllcorner" | "xllcenter" => self.corner[0] = Some(finite()?),
            "yllcorner" | "yllcenter" => self.corner[1] = Some(finite()?),
            // The one number that may be NaN.
            "nodata_value" | "nodata" => self.nodata = Some(number()?),
            _ => {
                let known = "ncols, nrows, xllcorner, yllcorner, cellsize, nodata_value";
                return Err(format!("`{key}` is no key of an ESRI ASCII grid; these are: {known}"));
            }
        }
        Ok(())
    }
}

fn row(line: &str, columns: usize, nodata: f64, height: &mut Vec<f32>) -> Result<(), String> {
    let before = height.len();
    for word in line.split_ascii_whitespace() {
        let h: f64 = word.parse().map_err(|_| format!("`{word}` is no height"))?;
        if h.is_infinite() {
            return Err(format!("`{word}` is no height"));
        }
        let void = h.is_nan() || h == nodata;
        height.push(if void { f32::NAN } else { h as f32 });
        if height.len() - before > columns {
            break;
        }
    }
    match height.len() - before {
        n if n == columns => Ok(()),
        n if n > columns => Err(format!("has more than the {columns} heights of the header")),
        n => Err(format!("has {n} heights; the header says {columns}")),
    }
}

/// A corner on the globe and an extent of a few degrees hardly mean metres.
fn degrees_note(header: &Header, extent: [f64; 2]) -> Option<String> {
    let [x, y] = header.corner;
    let global = x?.abs() <= 180.0 && y?.abs() <= 90.0 && extent[0] <= 360.0 && extent[1] <= 180.0;
    let tiny = header.dx? < 0.02;
    (global && tiny).then(|| {
        let [east, north] = metres_per_cell(header.dx.unwrap_or(0.0), y.unwrap_or(0.0) + 0.5 * extent[1]);
        format!(
            "the spacing looks like degrees and is read as metres; with `dx {east:.3}` and `dy {north:.3}` for \
             `cellsize` it would be metres"
        )
    })
}

fn metres_per_cell(degrees: f64, latitude: f64) -> [f64; 2] {
    super::metres_per_degree(latitude).map(|metres| metres * degrees)
}
