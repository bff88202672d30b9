//! What can go wrong between Lunette and Embree, each in one line.

use std::fmt;
use std::path::PathBuf;

/// How to get Embree, said once for every error about the library.
const REMEDY: &str = "run ./setup.sh, or set LUNETTE_EMBREE=/path/to/libembree4.so.4";

/// An error of this crate. Its `Display` is one line: what, where, what to do.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// No library was found in any of the places searched.
    LibraryNotFound,
    /// There is no file at the path that `LUNETTE_EMBREE` names.
    NoSuchLibrary {
        /// The path as it was given.
        path: PathBuf,
    },
    /// A file was found but the system's loader refused it.
    LibraryNotLoadable {
        /// The file.
        path: PathBuf,
        /// The loader's own words.
        reason: String,
    },
    /// The library loads but lacks a function of Embree 4.
    NotEmbree {
        /// The file.
        path: PathBuf,
        /// The first function that is missing.
        symbol: &'static str,
    },
    /// The library is an Embree of another major version.
    WrongVersion {
        /// The file.
        path: PathBuf,
        /// Its version: major, minor, patch.
        version: (u32, u32, u32),
    },
    /// The library is an Embree 4 that was built with options this crate can't use.
    UnsupportedBuild {
        /// The file.
        path: PathBuf,
        /// What is different.
        reason: &'static str,
    },
    /// A mesh without triangles.
    NoTriangles,
    /// A position is NaN, infinite or beyond [`crate::MAX_COORDINATE`].
    BadPosition {
        /// Which vertex.
        vertex: usize,
        /// Its position.
        position: [f32; 3],
    },
    /// A triangle names a vertex that is not there.
    IndexOutOfRange {
        /// Which triangle.
        triangle: usize,
        /// The index that it holds.
        index: u32,
        /// How many vertices there are.
        n_vertices: usize,
    },
    /// A transform holds a NaN or an infinity, or flattens space.
    BadTransform,
    /// An instance of a scene that itself holds instances: Embree has one level.
    NestedInstance,
    /// An instance of a scene that was made on another device.
    ForeignScene,
    /// The geometry number is not that of an instance in this scene.
    NotAnInstance {
        /// The number given.
        geometry: u32,
    },
    /// Embree itself reports an error.
    Embree {
        /// What was being done.
        action: &'static str,
        /// Embree's error code (`RTCError`).
        code: i32,
        /// Embree's own words, or the name of the code.
        message: String,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::LibraryNotFound => write!(f, "Embree 4 is not installed: {REMEDY}"),
            Error::NoSuchLibrary { path } => {
                write!(f, "LUNETTE_EMBREE: no Embree library at {}: {REMEDY}", path.display())
            }
            Error::LibraryNotLoadable { path, reason } => {
                write!(f, "cannot load {} ({reason}): {REMEDY}", path.display())
            }
            Error::NotEmbree { path, symbol } => {
                write!(f, "{} is not Embree 4 (it has no {symbol}): {REMEDY}", path.display())
            }
            Error::WrongVersion { path, version: (major, minor, patch) } => {
                let path = path.display();
                write!(f, "{path} is Embree {major}.{minor}.{patch}, but Embree 4 is needed: {REMEDY}")
            }
            Error::UnsupportedBuild { path, reason } => {
                write!(f, "{} cannot be used ({reason}): {REMEDY}", path.display())
            }
            Error::NoTriangles => write!(f, "the mesh has no triangles: give it at least one"),
            Error::BadPosition { vertex, position: [x, y, z] } => {
                write!(f, "vertex {vertex} is at ({x}, {y}, {z}): ")?;
                write!(f, "coordinates must be finite and at most {:e}", crate::MAX_COORDINATE)
            }
            Error::IndexOutOfRange { triangle, index, n_vertices } => {
                write!(f, "triangle {triangle} names vertex {index}, ")?;
                write!(f, "but there are only {n_vertices} vertices: indices count from 0")
            }
            Error::BadTransform => {
                write!(f, "the transform is not finite or not invertible: use a rotation and a translation")
            }
            Error::NestedInstance => {
                write!(f, "a scene with instances cannot be instanced again: instance its meshes instead")
            }
            Error::ForeignScene => {
                write!(f, "the instanced scene belongs to another device: build both on one device")
            }
            Error::NotAnInstance { geometry } => {
                write!(f, "geometry {geometry} is not an instance: use the number that add_instance returned")
            }
            Error::Embree { action, code, message } => {
                write!(f, "Embree could not {action}: {message} (error {code})")
            }
        }
    }
}

impl std::error::Error for Error {}

/// The name of an `RTCError`, for libraries that give no message.
pub(crate) fn code_name(code: i32) -> &'static str {
    match code {
        1 => "unknown error",
        2 => "invalid argument",
        3 => "invalid operation",
        4 => "out of memory",
        5 => "this processor is not supported",
        6 => "cancelled",
        _ => "unlisted error",
    }
}
