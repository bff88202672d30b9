//! A glossy object in a box-shaped room under a sunny sky through a window, against path tracing: error of the picture,
//! bytes, and time of bake, frame and view.
//!
//! The scene is that of figure 11 of Yue et al., Interactive Rendering of Interior Scenes with Dynamic Environment
//! Illumination, 2009, as far as it can be had: Phong exponent 10, cubemaps of 32 x 32 x 6, SH of order 4, 9 bounces; the
//! paper's picture differs by 2.1 % from its reference. The reference picture takes long, so that it is kept in the
//! target folder, under a name that says what it is of; it is traced anew, in an hour, where it is missing.
//!
//!     cargo bench -p lunette-benches --bench glossy

use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::Vec3;
use lunette_bake::{Basis, Options, PortalOptions, Silent, bake_portals, mesh_asset, refine};
use lunette_benches::least;
use lunette_relight::asset::Asset;
use lunette_relight::glossy::{Glossy, HIGHEST_EXPONENT};
use lunette_relight::indirect::Indirect;
use lunette_relight::light::{Light, Sky, Source};
use lunette_relight::portal_frame::PortalFrame;
use lunette_relight::shell::{Material, Shell};
use lunette_render::{
    Backdrop, Camera, Gloss, Image, ReferenceOptions, Scale, Surface, Through, Tracer, Visibility,
    auto_exposure, capture, difference, error_picture, noise, read_image, reference_image, seen_discs,
    tone_map, trace, write_exr, write_png,
};
use lunette_scenes::{Portal, Scene, builtin, take_portals};

/// The room: 48,000 vertices; the paper's has 44,763.
const SCENE: &str = "box-room:edge=0.08,gloss=0.4,exponent=10";
const BOUNCES: usize = 9;
const ROUNDS: usize = 10;

/// Pixels to a side of one of the reference's, whose mean is judged: else the edges of spots, the window and the object
/// would be off by what 16 rays per pixel are, and that is no matter of light.
const FINER: usize = 6;

/// A sunny sky, and how it is judged.
struct Case {
    name: &'static str,
    /// Of the sun, degrees.
    azimuth: f32,
    elevation: f32,
    size: (usize, usize),
    /// Paths per pixel of the reference.
    paths: u32,
}

/// The sun falls through the window on the floor beside the object, which it lights from below; and on the object itself,
/// whose every shadow's edge is then a texel wide instead of half a degree.
const CASES: [Case; 2] = [
    Case { name: "sun beside", azimuth: 300.0, elevation: 40.0, size: (64, 48), paths: 12288 },
    Case { name: "sun on it", azimuth: 270.0, elevation: 28.0, size: (80, 60), paths: 24576 },
];

/// How the room is baked.
struct Effort {
    name: &'static str,
    rays: usize,
    links: usize,
    /// How often edges are halved where near shadows end.
    refined: usize,
}

/// Links as they are by default, and as many as fit in 600 bytes per vertex.
const EFFORTS: [Effort; 2] = [
    Effort { name: "1024 rays, 448 links", rays: 1024, links: 448, refined: 0 },
    Effort { name: "4096 rays, 940 links, refined twice", rays: 4096, links: 940, refined: 2 },
];

fn main() {
    let (room, portals) = room();
    let camera = Camera::new(Vec3::new(1.6, 1.35, 1.6), Vec3::new(-0.15, 0.65, -0.9), 58.0);
    let truths = CASES.map(|case| case.reference(&room, &portals, &camera));
    for effort in EFFORTS {
        println!("\n{}", effort.name);
        judge(room.clone(), &portals, &camera, (&truths, &effort));
    }
}

