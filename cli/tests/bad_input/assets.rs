//! Files that are no whole asset.

use crate::Folder;

fn all_readers_fail(folder: &Folder, name: &str, needles: &[&str]) {
    let needles = [&[name], needles].concat();
    folder.fails_naming(&["info", name], &needles);
    folder.fails_naming(&["relight", name, "--light", "uniform", "-o", "out.png"], &needles);
}

#[test]
fn cut_asset_is_refused_wherever_it_is_cut() {
    let folder = Folder::new();
    let bytes = folder.bake("a.safetensors");
    // Every cut is tried on the reader itself; here some, to see that the command passes them on.
    for length in (0..bytes.len()).step_by(bytes.len() / 40) {
        folder.write("cut.safetensors", &bytes[..length]);
        folder.fails_naming(&["info", "cut.safetensors"], &["cut.safetensors"]);
    }
    folder.write("long.safetensors", [&bytes[..], &[0]].concat());
    all_readers_fail(&folder, "long.safetensors", &[]);
}

#[test]
fn asset_with_a_flipped_byte_is_refused() {
    let folder = Folder::new();
    let bytes = folder.bake("a.safetensors");
    for at in (0..bytes.len()).step_by(bytes.len() / 40) {
        let mut harmed = bytes.clone();
        harmed[at] ^= 0x10;
        folder.write("harmed.safetensors", harmed);
        folder.fails_naming(&["info", "harmed.safetensors"], &["harmed.safetensors"]);
    }
}

#[test]
fn asset_of_a_future_version_is_told_from_damage() {
    let folder = Folder::new();
    let mut bytes = folder.bake("a.safetensors");
    let key = br#"version\":"#;
    let at = bytes.windows(key.len()).position(|w| w == key).expect("the version") + key.len();
    bytes[at] = b'9';
    folder.write("future.safetensors", bytes);
    all_readers_fail(&folder, "future.safetensors", &["version 9"]);
}

#[test]
fn files_of_others_are_refused() {
    let folder = Folder::new();
    folder.write("other.safetensors", b"\x02\0\0\0\0\0\0\0{}");
    all_readers_fail(&folder, "other.safetensors", &["not baked by lunette"]);
    folder.write("text.safetensors", "not at all\n".repeat(99));
    all_readers_fail(&folder, "text.safetensors", &[]);
    all_readers_fail(&folder, "missing.safetensors", &[]);
    std::fs::create_dir(folder.path("folder.safetensors")).expect("a folder");
    all_readers_fail(&folder, "folder.safetensors", &[]);
}

#[test]
fn method_that_was_not_baked_is_named_with_what_to_bake() {
    let folder = Folder::new();
    folder.bake("a.safetensors");
    let bake = ["bake", "triangle.obj", "-o", "bent.safetensors", "--basis", "bent", "--rays", "16"];
    assert!(folder.run(&bake).status.success());
    let relight = ["relight", "bent.safetensors", "--light", "uniform", "--method", "sh", "-o", "out.png"];
    folder.fails_naming(&relight, &["--basis sh"]);
}

#[test]
fn relit_vertices_are_not_taken_for_a_bake() {
    let folder = Folder::new();
    folder.bake("a.safetensors");
    let relight = ["relight", "a.safetensors", "--light", "uniform", "-o", "lit.safetensors"];
    assert!(folder.run(&relight).status.success());
    folder.fails_naming(
        &["relight", "lit.safetensors", "--light", "uniform", "-o", "out.png"],
        &["lit.safetensors"],
    );
}
