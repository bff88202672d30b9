//! `lunette bake`

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Result, anyhow, bail};
use lunette_bake::{Basis, Options, PortalOptions};
use lunette_relight::asset::Asset;
use lunette_scenes::{Portal, Scene};

use crate::args::{self, Effort};
use crate::output;
use crate::progress::{Bar, say};
use crate::{glossy, portals, scene};

/// `lunette bake`
pub fn run(arguments: &args::Bake) -> Result<()> {
    let options = options(&arguments.basis, &arguments.effort)?;
    options.check().map_err(|e| anyhow!("{e}"))?;
    let path = arguments.output.clone().unwrap_or_else(|| default_output(&arguments.scene));
    output::check_folder(&path)?;
    let portal_options = portals::options(&arguments.portals)?;
    let mut scene = scene::load(&arguments.scene, &arguments.read)?;
    let portals = portals::take(&mut scene, &arguments.scene, &arguments.portals)?;
    glossy::report(&scene, &arguments.scene, &portals);
    let started = Instant::now();
    let asset = if portals.is_empty() {
        bake(&scene, &arguments.scene, &options)?
    } else {
        bake_portals(&scene, &portals, &arguments.scene, &options, &portal_options)?
    };
    let bytes = asset.to_bytes().map_err(|e| anyhow!("{e}"))?;
    lunette_render::write_atomically(&path, &bytes).map_err(|e| anyhow!("{e}"))?;
    let per_vertex = bytes.len() as f64 / scene.mesh.position.len() as f64;
    println!(
        "{}: {:.1} MB, {per_vertex:.0} bytes per vertex with the mesh, {:.1} s",
        path.display(),
        bytes.len() as f64 / 1e6,
        started.elapsed().as_secs_f64()
    );
    Ok(())
}

/// Bakes with a progress bar and the scene's name in the result.
pub fn bake(scene: &Scene, name: &str, options: &Options) -> Result<Asset<'static>> {
    let bar = Bar::new("M rays", 1e6);
    let mut asset = lunette_bake::bake(scene, options, &bar).map_err(|e| anyhow!("{e}"))?;
    asset.metadata.scene = short_name(name);
    Ok(asset)
}

/// As [`bake`], for an interior.
pub fn bake_portals(
    scene: &Scene,
    portals: &[Portal],
    name: &str,
    options: &Options,
    portal_options: &PortalOptions,
) -> Result<Asset<'static>> {
    let bar = Bar::new("M rays", 1e6);
    let (mut asset, report) = lunette_bake::bake_portals(scene, portals, options, portal_options, &bar)
        .map_err(|e| anyhow!("{e}"))?;
    drop(bar);
    report.lines.iter().for_each(|line| say(line));
    if !report.energy.is_empty() {
        let shares = lunette_bake::cumulative(&report.energy);
        let shares: Vec<String> = shares.iter().map(|s| format!("{:.1}", 100.0 * s)).collect();
        say(&format!("bounced light: % of the energy in the first 1, 2, ... SH bands: {}", shares.join(" ")));
    }
    asset.metadata.scene = short_name(name);
    Ok(asset)
}

fn short_name(name: &str) -> String {
    Path::new(name).file_name().map_or(name.into(), |n| n.to_string_lossy().into_owned())
}

/// Options of a bake from the command line.
pub fn options(basis: &[String], effort: &Effort) -> Result<Options> {
    let indirect_order = effort.indirect_order.unwrap_or(effort.order);
    Ok(Options {
        basis: basis.iter().map(|b| self::basis(b)).collect::<Result<_>>()?,
        order: effort.order,
        indirect_order,
        rays: effort.rays,
        bounces: effort.bounces,
        seed: effort.seed,
        threads: effort.threads,
    })
}

fn basis(name: &str) -> Result<Basis> {
    Ok(match name {
        "bent" => Basis::Bent,
        "aperture" => Basis::Aperture,
        "sh" => Basis::Sh,
        _ => bail!("--basis: there is no '{name}'; there are bent, aperture, sh"),
    })
}

/// The scene's name with `.safetensors`, in the current folder.
fn default_output(scene: &str) -> PathBuf {
    let name =
        Path::new(scene).file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
    PathBuf::from(format!("{}.safetensors", name.split(':').next().unwrap_or("scene")))
}