fn judge(mut room: Scene, portals: &[Portal], camera: &Camera, (truths, effort): (&[Truth; 2], &Effort)) {
    let started = Instant::now();
    refine(&mut room, portals, effort.refined).expect("Embree");
    let options = Options {
        basis: vec![Basis::Sh, Basis::DirectToIndirect],
        order: 4,
        indirect_order: 4,
        rays: effort.rays,
        links: effort.links,
        bounces: BOUNCES,
        ..Options::default()
    };
    let (baked, _) =
        bake_portals(&room, portals, &options, &PortalOptions::default(), &Silent).expect("a bake");
    println!("baked in {:.1} s", started.elapsed().as_secs_f64());
    // Through the file's bytes, so that what is judged is what is stored.
    let bytes = baked.to_bytes().expect("bytes");
    let asset = Asset::from_bytes(&bytes).expect("an asset");
    let mut frame = PortalFrame::new(&asset).expect("portals");
    frame.set_indirect(Indirect::DirectToIndirect).expect("baked");
    let (direct, bounced) = frame.bytes_per_vertex();
    println!(
        "{} vertices, {} triangles; bytes per vertex: {direct:.0} direct, {bounced:.0} bounced from direct",
        asset.n_vertices(),
        asset.triangles().len()
    );
    let plain = Tracer::new(surface(&asset)).expect("a tracer");
    for (case, truth) in CASES.iter().zip(truths) {
        let visibility = trace(&plain, camera, FINER * case.size.0, FINER * case.size.1).expect("a picture");
        for carried in [Indirect::DirectToIndirect, Indirect::Sh] {
            println!("{}, bounced light {carried:?}", case.name);
            let frame = Frame {
                asset: &asset,
                visibility: &visibility,
                light: &case.light(),
                carried,
                case: case.name,
            };
            frame.judge("glossy", Shine::Glossy, truth);
            frame.judge("sun in texels", Shine::Coarse, truth);
        }
    }
}

fn room() -> (Scene, Vec<Portal>) {
    let mut room = builtin::build(SCENE).expect("a built-in scene");
    let portals = take_portals(&mut room, &["glass*".into()]).expect("a window");
    blacken_outside(&mut room, &portals);
    (room, portals)
}

/// What lies outside of the glass, which stands in the middle of its wall, becomes black: what it sends in is a matter of
/// the captured shell, in which here is only the sky.
fn blacken_outside(room: &mut Scene, portals: &[Portal]) {
    let glass = portals[0].centre();
    let black = lunette_scenes::Material { name: "outside".into(), albedo: Vec3::ZERO, ..Default::default() };
    room.materials.push(black);
    for (triangle, material) in room.mesh.index.iter().zip(&mut room.mesh.material) {
        let middle = triangle.iter().map(|&v| room.mesh.position[v as usize]).sum::<Vec3>() / 3.0;
        if (middle - glass).dot(portals[0].normal) < 0.0 {
            *material = room.materials.len() as u32 - 1;
        }
    }
}

fn surface<'a>(asset: &'a Asset) -> Surface<'a> {
    let triples = |t: &'a [[f32; 3]]| -> Vec<Vec3> { t.iter().map(|p| Vec3::from(*p)).collect() };
    Surface {
        position: triples(asset.positions()).leak(),
        normal: triples(asset.normals()).leak(),
        index: asset.triangles(),
        albedo: triples(asset.albedo()).leak(),
    }
}

/// How much of each pixel shows the glossy object.
fn object(asset: &Asset, visibility: &Visibility) -> Vec<f32> {
    let glossy = Glossy::open(asset).expect("good tensors").expect("a glossy object");
    let mut mark = vec![Vec3::ZERO; asset.n_vertices()];
    glossy.vertices().iter().for_each(|&v| mark[v as usize] = Vec3::ONE);
    let image = visibility.shade(&surface(asset), &mark, |_| Vec3::ZERO).expect("a picture");
    means(&image).pixels.iter().map(|p| p.x).collect()
}

