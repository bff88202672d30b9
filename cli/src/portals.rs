//! Portals from the command line.

use anyhow::{Result, anyhow, ensure};
use lunette_bake::{PortalOptions, Start, openings};
use lunette_scenes::{Portal, Scene};

use crate::args;
use crate::progress::say;

/// Largest angle by which a portal may misplace an exterior object, degrees: the paper's example.
const LARGEST_ANGLE: f32 = 5.0;

/// Share of the light that may enter beside the portals unsaid: cracks between walls, and the hair by which a polygon
/// that was found by rays is smaller than its hole.
const LEAKY: f32 = 0.01;

/// The portals of a scene, taken out of its mesh: by `--portal`, else from a sidecar, else none.
pub fn take(scene: &mut Scene, name: &str, options: &args::Openings) -> Result<Vec<Portal>> {
    let sidecar = options.portals.clone().unwrap_or_else(|| lunette_scenes::sidecar_path(name));
    let n_said = scene.report.len();
    let portals = if !options.portal.is_empty() {
        lunette_scenes::take_portals(scene, &options.portal).map_err(|e| anyhow!("{e}"))?
    } else if options.portals.is_some() || (!options.no_portals && sidecar.is_file()) {
        say(&format!("{name}: portals from {}", sidecar.display()));
        let portals = lunette_scenes::read_portals(&sidecar).map_err(|e| anyhow!("{e}"))?;
        lunette_scenes::unglaze(scene, &portals).map_err(|e| anyhow!("{e}"))?;
        portals
    } else {
        if !options.no_portals {
            warn_of_glass(scene, name);
        }
        return Ok(Vec::new());
    };
    scene.report[n_said..].iter().for_each(|line| say(&format!("{name}: {line}")));
    let Some(distance) = options.nearest_exterior else { return Ok(portals) };
    let split = lunette_scenes::split_portals(portals, LARGEST_ANGLE.to_radians(), distance)
        .map_err(|e| anyhow!("--nearest-exterior: {e}"))?;
    split.report.iter().for_each(|line| say(&format!("{name}: {line}")));
    Ok(split.portals)
}

/// Without portals glass lets no light in.
fn warn_of_glass(scene: &Scene, name: &str) {
    let glass = scene.materials.iter().enumerate().filter(|(_, m)| m.is_see_through());
    let used: Vec<&str> = glass
        .filter(|(i, _)| scene.mesh.material.contains(&(*i as u32)))
        .map(|(_, m)| m.name.as_str())
        .collect();
    if let Some(first) = used.first() {
        say(&format!(
            "{name}: {} of glass, '{first}' for one, blocks light here; name windows with --portal, or let `lunette \
             portals` find them",
            if used.len() == 1 { "1 material".into() } else { format!("{} materials", used.len()) },
        ));
    }
}

/// Turns portals inwards, and says where they do not part inside from outside.
pub fn judge(scene: &Scene, name: &str, portals: &mut [Portal]) -> Result<()> {
    openings::orient(scene, portals).map_err(|e| anyhow!("{e}"))?;
    let elsewhere = openings::leak_share(scene, portals).map_err(|e| anyhow!("{e}"))?;
    warn_of_leaks(name, elsewhere, "`lunette portals` may find where");
    Ok(())
}

/// Says where portals do not part inside from outside, more than [`LEAKY`] of the light entering elsewhere, and what to
/// do.
pub fn warn_of_leaks(name: &str, elsewhere: f32, what_to_do: &str) {
    if elsewhere > LEAKY {
        say(&format!(
            "{name}: the portals do not part inside from outside: {:.1} % of the light that enters does so elsewhere, \
             and will be missing; {what_to_do}",
            100.0 * elsewhere
        ));
    }
}

/// Refines the mesh where shadows of near things end, and says how much.
pub fn refine(scene: &mut Scene, portals: &[Portal], times: usize) -> Result<()> {
    ensure!(
        times == 0 || !portals.is_empty(),
        "--refine: only shadows behind portals are refined, and the scene has none"
    );
    if times > 0 {
        let before = scene.mesh.position.len();
        lunette_bake::refine(scene, portals, times).map_err(|e| anyhow!("--refine: {e}"))?;
        say(&format!("refined: {} vertices more, of {before}", scene.mesh.position.len() - before));
    }
    Ok(())
}

/// As much as halves a metre to less than two centimetres.
const MOST_REFINED: usize = 6;

/// Options of a portal bake from the command line.
pub fn options(choice: &args::PortalChoice, order: args::Bands) -> Result<PortalOptions> {
    let percent = choice.energy;
    ensure!((1.0..=100.0).contains(&percent), "--energy: {percent} is not in 1..=100 percent");
    ensure!(
        choice.photons.is_none_or(|n| (1000..=10_000_000_000).contains(&n)),
        "--photons: a number in 1000..=10000000000 is needed"
    );
    ensure!(choice.refine <= MOST_REFINED, "--refine: {} is not in 0..={MOST_REFINED}", choice.refine);
    Ok(PortalOptions {
        start: choice.photons.map_or(Start::Gathering, Start::Photons),
        energy_share: (order == args::Bands::Auto).then_some(percent / 100.0),
    })
}
