//! A surface, ready for rays.
//!
//! Rays that leave a surface start a hair above it, so that they do not hit it again: by 256 units in the last place
//! of each coordinate along the normal, which fits the rounding of hit points at any distance from the origin; near
//! the origin, where such units vanish, by a fixed share of the scene's size.
//! Based on: Carsten Waechter and Nikolaus Binder, A Fast and Robust Method for Avoiding Self-Intersection, Ray
//! Tracing Gems ch. 6, 2019; their constants, made for scenes of size 1, are scaled here.
//!
//! It breaks where surfaces lie closer together than that hair, 3e-5 of the scene's size.

use crate::error::Error;
use crate::reference::panes::Panes;
use crate::reference::path::Place;
use crate::reference::scatter::Scatter;
use glam::{IVec3, Vec3};
use lunette_ffi::{Device, Ray, SceneBuilder};
use std::f32::consts::PI;

/// A view of what is lit: of a scene, or of a baked asset.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// Metres, \[V\].
    pub position: &'a [Vec3],
    /// Shading normals, of any length above 0, \[V\].
    pub normal: &'a [Vec3],
    /// Vertex indices below V, \[T\].
    pub index: &'a [[u32; 3]],
    /// Diffuse reflectance, linear Rec.709 in 0..=1, \[V\]; interpolated over triangles.
    pub albedo: &'a [Vec3],
}

/// Phong reflection of a surface, beside its albedo: it sends out
/// `∫ [albedo/π + specular (exponent + 2)/(2π) max(r·wi, 0)^exponent] L_i cosθ dwi`, with r the mirror direction of the
/// viewer's. The specular reflectance is the share of light that the lobe sends back from straight above.
///
/// Based on: Lafortune and Willems, Using the Modified Phong Reflectance Model for Physically Based Rendering, 1994.
#[derive(Clone, Copy, Debug)]
pub struct Gloss<'a> {
    /// Specular reflectance (`Ks`), in 0..=1, and no more than 1 together with the albedo, \[V\].
    pub specular: &'a [Vec3],
    /// Phong exponent (`Ns`), 0 and up, \[V\].
    pub exponent: &'a [f32],
}

/// A surface with Embree's search tree over it. Surfaces are opaque and two-sided, and Lambertian unless
/// [`with_gloss`](Tracer::with_gloss) says otherwise; emission (`Ke`) is not part of a relit light and does not count.
/// Nothing lets light through: panes of glass are to be left out of the surface.
pub struct Tracer<'a> {
    surface: Surface<'a>,
    gloss: Option<Gloss<'a>>,
    panes: Option<Panes>,
    scene: lunette_ffi::Scene,
    /// Largest magnitude of a coordinate, metres.
    extent: f32,
}

/// Where a ray met the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    pub position: Vec3,
    /// Unit, on the side from which the ray came.
    pub geometric_normal: Vec3,
    pub triangle: u32,
    /// Weights of the triangle's second and third vertex.
    pub weights: [f32; 2],
    /// Whether the ray met the side that the shading normals point to.
    pub is_front: bool,
}

/// Units in the last place by which a ray's origin is moved.
const ULPS: f32 = 256.0;

/// Share of the scene's extent under which a coordinate's units in the last place are too small to count on.
const NEAR_ORIGIN: f32 = 1.0 / 32.0;

/// Share of the scene's extent by which origins are moved there.
const NEAR_ORIGIN_STEP: f32 = 1.0 / 65536.0;

