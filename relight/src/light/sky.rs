//! The clear sky of Hosek and Wilkie, with a sun.
//!
//! Dome: L(θ, γ) for the angle θ from the zenith and γ from the sun, per RGB channel, from the `hw-skymodel`
//! crate's RGB data set; nothing below the horizon (there the scene itself is the ground). Sun: a [`Cap`] of
//! radius 0.2666° whose radiance is the extraterrestrial spectrum times the transmittance of the same turbid
//! atmosphere, see `spectrum.rs`.
//!
//! Units: both are radiometric-colorimetric, W/(m² sr) weighted with the CIE colour matching functions and
//! turned into linear Rec.709; 683 times the luminance 0.2126 R + 0.7152 G + 0.0722 B is in cd/m².
//!
//! Twilight: the model ends with the sun at the horizon. Below it, the dome keeps the shape and colour of
//! sunset and dims as measured twilight does: by a factor 10^0.4 per degree, reaching 0 at -18° (the end of
//! astronomical twilight). The disc is cut by the horizon and gone once its upper rim has set. Refraction is
//! left out: it would raise a setting sun by half a degree.
//!
//! Limits: turbidity 1 to 10; under 2° of elevation the model is fitted to few data; no clouds, no stars, no
//! moon.
//!
//! Based on: Hosek and Wilkie, An Analytic Model for Full Spectral Sky-Dome Radiance, 2012.

use std::f32::consts::FRAC_PI_2;
use std::fmt;

use glam::{Quat, Vec3};
use hw_skymodel::rgb::{SkyParams, SkyState};

use super::{Cap, spectrum, turned};
use crate::cap;

/// Angular radius of the sun at its mean distance: 0.2666 degrees, in radians.
pub const SUN_RADIUS: f32 = 0.004_653;

/// Turbidity of a clear day, where none is given.
pub const DEFAULT_TURBIDITY: f32 = 3.0;

/// Grey albedo of the land around the scene, which brightens the dome a little: soil and vegetation.
pub const DEFAULT_GROUND_ALBEDO: f32 = 0.2;

/// Below this elevation the sky is dark: the end of astronomical twilight, -18 degrees in radians.
const NIGHT_ELEVATION: f32 = -0.314_159_27;

/// The Hosek-Wilkie sky with its sun, at one moment.
#[derive(Clone, Debug)]
pub struct Sky {
    dome: Dome,
    /// From the sky's frame (up +Y, north -Z) to the world.
    orientation: Quat,
    azimuth: f32,
    elevation: f32,
    turbidity: f32,
    /// Twilight's factor on the dome: 1 by day.
    fade: f32,
    /// The whole disc, in the sky's frame.
    sun: Cap,
}

/// Coefficients of the dome for one sun, turbidity and ground, per RGB channel.
#[derive(Clone, Debug)]
struct Dome {
    /// A to I of the paper, in the order of the data set: A B C D E F G H I.
    shape: [[f32; 9]; 3],
    /// Radiance where the shape is 1.
    radiance: [f32; 3],
}

/// Why there is no such sky.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum SkyError {
    /// The azimuth is NaN or infinite.
    Azimuth(f32),
    /// The elevation is not in -π/2..=π/2 radians.
    Elevation(f32),
    /// The turbidity is not in 1..=10.
    Turbidity(f32),
    /// The ground's albedo is not in 0..=1.
    GroundAlbedo(f32),
}

impl Sky {
    /// The sky with the sun at `azimuth` (radians clockwise from north, -Z, through east, +X) and `elevation`
    /// (radians above the horizon, in -π/2..=π/2), over land of [`DEFAULT_GROUND_ALBEDO`].
    ///
    /// # Errors
    /// When a number is out of range.
    pub fn new(azimuth: f32, elevation: f32, turbidity: f32) -> Result<Sky, SkyError> {
        Sky::over_ground(azimuth, elevation, turbidity, DEFAULT_GROUND_ALBEDO)
    }

    /// As [`Sky::new`], over land of another grey albedo (snow 0.8, sea 0.06).
    ///
    /// # Errors
    /// When a number is out of range.
    pub fn over_ground(azimuth: f32, elevation: f32, turbidity: f32, albedo: f32) -> Result<Sky, SkyError> {
        if !azimuth.is_finite() {
            return Err(SkyError::Azimuth(azimuth));
        }
        if !(-FRAC_PI_2..=FRAC_PI_2).contains(&elevation) {
            return Err(SkyError::Elevation(elevation));
        }
        if !(1.0..=10.0).contains(&turbidity) {
            return Err(SkyError::Turbidity(turbidity));
        }
        let params = SkyParams { elevation: elevation.max(0.0), turbidity, albedo: [albedo; 3] };
        let dome = SkyState::new(&params).map_err(|_| SkyError::GroundAlbedo(albedo))?;
        let axis = compass_direction(azimuth, elevation);
        let sun = Cap { axis, radius: SUN_RADIUS, radiance: spectrum::sun_radiance(elevation, turbidity) };
        let fade = twilight(elevation);
        let dome = Dome::new(&dome);
        Ok(Sky { dome, orientation: Quat::IDENTITY, azimuth, elevation, turbidity, fade, sun })
    }

    /// The sun's azimuth in the sky's own frame, radians clockwise from north.
    pub fn azimuth(&self) -> f32 {
        self.azimuth
    }

    /// The sun's elevation in the sky's own frame, radians.
    pub fn elevation(&self) -> f32 {
        self.elevation
    }

    /// Turbidity, 1 to 10.
    pub fn turbidity(&self) -> f32 {
        self.turbidity
    }

    /// Turns the sky's own frame (up +Y, north -Z) into the world's.
    pub fn orientation(&self) -> Quat {
        self.orientation
    }

