//! A scene written and read back is the same scene.

use std::path::Path;

use glam::Vec3;
use lunette_scenes::{Error, LoadOptions, Material, Scene, load, subdivide, write_obj};

use crate::{assert_valid, load_files};

fn write_and_read(scene: &Scene) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("with blanks.obj");
    write_obj(scene, &path).unwrap();
    let mut names: Vec<_> =
        folder.path().read_dir().unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["with blanks.mtl", "with blanks.obj"], "nothing else is left behind");
    load(path.to_str().unwrap(), &LoadOptions::default()).unwrap()
}

fn assert_same(a: &Scene, b: &Scene) {
    assert_eq!(a.mesh.position, b.mesh.position);
    assert_eq!(a.mesh.normal, b.mesh.normal);
    assert_eq!(a.mesh.index, b.mesh.index);
    assert_eq!(a.mesh.material, b.mesh.material);
    assert_eq!(a.mesh.group, b.mesh.group);
    assert_eq!(a.groups, b.groups);
    assert_eq!(a.materials, b.materials);
}

/// Two roofs with creases, materials and groups that mix.
fn scene() -> Scene {
    let obj = "mtllib a.mtl\nv 0 0 0\nv 0 0 1\nv 1 .7 0\nv 1 .7 1\nv -1 .1 0\nv -1 .1 1\no a house\nusemtl tile # old\n\
               f 1 2 4 3\nusemtl glass\nf 1 5 2\ng 2\nf 5 6 2\nusemtl tile\ng a house\nf 6 5 1\n";
    let mtl = "newmtl unused\nKd 0 0 0\nnewmtl tile\nKd 0.1 0.123456789 1\nKs 0.3 0 0\nNs 12.5\nKe 0 1e-20 7\n\
               newmtl glass\nKd 0.1 0.1 0.1\nTf 0.7 0.8 0.9\nillum 4\n";
    let scene = load_files(&[("a.obj", obj.as_bytes()), ("a.mtl", mtl.as_bytes())], &LoadOptions::default());
    scene.expect("the files are right")
}

#[test]
fn loaded_scene_comes_back_bit_by_bit() {
    let mut scene = scene();
    assert_same(&write_and_read(&scene), &scene);
    subdivide(&mut scene, 0.21).unwrap();
    let back = write_and_read(&scene);
    assert_valid(&back);
    assert_same(&back, &scene);
}

#[test]
fn awkward_names_get_through_or_get_a_number() {
    let mut scene = scene();
    scene.groups = vec!["wall #3".into(), "wall #3".into()];
    let name = |name: &str| Material { name: name.into(), ..Material::default() };
    scene.materials = vec![name(""), name("two\nlines \\"), name("two lines")];
    let back = write_and_read(&scene);
    assert_eq!(back.groups, ["wall #3", "wall #3 2"]);
    let names: Vec<_> = back.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["material", "two lines", "two lines 2"]);
    assert_eq!(back.mesh.material, scene.mesh.material);
}

#[test]
fn missing_folder_is_an_error_that_names_the_file() {
    let path = Path::new("no/such/folder/a.obj");
    let error = write_obj(&scene(), path).unwrap_err();
    assert!(matches!(error, Error::Io { .. }));
    assert!(error.to_string().starts_with("no/such/folder/a.mtl: No such file"), "{error}");
}

#[test]
fn albedo_of_vertices_is_that_of_their_material() {
    let scene = scene();
    let tile = scene.materials.iter().position(|m| m.name == "tile").unwrap();
    let albedo = scene.vertex_albedo();
    for (t, &m) in scene.mesh.index.iter().zip(&scene.mesh.material) {
        let expected = if m as usize == tile { Vec3::new(0.1, 0.123_456_79, 1.0) } else { Vec3::splat(0.1) };
        assert!(t.iter().all(|&v| albedo[v as usize] == expected));
    }
}
