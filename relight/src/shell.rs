//! Shells at run time: the light outside a portal as somebody captured it, and what the portal's glass does to it.
//!
//! A [`Shell`] is the average radiance of each texel of a cubemap ([`cubemap`]) centred on a portal,
//! given anew every frame. A [`Material`] changes it before it is projected: a tint multiplies, frosting blurs
//! ([`Blur`]), closed is dark. So glass changes without a new bake.
//!
//! Text form of a material: `NAME=PART[+PART...]`, each part one of `clear`, `closed`, `tint:r,g,b`,
//! `frosted:radians`.
//!
//! Where it breaks: frosting blurs the light before it enters, which is right for glass that scatters evenly about
//! the way the light went, and the portal's own cosine and edges stay those of clear glass.
//!
//! Based on: Yue, Iwasaki, Chen, Dobashi and Nishita, Interactive Rendering of Interior Scenes with Dynamic
//! Environment Illumination, 2009.

use std::fmt;

use crate::cubemap;

mod blur;
mod parse;
#[cfg(test)]
mod tests;

pub use blur::Blur;
pub use parse::{MaterialError, MaterialProblem, parse_material};

/// The light around a portal at one moment.
#[derive(Clone, Copy, Debug)]
pub struct Shell<'a> {
    n: usize,
    texels: &'a [[f32; 3]],
}

/// Why texels are not a shell.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ShellError {
    /// The side is outside of [`cubemap::RESOLUTIONS`].
    Side(usize),
    /// Not 6 n² texels.
    Length {
        /// 6 n².
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// A texel is NaN, infinite or negative.
    Radiance {
        /// The first such texel.
        texel: usize,
        /// Its worst value.
        value: f32,
    },
    /// The portal was baked at another resolution.
    Resolution {
        /// Of the portal.
        baked: usize,
        /// Of the shell.
        given: usize,
    },
}

impl<'a> Shell<'a> {
    /// Checks an `n` x `n` x 6 cubemap of radiances, linear Rec.709.
    ///
    /// # Errors
    /// When the side or the number of texels is wrong, or a radiance is NaN, infinite or negative.
    pub fn new(n: usize, texels: &'a [[f32; 3]]) -> Result<Shell<'a>, ShellError> {
        if !cubemap::RESOLUTIONS.contains(&n) {
            return Err(ShellError::Side(n));
        }
        if texels.len() != cubemap::n_texels(n) {
            return Err(ShellError::Length { expected: cubemap::n_texels(n), found: texels.len() });
        }
        let is_bad = |value: &f32| !(value.is_finite() && *value >= 0.0);
        match texels.as_flattened().iter().position(is_bad) {
            Some(at) => Err(ShellError::Radiance { texel: at / 3, value: texels.as_flattened()[at] }),
            None => Ok(Shell { n, texels }),
        }
    }

    /// Texels on a side.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Average radiances, face after face.
    pub fn texels(&self) -> &'a [[f32; 3]] {
        self.texels
    }

    /// Whether a good part of the light comes from a small part of the sphere, as a sun's does: texels more than ten
    /// times as bright as the mean have at least a tenth of the energy. A clear sky's dome about the sun stays below,
    /// a sun of half a degree or a lamp does not.
    pub fn has_sun(&self) -> bool {
        let energy = |t: usize| {
            let [r, g, b] = self.texels[t];
            (0.2126 * r + 0.7152 * g + 0.0722 * b) * cubemap::solid_angle(self.n, t)
        };
        let total: f32 = (0..self.texels.len()).map(energy).sum();
        let mean = total / (4.0 * std::f32::consts::PI);
        let is_bright = |t: &usize| energy(*t) > 10.0 * mean * cubemap::solid_angle(self.n, *t);
        (0..self.texels.len()).filter(is_bright).map(energy).sum::<f32>() > 0.1 * total
    }
}

/// What the glass of a portal does to the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Share of the light let through, per colour, from 0; above 1 is allowed, as for a lamp in the frame.
    pub tint: [f32; 3],
    /// Standard deviation of the scattering, radians, in 0..=π; 0 is clear.
    pub frost: f32,
}

impl Material {
    /// An open window.
    pub const CLEAR: Material = Material { tint: [1.0; 3], frost: 0.0 };

    /// Blinds: no light.
    pub const CLOSED: Material = Material { tint: [0.0; 3], frost: 0.0 };
}

impl Default for Material {
    fn default() -> Self {
        Material::CLEAR
    }
}

impl fmt::Display for ShellError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ShellError::Side(n) => write!(f, "a shell has 8 to 64 texels on a side, not {n}"),
            ShellError::Length { expected, found } => {
                write!(
                    f,
                    "a shell of {found} texels where its side asks for {expected}: give 6 faces, +X -X +Y -Y +Z -Z"
                )
            }
            ShellError::Radiance { texel, value } => {
                write!(f, "texel {texel} of a shell is {value}: radiances are finite and not negative")
            }
            ShellError::Resolution { baked, given } => {
                write!(
                    f,
                    "a shell of {given} texels on a side for a portal baked at {baked}: capture it at {baked}"
                )
            }
        }
    }
}

impl std::error::Error for ShellError {}
