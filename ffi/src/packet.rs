//! Rays and hits, single and as packets of 8 or 16.
//!
//! A ray is the set of points origin + t direction with tnear <= t <= tfar. The
//! direction need not be a unit vector; t counts in its lengths. A hit point is
//! (1 - u - v) p0 + u p1 + v p2 for a triangle (p0, p1, p2).
//!
//! Packets are structures of arrays, 64-byte aligned, in Embree's own layout, so that
//! they go to it as they are. A lane whose mask is off is neither read nor written.

use crate::raw;

/// What [`Hits::geometry`] holds in a lane that hit nothing.
pub const NO_HIT: u32 = raw::INVALID_GEOMETRY_ID;

/// One ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where t = 0, in metres.
    pub origin: [f32; 3],
    /// Least t of a hit; at least 0.
    pub tnear: f32,
    /// Any finite length but 0.
    pub direction: [f32; 3],
    /// Greatest t of a hit; `f32::INFINITY` for an endless ray. Under `tnear`, the ray
    /// is empty and hits nothing.
    pub tfar: f32,
}

impl Ray {
    /// An endless ray: tnear = 0, tfar = infinity.
    pub fn new(origin: [f32; 3], direction: [f32; 3]) -> Ray {
        Ray { origin, tnear: 0.0, direction, tfar: f32::INFINITY }
    }
}

/// Where a ray met a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in lengths of its direction.
    pub t: f32,
    /// Weight of the triangle's second vertex, 0..=1.
    pub u: f32,
    /// Weight of the triangle's third vertex, 0..=1, with u + v <= 1.
    pub v: f32,
    /// Geometric normal (p1 - p0) x (p2 - p0) in world space: not normalised, twice the
    /// triangle's area long, on the side from which p0, p1, p2 run counter-clockwise. It
    /// does not turn towards the ray.
    pub normal: [f32; 3],
    /// Which triangle of the mesh.
    pub primitive: u32,
    /// Which mesh: the number that `add_triangles` returned, in the instanced scene where
    /// an instance was hit.
    pub geometry: u32,
    /// Which instance, where one was hit: the number that `add_instance` returned.
    pub instance: Option<u32>,
}

/// Which lanes of a packet take part.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mask<const N: usize> {
    /// Embree's convention: -1 is on, 0 is off. Private, as anything else is undefined.
    lanes: [i32; N],
}

impl<const N: usize> Mask<N> {
    /// Every lane on.
    pub fn all() -> Self {
        Mask { lanes: [-1; N] }
    }

    /// The first `n_lanes` on, the rest off.
    pub fn first(n_lanes: usize) -> Self {
        Mask::from_fn(|lane| lane < n_lanes)
    }

    /// The lanes for which `is_on` says so.
    pub fn from_fn(is_on: impl Fn(usize) -> bool) -> Self {
        Mask { lanes: std::array::from_fn(|lane| -i32::from(is_on(lane))) }
    }

    /// Whether a lane is on.
    ///
    /// # Panics
    /// If `lane` is not under `N`.
    pub fn is_on(&self, lane: usize) -> bool {
        self.lanes[lane] != 0
    }

    pub(crate) fn as_ptr(&self) -> *const i32 {
        self.lanes.as_ptr()
    }
}

/// `N` rays (8 or 16), each array one lane a ray; the layout of `RTCRay8`, `RTCRay16`.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct Packet<const N: usize> {
    /// Origins, x.
    pub origin_x: [f32; N],
    /// Origins, y.
    pub origin_y: [f32; N],
    /// Origins, z.
    pub origin_z: [f32; N],
    /// Least t of a hit; at least 0.
    pub tnear: [f32; N],
    /// Directions, x.
    pub direction_x: [f32; N],
    /// Directions, y.
    pub direction_y: [f32; N],
    /// Directions, z.
    pub direction_z: [f32; N],
    time: [f32; N],
    /// Greatest t of a hit. A query writes it: the hit's t where the closest hit was
    /// asked for, -infinity where occlusion was asked for and there is some.
    pub tfar: [f32; N],
    mask: [u32; N],
    id: [u32; N],
    flags: [u32; N],
}

impl<const N: usize> Default for Packet<N> {
    /// Rays from the world's origin with no direction and an empty range: they hit nothing.
    fn default() -> Self {
        let zero = [0.0; N];
        Packet {
            origin_x: zero,
            origin_y: zero,
            origin_z: zero,
            tnear: zero,
            direction_x: zero,
            direction_y: zero,
            direction_z: zero,
            time: zero,
            tfar: [-1.0; N],
            // Every geometry has the ray mask -1, so that all bits on means all geometry.
            mask: [u32::MAX; N],
            id: [0; N],
            flags: [0; N],
        }
    }
}

