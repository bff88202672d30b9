//! Why bytes are not an asset.

/// `Display` is one line: what is wrong, where, and what to do.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// Not a safetensors document, or cut short.
    NotSafetensors(String),
    /// A safetensors document that another program wrote.
    OtherProgram,
    /// The JSON description cannot be read.
    Description(String),
    /// A format version that this library does not know.
    Version(u32),
    /// The content changed after it was written.
    Checksum {
        /// In the file.
        stored: String,
        /// Of the content found.
        computed: String,
    },
    /// A tensor is missing or has the wrong type, shape or values.
    Tensor {
        /// Its name.
        name: String,
        /// What is wrong.
        what: String,
    },
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Error::NotSafetensors(why) => {
                // The library's own words may run over several lines.
                let why = why.lines().next().unwrap_or_default();
                write!(f, "not a whole safetensors file ({why}); bake it again")
            }
            Error::OtherProgram => write!(f, "a safetensors file, but not baked by lunette"),
            Error::Description(why) => write!(f, "its description cannot be read ({why}); bake it again"),
            Error::Version(version) => {
                write!(
                    f,
                    "format version {version}, but this lunette reads only {}; use the lunette that baked it, or bake it again",
                    super::VERSION
                )
            }
            Error::Checksum { stored, computed } => {
                write!(f, "damaged: checksum {computed} instead of {stored}; copy it anew or bake it again")
            }
            Error::Tensor { name, what } => write!(f, "tensor {name}: {what}; bake it again"),
        }
    }
}

impl std::error::Error for Error {}
