//! Portals that are none, or cannot be found.

use crate::{FAILED, Folder, TRIANGLE};

const ROOM: &str = "box-room:edge=0.8";
const SQUARE: &str = "[[0,1,-0.5],[0,1,0.5],[0,2,0.5],[0,2,-0.5]]";

/// A portal file around polygons.
fn file(polygons: &str) -> String {
    format!(
        "{{\"format\": \"lunette-portals\", \"version\": 1,\n\"portals\": [\n{{\"name\": \"west\", \"polygons\": [{polygons}]}}]}}"
    )
}

/// Runs a command that fails after it has loaded its scene, quietly: one line, and no file.
fn fails_late(folder: &Folder, arguments: &[&str], needles: &[&str]) {
    let before = folder.files();
    let output = folder.run(&[arguments, &["--quiet"]].concat());
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(FAILED), "{arguments:?}: {error}");
    assert!(output.stdout.is_empty() && error.lines().count() == 1, "{arguments:?}: {error}");
    assert!(error.starts_with("lunette: ") && !error.contains("panicked"), "{error}");
    needles.iter().for_each(|needle| assert!(error.contains(needle), "'{needle}' is not in: {error}"));
    assert_eq!(folder.files(), before, "{arguments:?} left files");
}

fn bake_fails(folder: &Folder, options: &[&str], needles: &[&str]) {
    let bake = ["bake", ROOM, "--rays", "16", "-o", "out.safetensors"];
    fails_late(folder, &[&bake, options].concat(), needles);
}

#[test]
fn scenes_without_openings_are_named() {
    let folder = Folder::new();
    folder.write("triangle.obj", TRIANGLE);
    for (scene, needle) in [
        ("plane:n=8", "nothing is inside"),
        ("triangle.obj", "nothing is inside"),
        ("sphere-on-plane:edge=0.5", "no interior"),
    ] {
        fails_late(&folder, &["portals", scene, "--cells", "5000"], &[scene, needle]);
    }
    folder.fails_naming(&["portals", "missing.obj"], &["missing.obj"]);
    folder.write("empty.obj", "");
    folder.fails_naming(&["portals", "empty.obj"], &["empty.obj", "empty"]);
}

#[test]
fn options_of_the_search_that_are_absurd_are_named() {
    let folder = Folder::new();
    for (option, values) in [
        ("--cells", &["0", "999", "20000001", "-1", "x", ""][..]),
        ("--smallest-area", &["-1", "nan", "inf", "x"]),
        ("--widest-bar", &["-1", "nan", "inf", "x"]),
        ("--size", &["0x0", "1x10", "10", "99999x2"]),
        ("--group", &["", "all"]),
        ("--seed", &["-1", "x"]),
        ("--threads", &["-1", "x"]),
    ] {
        for value in values {
            folder.fails_naming(&["portals", ROOM, option, value], &[option.trim_start_matches('-')]);
        }
    }
}

#[test]
fn places_that_cannot_be_written_to_are_named() {
    let folder = Folder::new();
    folder.fails_naming(&["portals", ROOM, "-o", "nowhere/a.json"], &["nowhere"]);
    folder.fails_naming(&["portals", ROOM, "-o", "a.png"], &["a.png", ".json"]);
    std::fs::create_dir(folder.path("there.json")).expect("a folder");
    folder.fails_naming(&["portals", ROOM, "-o", "there.json"], &["there.json"]);
    folder.write("box-room.portals.json", "{}");
    folder.fails_naming(&["portals", ROOM], &["box-room.portals.json", "--force"]);
}

#[test]
fn picture_that_cannot_be_written_leaves_no_portal_file() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("a.portals.png")).expect("a folder");
    folder.fails_naming(&["portals", ROOM, "-o", "a.json"], &["a.portals.png"]);
}

#[test]
fn name_that_matches_no_glass_lists_what_there_is() {
    let folder = Folder::new();
    bake_fails(&folder, &["--portal", "Glass*"], &["'Glass*'", "glass", "window"]);
    bake_fails(&folder, &["--portal", "a["], &["a["]);
    bake_fails(&folder, &["--portal", ""], &["''", "glass"]);
    bake_fails(&folder, &["--portal", "*"], &["'*'", "none is left"]);
}

#[test]
fn portal_of_a_mesh_without_area_is_named() {
    let folder = Folder::new();
    folder.write("a.mtl", "newmtl wall\nKd 0.5 0.5 0.5\nnewmtl glass\nd 0.1\n");
    let thin = "v 1 1 1\nv 2 1 1\nv 3 1 1\nv 0 3 0\nv 1 3 0\nusemtl glass\nf 4 5 6\n";
    folder.write("a.obj", format!("mtllib a.mtl\nusemtl wall\n{TRIANGLE}{thin}"));
    // What has no area is gone once the mesh is mended, and with it the material's last triangle.
    let bake = ["bake", "a.obj", "--rays", "16", "-o", "out.safetensors", "--portal", "glass"];
    fails_late(&folder, &bake, &["'glass'", "matches nothing"]);
}

