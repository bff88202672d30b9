//! Lights: what shines on a scene from far away, as radiance L(ω) over the sphere of directions.
//!
//! A [`Light`] is a sum of [`Source`]s. Everything a light can do follows from its radiance:
//! [`Light::radiance`] looks it up, [`project_sh`] integrates it against spherical harmonics,
//! [`parse`](Light::parse) reads the text form that people type.
//!
//! Units: linear Rec.709 radiance. A single source may use any scale (`uniform` is 1); the Hosek-Wilkie sky
//! and its sun share one absolute scale, see [`sky`].
//!
//! Limits: all sources are infinitely far away, so every point of the scene sees the same light. Lamps at a
//! finite distance are turned into [`Cap`]s as seen from one point; [`near_ratio`] says how wrong that is.

use glam::{Quat, Vec3};

mod equirect;
mod parse;
mod project;
pub mod quadrature;
pub mod sky;
mod spectrum;
mod split;
mod window;

pub use equirect::{Equirect, EquirectError};
pub use parse::{ParseContext, ParseError, Problem};
pub use project::{project_sh, project_source_sh};
pub use sky::Sky;
pub use split::{SMOOTH_ORDER, split};
pub use window::{Window, window};

/// Light from infinitely far away: the sum of its sources.
#[derive(Clone, Debug, Default)]
pub struct Light {
    /// Radiances add up; their order means nothing.
    pub sources: Vec<Source>,
}

/// One part of a light.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Source {
    /// The same radiance from every direction of the whole sphere.
    Uniform(Vec3),
    /// The CIE overcast sky above a horizon, nothing below.
    CieOvercast(CieOvercast),
    /// A disc of constant radiance: sun, lamp, or a whole hemisphere.
    Cap(Cap),
    /// The Hosek-Wilkie clear sky with its sun.
    Sky(Sky),
    /// A picture of the whole sphere.
    Equirect(Equirect),
}

/// L(ω) = zenith (1 + 2 sin(elevation)) / 3 above the horizon, 0 below.
///
/// Based on: Moon and Spencer, Illumination from a Non-Uniform Sky, 1942.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CieOvercast {
    /// Radiance straight up, three times that of the horizon.
    pub zenith: Vec3,
    /// Unit direction to the zenith: +Y unless the light was turned.
    pub up: Vec3,
}

/// A spherical cap of constant radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cap {
    /// Unit direction to its centre.
    pub axis: Vec3,
    /// Angle between axis and rim, radians, in (0, π].
    pub radius: f32,
    /// Radiance inside.
    pub radiance: Vec3,
}

impl Light {
    /// A light with one source.
    pub fn new(source: Source) -> Light {
        Light { sources: vec![source] }
    }

    /// The light that is dark everywhere.
    pub fn dark() -> Light {
        Light::default()
    }

    /// Radiance arriving from the unit direction `d` (pointing away from the scene).
    pub fn radiance(&self, d: Vec3) -> Vec3 {
        self.sources.iter().map(|s| s.radiance(d)).sum()
    }

    /// Its discs of constant radiance: caps, and the suns of skies as far as they are up.
    pub fn discs(&self) -> impl Iterator<Item = Cap> + '_ {
        self.sources.iter().filter_map(|source| match source {
            Source::Cap(cap) => Some(*cap),
            Source::Sky(sky) => sky.sun_above_horizon(),
            _ => None,
        })
    }

    /// This light turned by the unit quaternion `q`: `rotated(q).radiance(q * d) == radiance(d)`. Images are
    /// shared, not copied.
    pub fn rotated(&self, q: Quat) -> Light {
        Light { sources: self.sources.iter().map(|s| s.rotated(q)).collect() }
    }
}

impl Source {
    /// Radiance arriving from the unit direction `d`.
    pub fn radiance(&self, d: Vec3) -> Vec3 {
        match self {
            Source::Uniform(l) => *l,
            Source::CieOvercast(sky) => sky.radiance(d),
            Source::Cap(cap) => cap.radiance_from(d),
            Source::Sky(sky) => sky.radiance(d),
            Source::Equirect(image) => image.radiance(d),
        }
    }

    /// This source turned by the unit quaternion `q`.
    pub fn rotated(&self, q: Quat) -> Source {
        match self {
            Source::Uniform(l) => Source::Uniform(*l),
            Source::CieOvercast(sky) => Source::CieOvercast(CieOvercast { up: turned(q, sky.up), ..*sky }),
            Source::Cap(cap) => Source::Cap(Cap { axis: turned(q, cap.axis), ..*cap }),
            Source::Sky(sky) => Source::Sky(sky.rotated(q)),
            Source::Equirect(image) => Source::Equirect(image.rotated(q)),
        }
    }
}

impl CieOvercast {
    /// The overcast sky over a level horizon (up is +Y).
    pub fn new(zenith: Vec3) -> CieOvercast {
        CieOvercast { zenith, up: Vec3::Y }
    }

    /// Radiance arriving from the unit direction `d`.
    pub fn radiance(&self, d: Vec3) -> Vec3 {
        let sin_elevation = d.dot(self.up);
        if sin_elevation > 0.0 { self.zenith * ((1.0 + 2.0 * sin_elevation) / 3.0) } else { Vec3::ZERO }
    }
}

impl Cap {
    /// Is the unit direction `d` inside? The rim belongs to the cap.
    pub fn contains(&self, d: Vec3) -> bool {
        // Compared by chord: the cosine of a sun's radius has no digits left in f32.
        let rim = 2.0 * (0.5 * self.radius).sin();
        d.distance_squared(self.axis) <= rim * rim
    }

    /// Radiance arriving from the unit direction `d`.
    pub fn radiance_from(&self, d: Vec3) -> Vec3 {
        if self.contains(d) { self.radiance } else { Vec3::ZERO }
    }

    /// Solid angle 2π (1 - cos radius), steradians.
    pub fn solid_angle(&self) -> f32 {
        crate::cap::area(f64::from(self.radius)) as f32
    }

    /// The cap that a sphere of `radius` and `radiance` at `position` fills as seen from `centre`, all in
    /// metres. `None` when `centre` is inside the sphere. It is right for a scene that is small against the
    /// distance.
    pub fn of_sphere(position: Vec3, radius: f32, radiance: Vec3, centre: Vec3) -> Option<Cap> {
        let to = position - centre;
        let distance = to.length();
        let inside = distance <= radius;
        (!inside && radius > 0.0).then(|| Cap {
            axis: to / distance,
            radius: (radius / distance).asin(),
            radiance,
        })
    }
}

/// How near a lamp is: scene radius over the lamp's distance from the scene's centre.
///
/// Treating the lamp as infinitely far is wrong by about this ratio in its direction (radians), and by about
/// twice this ratio in the light received at the scene's edge. Above 0.1 one sees it.
pub fn near_ratio(scene_radius: f32, distance: f32) -> f32 {
    scene_radius / distance
}

/// Rotation of a unit vector, kept a unit vector over many turns.
fn turned(q: Quat, v: Vec3) -> Vec3 {
    (q * v).normalize_or(Vec3::Y)
}

#[cfg(test)]
mod tests;
