//! What is lit: meshes, materials, loaders and the built-in scenes.
//!
//! Everything leaves this crate right-handed, Y up, in metres and linear Rec.709.
//! There is no ray tracing here.
//!
//! ```
//! let mut scene = lunette_scenes::load("sphere-on-plane", &lunette_scenes::LoadOptions::default())?;
//! lunette_scenes::subdivide(&mut scene, 0.5)?;
//! for line in &scene.report {
//!     eprintln!("{line}");
//! }
//! # Ok::<(), lunette_scenes::Error>(())
//! ```

pub mod builtin;
mod gloss;
mod lines;
mod mtl;
mod names;
mod normals;
mod obj;
mod open;
mod ply;
mod polygon;
mod portal;
mod repair;
mod scene;
mod subdivide;
mod terrain;
mod tidy;
mod write_obj;

pub use gloss::Lobe;
pub use open::{LoadOptions, Up, load};
pub use portal::{
    MOST_THROWN_BACK, Portal, SIDECAR_FORMAT, SIDECAR_VERSION, Split, read_portals, sidecar_path,
    split_portals, take_portals, thrown_back, unglaze, without_doubled, write_portals,
};
pub use scene::{Error, Material, Mesh, Scene};
pub use subdivide::{MAX_TRIANGLES, cut_edges, subdivide};
pub use write_obj::write_obj;
