//! Splits a light into a few discs and a smooth rest, for methods that treat them apart.
//!
//! Caps stay what they are, the sun of a sky becomes one, and bright spots of a picture are taken out of it
//! as caps of the same energy and direction: of each pixel what is beyond the
//! picture's mean. The rest (uniform, overcast, dome, picture without spots) is
//! smooth enough for SH of order 3, which holds 99 % of what a diffuse surface can see of it.
//!
//! Limits: a spot is a disc of constant radiance; at most four per picture are found.
//!
//! Based on: Ramamoorthi and Hanrahan, An Efficient Representation for Irradiance Environment Maps, 2001
//! (why order 3).

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use super::equirect::image_direction;
use super::project::{add_dome, pixel_solid_angle, project_source_sh};
use super::{Cap, Equirect, Light, Source, turned};
use crate::cap::radius_of_area;
use crate::sh;

/// Order of the smooth rest.
pub const SMOOTH_ORDER: usize = 3;

/// Coefficients of the smooth rest.
const N_SMOOTH: usize = SMOOTH_ORDER * SMOOTH_ORDER;

/// A pixel belongs to a spot when its luminance is this many times the picture's mean. A cloud's silver
/// lining reaches ten; a sun thousands, even in a picture that clips it.
const SPOT_CONTRAST: f64 = 30.0;

/// Bright pixels within this angle of the brightest, in radians, are one spot: a sun with its blur is about
/// half as wide.
const SPOT_REACH: f32 = 0.1;

/// A spot with less than this part of the picture's energy stays in the smooth rest.
const SPOT_SHARE: f64 = 0.01;

/// More spots than this are not looked for.
const MAX_SPOTS: usize = 4;

/// Bright spots of a picture and the picture without them, in its own frame and scale.
#[derive(Debug)]
pub(super) struct Spots {
    caps: Vec<Cap>,
    /// `None` where there are no spots.
    rest: Option<Equirect>,
}

impl Light {
    /// This light with the bright spots of its pictures, suns above all, as discs: each has the power, the mean direction
    /// and about the size of its spot, and the picture without it goes on beside. Pictures are searched once, whatever
    /// their turn and scale.
    pub fn with_spots_as_discs(&self) -> Light {
        let mut light = Light::dark();
        for source in &self.sources {
            match source {
                Source::Equirect(image) => {
                    light.sources.push(Source::Equirect(image.without_spots()));
                    light.sources.extend(image.spots().map(Source::Cap));
                }
                other => light.sources.push(other.clone()),
            }
        }
        light
    }
}

impl Equirect {
    /// Its bright spots, in the world.
    fn spots(&self) -> impl Iterator<Item = Cap> + '_ {
        self.image_spots().caps.iter().map(|cap| Cap {
            axis: turned(self.orientation(), cap.axis),
            radiance: cap.radiance * self.scale(),
            ..*cap
        })
    }

    /// The picture without them.
    fn without_spots(&self) -> Equirect {
        match &self.image_spots().rest {
            Some(rest) => rest.scaled(self.scale()).rotated(self.orientation()),
            None => self.clone(),
        }
    }
}

/// Puts the discs of `light` into `caps` (cleared first; the horizon's cut of a setting sun becomes a dimmer
/// whole disc) and returns the SH coefficients of the rest, order [`SMOOTH_ORDER`].
///
/// Allocates only while `caps` grows beyond its capacity, and once per picture.
pub fn split(light: &Light, caps: &mut Vec<Cap>) -> [[f32; 3]; N_SMOOTH] {
    caps.clear();
    let mut smooth = [[0.0; 3]; N_SMOOTH];
    for source in &light.sources {
        match source {
            Source::Cap(cap) => caps.push(*cap),
            Source::Sky(sky) => {
                caps.extend(sky.sun_above_horizon());
                add_dome(sky, SMOOTH_ORDER, &mut smooth);
            }
            Source::Equirect(image) => split_equirect(image, caps, &mut smooth),
            Source::Uniform(_) | Source::CieOvercast(_) => {
                project_source_sh(source, SMOOTH_ORDER, &mut smooth)
            }
        }
    }
    smooth
}

