//! Methods held against the path-traced reference, in the middles of triangles: what is between the vertices counts,
//! and no point lies in a crease, where the truth is a matter of opinion.

use anyhow::{Result, anyhow, ensure};
use glam::Vec3;
use lunette_relight::asset::Asset;
use lunette_relight::light::Light;
use lunette_relight::portal_frame::{Detail, Point};
use lunette_render::{Difference, Reference, ReferenceOptions, Tracer};
use lunette_scenes::{Mesh, Portal, Scene};
use std::fmt::Write as _;

use crate::engine::Engine;
use crate::moving::Moment;
use crate::progress::Bar;
use crate::{relight, render};

/// The truth under one light, in the middle of every `stride`-th triangle.
pub struct Judge {
    /// Irradiance at the judged points and its standard errors.
    pub reference: Reference,
    /// Both parts of it together.
    pub total: Vec<Vec3>,
    /// What the reference's own noise brings, as relative differences.
    pub noise: Parts,
    /// Of each judged triangle, its corners and its area; 0 for what is not to be judged.
    triangles: Vec<[u32; 3]>,
    area: Vec<f32>,
    stride: usize,
    /// How many triangles nobody sees, since they lie inside others.
    n_hidden: usize,
    options: ReferenceOptions,
}

/// A number for all light, for direct and for bounced light.
#[derive(Clone, Copy)]
pub struct Parts {
    pub total: f64,
    pub direct: f64,
    pub indirect: f64,
}

/// One line of the table.
pub struct Row {
    /// The method, as on the command line.
    pub name: String,
    /// Relative differences against the reference.
    pub relative: Parts,
    /// Of the picture's pixels that see a surface, and the noise of its reference; where there is one.
    pub picture: Option<(f64, f64)>,
    /// 99th percentile of the error over the reference's mean.
    pub percentile_99: f64,
    /// The reference's noise.
    pub noise: Parts,
    /// What the method reads per vertex, of direct and of bounced light.
    pub bytes: (f32, f32),
    /// Of everything that the method needs.
    pub bake_seconds: f64,
    /// Projecting the light and evaluating all vertices, on all threads.
    pub relight_milliseconds: f64,
}

impl Row {
    /// The relative difference in percent; `~` before one that is under five times the reference's noise.
    pub fn percent(&self) -> String {
        percent(self.relative.total, self.noise.total)
    }

    /// As [`percent`](Row::percent), of direct and of bounced light.
    pub fn percent_of_parts(&self) -> [String; 2] {
        [(self.relative.direct, self.noise.direct), (self.relative.indirect, self.noise.indirect)]
            .map(|(relative, noise)| percent(relative, noise))
    }

    /// Whether the reference's noise is small enough to judge it.
    pub fn is_judged(&self) -> bool {
        lunette_render::may_judge(self.noise.total, self.relative.total)
    }
}

/// A relative difference in percent; `~` before one that is under five times the reference's noise.
fn percent(relative: f64, noise: f64) -> String {
    let mark = if lunette_render::may_judge(noise, relative) { "" } else { "~" };
    format!("{mark}{:.2}", 100.0 * relative)
}

impl Judge {
    /// Traces the reference.
    pub fn new(
        scene: &Scene,
        tracer: &Tracer,
        light: &Light,
        options: &ReferenceOptions,
        stride: usize,
        portals: &[Portal],
    ) -> Result<Judge> {
        let mesh = &scene.mesh;
        let triangles: Vec<[u32; 3]> = mesh.index.iter().step_by(stride).copied().collect();
        let mut area: Vec<f32> = triangles.iter().map(|t| triangle_area(mesh, t)).collect();
        if !portals.is_empty() {
            // Outer walls are lit by more than portals, and are not what an interior is baked for.
            let inside = lunette_bake::openings::parted(scene, portals, &Bar::new("M rays", 1e6))
                .and_then(|(panes, _)| lunette_bake::openings::inside(scene, &panes))
                .map_err(|e| anyhow!("{e}"))?;
            let is_inside = |t: &[u32; 3]| t.iter().all(|&v| inside[v as usize]);
            ensure!(
                mesh.index.iter().any(is_inside),
                "no triangle is lit through the portals alone: do they part inside from outside?"
            );
            ensure!(
                triangles.iter().any(is_inside),
                "--every: {stride} steps past all triangles that are lit through the portals; give less"
            );
            area.iter_mut().zip(&triangles).filter(|(_, t)| !is_inside(t)).for_each(|(area, _)| *area = 0.0);
        }
        let position = middles(&mesh.position, &triangles);
        let normal: Vec<Vec3> =
            middles(&mesh.normal, &triangles).iter().map(|n| n.normalize_or_zero()).collect();
        let hidden = lunette_bake::inside_others(scene, &position, &normal).map_err(|e| anyhow!("{e}"))?;
        let mut n_hidden = 0;
        for (area, _) in area.iter_mut().zip(hidden).filter(|(area, is_hidden)| *is_hidden && **area > 0.0) {
            *area = 0.0;
            n_hidden += 1;
        }
        ensure!(
            area.iter().any(|a| *a > 0.0),
            "--every: all triangles left to judge lie inside others; give less"
        );
        let reference = render::at(tracer, light, &position, &normal, options)?;
        let total = reference.total();
        // A part's noise is held against all light, as its difference is: see `measure`.
        let noise =
            |error: &[Vec3]| lunette_render::noise(error, &total, Some(&area)).map_err(|e| anyhow!("{e}"));
        let noise = Parts {
            total: noise(&reference.error)?,
            direct: noise(&reference.direct_error)?,
            indirect: noise(&reference.indirect_error)?,
        };
        let part = |part: &[Vec3]| share(part, &total, &area);
        let noise = Parts {
            direct: noise.direct / part(&reference.direct),
            indirect: noise.indirect / part(&reference.indirect),
            ..noise
        };
        Ok(Judge { total, reference, noise, triangles, area, stride, n_hidden, options: *options })
    }

