//! Portals from the command line.

use anyhow::{Result, anyhow, ensure};
use lunette_bake::{PortalOptions, Start};
use lunette_scenes::{Portal, Scene};

use crate::args;
use crate::progress::say;

/// Largest angle by which a portal may misplace an exterior object, degrees: the paper's example.
const LARGEST_ANGLE: f32 = 5.0;

/// The portals of a scene, taken out of its mesh: by `--portal`, else from a sidecar, else none.
pub fn take(scene: &mut Scene, name: &str, options: &args::Openings) -> Result<Vec<Portal>> {
    let sidecar = options.portals.clone().unwrap_or_else(|| lunette_scenes::sidecar_path(name));
    let portals = if !options.portal.is_empty() {
        lunette_scenes::take_portals(scene, &options.portal).map_err(|e| anyhow!("{e}"))?
    } else if options.portals.is_some() || (!options.no_portals && sidecar.is_file()) {
        say(&format!("{name}: portals from {}", sidecar.display()));
        lunette_scenes::read_portals(&sidecar).map_err(|e| anyhow!("{e}"))?
    } else {
        return Ok(Vec::new());
    };
    let Some(distance) = options.nearest_exterior else { return Ok(portals) };
    let split = lunette_scenes::split_portals(portals, LARGEST_ANGLE.to_radians(), distance)
        .map_err(|e| anyhow!("--nearest-exterior: {e}"))?;
    split.report.iter().for_each(|line| say(&format!("{name}: {line}")));
    Ok(split.portals)
}

/// Options of a portal bake from the command line.
pub fn options(choice: &args::PortalChoice, order: args::Bands) -> Result<PortalOptions> {
    let percent = choice.energy;
    ensure!((1.0..=100.0).contains(&percent), "--energy: {percent} is not in 1..=100 percent");
    ensure!(
        choice.photons.is_none_or(|n| (1000..=10_000_000_000).contains(&n)),
        "--photons: a number in 1000..=10000000000 is needed"
    );
    Ok(PortalOptions {
        start: choice.photons.map_or(Start::Gathering, Start::Photons),
        energy_share: (order == args::Bands::Auto).then_some(percent / 100.0),
    })
}
