//! Finding and opening Embree at run time.
//!
//! Search order: `LUNETTE_EMBREE` (the library, or the folder that holds it), the
//! system's library, then `.embree/` in the workspace, where `setup.sh` puts a
//! library whose file name may carry a hash, with its TBB beside it.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use libloading::Library;

use crate::error::Error;
use crate::raw::Functions;

/// The environment variable that names the library.
pub(crate) const VARIABLE: &str = "LUNETTE_EMBREE";

/// Where `setup.sh` unpacks the library, under the workspace's root.
const WORKSPACE_FOLDER: &str = ".embree";

/// The names under which a system may hold Embree 4, given to the loader's own search.
/// (Homebrew's folder on Apple silicon is not in the loader's path, so it is spelled out.)
const SYSTEM_NAMES: &[&str] = if cfg!(target_os = "windows") {
    &["embree4.dll"]
} else if cfg!(target_os = "macos") {
    &["libembree4.dylib", "libembree4.4.dylib", "/opt/homebrew/lib/libembree4.dylib"]
} else {
    &["libembree4.so.4"]
};

/// An opened library.
pub(crate) struct Embree {
    /// Every function that this crate calls. They stay valid for ever: see [`open_path`].
    pub functions: Functions,
    /// What was opened: a path, or the bare name that the system's loader resolved.
    pub path: PathBuf,
}

/// Opens the first Embree that the search finds.
///
/// A system library that is there but cannot be used does not end the search, since
/// `setup.sh` may have put a good one into `.embree/`; it is what is reported if none is.
pub(crate) fn open() -> Result<Embree, Error> {
    if let Some(path) = std::env::var_os(VARIABLE).filter(|path| !path.is_empty()) {
        return open_named(Path::new(&path));
    }
    let mut refused = None;
    for path in SYSTEM_NAMES.iter().map(PathBuf::from).chain(workspace_libraries()) {
        match open_path(&path) {
            Ok(embree) => return Ok(embree),
            // The loader says the same of a missing library and of a broken one; a bare
            // name that it cannot resolve is the ordinary case of no system library.
            Err(Error::LibraryNotLoadable { .. }) if !path.is_file() => {}
            Err(error) => refused = refused.or(Some(error)),
        }
    }
    Err(refused.unwrap_or(Error::LibraryNotFound))
}

/// Opens the library that the user named: a file, or a folder that holds one.
pub(crate) fn open_named(path: &Path) -> Result<Embree, Error> {
    let file = if path.is_dir() { library_in(path) } else { path.is_file().then(|| path.to_owned()) };
    open_path(&file.ok_or_else(|| Error::NoSuchLibrary { path: path.to_owned() })?)
}

/// Opens one library and looks its functions up.
fn open_path(path: &Path) -> Result<Embree, Error> {
    // SAFETY: opening runs the library's initialisers. What is opened is what the user
    // named or a file called libembree4, whose initialisers (Embree's and TBB's) set up
    // static tables and have no demands on the caller.
    let library = unsafe { Library::new(path) }
        .map_err(|error| Error::LibraryNotLoadable { path: path.to_owned(), reason: one_line(&error) })?;

    // SAFETY: the symbols' types are those of Embree 4, and `rtc…` is Embree's own prefix.
    // Embree 3 has some of the names too, but its device functions, the only ones called
    // before the version is checked, have the same types. The library is never unloaded
    // (below), so the table never dangles.
    let functions = unsafe { Functions::load(&library) };

    // TBB's worker threads run the library's code until the process ends, and unloading
    // would pull it from under them: the handle is given up on purpose.
    std::mem::forget(library);
    let functions = functions.map_err(|symbol| Error::NotEmbree { path: path.to_owned(), symbol })?;
    Ok(Embree { functions, path: path.to_owned() })
}

/// The loader's message and its cause as one line.
fn one_line(error: &dyn std::error::Error) -> String {
    let cause = error.source().map_or_else(|| error.to_string(), |source| source.to_string());
    cause.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The libraries in the `.embree/` folders that can be seen from the executable, from
/// the current folder and from where this crate was compiled, nearest first.
fn workspace_libraries() -> impl Iterator<Item = PathBuf> {
    let starts = [
        std::env::current_exe().ok(),
        std::env::current_dir().ok(),
        option_env!("CARGO_MANIFEST_DIR").map(PathBuf::from),
    ];
    starts
        .into_iter()
        .flatten()
        .filter_map(|start| start.ancestors().find_map(|folder| library_in(&folder.join(WORKSPACE_FOLDER))))
}

/// The Embree library in a folder: the first by name, if there are several.
fn library_in(folder: &Path) -> Option<PathBuf> {
    let files = std::fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path()));
    files.filter(|file| file.file_name().is_some_and(is_library_name)).min()
}

/// `libembree4.so.4`, `libembree4-4aef3270.so.4`, `libembree4.4.dylib`, `embree4.dll`, ….
fn is_library_name(name: &OsStr) -> bool {
    let name = name.to_string_lossy();
    let stem = name.strip_prefix("lib").unwrap_or(&name);
    let is_embree = stem.strip_prefix("embree4").is_some_and(|rest| rest.starts_with(['.', '-']));
    is_embree && (name.contains(".so") || name.ends_with(".dylib") || name.ends_with(".dll"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn library_names_are_told_from_others() {
        for name in ["libembree4.so.4", "libembree4-4aef3270.so.4", "libembree4.4.dylib", "embree4.dll"] {
            assert!(is_library_name(OsStr::new(name)), "{name}");
        }
        for name in
            ["libtbb-dcf63f8c.so.12", "libembree3.so.3", "libembree4.txt", "libembree40.so", "embree4"]
        {
            assert!(!is_library_name(OsStr::new(name)), "{name}");
        }
    }

    #[test]
    fn named_library_that_is_missing_is_an_error() {
        let path = Path::new("/nowhere/libembree4.so.4");
        let error = open_named(path).err();
        assert_eq!(error, Some(Error::NoSuchLibrary { path: path.to_owned() }));
    }

    #[test]
    fn file_that_is_no_library_is_refused_by_name() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        let error = open_named(&path).err();
        assert!(matches!(&error, Some(Error::LibraryNotLoadable { path: named, .. }) if *named == path));
        let line = error.expect("just matched").to_string();
        assert!(line.lines().count() == 1 && line.contains("./setup.sh"), "{line}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn library_that_is_not_embree_is_refused_by_symbol() {
        // The C library is on every Linux machine, and has no rtcNewDevice.
        let error = open_path(Path::new("libc.so.6")).err();
        assert!(matches!(error, Some(Error::NotEmbree { symbol: "rtcNewDevice", .. })), "{error:?}");
    }
}
