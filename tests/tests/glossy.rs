//! Glossy vertices of an interior: against naive rays, against the path-traced picture, and what must not change.

use std::f32::consts::PI;

use glam::{Vec3, vec3};
use lunette_bake::openings::inside;
use lunette_bake::{Basis, Options, PortalOptions, Silent, bake_portals};
use lunette_relight::asset::Asset;
use lunette_relight::cubemap::{n_texels, project_light};
use lunette_relight::glossy::{Glossy, HIGHEST_EXPONENT, mean_reflectance, reflectance};
use lunette_relight::indirect::Indirect;
use lunette_relight::light::Light;
use lunette_relight::portal_frame::{Detail, Point, PortalFrame};
use lunette_relight::shell::{self, Shell};
use lunette_render::{
    Camera, Gloss, ReferenceOptions, Surface, Tracer, difference, noise, reference_image,
    reference_irradiance, trace,
};
use lunette_scenes::{Material, Portal, Scene, take_portals};
use lunette_tests::baked::{light, scene};
use lunette_tests::brute::{End, Oracle};
use lunette_tests::interior::in_flat_faces;
use lunette_tests::measure::{mean, rms, spread};

const EYE: Vec3 = vec3(1.6, 1.35, 1.6);

struct Room {
    scene: Scene,
    /// Of the glossy object.
    exponent: f32,
    portals: Vec<Portal>,
    asset: Asset<'static>,
}

fn room(spec: &str, options: &Options) -> Room {
    changed_room(spec, options, |_| ())
}

fn changed_room(spec: &str, options: &Options, change: impl Fn(&mut Scene)) -> Room {
    let mut scene = scene(spec);
    change(&mut scene);
    let portals = take_portals(&mut scene, &["glass*".into()]).expect("a window");
    blacken_outside(&mut scene, &portals[0]);
    let portal_options = PortalOptions::default();
    let (asset, _) = bake_portals(&scene, &portals, options, &portal_options, &Silent).expect("a bake");
    let exponent = scene.materials.iter().map(|m| m.exponent).fold(0.0, f32::max);
    Room { scene, exponent, portals, asset }
}

/// Depth of the window's reveal inside of the glass, m, and a hair.
const REVEAL: f32 = 0.126;

