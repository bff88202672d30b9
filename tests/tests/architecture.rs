//! What ARCHITECTURE.md promises.

use std::path::Path;
use std::process::Command;

use glam::{Quat, Vec3};
use lunette_bake::Options;
use lunette_relight::aperture::Intersection;
use lunette_relight::cubemap::{n_texels, project_light};
use lunette_relight::frame::{Frame, Method};
use lunette_relight::indirect::Indirect;
use lunette_relight::light::Cap;
use lunette_relight::lobe::{self, Blockers, Lamp, Motion, Points, Scratch, Sphere, SphereSet, Sun, Target};
use lunette_relight::portal_frame::PortalFrame;
use lunette_relight::shell::Shell;
use lunette_tests::baked::{baked, light, scene};
use lunette_tests::interior::{bounced_options, built};

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("a workspace around the package")
}

/// Names of all crates that a package needs at run time, itself included, with all of its features.
fn dependencies(package: &str) -> Vec<String> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--all-features", "--edges", "normal", "--prefix", "none", "-p", package])
        .current_dir(workspace())
        .output()
        .expect("cargo");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    text.lines().filter_map(|line| line.split(' ').next()).map(str::to_string).collect()
}

#[test]
fn run_time_needs_no_ray_tracer_and_no_image_codec() {
    let names = dependencies("lunette-relight");
    assert!(names.iter().any(|n| n == "safetensors"), "cargo tree said nothing: {names:?}");
    for banned in ["lunette-", "libloading", "image", "exr", "png", "tiff", "tobj", "clap", "memmap2"] {
        let found: Vec<&String> =
            names.iter().filter(|n| n.starts_with(banned) && *n != "lunette-relight").collect();
        assert!(found.is_empty(), "the run time depends on {found:?}");
    }
}

#[test]
fn judge_shares_no_crate_with_the_baker_but_embree_and_the_run_time() {
    assert!(!dependencies("lunette-render").iter().any(|n| n == "lunette-bake"));
    assert!(!dependencies("lunette-bake").iter().any(|n| n == "lunette-render"));
    assert!(!dependencies("lunette-scenes").iter().any(|n| n == "lunette-ffi"));
}

#[test]
fn relighting_a_frame_does_not_allocate() {
    let asset = baked(&scene("plane:n=8"), &Options { rays: 64, bounces: 1, ..Options::default() });
    let methods = [
        Method::Bent,
        Method::Aperture(Intersection::Exact),
        Method::Aperture(Intersection::Smoothstep),
        Method::default(),
    ];
    let sky = light("sky:140,35 + uniform:0.1 + cie-overcast + cap:1,1,0,0.2,3");
    let frames: Vec<_> =
        (0..4).map(|i| sky.rotated(Quat::from_axis_angle(Vec3::Y, 0.3 * i as f32))).collect();
    let mut out = vec![[0.0; 3]; asset.n_vertices()];
    for method in methods {
        let mut frame = Frame::new(&asset, method).expect("what the method needs");
        let counted = allocation_counter::measure(|| {
            for light in &frames {
                frame.project(light);
                frame.direct(0, &mut out);
                frame.add_indirect(0, &mut out);
            }
        });
        assert_eq!(counted.count_total, 0, "{method:?}");
        assert!(out.iter().all(|e| e[0] > 0.0), "{method:?} gave no light");
    }
}

#[test]
fn relighting_an_interior_does_not_allocate() {
    relights_without_allocation("box-room:edge=0.6");
    relights_without_allocation("box-room:edge=0.6,gloss=0.4,exponent=10");
}

