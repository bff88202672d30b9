//! `lunette demo`: bake, relight, judge, and tell about it, by the functions of the other commands.

mod chapters;
mod report;
mod trials;

use std::path::Path;
use std::time::Instant;

use anyhow::{Result, anyhow};
use lunette_bake::{Basis, Options, PortalOptions};
use lunette_relight::asset::Asset;
use lunette_relight::light::Light;
use lunette_render::{Exposure, Image, Visibility, auto_exposure};
use lunette_scenes::{Portal, Scene};

use crate::args::{self, Openings, Outside, PictureOptions};
use crate::engine::Engine;
use crate::judge::Row;
use crate::moving::Moment;
use crate::progress::say;
use crate::stage::{self, Around};
use crate::{bake, day, light, output, portals, relight, scene};
use chapters::{CHAPTERS, Chapter, DATE, DRIVE, Kind, PLACE, Shot, Trial};

/// Size of the pictures.
const SIZE: &str = "640x400";

/// Haze of the day's sky.
const TURBIDITY: f32 = 3.0;

/// Enough of everything for the table: all methods come from one bake.
fn options(threads: usize) -> Options {
    Options { order: 10, indirect_order: 3, threads, ..Options::default() }
}

/// `lunette demo`
pub fn run(arguments: &args::Demo) -> Result<()> {
    let started = Instant::now();
    let folder = &arguments.folder;
    output::make_folder(folder)?;
    let options = options(arguments.threads);
    options.check().map_err(|e| anyhow!("{e}"))?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(arguments.threads).build()?;
    let told = pool.install(|| {
        CHAPTERS.iter().map(|chapter| tell(chapter, &options, folder)).collect::<Result<Vec<_>>>()
    })?;
    let path = folder.join("index.html");
    let page = report::page(&told, &options, pool.current_num_threads(), started.elapsed().as_secs_f64());
    lunette_render::write_atomically(&path, page.as_bytes()).map_err(|e| anyhow!("{e}"))?;
    println!("{}: pictures and numbers, {:.0} s", path.display(), started.elapsed().as_secs_f64());
    Ok(())
}

/// What a chapter came to.
struct Told {
    chapter: &'static Chapter,
    vertices: usize,
    bake_seconds: f64,
    megabytes: f64,
    pictures: Vec<Shown>,
    trials: Vec<Tried>,
}

/// A picture and what is to be said of it.
struct Shown {
    file: String,
    caption: String,
}

/// What a trial came to.
struct Tried {
    trial: &'static Trial,
    rows: Vec<Row>,
    judge: String,
    pictures: Vec<Shown>,
}

/// Everything at hand while a chapter is told.
struct Desk<'a> {
    chapter: &'static Chapter,
    folder: &'a Path,
    scene: &'a Scene,
    portals: &'a [Portal],
    options: &'a Options,
    asset: &'a Asset<'a>,
    visibility: Visibility,
    bake_seconds: f64,
}

fn tell(chapter: &'static Chapter, options: &Options, folder: &Path) -> Result<Told> {
    say(&format!("{}: baking", chapter.scene));
    let mut options = Options { rays: chapter.rays, ..options.clone() };
    let mut scene = scene::load_plain(chapter.scene)?;
    let started = Instant::now();
    let (portals, baked) = match chapter.kind {
        Kind::OpenSky => (Vec::new(), bake::bake(&scene, chapter.scene, &options)?),
        Kind::Interior => {
            options.basis = vec![Basis::Haar, Basis::DirectToIndirect];
            let glass = Openings { portal: vec!["glass*".into()], ..Openings::default() };
            let portals = portals::take(&mut scene, chapter.scene, &glass)?;
            let gathering = PortalOptions::default();
            let baked = bake::bake_portals(&scene, &portals, chapter.scene, &options, &gathering)?;
            (portals, baked)
        }
    };
    let bake_seconds = started.elapsed().as_secs_f64();
    let path = folder.join(format!("{}.safetensors", chapter.name()));
    let bytes = baked.to_bytes().map_err(|e| anyhow!("{e}"))?;
    lunette_render::write_atomically(&path, &bytes).map_err(|e| anyhow!("{e}"))?;
    drop((baked, bytes));

    // From here on as anybody would who has nothing but the file.
    let bytes = relight::map(&path)?;
    let asset = relight::open(&path, &bytes)?;
    let picture =
        PictureOptions { camera: chapter.camera.map(String::from), size: SIZE.into(), exposure: None };
    let visibility = stage::visibility(&picture, stage::surface(&asset))?;
    let desk = Desk {
        chapter,
        folder,
        scene: &scene,
        portals: &portals,
        options: &options,
        asset: &asset,
        visibility,
        bake_seconds,
    };
    Ok(Told {
        chapter,
        vertices: asset.n_vertices(),
        bake_seconds,
        megabytes: bytes.len() as f64 / 1e6,
        pictures: show(&desk)?,
        trials: trials::hold(&desk)?,
    })
}

