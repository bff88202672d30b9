//! What stands in a picture beside the baked scene: moving bodies, and lamps as balls of light.
//!
//! One surface holds all: the scene's vertices first, then those of each prop in the order in which they were added, so
//! that the scene's radiances can be extended by the props'. A lamp is drawn as a ball of facets, smaller than its sphere
//! by up to 1 %.

use std::f32::consts::{PI, TAU};
use std::ops::Range;

use glam::{Vec3, vec3};

use crate::tracer::Surface;

/// Rings of a ball between its poles.
const RINGS: usize = 24;

/// A surface that grows.
#[derive(Clone, Debug, Default)]
pub struct Props {
    position: Vec<Vec3>,
    normal: Vec<Vec3>,
    index: Vec<[u32; 3]>,
    albedo: Vec<Vec3>,
}

impl Props {
    /// A copy of the scene, without a prop.
    pub fn new(scene: &Surface) -> Props {
        Props {
            position: scene.position.to_vec(),
            normal: scene.normal.to_vec(),
            index: scene.index.to_vec(),
            albedo: scene.albedo.to_vec(),
        }
    }

    /// Adds a body that already stands where it is seen; gives the place of its vertices.
    pub fn add(&mut self, body: &Surface) -> Range<usize> {
        let first = self.position.len();
        self.position.extend_from_slice(body.position);
        self.normal.extend_from_slice(body.normal);
        self.albedo.extend_from_slice(body.albedo);
        self.index.extend(body.index.iter().map(|t| t.map(|v| v + first as u32)));
        first..self.position.len()
    }

    /// Adds a white ball; gives the place of its vertices.
    pub fn add_ball(&mut self, centre: Vec3, radius: f32) -> Range<usize> {
        let columns = 2 * RINGS;
        let on_sphere = |k: usize| {
            let (theta, phi) =
                ((k / columns) as f32 * PI / RINGS as f32, (k % columns) as f32 * TAU / columns as f32);
            vec3(theta.sin() * phi.cos(), theta.cos(), -theta.sin() * phi.sin())
        };
        let normal: Vec<Vec3> = (0..(RINGS + 1) * columns).map(on_sphere).collect();
        let position: Vec<Vec3> = normal.iter().map(|n| centre + radius * *n).collect();
        let quad = |k: usize| {
            let (row, column) = (k / columns, k % columns);
            let corner = |r: usize, c: usize| ((row + r) * columns + (column + c) % columns) as u32;
            [[corner(0, 0), corner(1, 0), corner(1, 1)], [corner(0, 0), corner(1, 1), corner(0, 1)]]
        };
        let index: Vec<[u32; 3]> = (0..RINGS * columns).flat_map(quad).collect();
        let albedo = vec![Vec3::ONE; position.len()];
        self.add(&Surface { position: &position, normal: &normal, index: &index, albedo: &albedo })
    }

    /// All of it.
    pub fn surface(&self) -> Surface<'_> {
        Surface { position: &self.position, normal: &self.normal, index: &self.index, albedo: &self.albedo }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Tracer, trace};

    const FLOOR: [Vec3; 3] = [vec3(-9.0, 0.0, -9.0), vec3(0.0, 0.0, 9.0), vec3(9.0, 0.0, -9.0)];

    #[test]
    fn ball_is_seen_over_the_scene_as_large_as_it_is() {
        let floor =
            Surface { position: &FLOOR, normal: &[Vec3::Y; 3], index: &[[0, 1, 2]], albedo: &[Vec3::ONE; 3] };
        let mut props = Props::new(&floor);
        let place = props.add_ball(vec3(0.0, 1.0, 0.0), 0.5);
        let surface = props.surface();
        assert_eq!(place, 3..surface.position.len());
        let tracer = Tracer::new(surface).unwrap();
        let camera = Camera::new(vec3(0.0, 11.0, 0.0), Vec3::ZERO, 12.0);
        let seen = trace(&tracer, &camera, 64, 64).unwrap();
        let mut radiance = vec![Vec3::ZERO; surface.position.len()];
        radiance[place].fill(Vec3::ONE);
        let image = seen.shade(&surface, &radiance, |_| Vec3::ZERO).unwrap();
        let share = image.pixels.iter().map(|p| p.x).sum::<f32>() / (64.0 * 64.0);
        // A cone of sine 1/20 in a square of half side tan 6°.
        let truth = PI * (0.05f32.asin().tan() / 6f32.to_radians().tan()).powi(2) / 4.0;
        // Facets take up to 1 % of the radius, 16 rays a pixel leave less.
        assert!((share / truth - 1.0).abs() < 0.02, "{share} {truth}");
    }
}