fn split_equirect(image: &Equirect, caps: &mut Vec<Cap>, smooth: &mut [[f32; 3]; N_SMOOTH]) {
    caps.extend(image.spots());
    let rest = image.image_spots().rest.as_ref().unwrap_or(image).image_sh();
    let mut turned = [[0.0; 3]; N_SMOOTH];
    sh::rotate(SMOOTH_ORDER, image.orientation(), &rest[..N_SMOOTH], &mut turned);
    for (sum, c) in smooth.iter_mut().zip(turned) {
        *sum = (Vec3::from(*sum) + image.scale() * Vec3::from(c)).to_array();
    }
}

/// A bright pixel: where it is and what it sends beyond the picture's mean, W-like units of radiance × sr.
struct Bright {
    index: usize,
    direction: Vec3,
    luminance: f64,
    solid_angle: f64,
    flux: DVec3,
}

/// Groups the bright pixels of a picture around the brightest of them, one spot after the other.
pub(super) fn find_spots(image: &Equirect) -> Spots {
    let total = total_luminance(image);
    let mean = total / (4.0 * PI);
    let mut bright = bright_pixels(image, mean);
    bright.sort_by(|a, b| b.luminance.total_cmp(&a.luminance));

    let (mut caps, mut pixels) = (Vec::new(), None);
    while caps.len() < MAX_SPOTS
        && let Some(peak) = bright.first().map(|p| p.direction)
    {
        let (spot, others): (Vec<_>, Vec<_>) =
            bright.into_iter().partition(|p| p.direction.angle_between(peak) < SPOT_REACH);
        bright = others;
        let energy: f64 = spot.iter().map(|p| p.luminance * p.solid_angle).sum();
        if energy >= SPOT_SHARE * total {
            caps.push(disc_of(&spot));
            let pixels = pixels.get_or_insert_with(|| image.pixels().to_vec());
            for pixel in &spot {
                let kept = (mean / (mean + pixel.luminance)) as f32;
                pixels[pixel.index] = (kept * Vec3::from(pixels[pixel.index])).to_array();
            }
        }
    }
    Spots { caps, rest: pixels.and_then(|pixels| Equirect::new(image.width(), image.height(), pixels).ok()) }
}

/// ∫ luminance dω over the picture.
fn total_luminance(image: &Equirect) -> f64 {
    let row_sum = |(row, line): (usize, &[[f32; 3]])| {
        let sum: f64 = line.iter().map(luminance).sum();
        sum * pixel_solid_angle(image.width(), image.height(), row)
    };
    image.pixels().chunks_exact(image.width()).enumerate().map(row_sum).sum()
}

fn bright_pixels(image: &Equirect, mean: f64) -> Vec<Bright> {
    let (width, height) = (image.width(), image.height());
    let is_bright = |(_, pixel): &(usize, &[f32; 3])| luminance(pixel) > SPOT_CONTRAST * mean;
    let describe = |(i, pixel): (usize, &[f32; 3])| {
        let (row, column) = (i / width, i % width);
        let solid_angle = pixel_solid_angle(width, height, row);
        let direction =
            image_direction((column as f32 + 0.5) / width as f32, (row as f32 + 0.5) / height as f32);
        let beyond = luminance(pixel) - mean;
        let flux = Vec3::from(*pixel).as_dvec3() * (beyond / luminance(pixel) * solid_angle);
        Bright { index: i, direction, luminance: beyond, solid_angle, flux }
    };
    image.pixels().iter().enumerate().filter(is_bright).map(describe).collect()
}

/// The disc with the spot's energy and mean direction. Its solid angle (∫L)² / ∫L² is that of the spot if it
/// is a disc, and that of the peak if it has a halo.
fn disc_of(spot: &[Bright]) -> Cap {
    let energy: f64 = spot.iter().map(|p| p.luminance * p.solid_angle).sum();
    let square: f64 = spot.iter().map(|p| p.luminance * p.luminance * p.solid_angle).sum();
    let solid_angle = energy * energy / square;
    let flux: DVec3 = spot.iter().map(|p| p.flux).sum();
    let mean: DVec3 = spot.iter().map(|p| p.direction.as_dvec3() * (p.luminance * p.solid_angle)).sum();
    Cap {
        axis: mean.as_vec3().normalize_or(spot[0].direction),
        radius: radius_of_area(solid_angle) as f32,
        radiance: (flux / solid_angle).as_vec3(),
    }
}

fn luminance(pixel: &[f32; 3]) -> f64 {
    let [r, g, b] = pixel.map(f64::from);
    0.2126 * r + 0.7152 * g + 0.0722 * b
}
