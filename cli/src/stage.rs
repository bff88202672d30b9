//! A scene ready for pictures: its surface, its camera and what each pixel sees.

use anyhow::{Context, Result, anyhow, ensure};
use glam::Vec3;
use lunette_relight::asset::Asset;
use lunette_relight::light::Light;
use lunette_render::{Camera, Exposure, Image, Surface, Through, Tracer, Visibility};

use crate::args::PictureOptions;

/// The longest side of a picture, pixels: a poster.
const LONGEST_SIDE: usize = 32768;

/// Most pixels of a picture: 1.5 GiB of radiance.
const MOST_PIXELS: usize = 1 << 27;

/// The surface of an asset, as the renderer takes it.
pub fn surface<'a>(asset: &'a Asset) -> Surface<'a> {
    Surface {
        position: bytemuck::cast_slice(asset.positions()),
        normal: bytemuck::cast_slice(asset.normals()),
        index: asset.triangles(),
        albedo: bytemuck::cast_slice(asset.albedo()),
    }
}

/// Width and height of the picture asked for.
pub fn size(options: &PictureOptions) -> Result<(usize, usize)> {
    parse_size(&options.size)
}

/// Width and height from `WxH`.
pub fn parse_size(text: &str) -> Result<(usize, usize)> {
    let wrong = || anyhow!("--size: '{text}' is not WIDTHxHEIGHT in 1..={LONGEST_SIDE}");
    let (w, h) = text.split_once('x').ok_or_else(wrong)?;
    let side = |s: &str| s.parse().ok().filter(|n| (1..=LONGEST_SIDE).contains(n)).ok_or_else(wrong);
    let (w, h) = (side(w)?, side(h)?);
    ensure!(w * h <= MOST_PIXELS, "--size: {w} x {h} is more than {MOST_PIXELS} pixels");
    Ok((w, h))
}

/// The camera asked for, or one that frames the scene.
pub fn camera(options: &PictureOptions, tracer: &Tracer) -> Result<Camera> {
    let (w, h) = size(options)?;
    match &options.camera {
        Some(text) => text.parse().map_err(|e| anyhow!("{e}")),
        None => Ok(lunette_render::frame(tracer, w as f32 / h as f32)),
    }
}

/// Stops, where given.
pub fn exposure(options: &PictureOptions) -> Result<Exposure> {
    match options.exposure {
        None => Ok(Exposure::Auto),
        Some(ev) => {
            ensure!(ev.is_finite() && ev.abs() <= 100.0, "--exposure: {ev} is not in -100..=100 stops");
            Ok(Exposure::Stops(ev))
        }
    }
}

/// What each pixel sees from the camera asked for.
pub fn visibility(options: &PictureOptions, surface: Surface) -> Result<Visibility> {
    let tracer = Tracer::new(surface).map_err(|e| anyhow!("{e}"))?;
    let camera = camera(options, &tracer)?;
    let (w, h) = size(options)?;
    lunette_render::trace(&tracer, &camera, w, h).map_err(|e| anyhow!("{e}"))
}

/// What the albedo of each vertex sends out.
pub fn radiance(surface: &Surface, irradiance: &[[f32; 3]]) -> Vec<Vec3> {
    let irradiance: &[Vec3] = bytemuck::cast_slice(irradiance);
    let lit: Vec<Vec3> = irradiance.iter().map(|e| e.max(Vec3::ZERO)).collect();
    lunette_render::vertex_radiance(&lit, surface.albedo)
}

/// What a picture shows beside the radiance of vertices.
#[derive(Clone, Copy)]
pub struct Around<'a> {
    /// Behind all surfaces.
    pub light: &'a Light,
    /// Portals whose suns and lobes are sharper than the mesh of their asset.
    pub through: Option<Through<'a>>,
}

/// The picture of vertices that send out this radiance; those of the asset come first.
pub fn shade(visibility: &Visibility, surface: &Surface, radiance: &[Vec3], around: Around) -> Result<Image> {
    visibility
        .shade_through(around.through, surface, radiance, |d| around.light.radiance(d))
        .map_err(|e| anyhow!("{e}"))
        .context("picture")
}