/// What lies outside of the glass, which stands in the middle of its wall, becomes black: what it sends in is a matter of
/// the shell, in which here is only the light. And the reveal, which is but one triangle wide, so that light on it is
/// known badly.
fn blacken_outside(scene: &mut Scene, glass: &Portal) {
    let black = Material { name: "outside".into(), albedo: Vec3::ZERO, ..Material::default() };
    scene.materials.push(black);
    for (triangle, material) in scene.mesh.index.iter().zip(&mut scene.mesh.material) {
        let middle = triangle.iter().map(|&v| scene.mesh.position[v as usize]).sum::<Vec3>() / 3.0;
        if (middle - glass.centre()).dot(glass.normal) < REVEAL {
            *material = scene.materials.len() as u32 - 1;
        }
    }
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
        // The reference has no glass.
        frame.set_material(0, shell::Material::CLEAR);
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
    let e = room.exponent;
    let (p, n) = (room.scene.mesh.position[v], room.scene.mesh.normal[v]);
    let r = (p - EYE).normalize().reflect(n);
    let mut sum = 0.0;
    oracle.for_each_ray(p, n, side, |d, end| {
        sum += f64::from(arriving(d, end) * r.dot(d).max(0.0).powf(e) * n.dot(d));
    });
    (0.4 * (e + 2.0) / (2.0 * PI)) * (sum * 2.0 * std::f64::consts::PI / (side * side) as f64) as f32
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

/// How far off the lobes of some vertices are under bounced light, relative to the brute force: root mean square, mean.
fn bounced_error(exponent: f32) -> (f64, f64) {
    let room = room(&format!("box-room:edge=0.4,gloss=0.4,exponent={exponent}"), &options(2048, 1));
    let mut glossy = room.glossy();
    // Some smooth light on everything, in a room that is dark outside.
    let e = |p: Vec3| 1.5 + (1.3 * p.x + 0.4).sin() + 0.4 * (2.0 * p.z - p.y).cos();
    let irradiance: Vec<[f32; 3]> = room.scene.mesh.position.iter().map(|p| [e(*p); 3]).collect();
    glossy.project(&PortalFrame::new(&room.asset).expect("a portal"), &irradiance);
    let (found, rho) = (sent(&glossy), reflectance(&room.asset));
    let oracle = Oracle::new(&room.scene.mesh);
    let off = judged(&room, 40).into_iter().map(|g| {
        let expected = brute(&room, &oracle, glossy.vertices()[g] as usize, 160, |_, end| {
            let End::Front(triangle, weights) = end else { return 0.0 };
            let corners = room.scene.mesh.index[triangle].map(|v| v as usize);
            (0..3).map(|i| weights[i] * rho[corners[i]].x * irradiance[corners[i]][0]).sum::<f32>() / PI
        });
        f64::from(found[g][0] / expected - 1.0)
    });
    let off: Vec<f64> = off.collect();
    (rms(off.iter().copied()), mean(off.iter().copied()))
}

#[test]
fn bounced_gloss_matches_brute_force() {
    // 2048 rays, a tenth of them in the lobe, leave 1 %; patches as wide as a fifth of the lobe another. The rays' error is
    // without bias; what patches cost all vertices alike shows in the mean.
    let (rms, mean) = bounced_error(10.0);
    assert!(rms < 0.02 && mean.abs() < 0.01, "{rms} {mean}");
    // Four times fewer rays in the lobe.
    let (rms, mean) = bounced_error(HIGHEST_EXPONENT);
    assert!(rms < 0.04 && mean.abs() < 0.015, "{rms} {mean}");
}

/// The same of light straight through the window, relative to its root mean square.
fn direct_error(exponent: f32) -> f64 {
    let room = room(&format!("box-room:edge=0.4,gloss=0.4,exponent={exponent}"), &options(4096, 0));
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
    rms(off) / rms(size)
}

#[test]
fn direct_gloss_matches_brute_force() {
    // The window is some thousands of the oracle's rays, of which those along its edge are a matter of chance; and it cuts
    // texels anywhere: half a percent each. A sharper lobe weighs fewer texels and rays.
    for (exponent, tolerance) in [(10.0, 0.015), (HIGHEST_EXPONENT, 0.03)] {
        let off = direct_error(exponent);
        assert!(off < tolerance, "{exponent}: {off}");
    }
}

/// The object alone in a picture of the room, its albedo black, lit straight and by one bounce: relit, path-traced, and
/// the standard error of the latter, summed over its pixels. One bounce, since then walls send on their direct light
/// alone, which is exact, and no other approximation is judged.
fn sums(room: &Room, light: &Light, samples: u32) -> [[f64; 3]; 3] {
    let camera = Camera::new(EYE, vec3(0.6, 0.5, -0.4), 32.0);
    let size = (32, 24);
    let albedo = room.scene.vertex_albedo();
    let lobes = room.scene.vertex_lobes(HIGHEST_EXPONENT);
    let (specular, exponent): (Vec<Vec3>, Vec<f32>) = lobes.iter().map(|l| (l.specular, l.exponent)).unzip();
    let panes: Vec<[Vec3; 3]> = room.portals.iter().flat_map(|p| p.triangles.clone()).collect();
    let tracer =
        Tracer::new(room.surface(&albedo)).expect("a tracer").with_portals(&panes).expect("a window");
    let tracer = tracer.with_gloss(Gloss { specular: &specular, exponent: &exponent }).expect("a lobe");
    let options = ReferenceOptions { samples, bounces: 1, seed: 1 };
    let truth = reference_image(&tracer, light, &camera, size, &options, |_| ()).expect("paths");

    let frame = room.lit(light);
    let mut irradiance = vec![[0.0; 3]; albedo.len()];
    frame.direct(0, &mut irradiance);
    let mut glossy = room.glossy();
    glossy.project(&frame, &irradiance);
    let (mut radiance, mut mark) = (vec![Vec3::ZERO; albedo.len()], vec![Vec3::ZERO; albedo.len()]);
    for (&v, s) in glossy.vertices().iter().zip(sent(&glossy)) {
        (radiance[v as usize], mark[v as usize]) = (Vec3::from(s), Vec3::ONE);
    }
    let seen = trace(&tracer, &camera, size.0, size.1).expect("a picture");
    let shade = |radiance: &[Vec3]| {
        seen.shade(&room.surface(&albedo), radiance, |_| Vec3::ZERO).expect("a picture").pixels
    };
    let is_object: Vec<bool> = shade(&mark).iter().map(|m| m.x > 0.999).collect();
    assert!(is_object.iter().filter(|is| **is).count() > 60, "the object is in the picture");
    let sum = |pixels: &[Vec3], power: i32| {
        let inside = || pixels.iter().zip(&is_object).filter(|(_, is)| **is);
        [0, 1, 2].map(|c| inside().map(|(p, _)| f64::from(p[c]).powi(power)).sum::<f64>())
    };
    [sum(&shade(&radiance), 1), sum(&truth.image.pixels, 1), sum(&truth.error.pixels, 2).map(f64::sqrt)]
}

#[test]
fn picture_of_a_glossy_object_has_no_bias_against_the_reference() {
    let dull = |scene: &mut Scene| {
        let glossy = scene.materials.iter_mut().filter(|m| m.specular != Vec3::ZERO);
        glossy.for_each(|m| m.albedo = Vec3::ZERO);
    };
    let room = changed_room("box-room:edge=0.15,gloss=0.4,exponent=10", &options(512, 1), dull);
    let [found, truth, noise] = sums(&room, &light("uniform"), 512);
    for c in 0..3 {
        let (off, noise) = (found[c] / truth[c] - 1.0, noise[c] / truth[c]);
        // Four standard errors, and 3 % for radiance interpolated over facets of 0.04 m on ears of 0.1 m.
        assert!(noise < 0.008 && off.abs() < 4.0 * noise + 0.03, "{off} ± {noise}");
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
    blacken_outside(&mut coated, &portals[0]);
    let portal_options = PortalOptions::default();
    let (coated, _) =
        bake_portals(&coated, &portals, &options(64, 2), &portal_options, &Silent).expect("a bake");
    for tensor in ["portal.0.indirect.sh", "portal.0.direct.value"] {
        let (a, b) = (glossy.asset.tensor(tensor).expect("baked"), coated.tensor(tensor).expect("baked"));
        assert!(a == b, "{tensor}");
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

/// A floor of albedo 0.1 and a lobe.
fn polish(scene: &mut Scene) {
    let floor = scene.materials.iter_mut().find(|m| m.name == "floor").expect("a floor");
    (floor.albedo, floor.specular, floor.exponent) = (Vec3::splat(0.1), Vec3::splat(0.7), 10.0);
}

/// The same in even light, sent on evenly.
fn coat(scene: &mut Scene) {
    polish(scene);
    let floor = scene.materials.iter_mut().find(|m| m.name == "floor").expect("a floor");
    floor.albedo += floor.specular * mean_reflectance(floor.exponent);
    (floor.specular, floor.exponent) = (Vec3::ZERO, 0.0);
}

/// What a sun on the floor sends on to walls and ceiling, against paths that know the floor's lobe: found 0.047 by lobes, of
/// patches that are not points, and 0.88 evenly.
#[test]
fn sun_on_a_polished_floor_lights_the_room_along_its_mirrored_way() {
    let spec = "box-room:window-width=3,window-height=2,edge=0.2";
    let with = |change: fn(&mut Scene)| {
        let options = Options { basis: vec![Basis::DirectToIndirect], ..options(1024, 1) };
        changed_room(spec, &options, change)
    };
    let polished = with(polish);
    let mesh = &polished.scene.mesh;
    let inner = inside(&polished.scene, &polished.portals).expect("Embree");
    let flat = in_flat_faces(mesh);
    let above = |v: &usize| inner[*v] && flat[*v] && mesh.position[*v].y > 0.3 && mesh.normal[*v].y < 0.1;
    let all: Vec<usize> = (0..mesh.position.len()).filter(above).collect();
    let at: Vec<usize> = spread(all.len(), 300).map(|i| all[i]).collect();
    let sun = light("cap:-1,0.7,0.2,0.1,100");
    let albedo = polished.scene.vertex_albedo();
    let lobes = polished.scene.vertex_lobes(HIGHEST_EXPONENT);
    let (specular, exponent): (Vec<Vec3>, Vec<f32>) = lobes.iter().map(|l| (l.specular, l.exponent)).unzip();
    let panes: Vec<[Vec3; 3]> = polished.portals.iter().flat_map(|p| p.triangles.clone()).collect();
    let tracer = Tracer::new(polished.surface(&albedo)).and_then(|t| t.with_portals(&panes));
    let tracer = tracer.and_then(|t| t.with_gloss(Gloss { specular: &specular, exponent: &exponent }));
    let pick = |of: &[Vec3]| at.iter().map(|&v| of[v]).collect::<Vec<_>>();
    let (points, normals) = (pick(&mesh.position), pick(&mesh.normal));
    let options = ReferenceOptions { samples: 4096, bounces: 1, seed: 9 };
    let truth = reference_irradiance(&tracer.expect("a tracer"), &sun, &points, &normals, &options, |_| {})
        .expect("paths");
    let off = |room: &Room| {
        let mut frame = room.lit(&sun);
        let shell = frame.captured(0).to_vec();
        let discs: Vec<_> = sun.discs().collect();
        let n = frame.resolution(0);
        frame.set_shell_with_discs(0, Shell::new(n, &shell).expect("a shell"), &discs).expect("its side");
        frame.set_indirect(Indirect::DirectToIndirect).expect("baked");
        let mut direct = vec![[0.0; 3]; mesh.position.len()];
        frame.direct(0, &mut direct);
        frame.reflect(&direct);
        let mut bounced = vec![[0.0; 3]; direct.len()];
        frame.add_indirect(0, &mut bounced);
        let found: Vec<Vec3> = at.iter().map(|&v| bounced[v].into()).collect();
        difference(&found, &truth.indirect, None).expect("numbers").relative
    };
    let (by_lobes, evenly) = (off(&polished), off(&with(coat)));
    let noise = noise(&truth.indirect_error, &truth.indirect, None).expect("numbers");
    println!("by lobes {by_lobes:.3}, evenly {evenly:.3}, noise {noise:.3}");
    assert!(noise < 0.02 && by_lobes < 0.07 && evenly > 8.0 * by_lobes, "{by_lobes} {evenly} {noise}");
}

/// The highlight of a sun on a polished floor, at points of triangles that see all of it and whose corners do: by the lobe
/// itself, which interpolation between corners half a metre apart is no match for.
#[test]
fn highlights_of_suns_are_the_lobe_itself_between_vertices() {
    let options = Options { basis: vec![Basis::Haar], ..options(256, 0) };
    let polished = changed_room("box-room:window-width=3,window-height=2,edge=0.4", &options, polish);
    let (mesh, asset) = (&polished.scene.mesh, &polished.asset);
    let sun = light("cap:-1,0.7,0.2,0.05,100");
    let mut frame = polished.lit(&sun);
    let discs: Vec<_> = sun.discs().collect();
    let (n, shell) = (frame.resolution(0), frame.captured(0).to_vec());
    frame.set_shell_with_discs(0, Shell::new(n, &shell).expect("a shell"), &discs).expect("its side");
    let mut direct = vec![[0.0; 3]; mesh.position.len()];
    frame.direct(0, &mut direct);
    let mut glossy = Glossy::open(asset).expect("good tensors").expect("a floor");
    glossy.project(&frame, &vec![[0.0; 3]; direct.len()]);
    let mut lobes = vec![[0.0; 3]; glossy.vertices().len()];
    glossy.radiance(EYE.to_array(), 0, &mut lobes);
    let mut seen = vec![Vec3::ZERO; direct.len()];
    glossy.vertices().iter().zip(&lobes).for_each(|(&v, s)| seen[v as usize] = Vec3::from(*s));
    let axis = vec3(-1.0, 0.7, 0.2).normalize();
    let whole = 100.0 * PI * 0.05f32.sin().powi(2) * axis.y;
    let mut detail = Detail::new(&frame);
    let (mut expected, mut found, mut plain) = (Vec::new(), Vec::new(), Vec::new());
    let all = polished.scene.vertex_lobes(HIGHEST_EXPONENT);
    for corners in &mesh.index {
        let at = corners.map(|v| v as usize);
        let sees_all = |v: &usize| (direct[*v][1] - whole).abs() < 0.005 * whole;
        if !at.iter().all(|v| all[*v].specular != Vec3::ZERO && sees_all(v)) {
            continue;
        }
        for weights in [[1.0 / 3.0; 3], [0.6, 0.3, 0.1], [0.1, 0.2, 0.7]] {
            let mean = |of: &dyn Fn(usize) -> Vec3| -> Vec3 {
                at.iter().zip(weights).map(|(v, w)| w * of(*v)).sum()
            };
            let point = Point { corners: *corners, weights, radius: 0.0 };
            let e = mean(&|v| direct[v].into()) + Vec3::from(detail.at(&point));
            assert!((e.y - whole).abs() < 0.01 * whole, "a lit point among lit corners: {e} of {whole}");
            let d = (mean(&|v| mesh.position[v]) - EYE).normalize();
            let (specular, exponent) = (all[at[0]].specular, all[at[0]].exponent);
            let cosine = d.reflect(Vec3::Y).dot(axis).max(0.0);
            expected.push(whole * (exponent + 2.0) / (2.0 * PI) * cosine.powf(exponent) * specular);
            plain.push(mean(&|v| seen[v]));
            found.push(Vec3::from(glossy.radiance_at(EYE.to_array(), &point, &mut detail)));
        }
    }
    let [off, plain] = [&found, &plain].map(|l| difference(l, &expected, None).expect("numbers").relative);
    println!("{} points: {off:.4} by lobes, {plain:.4} interpolated", expected.len());
    // The disc is taken for its axis, and seen whole within half a per cent.
    assert!(expected.len() > 30 && off < 0.01 && plain > 4.0 * off, "{} {off} {plain}", expected.len());
}
