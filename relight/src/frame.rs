//! One frame: a light projected into an asset's basis, and the irradiance of every vertex.
//!
//! ```
//! # use lunette_relight::{asset::{Asset, Error}, frame::{Frame, Method}, light::Light};
//! # fn relight(bytes: &[u8], light: &Light, out: &mut [[f32; 3]]) -> Result<(), Box<dyn std::error::Error>> {
//! let asset = Asset::from_bytes(bytes)?;
//! let mut frame = Frame::new(&asset, Method::default())?;
//! frame.project(light); // each time the light moves
//! frame.direct(0, out); // all vertices from 0 on, or any slice of them, from any thread
//! frame.add_indirect(0, out);
//! # Ok(())
//! # }
//! ```
//!
//! Direct light comes from the method's own basis; light that has bounced comes from `sky.indirect.sh` with every
//! method, where it is baked. Irradiance is in the unit of the light, without the receiver's albedo: a surface of
//! albedo ρ sends out ρ E / π.

use half::f16;

use crate::aperture::{self, ApertureLight, Apertures, Intersection};
use crate::asset::Asset;
use crate::bent::{self, BentLight};
use crate::dot;
use crate::light::{Cap, Light, SMOOTH_ORDER, Window, project_sh, split, window};
use crate::sh::MAX_COEFFICIENTS;

/// How direct light is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// Ambient occlusion and bent normal.
    Bent,
    /// Ambient aperture.
    Aperture(Intersection),
    /// Spherical harmonics.
    Sh {
        /// Bands used; more than are baked means all of them.
        order: usize,
        /// Against ringing.
        window: Option<Window>,
    },
}

impl Default for Method {
    fn default() -> Self {
        Method::Sh { order: crate::sh::MAX_ORDER, window: None }
    }
}

/// The asset lacks what a method needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Missing {
    /// The tensor.
    pub tensor: &'static str,
    /// What to bake.
    pub basis: &'static str,
}

impl std::fmt::Display for Missing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "the asset has no {}; bake it with --basis {}", self.tensor, self.basis)
    }
}

impl std::error::Error for Missing {}

/// An asset, a method, and the light of the moment. Projecting and evaluating do not allocate (but for the first
/// light of a picture, whose coefficients are kept with the picture).
pub struct Frame<'a> {
    asset: &'a Asset<'a>,
    method: Method,
    ao: Vec<f32>,
    axis: Vec<[f32; 3]>,
    radius: Vec<f32>,
    caps: Vec<Cap>,
    smooth: [[f32; 3]; SMOOTH_ORDER * SMOOTH_ORDER],
    sky: glam::Vec3,
    direct: Projected,
    indirect: Projected,
}

/// Light coefficients times the tensor's scale, and how many of them there are.
#[derive(Clone, Copy)]
struct Projected {
    n: usize,
    light: [[f32; 3]; MAX_COEFFICIENTS],
}

