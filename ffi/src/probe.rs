//! A check, before first use, that a library lays its structures out as [`crate::raw`] does.
//!
//! Embree has build options that change its interface without a trace in the version:
//! more than one instance level makes `RTCHit` longer than this crate's, and without ray
//! packets the packet queries only set an error. One instanced triangle, hit once with
//! each query, shows both.

use std::sync::Arc;

use crate::device::Device;
use crate::error::Error;
use crate::packet::{Hits, Mask, Packet, Ray};
use crate::raw;
use crate::scene::{self, Lanes, Scene, SceneBuilder, Width};

/// Fills the room after the hit, to see whether the library writes there.
const UNTOUCHED: u32 = 0x5eed_5eed;

/// More room than any build's hit takes: eight instance levels of two words.
#[repr(C, align(16))]
struct RoomyQuery {
    query: raw::RayHit,
    room: [u32; 16],
}

/// # Errors
/// [`Error::UnsupportedBuild`], or what building the two small scenes may give.
pub(crate) fn check(device: &Device) -> Result<(), Error> {
    let scene = instanced_triangle(device)?;
    let fail = |reason| Err(Error::UnsupportedBuild { path: device.library().to_owned(), reason });
    if !hit_has_known_layout(&scene) {
        return fail("it has more than one instance level");
    }
    if !packet_hits::<8>(&scene) || !packet_hits::<16>(&scene) {
        return fail("it has no ray packets");
    }
    device.check("trace a ray")
}

/// Geometry 1 of the instanced scene, shown by instance 2, so that no number that should
/// come back is the zero of untouched memory or another's.
fn instanced_triangle(device: &Device) -> Result<Scene, Error> {
    let triangle = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    let behind = triangle.map(|[x, y, _]| [x, y, -9.0]);
    let mut inner = SceneBuilder::new(device)?;
    inner.add_triangles(&behind, &[[0, 1, 2]])?;
    inner.add_triangles(&triangle, &[[0, 1, 2]])?;
    let inner = Arc::new(inner.commit()?);

    let moved = |x| [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let mut outer = SceneBuilder::new(device)?;
    for x in [-8.0, 8.0, 0.0] {
        outer.add_instance(&inner, moved(x))?;
    }
    outer.commit()
}

fn down_the_axis() -> Ray {
    Ray::new([0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
}

fn hit_has_known_layout(scene: &Scene) -> bool {
    let query = scene::single_query(&down_the_axis());
    let mut roomy = RoomyQuery { query, room: [UNTOUCHED; 16] };
    // SAFETY: a RoomyQuery begins with an RTCRayHit and has room after it for the longest
    // hit that any build option makes.
    unsafe { scene.intersect_raw(std::ptr::from_mut(&mut roomy).cast()) };
    let hit = roomy.query.hit;
    (hit.geometry, hit.primitive, hit.instance) == (1, 0, 2) && roomy.room == [UNTOUCHED; 16]
}

fn packet_hits<const N: usize>(scene: &Scene) -> bool
where
    Lanes<N>: Width,
{
    let (mut rays, mut hits) = (Packet::<N>::default(), Hits::default());
    rays.set(N - 1, &down_the_axis());
    scene.intersect_packet(&Mask::all(), &mut rays, &mut hits);
    let hit = hits.get(&rays, N - 1).map(|hit| (hit.geometry, hit.primitive, hit.instance));

    rays.set(N - 1, &down_the_axis());
    scene.occluded_packet(&Mask::all(), &mut rays);
    hit == Some((1, 0, Some(2)))
        && hits.get(&rays, 0).is_none()
        && rays.is_occluded(N - 1)
        && !rays.is_occluded(0)
}
