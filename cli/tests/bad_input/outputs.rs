//! Places that cannot be written to.

use crate::{FAILED, Folder, TRIANGLE};

/// Every command that writes a file, without its `-o FILE`, and the file's ending.
const WRITERS: [(&[&str], &str); 6] = [
    (&["bake", "triangle.obj", "--rays", "16"], "safetensors"),
    (&["relight", "a.safetensors", "--light", "uniform", "--size", "32x32"], "png"),
    (&["relight", "a.safetensors", "--light", "uniform"], "ply"),
    (&["render", "triangle.obj", "--light", "uniform", "--size", "32x32", "--samples", "2"], "exr"),
    (&["render", "triangle.obj", "--light", "uniform", "--samples", "2"], "safetensors"),
    (&["scene", "plane:n=16"], "obj"),
];

fn baked() -> Folder {
    let folder = Folder::new();
    folder.bake("a.safetensors");
    folder
}

#[test]
fn output_folder_that_does_not_exist_is_named() {
    let folder = baked();
    for (command, ending) in WRITERS {
        let output = format!("nowhere/out.{ending}");
        folder.fails_naming(&[command, &["-o", &output]].concat(), &["nowhere"]);
    }
}

#[test]
fn output_that_is_a_folder_is_named() {
    let folder = baked();
    for (command, ending) in WRITERS {
        let output = format!("there.{ending}");
        std::fs::create_dir_all(folder.path(&output)).expect("a folder");
        folder.fails_naming(&[command, &["-o", &output]].concat(), &["there"]);
    }
}

#[test]
fn folder_that_is_a_file_is_named() {
    let folder = Folder::new();
    folder.write("triangle.obj", TRIANGLE);
    folder.write("there", "");
    let compare = ["compare", "triangle.obj", "--light", "uniform", "--samples", "2", "-o", "there"];
    for command in [&compare[..], &["demo", "there"]] {
        folder.fails_naming(command, &["there", "is a file", "folder"]);
    }
}

#[test]
fn output_of_an_unknown_kind_is_named() {
    let folder = baked();
    for command in [&WRITERS[1], &WRITERS[3]] {
        folder.fails_naming(&[command.0, &["-o", "out.jpg"]].concat(), &["out.jpg", ".png"]);
    }
}

#[test]
fn missing_input_does_not_touch_an_older_output() {
    let folder = baked();
    let before = std::fs::read(folder.path("a.safetensors")).expect("the bake");
    folder.refused(FAILED, &["bake", "missing.obj", "-o", "a.safetensors"]);
    assert!(std::fs::read(folder.path("a.safetensors")).expect("the bake") == before);
}

/// A limit on the size of files stands for a full disk: the write in the middle fails the same way.
#[cfg(unix)]
#[test]
fn full_disk_leaves_nothing_half_written() {
    let folder = Folder::new();
    folder.write("triangle.obj", TRIANGLE);
    let script = r#"trap '' XFSZ; ulimit -f 8; exec "$0" "$@""#;
    let lunette = env!("CARGO_BIN_EXE_lunette");
    for command in [
        &["bake", "plane:n=32", "--rays", "16", "-o", "out.safetensors"][..],
        &[
            "render",
            "plane:n=4",
            "--light",
            "uniform",
            "--samples",
            "2",
            "--size",
            "300x300",
            "-o",
            "out.exr",
        ],
        &["scene", "plane:n=64", "-o", "out.obj"],
    ] {
        let before = folder.files();
        let run = std::process::Command::new("sh")
            .args(["-c", script, lunette])
            .args(command)
            .arg("--quiet")
            .current_dir(folder.0.path())
            .output()
            .expect("a shell");
        let error = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(FAILED), "{command:?}: {error}");
        assert!(error.starts_with("lunette: out.") && error.lines().count() == 1, "{command:?}: {error}");
        assert_eq!(folder.files(), before, "{command:?} left files");
    }
}
