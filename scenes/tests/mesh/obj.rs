//! Quirks of `.obj` files, one small file each.

use glam::Vec3;
use lunette_scenes::{LoadOptions, Scene, Up};

use crate::{area, assert_valid, error_of, load_files};

fn obj(text: &str) -> Scene {
    let scene =
        load_files(&[("a.obj", text.as_bytes())], &LoadOptions::default()).expect("the file can be mended");
    assert_valid(&scene);
    scene
}

fn reports(scene: &Scene, line: &str) -> bool {
    scene.report.iter().any(|l| l == line)
}

/// Corners of the unit square in the xz plane, counter-clockwise from above.
const SQUARE: &str = "v 0 0 0\nv 0 0 1\nv 1 0 1\nv 1 0 0\n";

#[test]
fn negative_and_mixed_indices_mean_the_same_square() {
    for face in ["f 1 2 3 4", "f -4 -3 -2 -1", "f 1 -3 3 -1", "f 1// 2/ -2// 4", "fo 1 2 3 4"] {
        let scene = obj(&format!("{SQUARE}{face}\n"));
        assert_eq!(scene.mesh.index, [[0, 1, 2], [0, 2, 3]], "{face}");
        assert_eq!(scene.mesh.position, [Vec3::ZERO, Vec3::Z, Vec3::new(1.0, 0.0, 1.0), Vec3::X]);
        assert_eq!(scene.mesh.normal, [Vec3::Y; 4]);
    }
}

#[test]
fn texture_indices_are_ignored_even_when_wrong() {
    let scene = obj(&format!("{SQUARE}vt nonsense\nf 1/7 2/-9 3/9999999999 4/x\n"));
    assert_eq!(scene.mesh.index.len(), 2);
}

#[test]
fn concave_polygon_has_its_own_area() {
    // An L of three unit squares; a fan from the first corner would cover four and a half.
    let ell = "v 1 0 1\nv 1 0 2\nv 0 0 2\nv 0 0 0\nv 2 0 0\nv 2 0 1\nf 5 4 3 2 1 6\n";
    // Sums of a few f32 products of size 1.
    let scene = obj(ell);
    assert!((area(&scene) - 3.0).abs() < 1e-5, "{}", area(&scene));
    assert!(scene.mesh.normal.iter().all(|n| n.y.abs() > 0.999));
}

#[test]
fn line_ends_tabs_marks_and_comments_do_not_matter() {
    let plain = obj(&format!("{SQUARE}g floor\nusemtl oak\nf 1 2 3 4\n"));
    let odd = [
        format!("\u{feff}{SQUARE}g floor\nusemtl oak\nf 1 2 3 4 # last"),
        format!("{SQUARE}g floor\nusemtl oak\nf 1 2 \\\n 3 4\n").replace('\n', "\r\n"),
        format!("{SQUARE}g floor\nusemtl oak\nf 1 2 3 4").replace('\n', "\r"),
        format!("{SQUARE}\tg\tfloor \n \tusemtl\toak\t\n\tf\t1  2\t3 4").replace("v ", "\t v\t "),
        format!("{SQUARE}\0\ng floor\nusemtl oak # a wood\n\nf 1 2 3 4\n\0\0"),
        format!("{SQUARE}vp 1 2\ncstype bezier\ns 1\nnonsense 1 2\ng floor\nusemtl oak\nf 1 2 3 4\nend\n"),
    ];
    for text in odd {
        let scene = obj(&text);
        assert_eq!(scene.mesh.position, plain.mesh.position, "{text:?}");
        assert_eq!(scene.mesh.index, plain.mesh.index);
        assert_eq!(scene.materials, plain.materials);
        assert_eq!(scene.groups, ["floor"]);
    }
}

#[test]
fn weights_and_colours_after_a_vertex_are_ignored() {
    let scene = obj("v 0 0 0 2\nv 0 0 1 1 0 0\nv 1 0 0 1 0 0 1\nf 1 2 3\n");
    assert_eq!(scene.mesh.position, [Vec3::ZERO, Vec3::Z, Vec3::X]);
}

#[test]
fn winding_follows_the_normals() {
    let scene = obj(&format!("{SQUARE}vn 0 -1 0\nf 1//1 2//1 3//1 4//1\n"));
    assert_eq!(scene.mesh.index, [[0, 2, 1], [0, 3, 2]]);
    assert_eq!(scene.mesh.normal, [Vec3::NEG_Y; 4]);
    assert!(reports(&scene, "2 triangles wound against the normals turned over"), "{:?}", scene.report);
}

#[test]
fn unusable_normals_are_built_from_the_faces() {
    for normal in ["0 0 0", "nan nan nan", "-1.#IND 0 1", "1", "inf 0 0", "1e400 0 0"] {
        let scene = obj(&format!("{SQUARE}vn {normal}\nvn 0 1 0\nf 1//1 2//2 3//2\n"));
        assert_eq!(scene.mesh.normal, [Vec3::Y; 3], "{normal}");
        let line = "1 corner normal missing, zero or not a number built from the faces";
        assert!(reports(&scene, line), "{:?}", scene.report);
    }
}

