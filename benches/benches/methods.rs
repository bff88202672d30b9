//! Speed, size and accuracy of every way to carry the direct light of the sky, and where each one breaks.
//!
//! Each scene is baked once; every method relights it under an overcast sky, a clear sky with its sun, and discs of
//! light from 0.005 to 0.8 radians; the path-traced reference without bounces judges at some vertices. Drawn into
//! `methods.html` in the target folder; printed as a table.
//!
//!     cargo bench -p lunette-benches --bench methods

use std::error::Error;
use std::hint::black_box;

use glam::Vec3;
use lunette_bake::{Options, Silent};
use lunette_benches::chart::{Chart, Page, Point, Series};
use lunette_benches::{fewer_bands, least};
use lunette_relight::aperture::Intersection;
use lunette_relight::asset::Asset;
use lunette_relight::frame::{Frame, Method};
use lunette_relight::light::{Cap, CieOvercast, Light, Sky, Source, Window};
use lunette_render::{ReferenceOptions, Surface, Tracer};
use lunette_scenes::Scene;

/// Scenes, and at every how many vertices they are judged.
const SCENES: [(&str, usize); 4] = [
    ("terrain:n=129", 16),
    ("courtyard:edge=0.6,columns=3", 64),
    ("sphere-on-plane:edge=0.15", 4),
    ("horizon-band:edge=0.5", 4),
];

/// Radii of the discs, radians; the first one is the sun's.
const RADII: [f32; 8] = [0.005, 0.01, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8];

/// Direction of the discs: 45 degrees high; over the band, straight up, where its canopy is.
const SLANTED: Vec3 = Vec3::new(0.6, 0.707, 0.374);

/// Rays per vertex of the bake: enough that the method shows and not its noise.
const RAYS: usize = 4096;
const REFERENCE: ReferenceOptions = ReferenceOptions { samples: 2048, bounces: 0, seed: 1 };
const ROUNDS: usize = 5;

/// A method, the family that it is drawn with, and its label there.
struct Candidate {
    family: &'static str,
    label: String,
    method: Method,
}

impl Candidate {
    fn name(&self) -> String {
        let is_number = self.label.parse::<usize>().is_ok();
        if is_number { format!("{} {}", self.family, self.label) } else { self.family.into() }
    }
}

/// One method under one light.
struct Outcome {
    relative: f64,
    nanoseconds: f64,
    bytes: usize,
}

/// One light in one scene.
struct Case {
    light: String,
    noise: f64,
    outcomes: Vec<Outcome>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let candidates = candidates();
    let mut page = Page::new(
        "Direct light: speed, size and accuracy",
        "Relative difference of irradiance at the vertices, weighted by area, against the path-traced reference. \
         Time is one thread's for one frame, projection of the light included, divided by the vertices. Small \
         numbers in the charts are SH orders.",
    );
    for (name, stride) in SCENES {
        let scene = lunette_scenes::builtin::build(name)?;
        let cases = measure(name, &scene, stride, &candidates)?;
        print(name, &cases, &candidates);
        draw(&mut page, name, scene.mesh.position.len(), &cases, &candidates)?;
    }
    println!("{}", page.write("methods.html")?.display());
    Ok(())
}

fn candidates() -> Vec<Candidate> {
    let sh = |family, order: usize, window| Candidate {
        family,
        label: order.to_string(),
        method: Method::Sh { order, window },
    };
    let single = |family, label: &str, method| Candidate { family, label: label.into(), method };
    let lanczos = Window::Lanczos { strength: 1.0 };
    (1..=10)
        .map(|order| sh("sh", order, None))
        .chain((2..=10).map(|order| sh("sh, Lanczos window", order, Some(lanczos))))
        .chain([
            single("bent", "bent", Method::Bent),
            single("aperture", "aperture", Method::Aperture(Intersection::Exact)),
            single("aperture, smoothstep", "", Method::Aperture(Intersection::Smoothstep)),
        ])
        .collect()
}

fn lights(name: &str) -> Result<Vec<(String, Light)>, Box<dyn Error>> {
    let axis = if name.starts_with("horizon") { Vec3::Y } else { SLANTED.normalize() };
    let sky = Sky::new(150f32.to_radians(), 40f32.to_radians(), 3.0)?;
    let disc = |radius| Source::Cap(Cap { axis, radius, radiance: Vec3::ONE });
    let mut lights = vec![
        ("overcast".to_string(), Source::CieOvercast(CieOvercast::new(Vec3::ONE))),
        ("clear sky".to_string(), Source::Sky(sky)),
    ];
    lights.extend(RADII.map(|radius| (radius.to_string(), disc(radius))));
    Ok(lights.into_iter().map(|(label, source)| (label, Light::new(source))).collect())
}

