//! Glossy vertices of an interior: against naive rays, against the path-traced picture, and what must not change.

use std::f32::consts::PI;

use glam::{Vec3, vec3};
use lunette_bake::{Options, PortalOptions, Silent, bake_portals};
use lunette_relight::asset::Asset;
use lunette_relight::cubemap::{n_texels, project_light};
use lunette_relight::glossy::{Glossy, HIGHEST_EXPONENT, mean_reflectance, reflectance};
use lunette_relight::light::Light;
use lunette_relight::portal_frame::PortalFrame;
use lunette_relight::shell::Shell;
use lunette_render::{Camera, Gloss, Image, ReferenceOptions, Surface, Tracer, reference_image, trace};
use lunette_scenes::{Portal, Scene, take_portals};
use lunette_tests::baked::{light, scene};
use lunette_tests::brute::{End, Oracle};
use lunette_tests::measure::{mean, rms, spread};

const ROOM: &str = "box-room:edge=0.4,gloss=0.4,exponent=10";
const EYE: Vec3 = vec3(1.6, 1.35, 1.6);

struct Room {
    scene: Scene,
    portals: Vec<Portal>,
    asset: Asset<'static>,
}

fn room(spec: &str, options: &Options) -> Room {
    let mut scene = scene(spec);
    let portals = take_portals(&mut scene, &["glass*".into()]).expect("a window");
    let (asset, _) =
        bake_portals(&scene, &portals, options, &PortalOptions::default(), &Silent).expect("a bake");
    Room { scene, portals, asset }
}

fn options(rays: usize, bounces: usize) -> Options {
    Options { order: 4, indirect_order: 4, rays, bounces, ..Options::default() }
}

impl Room {
    fn lit(&self, light: &Light) -> PortalFrame<'_> {
        let mut frame = PortalFrame::new(&self.asset).expect("a portal");
        let n = frame.resolution(0);
        let mut texels = vec![[0.0; 3]; n_texels(n)];
        project_light(light, n, &mut texels);
        frame.set_shell(0, Shell::new(n, &texels).expect("a shell")).expect("the side of the bake");
        frame
    }

    fn glossy(&self) -> Glossy<'_> {
        Glossy::open(&self.asset).expect("good tensors").expect("a glossy object")
    }

    fn surface<'a>(&'a self, albedo: &'a [Vec3]) -> Surface<'a> {
        let mesh = &self.scene.mesh;
        Surface { position: &mesh.position, normal: &mesh.normal, index: &mesh.index, albedo }
    }
}

/// Radiance that the lobe of vertex `v` sends to the eye, by `side`² naive rays; `arriving` is the radiance along a ray.
fn brute(room: &Room, oracle: &Oracle, v: usize, side: usize, arriving: impl Fn(Vec3, End) -> f32) -> f32 {
    let (p, n) = (room.scene.mesh.position[v], room.scene.mesh.normal[v]);
    let r = (p - EYE).normalize().reflect(n);
    let mut sum = 0.0;
    oracle.for_each_ray(p, n, side, |d, end| {
        sum += f64::from(arriving(d, end) * r.dot(d).max(0.0).powi(10) * n.dot(d));
    });
    (0.4 * 12.0 / (2.0 * PI)) * (sum * 2.0 * std::f64::consts::PI / (side * side) as f64) as f32
}

/// Some glossy vertices that the eye sees from the front, not close to the floor, where a hair decides what they see.
fn judged(room: &Room, n: usize) -> Vec<usize> {
    let (glossy, mesh) = (room.glossy().vertices(), &room.scene.mesh);
    let is_seen = |&g: &usize| {
        let v = glossy[g] as usize;
        mesh.position[v].y > 0.05 && mesh.normal[v].dot(EYE - mesh.position[v]) > 0.0
    };
    let all: Vec<usize> = (0..glossy.len()).filter(is_seen).collect();
    spread(all.len(), n).map(|i| all[i]).collect()
}

fn sent(glossy: &Glossy) -> Vec<[f32; 3]> {
    let mut out = vec![[0.0; 3]; glossy.vertices().len()];
    glossy.radiance(EYE.to_array(), 0, &mut out);
    out
}

