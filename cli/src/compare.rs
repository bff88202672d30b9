//! `lunette compare`: methods against the path-traced reference, at the vertices.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, ensure};
use glam::Vec3;
use lunette_bake::{Basis, Options};
use lunette_relight::asset::Asset;
use lunette_relight::frame::{Frame, Method};
use lunette_relight::light::Light;
use lunette_render::{Image, ReferenceOptions, Scale, Surface, Tracer, Visibility};
use lunette_scenes::Scene;

use crate::args;
use crate::progress::say;
use crate::{bake, light, output, relight, render, scene, stage};

/// One line of the table.
struct Row {
    name: String,
    relative: f64,
    percentile_99: f64,
    bytes: usize,
    bake_seconds: f64,
    relight_milliseconds: f64,
}

/// `lunette compare`
pub fn run(arguments: &args::Compare) -> Result<()> {
    let methods: Vec<(String, Method)> =
        arguments.methods.iter().map(|m| Ok((m.clone(), relight::method(m)?))).collect::<Result<_>>()?;
    let effort = bake::options(&["sh".into()], &arguments.effort)?;
    effort.check().map_err(|e| anyhow!("{e}"))?;
    let exposure = stage::exposure(&arguments.picture)?;
    let scene = scene::load(&arguments.scene, &arguments.read)?;
    let mut lights = light::frames(&arguments.light, scene.mesh.bounds())?;
    ensure!(lights.len() == 1, "compare takes one light, not a day; give --light sky:azimuth,elevation");
    let (_, light) = lights.remove(0);
    std::fs::create_dir_all(&arguments.output).with_context(|| arguments.output.display().to_string())?;

    let samples = ReferenceOptions { samples: arguments.samples, bounces: effort.bounces as u32, seed: 1 };
    let judge = Judge::new(&scene, &light, &samples, &arguments.picture)?;
    let truth = judge.picture(&scene, &judge.reference, &light)?;
    output::picture(&arguments.output.join("reference.png"), &truth, exposure)?;
    let coverage = judge.visibility.coverage();
    let mut rows = Vec::new();
    for (name, method) in methods {
        let (row, total) = measure(&scene, &light, name, method, &effort, &judge)?;
        let picture = judge.picture(&scene, &total, &light)?;
        output::picture(&arguments.output.join(format!("{}.png", row.name)), &picture, exposure)?;
        let error =
            lunette_render::error_picture(&picture, &truth, Some(&coverage), Scale::default()).map_err(|e| anyhow!("{e}"))?;
        lunette_render::write_png(&arguments.output.join(format!("{}-error.png", row.name)), &error)
            .map_err(|e| anyhow!("{e}"))?;
        rows.push(row);
    }
    let text = table(&rows, &judge);
    lunette_render::write_atomically(&arguments.output.join("table.txt"), text.as_bytes())
        .map_err(|e| anyhow!("{e}"))?;
    print!("{text}");
    Ok(())
}

/// The truth at the vertices, and how to look at it.
struct Judge {
    reference: Vec<Vec3>,
    noise: f64,
    area: Vec<f32>,
    visibility: Visibility,
    samples: ReferenceOptions,
}

impl Judge {
    fn new(
        scene: &Scene,
        light: &Light,
        samples: &ReferenceOptions,
        picture: &args::PictureOptions,
    ) -> Result<Judge> {
        let albedo = scene.vertex_albedo();
        let surface = render::surface(scene, &albedo);
        let visibility = stage::visibility(picture, surface)?;
        let tracer = Tracer::new(surface).map_err(|e| anyhow!("{e}"))?;
        let reference = render::vertices(&tracer, light, samples)?;
        let area = scene.mesh.vertex_area();
        let total = reference.total();
        let noise =
            lunette_render::noise(&reference.error, &total, Some(&area)).map_err(|e| anyhow!("{e}"))?;
        Ok(Judge { reference: total, noise, area, visibility, samples: *samples })
    }

