//! Lights from the command line.

use std::path::Path;

use anyhow::{Result, anyhow, ensure};
use glam::{Quat, Vec3};
use lunette_relight::light::{Light, ParseContext, near_ratio};

use crate::args::LightOptions;
use crate::day;
use crate::progress::say;

/// A lamp nearer than this many radii of the scene is not "at a distance": its direction differs across the scene.
const NEAR_LAMP: f32 = 0.2;

/// One light per frame, each with its label. `bounds` is the scene's box.
pub fn frames(options: &LightOptions, bounds: (Vec3, Vec3)) -> Result<Vec<(String, Light)>> {
    let fixed = match &options.light {
        Some(spec) => Some(parse(spec, bounds)?),
        None => None,
    };
    ensure!(options.turn.is_finite(), "--turn: {} is not an angle", options.turn);
    let turn = Quat::from_rotation_y(-options.turn.to_radians());
    let Some(date) = &options.day else {
        return Ok(vec![(String::new(), fixed.unwrap_or_default().rotated(turn))]);
    };
    let mut frames =
        day::skies(date, options.at.as_deref().unwrap_or_default(), options.frames, options.turbidity)?;
    for (_, light) in &mut frames {
        light.sources.extend(fixed.iter().flat_map(|f| f.sources.iter().cloned()));
        *light = light.rotated(turn);
    }
    Ok(frames)
}

/// The light of a SPEC, as seen from the middle of the scene.
pub fn parse(spec: &str, (low, high): (Vec3, Vec3)) -> Result<Light> {
    let mut load = |path: &Path| {
        let picture = lunette_render::read_light(path).map_err(|e| e.to_string())?;
        if picture.n_negative() > 0 {
            say(&format!("{}: {} negative samples set to zero", path.display(), picture.n_negative()));
        }
        Ok(picture)
    };
    let mut context = ParseContext::new(&mut load);
    context.centre = 0.5 * (low + high);
    let light = Light::parse(spec, &mut context).map_err(|e| anyhow!("{e}"))?;
    let ratio = near_ratio(0.5 * (high - low).length(), context.nearest_lamp);
    if ratio > NEAR_LAMP {
        say(&format!(
            "a lamp is only {:.1} scene radii away: the baked sky takes it for one direction everywhere",
            1.0 / ratio
        ));
    }
    Ok(light)
}
