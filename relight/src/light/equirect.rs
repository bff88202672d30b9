//! Equirectangular pictures of the whole sphere.
//!
//! The centre column looks along -Z, u grows towards +X, the top row is +Y. A pixel is a box in (u, v) of
//! constant radiance: nothing is interpolated, so sums over pixels are exact integrals.

use std::f32::consts::{PI, TAU};
use std::fmt;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use glam::{Quat, Vec3};

use super::split::Spots;

/// A picture of radiance over the sphere, and how it is turned. Cloning shares the pixels.
#[derive(Clone, Debug)]
pub struct Equirect {
    image: Arc<Image>,
    orientation: Quat,
    scale: f32,
}

#[derive(Debug)]
struct Image {
    width: usize,
    height: usize,
    pixels: Vec<[f32; 3]>,
    n_negative: usize,
    /// SH coefficients in the picture's own frame, up to the highest order, computed when first asked for.
    sh: OnceLock<Vec<[f32; 3]>>,
    /// Bright spots and the rest of the picture without them, computed when first asked for.
    spots: OnceLock<Spots>,
    /// The cubemap last asked for.
    cubemap: Mutex<Option<KeptCubemap>>,
}

/// Texels without the picture's scale, at one resolution and turn.
#[derive(Debug)]
struct KeptCubemap {
    n: usize,
    orientation: Quat,
    texels: Vec<[f32; 3]>,
}

/// Why a picture cannot be a light.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EquirectError {
    /// Width or height is zero.
    Empty {
        /// Pixels per row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// `pixels` does not hold width × height entries.
    WrongLength {
        /// width × height.
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// A sample is NaN, infinite or beyond 1e12.
    NotFinite {
        /// Column of the first such pixel, from the left.
        column: usize,
        /// Row of the first such pixel, from the top.
        row: usize,
        /// How many pixels are like that.
        n_pixels: usize,
    },
}

impl Equirect {
    /// A light from rows of linear RGB, top row first. Negative samples are set to 0 and counted in
    /// [`n_negative`](Equirect::n_negative).
    ///
    /// # Errors
    /// When the picture has no pixels, the wrong number of them, or any that is NaN, infinite or beyond 1e12.
    pub fn new(width: usize, height: usize, mut pixels: Vec<[f32; 3]>) -> Result<Equirect, EquirectError> {
        if width == 0 || height == 0 {
            return Err(EquirectError::Empty { width, height });
        }
        let expected = width.saturating_mul(height);
        if pixels.len() != expected {
            return Err(EquirectError::WrongLength { expected, found: pixels.len() });
        }
        check_finite(width, &pixels)?;
        let n_negative = mend_negative(&mut pixels);
        let image = Image {
            width,
            height,
            pixels,
            n_negative,
            sh: OnceLock::new(),
            spots: OnceLock::new(),
            cubemap: Mutex::new(None),
        };
        Ok(Equirect { image: Arc::new(image), orientation: Quat::IDENTITY, scale: 1.0 })
    }

    /// Pixels per row.
    pub fn width(&self) -> usize {
        self.image.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.image.height
    }

    /// Rows of linear RGB as loaded (negative samples mended), top row first, without [`scale`](Self::scale).
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.image.pixels
    }

    /// How many negative samples were set to 0.
    pub fn n_negative(&self) -> usize {
        self.image.n_negative
    }

    /// Turns a direction of the picture into one of the world.
    pub fn orientation(&self) -> Quat {
        self.orientation
    }

    /// Factor from pixel values to radiance.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// The same picture turned by the unit quaternion `q`.
    pub fn rotated(&self, q: Quat) -> Equirect {
        Equirect { orientation: (q * self.orientation).normalize(), ..self.clone() }
    }

    /// The same picture, `factor` times as bright. `factor` is finite and not negative.
    pub fn scaled(&self, factor: f32) -> Equirect {
        Equirect { scale: self.scale * factor, ..self.clone() }
    }

    /// Radiance arriving from the unit direction `d`: that of the pixel it falls into.
    pub fn radiance(&self, d: Vec3) -> Vec3 {
        let (column, row) = self.pixel_at(d);
        Vec3::from(self.image.pixels[row * self.image.width + column]) * self.scale
    }

    /// Column and row of the pixel that the unit direction `d` of the world falls into.
    pub fn pixel_at(&self, d: Vec3) -> (usize, usize) {
        let local = self.orientation.inverse() * d;
        let u = 0.5 + local.x.atan2(-local.z) / TAU;
        let v = local.y.clamp(-1.0, 1.0).acos() / PI;
        let column = (u * self.image.width as f32) as usize % self.image.width;
        let row = ((v * self.image.height as f32) as usize).min(self.image.height - 1);
        (column, row)
    }

    /// Unit direction in the world of the picture's point (u, v), both in 0..=1 from the left and from the
    /// top.
    pub fn direction(&self, u: f32, v: f32) -> Vec3 {
        self.orientation * image_direction(u, v)
    }

    /// SH coefficients in the picture's own frame without scale, [`crate::sh::MAX_ORDER`]² of them; the first
    /// call sums over all pixels.
    pub(super) fn image_sh(&self) -> &[[f32; 3]] {
        self.image.sh.get_or_init(|| super::project::equirect_sh(self.width(), self.height(), self.pixels()))
    }

    /// Bright spots in the picture's own frame without scale; the first call searches all pixels.
    pub(super) fn image_spots(&self) -> &Spots {
        self.image.spots.get_or_init(|| super::split::find_spots(self))
    }

    /// Calls `read` with the picture's texels on an `n` x `n` x 6 cubemap in the world, without scale. They are
    /// kept until another resolution or turn is asked for.
    pub(crate) fn with_cubemap(&self, n: usize, read: impl FnOnce(&[[f32; 3]])) {
        // A panic elsewhere cannot leave half a cubemap: it is replaced whole.
        let mut kept = self.image.cubemap.lock().unwrap_or_else(PoisonError::into_inner);
        if !kept.as_ref().is_some_and(|k| k.n == n && k.orientation == self.orientation) {
            let texels = crate::cubemap::accumulate_picture(self, n);
            *kept = Some(KeptCubemap { n, orientation: self.orientation, texels });
        }
        if let Some(kept) = kept.as_ref() {
            read(&kept.texels);
        }
    }
}