/// A picture in the reference's pixels.
fn means(image: &Image) -> Image {
    let (width, height) = (image.width / FINER, image.height / FINER);
    let mean = |i: usize| {
        let (x, y) = (i % width * FINER, i / width * FINER);
        let row = |dy: usize| image.pixels[(y + dy) * image.width + x..][..FINER].iter().sum::<Vec3>();
        (0..FINER).map(row).sum::<Vec3>() / (FINER * FINER) as f32
    };
    Image { width, height, pixels: (0..width * height).map(mean).collect() }
}

/// The path-traced picture and its standard error.
struct Truth {
    image: Image,
    error: Image,
}

impl Case {
    fn light(&self) -> Light {
        let [azimuth, elevation] = [self.azimuth, self.elevation].map(f32::to_radians);
        Light::new(Source::Sky(Sky::new(azimuth, elevation, 3.0).expect("a good sky")))
    }

    fn kept(&self, suffix: &str) -> PathBuf {
        let name = format!("{SCENE}-{}-{}-{:?}-{}", self.azimuth, self.elevation, self.size, self.paths);
        let name: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../target/{name}{suffix}.exr"))
    }

    fn reference(&self, room: &Scene, portals: &[Portal], camera: &Camera) -> Truth {
        let (image, error) = (self.kept(""), self.kept("-error"));
        if let (Ok(image), Ok(error)) = (read_image(&image), read_image(&error)) {
            return Truth { image, error };
        }
        let started = Instant::now();
        let asset = mesh_asset(room);
        let lobes = room.vertex_lobes(HIGHEST_EXPONENT);
        let (specular, exponent): (Vec<Vec3>, Vec<f32>) =
            lobes.iter().map(|l| (l.specular, l.exponent)).unzip();
        let tracer = Tracer::new(surface(&asset)).and_then(|t| t.with_portals(&rectangle(portals)));
        let tracer = tracer.and_then(|t| t.with_gloss(Gloss { specular: &specular, exponent: &exponent }));
        let options = ReferenceOptions { samples: self.paths, bounces: BOUNCES as u32, seed: 1 };
        let truth =
            reference_image(&tracer.expect("a tracer"), &self.light(), camera, self.size, &options, |_| ())
                .expect("paths");
        println!("reference traced in {:.0} s", started.elapsed().as_secs_f64());
        for (path, picture) in [(&image, &truth.image), (&error, &truth.error)] {
            write_exr(path, picture).expect("the target folder can be written to");
        }
        Truth { image: truth.image, error: truth.error }
    }
}

/// The window's two largest triangles: the same opening as its many, and aiming at two costs less.
fn rectangle(portals: &[Portal]) -> Vec<[Vec3; 3]> {
    let points = || portals.iter().flat_map(|p| p.triangles.iter().flatten());
    let low = points().fold(Vec3::INFINITY, |a, p| a.min(*p));
    let high = points().fold(Vec3::NEG_INFINITY, |a, p| a.max(*p));
    let (b, c) = (Vec3::new(low.x, high.y, low.z), Vec3::new(low.x, low.y, high.z));
    vec![[low, b, high], [low, high, c]]
}

#[derive(Clone, Copy, PartialEq)]
enum Shine {
    Glossy,
    /// As glossy, the sun spread over its texels.
    Coarse,
}

struct Frame<'a> {
    asset: &'a Asset<'a>,
    visibility: &'a Visibility,
    light: &'a Light,
    carried: Indirect,
    case: &'static str,
}

