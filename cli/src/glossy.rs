//! Glossy materials on the command line.

use std::time::Instant;

use anyhow::Result;
use glam::Vec3;
use lunette_relight::glossy::HIGHEST_EXPONENT;
use lunette_relight::light::Light;
use lunette_render::{Gloss, Image, Surface, Visibility};
use lunette_scenes::{Portal, Scene};

use crate::engine::Engine;
use crate::progress::say;
use crate::stage;

/// Says which materials a bake takes otherwise than their file has them.
pub fn report(scene: &Scene, name: &str, portals: &[Portal]) {
    scene.gloss_report(HIGHEST_EXPONENT).iter().for_each(|line| say(&format!("{name}: {line}")));
    let is_glossy = scene.materials.iter().any(|m| m.lobe(HIGHEST_EXPONENT).is_some());
    if is_glossy && portals.is_empty() {
        say(&format!(
            "{name}: under the open sky glossy materials are baked as diffuse; an interior keeps them"
        ));
    }
}

/// The gloss of a scene as the reference takes it.
pub struct Coat {
    specular: Vec<Vec3>,
    exponent: Vec<f32>,
}

impl Coat {
    /// Of the scene of that name; says which materials are taken otherwise than their file has them.
    pub fn new(scene: &Scene, name: &str) -> Coat {
        scene.gloss_report(HIGHEST_EXPONENT).iter().for_each(|line| say(&format!("{name}: {line}")));
        let (specular, exponent) =
            scene.vertex_lobes(HIGHEST_EXPONENT).iter().map(|l| (l.specular, l.exponent)).unzip();
        Coat { specular, exponent }
    }

    /// A view of it.
    pub fn gloss(&self) -> Gloss<'_> {
        Gloss { specular: &self.specular, exponent: &self.exponent }
    }
}

/// The picture of an engine's last frame, glossy vertices as the camera sees them; and what that took, for the line
/// about the frame.
pub fn shade(
    engine: &mut Engine,
    visibility: &Visibility,
    surface: &Surface,
    irradiance: &[[f32; 3]],
    light: &Light,
) -> Result<(Image, String)> {
    let mut radiance = stage::radiance(surface, irradiance);
    let mut note = String::new();
    if let Some((glossy, frame)) = engine.glossy() {
        let mut specular = vec![[0.0; 3]; glossy.vertices().len()];
        let started = Instant::now();
        glossy.project(frame, irradiance);
        glossy.aim(frame, light);
        glossy.radiance_parallel(visibility.eye().to_array(), &mut specular);
        let milliseconds = started.elapsed().as_secs_f64() * 1e3;
        for (&v, s) in glossy.vertices().iter().zip(&specular) {
            radiance[v as usize] += Vec3::from(*s).max(Vec3::ZERO);
        }
        note = format!(", {} glossy ones seen in {milliseconds:.2} ms", specular.len());
    }
    Ok((stage::shade_radiance(visibility, surface, &radiance, light)?, note))
}
