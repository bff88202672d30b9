//! Quirks of `.ply` files.

use glam::Vec3;
use lunette_scenes::{LoadOptions, Scene};

use crate::{area, assert_valid, error_of, load_files};

fn ply(bytes: &[u8]) -> Scene {
    let scene = load_files(&[("a.ply", bytes)], &LoadOptions::default()).expect("the file can be mended");
    assert_valid(&scene);
    scene
}

fn ply_error(bytes: &[u8]) -> String {
    error_of(load_files(&[("a.ply", bytes)], &LoadOptions::default()))
}

/// The head of a file of n vertices with float coordinates and m faces.
fn head(format: &str, n: usize, m: usize) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment caf\u{e9}\nelement vertex {n}\nproperty float x\nproperty float y\n\
         property float z\nelement face {m}\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, 0.0]];

#[test]
fn three_encodings_give_the_same_square() {
    let ascii = ply((head("ascii", 4, 1) + "0 0 0\n0 0 1\n\n1 0 1\n1 0 0\n4 0 1 2 3\n").as_bytes());
    let mut little = head("binary_little_endian", 4, 1).into_bytes();
    little.extend(SQUARE.iter().flatten().flat_map(|x| x.to_le_bytes()));
    little.push(4);
    little.extend((0..4).flat_map(i32::to_le_bytes));
    let mut big = head("binary_big_endian", 4, 1).replace('\n', "\r\n").into_bytes();
    big.extend(SQUARE.iter().flatten().flat_map(|x| x.to_be_bytes()));
    big.push(4);
    big.extend((0..4).flat_map(i32::to_be_bytes));
    for scene in [ply(&little), ply(&big), ascii] {
        assert_eq!(scene.mesh.position, SQUARE.map(Vec3::from));
        assert_eq!(scene.mesh.index, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(scene.mesh.normal, [Vec3::Y; 4]);
    }
}

#[test]
fn properties_of_other_types_names_and_order_are_taken() {
    let text = "ply\nformat ascii 1.0\nobj_info scanned\nelement scanner 2\nproperty list int float rays\n\
                element face 1\nproperty uchar flags\nproperty list uint16 uint8 vertex_index\n\
                element vertex 3\nproperty double confidence\nproperty int z\nproperty double y\nproperty short x\n\
                end_header\n2 0.5 0.5\n0\n7 3 0 1 2\n1 0 0 0\n1 1 0 0\n1 0 0 1\n";
    assert_eq!(ply(text.as_bytes()).mesh.position, [Vec3::ZERO, Vec3::Z, Vec3::X]);
}

#[test]
fn normals_are_made_unit_and_turn_faces() {
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                property float nx\nproperty float ny\nproperty float nz\nelement face 1\n\
                property list uchar int vertex_indices\nend_header\n\
                0 0 0 0 -5 0\n0 0 1 0 -5 0\n1 0 0 0 -5 0\n3 0 1 2\n";
    let scene = ply(text.as_bytes());
    assert_eq!(scene.mesh.normal, [Vec3::NEG_Y; 3]);
    assert_eq!(scene.mesh.index, [[0, 2, 1]]);
}

#[test]
fn vertex_colours_become_their_linear_mean() {
    let with = |kind: &str, colours: [&str; 3]| {
        let [a, b, c] = colours;
        let text = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             property {kind} red\nproperty {kind} green\nproperty {kind} blue\nelement face 1\n\
             property list uchar int vertex_indices\nend_header\n0 0 0 {a}\n0 0 1 {b}\n1 0 0 {c}\n3 0 1 2\n"
        );
        ply(text.as_bytes()).materials[0].albedo
    };
    // sRGB 188 is 0.5029 in linear light (IEC 61966-2-1), given here to four digits.
    let albedo = with("uchar", ["255 0 188", "255 0 188", "255 0 188"]);
    assert!((albedo - Vec3::new(1.0, 0.0, 0.5029)).abs().max_element() < 1e-4, "{albedo}");
    let albedo = with("float", ["1.0 0 0.25", "0 0 0.25", "2.0 0 0.25"]);
    // One rounding of a third.
    assert!((albedo - Vec3::new(2.0 / 3.0, 0.0, 0.25)).abs().max_element() < 1e-6, "{albedo}");
}