impl<'a> Tracer<'a> {
    /// Checks the surface and builds the search tree.
    ///
    /// # Errors
    /// [`Error::Surface`] where there is no triangle, lengths differ, an index is out of range, a value is not finite
    /// or an albedo is not in 0..=1; [`Error::Embree`] where Embree is missing.
    pub fn new(surface: Surface<'a>) -> Result<Tracer<'a>, Error> {
        check(&surface)?;
        let device = Device::new()?;
        let mut builder = SceneBuilder::new(&device)?;
        builder.add_triangles(bytemuck::cast_slice(surface.position), surface.index)?;
        let extent = surface.position.iter().map(|p| p.abs().max_element()).fold(f32::MIN_POSITIVE, f32::max);
        Ok(Tracer { surface, gloss: None, panes: None, scene: builder.commit()?, extent })
    }

    /// The same surface, glossy.
    ///
    /// # Errors
    /// [`Error::Surface`] where lengths differ, a value is out of its range, or albedo and specular reflectance together
    /// send back more light than falls in.
    pub fn with_gloss(self, gloss: Gloss<'a>) -> Result<Tracer<'a>, Error> {
        check_gloss(&self.surface, &gloss)?;
        Ok(Tracer { gloss: Some(gloss), ..self })
    }

    /// The same surface, with openings through which most light enters: triangles that block nothing, and at which the
    /// reference aims rays. That takes away noise and changes no expected value, even where light enters elsewhere too.
    /// Triangles without area are left out; none at all is as if this was not called.
    ///
    /// # Errors
    /// [`Error::Surface`] for a corner that is not finite.
    pub fn with_portals(self, triangles: &[[Vec3; 3]]) -> Result<Tracer<'a>, Error> {
        if let Some(t) = triangles.iter().position(|t| t.iter().any(|p| !p.is_finite())) {
            let what =
                format!("triangle {t} of the portals has a corner that is not finite: {:?}", triangles[t]);
            return Err(Error::Surface { what });
        }
        self.with_glass(triangles, &vec![Vec3::ONE; triangles.len()])
    }

    /// As [`with_portals`](Tracer::with_portals), and each triangle lets through a share of the light, per colour.
    ///
    /// # Errors
    /// As there, and for a share that is not finite and 0 or more, or not one share per triangle.
    pub fn with_glass(self, triangles: &[[Vec3; 3]], transmission: &[Vec3]) -> Result<Tracer<'a>, Error> {
        let wrong = |t: &Vec3| !t.is_finite() || t.min_element() < 0.0;
        if transmission.len() != triangles.len() || transmission.iter().any(wrong) {
            let what =
                format!("{} portal triangles need as many shares of light, 0 or more", triangles.len());
            return Err(Error::Surface { what });
        }
        Ok(Tracer { panes: Panes::new(triangles, transmission), ..self })
    }

    /// What panes on the way let through.
    pub(crate) fn transmission(&self, origin: Vec3, direction: Vec3, distance: f32) -> Vec3 {
        self.panes.as_ref().map_or(Vec3::ONE, |panes| panes.transmission(origin, direction, distance))
    }

    /// What it was made of.
    pub fn surface(&self) -> Surface<'a> {
        self.surface
    }

    pub(crate) fn scene(&self) -> &lunette_ffi::Scene {
        &self.scene
    }

    pub(crate) fn panes(&self) -> Option<&Panes> {
        self.panes.as_ref()
    }

    /// The first contact of an endless ray.
    pub(crate) fn first_contact(&self, origin: Vec3, direction: Vec3) -> Option<Contact> {
        let hit = self.scene.intersect(&Ray::new(origin.to_array(), direction.to_array()))?;
        let [a, b, c] = self.corners(hit.primitive, self.surface.position);
        let position = (1.0 - hit.u - hit.v) * a + hit.u * b + hit.v * c;
        let normal = Vec3::from(hit.normal).normalize_or(-direction);
        let sees_winding = normal.dot(direction) < 0.0;
        let weights = [hit.u, hit.v];
        let winding_is_front =
            self.interpolate(hit.primitive, weights, self.surface.normal).dot(normal) >= 0.0;
        Some(Contact {
            position,
            geometric_normal: if sees_winding { normal } else { -normal },
            triangle: hit.primitive,
            weights,
            is_front: sees_winding == winding_is_front,
        })
    }

    /// Whether anything is in the way of an endless ray.
    pub(crate) fn is_blocked(&self, origin: Vec3, direction: Vec3) -> bool {
        self.scene.occluded(&Ray::new(origin.to_array(), direction.to_array()))
    }

    /// Whether nothing is between two points.
    pub(crate) fn sees(&self, from: Vec3, to: Vec3) -> bool {
        !self.scene.occluded(&Ray { tfar: 1.0, ..Ray::new(from.to_array(), (to - from).to_array()) })
    }

    /// The point of a path at a contact, with a unit normal on its side, seen along the unit direction `d`.
    pub(crate) fn place(&self, contact: &Contact, n: Vec3, d: Vec3) -> Place {
        let origin = self.lift(contact.position, contact.geometric_normal);
        Place { origin, n, scatter: self.scatter(contact, n, d) }
    }

    fn scatter(&self, contact: &Contact, n: Vec3, d: Vec3) -> Scatter {
        let albedo = self.interpolate(contact.triangle, contact.weights, self.surface.albedo);
        let Some(gloss) = self.gloss else { return Scatter::matt(albedo) };
        let specular = self.interpolate(contact.triangle, contact.weights, gloss.specular);
        let [u, v] = contact.weights;
        let [a, b, c] = self.surface.index[contact.triangle as usize].map(|i| gloss.exponent[i as usize]);
        Scatter::glossy(albedo, specular, (1.0 - u - v) * a + u * b + v * c, n, d)
    }

    /// Unit interpolated normal at a contact, on the side from which the ray came.
    pub(crate) fn shading_normal(&self, contact: &Contact) -> Vec3 {
        let normal = self.interpolate(contact.triangle, contact.weights, self.surface.normal);
        let towards = if contact.is_front { normal } else { -normal };
        towards.try_normalize().unwrap_or(contact.geometric_normal)
    }

    /// A ray's origin just above `point`, on the side that the unit `normal` points to.
    pub(crate) fn lift(&self, point: Vec3, normal: Vec3) -> Vec3 {
        let steps: IVec3 = (ULPS * normal).as_ivec3();
        let move_by = |x: f32, ulps: i32, n: f32| {
            if x.abs() < NEAR_ORIGIN * self.extent {
                return x + n * NEAR_ORIGIN_STEP * self.extent;
            }
            // Floats of one sign are ordered like their bits: adding to the bits steps away from 0.
            f32::from_bits(x.to_bits().wrapping_add_signed(if x < 0.0 { -ulps } else { ulps }))
        };
        Vec3::new(
            move_by(point.x, steps.x, normal.x),
            move_by(point.y, steps.y, normal.y),
            move_by(point.z, steps.z, normal.z),
        )
    }

    fn interpolate(&self, triangle: u32, [u, v]: [f32; 2], values: &[Vec3]) -> Vec3 {
        let [a, b, c] = self.corners(triangle, values);
        (1.0 - u - v) * a + u * b + v * c
    }

    fn corners(&self, triangle: u32, values: &[Vec3]) -> [Vec3; 3] {
        self.surface.index[triangle as usize].map(|i| values[i as usize])
    }
}