/// Samples beyond this are broken: a million times the sun. It keeps all sums over a picture within f32.
const MAX_SAMPLE: f32 = 1e12;

/// Unit direction, in the picture's own frame, of its point (u, v).
pub(super) fn image_direction(u: f32, v: f32) -> Vec3 {
    let (sin_phi, cos_phi) = ((u - 0.5) * TAU).sin_cos();
    let (sin_theta, cos_theta) = (v * PI).sin_cos();
    Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi)
}

fn check_finite(width: usize, pixels: &[[f32; 3]]) -> Result<(), EquirectError> {
    let is_bad = |p: &[f32; 3]| !p.iter().all(|c| c.abs() <= MAX_SAMPLE);
    let Some(first) = pixels.iter().position(is_bad) else { return Ok(()) };
    let n_pixels = pixels.iter().filter(|p| is_bad(p)).count();
    Err(EquirectError::NotFinite { column: first % width, row: first / width, n_pixels })
}

fn mend_negative(pixels: &mut [[f32; 3]]) -> usize {
    let mut n_negative = 0;
    for sample in pixels.as_flattened_mut() {
        if *sample < 0.0 {
            *sample = 0.0;
            n_negative += 1;
        }
    }
    n_negative
}

impl fmt::Display for EquirectError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            EquirectError::Empty { width, height } => {
                write!(f, "the picture is {width} x {height} pixels: it needs at least one")
            }
            EquirectError::WrongLength { expected, found } => {
                write!(f, "the picture holds {found} pixels where its size asks for {expected}")
            }
            EquirectError::NotFinite { column, row, n_pixels } => write!(
                f,
                "{n_pixels} pixels of the picture are NaN, infinite or beyond 1e12, the first at column {column}, \
                 row {row}: repair it in an image editor"
            ),
        }
    }
}

impl std::error::Error for EquirectError {}
