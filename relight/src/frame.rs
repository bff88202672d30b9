//! One frame: a light projected into an asset's basis, and the irradiance of every vertex.
//!
//! ```
//! # use lunette_relight::{asset::{Asset, Error}, frame::{Frame, Method}, light::Light};
//! # fn relight(bytes: &[u8], light: &Light, out: &mut [[f32; 3]]) -> Result<(), Box<dyn std::error::Error>> {
//! let asset = Asset::from_bytes(bytes)?;
//! let mut frame = Frame::new(&asset, Method::default())?;
//! frame.project(light); // each time the light moves
//! frame.direct(0, out); // all vertices from 0 on, or any slice of them, from any thread
//! frame.reflect(out); // does something only where bounced light is carried from direct light
//! frame.add_indirect(0, out);
//! # Ok(())
//! # }
//! ```
//!
//! Direct light comes from the method's own basis; light that has bounced comes with every method from
//! `sky.indirect.sh`, where it is baked, or is carried from the direct light ([`Frame::set_indirect`]). Irradiance is in the unit of the light, without the receiver's albedo: a surface of
//! albedo ρ sends out ρ E / π.

use half::f16;

use crate::aperture::{self, ApertureLight, Apertures, Intersection};
use crate::asset::Asset;
use crate::bent::{self, BentLight};
use crate::cubemap::{n_texels, project_light};
use crate::dot;
use crate::indirect::{Carrier, Indirect};
use crate::light::{Cap, Light, SMOOTH_ORDER, Window, project_sh, split, window};
use crate::sh::MAX_COEFFICIENTS;
use crate::sparse::{Rows, SparseLight};

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
    /// Sparse rows on a cubemap, in pulses or Haar wavelets: shadows of a sun as sharp as a texel.
    Haar,
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

impl Missing {
    pub(crate) fn carrier() -> Missing {
        Missing { tensor: "indirect.node", basis: "direct-to-indirect" }
    }
}

impl std::fmt::Display for Missing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Missing { tensor, basis } = self;
        let bounces = if tensor.contains("indirect") { " and --bounces of at least 1" } else { "" };
        write!(f, "the asset has no {tensor}; bake it with --basis {basis}{bounces}")
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
    sparse: Option<Sparse<'a>>,
    direct: Projected,
    indirect: Projected,
    carrier: Option<Carrier<'a>>,
    carried: Indirect,
}

/// Rows on a cubemap and the light on it.
struct Sparse<'a> {
    rows: Rows<'a>,
    texels: Vec<[f32; 3]>,
    light: SparseLight,
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
            sparse: None,
            direct: dark("sky.direct.sh"),
            indirect: dark("sky.indirect.sh"),
            carrier: None,
            carried: Indirect::Sh,
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
            Method::Haar => {
                let rows = Rows::open(asset, "sky.direct").ok().flatten();
                let rows = rows.ok_or(Missing { tensor: "sky.direct.start", basis: "haar" })?;
                let n = rows.n();
                frame.sparse =
                    Some(Sparse { rows, texels: vec![[0.0; 3]; n_texels(n)], light: SparseLight::new(n) });
            }
        }
        Ok(frame)
    }

    /// Chooses how bounced light is carried, see [`Indirect::for_light`]; at first it is SH, or nothing where none is
    /// baked. [`Indirect::DirectToIndirect`] needs a call of [`Frame::reflect`] after each change of the light.
    ///
    /// # Errors
    /// When that was not baked.
    pub fn set_indirect(&mut self, indirect: Indirect) -> Result<(), Missing> {
        match indirect {
            Indirect::Sh if self.indirect.n == 0 => {
                return Err(Missing { tensor: "sky.indirect.sh", basis: "sh" });
            }
            Indirect::DirectToIndirect if self.carrier.is_none() => {
                let carrier = Carrier::open(self.asset).ok().flatten();
                self.carrier = Some(carrier.ok_or_else(Missing::carrier)?);
            }
            _ => {}
        }
        self.carried = indirect;
        Ok(())
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
            Method::Haar => {
                if let Some(sparse) = &mut self.sparse {
                    project_light(light, sparse.rows.n(), &mut sparse.texels);
                    sparse.light.set(&sparse.texels);
                }
            }
        }
        if self.indirect.n > 0 && self.carried == Indirect::Sh {
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
            Method::Haar => {
                out.fill([0.0; 3]);
                if let Some(sparse) = &self.sparse {
                    sparse.rows.add(first, &sparse.light, out);
                }
            }
        }
    }

    /// Takes on the direct irradiance of all vertices, from which [`add_indirect`](Self::add_indirect) then carries
    /// bounced light, if that is how it is carried; else does nothing.
    ///
    /// # Panics
    /// When `direct` is not one value per vertex.
    pub fn reflect(&mut self, direct: &[[f32; 3]]) {
        if let (Indirect::DirectToIndirect, Some(carrier)) = (self.carried, &mut self.carrier) {
            carrier.reflect(direct);
        }
    }

    /// As [`reflect`](Self::reflect), over all threads of the current rayon pool.
    ///
    /// # Panics
    /// When `direct` is not one value per vertex.
    #[cfg(feature = "rayon")]
    pub fn reflect_parallel(&mut self, direct: &[[f32; 3]]) {
        if let (Indirect::DirectToIndirect, Some(carrier)) = (self.carried, &mut self.carrier) {
            carrier.reflect_parallel(direct);
        }
    }

    /// Adds the irradiance of light that has bounced to the vertices from `first` on; nothing where none is baked.
    ///
    /// # Panics
    /// When there are not that many vertices.
    pub fn add_indirect(&self, first: usize, out: &mut [[f32; 3]]) {
        let n = self.indirect.n;
        match (self.carried, &self.carrier) {
            (Indirect::Sh, _) if n > 0 => {
                let rows = self.rows("sky.indirect.sh", first * 3 * n, out.len() * 3 * n);
                dot::sh_rgb_add(rows, &self.indirect.light[..n], out);
            }
            (Indirect::DirectToIndirect, Some(carrier)) => carrier.add(first, out),
            _ => {}
        }
    }

    /// All light, over all threads of the current rayon pool.
    ///
    /// # Panics
    /// When `out` is longer than there are vertices, or shorter where bounced light is carried from direct light.
    #[cfg(feature = "rayon")]
    pub fn irradiance_parallel(&mut self, out: &mut [[f32; 3]]) {
        use rayon::prelude::*;
        let task = dot::ROWS_PER_TASK;
        out.par_chunks_mut(task).enumerate().for_each(|(i, out)| self.direct(i * task, out));
        self.reflect_parallel(out);
        out.par_chunks_mut(task).enumerate().for_each(|(i, out)| self.add_indirect(i * task, out));
    }

    /// What the method reads per vertex, bytes in the mean: (direct, bounced), without the mesh.
    pub fn bytes_per_vertex(&self) -> (f32, f32) {
        let direct = match self.method {
            Method::Bent | Method::Aperture(_) => 8.0,
            Method::Sh { order, .. } => 2.0 * self.direct.n.min(order.saturating_mul(order)) as f32,
            Method::Haar => {
                self.sparse.as_ref().map_or(0.0, |s| s.rows.bytes() as f32 / s.rows.n_rows().max(1) as f32)
            }
        };
        let bounced = match (self.carried, &self.carrier) {
            (Indirect::Sh, _) => (6 * self.indirect.n) as f32,
            (Indirect::DirectToIndirect, Some(carrier)) => carrier.bytes_per_vertex(),
            _ => 0.0,
        };
        (direct, bounced)
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

#[cfg(test)]
mod tests;
