//! Pictures in memory: linear radiance, and the 8-bit picture a screen shows of it.
//!
//! Tone mapping: `y = curve(2^stops x)` per channel, then the sRGB transfer function (IEC 61966-2-1). The curve
//! is the identity up to [`KNEE`] and from there bends towards 1 without ever reaching it,
//! `y = k + (1 - k) (1 - exp(-(x - k) / (1 - k)))`, with equal slope on both sides: most of a well exposed
//! picture is shown as it is, and a sky keeps its gradients instead of clipping. It is for looking only; numbers
//! are taken from the linear picture.

use glam::Vec3;

/// Linear radiance, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Linear Rec.709, \[height x width\].
    pub pixels: Vec<Vec3>,
}

/// What a screen shows: 8-bit sRGB, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Picture {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// sRGB, \[height x width\].
    pub pixels: Vec<[u8; 3]>,
}

/// How bright a picture is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// Chosen from the picture by [`auto_exposure`].
    #[default]
    Auto,
    /// Radiance is multiplied by 2 to this power.
    Stops(f32),
}

/// Display value up to which the tone curve is the identity: a sunlit white wall (albedo 0.8) at the automatic
/// exposure of an ordinary outdoor picture lies just above it.
pub const KNEE: f32 = 0.6;

/// Display value that the automatic exposure gives the geometric mean of a picture. The photographer's 18 % grey,
/// raised since pictures of single objects have a bright sky behind them.
const MIDDLE_GREY: f32 = 0.26;

/// Radiance under this share of the brightest pixel's is "black": it does not count in the geometric mean, which
/// a few unlit pixels would otherwise drag to nothing.
const BLACK: f32 = 1e-4;

impl Image {
    /// An image of one colour.
    pub fn filled(width: usize, height: usize, colour: Vec3) -> Image {
        Image { width, height, pixels: vec![colour; width * height] }
    }
}

/// 8-bit picture of an image; channels that are not finite are shown as black.
pub fn tone_map(image: &Image, exposure: Exposure) -> Picture {
    let stops = match exposure {
        Exposure::Auto => auto_exposure(image),
        Exposure::Stops(stops) => stops,
    };
    let gain = stops.exp2();
    let pixels = image.pixels.iter().map(|p| (*p * gain).to_array().map(|x| to_srgb8(curve(x)))).collect();
    Picture { width: image.width, height: image.height, pixels }
}

/// Stops that bring the geometric mean of the luminance to a middle grey; 0 for a black image. Frames of one day
/// should share one exposure: ask once, and pass it on as [`Exposure::Stops`].
pub fn auto_exposure(image: &Image) -> f32 {
    // The brightest hundredth (a sun, a lamp) does not decide what "black" is.
    let mut luminances: Vec<f32> = image.pixels.iter().map(|&p| luminance(p)).filter(|l| *l > 0.0).collect();
    luminances.retain(|l| l.is_finite());
    if luminances.is_empty() {
        return 0.0;
    }
    let bright = luminances.len() * 99 / 100;
    let floor = *luminances.select_nth_unstable_by(bright, f32::total_cmp).1 * BLACK;
    let (sum, n) = luminances
        .iter()
        .filter(|l| **l >= floor)
        .fold((0.0f64, 0u32), |(sum, n), l| (sum + f64::from(l.log2()), n + 1));
    MIDDLE_GREY.log2() - (sum / f64::from(n)) as f32
}

/// Rec.709 luminance of linear RGB.
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// The tone curve of the module's head; 0 for what is negative or not a number.
fn curve(x: f32) -> f32 {
    if x > KNEE { KNEE + (1.0 - KNEE) * (1.0 - (-(x - KNEE) / (1.0 - KNEE)).exp()) } else { x.max(0.0) }
}

/// sRGB transfer function, rounded to 8 bits.
pub(crate) fn to_srgb8(x: f32) -> u8 {
    let y = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    (y * 255.0).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tone_curve_is_smooth_monotone_and_below_one() {
        let slope = |x: f32| (curve(x + 1e-3) - curve(x - 1e-3)) / 2e-3;
        assert!((curve(0.3) - 0.3).abs() < 1e-7);
        // Second differences at the knee are about 1e-3 / (1 - KNEE).
        assert!((slope(KNEE) - 1.0).abs() < 3e-3);
        let values: Vec<f32> = (0..60).map(|i| curve(0.1 * i as f32)).collect();
        assert!(values.windows(2).all(|w| w[0] < w[1]) && values[59] < 1.0);
    }

    #[test]
    fn srgb_known_values() {
        assert_eq!([0.0, 0.215_86, 1.0].map(to_srgb8), [0, 128, 255]);
    }

    #[test]
    fn exposure_stop_doubles_light() {
        let a = Image::filled(2, 2, Vec3::splat(0.1));
        let b = Image::filled(2, 2, Vec3::splat(0.2));
        assert_eq!(tone_map(&a, Exposure::Stops(1.0)), tone_map(&b, Exposure::Stops(0.0)));
    }

    #[test]
    fn auto_exposure_is_middle_grey_whatever_the_scale_and_the_sun() {
        let mut image = Image::filled(32, 32, Vec3::splat(7e-4));
        assert!((auto_exposure(&image).exp2() * 7e-4 - MIDDLE_GREY).abs() < 1e-3);
        image.pixels[3] = Vec3::splat(1e9);
        image.pixels[4] = Vec3::splat(f32::NAN);
        // One pixel of 1,024 moves the geometric mean by (1e9 / 7e-4)^(1/1024), 2.8 %.
        assert!((auto_exposure(&image).exp2() * 7e-4 / MIDDLE_GREY - 1.0).abs() < 0.03);
    }

    #[test]
    fn black_image_stays_black() {
        assert_eq!(auto_exposure(&Image::filled(4, 4, Vec3::ZERO)), 0.0);
        let nan = Image::filled(1, 1, Vec3::new(f32::NAN, 0.0, -1.0));
        assert_eq!(tone_map(&nan, Exposure::Auto).pixels, [[0, 0, 0]]);
    }
}
