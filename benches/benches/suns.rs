//! Where SH gives out: error of bounced light through a window against the order of its SH and the size of the sun, beside
//! direct-to-indirect transport, which has no order.
//!
//! A room is baked once with ten bands. Suns of several sizes move across the window, at five places of a day; the
//! path-traced reference judges bounced light in the middle of some triangles, all places of a sun together. Drawn
//! into `suns.html` in the target folder; printed as a table.
//!
//!     cargo bench -p lunette-benches --bench suns

use std::error::Error;

use glam::Vec3;
use lunette_bake::{Basis, Options, PortalOptions, Silent, bake_portals};
use lunette_benches::chart::{Chart, Page, Point, Series};
use lunette_benches::fewer_bands;
use lunette_relight::asset::Asset;
use lunette_relight::cubemap::{n_texels, project_light};
use lunette_relight::indirect::Indirect;
use lunette_relight::light::{Cap, CieOvercast, Light, Source};
use lunette_relight::portal_frame::PortalFrame;
use lunette_relight::shell::{Material, Shell};
use lunette_render::{ReferenceOptions, Surface, Tracer, difference, noise, reference_irradiance};
use lunette_scenes::{builtin, take_portals};

const SCENE: &str = "box-room:edge=0.1";
const BOUNCES: usize = 12;
const ORDERS: usize = 10;
/// So many triangles are judged.
const JUDGED: usize = 100;
const PATHS: u32 = 8192;

/// Radii of the suns, radians; the first is the sun's own.
const RADII: [f32; 4] = [0.004_653, 0.1, 0.3, 0.8];

/// Directions to them, through the window in the wall at -X.
const PLACES: [Vec3; 5] = [
    Vec3::new(-1.0, 0.5, -0.8),
    Vec3::new(-1.0, 0.9, -0.3),
    Vec3::new(-1.0, 0.3, 0.1),
    Vec3::new(-1.0, 0.7, 0.4),
    Vec3::new(-1.0, 0.35, 0.9),
];

/// A kind of light at all of its places.
struct Case {
    name: String,
    lights: Vec<Light>,
}

/// Errors by order, that of what is carried, and the reference's noise.
struct Outcome {
    sh: Vec<f64>,
    carried: f64,
    noise: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut room = builtin::build(SCENE)?;
    let portals = take_portals(&mut room, &["glass*".into()])?;
    let basis = vec![Basis::Sh, Basis::DirectToIndirect];
    let options =
        Options { basis, order: ORDERS, indirect_order: ORDERS, bounces: BOUNCES, ..Options::default() };
    let (asset, _) = bake_portals(&room, &portals, &options, &PortalOptions::default(), &Silent)?;
    let assets = (1..=ORDERS)
        .map(|order| fewer_bands(&asset, "portal.0.indirect.sh", order))
        .collect::<Result<Vec<_>, _>>()?;
    let albedo = room.vertex_albedo();
    let mesh = &room.mesh;
    let surface =
        Surface { position: &mesh.position, normal: &mesh.normal, index: &mesh.index, albedo: &albedo };
    let panes: Vec<[Vec3; 3]> = portals.iter().flat_map(|p| p.triangles.iter().copied()).collect();
    let tracer = Tracer::new(surface)?.with_portals(&panes)?;
    let inside = lunette_bake::openings::inside(&room, &portals)?;
    let inner: Vec<[u32; 3]> =
        mesh.index.iter().filter(|t| t.iter().all(|&v| inside[v as usize])).copied().collect();
    let at: Vec<[u32; 3]> = (0..JUDGED).map(|i| inner[i * inner.len() / JUDGED]).collect();

    println!("{SCENE}, {} vertices, {BOUNCES} bounces: bounced light, relative difference, %", inside.len());
    let header: Vec<String> = (1..=ORDERS).map(|n| format!("{:>8}", format!("sh{n}"))).collect();
    println!("{:<22}{}{:>10}{:>8}", "", header.concat(), "carried", "noise");
    let mut outcomes = Vec::new();
    for case in cases() {
        let outcome = judge(&case, &assets, &tracer, &at)?;
        let cells: Vec<String> = outcome.sh.iter().map(|e| format!("{:>8.1}", 100.0 * e)).collect();
        let [carried, noise] = [outcome.carried, outcome.noise].map(|e| 100.0 * e);
        println!("{:<22}{}{carried:>10.1}{noise:>8.1}", case.name, cells.concat());
        outcomes.push((case.name, outcome));
    }
    let mut page = Page::new(
        "Bounced light through a window: where SH gives out",
        "Relative difference of bounced irradiance against the path-traced reference, suns of a size at five places \
         together. Numbers beside points are SH bands; direct-to-indirect transport has none.",
    );
    page.section(SCENE, &format!("{} vertices, {PATHS} paths for each judged point.", inside.len()));
    page.chart(&by_order(&outcomes))?;
    page.chart(&by_radius(&outcomes))?;
    println!("{}", page.write("suns.html")?.display());
    Ok(())
}