    /// How the numbers came about, in one line.
    pub fn describe(&self) -> String {
        let which = match self.stride {
            1 => "the middles of the triangles".to_string(),
            n => format!("the middle of every {n}th triangle"),
        };
        let hidden = match self.n_hidden {
            0 => String::new(),
            n => format!(" ({n} that lie inside others left out)"),
        };
        let n = self.noise;
        format!(
            "irradiance at {which}{hidden}, weighted by area, against {} paths with {} bounces; the reference's own noise is {:.2} % (direct {:.2} %, bounced {:.2} %; ~ marks what is under five times that)",
            self.options.samples,
            self.options.bounces,
            100.0 * n.total,
            100.0 * n.direct,
            100.0 * n.indirect
        )
    }

    /// Of what vertices have and middles of triangles have `more` than those.
    fn difference(&self, all: &[[f32; 3]], more: &[Vec3], reference: &[Vec3]) -> Result<Difference> {
        let mut judged = middles(bytemuck::cast_slice(all), &self.triangles);
        judged.iter_mut().zip(more).for_each(|(e, more)| *e += *more);
        lunette_render::difference(&judged, reference, Some(&self.area)).map_err(|e| anyhow!("{e}"))
    }
}

/// Share of light that a part of it has, over area; never 0.
fn share(part: &[Vec3], total: &[Vec3], area: &[f32]) -> f64 {
    let sum =
        |light: &[Vec3]| light.iter().zip(area).map(|(l, a)| f64::from(l.element_sum() * a)).sum::<f64>();
    (sum(part) / sum(total)).max(f64::MIN_POSITIVE)
}

/// Relights an asset, judges it, and gives the irradiance of all vertices too.
pub fn measure(
    asset: &Asset,
    (name, engine): (&str, &mut Engine),
    bake_seconds: f64,
    light: &Light,
    judge: &Judge,
) -> Result<(Row, Vec<[f32; 3]>)> {
    let still = Moment::default();
    let mut lit = engine.light(asset, light, &still, (0, 1))?;
    let mut least = lit.spent.all();
    for _ in 1..5 {
        lit = engine.light(asset, light, &still, (0, 1))?;
        least = least.min(lit.spent.all());
    }
    let total = relight::sum(&lit.direct, &lit.indirect);
    let middle = |corners: &[u32; 3]| Point { corners: *corners, weights: [1.0 / 3.0; 3], radius: 0.0 };
    let more: Vec<Vec3> = match engine.portals() {
        Some(frame) => {
            let mut detail = Detail::new(frame);
            judge.triangles.iter().map(|t| detail.at(&middle(t)).into()).collect()
        }
        None => Vec::new(),
    };
    let all = judge.difference(&total, &more, &judge.total)?;
    let row = Row {
        name: name.to_string(),
        relative: Parts {
            total: all.relative,
            direct: judge.difference(&lit.direct, &more, &judge.reference.direct)?.relative,
            indirect: judge.difference(&lit.indirect, &[], &judge.reference.indirect)?.relative,
        },
        picture: None,
        percentile_99: all.percentile_99,
        noise: judge.noise,
        bytes: engine.bytes_per_vertex(),
        bake_seconds,
        relight_milliseconds: least.as_secs_f64() * 1e3,
    };
    Ok((row, total))
}

/// Means over the corners of triangles.
fn middles(of_vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    triangles.iter().map(|t| t.map(|v| of_vertices[v as usize]).iter().sum::<Vec3>() / 3.0).collect()
}

fn triangle_area(mesh: &Mesh, triangle: &[u32; 3]) -> f32 {
    let [a, b, c] = triangle.map(|v| mesh.position[v as usize]);
    0.5 * (b - a).cross(c - a).length()
}

/// The rows as text, with a last line that says how they came about.
pub fn table(rows: &[Row], judge: &Judge) -> String {
    let mut text = format!(
        "{:<18} {:>10} {:>10} {:>10} {:>10} {:>10} {:>14} {:>8} {:>10}\n",
        "method", "rel. diff", "direct", "bounced", "99th pct", "picture", "bytes/V", "bake s", "relight ms"
    );
    for r in rows {
        let (d, p) = (r.percent(), 100.0 * r.percentile_99);
        let [direct, indirect] = r.percent_of_parts();
        let picture = r.picture.map_or("-".into(), |(r, n)| format!("{} %", percent(r, n)));
        let bytes = format!("{:.0} + {:.0}", r.bytes.0, r.bytes.1);
        let _ = writeln!(
            text,
            "{:<18} {d:>8} % {direct:>8} % {indirect:>8} % {p:>8.1} % {picture:>10} {bytes:>14} {:>8.1} {:>10.2}",
            r.name, r.bake_seconds, r.relight_milliseconds
        );
    }
    let _ = writeln!(text, "{}", judge.describe());
    text
}
