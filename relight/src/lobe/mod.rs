//! Cosine lobes: direct light from moving lamps past moving blockers, without a bake.
//!
//! A lobe is s max(a·v, 0)ᵉ: scale s, axis a, exponent e. Reflectance, light and visibility are sums of lobes;
//! the product of two lobes is taken to be one lobe ([`product`]), and the integral of a lobe over the sphere
//! is 2π s / (e + 1), so that
//!
//! ```text
//! L(x, v₀) = Σ lamps Σ reflectance lobes ∫ f̃ · L_lamp · (1 - Σ shadow leaves w c) dv
//! ```
//!
//! is a sum of closed forms, whose cost follows the lobes that matter.
//!
//! - [`product`], [`product_integral`], [`Lobe`]: the algebra;
//! - [`reflectance`]: Lambert, Phong, modified Phong and Lafortune as lobes;
//! - [`Lamp`], [`cap_lobe`]: a sphere of light, seen from a point as a cap, as a lobe;
//! - [`SphereSet`], [`Blockers`]: what casts shadows, moved rigidly every frame;
//! - [`add_irradiance`], [`add_radiance`]: one frame, into the caller's buffers;
//! - [`Sun`]: what the blockers leave of a baked sun.
//!
//! Geometry of the baked scene does not block these lamps; only spheres do. Lamps are opaque: a nearer one
//! hides what it covers of another. Light that has bounced is not part of this method, but may be carried on from
//! the irradiance that it adds.
//!
//! Based on: Meunier, Meneveaux, Aveneau and Ghazanfarpour, Cosine Lobes for Interactive Direct Lighting in
//! Dynamic Scenes, 2009.

#![allow(clippy::needless_range_loop, reason = "a lane or lobe number indexes several arrays side by side")]

mod blockers;
mod chunk;
pub(crate) mod fast;
mod frame;
mod lamp;
mod leaves;
mod mask;
mod product;
mod profile;
pub mod reflectance;
mod relation;
mod sun;
#[cfg(test)]
mod tests;
mod weights;
#[cfg(target_arch = "x86_64")]
mod x86;

use std::f32::consts::TAU;

use glam::Vec3;

pub use blockers::{Blockers, Motion, Sphere, SphereSet};
pub use frame::{
    Options, Points, Probe, Scene, Scratch, Stage, Surface, Target, add_irradiance, add_light, add_radiance,
};
pub use lamp::{Lamp, cap_lobe, cap_lobe_least_squares};
pub use mask::{MAX_DEPTH, Policy};
pub use product::{product, product_integral, triple_integral};
pub use sun::{Sun, WIDEST};

/// s max(a·v, 0)ᵉ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// a, of unit length.
    pub axis: Vec3,
    /// e, from 0 up. 0 is a hemisphere of constant value.
    pub exponent: f32,
    /// s, the value along the axis.
    pub scale: f32,
}

impl Lobe {
    /// The lobe's value in a direction of unit length.
    pub fn value(&self, direction: Vec3) -> f32 {
        let cos = self.axis.dot(direction);
        if cos > 0.0 { self.scale * cos.powf(self.exponent) } else { 0.0 }
    }

    /// Its integral over the sphere, 2π s / (e + 1) \[sr\].
    pub fn integral(&self) -> f32 {
        TAU * self.scale / (self.exponent + 1.0)
    }
}

/// Why a lamp or a set of spheres was refused. `Display` is one line.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// A radius that is zero, negative, infinite or not a number.
    Radius(f32),
    /// A position or colour that is infinite or not a number, or a colour below zero.
    NotANumber(&'static str),
    /// A set without a sphere.
    NoSphere,
    /// More spheres than [`SphereSet::MAX_SPHERES`].
    TooManySpheres(usize),
    /// A mask depth outside 1..=[`MAX_DEPTH`].
    Depth(u32),
    /// A threshold that is negative or not a number.
    Threshold(f32),
}

impl std::fmt::Display for Error {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Error::Radius(r) => write!(f, "a radius of {r} is no sphere; give one above 0"),
            Error::NotANumber(what) => write!(f, "the {what} must be finite numbers, a colour from 0 up"),
            Error::NoSphere => write!(f, "a blocker needs at least one sphere"),
            Error::TooManySpheres(n) => {
                write!(f, "{n} spheres are too many for one blocker; give at most {}", SphereSet::MAX_SPHERES)
            }
            Error::Depth(d) => write!(f, "a mask depth of {d} is not in 1..={MAX_DEPTH}"),
            Error::Threshold(t) => write!(f, "a threshold of {t} is not a number from 0 up"),
        }
    }
}

impl std::error::Error for Error {}