impl<const N: usize> Packet<N> {
    /// Puts one ray into a lane.
    ///
    /// # Panics
    /// If `lane` is not under `N`.
    #[inline]
    pub fn set(&mut self, lane: usize, ray: &Ray) {
        [self.origin_x[lane], self.origin_y[lane], self.origin_z[lane]] = ray.origin;
        [self.direction_x[lane], self.direction_y[lane], self.direction_z[lane]] = ray.direction;
        self.tnear[lane] = ray.tnear;
        self.tfar[lane] = ray.tfar;
    }

    /// Whether an occlusion query found something in this lane.
    ///
    /// # Panics
    /// If `lane` is not under `N`.
    #[inline]
    pub fn is_occluded(&self, lane: usize) -> bool {
        self.tfar[lane] == f32::NEG_INFINITY
    }
}

/// What `N` rays hit; the layout of `RTCHit8`, `RTCHit16`. The fields mean what those of
/// [`Hit`] mean; t is in [`Packet::tfar`].
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct Hits<const N: usize> {
    /// Geometric normals, x.
    pub normal_x: [f32; N],
    /// Geometric normals, y.
    pub normal_y: [f32; N],
    /// Geometric normals, z.
    pub normal_z: [f32; N],
    /// Weights of the triangles' second vertices.
    pub u: [f32; N],
    /// Weights of the triangles' third vertices.
    pub v: [f32; N],
    /// Triangles.
    pub primitive: [u32; N],
    /// Meshes; [`NO_HIT`] where nothing was hit. The lane's other fields then hold
    /// nothing of use.
    pub geometry: [u32; N],
    /// Instances; [`NO_HIT`] where none was hit.
    pub instance: [u32; N],
    /// Written by libraries from 4.3 on; see [`raw::Hit`].
    instance_primitive: [u32; N],
}

impl<const N: usize> Default for Hits<N> {
    /// No hit in any lane.
    fn default() -> Self {
        let (zero, none) = ([0.0; N], [NO_HIT; N]);
        Hits {
            normal_x: zero,
            normal_y: zero,
            normal_z: zero,
            u: zero,
            v: zero,
            primitive: none,
            geometry: none,
            instance: none,
            instance_primitive: none,
        }
    }
}

impl<const N: usize> Hits<N> {
    /// The hit of one lane, if there is one; `rays` is the packet that was traced.
    ///
    /// # Panics
    /// If `lane` is not under `N`.
    pub fn get(&self, rays: &Packet<N>, lane: usize) -> Option<Hit> {
        (self.geometry[lane] != NO_HIT).then(|| Hit {
            t: rays.tfar[lane],
            u: self.u[lane],
            v: self.v[lane],
            normal: [self.normal_x[lane], self.normal_y[lane], self.normal_z[lane]],
            primitive: self.primitive[lane],
            geometry: self.geometry[lane],
            instance: Some(self.instance[lane]).filter(|&instance| instance != NO_HIT),
        })
    }
}

/// Rays and hits as Embree wants them for a closest-hit query: `RTCRayHit8`, `RTCRayHit16`.
#[repr(C)]
pub(crate) struct RayHits<const N: usize> {
    pub rays: Packet<N>,
    pub hits: Hits<N>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::mem::{align_of, offset_of, size_of};

    /// `RTCRayN` is twelve arrays and `RTCHitN` begins right after it, with seven arrays
    /// before the instance's: the header's accessors say so.
    fn check_layout<const N: usize>() {
        assert_eq!(size_of::<Packet<N>>(), 12 * 4 * N);
        assert_eq!(align_of::<Packet<N>>(), 64);
        assert_eq!(offset_of!(Packet<N>, tnear), 3 * 4 * N);
        assert_eq!(offset_of!(Packet<N>, tfar), 8 * 4 * N);
        assert_eq!(offset_of!(Packet<N>, mask), 9 * 4 * N);
        assert_eq!(offset_of!(RayHits<N>, hits), 12 * 4 * N);
        assert_eq!(offset_of!(Hits<N>, u), 3 * 4 * N);
        assert_eq!(offset_of!(Hits<N>, geometry), 6 * 4 * N);
        assert_eq!(offset_of!(Hits<N>, instance), 7 * 4 * N);
        assert!(size_of::<Hits<N>>() >= 9 * 4 * N);
    }

    #[test]
    fn packet_layout_matches_embree_headers() {
        check_layout::<8>();
        check_layout::<16>();
    }

    #[test]
    fn mask_turns_on_what_was_asked() {
        let mask = Mask::<8>::first(3);
        assert_eq!(
            std::array::from_fn(|lane| mask.is_on(lane)),
            [true, true, true, false, false, false, false, false]
        );
        assert_eq!(Mask::<16>::first(99), Mask::all());
        assert_eq!(Mask::<8>::from_fn(|lane| lane == 2).lanes, [0, 0, -1, 0, 0, 0, 0, 0]);
    }
}