/// Bakes a scene and holds all methods against the reference under each light.
fn measure(
    name: &str,
    scene: &Scene,
    stride: usize,
    candidates: &[Candidate],
) -> Result<Vec<Case>, Box<dyn Error>> {
    let options = Options { order: 10, indirect_order: 1, rays: RAYS, bounces: 0, ..Options::default() };
    let asset = lunette_bake::bake(scene, &options, &Silent)?;
    let assets =
        (1..=10).map(|order| fewer_bands(&asset, "sky.direct.sh", order)).collect::<Result<Vec<_>, _>>()?;
    let albedo = scene.vertex_albedo();
    let mesh = &scene.mesh;
    let surface =
        Surface { position: &mesh.position, normal: &mesh.normal, index: &mesh.index, albedo: &albedo };
    let tracer = Tracer::new(surface)?;
    let position: Vec<Vec3> = mesh.position.iter().step_by(stride).copied().collect();
    let normal: Vec<Vec3> = mesh.normal.iter().step_by(stride).map(|n| n.normalize()).collect();
    let area: Vec<f32> = mesh.vertex_area().into_iter().step_by(stride).collect();
    let judge = |(label, light): (String, Light)| {
        let r =
            lunette_render::reference_irradiance(&tracer, &light, &position, &normal, &REFERENCE, |_| ())?;
        let noise = lunette_render::noise(&r.error, &r.direct, Some(&area))?;
        let outcome = |c: &Candidate| outcome(&assets, c.method, &light, stride, (&r.direct, &area));
        let outcomes = candidates.iter().map(outcome).collect::<Result<_, _>>()?;
        Ok(Case { light: label, noise, outcomes })
    };
    lights(name)?.into_iter().map(judge).collect()
}

fn outcome(
    assets: &[Asset],
    method: Method,
    light: &Light,
    stride: usize,
    (reference, area): (&[Vec3], &[f32]),
) -> Result<Outcome, Box<dyn Error>> {
    let asset = match method {
        Method::Sh { order, .. } => &assets[order - 1],
        _ => &assets[0],
    };
    let mut frame = Frame::new(asset, method)?;
    let mut out = vec![[0.0; 3]; asset.n_vertices()];
    let seconds = least(ROUNDS, || {
        frame.project(light);
        frame.direct(0, black_box(&mut out));
    });
    let judged: Vec<Vec3> = out.iter().step_by(stride).map(|e| Vec3::from(*e)).collect();
    Ok(Outcome {
        relative: lunette_render::difference(&judged, reference, Some(area))?.relative,
        nanoseconds: seconds * 1e9 / out.len() as f64,
        bytes: (frame.bytes_per_vertex().0 + frame.bytes_per_vertex().1).round() as usize,
    })
}

fn print(name: &str, cases: &[Case], candidates: &[Candidate]) {
    println!("\n{name}: relative difference, %");
    let header: Vec<String> = cases.iter().map(|c| format!("{:>10}", c.light)).collect();
    println!("{:<24}{:>8}{:>9}{}", "", "bytes/V", "ns/V sky", header.concat());
    for (i, c) in candidates.iter().enumerate() {
        let cells: Vec<String> =
            cases.iter().map(|case| format!("{:>10.2}", 100.0 * case.outcomes[i].relative)).collect();
        let first = &cases[1].outcomes[i];
        let name = c.name();
        println!("{name:<24}{:>8}{:>9.1}{}", first.bytes, first.nanoseconds, cells.concat());
    }
    let noise: Vec<String> = cases.iter().map(|case| format!("{:>10.2}", 100.0 * case.noise)).collect();
    println!("{:<41}{}", "the reference's noise", noise.concat());
}

fn draw(
    page: &mut Page,
    name: &str,
    vertices: usize,
    cases: &[Case],
    candidates: &[Candidate],
) -> Result<(), Box<dyn Error>> {
    let noise = cases.iter().map(|c| c.noise).fold(0.0, f64::max);
    let text = format!(
        "{vertices} vertices, {RAYS} rays each. The reference takes {} paths; its own noise is {:.2} % at most.",
        REFERENCE.samples,
        100.0 * noise
    );
    page.section(name, &text);
    page.chart(&by_radius(cases, candidates))?;
    for case in &cases[..2] {
        page.chart(&by_cost(case, candidates, "bytes per vertex", |o| o.bytes as f64))?;
        page.chart(&by_cost(case, candidates, "relighting, ns per vertex", |o| o.nanoseconds))?;
    }
    Ok(())
}

/// Error against the size of the light, for some of the methods.
fn by_radius(cases: &[Case], candidates: &[Candidate]) -> Chart {
    let is_chosen = |c: &Candidate| match c.method {
        Method::Sh { order, window } => matches!((order, window), (3 | 5 | 10, None) | (10, Some(_))),
        _ => c.family != "aperture, smoothstep",
    };
    let discs = || cases.iter().filter_map(|c| Some((c.light.parse::<f64>().ok()?, c)));
    let series = |(i, c): (usize, &Candidate)| Series {
        name: c.name(),
        points: discs().map(|(x, case)| point(x, case.outcomes[i].relative, "")).collect(),
    };
    let series = candidates.iter().enumerate().filter(|(_, c)| is_chosen(c)).map(series).collect();
    Chart {
        title: "A disc of light of any size".into(),
        x: "radius of the disc, radians".into(),
        y: "relative difference, %".into(),
        series,
    }
}

/// Error against a cost, all methods, a line for each family.
fn by_cost(case: &Case, candidates: &[Candidate], x: &str, cost: impl Fn(&Outcome) -> f64) -> Chart {
    let mut series: Vec<Series> = Vec::new();
    for (c, outcome) in candidates.iter().zip(&case.outcomes) {
        if series.last().is_none_or(|s| s.name != c.family) {
            series.push(Series { name: c.family.into(), points: Vec::new() });
        }
        if let Some(last) = series.last_mut() {
            last.points.push(point(cost(outcome), outcome.relative, &c.label));
        }
    }
    Chart {
        title: format!("{}: error and cost", case.light),
        x: x.into(),
        y: "relative difference, %".into(),
        series,
    }
}

fn point(x: f64, relative: f64, label: &str) -> Point {
    Point { x, y: 100.0 * relative, label: label.into() }
}