#[test]
fn portal_file_that_is_none_is_named_with_the_place() {
    let folder = Folder::new();
    let cases = [
        (String::new(), "p.json", "empty"),
        ("{\n\"format\" 1}".into(), "p.json:2:10", "expected"),
        (file(SQUARE).replace("west\"", "west"), "p.json:3:", "expected"),
        (file("[[0,1,NaN],[0,1,1],[0,2,1]]"), "p.json:3:", "expected value"),
        (file("[[0,1,1e99],[0,1,1],[0,2,1]]"), "'west', polygon 1", "inf"),
        (file("[[0,1,1e999],[0,1,1],[0,2,1]]"), "p.json:3:", "out of range"),
        (file("[[0,1],[0,1,1],[0,2,1]]"), "p.json:3:", "invalid length 2"),
        (file(SQUARE).replace("polygons", "polygon"), "p.json:3:", "polygon"),
        (file(""), "'west'", "has no polygon"),
        (file("[[0,1,0],[0,2,0]]"), "'west', polygon 1", "2 corner"),
        (file("[[0,1,0],[0,2,0],[0,3,0]]"), "'west', polygon 1", "no area"),
        (file(&format!("{SQUARE},[[0,1,0],[0,1,1],[1,2,1],[0,2,0]]")), "'west', polygon 2", "not flat"),
        (file(SQUARE).replace("west", " "), "portal 1", "no name"),
        ("{\"format\": \"lunette-portals\", \"version\": 1, \"portals\": []}".into(), "p.json", "no portal"),
        ("{\"format\": \"other\", \"version\": 1, \"portals\": []}".into(), "p.json", "format"),
    ];
    for (text, place, what) in cases {
        folder.write("p.json", &text);
        bake_fails(&folder, &["--portals", "p.json"], &["p.json", place, what]);
        // The same beside the scene, where nobody named it.
        folder.write("box-room.portals.json", &text);
        bake_fails(&folder, &[], &["box-room.portals.json", what]);
        std::fs::remove_file(folder.path("box-room.portals.json")).expect("the file");
    }
    bake_fails(&folder, &["--portals", "missing.json"], &["missing.json"]);
}

#[test]
fn portal_that_no_vertex_sees_is_named() {
    let folder = Folder::new();
    folder.write("p.json", file("[[2.1,1,-0.5],[2.1,1,0.5],[2.1,2,0.5],[2.1,2,-0.5]]"));
    // Within the east wall, between its inner and its outer face.
    bake_fails(&folder, &["--portals", "p.json"], &["'west'", "seen from no vertex"]);
}

#[test]
fn nearest_exterior_that_is_absurd_is_named() {
    let folder = Folder::new();
    for distance in ["0", "-1", "nan", "inf"] {
        bake_fails(&folder, &["--portal", "glass", "--nearest-exterior", distance], &["nearest-exterior"]);
    }
    bake_fails(&folder, &["--portal", "glass", "--nearest-exterior", "0.1"], &["'glass'", "256 portals"]);
}

#[test]
fn ways_of_bounced_light_that_are_absurd_or_of_none_are_named() {
    let folder = Folder::new();
    let carried = ["--portal", "glass", "--basis", "direct-to-indirect"];
    for (option, value, range) in
        [("--links", "0", "1..=4096"), ("--links", "5000", "1..=4096"), ("--patches", "40000", "16..=32767")]
    {
        bake_fails(&folder, &[&carried[..], &[option, value]].concat(), &[option, value, range]);
    }
    let compare = ["compare", ROOM, "--portal", "glass", "--bounces", "0", "--light", "uniform", "-o", "out"];
    for method in ["portal-d2i", "portal-sh4"] {
        fails_late(
            &folder,
            &[&compare[..], &["--methods", method]].concat(),
            &["--methods", method, "--bounces 0", "give portal"],
        );
    }
}

#[test]
fn step_past_all_triangles_inside_is_named() {
    let folder = Folder::new();
    let compare =
        ["compare", ROOM, "--portal", "glass", "--bounces", "0", "--methods", "portal", "--light", "uniform"];
    fails_late(
        &folder,
        &[&compare[..], &["--every", "1000000", "-o", "out"]].concat(),
        &["--every", "1000000", "less"],
    );
}

#[test]
fn refinement_needs_portals_and_a_small_number() {
    let folder = Folder::new();
    bake_fails(&folder, &["--portal", "glass*", "--refine", "7"], &["--refine", "7", "0..=6"]);
    let plain = ["bake", "plane:n=8", "--rays", "16", "--refine", "1", "-o", "out.safetensors"];
    fails_late(&folder, &plain, &["--refine", "portals"]);
}
