//! Bad input gets one line on stderr and an exit status, and leaves no file behind.

mod assets;
mod lights;
mod moving;
mod options;
mod outputs;
mod portals;
mod scenes;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The work failed.
const FAILED: i32 = 1;

/// The command line makes no sense.
const USAGE: i32 = 2;

/// A triangle facing up.
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 3 2\n";

/// A folder of its own for each test, with input files in it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().expect("a temporary folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).expect("an input file");
    }

    /// A baked triangle.
    fn bake(&self, name: &str) -> Vec<u8> {
        self.write("triangle.obj", TRIANGLE);
        let output =
            self.run(&["bake", "triangle.obj", "-o", name, "--rays", "16", "--order", "2", "--bounces", "1"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::read(self.path(name)).expect("the bake")
    }

    fn run(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_lunette"))
            .args(arguments)
            .current_dir(self.0.path())
            .output()
            .expect("the lunette command")
    }

    fn files(&self) -> BTreeSet<PathBuf> {
        fn walk(folder: &Path, files: &mut BTreeSet<PathBuf>) {
            for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
                if entry.path().is_dir() {
                    walk(&entry.path(), files);
                }
                files.insert(entry.path());
            }
        }
        let mut files = BTreeSet::new();
        walk(self.0.path(), &mut files);
        files
    }

    /// Runs a command that must be refused with this exit status, loud and quiet; the line that it says.
    fn refused(&self, status: i32, arguments: &[&str]) -> String {
        let before = self.files();
        let [loud, quiet] = [&[][..], &["--quiet"]].map(|extra| {
            let output = self.run(&[arguments, extra].concat());
            let error = String::from_utf8(output.stderr).expect("UTF-8 on stderr");
            assert_eq!(output.status.code(), Some(status), "{arguments:?}: {error}");
            assert!(output.stdout.is_empty(), "{arguments:?} wrote to stdout");
            assert!(error.starts_with("lunette: ") && !error.contains("panicked"), "{arguments:?}: {error}");
            assert_eq!(error.trim_end().lines().count(), 1, "{arguments:?}: {error}");
            error
        });
        assert_eq!(loud, quiet);
        assert_eq!(self.files(), before, "{arguments:?} left files");
        loud
    }

    /// As [`Folder::refused`] with [`FAILED`], and the line names all of `needles`.
    fn fails_naming(&self, arguments: &[&str], needles: &[&str]) {
        let error = self.refused(FAILED, arguments);
        for needle in needles {
            assert!(error.contains(needle), "{arguments:?}: '{needle}' is not in: {error}");
        }
    }
}
