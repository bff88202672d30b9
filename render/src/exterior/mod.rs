//! What stands outside the windows, and moves: rigid objects, each of a mesh of its own.
//!
//! Surfaces are Lambertian, opaque and two-sided. Their light is `albedo/π E` with `E` from the discs of the light (suns,
//! lamps) through shadow rays among all objects, and from the smooth rest of it (see
//! [`split`](lunette_relight::light::split)) by SH of order 3: per triangle the mean of `T_i = ∫ V(w) max(n·w, 0) y_i(w) dw`
//! is found once with rays against the object's own mesh, so that an object shades itself under the sky wherever it
//! moves. A mean over triangles has no dark vertices where walls meet the ground, and a texel is broad.
//!
//! Where it breaks: a triangle that is large against its shadows shows their mean; objects do not shade each other from the smooth sky, only from discs, and light bounces off none of
//! them onto another.
//!
//! Based on: Sloan, Kautz and Snyder, Precomputed Radiance Transfer for Real-Time Rendering in Dynamic, Low-Frequency
//! Lighting Environments, 2002; Yue et al., Interactive Rendering of Interior Scenes with Dynamic Environment
//! Illumination, 2009 (the two conditions that outside objects must meet, sec. 6).

use crate::error::Error;
use crate::reference::{hash, scatter::cosine_lobe};
use crate::tracer::{Surface, Tracer};
use glam::{Quat, Vec3};
use lunette_ffi::{Device, Mask, Packet, Ray, Scene, SceneBuilder, Transform};
use lunette_relight::light::SMOOTH_ORDER;
use lunette_relight::sh;
use rayon::prelude::*;
use std::f32::consts::PI;
use std::sync::Arc;

mod nearness;
mod track;

pub use nearness::Overlap;
pub use track::Track;

/// SH coefficients of the smooth light.
pub(crate) const N_SMOOTH: usize = SMOOTH_ORDER * SMOOTH_ORDER;

/// Rays per triangle for its transfer, a multiple of 16: it is seen in texels only, mostly with its neighbours.
const TRANSFER_RAYS: usize = 64;

/// Share of the exterior's extent by which shadow rays start above a surface: what they start from is a point along a
/// long ray, not an exact one, and a texel sees no finer shadow.
const SHADOW_LIFT: f32 = 1e-4;

/// Where an object is: its mesh is turned around the origin of its own coordinates, then moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Unit.
    pub rotation: Quat,
    /// Metres.
    pub position: Vec3,
}

impl Default for Pose {
    /// As the mesh was made.
    fn default() -> Self {
        Pose { rotation: Quat::IDENTITY, position: Vec3::ZERO }
    }
}

impl Pose {
    fn apply(&self, p: Vec3) -> Vec3 {
        self.rotation * p + self.position
    }
}

/// Objects outside, ready for rays.
pub struct Exterior {
    objects: Vec<Object>,
    scene: Scene,
}

/// One rigid object, in its own coordinates.
pub(crate) struct Object {
    pub pose: Pose,
    position: Vec<Vec3>,
    index: Vec<[u32; 3]>,
    /// Means over triangles, \[T\].
    albedo: Vec<Vec3>,
    /// Of the smooth light, means over triangles, \[T\].
    transfer: Vec<[f32; N_SMOOTH]>,
    /// Largest distance from the origin, metres.
    reach: f32,
}

impl Exterior {
    /// Builds search trees and finds how each object shades itself; all objects are in the default pose.
    ///
    /// # Errors
    /// [`Error::Surface`] for a mesh that cannot be traced; [`Error::Embree`] where Embree is missing.
    pub fn new(meshes: &[Surface]) -> Result<Exterior, Error> {
        let device = Device::new()?;
        let mut builder = SceneBuilder::new(&device)?;
        let mut objects = Vec::new();
        for mesh in meshes {
            let mut object = SceneBuilder::new(&device)?;
            let tracer = Tracer::new(*mesh)?;
            object.add_triangles(bytemuck::cast_slice(mesh.position), mesh.index)?;
            builder.add_instance(&Arc::new(object.commit()?), transform(&Pose::default()))?;
            objects.push(Object {
                pose: Pose::default(),
                position: mesh.position.to_vec(),
                index: mesh.index.to_vec(),
                albedo: mesh.index.iter().map(|t| mean(t.map(|i| mesh.albedo[i as usize]))).collect(),
                transfer: self_shadowed_transfer(&tracer),
                reach: mesh.position.iter().map(|p| p.length()).fold(0.0, f32::max),
            });
        }
        Ok(Exterior { objects, scene: builder.commit()? })
    }

