//! Judging and looking: camera images of a relit scene, the path-traced reference, error measures, image files.
//!
//! The reference shares no integrator with the baker that it judges: it has its own sampling, its own ray offsets and
//! its own paths. Common to both are only Embree's ray queries and the definition of the light,
//! [`Light::radiance`](lunette_relight::light::Light::radiance).
//!
//! The parts, in the order in which a comparison uses them:
//!
//! 1. [`Tracer`]: a surface, ready for rays; [`Camera`] where to look from.
//! 2. [`Visibility`]: what each pixel sees; shading it with per-vertex radiance makes an [`Image`], again and again
//!    for a moving sun without another ray.
//! 3. [`reference_irradiance`] and [`reference_image`]: the truth by path tracing, with its standard error.
//! 4. [`difference`], [`noise`], [`error_picture`]: how far the one is from the other.
//! 5. [`capture`]: the light outside a portal as a shell, each frame, with an [`Exterior`] that moves.
//! 6. [`write_png`], [`write_exr`], [`read_light`]: files.

mod camera;
mod capture;
mod error;
mod exterior;
mod false_colour;
mod font;
mod framing;
mod image;
mod image_file;
mod measure;
mod outline;
mod props;
mod reference;
mod showing;
mod tracer;
mod visibility;

pub use camera::Camera;
pub use capture::{Backdrop, capture, seen_discs};
pub use error::Error;
pub use exterior::{Exterior, Overlap, Pose, Track};
pub use false_colour::{NARROWEST, Scale, count_picture, error_picture, viridis};
pub use framing::frame;
pub use image::{Exposure, Image, KNEE, Picture, auto_exposure, luminance, tone_map};
pub use image_file::{read_image, read_light, write_atomically, write_exr, write_png};
pub use measure::{Difference, NOISE_MARGIN, difference, element_errors, may_judge, noise};
pub use outline::draw_outlines;
pub use props::Props;
pub use reference::{
    N_BATCHES, Reference, ReferenceImage, ReferenceOptions, reference_image, reference_irradiance,
};
pub use showing::{Shown, show_portals};
pub use tracer::{Gloss, Surface, Tracer};
pub use visibility::{Through, Visibility, trace, vertex_radiance};