#[test]
fn strips_alternate_and_restart() {
    let text = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
                element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
                0 0 0\n0 0 1\n1 0 0\n1 0 1\n2 0 0\n2 0 1\n9 0 1 2 3 -1 2 3 4 5\n";
    let scene = ply(text.as_bytes());
    assert_eq!(scene.mesh.index.len(), 4);
    assert_eq!(scene.mesh.normal, [Vec3::Y; 6], "every other triangle is turned");
    assert_eq!(area(&scene), 2.0);
}

#[test]
fn concave_polygon_has_its_own_area() {
    let arrow = head("ascii", 4, 1) + "0 0 0\n2 0 1\n1 0 0\n2 0 -1\n4 0 1 2 3\n";
    // A few f32 products of size 1.
    assert!((area(&ply(arrow.as_bytes())) - 1.0).abs() < 1e-6);
}

#[test]
fn errors_say_where_and_what() {
    let binary = |n, m, bytes: &[u8]| [head("binary_little_endian", n, m).as_bytes(), bytes].concat();
    let nan = [0.0, f32::NAN, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let cases: [(Vec<u8>, &str); 12] = [
        (b"solid cube".to_vec(), "a.ply: not a PLY file (it does not begin with 'ply')"),
        (b"ply\nformat ascii 1.0\n".to_vec(), "a.ply: the header has no end (end_header); cut short?"),
        (
            b"ply\nformat ascii 1.0\ncomment\nelement vertx -3\nend_header\n".to_vec(),
            "a.ply:4: 'element vertx -3' is not understood in a PLY header",
        ),
        (b"ply\nend_header\n".to_vec(), "a.ply: the PLY header has no valid format line"),
        (
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float u\nend_header\n1\n".to_vec(),
            "a.ply: its vertices have no x, y and z",
        ),
        (
            (head("ascii", 1, 0) + "1 2 3\n").into(),
            "a.ply: no triangle: the file has 1 vertex and no face; is it a cloud",
        ),
        (
            (head("ascii", 2, 0) + "1 2 3\n").into(),
            "a.ply: the file ends after 1 of 2 vertices; it is cut short",
        ),
        (
            (head("ascii", 2, 0) + "1 2 3\n1 nan 3\n").into(),
            "a.ply:12: not the vertex that the header describes",
        ),
        (
            (head("ascii", 2, 0) + "1 2 3\n1 1e999 3\n").into(),
            "a.ply:12: a coordinate of the vertex is not finite",
        ),
        (binary(1, 0, &nan), "a.ply: vertex 0: a coordinate of the vertex is not finite"),
        (
            binary(4_000_000_000, 0, &[0; 64]),
            "a.ply: 4000000000 vertices do not fit in the file; it is cut short",
        ),
        (
            (head("ascii", 3, 1) + "0 0 0\n0 0 1\n1 0 0\n3 0 1 3\n").into(),
            "a.ply: face 0 names vertex 3, and there are 3, counted from 0",
        ),
    ];
    for (bytes, expected) in cases {
        let error = ply_error(&bytes);
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn lying_list_length_ends_with_the_file() {
    let mut bytes = head("binary_little_endian", 3, 1).replace("list uchar", "list uint").into_bytes();
    bytes.extend(
        [[0.0_f32, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
            .iter()
            .flatten()
            .flat_map(|x| x.to_le_bytes()),
    );
    bytes.extend(u32::MAX.to_le_bytes());
    bytes.extend([0; 100]);
    assert_eq!(ply_error(&bytes), "a.ply: the file ends after 0 of 1 face; it is cut short");
}
