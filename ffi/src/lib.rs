//! Embree 4, opened at run time: a small, safe wrapper for tracing triangles.
//!
//! Nothing of Embree is needed to compile or link this crate. [`Device::new`] looks for
//! the library where `LUNETTE_EMBREE` says, then in the system, then in the workspace's
//! `.embree/`, and says in one line what to do where there is none.
//!
//! ```
//! use lunette_ffi::{Device, Ray, SceneBuilder};
//!
//! # fn main() -> Result<(), lunette_ffi::Error> {
//! let device = Device::new()?;
//! let mut scene = SceneBuilder::new(&device)?;
//! scene.add_triangles(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], &[[0, 1, 2]])?;
//! let scene = scene.commit()?;
//!
//! let hit = scene.intersect(&Ray::new([0.2, 0.2, 1.0], [0.0, 0.0, -1.0]));
//! assert!(hit.is_some_and(|hit| (hit.t - 1.0).abs() < 1e-6)); // processors divide by reciprocals that differ
//! # Ok(())
//! # }
//! ```
//!
//! Based on: Wald et al., Embree: a kernel framework for efficient CPU ray tracing, 2014,
//! and the Embree 4 API documentation.
//!
//! Limits: triangles and one level of instances only. A ray's numbers are not checked:
//! one that holds a NaN, or has no direction, hits nothing or anything, but harms nothing.
//! Among hits at exactly equal distance, which one is found is not defined.

#![allow(unsafe_code, reason = "the one crate that calls C; every block says why it may")]

mod device;
mod error;
mod float;
mod geometry;
mod library;
mod packet;
mod probe;
mod raw;
mod scene;

pub use device::Device;
pub use error::Error;
pub use float::flush_to_zero;
pub use packet::{Hit, Hits, Mask, NO_HIT, Packet, Ray};
pub use scene::{Lanes, MAX_COORDINATE, Scene, SceneBuilder, Transform, Width};