    fn picture(&self, scene: &Scene, irradiance: &[Vec3], light: &Light) -> Result<Image> {
        let albedo = scene.vertex_albedo();
        let surface: Surface = render::surface(scene, &albedo);
        stage::shade(&self.visibility, &surface, bytemuck::cast_slice(irradiance), light)
    }
}

fn measure(
    scene: &Scene,
    light: &Light,
    name: String,
    method: Method,
    effort: &Options,
    judge: &Judge,
) -> Result<(Row, Vec<Vec3>)> {
    let options = options_of(method, effort);
    let started = Instant::now();
    let asset = bake::bake(scene, "", &options)?;
    let bake_seconds = started.elapsed().as_secs_f64();
    // Through the file's bytes, so that what is judged is what is stored.
    let bytes = asset.to_bytes().map_err(|e| anyhow!("{e}"))?;
    let asset = Asset::from_bytes(&bytes).map_err(|e| anyhow!("{e}"))?;
    let mut frame = Frame::new(&asset, method).map_err(|e| anyhow!("{e}"))?;
    let relight_milliseconds = time_frame(&mut frame, light, asset.n_vertices());
    let (direct, indirect) = relight::evaluate(&frame, asset.n_vertices());
    let total: Vec<Vec3> = bytemuck::cast_slice(&relight::sum(&direct, &indirect)).to_vec();
    let d = lunette_render::difference(&total, &judge.reference, Some(&judge.area))
        .map_err(|e| anyhow!("{e}"))?;
    if !lunette_render::may_judge(judge.noise, d.relative) {
        say(&format!("{name}: the reference is too noisy to judge so small an error; give more --samples"));
    }
    let bytes = frame.bytes_per_vertex();
    let row = Row {
        name,
        relative: d.relative,
        percentile_99: d.percentile_99,
        bytes,
        bake_seconds,
        relight_milliseconds,
    };
    Ok((row, total))
}

/// What must be baked for a method. Bounced light needs the SH pass, whatever carries the direct light.
fn options_of(method: Method, effort: &Options) -> Options {
    let (basis, order) = match method {
        Method::Bent => (vec![Basis::Bent], effort.order),
        Method::Aperture(_) => (vec![Basis::Aperture], effort.order),
        Method::Sh { order, .. } => (vec![Basis::Sh], order),
        _ => (vec![Basis::Sh], effort.order),
    };
    let sh = if effort.bounces > 0 && !basis.contains(&Basis::Sh) { vec![Basis::Sh] } else { vec![] };
    let indirect_order = effort.indirect_order.min(order);
    Options { basis: [basis, sh].concat(), order, indirect_order, ..effort.clone() }
}

/// The least of several frames, projection of the light included; the first one also fills the caches.
fn time_frame(frame: &mut Frame, light: &Light, n_vertices: usize) -> f64 {
    let mut out = vec![[0.0; 3]; n_vertices];
    let mut least = Duration::MAX;
    for _ in 0..5 {
        let started = Instant::now();
        frame.project(light);
        frame.irradiance_parallel(&mut out);
        least = least.min(started.elapsed());
    }
    least.as_secs_f64() * 1e3
}

fn table(rows: &[Row], judge: &Judge) -> String {
    let mut text = format!(
        "{:<18} {:>10} {:>10} {:>8} {:>8} {:>10}\n",
        "method", "rel. diff", "99th pct", "bytes/V", "bake s", "relight ms"
    );
    for r in rows {
        let (d, p) = (100.0 * r.relative, 100.0 * r.percentile_99);
        let _ = writeln!(
            text,
            "{:<18} {d:>8.2} % {p:>8.1} % {:>8} {:>8.1} {:>10.2}",
            r.name, r.bytes, r.bake_seconds, r.relight_milliseconds
        );
    }
    let _ = writeln!(
        text,
        "irradiance at the vertices, weighted by area, against {} paths with {} bounces; the reference's own noise is {:.2} %",
        judge.samples.samples,
        judge.samples.bounces,
        100.0 * judge.noise
    );
    text
}
