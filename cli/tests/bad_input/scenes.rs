//! Scenes that cannot be loaded.

use crate::{Folder, TRIANGLE};

fn bake_fails(name: &str, content: impl AsRef<[u8]>, needles: &[&str]) {
    let folder = Folder::new();
    folder.write(name, content);
    folder.fails_naming(&["bake", name, "-o", "out.safetensors"], &[&[name], needles].concat());
    folder.fails_naming(&["render", name, "--light", "uniform", "-o", "out.png"], &[name]);
}

/// Bytes of no format, the same every time.
fn garbage(length: usize) -> Vec<u8> {
    (0..length as u32).map(|i| (i.wrapping_mul(2654435761) >> 13) as u8).collect()
}

const KINDS: [&str; 7] = ["s.obj", "s.ply", "s.asc", "s.dem", "s.hgt", "s.png", "s.tif"];

#[test]
fn missing_scene_is_named() {
    for name in KINDS {
        Folder::new().fails_naming(&["bake", name, "-o", "out.safetensors"], &[name]);
    }
    Folder::new().fails_naming(&["bake", "cortyard"], &["cortyard", "courtyard"]);
    Folder::new().fails_naming(&["bake", "courtyard:colums=3"], &["colums"]);
    Folder::new().fails_naming(&["scene", "plane:n=-1", "-o", "out.obj"], &["n"]);
}

#[test]
fn empty_scene_is_named() {
    for name in KINDS {
        bake_fails(name, "", &["empty"]);
    }
}

#[test]
fn garbage_is_named() {
    for name in KINDS {
        bake_fails(name, garbage(4099), &[]);
    }
}

#[test]
fn folder_instead_of_a_scene_is_named() {
    let folder = Folder::new();
    for name in KINDS {
        std::fs::create_dir(folder.path(name)).expect("a folder");
        folder.fails_naming(&["bake", name, "-o", "out.safetensors"], &[name]);
    }
}

#[test]
fn vertices_that_are_no_numbers_are_named() {
    for bad in ["nan", "inf", "-inf", "1e99", "abc"] {
        bake_fails("s.obj", TRIANGLE.replace("v 1 0 0", &format!("v 1 {bad} 0")), &["2"]);
    }
    let ply = |x: f32| {
        let header = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
            property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
        let values = [x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let mut bytes = header.as_bytes().to_vec();
        values.iter().for_each(|v: &f32| bytes.extend(v.to_le_bytes()));
        bytes.push(3);
        [0, 2, 1].iter().for_each(|i: &i32| bytes.extend(i.to_le_bytes()));
        bytes
    };
    bake_fails("s.ply", ply(f32::NAN), &[]);
    let whole = ply(0.0);
    bake_fails("s.ply", &whole[..whole.len() - 1], &[]);
    bake_fails("s.ply", &whole[..whole.len() - 30], &[]);
}

#[test]
fn index_out_of_range_is_named_with_its_line() {
    for face in ["f 1 3 9", "f 1 3 -9", "f 1 3 0", "f 1 3 99999999999999"] {
        bake_fails("s.obj", TRIANGLE.replace("f 1 3 2", face), &["4"]);
    }
}

#[test]
fn mesh_without_a_triangle_is_named() {
    bake_fails("s.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\n", &["triangle"]);
    bake_fails("s.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", &["triangle"]);
}

#[test]
fn terrain_of_voids_is_named() {
    let header = "ncols 3\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 10\nNODATA_value -9999\n";
    bake_fails("s.asc", format!("{header}{}", "-9999 -9999 -9999\n".repeat(2)), &["void"]);
    bake_fails("s.asc", format!("{header}1 2 3\n4 5"), &[]);
    bake_fails("s.asc", format!("{header}1 2 3\n4 5 six\n"), &["six"]);
    bake_fails("s.asc", header.replace("ncols 3", "ncols 4000000000"), &[]);
}

#[test]
fn mended_scene_is_baked_and_reported() {
    let folder = Folder::new();
    folder.write("s.obj", format!("{TRIANGLE}v 7 7 7\nf 1 1 2\nf 1 3 2\n"));
    let output = folder.run(&["bake", "s.obj", "-o", "out.safetensors", "--rays", "16"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && folder.path("out.safetensors").is_file(), "{said}");
    assert!(said.contains("1 unused vert") && said.contains("s.obj"), "{said}");
}