#[test]
fn bounced_gloss_matches_brute_force() {
    let room = room(ROOM, &options(2048, 1));
    let mut glossy = room.glossy();
    // Some smooth light on everything, in a room that is dark outside.
    let e = |p: Vec3| 1.5 + (1.3 * p.x + 0.4).sin() + 0.4 * (2.0 * p.z - p.y).cos();
    let irradiance: Vec<[f32; 3]> = room.scene.mesh.position.iter().map(|p| [e(*p); 3]).collect();
    glossy.project(&PortalFrame::new(&room.asset).expect("a portal"), &irradiance);
    let (found, rho) = (sent(&glossy), reflectance(&room.asset));
    let oracle = Oracle::new(&room.scene.mesh);
    let mut off = Vec::new();
    for g in judged(&room, 40) {
        let expected = brute(&room, &oracle, glossy.vertices()[g] as usize, 160, |_, end| {
            let End::Front(triangle, weights) = end else { return 0.0 };
            let corners = room.scene.mesh.index[triangle].map(|v| v as usize);
            (0..3).map(|i| weights[i] * rho[corners[i]].x * irradiance[corners[i]][0]).sum::<f32>() / PI
        });
        off.push(f64::from(found[g][0] / expected - 1.0));
        let v = glossy.vertices()[g] as usize;
        let (p, n) = (room.scene.mesh.position[v], room.scene.mesh.normal[v]);
        eprintln!("{p} n.v {:.3} found {} expected {expected}", n.dot((EYE - p).normalize()), found[g][0]);
    }
    // 2048 rays, a tenth of them in the lobe, leave 1 %; patches as wide as a fifth of the lobe another.
    assert!(rms(off.iter().copied()) < 0.02, "{off:?}");
    // The rays' error is without bias; what patches cost all vertices alike would show here.
    assert!(mean(off.iter().copied()).abs() < 0.01, "{off:?}");
}

#[test]
fn direct_gloss_matches_brute_force() {
    let room = room(ROOM, &options(4096, 0));
    let light = light("cie-overcast + uniform:0.2");
    let mut glossy = room.glossy();
    glossy.project(&room.lit(&light), &vec![[0.0; 3]; room.scene.mesh.position.len()]);
    let found = sent(&glossy);
    let oracle = Oracle::new(&room.scene.mesh);
    let (mut off, mut size) = (Vec::new(), Vec::new());
    for g in judged(&room, 40) {
        let expected = brute(&room, &oracle, glossy.vertices()[g] as usize, 400, |d, end| match end {
            End::Sky => light.radiance(d).x,
            _ => 0.0,
        });
        off.push(f64::from(found[g][0] - expected));
        size.push(f64::from(expected));
    }
    // The window is some thousands of the oracle's rays, of which those along its edge are a matter of chance; and it
    // cuts texels anywhere: half a percent each.
    let relative = rms(off) / rms(size);
    assert!(relative < 0.015, "{relative}");
}

/// Some pixels of the room, relit and path-traced, with the standard error of the latter.
fn pictures(room: &Room, light: &Light, samples: u32) -> (Image, Image, Image) {
    let camera = Camera::new(EYE, vec3(0.75, 0.45, -0.5), 36.0);
    let size = (24, 18);
    let albedo = room.scene.vertex_albedo();
    let lobes = room.scene.vertex_lobes(HIGHEST_EXPONENT);
    let (specular, exponent): (Vec<Vec3>, Vec<f32>) = lobes.iter().map(|l| (l.specular, l.exponent)).unzip();
    let panes: Vec<[Vec3; 3]> = room.portals.iter().flat_map(|p| p.triangles.clone()).collect();
    let tracer =
        Tracer::new(room.surface(&albedo)).expect("a tracer").with_portals(&panes).expect("a window");
    let tracer = tracer.with_gloss(Gloss { specular: &specular, exponent: &exponent }).expect("a lobe");
    let options = ReferenceOptions { samples, bounces: 3, seed: 1 };
    let truth = reference_image(&tracer, light, &camera, size, &options, |_| ()).expect("paths");

    let mut frame = room.lit(light);
    let mut irradiance = vec![[0.0; 3]; albedo.len()];
    frame.irradiance_parallel(&mut irradiance);
    let mut glossy = room.glossy();
    glossy.project(&frame, &irradiance);
    let e = irradiance.iter().map(|e| Vec3::from(*e));
    let mut radiance: Vec<Vec3> = e.zip(&albedo).map(|(e, rho)| e * *rho / PI).collect();
    glossy.vertices().iter().zip(sent(&glossy)).for_each(|(&v, s)| radiance[v as usize] += Vec3::from(s));
    let seen = trace(&tracer, &camera, size.0, size.1).expect("a picture");
    let image = seen.shade(&room.surface(&albedo), &radiance, |d| light.radiance(d)).expect("a picture");
    (image, truth.image, truth.error)
}