    /// Number of objects.
    pub fn n_objects(&self) -> usize {
        self.objects.len()
    }

    /// Moves an object.
    ///
    /// # Errors
    /// [`Error::Options`] for an object that is not there, or a pose that is not finite.
    pub fn set_pose(&mut self, object: usize, pose: Pose) -> Result<(), Error> {
        let n = self.objects.len();
        let Some(moved) = self.objects.get_mut(object) else {
            return Err(Error::Options { what: format!("exterior: no object {object}, there are {n}") });
        };
        if !(pose.position.is_finite() && pose.rotation.is_normalized()) {
            return Err(Error::Options {
                what: format!(
                    "exterior: object {object} cannot be put at {pose:?}: not finite, or no rotation"
                ),
            });
        }
        moved.pose = pose;
        Ok(self.scene.set_instance_transform(object as u32, transform(&pose))?)
    }

    pub(crate) fn objects(&self) -> &[Object] {
        &self.objects
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// How far above a surface shadow rays start, metres.
    pub(crate) fn shadow_lift(&self) -> f32 {
        let reach = |object: &Object| object.reach + object.pose.position.length();
        SHADOW_LIFT * self.objects.iter().map(reach).fold(0.0, f32::max)
    }
}

impl Object {
    /// Irradiance by the smooth light, given in the object's own frame, and albedo, of a triangle.
    pub fn smooth_irradiance(&self, triangle: u32, light: &[[f32; 3]; N_SMOOTH]) -> (Vec3, Vec3) {
        let transfer = &self.transfer[triangle as usize];
        let irradiance: Vec3 = transfer.iter().zip(light).map(|(t, l)| *t * Vec3::from(*l)).sum();
        // SH of order 3 rings: a dark side may come out a little below 0.
        (irradiance.max(Vec3::ZERO), self.albedo[triangle as usize])
    }

    /// Corners in the world.
    fn triangles(&self) -> impl IndexedParallelIterator<Item = [Vec3; 3]> + '_ {
        self.index.par_iter().map(|t| t.map(|i| self.pose.apply(self.position[i as usize])))
    }
}

fn transform(pose: &Pose) -> Transform {
    let m = glam::Mat3::from_quat(pose.rotation);
    std::array::from_fn(|row| {
        let r = m.row(row);
        [r.x, r.y, r.z, pose.position[row]]
    })
}

fn mean([a, b, c]: [Vec3; 3]) -> Vec3 {
    (a + b + c) / 3.0
}

/// `T_i` of each triangle: mean of V y_i, times π, over rays from points all over it, each with a cosine lobe.
fn self_shadowed_transfer(tracer: &Tracer) -> Vec<[f32; N_SMOOTH]> {
    let of_triangle = |t: usize| {
        let mut transfer = [0.0; N_SMOOTH];
        for first in (0..TRANSFER_RAYS).step_by(16) {
            let mut rays = Packet::<16>::default();
            let directions: [Vec3; 16] = std::array::from_fn(|lane| {
                let (origin, direction) = transfer_ray(tracer, t, (first + lane) as u32);
                rays.set(lane, &Ray::new(origin.to_array(), direction.to_array()));
                direction
            });
            tracer.scene().occluded_packet(&Mask::all(), &mut rays);
            for (_, d) in directions.iter().enumerate().filter(|(lane, _)| !rays.is_occluded(*lane)) {
                let mut y = [0.0; N_SMOOTH];
                sh::eval(SMOOTH_ORDER, *d, &mut y);
                transfer.iter_mut().zip(y).for_each(|(t, y)| *t += y * PI / TRANSFER_RAYS as f32);
            }
        }
        transfer
    };
    (0..tracer.surface().index.len()).into_par_iter().map(of_triangle).collect()
}

/// Ray `i` of a triangle: from a point of it, on the side of its shading normals.
fn transfer_ray(tracer: &Tracer, triangle: usize, i: u32) -> (Vec3, Vec3) {
    let Surface { position, normal, index, .. } = tracer.surface();
    let corners = index[triangle].map(|i| i as usize);
    let draw =
        |dimension| hash::stratified_2d(i, TRANSFER_RAYS as u32, hash::mix([triangle as u32, dimension]));
    let place = draw(0);
    let side = place.x.sqrt();
    let weights = [1.0 - side, side * (1.0 - place.y), side * place.y];
    let at = |values: &[Vec3]| corners.into_iter().zip(weights).map(|(v, w)| w * values[v]).sum::<Vec3>();
    let n = at(normal).normalize_or(Vec3::Y);
    (tracer.lift(at(position), n), cosine_lobe(n, draw(1)))
}

#[cfg(test)]
mod tests;
