//! `lunette portals`: proposes an interior's portals and writes them where `bake` finds them.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow, ensure};
use lunette_bake::openings::{self, Grouping, Options};
use lunette_render::{Picture, Shown, Surface};
use lunette_scenes::{Portal, Scene};

use crate::progress::Bar;
use crate::{args, output, portals, scene, stage};

/// Where more of the light enters elsewhere than through them, portals are none: the nook under a ball is no room.
const USELESS: f32 = 0.5;

/// `lunette portals`
pub fn run(arguments: &args::Portals) -> Result<()> {
    let path = target(arguments)?;
    output::check_folder(&path)?;
    output::check_folder(&picture_path(&path))?;
    let size = stage::parse_size(&arguments.size)?;
    ensure!(size.0 >= 2, "--size: two views need 2 pixels of width");
    let options = options(arguments);
    options.check().map_err(|e| anyhow!("{e}"))?;
    let mut scene = scene::load(&arguments.scene, &arguments.read)?;
    let bar = Bar::new("M rays", 1e6);
    let found = openings::find(&scene, &options, &bar).map_err(|e| anyhow!("{}: {e}", arguments.scene))?;
    drop(bar);
    lunette_scenes::unglaze(&mut scene, &found).map_err(|e| anyhow!("{e}"))?;
    let elsewhere = openings::leak_share(&scene, &found).map_err(|e| anyhow!("{e}"))?;
    ensure!(
        elsewhere < USELESS,
        "{}: no interior that portals would close: {:.0} % of the light enters beside what was found; bake it without, or \
         write a portal file by hand",
        arguments.scene,
        100.0 * elsewhere
    );
    let picture = picture(&scene, &found, size)?;
    lunette_render::write_png(&picture_path(&path), &picture).map_err(|e| anyhow!("{e}"))?;
    lunette_scenes::write_portals(&path, &found).map_err(|e| anyhow!("{e}"))?;
    found.iter().for_each(|p| println!("{}", described(p)));
    println!("{:.1} % of the light that enters does so elsewhere", 100.0 * elsewhere);
    let area: f32 = found.iter().map(Portal::area).sum();
    let n = found.len();
    println!("{}: {n} portal{}, {area:.3} m²", path.display(), if n == 1 { "" } else { "s" });
    let what_to_do = "look for it in the picture, and give more --cells for narrower holes";
    portals::warn_of_leaks(&arguments.scene, elsewhere, what_to_do);
    Ok(())
}

/// The portal file to be written; one that is there is replaced only where that was asked for.
fn target(arguments: &args::Portals) -> Result<PathBuf> {
    if let Some(path) = &arguments.output {
        ensure!(
            path.extension().is_some_and(|e| e == "json"),
            "{}: a portal file's name has to end in .json",
            path.display()
        );
        return Ok(path.clone());
    }
    let path = lunette_scenes::sidecar_path(&arguments.scene);
    ensure!(
        arguments.force || !path.exists(),
        "{}: is there already, and may have been edited by hand; --force replaces it, -o FILE.json writes another",
        path.display()
    );
    Ok(path)
}

fn options(arguments: &args::Portals) -> Options {
    Options {
        cells: arguments.cells,
        smallest_area: arguments.smallest_area,
        widest_bar: arguments.widest_bar,
        grouping: if arguments.group == "apart" { Grouping::Apart } else { Grouping::Joined },
        seed: arguments.seed,
        threads: arguments.threads,
    }
}

/// `room.portals.json` has `room.portals.png` beside it, and `a.json` has `a.portals.png`: a scene's own pictures are
/// safe.
fn picture_path(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{}.portals.png", stem.trim_end_matches(".portals")))
}

/// The portals in the scene without its glass.
fn picture(scene: &Scene, portals: &[Portal], size: (usize, usize)) -> Result<Picture> {
    let opaque = |t: &usize| !scene.materials[scene.mesh.material[*t] as usize].is_see_through();
    let index: Vec<[u32; 3]> =
        (0..scene.mesh.index.len()).filter(opaque).map(|t| scene.mesh.index[t]).collect();
    let albedo = scene.vertex_albedo();
    let surface = Surface {
        position: &scene.mesh.position,
        normal: &scene.mesh.normal,
        index: &index,
        albedo: &albedo,
    };
    let window = |(portal, w): (usize, Portal)| Shown {
        portal,
        outline: w.outline(),
        normal: w.normal,
        triangles: w.triangles,
    };
    let windows = portals.iter().enumerate().flat_map(|(k, p)| p.windows().into_iter().map(move |w| (k, w)));
    let portals: Vec<Shown> = windows.map(window).collect();
    lunette_render::show_portals(surface, &portals, size).map_err(|e| anyhow!("{e}"))
}

/// Name, polygons, area, centre and normal.
fn described(portal: &Portal) -> String {
    let n = portal.polygons().len();
    let (c, n_in) = (portal.centre(), portal.normal);
    format!(
        "{:<16} {n:>4} polygon{} {:>9.3} m²  centre {:.2} {:.2} {:.2}  inwards {:.2} {:.2} {:.2}",
        portal.name,
        if n == 1 { " " } else { "s" },
        portal.area(),
        c.x,
        c.y,
        c.z,
        n_in.x,
        n_in.y,
        n_in.z
    )
}