fn cases() -> Vec<Case> {
    let disc = |radius: f32, axis: Vec3| {
        let radiance = Vec3::splat(1.0 / radius.sin().powi(2));
        Light::new(Source::Cap(Cap { axis: axis.normalize(), radius, radiance }))
    };
    let suns = RADII.map(|radius| Case {
        name: format!("sun of {radius} rad"),
        lights: PLACES.iter().map(|axis| disc(radius, *axis)).collect(),
    });
    let overcast = Light::new(Source::CieOvercast(CieOvercast::new(Vec3::ONE)));
    suns.into_iter().chain([Case { name: "overcast sky".into(), lights: vec![overcast] }]).collect()
}

fn judge(case: &Case, assets: &[Asset], tracer: &Tracer, at: &[[u32; 3]]) -> Result<Outcome, Box<dyn Error>> {
    let asset = &assets[0];
    let middle =
        |of: &[[f32; 3]], t: &[u32; 3]| t.map(|v| Vec3::from(of[v as usize])).iter().sum::<Vec3>() / 3.0;
    let pick = |of: &[[f32; 3]]| at.iter().map(|t| middle(of, t)).collect::<Vec<_>>();
    let position = pick(asset.positions());
    let normal: Vec<Vec3> = pick(asset.normals()).into_iter().map(Vec3::normalize).collect();
    let (mut truth, mut error) = (Vec::new(), Vec::new());
    for light in &case.lights {
        let options = ReferenceOptions { samples: PATHS, bounces: BOUNCES as u32, seed: 5 };
        let r = reference_irradiance(tracer, light, &position, &normal, &options, |_| ())?;
        truth.extend(r.indirect);
        error.extend(r.indirect_error);
    }
    let off = |asset: &Asset, way| -> Result<f64, Box<dyn Error>> {
        let mut found = Vec::new();
        for light in &case.lights {
            found.extend(pick(&bounced(asset, light, way)?));
        }
        Ok(difference(&found, &truth, None)?.relative)
    };
    Ok(Outcome {
        sh: assets.iter().map(|asset| off(asset, Indirect::Sh)).collect::<Result<_, _>>()?,
        carried: off(asset, Indirect::DirectToIndirect)?,
        noise: noise(&error, &truth, None)?,
    })
}

fn bounced(asset: &Asset, light: &Light, way: Indirect) -> Result<Vec<[f32; 3]>, Box<dyn Error>> {
    let mut frame = PortalFrame::new(asset)?;
    frame.set_indirect(way)?;
    // As the reference has it.
    frame.set_material(0, Material::CLEAR);
    let n = frame.resolution(0);
    let mut texels = vec![[0.0; 3]; n_texels(n)];
    project_light(light, n, &mut texels);
    let discs: Vec<Cap> = light.discs().collect();
    frame.set_shell_with_discs(0, Shell::new(n, &texels)?, &discs)?;
    let mut direct = vec![[0.0; 3]; asset.n_vertices()];
    let mut out = direct.clone();
    frame.direct(0, &mut direct);
    frame.reflect(&direct);
    frame.add_indirect(0, &mut out);
    Ok(out)
}

/// Error by order, a line for each light.
fn by_order(outcomes: &[(String, Outcome)]) -> Chart {
    let point = |(i, e): (usize, &f64)| Point {
        x: 6.0 * ((i + 1) * (i + 1)) as f64,
        y: 100.0 * e,
        label: (i + 1).to_string(),
    };
    let series = |(name, outcome): &(String, Outcome)| Series {
        name: name.clone(),
        points: outcome.sh.iter().enumerate().map(point).collect(),
    };
    Chart {
        title: "SH of order 1 to 10".into(),
        x: "bytes per vertex".into(),
        y: "relative difference, %".into(),
        series: outcomes.iter().map(series).collect(),
    }
}

/// Error by the size of the sun, a line for some orders and for what is carried.
fn by_radius(outcomes: &[(String, Outcome)]) -> Chart {
    let line = |name: String, of: &dyn Fn(&Outcome) -> f64| {
        let points = RADII.iter().zip(outcomes).map(|(radius, (_, outcome))| Point {
            x: f64::from(*radius),
            y: 100.0 * of(outcome),
            label: String::new(),
        });
        Series { name, points: points.collect() }
    };
    let sh = [2, 4, 6, 10].map(|order| line(format!("sh {order}"), &|o| o.sh[order - 1]));
    let carried = line("direct to indirect".into(), &|o| o.carried);
    Chart {
        title: "A sun of any size".into(),
        x: "radius of the sun, radians".into(),
        y: "relative difference, %".into(),
        series: sh.into_iter().chain([carried, line("the reference's noise".into(), &|o| o.noise)]).collect(),
    }
}