#[test]
fn normal_of_any_length_is_made_unit() {
    for normal in ["0 3 0", "0 1e-30 0", "0 1e30 0"] {
        let scene = obj(&format!("{SQUARE}vn {normal}\nf 1//1 2//1 3//1\n"));
        assert_eq!(scene.mesh.normal, [Vec3::Y; 3]);
        assert!(reports(&scene, "3 corner normals of another length made unit"), "{:?}", scene.report);
    }
}

#[test]
fn normal_behind_its_face_is_rebuilt() {
    let scene = obj(&format!("{SQUARE}vn 0 1 0\nvn 1 -0.5 0\nf 1//1 2//1 3//2\n"));
    assert_eq!(scene.mesh.normal, [Vec3::Y; 3]);
    assert!(
        reports(&scene, "1 corner normal pointing behind the face built from the faces"),
        "{:?}",
        scene.report
    );
}

#[test]
fn faces_with_and_without_normals_mix() {
    let scene = obj(&format!("{SQUARE}vn 0 0.8 0.6\nf 1//1 2//1 3//1\nf 1 3 4\nf 1//1 3 4//1\n"));
    // The last has a corner without a normal, and lies in the place of the one before.
    assert_eq!(scene.mesh.index.len(), 2);
    let tilted = Vec3::new(0.0, 0.8, 0.6);
    assert_eq!(scene.mesh.index[0].map(|v| scene.mesh.normal[v as usize]), [tilted; 3]);
    assert_eq!(scene.mesh.index[1].map(|v| scene.mesh.normal[v as usize]), [Vec3::Y; 3]);
}

#[test]
fn vertices_keep_their_order_and_splits_come_last() {
    // Two walls of a box that share an edge, the second named first.
    let text = "v 0 0 0\nv 9 9 9\nv 0 1 0\nv 1 0 0\nv 0 0 1\nf 1 4 3\nf 1 3 5\n";
    let scene = obj(text);
    let p = &scene.mesh.position;
    assert_eq!(p[..4], [Vec3::ZERO, Vec3::Y, Vec3::X, Vec3::Z]);
    assert_eq!(p[4..], [Vec3::ZERO, Vec3::Y]);
    assert_eq!(scene.mesh.index, [[0, 2, 1], [4, 5, 3]]);
    assert_eq!(scene.mesh.normal[4], Vec3::X);
    assert!(reports(&scene, "1 unused vertex left out"));
}

#[test]
fn duplicate_vertices_are_joined_and_smoothed_over() {
    // Two triangles of a nearly flat roof, each with vertices of its own.
    let text = "v 0 0 0\nv 0 0 1\nv 1 0.1 0\nv 0 0 1\nv -0 0 0\nv -1 0.1 0\nf 1 2 3\nf 4 5 6\n";
    let scene = obj(text);
    assert_eq!(scene.mesh.index, [[0, 1, 2], [1, 0, 3]]);
    assert_eq!(scene.mesh.normal[0], Vec3::Y);
    assert!(reports(&scene, "2 duplicate vertices joined"), "{:?}", scene.report);
}

#[test]
fn material_edges_split_vertices_but_not_normals() {
    let scene = obj(&format!("{SQUARE}usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n"));
    assert_eq!(scene.mesh.position.len(), 6);
    assert_eq!(scene.mesh.material, [0, 1]);
    assert_eq!(scene.mesh.normal, [Vec3::Y; 6]);
    assert!(reports(&scene, "2 materials not in any material library made grey (Kd 0.5): a, b"));
}

#[test]
fn groups_and_objects_name_what_follows() {
    let text =
        format!("{SQUARE}f 1 2 3\no empty\no the house\ng\tleft wall  # one\nf 1 3 4\ng default\nf 2 3 4\n");
    let scene = obj(&text);
    assert_eq!(scene.groups, ["left wall", "default"]);
    assert_eq!(scene.mesh.group, [1, 0, 1]);
}

#[test]
fn degenerate_and_coincident_triangles_are_counted() {
    let text = format!("{SQUARE}v 2 0 2\nf 1 2 3\nf 1 2 2\nf 1 3 5\nf 2 3 1\nf 3 2 1\n");
    let scene = obj(&text);
    assert_eq!(scene.mesh.index.len(), 1);
    assert!(reports(&scene, "2 zero-area triangles left out"), "{:?}", scene.report);
    assert!(reports(&scene, "1 triangle in the place of another left out"));
    assert!(reports(&scene, "1 triangle in the place of another that faces the other way left out"));
    assert!(reports(&scene, "2 unused vertices left out"));
}