/// Radiance that a Lambertian surface sends out under irradiance `e`.
pub(crate) fn lambert(albedo: Vec3, e: Vec3) -> Vec3 {
    albedo * e / PI
}

fn check(surface: &Surface) -> Result<(), Error> {
    let wrong = |what: String| Err(Error::Surface { what });
    let n = surface.position.len();
    if surface.index.is_empty() {
        return wrong("the surface has no triangle".into());
    }
    if surface.normal.len() != n || surface.albedo.len() != n {
        let (normals, albedos) = (surface.normal.len(), surface.albedo.len());
        return wrong(format!("the surface has {n} positions, {normals} normals and {albedos} albedos"));
    }
    if let Some(t) = surface.index.iter().position(|t| t.iter().any(|&i| i as usize >= n)) {
        return wrong(format!("triangle {t} of the surface asks for a vertex beyond the last of {n}"));
    }
    for (name, values) in [("position", surface.position), ("normal", surface.normal)] {
        if let Some(v) = values.iter().position(|x| !x.is_finite()) {
            return wrong(format!("vertex {v} of the surface has the {name} {}", values[v]));
        }
    }
    let is_albedo = |x: &Vec3| x.to_array().iter().all(|x| (0.0..=1.0).contains(x));
    match surface.albedo.iter().position(|x| !is_albedo(x)) {
        Some(v) => {
            wrong(format!("vertex {v} of the surface has the albedo {}, not in 0..=1", surface.albedo[v]))
        }
        None => Ok(()),
    }
}

/// Rounding of a file's decimals may put a sum of reflectances this far over 1.
const REFLECTANCE_MARGIN: f32 = 1e-3;