#[test]
fn picture_of_a_glossy_object_has_no_bias_against_the_reference() {
    let room = room("box-room:edge=0.25,gloss=0.4,exponent=10", &options(1024, 3));
    let (image, truth, error) = pictures(&room, &light("uniform"), 512);
    let ratio = |f: fn(Vec3) -> f32| {
        let sum = |i: &Image| i.pixels.iter().map(|p| f64::from(f(*p))).sum::<f64>();
        let noise = error.pixels.iter().map(|p| f64::from(f(*p)).powi(2)).sum::<f64>().sqrt() / sum(&truth);
        (sum(&image) / sum(&truth) - 1.0, noise)
    };
    for channel in [|p: Vec3| p.x, |p: Vec3| p.y, |p: Vec3| p.z] {
        let (off, noise) = ratio(channel);
        // Four standard errors, and 1 % for light interpolated between vertices 0.25 m apart in corners and contacts.
        assert!(noise < 0.005 && off.abs() < 4.0 * noise + 0.01, "{off} ± {noise}");
    }
}

#[test]
fn lobes_bounce_as_much_light_as_a_diffuse_coat_of_their_reflectance() {
    let glossy = room("box-room:edge=0.6,gloss=0.4,exponent=10", &options(64, 2));
    let mut coated = scene("box-room:edge=0.6,gloss=0.4,exponent=10");
    for material in coated.materials.iter_mut().filter(|m| m.specular != Vec3::ZERO) {
        material.albedo += material.specular * mean_reflectance(material.exponent);
        material.specular = Vec3::ZERO;
    }
    let portals = take_portals(&mut coated, &["glass*".into()]).expect("a window");
    let (coated, _) =
        bake_portals(&coated, &portals, &options(64, 2), &PortalOptions::default(), &Silent).expect("a bake");
    for tensor in ["portal.0.indirect.sh", "portal.0.direct.value", "indirect.gather", "indirect.spread"] {
        assert_eq!(glossy.asset.tensor(tensor), coated.tensor(tensor), "{tensor}");
    }
    assert!(coated.tensors().all(|(name, _)| !name.starts_with("glossy.")), "nothing for matt vertices");
    assert!(Glossy::open(&coated).expect("no tensors at all").is_none());
}

#[test]
fn glossy_bytes_do_not_depend_on_threads() {
    let bytes = |threads| {
        let options = Options { threads, ..options(64, 2) };
        room("box-room:edge=0.6,gloss=0.4,exponent=10", &options).asset.to_bytes().expect("an asset")
    };
    assert!(bytes(1) == bytes(3));
}

#[test]
fn exponents_beyond_the_limit_stay_diffuse() {
    let sharp = room("box-room:edge=0.8,gloss=0.4,exponent=300", &options(64, 1));
    assert!(Glossy::open(&sharp.asset).expect("no tensors").is_none());
    assert_eq!(sharp.scene.gloss_report(HIGHEST_EXPONENT).len(), 1);
}

#[test]
fn views_of_glossy_vertices_do_not_allocate() {
    let room = room("box-room:edge=0.8,gloss=0.4,exponent=10", &options(64, 1));
    let frame = room.lit(&light("uniform"));
    let mut glossy = room.glossy();
    let irradiance = vec![[1.0; 3]; room.scene.mesh.position.len()];
    let mut out = vec![[0.0; 3]; glossy.vertices().len()];
    let counted = allocation_counter::measure(|| {
        glossy.project(&frame, &irradiance);
        glossy.radiance(EYE.to_array(), 0, &mut out);
    });
    assert_eq!(counted.count_total, 0);
    assert!(out.iter().filter(|s| s[0] > 0.0).count() > out.len() / 2, "half of them turn to the eye");
}
