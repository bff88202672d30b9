//! Glossy materials on the command line.

use anyhow::Result;
use glam::Vec3;
use lunette_relight::glossy::HIGHEST_EXPONENT;
use lunette_relight::light::Light;
use lunette_render::{Gloss, Image, Surface, Visibility};
use lunette_scenes::{Portal, Scene};

use crate::engine::Engine;
use crate::progress::say;
use crate::stage::{self, Around};

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

/// The picture of an engine's last frame, glossy vertices as the camera sees them.
pub fn shade(
    engine: &mut Engine,
    visibility: &Visibility,
    surface: &Surface,
    irradiance: &[[f32; 3]],
    light: &Light,
) -> Result<Image> {
    let radiance = stage::radiance(surface, irradiance);
    stage::shade(visibility, surface, &radiance, Around { light, through: engine.through(irradiance) })
}
