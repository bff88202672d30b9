//! Quirks of `.mtl` files.

use glam::Vec3;
use lunette_scenes::{LoadOptions, Material, Scene};

use crate::{assert_valid, load_files};

/// Loads one triangle of material `m` with this library.
fn with_library(mtllib: &str, file: &str, mtl: &[u8]) -> Scene {
    let obj = format!("mtllib {mtllib}\nv 0 0 0\nv 0 0 1\nv 1 0 0\nusemtl m\nf 1 2 3\n");
    let scene = load_files(&[("a.obj", obj.as_bytes()), (file, mtl)], &LoadOptions::default()).unwrap();
    assert_valid(&scene);
    scene
}

fn material(mtl: &str) -> (Material, Vec<String>) {
    let scene = with_library("a.mtl", "a.mtl", mtl.as_bytes());
    (scene.materials[scene.mesh.material[0] as usize].clone(), scene.report)
}

fn reports(report: &[String], line: &str) -> bool {
    report.iter().any(|l| l.contains(line))
}

#[test]
fn tabs_comments_and_foreign_keywords_are_read_over() {
    let mtl = "\u{feff}# made by hand\r\n\tnewmtl m\r\n\tNs 10.0 # shiny\r\n\tillum 2\r\n\tKa 1 1\r\n\tKd 0.63 0.065 \\\r\n\
               0.05 # Red\r\n\tKs .1 .2 .3\r\n\tKe 17 12 4\r\n\tPr 0.5\r\n\tmap_bump -bm 1\r\n\tsharpness\r\n\tbump\r\n";
    let (material, _) = material(mtl);
    assert_eq!(material.albedo, Vec3::new(0.63, 0.065, 0.05));
    assert_eq!(material.specular, Vec3::new(0.1, 0.2, 0.3));
    assert_eq!(material.emission, Vec3::new(17.0, 12.0, 4.0));
    assert_eq!(material.exponent, 10.0);
    assert_eq!(material.transmission, Vec3::ZERO);
}

#[test]
fn unreadable_values_are_left_out_and_told() {
    let (material, report) =
        material("newmtl m\nKd 0.25\nKs xyz 1 1 1\nNs many\nKe 1 2\nillum 999\nd -halo 0.75\nKd\n");
    assert_eq!(material.albedo, Vec3::splat(0.25), "a single number stands for all channels");
    assert_eq!(material.specular, Vec3::ZERO);
    assert_eq!(material.transmission, Vec3::splat(0.25));
    assert!(
        reports(&report, "4 values not understood in") && reports(&report, "the first in line 3"),
        "{report:?}"
    );
}

#[test]
fn values_out_of_range_are_cut() {
    let (material, report) = material("newmtl m\nKd 2 0 1\nKs -1 0 0\nKe -3 1 0\nNs -5\n");
    assert_eq!(material.albedo, Vec3::new(1.0, 0.0, 1.0));
    assert_eq!([material.specular, material.emission], [Vec3::ZERO, Vec3::Y]);
    assert_eq!(material.exponent, 0.0);
    assert!(reports(&report, "1 material with a value outside of 0 to 1 cut to that range: m"), "{report:?}");
    assert!(reports(&report, "1 material with Kd 1, where light fades only by leaving the scene: m"));
}

#[test]
fn transmission_follows_the_way_of_the_exporter() {
    let coloured = Vec3::new(0.1, 0.6, 0.2);
    let cases = [
        ("d 1\nTr 0\nTf 0.1 0.6 0.2\nillum 4", coloured),
        ("d 0.1\nTr 0.9\nTf 0.1 0.1 0.1\nillum 2", Vec3::splat(0.9)),
        ("d 1\nTr 0\nTf 1 1 1\nillum 2", Vec3::ZERO),
        ("d 0.5\nTf 0.1 0.6 0.2\nillum 2", 0.5 * coloured),
        ("d 0.1\nillum 4", Vec3::splat(0.9)),
        ("Tr 0.25", Vec3::splat(0.25)),
        ("Tr 1", Vec3::ZERO),
        ("d 7", Vec3::ZERO),
    ];
    for (lines, expected) in cases {
        let (material, _) = material(&format!("newmtl m\nKd 1 1 1\n{lines}\n"));
        // One rounding of 1 - d.
        assert!(
            (material.transmission - expected).abs().max_element() < 1e-7,
            "{lines}: {}",
            material.transmission
        );
    }
}

#[test]
fn diffuse_illumination_has_no_highlight() {
    assert_eq!(material("newmtl m\nKs 1 1 1\nillum 1\n").0.specular, Vec3::ZERO);
    assert_eq!(material("newmtl m\nKs 1 1 1\nillum 2\n").0.specular, Vec3::ONE);
}

#[test]
fn textures_and_missing_colours_are_told() {
    let (material, report) = material("newmtl m\nmap_Kd -s 1 1 1 wood.png\n");
    assert_eq!(material.albedo, Vec3::splat(0.5));
    assert!(
        reports(&report, "1 material with a texture, which is not read (Kd stands for it): m"),
        "{report:?}"
    );
    assert!(reports(&report, "1 material without Kd made grey (Kd 0.5): m"));
}

#[test]
fn library_is_found_beside_the_mesh() {
    let kd = b"newmtl m\nKd 0.2 0.2 0.2\n";
    for (mtllib, file) in [
        ("scenes/a.mtl", "a.mtl"),
        ("C:\\models\\a.mtl", "a.mtl"),
        ("my colours.mtl", "my colours.mtl"),
        ("\"a.mtl\"", "a.mtl"),
        ("missing.mtl a.mtl", "a.mtl"),
    ] {
        let scene = with_library(mtllib, file, kd);
        assert_eq!(scene.materials[0].albedo, Vec3::splat(0.2), "{mtllib}");
    }
}

#[test]
fn missing_library_makes_grey_and_tells() {
    let scene = with_library("b.mtl", "a.mtl", b"");
    assert_eq!(scene.materials, [Material { name: "m".into(), ..Material::default() }]);
    assert!(reports(&scene.report, "material library 'b.mtl' not found: its materials are grey (Kd 0.5)"));
}

#[test]
fn last_of_doubled_materials_counts() {
    let (material, report) =
        material("newmtl m\nKd 0 0 0\nnewmtl m\nKd 1 0 0\nnewmtl other name\nKd 0 0 0\n");
    assert_eq!(material.albedo, Vec3::X);
    assert!(reports(&report, "1 material defined more than once, the last one taken: m"), "{report:?}");
}
