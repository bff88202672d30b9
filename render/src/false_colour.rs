//! False-colour pictures of an error or of a count, with a legend.
//!
//! Colours: the viridis map (dark blue, green, yellow: even steps look even, also without colour vision), as a
//! polynomial of degree 6 per channel, within 4 of 255 of the table.
//! Based on: Nathaniel Smith and Stéfan van der Walt, A Better Default Colormap for Matplotlib, 2015; the polynomial
//! is Matt Zucker's, 2019.
//!
//! The legend is a bar under the picture, from 0 at the left to the top of the scale at the right, with labelled
//! ticks in percent of the reference's mean. Pictures narrower than [`NARROWEST`] get no legend: no label fits.

use crate::error::Error;
use crate::font::{self, GLYPH_HEIGHT};
use crate::image::{Image, Picture};
use crate::measure;

/// How an error is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Scale {
    /// Up to the 99th percentile, rounded up to 1, 2 or 5 times a power of ten.
    #[default]
    Fit,
    /// Up to this error, in units of the reference's mean: pictures to be laid side by side want the same.
    UpTo(f32),
}

/// Narrowest picture that gets a legend, pixels.
pub const NARROWEST: usize = 120;

/// Pixels above and below the legend's parts.
const MARGIN: usize = 4;
/// Height of the colour bar, pixels.
const BAR: usize = 10;
/// Height of a tick under the bar, pixels.
const TICK: usize = 3;
/// Height of the whole legend, pixels.
const LEGEND: usize = 2 * MARGIN + BAR + TICK + 1 + GLYPH_HEIGHT;

/// Behind the legend, and where pixels do not count.
const BACKGROUND: [u8; 3] = [24, 24, 24];
/// Ticks and labels.
const INK: [u8; 3] = [235, 235, 235];

/// Draws |a - b| of each pixel in units of the mean of the reference `b`, by `scale`, over a legend. With a `weight` per
/// pixel (its coverage), mean and scale come from the surfaces alone; pixels of no weight are dark.
///
/// # Errors
/// [`Error::Options`] where sizes differ, a pixel is not finite, or the scale is not above 0.
pub fn error_picture(a: &Image, b: &Image, weight: Option<&[f32]>, scale: Scale) -> Result<Picture, Error> {
    if (a.width, a.height) != (b.width, b.height) {
        let what = format!("error picture: {}x{} against {}x{} pixels", a.width, a.height, b.width, b.height);
        return Err(Error::Options { what });
    }
    let errors = measure::element_errors(&a.pixels, &b.pixels, weight)?;
    let top = match scale {
        Scale::UpTo(top) if top > 0.0 && top.is_finite() => top,
        Scale::UpTo(top) => {
            return Err(Error::Options { what: format!("error picture: scale {top} is not above 0") });
        }
        Scale::Fit => round_up(measure::difference(&a.pixels, &b.pixels, weight)?.percentile_99 as f32),
    };
    let counts = |i: usize| weight.is_none_or(|w| w[i] > 0.0);
    let colour = |(i, e): (usize, &f32)| if counts(i) { viridis(e / top) } else { BACKGROUND };
    let pixels = errors.iter().enumerate().map(colour).collect();
    let mut picture = Picture { width: a.width, height: a.height, pixels };
    if picture.width >= NARROWEST {
        add_legend(&mut picture, top, percent);
    }
    Ok(picture)
}

/// Draws a count per pixel (the first channel), up to its largest rounded up to 1, 2 or 5 times a power of ten, over a
/// legend. Pixels of no weight are dark; those that see the scene in part have their mean over that part.
///
/// # Errors
/// [`Error::Options`] where sizes differ or a count is not finite.
pub fn count_picture(counts: &Image, weight: &[f32]) -> Result<Picture, Error> {
    if weight.len() != counts.pixels.len() || counts.pixels.iter().any(|p| !p.x.is_finite()) {
        let what = format!("count picture: {} pixels, {} weights", counts.pixels.len(), weight.len());
        return Err(Error::Options { what });
    }
    let of = |i: usize| (weight[i] > 0.0).then(|| counts.pixels[i].x / weight[i]);
    let top = round_up((0..weight.len()).filter_map(of).fold(1.0, f32::max));
    let pixels = (0..weight.len()).map(|i| of(i).map_or(BACKGROUND, |n| viridis(n / top))).collect();
    let mut picture = Picture { width: counts.width, height: counts.height, pixels };
    if picture.width >= NARROWEST {
        add_legend(&mut picture, top, |n| format!("{n:.0}"));
    }
    Ok(picture)
}

/// Viridis at 0..=1; values outside are clamped.
pub fn viridis(x: f32) -> [u8; 3] {
    // Least squares over the 256 entries of the table, lowest power first.
    const R: [f32; 7] = [0.277_727, 0.105_093, -0.330_862, -4.634_23, 6.228_27, 4.776_385, -5.435_456];
    const G: [f32; 7] = [0.005_407, 1.404_614, 0.214_848, -5.799_101, 14.179_934, -13.745_146, 4.645_853];
    const B: [f32; 7] = [0.334_1, 1.384_59, 0.095_095, -19.332_441, 56.690_55, -65.353_033, 26.312_435];
    let x = x.clamp(0.0, 1.0);
    [R, G, B].map(|c| {
        let y = c.iter().rev().fold(0.0, |y, c| y * x + c);
        (255.0 * y).round().clamp(0.0, 255.0) as u8
    })
}

