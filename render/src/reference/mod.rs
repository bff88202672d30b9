//! The truth, by path tracing.
//!
//! Surfaces are opaque, two-sided, and Lambertian or Phong; emission is not part of a relit light and is left out.
//! Light falls in from infinitely far away; there is no transmission, so that panes of glass must not be among the
//! triangles. A path meets surfaces with their geometric normals; only its first point has a normal
//! of its own: the given one for [`reference_irradiance`], the interpolated shading normal for [`reference_image`], as
//! light baked per vertex has vertex normals too. A picture shows the side that the camera sees.
//!
//! Samples come in [`N_BATCHES`] independent stratified sets per element; the standard error is that of the mean of
//! the batches' means, and thus itself uncertain by a sixth. Results depend on the seed alone, not on the number of
//! threads.
//!
//! It breaks, slowly, where light enters through a small hole: paths find it by chance, unless the hole was named
//! with [`Tracer::with_portals`].

use crate::camera::Camera;
use crate::error::Error;
use crate::image::Image;
use crate::tracer::Tracer;
use crate::visibility::for_each_tile;
use glam::Vec3;
use lunette_relight::light::Light;
use path::{Draw, Gathered, Place, World, gather};
use rayon::prelude::*;
use scatter::Scatter;

pub(crate) mod aim;
pub(crate) mod hash;
pub(crate) mod panes;
pub(crate) mod path;
pub(crate) mod scatter;
mod table;

/// How long to trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReferenceOptions {
    /// Paths per point or pixel, at least 2; rounded up to a multiple of [`N_BATCHES`] (of fewer batches under twice
    /// that). Four times as many halve the noise, or better.
    pub samples: u32,
    /// Most surfaces that light may have bounced off before it arrives; 0 for direct light only.
    pub bounces: u32,
    /// Another seed is other noise.
    pub seed: u32,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        ReferenceOptions { samples: 256, bounces: 8, seed: 1 }
    }
}

/// Independent sets of samples from which the standard error is computed.
pub const N_BATCHES: u32 = 16;

/// Irradiance at oriented points, without their own albedo.
#[derive(Clone, Debug, Default)]
pub struct Reference {
    /// Straight from the light, \[K\].
    pub direct: Vec<Vec3>,
    /// By way of other surfaces, \[K\].
    pub indirect: Vec<Vec3>,
    /// Standard error of the sum of both, \[K\].
    pub error: Vec<Vec3>,
    /// Standard error of the direct part, \[K\].
    pub direct_error: Vec<Vec3>,
    /// Standard error of the indirect part, \[K\].
    pub indirect_error: Vec<Vec3>,
}

impl Reference {
    /// Direct and indirect irradiance together, \[K\].
    pub fn total(&self) -> Vec<Vec3> {
        self.direct.iter().zip(&self.indirect).map(|(d, i)| d + i).collect()
    }
}

/// A path-traced picture and its standard error.
#[derive(Clone, Debug, Default)]
pub struct ReferenceImage {
    /// Radiance.
    pub image: Image,
    /// The part of it that comes straight from the light, to the eye or by way of one surface.
    pub direct: Image,
    /// Standard error of each pixel.
    pub error: Image,
}

/// Irradiance at points of the surface with unit normals, e.g. its vertices. `done` is called with the number of
/// points that have just been finished, from any thread.
///
/// # Errors
/// [`Error::Options`] for fewer than 2 samples, or arrays of different lengths.
pub fn reference_irradiance(
    tracer: &Tracer,
    light: &Light,
    points: &[Vec3],
    normals: &[Vec3],
    options: &ReferenceOptions,
    done: impl Fn(usize) + Sync,
) -> Result<Reference, Error> {
    if points.len() != normals.len() {
        let what = format!("reference: {} points with {} normals", points.len(), normals.len());
        return Err(Error::Options { what });
    }
    let plan = Plan::new(options)?;
    let aims = aim::aims(light);
    let world = World { tracer, light, aims: &aims, bounces: options.bounces };

    let at_point = |i: usize| {
        let origin = tracer.lift(points[i], normals[i]);
        let place = || Place { origin, n: normals[i], scatter: Scatter::RECEIVER };
        plan.average(i as u32, |draw| gather(&world, place(), draw))
    };
    let chunks: Vec<Vec<Average>> = (0..points.len().div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            lunette_ffi::flush_to_zero();
            let range = chunk * CHUNK..points.len().min((chunk + 1) * CHUNK);
            let n_points = range.len();
            let averages = range.map(at_point).collect();
            done(n_points);
            averages
        })
        .collect();

    let averages: Vec<Average> = chunks.into_iter().flatten().collect();
    Ok(Reference {
        direct: averages.iter().map(|a| a.mean.direct).collect(),
        indirect: averages.iter().map(|a| a.mean.indirect).collect(),
        error: averages.iter().map(|a| a.error).collect(),
        direct_error: averages.iter().map(|a| a.direct_error).collect(),
        indirect_error: averages.iter().map(|a| a.indirect_error).collect(),
    })
}

