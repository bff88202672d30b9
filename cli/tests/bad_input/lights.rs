//! Lights that cannot be had.

use glam::Vec3;
use lunette_render::{Image, write_exr};

use crate::Folder;

fn baked() -> Folder {
    let folder = Folder::new();
    folder.bake("a.safetensors");
    folder
}

fn relight_fails(folder: &Folder, spec: &str, needles: &[&str]) {
    folder.fails_naming(&["relight", "a.safetensors", "--light", spec, "-o", "out.png"], needles);
}

#[test]
fn light_that_does_not_parse_is_pointed_at() {
    let folder = baked();
    for (spec, column) in [
        ("", 1),
        ("unifrom", 1),
        ("uniform:x", 9),
        ("uniform:1,2", 1),
        ("uniform:nan", 9),
        ("uniform:-1", 9),
        ("uniform + ", 11),
        ("uniform + cap:0,1,0,0.1", 11),
        ("cap:0,0,0,0.1,1", 5),
        ("cap:0,1,0,-0.1,1", 11),
        ("cap:0,1,0,9,1", 11),
        ("sky:10", 1),
        ("sky:10,500", 8),
        ("sky:10,30,99", 11),
        ("cie-overcast:1e30", 14),
    ] {
        relight_fails(&folder, spec, &[&format!("column {column}:")]);
    }
}

#[test]
fn picture_of_the_sky_that_cannot_be_read_is_named() {
    let folder = baked();
    folder.write("empty.hdr", "");
    folder.write("garbage.hdr", [7u8; 999]);
    folder.write("zero.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 0 +X 0\n");
    folder.write("cut.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n\x02\x02");
    folder.write("huge.hdr", "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2000000000 +X 2000000000\n");
    folder.write("empty.exr", "");
    folder.write("garbage.exr", [7u8; 999]);
    for name in [
        "empty.hdr",
        "garbage.hdr",
        "zero.hdr",
        "cut.hdr",
        "huge.hdr",
        "empty.exr",
        "garbage.exr",
        "missing.exr",
    ] {
        relight_fails(&folder, name, &[name]);
        relight_fails(&folder, &format!("uniform + {name}"), &[name, "column 11:"]);
    }
}

#[test]
fn picture_of_the_sky_without_numbers_is_refused() {
    let folder = baked();
    for bad in [f32::NAN, f32::INFINITY] {
        let mut image = Image { width: 8, height: 4, pixels: vec![Vec3::ONE; 32] };
        image.pixels[9].y = bad;
        write_exr(&folder.path("bad.exr"), &image).expect("a picture");
        relight_fails(&folder, "bad.exr", &["bad.exr"]);
    }
}

#[test]
fn negative_samples_are_mended_and_counted() {
    let folder = baked();
    let mut image = Image { width: 8, height: 4, pixels: vec![Vec3::ONE; 32] };
    image.pixels[9].y = -0.5;
    write_exr(&folder.path("dip.exr"), &image).expect("a picture");
    let output = folder.run(&["relight", "a.safetensors", "--light", "dip.exr", "-o", "out.ply"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && said.contains("1 negative sample"), "{said}");
}