    /// Unit direction to the zenith, in the world.
    pub fn up(&self) -> Vec3 {
        turned(self.orientation, Vec3::Y)
    }

    /// Radiance of dome and sun from the unit direction `d`.
    pub fn radiance(&self, d: Vec3) -> Vec3 {
        let local = self.orientation.inverse() * d;
        if local.y <= 0.0 {
            return Vec3::ZERO;
        }
        self.dome_local(local) + self.sun.radiance_from(local)
    }

    /// Radiance of the dome alone, without the sun's disc.
    pub fn dome_radiance(&self, d: Vec3) -> Vec3 {
        let local = self.orientation.inverse() * d;
        if local.y <= 0.0 { Vec3::ZERO } else { self.dome_local(local) }
    }

    /// The sun's whole disc in the world, also where the horizon cuts it; `None` once it has set.
    pub fn sun(&self) -> Option<Cap> {
        let is_up = self.elevation > -SUN_RADIUS;
        is_up.then(|| Cap { axis: turned(self.orientation, self.sun.axis), ..self.sun })
    }

    /// The sun as [`Sky::sun`], its radiance lowered by the part of the disc that has set: the same energy
    /// without a cut, for methods that know only whole discs.
    pub fn sun_above_horizon(&self) -> Option<Cap> {
        let disc = self.sun()?;
        let radius = f64::from(SUN_RADIUS);
        let zenith_angle = std::f64::consts::FRAC_PI_2 - f64::from(self.elevation);
        let visible =
            cap::intersection_area(zenith_angle, radius, std::f64::consts::FRAC_PI_2) / cap::area(radius);
        (visible > 0.0).then(|| Cap { radiance: disc.radiance * visible as f32, ..disc })
    }

    /// Radiance of the dome from `d` in the sky's own frame, above the horizon.
    pub(super) fn dome_local(&self, d: Vec3) -> Vec3 {
        let rgb = self.dome.radiance(d.y.clamp(0.0, 1.0), d.angle_between(self.dome_sun()));
        // The fit dips under zero opposite to a low sun.
        rgb.max(Vec3::ZERO) * self.fade
    }

    /// Where the dome's glow is centred: the sun, held at the horizon in twilight.
    fn dome_sun(&self) -> Vec3 {
        if self.elevation >= 0.0 { self.sun.axis } else { compass_direction(self.azimuth, 0.0) }
    }

    /// This sky turned by the unit quaternion `q`.
    pub fn rotated(&self, q: Quat) -> Sky {
        Sky { orientation: (q * self.orientation).normalize(), ..self.clone() }
    }
}

impl Dome {
    fn new(state: &SkyState) -> Dome {
        let (shape, radiance) = state.raw();
        Dome { shape: std::array::from_fn(|c| std::array::from_fn(|i| shape[9 * c + i])), radiance }
    }

    /// L = (1 + A exp(B / (cos θ + 0.01))) (C + D exp(E γ) + F cos² γ + G χ(I, γ) + H √cos θ) times the radiance
    /// scale, χ(g, γ) = (1 + cos² γ) / (1 + g² - 2 g cos γ)^(3/2): what `SkyState::radiance` computes, for the
    /// three channels at once, which share the costly parts.
    fn radiance(&self, cos_theta: f32, gamma: f32) -> Vec3 {
        let cos_gamma = gamma.cos();
        let cos_gamma2 = cos_gamma * cos_gamma;
        let root = cos_theta.sqrt();
        let horizon = 1.0 / (cos_theta + 0.01);
        let channel = |channel: usize| {
            let [a, b, c, d, e, f, g, h, i] = self.shape[channel];
            let x = 1.0 + i * i - 2.0 * i * cos_gamma;
            let glow = (1.0 + cos_gamma2) / (x * x.sqrt());
            let falloff = 1.0 + a * (b * horizon).exp();
            self.radiance[channel]
                * falloff
                * (c + d * (e * gamma).exp() + f * cos_gamma2 + g * glow + h * root)
        };
        Vec3::new(channel(0), channel(1), channel(2))
    }
}

/// Unit direction of a compass azimuth (radians clockwise from north, -Z, through east, +X) and an elevation
/// (radians).
pub fn compass_direction(azimuth: f32, elevation: f32) -> Vec3 {
    let (sin_azimuth, cos_azimuth) = azimuth.sin_cos();
    let (sin_elevation, cos_elevation) = elevation.sin_cos();
    Vec3::new(sin_azimuth * cos_elevation, sin_elevation, -cos_azimuth * cos_elevation)
}

/// Brightness of the dome against sunset: 1 by day, 0 from the end of astronomical twilight on.
///
/// Horizontal illuminance of a clear twilight falls from about 400 lx at 0° over 3 lx at -6° to 0.008 lx at
/// -12°, close to 0.4 decades per degree.
fn twilight(elevation: f32) -> f32 {
    if elevation >= 0.0 {
        return 1.0;
    }
    let depth = (-elevation).to_degrees();
    let to_night = ((elevation - NIGHT_ELEVATION) / (-0.25 * NIGHT_ELEVATION)).clamp(0.0, 1.0);
    10.0_f32.powf(-0.4 * depth) * to_night * to_night * (3.0 - 2.0 * to_night)
}

impl fmt::Display for SkyError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            SkyError::Azimuth(x) => write!(f, "the sun's azimuth {x} is not a finite angle"),
            SkyError::Elevation(x) => {
                write!(f, "the sun's elevation {} is not within -90..90 degrees", x.to_degrees())
            }
            SkyError::Turbidity(x) => write!(f, "turbidity {x} is not within 1..10"),
            SkyError::GroundAlbedo(x) => write!(f, "ground albedo {x} is not within 0..1"),
        }
    }
}

impl std::error::Error for SkyError {}