/// Points that one thread takes at a time.
const CHUNK: usize = 32;

/// A picture of `width` x `height` pixels, box filtered. `done` is called with the number of pixels that have just been
/// finished, from any thread.
///
/// # Errors
/// [`Error::Options`] for fewer than 2 samples, a camera without direction or a picture without pixels.
pub fn reference_image(
    tracer: &Tracer,
    light: &Light,
    camera: &Camera,
    (width, height): (usize, usize),
    options: &ReferenceOptions,
    done: impl Fn(usize) + Sync,
) -> Result<ReferenceImage, Error> {
    let plan = Plan::new(options)?;
    let view = camera.view(width, height)?;
    let aims = aim::aims(light);
    let world = World { tracer, light, aims: &aims, bounces: options.bounces };

    let pixels = for_each_tile(width, height, |x, y| {
        let sample = |draw: Draw| {
            let place = draw.point(PIXEL_DIMENSION);
            let direction = view.direction(x as f32 + place.x, y as f32 + place.y);
            seen_radiance(&world, view.eye, direction, draw)
        };
        let average = plan.average((y * width + x) as u32, sample);
        done(1);
        average
    });
    let picture =
        |value: fn(&Average) -> Vec3| Image { width, height, pixels: pixels.iter().map(value).collect() };
    Ok(ReferenceImage {
        image: picture(|a| a.mean.direct + a.mean.indirect),
        direct: picture(|a| a.mean.direct),
        error: picture(|a| a.error),
    })
}

/// The dimension of a pixel's sample that no path uses.
const PIXEL_DIMENSION: u32 = u32::MAX;

/// Radiance that a camera ray sees.
fn seen_radiance(world: &World, eye: Vec3, direction: Vec3, draw: Draw) -> Gathered {
    match world.tracer.first_contact(eye, direction) {
        None => Gathered { direct: world.light.radiance(direction), indirect: Vec3::ZERO },
        Some(contact) => {
            let normal = world.tracer.shading_normal(&contact);
            gather(world, world.tracer.place(&contact, normal, direction), draw)
        }
    }
}

/// How samples are split into batches.
struct Plan {
    n_batches: u32,
    per_batch: u32,
    seed: u32,
}

/// A mean over batches, and the standard errors of it, of its direct and of its indirect part.
#[derive(Clone, Copy, Default)]
struct Average {
    mean: Gathered,
    error: Vec3,
    direct_error: Vec3,
    indirect_error: Vec3,
}

impl Plan {
    fn new(options: &ReferenceOptions) -> Result<Plan, Error> {
        if options.samples < 2 {
            let what =
                format!("reference: {} samples, needs at least 2 to know its own error", options.samples);
            return Err(Error::Options { what });
        }
        let n_batches = (options.samples / 2).clamp(2, N_BATCHES);
        Ok(Plan { n_batches, per_batch: options.samples.div_ceil(n_batches), seed: options.seed })
    }

    /// Average of an element's samples.
    fn average(&self, element: u32, sample: impl Fn(Draw) -> Gathered) -> Average {
        let [mut direct, mut indirect, mut total] = [Welford::default(); 3];
        for batch in 0..self.n_batches {
            let set = hash::mix([self.seed, element, batch]);
            let mut sum = Gathered::default();
            for index in 0..self.per_batch {
                let gathered = sample(Draw { index, n: self.per_batch, set });
                sum.direct += gathered.direct;
                sum.indirect += gathered.indirect;
            }
            let per_sample = 1.0 / self.per_batch as f32;
            direct.add(sum.direct * per_sample);
            indirect.add(sum.indirect * per_sample);
            total.add((sum.direct + sum.indirect) * per_sample);
        }
        Average {
            mean: Gathered { direct: direct.mean, indirect: indirect.mean },
            error: total.error(),
            direct_error: direct.error(),
            indirect_error: indirect.error(),
        }
    }
}

/// A running mean and squares: no cancellation where the noise is small.
#[derive(Clone, Copy, Default)]
struct Welford {
    n: f32,
    mean: Vec3,
    squares: Vec3,
}

impl Welford {
    fn add(&mut self, value: Vec3) {
        self.n += 1.0;
        let step = value - self.mean;
        self.mean += step / self.n;
        self.squares += step * (value - self.mean);
    }

    /// Standard error of the mean.
    fn error(&self) -> Vec3 {
        (self.squares / (self.n * (self.n - 1.0))).max(Vec3::ZERO).map(f32::sqrt)
    }
}

#[cfg(test)]
mod interior_tests;
#[cfg(test)]
pub(crate) mod test_scenes;
#[cfg(test)]
mod tests;
