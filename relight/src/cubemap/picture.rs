//! Pixels of a picture gathered into texels.
//!
//! Every pixel is cut into samples so fine that each texel gets hundreds of them, whichever of the two is larger; a
//! texel is the mean of its samples, weighted by solid angle, so that a constant picture gives a constant cubemap.
//! One factor per colour then makes the energy exactly that of the pixels.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

use super::{n_texels, solid_angle, texel_of};
use crate::light::Equirect;

/// Samples along a side of a texel: the number in a texel then wavers by less than 1 %, and only light that changes
/// within the texel notices.
const SAMPLES: f64 = 20.0;

/// Adds a picture; the texels are kept with it for the next time.
pub(super) fn add_picture(n: usize, image: &Equirect, out: &mut [[f32; 3]]) {
    let scale = image.scale();
    image.with_cubemap(n, |texels| {
        for (sum, texel) in out.as_flattened_mut().iter_mut().zip(texels.as_flattened()) {
            *sum += scale * texel;
        }
    });
}

/// Average radiance over each texel, turned as the picture is but without its scale.
pub(crate) fn accumulate(image: &Equirect, n: usize) -> Vec<[f32; 3]> {
    let mut sums = vec![[0.0f64; 4]; n_texels(n)];
    let turn = DMat3::from_quat(image.orientation().as_dquat());
    let spacing = 2.0 / n as f64 / SAMPLES;
    let (width, height) = (image.width(), image.height());
    let n_strips = (PI / height as f64 / spacing).ceil();
    for (row, pixels) in image.pixels().chunks_exact(width).enumerate() {
        for strip in 0..n_strips as usize {
            let theta = |part: f64| PI * (row as f64 + (strip as f64 + part) / n_strips) / height as f64;
            let band = theta(0.0).cos() - theta(1.0).cos();
            add_strip(n, &turn, pixels, theta(0.5), band, spacing, &mut sums);
        }
    }
    averages(n, &sums)
}

/// Adds one line of samples at `theta` from the top, of `band` = Δ cos θ.
fn add_strip(
    n: usize,
    turn: &DMat3,
    pixels: &[[f32; 3]],
    theta: f64,
    band: f64,
    spacing: f64,
    sums: &mut [[f64; 4]],
) {
    let (sin_theta, cos_theta) = theta.sin_cos();
    let width = TAU / pixels.len() as f64;
    let per_pixel = (width * sin_theta / spacing).ceil().max(1.0);
    let step = width / per_pixel;
    let (sin_step, cos_step) = step.sin_cos();
    let (mut sin, mut cos) = (0.5 * step - PI).sin_cos();
    let weight = step * band;
    for pixel in pixels {
        let [r, g, b] = pixel.map(|c| f64::from(c) * weight);
        for _ in 0..per_pixel as usize {
            let d = *turn * DVec3::new(sin_theta * sin, cos_theta, -sin_theta * cos);
            let sum = &mut sums[texel_of(n, d.as_vec3())];
            *sum = [sum[0] + r, sum[1] + g, sum[2] + b, sum[3] + weight];
            (sin, cos) = (sin * cos_step + cos * sin_step, cos * cos_step - sin * sin_step);
        }
    }
}

/// Means of the samples, scaled to the samples' energy.
fn averages(n: usize, sums: &[[f64; 4]]) -> Vec<[f32; 3]> {
    let mean = |sum: &[f64; 4], c: usize| sum[c] / sum[3].max(f64::MIN_POSITIVE);
    let factor: [f64; 3] = std::array::from_fn(|c| {
        let wanted: f64 = sums.iter().map(|sum| sum[c]).sum();
        let found: f64 =
            sums.iter().enumerate().map(|(t, sum)| mean(sum, c) * f64::from(solid_angle(n, t))).sum();
        if found > 0.0 { wanted / found } else { 1.0 }
    });
    sums.iter().map(|sum| std::array::from_fn(|c| (mean(sum, c) * factor[c]) as f32)).collect()
}
