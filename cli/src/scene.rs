//! Scenes from the command line, and `lunette scene`.

use anyhow::{Context, Result, anyhow};
use lunette_scenes::{LoadOptions, Scene, Up, builtin};

use crate::args::{self, SceneOptions};
use crate::output;
use crate::progress::say;

/// Loads and, where asked for, subdivides a scene; says what was mended.
pub fn load(name: &str, options: &SceneOptions) -> Result<Scene> {
    let up = if options.up == "z" { Up::Z } else { Up::Y };
    let load = LoadOptions {
        up,
        scale: positive("scale", options.scale)?,
        vertical_scale: positive("vertical-scale", options.vertical_scale)?,
        crease_angle: degrees("crease-angle", options.crease_angle)?,
    };
    let mut scene = lunette_scenes::load(name, &load).map_err(|e| anyhow!("{e}"))?;
    if let Some(edge) = options.subdivide {
        lunette_scenes::subdivide(&mut scene, positive("subdivide", edge)?).map_err(|e| anyhow!("{e}"))?;
    }
    for line in &scene.report {
        say(&format!("{name}: {line}"));
    }
    let emitters = scene.materials.iter().filter(|m| m.emission.max_element() > 0.0).count();
    if emitters > 0 {
        say(&format!("{name}: {emitters} materials emit light (Ke); a bake holds only light from outside"));
    }
    say(&format!("{name}: {} vertices, {} triangles", scene.mesh.position.len(), scene.mesh.index.len()));
    Ok(scene)
}

/// Loads a scene as it is.
pub fn load_plain(name: &str) -> Result<Scene> {
    lunette_scenes::load(name, &LoadOptions::default()).map_err(|e| anyhow!("{e}"))
}

fn positive(option: &str, value: f32) -> Result<f32> {
    if value.is_finite() && (1e-9..=1e9).contains(&value) {
        return Ok(value);
    }
    Err(anyhow!("--{option}: {value} is not a number in 1e-9..=1e9"))
}

fn degrees(option: &str, value: f32) -> Result<f32> {
    if (0.0..=180.0).contains(&value) {
        return Ok(value.to_radians());
    }
    Err(anyhow!("--{option}: {value} is not in 0..=180 degrees"))
}

/// `lunette scene`
pub fn run(arguments: &args::Scene) -> Result<()> {
    if arguments.list {
        for scene in builtin::list() {
            println!("{:<20} {}", scene.name, scene.what);
            for p in scene.parameters {
                let default = p.default.map_or("by the scene".into(), |d| d.to_string());
                println!("    {:<16} {} [{default}; {} to {}]", p.name, p.what, p.low, p.high);
            }
        }
        return Ok(());
    }
    let name = arguments.name.as_deref().context("name a built-in scene, or --list")?;
    let output = arguments.output.as_deref().context("-o FILE.obj is missing")?;
    output::check_folder(output)?;
    let scene = builtin::build(name).map_err(|e| anyhow!("{e}"))?;
    lunette_scenes::write_obj(&scene, output).map_err(|e| anyhow!("{e}"))?;
    println!(
        "{}: {} vertices, {} triangles",
        output.display(),
        scene.mesh.position.len(),
        scene.mesh.index.len()
    );
    Ok(())
}
