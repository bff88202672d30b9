//! The Lunette run time: open a baked asset, project a light, take dot products.
//!
//! This is the part that a game engine or a viewer embeds. It knows no ray tracer, no image codec and no file
//! system: an asset is a byte slice (read or memory-mapped by the caller), results go into the caller's
//! buffers, and relighting a frame does not allocate. `rayon` is used only with the feature of that name.

pub mod aperture;
pub mod asset;
pub mod bent;
pub mod block;
pub mod cap;
pub mod cubemap;
pub mod dot;
pub mod frame;
pub mod glossy;
pub mod haar;
pub mod indirect;
pub mod light;
pub mod lobe;
pub mod portal_frame;
pub mod sh;
pub mod shell;
pub mod sparse;
