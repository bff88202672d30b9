//! One frame: the light of all lamps at all points, into the caller's buffers.
//!
//! Eight points at a time ([`super::chunk`]): (a) their reflectance as lobes; for each lamp (b) the lamp's lobe
//! and (e) its product with the reflectance; for each point whose product matters and whose view of the lamp a
//! body may touch, (c) the mask of what hides the lamp, (d) its leaves and (e) their products. That is the
//! paper's order: light and reflectance first, since few of their products matter, then visibility. A product
//! whose integral is below [`Options::threshold`] times the solid angle of its lamp ends there.
//!
//! Nothing allocates: [`Scratch`] and [`Blockers`] hold all memory. Threads share points, lamps and blockers,
//! and each has a scratch and a slice of the output.
//!
//! Based on: Meunier et al., Cosine Lobes for Interactive Direct Lighting in Dynamic Scenes, 2009.

use glam::Vec3;

use super::chunk;
use super::leaves::Leaves;
use super::mask::{MAX_DEPTH, Mask, Policy};
use super::reflectance::Reflectance;
use super::weights::weights;
use super::{Blockers, Error, Lamp};

/// How finely a frame is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Levels of the quad-tree over each lamp, 1..=[`MAX_DEPTH`]. Every level doubles the cells along a side.
    pub depth: u32,
    /// What becomes of cells that are hidden in part.
    pub policy: Policy,
    /// The paper's tᵢ, relative to the lamp's solid angle: products with a smaller integral are dropped. Shadow
    /// leaves that hold a smaller share of the lamp are not multiplied, and take that share off as it is. 0
    /// keeps all.
    pub threshold: f32,
}

impl Default for Options {
    fn default() -> Self {
        Options { depth: MAX_DEPTH, policy: Policy::default(), threshold: 0.0 }
    }
}

impl Options {
    /// # Errors
    /// When the depth or the threshold is out of range.
    pub fn check(&self) -> Result<(), Error> {
        if !(1..=MAX_DEPTH).contains(&self.depth) {
            return Err(Error::Depth(self.depth));
        }
        if !(self.threshold >= 0.0 && self.threshold.is_finite()) {
            return Err(Error::Threshold(self.threshold));
        }
        Ok(())
    }
}

/// Where light is wanted.
#[derive(Clone, Copy, Debug)]
pub struct Points<'a> {
    /// Metres, \[N\].
    pub position: &'a [[f32; 3]],
    /// Unit normals, \[N\].
    pub normal: &'a [[f32; 3]],
}

/// What the points are made of, for radiance towards an eye.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// The materials.
    pub materials: &'a [Reflectance],
    /// Index into `materials`, \[N\].
    pub material: &'a [u32],
    /// Tangents that anisotropy follows, \[N\]; empty where none does.
    pub tangent: &'a [[f32; 3]],
    /// Metres.
    pub eye: Vec3,
}

/// What lights the points, and what stands between.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// The lamps.
    pub lamps: &'a [Lamp],
    /// The bodies.
    pub blockers: &'a Blockers,
}

/// Where results go.
#[derive(Debug)]
pub struct Target<'a> {
    /// Light is added here, linear Rec.709, \[N\].
    pub light: &'a mut [[f32; 3]],
    /// Lobe products of each point are counted here, \[N\], or nowhere.
    pub products: Option<&'a mut [u32]>,
}

/// The parts of the work, as in the paper's Table 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// (a) Lobes of reflectance.
    Reflectance,
    /// (b) Lobes of lamps.
    Lighting,
    /// (c) Masks.
    Mask,
    /// (d) Lobes of masks.
    Leaves,
    /// (e) Products and integrals.
    Integration,
}

/// Is told when a stage ends. `()` ignores it and costs nothing.
pub trait Probe {
    /// The stage that has just ended.
    fn end(&mut self, stage: Stage);
}

impl Probe for () {
    #[inline(always)]
    fn end(&mut self, _: Stage) {}
}

/// Memory of one thread; about 45 kB.
#[derive(Clone, Debug)]
pub struct Scratch {
    pub(super) mask: Mask,
    pub(super) leaves: Leaves,
    pub(super) full: Leaves,
}

impl Default for Scratch {
    fn default() -> Self {
        // The calibration belongs to the set-up, not to the first frame.
        weights();
        Scratch { mask: Mask::new(MAX_DEPTH, Policy::default()), leaves: Leaves::new(), full: Leaves::new() }
    }
}

/// Adds the irradiance from all lamps, as a white diffuse surface without its own albedo takes it.
///
/// # Panics
/// When slices differ in length, or `options` do not pass [`Options::check`].
pub fn add_irradiance(
    points: &Points<'_>,
    scene: &Scene<'_>,
    options: &Options,
    scratch: &mut Scratch,
    target: &mut Target<'_>,
) {
    add_light(points, None, scene, options, scratch, target, &mut ());
}

/// Adds the radiance that points reflect towards the eye from all lamps.
///
/// # Panics
/// As [`add_irradiance`], and when an index of a material is out of range.
pub fn add_radiance(
    points: &Points<'_>,
    surface: &Surface<'_>,
    scene: &Scene<'_>,
    options: &Options,
    scratch: &mut Scratch,
    target: &mut Target<'_>,
) {
    add_light(points, Some(surface), scene, options, scratch, target, &mut ());
}

/// [`add_radiance`], or [`add_irradiance`] without a surface, with a probe for timing.
///
/// # Panics
/// As these.
pub fn add_light(
    points: &Points<'_>,
    surface: Option<&Surface<'_>>,
    scene: &Scene<'_>,
    options: &Options,
    scratch: &mut Scratch,
    target: &mut Target<'_>,
    probe: &mut impl Probe,
) {
    check(points, surface, options, target);
    scratch.mask.cells = 1 << options.depth;
    scratch.mask.policy = options.policy;
    let job = chunk::Job { points, surface, scene, options };
    #[cfg(target_arch = "x86_64")]
    if super::x86::run(&job, scratch, target, probe) {
        return;
    }
    chunk::run(&job, scratch, target, probe);
}

fn check(points: &Points<'_>, surface: Option<&Surface<'_>>, options: &Options, target: &Target<'_>) {
    let n = points.position.len();
    assert_eq!(n, points.normal.len(), "positions and normals do not match");
    assert_eq!(n, target.light.len(), "points and output do not match");
    assert!(target.products.as_ref().is_none_or(|p| p.len() == n), "points and counts do not match");
    if let Some(surface) = surface {
        assert_eq!(n, surface.material.len(), "points and materials do not match");
        assert!(surface.tangent.is_empty() || surface.tangent.len() == n, "points and tangents do not match");
    }
    assert!(options.check().is_ok(), "options out of range");
}
