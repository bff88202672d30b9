//! Highlights of suns between glossy vertices.
//!
//! A vertex sends to the eye what [`glossy`](crate::glossy) says. Between vertices that is interpolated, which spreads the
//! highlight of a sun over whole triangles of a curved surface and over shadows' edges. What is to be added at a point, of a
//! beam towards a, is
//!
//! Ks (e + 2)/(2π) max(r·a, 0)^e E - Σ over corners w Ks(v) (e(v) + 2)/(2π) max(r(v)·a, 0)^e(v) E(v),
//!
//! Ks, e and the normal by which the eye is mirrored being interpolated, and E as [`Detail`](super::Detail) has it.

use glam::Vec3;

use super::{PortalFrame, point::Point};
use crate::glossy::{GlossyVertex, phong};

/// How a point and the corners of its triangle mirror the eye.
pub(super) struct Highlight {
    point: Mirror,
    /// Times their weights.
    corners: [Mirror; 3],
}

#[derive(Clone, Copy, Default)]
struct Mirror {
    specular: Vec3,
    exponent: f32,
    /// Of the eye.
    direction: Vec3,
}

impl Highlight {
    /// `None` where no corner is glossy.
    pub fn new(frame: &PortalFrame, point: &Point, eye: Vec3) -> Option<Highlight> {
        let found = |v: u32| frame.gloss.binary_search_by_key(&v, |gloss| gloss.vertex).ok();
        let gloss = point.corners.map(|v| found(v).map(|at| &frame.gloss[at]));
        let whole: f32 = gloss.iter().zip(point.weights).filter(|(g, _)| g.is_some()).map(|(_, w)| w).sum();
        if whole <= 0.0 {
            return None;
        }
        let mean = |of: &dyn Fn(&GlossyVertex) -> Vec3| -> Vec3 {
            let glossy = gloss.iter().zip(point.weights).filter_map(|(g, w)| Some(w * of((*g)?)));
            glossy.sum()
        };
        let place = |v: u32| Vec3::from(frame.receivers.position[v as usize]);
        let mirrored = |at: Vec3, normal: Vec3| (at - eye).normalize_or_zero().reflect(normal);
        let at: Vec3 = point.corners.iter().zip(point.weights).map(|(v, w)| w * place(*v)).sum();
        let mirror = Mirror {
            specular: mean(&|g| g.specular),
            exponent: mean(&|g| Vec3::splat(g.exponent)).x / whole,
            direction: mirrored(at, mean(&|g| g.normal).normalize_or_zero()),
        };
        let corner = |i: usize| {
            gloss[i].map_or_else(Mirror::default, |g| Mirror {
                specular: point.weights[i] * g.specular,
                exponent: g.exponent,
                direction: mirrored(place(point.corners[i]), g.normal),
            })
        };
        Some(Highlight { point: mirror, corners: [0, 1, 2].map(corner) })
    }

    /// What a beam towards `axis` of radiance 1 adds to the eye, by its irradiance of the point and of the corners.
    pub fn more(&self, axis: Vec3, point: f32, corners: [f32; 3]) -> Vec3 {
        let interpolated: Vec3 = self.corners.iter().zip(corners).map(|(c, e)| c.radiance(axis, e)).sum();
        self.point.radiance(axis, point) - interpolated
    }
}

impl Mirror {
    fn radiance(&self, axis: Vec3, irradiance: f32) -> Vec3 {
        if irradiance == 0.0 || self.specular == Vec3::ZERO {
            return Vec3::ZERO;
        }
        irradiance * phong(self.direction.dot(axis), self.exponent) * self.specular
    }
}
