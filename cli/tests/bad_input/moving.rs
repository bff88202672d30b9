//! Lamps and blockers that make no sense.

use crate::{FAILED, Folder, TRIANGLE};

fn baked() -> Folder {
    let folder = Folder::new();
    folder.bake("a.safetensors");
    folder
}

fn relight_fails(folder: &Folder, extra: &[&str], needles: &[&str]) {
    let command = ["relight", "a.safetensors", "--light", "uniform", "--size", "32x32", "-o", "out.png"];
    folder.fails_naming(&[&command, extra].concat(), needles);
}

#[test]
fn lamp_that_does_not_parse_is_pointed_at() {
    let folder = baked();
    for (lamp, column) in [
        ("", 1),
        ("1,2,3", 1),
        ("0,2,x,0.1,1", 5),
        ("0,2,0,0,1", 7),
        ("0,2,0,-1,1", 7),
        ("0,2,0,nan,1", 7),
        ("0,2,0,inf,1", 7),
        ("0,2,0,0.1,-1", 11),
        ("0,2,0,0.1,1,2", 1),
        ("0,2,0:1,2,0", 1),
        ("0,2,0:1,y,0,0.1,1", 9),
    ] {
        relight_fails(&folder, &["--lamp", lamp], &["--lamp", &format!("column {column}:")]);
    }
}

#[test]
fn blocker_that_does_not_parse_is_pointed_at() {
    let folder = baked();
    for (blocker, column) in [
        ("", 1),
        ("@0,0,0", 1),
        ("rabbit@", 8),
        ("rabbit@0,1", 8),
        ("rabbit@0,y,0", 10),
        ("rabbit@0,1,0,0,0", 16),
        ("rabbit@0,1,0,0,-2", 16),
        ("rabbit@0,1,0,0,nan", 16),
        ("rabbit@0,1,0:1,1", 14),
        ("rabbit@0,1,0:1,1,1,0,2", 14),
    ] {
        relight_fails(&folder, &["--blocker", blocker], &["--blocker", &format!("column {column}:")]);
    }
}

#[test]
fn blocker_that_cannot_be_read_is_named() {
    let folder = baked();
    folder.write("empty.obj", "");
    folder.write("points.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\n");
    folder.write("garbage.ply", [7u8; 999]);
    for (scene, needle) in [
        ("missing.obj", "missing.obj"),
        ("empty.obj", "empty.obj"),
        ("points.obj", "points.obj"),
        ("garbage.ply", "garbage.ply"),
        ("rabit", "rabbit"),
        ("rabbit:hight=2", "hight"),
    ] {
        relight_fails(&folder, &["--blocker", &format!("{scene}@0,1,0")], &["--blocker", needle]);
    }
}

#[test]
fn blocker_without_volume_is_named() {
    let folder = baked();
    folder.write("flat.obj", TRIANGLE);
    for name in ["flat.obj", "plane:n=4"] {
        relight_fails(&folder, &["--blocker", name], &[name, "no volume"]);
    }
}

#[test]
fn blocker_or_lamp_that_swallows_the_camera_is_named() {
    let folder = baked();
    let camera = ["--camera", "0,1,3;0,0,0;40"];
    for extra in [["--blocker", "rabbit@0,0.7,3"], ["--lamp", "0,1,3,0.2,1"]] {
        relight_fails(&folder, &[&camera[..], &extra].concat(), &[extra[0], "camera"]);
    }
    // On its way, in a frame in the middle.
    let way = ["--blocker", "rabbit@-5,0.7,3:5,0.7,3", "--frames", "5", "-o", "out.%d.png"];
    let command = ["relight", "a.safetensors", "--light", "uniform", "--size", "32x32"];
    folder.fails_naming(&[&command[..], &camera, &way].concat(), &["rabbit", "frame 2"]);
}

#[test]
fn blocker_that_swallows_the_scene_is_named() {
    let folder = baked();
    let extra = ["--blocker", "rabbit@0,-30,0,0,100", "--camera", "0,300,0;0,0,0;40"];
    relight_fails(&folder, &extra, &["rabbit", "whole scene"]);
}

#[test]
fn options_of_moving_things_are_named_when_they_are_absurd() {
    let folder = baked();
    let lamp = ["--lamp", "0,2,0,0.1,1"];
    for (option, absurd) in [
        ("--spheres", &["0", "-1", "5000", "99999999999", "x"][..]),
        ("--mask-depth", &["0", "6", "-1", "x"]),
        ("--threshold", &["-1", "nan", "inf", "x"]),
        ("--mask", &["", "dark"]),
    ] {
        for value in absurd {
            let extra = [&lamp[..], &["--blocker", "rabbit@0,1,0", option, value]].concat();
            relight_fails(&folder, &extra, &[option.trim_start_matches('-')]);
        }
    }
    let moving = ["--lamp", "0,2,0:1,2,0,0.1,1"];
    for frames in ["0", "100001", "-1"] {
        relight_fails(&folder, &[&moving[..], &["--frames", frames]].concat(), &["--frames"]);
    }
    // Frames without a number in the name, and pictures that cannot be.
    relight_fails(&folder, &moving, &["out.png", "%02d"]);
    relight_fails(&folder, &["--products", "p.png"], &["--products", "--lamp"]);
    relight_fails(&folder, &[&lamp[..], &["--products", "p.exr"]].concat(), &["--products", ".png"]);
    relight_fails(&folder, &[&lamp[..], &["--products", "nowhere/p.png"]].concat(), &["nowhere"]);
    let table = ["relight", "a.safetensors", "--light", "uniform", "-o", "out.ply", "--products", "p.png"];
    folder.refused(FAILED, &[&table[..], &lamp].concat());
}

#[test]
fn more_spheres_than_memory_allows_are_refused() {
    let folder = baked();
    let blockers: Vec<&str> = (0..257).flat_map(|_| ["--blocker", "rabbit@0,1,0"]).collect();
    relight_fails(&folder, &[&blockers[..], &["--spheres", "4096"]].concat(), &["--blocker", "--spheres"]);
    let lamps: Vec<&str> = (0..1001).flat_map(|_| ["--lamp", "0,2,0,0.1,1"]).collect();
    relight_fails(&folder, &lamps, &["--lamp", "1001"]);
}

#[test]
fn moving_lamp_and_blocker_make_a_picture_per_frame() {
    let folder = baked();
    let output = folder.run(&[
        "relight",
        "a.safetensors",
        "--light",
        "uniform + cap:0,1,0,0.1,5",
        "--lamp",
        "0,2,0:1,2,1,0.1,1,0.5,0.2",
        "--blocker",
        "rabbit:n=17@0.2,0.2,0.2,0,0.4:0.6,0.2,0.2,90",
        "--spheres",
        "8",
        "--frames",
        "3",
        "--size",
        "32x32",
        "-o",
        "out.%d.png",
        "--products",
        "p.%d.png",
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.lines().count() == 3 && said.contains("1 lamp and 1 blocker"), "{said}");
    let bytes = |name: &str| std::fs::read(folder.path(name)).expect("a picture");
    assert_ne!(bytes("out.0.png"), bytes("out.2.png"));
    assert!(folder.path("p.2.png").is_file());
}
