//! What can go wrong while judging and looking.

use std::fmt;
use std::path::PathBuf;

/// Why a picture, a camera or a reference could not be had. `Display` is one line for the user.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// A file could not be read or written.
    Io {
        /// The file, or the folder that it should go into.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// An image file was read and is wrong, or cannot hold what was asked for.
    Image {
        /// The file.
        path: PathBuf,
        /// What is wrong and what to do.
        what: String,
    },
    /// A `--camera` that does not parse.
    Camera {
        /// As given by the user.
        text: String,
        /// Byte at which it goes wrong, from 0.
        at: usize,
        /// What was expected there.
        what: String,
    },
    /// A surface that cannot be traced: no triangle, indices or lengths that do not fit, values that are not
    /// finite.
    Surface {
        /// What is wrong, with the first place where it is.
        what: String,
    },
    /// Options or arrays that do not fit together.
    Options {
        /// What is wrong and what is allowed.
        what: String,
    },
    /// Embree is missing or refused the scene.
    Embree(lunette_ffi::Error),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Io { path, source } => write!(f, "{}: {source}", path.display()),
            Error::Image { path, what } => write!(f, "{}: {what}", path.display()),
            Error::Camera { text, at, what } => {
                write!(f, "camera '{text}', character {}: {what}", text[..*at].chars().count() + 1)
            }
            Error::Surface { what } | Error::Options { what } => f.write_str(what),
            Error::Embree(source) => write!(f, "{source}"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Error::Io { source, .. } => Some(source),
            Error::Embree(source) => Some(source),
            _ => None,
        }
    }
}

impl From<lunette_ffi::Error> for Error {
    fn from(source: lunette_ffi::Error) -> Self {
        Error::Embree(source)
    }
}
