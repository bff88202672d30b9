//! Numbers and names that no option can take.

use crate::{FAILED, Folder, TRIANGLE, USAGE};

fn ready() -> Folder {
    let folder = Folder::new();
    folder.bake("a.safetensors");
    folder
}

/// Numbers that are none, in any option.
const NO_NUMBERS: [&str; 4] = ["-5", "x", "nan", ""];

fn each_is_refused(folder: &Folder, command: &[&str], option: &str, values: &[&str]) {
    for value in values {
        folder.fails_naming(&[command, &[option, value]].concat(), &[option.trim_start_matches('-')]);
    }
}

#[test]
fn bake_names_the_option_that_is_absurd() {
    let folder = ready();
    let command = ["bake", "triangle.obj", "-o", "out.safetensors"];
    for (option, absurd) in [
        ("--order", &["0", "11"][..]),
        ("--indirect-order", &["0", "11"]),
        ("--rays", &["0", "15", "65537", "99999999999999999999"]),
        ("--bounces", &["1001"]),
        ("--threads", &["1025"]),
        ("--seed", &["99999999999999999999"]),
        ("--scale", &["0", "inf", "1e-30", "1e30"]),
        ("--vertical-scale", &["0", "inf"]),
        ("--crease-angle", &["181", "inf"]),
        ("--subdivide", &["0", "inf", "1e-9"]),
    ] {
        each_is_refused(&folder, &command, option, &NO_NUMBERS);
        each_is_refused(&folder, &command, option, absurd);
    }
    each_is_refused(&folder, &command, "--up", &["x", "w", ""]);
    each_is_refused(&folder, &command, "--basis", &["shh", "bent,,sh", ""]);
}

#[test]
fn relight_names_the_option_that_is_absurd() {
    let folder = ready();
    let command = ["relight", "a.safetensors", "--light", "uniform", "-o", "out.png"];
    for (option, absurd) in [
        ("--size", &["0x0", "10", "10x", "x10", "99999x2", "32768x32768"][..]),
        ("--exposure", &["inf", "1000"]),
        ("--turn", &["inf", "x"]),
        ("--camera", &["", "1,2", "0,0,0;0,0,0;40", "0,1,2;0,0,0;0", "0,1,2;0,0,0;180", "a,b,c;0,0,0;40"]),
        ("--method", &["shh", "sh0", "sh11", "bent-lanczos"]),
    ] {
        each_is_refused(&folder, &command, option, absurd);
    }
}

#[test]
fn day_names_the_option_that_is_absurd() {
    let folder = ready();
    let day = ["relight", "a.safetensors", "-o", "out.%02d.png", "--day"];
    for date in ["", "tomorrow", "2026-02-30", "999999-01-01"] {
        folder.fails_naming(&[&day[..], &[date, "--at", "46.2,-122.2"]].concat(), &["--day"]);
    }
    for place in ["", "46.2", "91,0", "0,181", "nan,0", "46.2,-122.2,3"] {
        folder.fails_naming(&[&day[..], &["2026-06-21", "--at", place]].concat(), &["--at"]);
    }
    let command = [&day[..], &["2026-06-21", "--at", "46.2,-122.2"]].concat();
    each_is_refused(&folder, &command, "--frames", &["0", "-1", "100001", "x"]);
    each_is_refused(&folder, &command, "--turbidity", &["0", "11", "-3", "nan", "x"]);
    let one_file =
        ["relight", "a.safetensors", "-o", "out.png", "--day", "2026-06-21", "--at", "46.2,-122.2"];
    folder.fails_naming(&one_file, &["out.png", "%02d"]);
}

#[test]
fn render_and_compare_name_the_option_that_is_absurd() {
    let folder = ready();
    let render = ["render", "triangle.obj", "--light", "uniform", "-o", "out.png", "--size", "8x8"];
    each_is_refused(&folder, &render, "--samples", &["0", "1", "-1", "x", "4000000000"]);
    each_is_refused(&folder, &render, "--bounces", &["-1", "x", "4000000000"]);
    each_is_refused(&folder, &render, "--seed", &["-1", "x", "99999999999"]);
    let compare = ["compare", "triangle.obj", "--light", "uniform", "-o", "out"];
    each_is_refused(&folder, &compare, "--methods", &["", "sh5,shh"]);
    each_is_refused(&folder, &compare, "--samples", &["0", "-1", "4000000000"]);
    each_is_refused(&folder, &compare, "--rays", &["0", "-1"]);
}

#[test]
fn wrong_usage_has_a_status_of_its_own() {
    let folder = Folder::new();
    folder.write("triangle.obj", TRIANGLE);
    for command in [
        &["bake"][..],
        &["bak", "triangle.obj"],
        &["bake", "triangle.obj", "--rais", "16"],
        &["relight", "triangle.obj"],
        &["relight", "triangle.obj", "--day", "2026-06-21"],
        &["scene", "plane"],
    ] {
        folder.refused(USAGE, command);
    }
}

#[test]
fn huge_scenes_are_refused_before_they_fill_the_memory() {
    let folder = ready();
    folder.refused(FAILED, &["bake", "terrain:n=1000000", "-o", "out.safetensors"]);
    folder.refused(FAILED, &["bake", "plane:size=1e30", "-o", "out.safetensors"]);
}