/// The relit pictures of a chapter.
fn show(desk: &Desk) -> Result<Vec<Shown>> {
    let mut shown = Vec::new();
    let mut exposure_of_glass = Exposure::Auto;
    for (i, shot) in desk.chapter.shots.iter().enumerate() {
        let (caption, light) = shot_light(desk, shot)?;
        let method = shot.method().map(relight::method).transpose()?;
        let mut engine = Engine::new(desk.asset, method, &outside(shot))?;
        let (frame, frames) = if let Shot::Drive { frame, .. } = shot { (*frame, DRIVE.2) } else { (0, 1) };
        let lit = engine.light(desk.asset, &light, &Moment::default(), (frame, frames))?;
        let total = relight::sum(&lit.direct, &lit.indirect);
        let image = desk.shade(&total, Around { light: &light, through: engine.through(&total) })?;
        if matches!((shot, exposure_of_glass), (Shot::Glass { .. }, Exposure::Auto)) {
            exposure_of_glass = Exposure::Stops(auto_exposure(&image));
        }
        let exposure = if let Shot::Glass { .. } = shot { exposure_of_glass } else { Exposure::Auto };
        let file = format!("{}-{i}.png", desk.chapter.name());
        output::picture(&desk.folder.join(&file), &image, exposure)?;
        shown.push(Shown { file, caption });
    }
    Ok(shown)
}

fn shot_light(desk: &Desk, shot: &Shot) -> Result<(String, Light)> {
    let parse = |spec: &str| light::parse(spec, desk.scene.mesh.bounds());
    let by = |method: &Option<&str>| method.map(|m| format!("; {m}")).unwrap_or_default();
    Ok(match shot {
        Shot::Hour { hour, method } => {
            let (caption, light) = day::skies(DATE, PLACE, 24, TURBIDITY)?.swap_remove(*hour);
            (caption + &by(method), light)
        }
        Shot::Spec { spec, method } => (spec.to_string() + &by(method), parse(spec)?),
        Shot::Glass { spec, glass: [] } => (format!("{spec}; the glass as modelled"), parse(spec)?),
        Shot::Glass { spec, glass } => (format!("{spec}; {}", glass.join(", ")), parse(spec)?),
        Shot::Drive { spec, frame } => {
            (format!("{spec}; frame {} of {} along {}", frame + 1, DRIVE.2, DRIVE.1), parse(spec)?)
        }
    })
}

/// What a shot needs outside, as on the command line.
fn outside(shot: &Shot) -> Outside {
    let plain = Outside::default();
    match shot {
        Shot::Glass { glass, .. } => {
            Outside { portal_material: glass.iter().map(|g| g.to_string()).collect(), ..plain }
        }
        Shot::Drive { .. } => {
            Outside { exterior: Some(DRIVE.0.into()), along: Some(DRIVE.1.into()), ..plain }
        }
        Shot::Hour { .. } | Shot::Spec { .. } => plain,
    }
}

impl Desk<'_> {
    fn shade(&self, irradiance: &[[f32; 3]], around: Around) -> Result<Image> {
        let surface = stage::surface(self.asset);
        stage::shade(&self.visibility, &surface, &stage::radiance(&surface, irradiance), around)
    }
}
