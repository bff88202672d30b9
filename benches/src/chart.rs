//! Charts on logarithmic axes, as SVG, and a page of them that needs no other file.

use std::error::Error;
use std::fmt::Write as _;
use std::path::PathBuf;

use plotters::prelude::*;

/// Size of a chart, pixels.
const SIZE: (u32, u32) = (640, 440);

/// Eight colours that colour-blind readers can tell apart (Okabe & Ito, 2008), the faint yellow last.
const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
    RGBColor(240, 228, 66),
];

/// What a chart shows.
#[derive(Debug, Default)]
pub struct Chart {
    /// Over the chart.
    pub title: String,
    /// Under the axis, with its unit.
    pub x: String,
    /// Beside the axis, with its unit.
    pub y: String,
    /// In the order of the legend; its place gives a series its colour.
    pub series: Vec<Series>,
}

/// Points that belong together, joined by a line in the order given.
#[derive(Debug, Default)]
pub struct Series {
    /// In the legend of a page.
    pub name: String,
    /// What is not positive cannot be shown, and is left out.
    pub points: Vec<Point>,
}

/// A point and what stands beside it.
#[derive(Clone, Debug, Default)]
pub struct Point {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// May be empty.
    pub label: String,
}

/// A chart as an SVG element, without its legend.
///
/// # Errors
/// When there is no point to show, or drawing fails.
pub fn svg(chart: &Chart) -> Result<String, Box<dyn Error>> {
    let shown = || chart.series.iter().flat_map(|s| s.points.iter()).filter(|p| is_shown(p));
    let (x, y) = (extent(shown().map(|p| p.x))?, extent(shown().map(|p| p.y))?);
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let mut area = ChartBuilder::on(&root)
            .caption(&chart.title, ("sans-serif", 17))
            .margin(8)
            .x_label_area_size(40)
            .y_label_area_size(64)
            .build_cartesian_2d((x.0..x.1).log_scale(), (y.0..y.1).log_scale())?;
        area.configure_mesh()
            .x_desc(&chart.x)
            .y_desc(&chart.y)
            .x_label_formatter(&|v| number(*v))
            .y_label_formatter(&|v| number(*v))
            .light_line_style(RGBColor(244, 244, 244))
            .bold_line_style(RGBColor(222, 222, 222))
            .draw()?;
        for (i, series) in chart.series.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let points = || series.points.iter().filter(|p| is_shown(p));
            area.draw_series(LineSeries::new(points().map(|p| (p.x, p.y)), colour.stroke_width(2)))?;
            area.draw_series(points().map(|p| Circle::new((p.x, p.y), 3, colour.filled())))?;
            let font = ("sans-serif", 11).into_font().color(&colour);
            area.draw_series(
                points().map(|p| {
                    EmptyElement::at((p.x, p.y)) + Text::new(p.label.clone(), (5, -11), font.clone())
                }),
            )?;
        }
        root.present()?;
    }
    Ok(text)
}

fn is_shown(point: &Point) -> bool {
    point.x > 0.0 && point.y > 0.0 && point.x.is_finite() && point.y.is_finite()
}

/// From a little under the least value to a little over the greatest.
fn extent(values: impl Iterator<Item = f64>) -> Result<(f64, f64), Box<dyn Error>> {
    let (low, high) = values.fold((f64::MAX, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return Err("a chart without points".into());
    }
    Ok((low / 1.4, high * 1.6))
}

fn number(value: f64) -> String {
    if value >= 10000.0 { format!("{value:.0e}") } else { format!("{}", (value * 1e6).round() / 1e6) }
}

/// A page of headings, paragraphs and charts.
#[derive(Debug)]
pub struct Page {
    html: String,
}

impl Page {
    /// A page with its title and a first paragraph.
    pub fn new(title: &str, text: &str) -> Page {
        let html = format!(
            "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>{title}</title><style>\
             body{{font:16px/1.5 sans-serif;max-width:1340px;margin:2em auto;padding:0 1em;color:#222}}\
             p{{max-width:50em}}figure{{display:inline-block;width:640px;margin:0 8px 16px 0;vertical-align:top}}\
             figcaption{{font-size:.8em;margin-left:70px}}</style>\n<h1>{title}</h1>\n<p>{text}</p>\n"
        );
        Page { html }
    }

    /// A heading and what is to be said under it.
    pub fn section(&mut self, title: &str, text: &str) {
        let _ = writeln!(self.html, "<h2>{title}</h2>\n<p>{text}</p>");
    }

    /// A chart over its legend; charts stand side by side where there is room.
    ///
    /// # Errors
    /// As [`svg`].
    pub fn chart(&mut self, chart: &Chart) -> Result<(), Box<dyn Error>> {
        let _ = write!(self.html, "<figure>{}<figcaption>", svg(chart)?);
        for (i, series) in chart.series.iter().enumerate() {
            let RGBColor(r, g, b) = COLOURS[i % COLOURS.len()];
            let _ =
                write!(self.html, "<span style=\"color:rgb({r},{g},{b})\">&#9632;</span> {} ", series.name);
        }
        self.html.push_str("</figcaption></figure>\n");
        Ok(())
    }

    /// Writes the page into the target folder and says where it is.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write(&self, file: &str) -> Result<PathBuf, Box<dyn Error>> {
        let target = std::env::var_os("CARGO_TARGET_DIR")
            .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../target")), PathBuf::from);
        let path = target.join(file);
        std::fs::write(&path, &self.html).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(std::fs::canonicalize(&path).unwrap_or(path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chart_holds_every_positive_point_and_label() {
        let point = |x: f64, label: &str| Point { x, y: 0.5 * x, label: label.into() };
        let points = vec![point(1.0, "one"), point(100.0, "hundred"), point(0.0, "none")];
        let chart = Chart { series: vec![Series { name: "line".into(), points }], ..Chart::default() };
        let text = svg(&chart).unwrap();
        assert!(text.contains("one") && text.contains("hundred"));
        assert_eq!(text.matches("<circle").count(), 2);
        assert!(!text.contains("none\n"));
        let mut page = Page::new("title", "text");
        page.chart(&chart).unwrap();
        assert!(page.html.contains("line"));
        assert!(svg(&Chart::default()).is_err());
    }
}
