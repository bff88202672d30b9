//! `lunette render`

use anyhow::{Result, anyhow, ensure};
use glam::Vec3;
use lunette_relight::light::Light;
use lunette_render::{Camera, Reference, ReferenceImage, ReferenceOptions, Surface, Tracer};
use lunette_scenes::{Portal, Scene};

use crate::args;
use crate::output::{self, Lit};
use crate::progress::Bar;
use crate::{glossy, light, portals, scene, stage};

/// `lunette render`
pub fn run(arguments: &args::Render) -> Result<()> {
    let kind = output::kind(&arguments.output)?;
    output::check_folder(&arguments.output)?;
    let exposure = stage::exposure(&arguments.picture)?;
    let size = stage::size(&arguments.picture)?;
    let options = options(arguments.samples, arguments.bounces, arguments.seed)?;
    let mut scene = scene::load(&arguments.scene, &arguments.read)?;
    let portals = portals::take(&mut scene, &arguments.scene, &arguments.openings)?;
    let lights = light::frames(&arguments.light, scene.mesh.bounds())?;
    let albedo = scene.vertex_albedo();
    let coat = glossy::Coat::new(&scene, &arguments.scene);
    let tracer = tracer(surface(&scene, &albedo), &portals)?;
    let tracer = tracer.with_gloss(coat.gloss()).map_err(|e| anyhow!("{e}"))?;
    let camera = stage::camera(&arguments.picture, &tracer)?;
    for (i, (label, light)) in lights.iter().enumerate() {
        let path = output::frame_path(&arguments.output, i, lights.len())?;
        let label = if label.is_empty() { String::new() } else { format!(", {label}") };
        if kind.is_picture() {
            let reference = image(&tracer, light, &camera, size, &options)?;
            output::picture(&path, &reference.image, exposure)?;
            let noise = lunette_render::noise(&reference.error.pixels, &reference.image.pixels, None);
            println!("{}: {}{label}", path.display(), noise_text(noise));
        } else {
            let reference = vertices(&tracer, light, &options)?;
            let noise = lunette_render::noise(&reference.error, &reference.total(), None);
            let lit = Lit {
                direct: bytemuck::cast_slice(&reference.direct),
                indirect: bytemuck::cast_slice(&reference.indirect),
                error: Some(bytemuck::cast_slice(&reference.error)),
            };
            output::vertices(&path, &lunette_bake::mesh_asset(&scene), &lit)?;
            println!("{}: {}{label}", path.display(), noise_text(noise));
        }
    }
    Ok(())
}

/// More paths than anybody has the time for.
const MOST_SAMPLES: u32 = 1 << 24;

/// More bounces than leave any light, but in a white furnace.
const MOST_BOUNCES: u32 = 1000;

/// Options of the reference from the command line.
pub fn options(samples: u32, bounces: u32, seed: u32) -> Result<ReferenceOptions> {
    ensure!((2..=MOST_SAMPLES).contains(&samples), "--samples: {samples} is not in 2..={MOST_SAMPLES}");
    ensure!(bounces <= MOST_BOUNCES, "--bounces: {bounces} is not in 0..={MOST_BOUNCES}");
    Ok(ReferenceOptions { samples, bounces, seed })
}

/// What the renderer takes of a scene.
pub fn surface<'a>(scene: &'a Scene, albedo: &'a [Vec3]) -> Surface<'a> {
    Surface { position: &scene.mesh.position, normal: &scene.mesh.normal, index: &scene.mesh.index, albedo }
}

/// The path tracer of a surface; it aims at the portals, if there are any.
pub fn tracer<'a>(surface: Surface<'a>, portals: &[Portal]) -> Result<Tracer<'a>> {
    let panes: Vec<[Vec3; 3]> = portals.iter().flat_map(|p| p.triangles.iter().copied()).collect();
    let tint: Vec<Vec3> = portals.iter().flat_map(|p| vec![p.transmission; p.triangles.len()]).collect();
    let tracer = Tracer::new(surface).map_err(|e| anyhow!("{e}"))?;
    if panes.is_empty() { Ok(tracer) } else { tracer.with_glass(&panes, &tint).map_err(|e| anyhow!("{e}")) }
}

/// The reference at every vertex, with a progress bar.
pub fn vertices(tracer: &Tracer, light: &Light, options: &ReferenceOptions) -> Result<Reference> {
    let surface = tracer.surface();
    let normals: Vec<Vec3> = surface.normal.iter().map(|n| n.normalize()).collect();
    at(tracer, light, surface.position, &normals, options)
}

/// The reference at points of the surface, with a progress bar.
pub fn at(
    tracer: &Tracer,
    light: &Light,
    position: &[Vec3],
    normal: &[Vec3],
    options: &ReferenceOptions,
) -> Result<Reference> {
    let counter = Counter::new("vertices", position.len());
    lunette_render::reference_irradiance(tracer, light, position, normal, options, |n| counter.add(n))
        .map_err(|e| anyhow!("{e}"))
}

/// The reference as a picture, with a progress bar.
pub fn image(
    tracer: &Tracer,
    light: &Light,
    camera: &Camera,
    size: (usize, usize),
    options: &ReferenceOptions,
) -> Result<ReferenceImage> {
    let counter = Counter::new("pixels", size.0 * size.1);
    lunette_render::reference_image(tracer, light, camera, size, options, |n| counter.add(n))
        .map_err(|e| anyhow!("{e}"))
}

struct Counter {
    bar: Bar,
    done: std::sync::atomic::AtomicU64,
    total: u64,
}

impl Counter {
    fn new(unit: &'static str, total: usize) -> Counter {
        Counter { bar: Bar::new(unit, 1.0), done: 0.into(), total: total as u64 }
    }

    fn add(&self, n: usize) {
        let done = self.done.fetch_add(n as u64, std::sync::atomic::Ordering::Relaxed) + n as u64;
        self.bar.set("reference", done, self.total);
    }
}

pub fn noise_text(noise: Result<f64, lunette_render::Error>) -> String {
    match noise {
        Ok(noise) => format!("mean standard error {:.2} % of the mean", noise * 100.0),
        Err(e) => e.to_string(),
    }
}
