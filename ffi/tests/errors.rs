//! Bad input and a missing library: values, and one line each.

use std::process::Command;

use lunette_ffi::{Device, Error, MAX_COORDINATE, SceneBuilder};

const POSITIONS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// Set in the child process of the test on missing libraries.
const CHILD: &str = "LUNETTE_FFI_TEST_CHILD";

fn builder() -> SceneBuilder {
    SceneBuilder::new(&Device::new().expect("Embree")).expect("scene")
}

#[test]
fn mesh_without_triangles_is_an_error() {
    assert_eq!(builder().add_triangles(&POSITIONS, &[]), Err(Error::NoTriangles));
    assert_eq!(builder().add_triangles(&[], &[]), Err(Error::NoTriangles));
}

#[test]
fn index_out_of_range_is_an_error_that_says_where() {
    let indices = [[0, 1, 2], [0, 3, 1]];
    let error = Error::IndexOutOfRange { triangle: 1, index: 3, n_vertices: 3 };
    assert_eq!(builder().add_triangles(&POSITIONS, &indices), Err(error));
    let error = Error::IndexOutOfRange { triangle: 0, index: u32::MAX, n_vertices: 0 };
    assert_eq!(builder().add_triangles(&[], &[[u32::MAX; 3]]), Err(error));
}

#[test]
fn position_that_is_not_usable_is_an_error_that_says_where() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -2.0 * MAX_COORDINATE] {
        let mut positions = POSITIONS;
        positions[2][1] = bad;
        let result = builder().add_triangles(&positions, &[[0, 1, 2]]);
        assert!(matches!(result, Err(Error::BadPosition { vertex: 2, .. })), "{bad}: {result:?}");
    }
}

#[test]
fn builder_works_on_after_an_error() {
    let mut builder = builder();
    builder.add_triangles(&POSITIONS, &[[0, 1, 9]]).expect_err("index out of range");
    assert_eq!(builder.add_triangles(&POSITIONS, &[[0, 1, 2], [1, 1, 1]]), Ok(0));
    let scene = builder.commit().expect("commit");
    assert!(scene.occluded(&lunette_ffi::Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0])));
}

#[test]
fn device_names_its_library_and_version() {
    let device = Device::new().expect("Embree");
    assert_eq!(device.version().0, 4);
    assert!(device.library().to_string_lossy().contains("embree4"), "{device:?}");
}

#[test]
fn bad_library_is_one_line_with_the_remedy() {
    if std::env::var_os(CHILD).is_some() {
        let error = Device::new().expect_err("there is no library in that place");
        println!("error: {error}");
        return;
    }
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src");
    for (path, reason) in [
        ("/nowhere/libembree4.so.4", "no Embree library"),
        (folder, "no Embree library"),
        (manifest, "cannot load"),
    ] {
        let line = error_of_child(path);
        assert!(line.contains(path) && line.contains(reason), "{line}");
        assert!(line.contains("run ./setup.sh, or set LUNETTE_EMBREE="), "{line}");
    }
}

/// What a process with `LUNETTE_EMBREE` set to `path` prints: this very test, run again.
fn error_of_child(path: &str) -> String {
    let output = Command::new(std::env::current_exe().expect("this test's file"))
        .args(["--exact", "bad_library_is_one_line_with_the_remedy", "--nocapture"])
        .env(CHILD, "1")
        .env("LUNETTE_EMBREE", path)
        .output()
        .expect("child process");
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8_lossy(&output.stdout);
    // The test runner's own line stands before it; a second line of the message would be
    // the runner's "ok" no more.
    let (_, message) = text.split_once("error: ").expect("an error line");
    let mut lines = message.lines();
    let line = lines.next().expect("a line").to_owned();
    let rest = lines.next().unwrap_or_default();
    assert!(rest.trim().is_empty() || rest.starts_with("test ") || rest.starts_with("ok"), "{text}");
    line
}