/// The next 1, 2 or 5 times a power of ten, at least 1e-6; at most 1e6 for an infinite error.
fn round_up(x: f32) -> f32 {
    let x = x.clamp(1e-6, 1e6);
    let decade = 10.0f32.powf(x.log10().floor());
    // A hair over, since the power of ten is rounded.
    [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|top| *top >= x * 0.9999).unwrap_or(x)
}

fn add_legend(picture: &mut Picture, top: f32, text: impl Fn(f32) -> String) {
    let (width, bar_top) = (picture.width, picture.height + MARGIN);
    picture.height += LEGEND;
    picture.pixels.resize(width * picture.height, BACKGROUND);

    // The bar, with room beside it for half a label.
    let side = MARGIN + font::width("100%") / 2;
    let last = width - 2 * side - 1;
    for i in 0..=last {
        let colour = viridis(i as f32 / last as f32);
        for y in bar_top..bar_top + BAR {
            picture.pixels[y * width + side + i] = colour;
        }
    }

    // Ticks and their labels.
    let n_ticks = if width >= 3 * NARROWEST { 4 } else { 2 };
    for k in 0..=n_ticks {
        let x = side + last * k / n_ticks;
        for y in bar_top + BAR..bar_top + BAR + TICK {
            picture.pixels[y * width + x] = INK;
        }
        let label = text(top * k as f32 / n_ticks as f32);
        let left = x.saturating_sub(font::width(&label) / 2).min(width.saturating_sub(font::width(&label)));
        font::draw(picture, left, bar_top + BAR + TICK + 1, &label, INK);
    }
}

/// A share as percent with at most 3 significant digits.
fn percent(share: f32) -> String {
    let x = 100.0 * share;
    let decimals = if x == 0.0 { 0 } else { (2 - x.log10().floor() as i32).clamp(0, 6) as usize };
    let digits = format!("{x:.decimals$}");
    let digits =
        if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { &digits };
    format!("{digits}%")
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn counts_are_coloured_up_to_the_largest_and_leave_the_background_dark() {
        let counts = Image { width: 3, height: 1, pixels: [0.0, 20.0, 0.0].map(Vec3::splat).to_vec() };
        // The middle pixel sees the scene with half of its rays: 40 there.
        let picture = count_picture(&counts, &[1.0, 0.5, 0.0]).unwrap();
        assert_eq!(picture.pixels, [viridis(0.0), viridis(40.0 / 50.0), BACKGROUND]);
        assert!(count_picture(&counts, &[1.0]).is_err());
    }

    #[test]
    fn viridis_matches_table_and_brightens() {
        // Entries 0, 64, 128, 191 and 255 of the published table.
        let table = [
            (0, [68, 1, 84]),
            (64, [59, 82, 139]),
            (128, [33, 145, 140]),
            (191, [92, 200, 99]),
            (255, [253, 231, 37]),
        ];
        for (i, expected) in table {
            let found = viridis(i as f32 / 255.0);
            for c in 0..3 {
                // The polynomial's largest distance from the table.
                assert!(found[c].abs_diff(expected[c]) <= 4, "{i}: {found:?} {expected:?}");
            }
        }
        let luminance = |i: u32| {
            let c = viridis(i as f32 / 20.0).map(f32::from);
            0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
        };
        assert!((0..20).all(|i| luminance(i) < luminance(i + 1)));
    }

    #[test]
    fn scale_is_rounded_up() {
        for (x, expected) in
            [(0.0, 1e-6), (0.013, 0.02), (0.2, 0.2), (0.6, 1.0), (3.1, 5.0), (f32::INFINITY, 1e6)]
        {
            assert!((round_up(x) / expected - 1.0).abs() < 1e-5, "{x}");
        }
    }

    #[test]
    fn percent_has_three_digits() {
        let found = [0.0, 0.0005, 0.015, 0.5, 1.0, 12.5].map(percent);
        assert_eq!(found, ["0%", "0.05%", "1.5%", "50%", "100%", "1250%"]);
    }

    #[test]
    fn error_picture_has_legend_where_it_fits() {
        for (width, height) in [(NARROWEST - 1, 4), (NARROWEST, 4), (640, 4)] {
            let b = Image::filled(width, height, Vec3::ONE);
            let mut a = b.clone();
            a.pixels[0] = Vec3::splat(1.5);
            let picture = error_picture(&a, &b, None, Scale::UpTo(0.5)).unwrap();
            assert_eq!(picture.pixels[0], viridis(1.0));
            assert_eq!(picture.pixels[1], viridis(0.0));
            assert_eq!(picture.height, if width < NARROWEST { height } else { height + LEGEND });
            assert_eq!(picture.pixels.len(), picture.width * picture.height);
            assert_eq!(picture.pixels.contains(&INK), width >= NARROWEST);
        }
    }

    #[test]
    fn error_picture_leaves_weightless_pixels_dark() {
        let (a, b) = (Image::filled(2, 1, Vec3::ONE), Image::filled(2, 1, Vec3::splat(2.0)));
        let picture = error_picture(&a, &b, Some(&[0.0, 1.0]), Scale::UpTo(0.5)).unwrap();
        assert_eq!(picture.pixels, [BACKGROUND, viridis(1.0)]);
    }

    #[test]
    fn error_picture_refuses_other_sizes_and_scales() {
        let (a, b) = (Image::filled(2, 3, Vec3::ONE), Image::filled(3, 2, Vec3::ONE));
        assert!(error_picture(&a, &b, None, Scale::Fit).is_err());
        assert!(error_picture(&a, &a, None, Scale::UpTo(-1.0)).is_err());
    }
}