fn relights_without_allocation(spec: &str) {
    let asset = built(spec).bake(&bounced_options());
    let mut frame = PortalFrame::new(&asset).expect("a portal");
    let n = frame.resolution(0);
    // Suns that wander across texels and faces, of which the first makes room.
    let lights: Vec<_> = (0..8)
        .map(|i| light(&format!("uniform + cap:-1,0.5,{},0.03,9000", 0.2 * i as f32 - 0.7)))
        .map(|light| {
            let mut texels = vec![[0.0; 3]; n_texels(n)];
            project_light(&light, n, &mut texels);
            (texels, light.discs().collect::<Vec<_>>())
        })
        .collect();
    let mut out = vec![[0.0; 3]; asset.n_vertices()];
    for way in [Indirect::Sh, Indirect::DirectToIndirect] {
        frame.set_indirect(way).expect("what is baked");
        let mut relight = |(texels, discs): &(Vec<[f32; 3]>, Vec<_>)| {
            let shell = Shell::new(n, texels).expect("a shell");
            frame.set_shell_with_discs(0, shell, discs).expect("its side");
            frame.direct(0, &mut out);
            frame.reflect(&out);
            frame.add_indirect(0, &mut out);
        };
        lights.iter().for_each(&mut relight);
        let counted = allocation_counter::measure(|| lights.iter().for_each(&mut relight));
        assert_eq!(counted.count_total, 0, "{spec}, {way:?}");
    }
    assert!(out.iter().any(|e| e[0] > 10.0), "no sun");
}

#[test]
fn moving_lamps_and_blockers_do_not_allocate() {
    let sphere = |k: usize| Sphere { centre: Vec3::new(0.1 * k as f32, 1.0, 0.0), radius: 0.2 };
    let set = SphereSet::new((0..20).map(sphere).collect()).expect("spheres");
    let position: Vec<[f32; 3]> =
        (0..900).map(|k| [(k % 30) as f32 * 0.1, 0.0, (k / 30) as f32 * 0.1 - 1.5]).collect();
    let normal = vec![[0.0, 1.0, 0.0]; position.len()];
    let (mut light, mut part) = (vec![[0.0; 3]; position.len()], vec![0.0; position.len()]);
    let (mut scratch, mut blockers) = (Scratch::default(), Blockers::default());
    let options = lobe::Options::default();
    let disc = Cap { axis: Vec3::Y, radius: 0.1, radiance: Vec3::ONE };
    let around = Sphere { centre: Vec3::ZERO, radius: 5.0 };
    let mut frame = |i: usize| {
        let motion = Motion { translation: Vec3::X * 0.1 * i as f32, ..Motion::default() };
        blockers.clear();
        blockers.push(&set, &motion);
        let lamp = Lamp { centre: Vec3::new(i as f32, 3.0, 0.0), radius: 0.4, radiance: Vec3::ONE };
        let points = Points { position: &position, normal: &normal };
        let scene = lobe::Scene { lamps: &[lamp], blockers: &blockers };
        let mut target = Target { light: &mut light, products: None };
        lobe::add_irradiance(&points, &scene, &options, &mut scratch, &mut target);
        let sun = Sun::new(&disc, around, &mut scratch).expect("a sun");
        sun.visible_part(&position, &blockers, &options, &mut scratch, &mut part);
    };
    // The first frame makes room for the blockers.
    frame(0);
    let counted = allocation_counter::measure(|| (1..4).for_each(&mut frame));
    assert_eq!(counted.count_total, 0);
    assert!(part.contains(&1.0) && part.iter().any(|p| *p < 0.5), "the sun has a shadow");
    assert!(light.iter().all(|e| e[0] >= 0.0) && light.iter().any(|e| e[0] > 0.0));
}

#[test]
fn unsafe_code_is_denied_by_the_workspace_and_allowed_with_a_reason() {
    let manifest = std::fs::read_to_string(workspace().join("Cargo.toml")).expect("the manifest");
    assert!(manifest.contains("unsafe_code = \"deny\""));
    let mut allowed = 0;
    for file in sources(workspace()) {
        let text = std::fs::read_to_string(&file).expect("a source file");
        for line in
            text.lines().map(str::trim).filter(|l| l.starts_with("#") && l.contains("allow(unsafe_code"))
        {
            assert!(line.contains("reason = "), "{}: {line}", file.display());
            allowed += 1;
        }
    }
    assert!(allowed > 0, "ffi at least must call C");
}

/// All Rust files of the workspace's packages.
fn sources(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        if path.is_dir() && name != "target" && !name.to_string_lossy().starts_with('.') {
            files.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            files.push(path);
        }
    }
    files
}
