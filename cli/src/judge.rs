//! Methods held against the path-traced reference, at the vertices.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use glam::Vec3;
use lunette_relight::asset::Asset;
use lunette_relight::frame::{Frame, Method};
use lunette_relight::light::Light;
use lunette_render::{ReferenceOptions, Tracer};
use lunette_scenes::Scene;

use crate::{relight, render};

/// The truth under one light, at every `stride`-th vertex.
pub struct Judge {
    /// Irradiance of the judged vertices.
    pub reference: Vec<Vec3>,
    /// Relative difference that the reference's own noise brings.
    pub noise: f64,
    area: Vec<f32>,
    stride: usize,
    options: ReferenceOptions,
}

/// One line of the table.
pub struct Row {
    /// The method, as on the command line.
    pub name: String,
    /// Relative difference against the reference.
    pub relative: f64,
    /// 99th percentile of the error over the reference's mean.
    pub percentile_99: f64,
    /// Whether the reference's noise is small enough to judge it.
    pub is_judged: bool,
    /// What the method reads per vertex.
    pub bytes: usize,
    /// Of everything that the method needs.
    pub bake_seconds: f64,
    /// Projecting the light and evaluating all vertices, on all threads.
    pub relight_milliseconds: f64,
}

impl Row {
    /// The relative difference in percent; `~` before one that is under five times the reference's noise.
    pub fn percent(&self) -> String {
        let mark = if self.is_judged { "" } else { "~" };
        format!("{mark}{:.2}", 100.0 * self.relative)
    }
}

impl Judge {
    /// Traces the reference.
    pub fn new(
        scene: &Scene,
        tracer: &Tracer,
        light: &Light,
        options: &ReferenceOptions,
        stride: usize,
    ) -> Result<Judge> {
        let position = picked(&scene.mesh.position, stride);
        let normal: Vec<Vec3> = picked(&scene.mesh.normal, stride).iter().map(|n| n.normalize()).collect();
        let area = picked(&scene.mesh.vertex_area(), stride);
        let reference = render::at(tracer, light, &position, &normal, options)?;
        let total = reference.total();
        let noise =
            lunette_render::noise(&reference.error, &total, Some(&area)).map_err(|e| anyhow!("{e}"))?;
        Ok(Judge { reference: total, noise, area, stride, options: *options })
    }

    /// How the numbers came about, in one line.
    pub fn describe(&self) -> String {
        let which = match self.stride {
            1 => "the vertices".to_string(),
            n => format!("every {n}th vertex"),
        };
        format!(
            "irradiance at {which}, weighted by area, against {} paths with {} bounces; the reference's own noise is {:.2} % (~ marks what is under five times that)",
            self.options.samples,
            self.options.bounces,
            100.0 * self.noise
        )
    }
}

/// Relights an asset by a method, judges it, and gives the irradiance of all vertices too.
pub fn measure(
    asset: &Asset,
    (name, method): (&str, Method),
    bake_seconds: f64,
    light: &Light,
    judge: &Judge,
) -> Result<(Row, Vec<[f32; 3]>)> {
    let mut frame = Frame::new(asset, method).map_err(|e| anyhow!("{e}"))?;
    let relight_milliseconds = time_frame(&mut frame, light, asset.n_vertices());
    let (direct, indirect) = relight::evaluate(&frame, asset.n_vertices());
    let total = relight::sum(&direct, &indirect);
    let judged: Vec<Vec3> = picked(bytemuck::cast_slice(&total), judge.stride);
    let d = lunette_render::difference(&judged, &judge.reference, Some(&judge.area))
        .map_err(|e| anyhow!("{e}"))?;
    let row = Row {
        name: name.to_string(),
        relative: d.relative,
        percentile_99: d.percentile_99,
        is_judged: lunette_render::may_judge(judge.noise, d.relative),
        bytes: frame.bytes_per_vertex(),
        bake_seconds,
        relight_milliseconds,
    };
    Ok((row, total))
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

fn picked<T: Copy>(all: &[T], stride: usize) -> Vec<T> {
    all.iter().step_by(stride).copied().collect()
}

/// The rows as text, with a last line that says how they came about.
pub fn table(rows: &[Row], judge: &Judge) -> String {
    let mut text = format!(
        "{:<18} {:>10} {:>10} {:>8} {:>8} {:>10}\n",
        "method", "rel. diff", "99th pct", "bytes/V", "bake s", "relight ms"
    );
    for r in rows {
        let (d, p) = (r.percent(), 100.0 * r.percentile_99);
        let _ = writeln!(
            text,
            "{:<18} {d:>8} % {p:>8.1} % {:>8} {:>8.1} {:>10.2}",
            r.name, r.bytes, r.bake_seconds, r.relight_milliseconds
        );
    }
    let _ = writeln!(text, "{}", judge.describe());
    text
}
