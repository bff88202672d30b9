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

/// Radiance that the glossy vertices add as seen from an eye, of all vertices, after an engine's last frame; empty where
/// there are none. And what that took, for the line about the frame.
pub fn specular(engine: &mut Engine, eye: Vec3, irradiance: &[[f32; 3]]) -> (Vec<Vec3>, String) {
    let Some((glossy, frame)) = engine.glossy() else { return (Vec::new(), String::new()) };
    let mut lobes = vec![[0.0; 3]; glossy.vertices().len()];
    let started = Instant::now();
    glossy.project(frame, irradiance);
    glossy.radiance_parallel(eye.to_array(), &mut lobes);
    let milliseconds = started.elapsed().as_secs_f64() * 1e3;
    let mut all = vec![Vec3::ZERO; irradiance.len()];
    for (&v, s) in glossy.vertices().iter().zip(&lobes) {
        all[v as usize] = Vec3::from(*s).max(Vec3::ZERO);
    }
    (all, format!(", {} glossy ones seen in {milliseconds:.2} ms", lobes.len()))
}

/// The picture of an engine's last frame, glossy vertices as the camera sees them.
pub fn shade(
    engine: &mut Engine,
    visibility: &Visibility,
    surface: &Surface,
    irradiance: &[[f32; 3]],
    light: &Light,
) -> Result<Image> {
    let (specular, _) = specular(engine, visibility.eye(), irradiance);
    let mut radiance = stage::radiance(surface, irradiance);
    radiance.iter_mut().zip(specular).for_each(|(r, s)| *r += s);
    stage::shade(visibility, surface, &radiance, Around { light, portals: engine.portals() })
}
