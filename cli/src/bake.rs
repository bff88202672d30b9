//! `lunette bake`

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Result, anyhow, ensure};
use lunette_bake::{Basis, Options, PortalOptions, PortalReport};
use lunette_relight::asset::Asset;
use lunette_relight::sh::MAX_ORDER;
use lunette_scenes::{Portal, Scene};

use crate::args::{self, Bands, Effort};
use crate::output;
use crate::progress::{Bar, say};
use crate::{glossy, portals, relight, scene};

/// `lunette bake`
pub fn run(arguments: &args::Bake) -> Result<()> {
    let asked = basis(&arguments.basis)?;
    let mut options = options(asked.clone(), &arguments.effort);
    options.check().map_err(|e| anyhow!("{e}"))?;
    let path = arguments.output.clone().unwrap_or_else(|| default_output(&arguments.scene));
    output::check_folder(&path)?;
    let portal_options = portals::options(&arguments.portals, arguments.effort.order)?;
    let mut scene = scene::load(&arguments.scene, &arguments.read)?;
    let mut portals = portals::take(&mut scene, &arguments.scene, &arguments.portals.openings)?;
    if !portals.is_empty() {
        portals::judge(&scene, &arguments.scene, &mut portals)?;
    }
    portals::refine(&mut scene, &portals, arguments.portals.refine)?;
    if asked.is_empty() && !portals.is_empty() {
        options.basis = vec![Basis::Haar, Basis::Sh, Basis::DirectToIndirect];
    }
    ensure!(
        !portals.is_empty() || arguments.effort.order != Bands::Auto,
        "--order: auto chooses the bands of light that bounces behind portals; under the open sky give a number"
    );
    ensure!(
        !portals.is_empty() || arguments.earlier.is_none(),
        "--continue: only light behind portals is continued, and the scene has none"
    );
    glossy::report(&scene, &arguments.scene, &portals);
    let started = Instant::now();
    let asset = match &arguments.earlier {
        None if portals.is_empty() => bake(&scene, &arguments.scene, &options)?,
        None => bake_portals(&scene, &portals, &arguments.scene, &options, &portal_options)?,
        Some(earlier) => {
            let bytes = relight::map(earlier)?;
            let there = relight::open(earlier, &bytes)?;
            let bar = Bar::new("M rays", 1e6);
            let result =
                lunette_bake::continue_portals(&there, &scene, &portals, &options, &portal_options, &bar);
            finish(result.map_err(|e| anyhow!("{}: {e}", earlier.display()))?, &arguments.scene, bar)
        }
    };
    let bytes = asset.to_bytes().map_err(|e| anyhow!("{e}"))?;
    lunette_render::write_atomically(&path, &bytes).map_err(|e| anyhow!("{e}"))?;
    println!(
        "{}: {:.1} MB, {:.1} s; bytes per vertex: {}",
        path.display(),
        bytes.len() as f64 / 1e6,
        started.elapsed().as_secs_f64(),
        bytes_per_vertex(&asset)
    );
    Ok(())
}

/// Where the bytes go, in words.
fn bytes_per_vertex(asset: &Asset) -> String {
    let kind = |name: &str| match name {
        _ if name.starts_with("mesh.") => 0,
        _ if name.ends_with("indirect.sh") => 2,
        _ if name.starts_with("indirect.") => 3,
        _ => 1,
    };
    let mut bytes = [0; 4];
    for (name, tensor) in asset.tensors() {
        bytes[kind(name)] += tensor.data.bytes().len();
    }
    let names = ["mesh", "direct light", "bounced light as SH", "bounced light from direct"];
    let parts = names.iter().zip(bytes).filter(|(_, bytes)| *bytes > 0);
    let per_vertex = |bytes: usize| bytes as f64 / asset.n_vertices().max(1) as f64;
    parts.map(|(name, bytes)| format!("{:.0} {name}", per_vertex(bytes))).collect::<Vec<_>>().join(" + ")
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
    let result = lunette_bake::bake_portals(scene, portals, options, portal_options, &bar);
    Ok(finish(result.map_err(|e| anyhow!("{e}"))?, name, bar))
}

/// Ends the bar, says what was found out, and names the asset.
fn finish((mut asset, report): (Asset<'static>, PortalReport), name: &str, bar: Bar) -> Asset<'static> {
    drop(bar);
    report.lines.iter().for_each(|line| say(line));
    asset.metadata.scene = short_name(name);
    asset
}

fn short_name(name: &str) -> String {
    Path::new(name).file_name().map_or(name.into(), |n| n.to_string_lossy().into_owned())
}

/// Options of a bake from the command line; no basis means the sky's default.
pub fn options(basis: Vec<Basis>, effort: &Effort) -> Options {
    // Portals choose fewer bands by their energy.
    let order = match effort.order {
        Bands::Fixed(order) => order,
        Bands::Auto => MAX_ORDER,
    };
    Options {
        basis: if basis.is_empty() { Options::default().basis } else { basis },
        order,
        indirect_order: effort.indirect_order.unwrap_or(order),
        rays: effort.rays,
        bounces: effort.bounces,
        resolution: effort.resolution,
        patches: effort.patches,
        links: effort.links,
        seed: effort.seed,
        threads: effort.threads,
    }
}

fn basis(names: &[String]) -> Result<Vec<Basis>> {
    let known = Basis::ALL.map(Basis::name).join(", ");
    let find = |name: &String| Basis::ALL.into_iter().find(|b| b.name() == name);
    names
        .iter()
        .map(|n| find(n).ok_or_else(|| anyhow!("--basis: there is no '{n}'; there are {known}")))
        .collect()
}

/// The scene's name with `.safetensors`, in the current folder.
fn default_output(scene: &str) -> PathBuf {
    let name =
        Path::new(scene).file_stem().map_or_else(|| "scene".into(), |s| s.to_string_lossy().into_owned());
    PathBuf::from(format!("{}.safetensors", name.split(':').next().unwrap_or("scene")))
}
