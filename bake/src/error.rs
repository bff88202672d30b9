//! Why a bake did not come to its end.

/// `Display` is one line: what is wrong and what to do.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// Embree is missing or refused.
    Embree(lunette_ffi::Error),
    /// An option is out of its range.
    Option {
        /// Its name on the command line.
        name: &'static str,
        /// The value and the range.
        what: String,
    },
    /// There is nothing to bake.
    EmptyScene,
    /// The threads could not be started.
    Threads(String),
    /// The scene or its portals are wrong.
    Scene(lunette_scenes::Error),
    /// A tensor would not fit its file.
    TooLarge(String),
    /// Nothing in the scene is inside.
    NoInterior,
    /// The inside is closed.
    NoOpening,
    /// No vertex sees a portal.
    UnseenPortal(String),
    /// [`crate::Progress::cancelled`] said so.
    Cancelled,
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Error::Embree(e) => e.fmt(f),
            Error::Option { name, what } => write!(f, "--{name}: {what}"),
            Error::EmptyScene => write!(f, "the scene has no triangle; give one that has"),
            Error::Threads(why) => write!(f, "cannot start threads ({why}); try a smaller --threads"),
            Error::Scene(why) => write!(f, "{why}"),
            Error::TooLarge(why) => write!(f, "{why}"),
            Error::NoInterior => {
                write!(f, "nothing is inside: most of the sky is seen everywhere; bake it without portals")
            }
            Error::NoOpening => write!(
                f,
                "nothing leads from inside to outside; a hole may be narrower than a cell of the grid (more --cells) or \
                 too small (--smallest-area)"
            ),
            Error::UnseenPortal(name) => write!(
                f,
                "portal '{name}' is seen from no vertex: it lies behind a wall or outside; take it out, or move it into \
                 its opening"
            ),
            Error::Cancelled => write!(f, "stopped before the end; nothing was written"),
        }
    }
}

impl std::error::Error for Error {}

impl From<lunette_ffi::Error> for Error {
    fn from(e: lunette_ffi::Error) -> Self {
        Error::Embree(e)
    }
}