#[test]
fn lines_and_points_are_counted() {
    let scene = obj(&format!("{SQUARE}l 1 2 3\np 1\nf 1 2\nf 1\ncurv 0 1 1 2\nf 1 2 3\n"));
    assert_eq!(scene.mesh.index.len(), 1);
    assert!(reports(&scene, "4 line or point elements left out: only faces are lit"), "{:?}", scene.report);
    assert!(reports(&scene, "1 free-form curve or surface left out: only faces are read"));
}

#[test]
fn z_up_and_scale_turn_and_grow_the_scene() {
    let options = LoadOptions { up: Up::Z, scale: 0.5, ..LoadOptions::default() };
    let text = "v 0 0 0\nv 2 0 0\nv 0 4 0\nvn 0 0 1\nf 1//1 2//1 3//1\n";
    let scene = load_files(&[("a.obj", text.as_bytes())], &options).unwrap();
    assert_valid(&scene);
    assert_eq!(scene.mesh.position, [Vec3::ZERO, Vec3::X, Vec3::new(0.0, 0.0, -2.0)]);
    assert_eq!(scene.mesh.normal, [Vec3::Y; 3]);
}

#[test]
fn errors_say_where_and_what() {
    let cases = [
        ("v 0 0 0\nv 1 0\n", "a.obj:2: a vertex needs three coordinates, this one has 2"),
        ("v 0 0 0\nv 0,5 1 2\n", "a.obj:2: '0,5' is not a number"),
        ("\nv 0 nan 0\n", "a.obj:2: the coordinate 'nan' is not finite"),
        ("v 0 \\\n1e400 0\n", "a.obj:1: the coordinate '1e400' is not finite"),
        ("v 0 0 -inf\n", "a.obj:1: the coordinate '-inf' is not finite"),
        ("v 1 2 3\nf 1 1 2\n", "a.obj:2: the face names vertex 2, and there are 1 before it"),
        ("v 1 2 3\nf 1 1 -2\n", "a.obj:2: the face names vertex -2, and there are 1 before it"),
        ("v 1 2 3\nf 1 0 1\n", "a.obj:2: the face names vertex 0, and there are 1 before it"),
        ("v 1 2 3\nf 1//1 1 1\n", "a.obj:2: the face names normal 1, and there are 0 before it"),
        ("v 1 2 3\nf 1 1 99999999999999999999\n", "not a corner of a face (vertex/texture/normal)"),
        ("v 1 2 3\nf 1 1 1.5\n", "'1.5' is not a corner of a face (vertex/texture/normal)"),
        ("", "a.obj: the file is empty"),
        ("v 1 2 3\n", "a.obj: no triangle: the file has 1 vertex and no face; is it a Wavefront .obj mesh?"),
        ("\u{1}\u{2}binary", "a.obj: no triangle: the file has 0 vertices and no face"),
        ("v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n", "a.obj: no triangle in it has an area"),
        ("v 0 0 0\nv 1 1 1\nv 2 2e20 2\nf 1 2 3\n", "a.obj: vertex 3 lies 2e20 m from the origin"),
    ];
    for (text, expected) in cases {
        let loaded = load_files(&[("a.obj", text.as_bytes())], &LoadOptions::default());
        let error = loaded.unwrap_err().to_string();
        assert!(error.contains(expected) && !error.contains('\n'), "{text:?}: {error}");
    }
}

#[test]
fn utf16_is_named_as_such() {
    let bytes: Vec<u8> = "\u{feff}v 0 0 0".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let error = error_of(load_files(&[("a.obj", &bytes)], &LoadOptions::default()));
    assert_eq!(error, "a.obj: the text is UTF-16; save it as UTF-8 or ASCII");
}

#[test]
fn scene_that_is_neither_file_nor_name_says_both() {
    let options = LoadOptions::default();
    let error = lunette_scenes::load("sphere-on-plain", &options).unwrap_err().to_string();
    assert!(
        error.starts_with("sphere-on-plain: no such file, and no built-in scene of that name"),
        "{error}"
    );
    assert!(error.contains("sphere-on-plane"), "the nearest name is offered: {error}");
    let error = lunette_scenes::load("missing.OBJ", &options).unwrap_err().to_string();
    assert!(error.starts_with("missing.OBJ: No such file"), "{error}");
    let error = error_of(load_files(&[("a.stl", b"solid")], &options));
    assert!(error.contains("a.stl: not a kind of file that can be read"), "{error}");
}

#[test]
fn absurd_options_are_refused() {
    let base = LoadOptions::default();
    let cases = [
        (LoadOptions { scale: 0.0, ..base.clone() }, "scale: has to be a positive number, not 0"),
        (LoadOptions { scale: f32::NAN, ..base.clone() }, "scale: has to be a positive number, not NaN"),
        (
            LoadOptions { vertical_scale: -1.0, ..base.clone() },
            "vertical scale: has to be a positive number, not -1",
        ),
        (LoadOptions { crease_angle: 4.0, ..base }, "crease angle: has to be from 0 to pi radians, not 4"),
    ];
    for (options, expected) in cases {
        assert_eq!(lunette_scenes::load("a.obj", &options).unwrap_err().to_string(), expected);
    }
}