fn check_gloss(surface: &Surface, gloss: &Gloss) -> Result<(), Error> {
    let wrong = |what: String| Err(Error::Surface { what });
    let (n, specular, exponent) = (surface.position.len(), gloss.specular, gloss.exponent);
    if specular.len() != n || exponent.len() != n {
        let (speculars, exponents) = (specular.len(), exponent.len());
        return wrong(format!(
            "the surface has {n} positions, {speculars} speculars and {exponents} exponents"
        ));
    }
    let keeps_energy = |(s, albedo): (&Vec3, &Vec3)| {
        let most = 1.0 + REFLECTANCE_MARGIN;
        s.to_array().iter().all(|x| (0.0..=1.0).contains(x)) && (s + albedo).max_element() <= most
    };
    if let Some(v) = specular.iter().zip(surface.albedo).position(|both| !keeps_energy(both)) {
        let (s, albedo) = (specular[v], surface.albedo[v]);
        return wrong(format!(
            "vertex {v} of the surface has the specular {s} beside the albedo {albedo}: their sum must be in 0..=1"
        ));
    }
    match exponent.iter().position(|e| !(e.is_finite() && *e >= 0.0)) {
        Some(v) => {
            wrong(format!("vertex {v} of the surface has the exponent {}, not 0 or more", exponent[v]))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [Vec3; 3] =
        [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(-1.0, 0.0, 3.0), Vec3::new(3.0, 0.0, -1.0)];

    const ALBEDO: [Vec3; 3] = [Vec3::splat(0.5); 3];

    fn triangle<'a>(position: &'a [Vec3], normal: &'a [Vec3]) -> Surface<'a> {
        Surface { position, normal, index: &[[0, 1, 2]], albedo: &ALBEDO }
    }

    #[test]
    fn contact_faces_the_ray_and_knows_its_front() {
        for (normal, from_above_is_front) in [(Vec3::Y, true), (Vec3::NEG_Y, false)] {
            let normals = [normal; 3];
            let tracer = Tracer::new(triangle(&CORNERS, &normals)).unwrap();
            for side in [1.0, -1.0] {
                let contact = tracer.first_contact(Vec3::new(0.5, side, 0.25), Vec3::Y * -side).unwrap();
                assert!(contact.position.distance(Vec3::new(0.5, 0.0, 0.25)) < 1e-6);
                assert_eq!(contact.geometric_normal, Vec3::Y * side);
                assert_eq!(contact.is_front, from_above_is_front == (side > 0.0));
                assert_eq!(tracer.shading_normal(&contact), Vec3::Y * side);
            }
        }
    }

    /// Oblique triangles far from and near the origin, small and large scenes: a ray from a contact, lifted, misses
    /// the triangle it came from, above and below.
    #[test]
    fn lifted_rays_never_hit_their_own_triangle() {
        let mut n_tested = 0;
        for (scale, shift) in [(1.0, Vec3::ZERO), (1e-3, Vec3::ZERO), (1e3, Vec3::new(3e4, 100.0, -1e4))] {
            let tilt = |p: Vec3| scale * Vec3::new(p.x, 0.7 * p.x - 0.3 * p.z, p.z) + shift;
            let position = CORNERS.map(tilt);
            let normals = [Vec3::new(-0.7, 1.0, 0.3); 3];
            let tracer = Tracer::new(triangle(&position, &normals)).unwrap();
            for i in 0..1000 {
                let (x, z) = ((i % 37) as f32 * 0.05 - 0.9, (i % 41) as f32 * 0.045 - 0.9);
                let target = tilt(Vec3::new(x, 0.0, z));
                for side in [1.0, -1.0] {
                    let from = target + side * scale * Vec3::new(0.3, 4.0, 0.1);
                    let Some(contact) = tracer.first_contact(from, (target - from).normalize()) else {
                        continue;
                    };
                    let origin = tracer.lift(contact.position, contact.geometric_normal);
                    let n = contact.geometric_normal;
                    for grazing in [n.any_orthonormal_vector(), n.cross(n.any_orthonormal_vector())] {
                        let direction = (grazing + 1e-3 * n).normalize();
                        assert!(!tracer.is_blocked(origin, direction), "scale {scale}, point {target}");
                        n_tested += 1;
                    }
                    assert!(tracer.is_blocked(origin, -n), "the lift must stay on its side");
                }
            }
        }
        assert!(n_tested > 9000, "{n_tested}");
    }

    #[test]
    fn unusable_surfaces_are_refused() {
        let normals = [Vec3::Y; 3];
        let good = triangle(&CORNERS, &normals);
        let nan = [Vec3::NAN; 3];
        for surface in [
            Surface { index: &[], ..good },
            Surface { index: &[[0, 1, 3]], ..good },
            Surface { position: &nan, ..good },
            Surface { normal: &normals[..2], ..good },
            Surface { albedo: &[Vec3::splat(1.5); 3], ..good },
            Surface { albedo: &nan, ..good },
        ] {
            let Err(error) = Tracer::new(surface) else { panic!("accepted {surface:?}") };
            assert!(matches!(error, Error::Surface { .. }));
            assert_eq!(error.to_string().lines().count(), 1);
        }
    }

    #[test]
    fn unusable_gloss_and_portals_are_refused() {
        let normals = [Vec3::Y; 3];
        let (s, e) = ([Vec3::splat(0.5); 3], [3.0f32; 3]);
        let glossy = |specular, exponent| {
            Tracer::new(triangle(&CORNERS, &normals)).unwrap().with_gloss(Gloss { specular, exponent })
        };
        assert!(glossy(&s, &e).is_ok());
        for (specular, exponent) in [
            (&s[..2], &e[..]),
            (&s, &[3.0, 3.0, -1.0]),
            (&s, &[3.0, f32::NAN, 1.0]),
            (&[Vec3::splat(0.6); 3], &e),
            (&[Vec3::NAN; 3], &e),
        ] {
            let Err(error) = glossy(specular, exponent) else { panic!("accepted {specular:?} {exponent:?}") };
            assert_eq!(error.to_string().lines().count(), 1);
        }
        let tracer = Tracer::new(triangle(&CORNERS, &normals)).unwrap();
        assert!(tracer.with_portals(&[[Vec3::ZERO, Vec3::NAN, Vec3::X]]).is_err());
    }
}
