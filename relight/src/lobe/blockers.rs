//! What casts shadows: sets of spheres that move as rigid bodies.
//!
//! A set is sorted once, so that eight spheres that follow each other lie close together. A frame's blockers
//! keep them in eights, each with a sphere around it, and each set with a sphere around all: a point in the
//! light rejects a whole body with one test, and tests eight spheres at a time where it cannot.

use glam::{Quat, Vec3};

use super::Error;

/// Spheres that are tested together: the lanes of a 256-bit vector.
pub(super) const LANES: usize = 8;

/// A ball of matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Metres.
    pub centre: Vec3,
    /// Metres, above 0.
    pub radius: f32,
}

/// A body made of spheres, at rest. Spheres may overlap and contain each other.
#[derive(Clone, Debug, PartialEq)]
pub struct SphereSet {
    spheres: Vec<Sphere>,
    bound: Sphere,
}

impl SphereSet {
    /// Spheres in one set; a frame of this many takes minutes, so more is a mistake.
    pub const MAX_SPHERES: usize = 1 << 20;

    /// Sorts the spheres so that neighbours lie close together.
    ///
    /// # Errors
    /// When there is none or too many, a radius is not above 0, or a number is not finite.
    pub fn new(mut spheres: Vec<Sphere>) -> Result<SphereSet, Error> {
        if spheres.is_empty() {
            return Err(Error::NoSphere);
        }
        if spheres.len() > Self::MAX_SPHERES {
            return Err(Error::TooManySpheres(spheres.len()));
        }
        for sphere in &spheres {
            if !(sphere.radius > 0.0 && sphere.radius.is_finite()) {
                return Err(Error::Radius(sphere.radius));
            }
            if !sphere.centre.is_finite() {
                return Err(Error::NotANumber("sphere's centre"));
            }
        }
        sort_into_eights(&mut spheres);
        let bound = around(&spheres);
        Ok(SphereSet { spheres, bound })
    }

    /// The spheres, sorted.
    pub fn spheres(&self) -> &[Sphere] {
        &self.spheres
    }

    /// A sphere around all of them, not the smallest.
    pub fn bound(&self) -> Sphere {
        self.bound
    }
}

/// Splits at the median of the longest axis until eight or fewer are left.
fn sort_into_eights(spheres: &mut [Sphere]) {
    if spheres.len() <= LANES {
        return;
    }
    let low = spheres.iter().fold(Vec3::INFINITY, |low, s| low.min(s.centre));
    let high = spheres.iter().fold(Vec3::NEG_INFINITY, |high, s| high.max(s.centre));
    let axis = (high - low).max_position();
    let middle = (spheres.len() / 2).next_multiple_of(LANES);
    spheres.select_nth_unstable_by(middle.min(spheres.len() - 1), |a, b| {
        a.centre[axis].total_cmp(&b.centre[axis])
    });
    let (left, right) = spheres.split_at_mut(middle.min(spheres.len() - 1));
    sort_into_eights(left);
    sort_into_eights(right);
}

/// A sphere around spheres: the centre of their box, and as far as the farthest reaches.
fn around(spheres: &[Sphere]) -> Sphere {
    let low = spheres.iter().fold(Vec3::INFINITY, |low, s| low.min(s.centre - s.radius));
    let high = spheres.iter().fold(Vec3::NEG_INFINITY, |high, s| high.max(s.centre + s.radius));
    let centre = 0.5 * low + 0.5 * high;
    let reach = |s: &Sphere| s.centre.distance(centre) + s.radius;
    // A little more, for the rounding of the motion to come.
    let radius = 1.000_01 * spheres.iter().map(reach).fold(0.0, f32::max);
    Sphere { centre, radius }
}

/// Turns about the origin of the set, then moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Of unit length.
    pub rotation: Quat,
    /// Metres.
    pub translation: Vec3,
}

impl Default for Motion {
    fn default() -> Self {
        Motion { rotation: Quat::IDENTITY, translation: Vec3::ZERO }
    }
}

/// Eight spheres of one body. Empty places repeat the last sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eight {
    pub bound: Sphere,
    pub x: [f32; LANES],
    pub y: [f32; LANES],
    pub z: [f32; LANES],
    pub radius: [f32; LANES],
}

impl Eight {
    pub fn sphere(&self, lane: usize) -> Sphere {
        Sphere { centre: Vec3::new(self.x[lane], self.y[lane], self.z[lane]), radius: self.radius[lane] }
    }
}

/// One body in the world: its bound, and where its eights lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    pub bound: Sphere,
    pub first: usize,
    pub end: usize,
}

/// The bodies of one frame, where they are now. Shared by all threads; cleared and filled anew every frame
/// without allocating, once it has held as many.
#[derive(Clone, Debug, Default)]
pub struct Blockers {
    pub(super) bodies: Vec<Body>,
    pub(super) eights: Vec<Eight>,
}

impl Blockers {
    /// Takes all bodies away and keeps the memory.
    pub fn clear(&mut self) {
        self.bodies.clear();
        self.eights.clear();
    }

    /// Adds a body.
    pub fn push(&mut self, set: &SphereSet, motion: &Motion) {
        let first = self.eights.len();
        self.eights.extend(set.spheres.chunks(LANES).map(|chunk| eight(chunk, motion)));
        let bound = moved(&set.bound, motion);
        self.bodies.push(Body { bound, first, end: self.eights.len() });
    }

    /// Whether there is no body.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }
}

fn moved(sphere: &Sphere, motion: &Motion) -> Sphere {
    Sphere { centre: motion.rotation * sphere.centre + motion.translation, radius: sphere.radius }
}

fn eight(chunk: &[Sphere], motion: &Motion) -> Eight {
    let mut spheres = [moved(&chunk[chunk.len() - 1], motion); LANES];
    for (place, sphere) in spheres.iter_mut().zip(chunk) {
        *place = moved(sphere, motion);
    }
    Eight {
        bound: around(&spheres),
        x: spheres.map(|s| s.centre.x),
        y: spheres.map(|s| s.centre.y),
        z: spheres.map(|s| s.centre.z),
        radius: spheres.map(|s| s.radius),
    }
}