impl<'a> Frame<'a> {
    /// Unpacks what the method needs. The light is dark until [`Frame::project`].
    ///
    /// # Errors
    /// When the asset was baked without it.
    pub fn new(asset: &'a Asset<'a>, method: Method) -> Result<Frame<'a>, Missing> {
        let dark = |name| Projected {
            n: asset.order(name).map_or(0, |n| n * n),
            light: [[0.0; 3]; MAX_COEFFICIENTS],
        };
        let mut frame = Frame {
            asset,
            method,
            ao: Vec::new(),
            axis: Vec::new(),
            radius: Vec::new(),
            caps: Vec::with_capacity(16),
            smooth: [[0.0; 3]; SMOOTH_ORDER * SMOOTH_ORDER],
            sky: glam::Vec3::ZERO,
            direct: dark("sky.direct.sh"),
            indirect: dark("sky.indirect.sh"),
        };
        match method {
            Method::Bent => {
                frame.ao = unpack(asset, "sky.ao", "bent")?;
                frame.axis = triples(&unpack(asset, "sky.bent", "bent")?);
            }
            Method::Aperture(_) => {
                frame.radius = unpack(asset, "sky.aperture", "aperture")?;
                frame.axis = triples(&unpack(asset, "sky.bent", "aperture")?);
                normalise(&mut frame.axis);
            }
            Method::Sh { .. } if frame.direct.n == 0 => {
                return Err(Missing { tensor: "sky.direct.sh", basis: "sh" });
            }
            Method::Sh { .. } => {}
        }
        Ok(frame)
    }

    /// Takes on a light.
    pub fn project(&mut self, light: &Light) {
        match self.method {
            Method::Bent => self.smooth = split(light, &mut self.caps),
            Method::Aperture(_) => self.sky = aperture::simplify(light, glam::Vec3::Y, &mut self.caps),
            Method::Sh { order, window } => {
                let scale = self.asset.metadata.scale("sky.direct.sh");
                self.direct.project(light, order, window, scale);
            }
        }
        if self.indirect.n > 0 {
            let (order, filter) = match self.method {
                Method::Sh { order, window } => (order, window),
                _ => (usize::MAX, None),
            };
            let scale = self.asset.metadata.scale("sky.indirect.sh");
            self.indirect.project(light, order, filter, scale);
        }
    }

    /// Writes the direct irradiance of the vertices from `first` on. May come out a little negative with SH, by
    /// ringing.
    ///
    /// # Panics
    /// When there are not that many vertices.
    pub fn direct(&self, first: usize, out: &mut [[f32; 3]]) {
        let range = first..first + out.len();
        match self.method {
            Method::Bent => {
                let light = BentLight { caps: &self.caps, smooth: &self.smooth };
                bent::irradiance(&self.ao[range.clone()], &self.axis[range], &light, out);
            }
            Method::Aperture(intersection) => {
                let normal = &self.asset.normals()[range.clone()];
                let apertures =
                    Apertures { axis: &self.axis[range.clone()], radius: &self.radius[range], normal };
                let light = ApertureLight { caps: &self.caps, sky: self.sky };
                aperture::irradiance(apertures, &light, intersection, out);
            }
            Method::Sh { .. } => {
                let n = self.direct.n;
                dot::sh(self.rows("sky.direct.sh", first * n, out.len() * n), &self.direct.light[..n], out);
            }
        }
    }

    /// Adds the irradiance of light that has bounced to the vertices from `first` on; nothing where none is baked.
    ///
    /// # Panics
    /// When there are not that many vertices.
    pub fn add_indirect(&self, first: usize, out: &mut [[f32; 3]]) {
        let n = self.indirect.n;
        if n > 0 {
            let rows = self.rows("sky.indirect.sh", first * 3 * n, out.len() * 3 * n);
            dot::sh_rgb_add(rows, &self.indirect.light[..n], out);
        }
    }

    /// All light, over all threads of the current rayon pool.
    ///
    /// # Panics
    /// When `out` is longer than there are vertices.
    #[cfg(feature = "rayon")]
    pub fn irradiance_parallel(&self, out: &mut [[f32; 3]]) {
        use rayon::prelude::*;
        out.par_chunks_mut(dot::ROWS_PER_TASK).enumerate().for_each(|(task, out)| {
            self.direct(task * dot::ROWS_PER_TASK, out);
            self.add_indirect(task * dot::ROWS_PER_TASK, out);
        });
    }

    /// What the method reads per vertex, bytes: direct and bounced light, without the mesh.
    pub fn bytes_per_vertex(&self) -> usize {
        let direct = match self.method {
            Method::Bent | Method::Aperture(_) => 8,
            Method::Sh { order, .. } => 2 * self.direct.n.min(order.saturating_mul(order)),
        };
        direct + 6 * self.indirect.n
    }

    fn rows(&self, name: &str, from: usize, count: usize) -> &[f16] {
        self.asset.half(name).map_or(&[], |(values, _)| &values[from..from + count])
    }
}

impl Projected {
    fn project(&mut self, light: &Light, order: usize, filter: Option<Window>, scale: f32) {
        let order = order.min(self.n.isqrt());
        self.light = [[0.0; 3]; MAX_COEFFICIENTS];
        project_sh(light, order, &mut self.light);
        if let Some(filter) = filter {
            window(order, filter, &mut self.light[..order * order]);
        }
        for l in self.light.as_flattened_mut() {
            *l *= scale;
        }
    }
}

fn unpack(asset: &Asset, tensor: &'static str, basis: &'static str) -> Result<Vec<f32>, Missing> {
    let (values, scale) = asset.half(tensor).ok_or(Missing { tensor, basis })?;
    Ok(values.iter().map(|v| v.to_f32() * scale).collect())
}

fn triples(flat: &[f32]) -> Vec<[f32; 3]> {
    flat.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

/// f16 leaves a unit vector up to 4e-4 short or long, enough to matter for a sun of 5e-3 radians.
fn normalise(axes: &mut [[f32; 3]]) {
    for axis in axes {
        *axis = glam::Vec3::from(*axis).normalize_or_zero().to_array();
    }
}
