//! What moving blockers leave of a disc of light at infinity: a baked sun.
//!
//! The disc stands as a lamp so far away that all points see it in one direction; a point that faces it then has
//!
//! ```text
//! part = E(with blockers) / E(without),     0..=1
//! ```
//!
//! of it, by the same masks and leaves as of any lamp. Direct light is linear, so that a baked sun's E_sun
//! becomes part E_sun.
//!
//! Where it breaks: E_sun is what the baked scene lets through, and the part is of the whole disc; where both a
//! baked edge and a blocker cut the same sun, their shadows are multiplied and not laid over each other. Discs
//! wider than [`WIDEST`] are more sky than sun and are not shadowed.
//!
//! Based on: Meunier et al., Cosine Lobes for Interactive Direct Lighting in Dynamic Scenes, 2009 (the masks).

use glam::Vec3;

use super::{Blockers, Lamp, Options, Points, Scene, Scratch, Sphere, Target, add_irradiance};
use crate::light::Cap;

/// Radius of the widest disc that blockers shadow, radians.
pub const WIDEST: f32 = 1.0;
/// Distance of the lamp over the scene's radius: directions differ by no more than 1e-5 radians, a 500th of the
/// sun's radius, and the squares of distances stay in the range of f32.
const FAR: f32 = 1e5;
/// Points of one call to the frame's loops.
const BLOCK: usize = 256;

/// A disc of light at infinity.
#[derive(Clone, Copy, Debug)]
pub struct Sun {
    lamp: Lamp,
    axis: Vec3,
    /// Irradiance of a point that faces the disc, without blockers.
    open: f32,
}

impl Sun {
    /// The disc as seen from within a sphere that holds all points and blockers; `None` where the disc is wider
    /// than [`WIDEST`] or dark, or the sphere is not finite.
    pub fn new(disc: &Cap, within: Sphere, scratch: &mut Scratch) -> Option<Sun> {
        if !(disc.radius > 0.0 && disc.radius <= WIDEST) || disc.radiance == Vec3::ZERO {
            return None;
        }
        let distance = FAR * (within.radius + within.centre.length()).max(1e-3);
        let axis = disc.axis.try_normalize()?;
        let lamp =
            Lamp::new(within.centre + distance * axis, distance * disc.radius.sin(), Vec3::ONE).ok()?;
        let mut sun = Sun { lamp, axis, open: 1.0 };
        let mut open = [0.0];
        let centre = [within.centre.to_array()];
        sun.light(&centre, &Blockers::default(), &Options::default(), scratch, &mut open);
        sun.open = open[0];
        (sun.open > 0.0).then_some(sun)
    }

    /// The part of the disc that blockers leave to each point, 0..=1, written over `out`.
    ///
    /// # Panics
    /// When the slices differ in length, or `options` do not pass [`Options::check`].
    pub fn visible_part(
        &self,
        position: &[[f32; 3]],
        blockers: &Blockers,
        options: &Options,
        scratch: &mut Scratch,
        out: &mut [f32],
    ) {
        assert_eq!(position.len(), out.len(), "positions and output do not match");
        self.light(position, blockers, options, scratch, out);
        out.iter_mut().for_each(|part| *part = (*part / self.open).min(1.0));
    }

    /// Irradiance of points that face the disc.
    fn light(
        &self,
        position: &[[f32; 3]],
        blockers: &Blockers,
        options: &Options,
        scratch: &mut Scratch,
        out: &mut [f32],
    ) {
        let normal = [self.axis.to_array(); BLOCK];
        let scene = Scene { lamps: &[self.lamp], blockers };
        for (position, out) in position.chunks(BLOCK).zip(out.chunks_mut(BLOCK)) {
            let mut light = [[0.0; 3]; BLOCK];
            let n = position.len();
            let points = Points { position, normal: &normal[..n] };
            let mut target = Target { light: &mut light[..n], products: None };
            add_irradiance(&points, &scene, options, scratch, &mut target);
            out.iter_mut().zip(&light).for_each(|(out, light)| *out = light[0]);
        }
    }
}