impl Frame<'_> {
    fn judge(&self, name: &str, shine: Shine, truth: &Truth) {
        let image = self.picture(shine);
        // The sky itself, seen through the window, is no result.
        let pixels = self.visibility.coverage().into_iter().map(Vec3::splat).collect();
        let covered = means(&Image { width: FINER * image.width, height: FINER * image.height, pixels });
        let surface: Vec<f32> = covered.pixels.iter().map(|c| if c.x > 0.999 { 1.0 } else { 0.0 }).collect();
        let object = object(self.asset, self.visibility);
        let rest: Vec<f32> = object.iter().zip(&surface).map(|(o, s)| s * (1.0 - o)).collect();
        for (part, weight) in [("picture", &surface), ("object", &object), ("rest", &rest)] {
            let weight = Some(&weight[..]);
            let d = difference(&image.pixels, &truth.image.pixels, weight).expect("numbers");
            let noise = noise(&truth.error.pixels, &truth.image.pixels, weight).expect("numbers");
            println!(
                "{name:<14} {part:<8} {:>6.2} % off, 99th percentile {:>6.1} %, noise of the reference {:.2} %",
                100.0 * d.relative,
                100.0 * d.percentile_99,
                100.0 * noise
            );
        }
        let exposure = lunette_render::Exposure::Stops(auto_exposure(&truth.image));
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target");
        let name = format!("glossy-{}-{:?}-{name}", self.case, self.carried).replace(' ', "-");
        write_exr(&folder.join(format!("{name}.exr")), &image).expect("a picture");
        let pictures = [("", &image), ("-reference", &truth.image)];
        for (suffix, picture) in pictures {
            let path = folder.join(format!("{name}{suffix}.png"));
            write_png(&path, &tone_map(picture, exposure)).expect("a picture");
        }
        let error = error_picture(&image, &truth.image, None, Scale::default()).expect("a picture");
        write_png(&folder.join(format!("{name}-error.png")), &error).expect("a picture");
    }

    fn picture(&self, shine: Shine) -> Image {
        let mut frame = PortalFrame::new(self.asset).expect("portals");
        frame.set_indirect(self.carried).expect("bounced light");
        let side = frame.resolution(0);
        let backdrop = Backdrop::new(self.light, side).expect("a backdrop");
        let mut texels = vec![[0.0; 3]; 6 * side * side];
        let mut discs = Vec::new();
        for k in 0..frame.n_portals() {
            // As the reference has it.
            frame.set_material(k, Material::CLEAR);
            let centre = self.asset.metadata.shells[k + 1].centre.unwrap_or_default();
            capture(&backdrop, None, centre.into(), &mut texels).expect("a shell");
            if shine != Shine::Coarse {
                seen_discs(&backdrop, None, centre.into(), &mut discs);
            }
            let shell = Shell::new(side, &texels).expect("a shell");
            frame.set_shell_with_discs(k, shell, &discs).expect("the right side");
        }
        let mut irradiance = vec![[0.0; 3]; self.asset.n_vertices()];
        let relit = least(ROUNDS, || frame.irradiance_parallel(&mut irradiance));
        let surface = surface(self.asset);
        let radiance: Vec<Vec3> = irradiance
            .iter()
            .zip(surface.albedo)
            .map(|(e, rho)| Vec3::from(*e).max(Vec3::ZERO) * *rho / std::f32::consts::PI)
            .collect();
        let mut glossy = Glossy::open(self.asset).expect("good tensors").expect("a glossy object");
        let eye = self.visibility.eye().to_array();
        let mut out = vec![[0.0; 3]; glossy.vertices().len()];
        let projected = least(ROUNDS, || glossy.project(&frame, &irradiance));
        let seen = least(ROUNDS, || glossy.radiance_parallel(eye, &mut out));
        let (texels, patches) = glossy.entries_per_vertex();
        println!(
            "all vertices relit in {:.2} ms, patches lit in {:.2} ms, {} glossy vertices seen in {:.2} ms \
             ({texels:.0} texels and {patches:.0} patches each, {:.0} bytes beside the direct row)",
            relit * 1e3,
            projected * 1e3,
            out.len(),
            seen * 1e3,
            glossy.bytes_per_vertex()
        );
        let background = |d| self.light.radiance(d);
        let through = Through { frame: &frame, glossy: Some(&glossy) };
        means(
            &self
                .visibility
                .shade_through(Some(through), &surface, &radiance, background)
                .expect("a picture"),
        )
    }
}
