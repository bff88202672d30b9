//! The estimators: a scene and options in, a baked [`Asset`] out.
//!
//! One pass of rays over the hemisphere of every vertex gives ambient occlusion, bent normal, aperture and
//! shadowed SH transfer together; further passes give the transfer of light that has bounced. The same scene,
//! options and seed give the same bytes, whatever the number of threads.

mod buried;
mod carrier;
mod energy;
mod error;
mod fill;
mod gather;
mod glossy;
pub mod openings;
mod options;
mod photon;
mod portal;
mod progress;
mod refine;
mod rows;
mod sampling;
mod sky;
mod smooth;
mod spheres;
mod surface;

use lunette_relight::asset::Asset;
use lunette_scenes::Scene;

pub use buried::inside_others;
pub use error::Error;
pub use options::{Basis, Options};
pub use portal::{Gates, PortalOptions, PortalReport, Start, bake_portals, continue_portals};
pub use progress::{Progress, Silent};
pub use refine::refine;
pub use sampling::{Directions, Frame, HemisphereSets, LANES};
pub use sky::mesh_asset;
pub use spheres::{SphereError, SphereFit, SphereOptions, fit_spheres};
pub use surface::Surface;

/// Bakes a scene. Memory grows with V (n² + 9 m²) for n bands of direct and m of bounced light.
///
/// # Errors
/// When an option is out of range, Embree cannot be had, the scene has no triangle, or `progress` asks to stop.
pub fn bake(scene: &Scene, options: &Options, progress: &dyn Progress) -> Result<Asset<'static>, Error> {
    options.check()?;
    if scene.mesh.index.is_empty() {
        return Err(Error::EmptyScene);
    }
    pool(options.threads)?.install(|| {
        let surface = Surface::new(scene)?;
        sky::bake(scene, &surface, options, progress)
    })
}

/// Tracing threads with denormals flushed to zero, as Embree asks; 0 means one for each core.
fn pool(threads: usize) -> Result<rayon::ThreadPool, Error> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .start_handler(|_| lunette_ffi::flush_to_zero())
        .build()
        .map_err(|e| Error::Threads(e.to_string()))
}
