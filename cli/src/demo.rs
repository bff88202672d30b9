//! `lunette demo`: bake, relight, judge, and tell about it, by the functions of the other commands.

mod chapters;
mod report;

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, anyhow};
use lunette_bake::Options;
use lunette_relight::asset::Asset;
use lunette_relight::frame::Frame;
use lunette_relight::light::Light;
use lunette_render::{Exposure, ReferenceOptions, Tracer, Visibility, auto_exposure};
use lunette_scenes::{LoadOptions, Scene};

use crate::args::{self, Outside, PictureOptions};
use crate::engine::Engine;
use crate::judge::{self, Judge, Row};
use crate::progress::say;
use crate::{bake, day, light, output, relight, render, stage};
use chapters::{CHAPTERS, Chapter, DATE, PLACE, Shot, Trial};

/// Methods of the tables.
const METHODS: [&str; 7] = ["bent", "aperture", "aperture-smooth", "sh3", "sh5", "sh10", "sh10-lanczos"];

/// Methods of which a trial shows pictures.
const SHOWN: [&str; 4] = ["aperture", "sh5", "sh10", "sh10-lanczos"];

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
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
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
    asset: &'a Asset<'a>,
    visibility: Visibility,
    bake_seconds: f64,
}

fn tell(chapter: &'static Chapter, options: &Options, folder: &Path) -> Result<Told> {
    say(&format!("{}: baking", chapter.scene));
    let options = Options { rays: chapter.rays, ..options.clone() };
    let scene = lunette_scenes::load(chapter.scene, &LoadOptions::default()).map_err(|e| anyhow!("{e}"))?;
    let started = Instant::now();
    let baked = bake::bake(&scene, chapter.scene, &options)?;
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
    let desk = Desk { chapter, folder, scene: &scene, asset: &asset, visibility, bake_seconds };
    Ok(Told {
        chapter,
        vertices: asset.n_vertices(),
        bake_seconds,
        megabytes: bytes.len() as f64 / 1e6,
        pictures: show(&desk)?,
        trials: chapter.trials.iter().map(|trial| try_methods(&desk, trial)).collect::<Result<_>>()?,
    })
}

/// The relit pictures of a chapter.
fn show(desk: &Desk) -> Result<Vec<Shown>> {
    let mut shown = Vec::new();
    for (i, shot) in desk.chapter.shots.iter().enumerate() {
        let (caption, light) = shot_light(desk, shot)?;
        let mut frame =
            Frame::new(desk.asset, relight::method(shot.method())?).map_err(|e| anyhow!("{e}"))?;
        frame.project(&light);
        let (direct, indirect) = relight::evaluate(&frame, desk.asset.n_vertices());
        let file = format!("{}-{i}.png", desk.chapter.name());
        desk.picture(&file, &relight::sum(&direct, &indirect), &light, Exposure::Auto)?;
        shown.push(Shown { file, caption: format!("{caption}; {}", shot.method()) });
    }
    Ok(shown)
}

fn shot_light(desk: &Desk, shot: &Shot) -> Result<(String, Light)> {
    match *shot {
        Shot::Hour { hour, .. } => {
            let mut frames = day::skies(DATE, PLACE, 24, TURBIDITY)?;
            Ok(frames.swap_remove(hour))
        }
        Shot::Spec { spec, .. } => Ok((spec.into(), light::parse(spec, desk.scene.mesh.bounds())?)),
    }
}

/// All methods under one light, against the reference; and pictures, where the trial asks for them.
fn try_methods(desk: &Desk, trial: &'static Trial) -> Result<Tried> {
    say(&format!("{}: judging under {}", desk.chapter.scene, trial.light));
    let light = light::parse(trial.light, desk.scene.mesh.bounds())?;
    let albedo = desk.scene.vertex_albedo();
    let tracer = Tracer::new(render::surface(desk.scene, &albedo)).map_err(|e| anyhow!("{e}"))?;
    let samples = ReferenceOptions { samples: trial.samples, bounces: 2, seed: 1 };
    let judge = Judge::new(desk.scene, &tracer, &light, &samples, trial.stride, &[])?;
    let mut pictures = Vec::new();
    let mut exposure = Exposure::Auto;
    if trial.stride == 1 {
        let truth = render::vertices(&tracer, &light, &samples)?.total();
        let truth: &[[f32; 3]] = bytemuck::cast_slice(&truth);
        let image = stage::shade(&desk.visibility, &stage::surface(desk.asset), truth, &light)?;
        exposure = Exposure::Stops(auto_exposure(&image));
        pictures.push(desk.trial_picture("reference", truth, &light, exposure)?);
    }
    let mut rows = Vec::new();
    for name in METHODS {
        let mut engine = Engine::new(desk.asset, Some(relight::method(name)?), &Outside::default())?;
        let (row, total) =
            judge::measure(desk.asset, (name, &mut engine), desk.bake_seconds, &light, &judge)?;
        if trial.stride == 1 && SHOWN.contains(&name) {
            pictures.push(desk.trial_picture(name, &total, &light, exposure)?);
        }
        rows.push(row);
    }
    Ok(Tried { trial, rows, judge: judge.describe(), pictures })
}

impl Desk<'_> {
    fn picture(&self, file: &str, irradiance: &[[f32; 3]], light: &Light, exposure: Exposure) -> Result<()> {
        let image = stage::shade(&self.visibility, &stage::surface(self.asset), irradiance, light)?;
        output::picture(&self.folder.join(file), &image, exposure)
    }

    fn trial_picture(
        &self,
        name: &str,
        irradiance: &[[f32; 3]],
        light: &Light,
        exposure: Exposure,
    ) -> Result<Shown> {
        let file = format!("{}-{name}.png", self.chapter.name());
        self.picture(&file, irradiance, light, exposure)?;
        Ok(Shown { file, caption: name.into() })
    }
}
