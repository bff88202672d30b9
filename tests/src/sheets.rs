//! Scenes of flat sheets, for what no built-in scene shows.

use glam::{Vec3, vec3};
use lunette_scenes::{Material, Mesh, Scene};

/// A scene under construction.
#[derive(Default)]
pub struct Sheets {
    mesh: Mesh,
}

impl Sheets {
    /// Adds the parallelogram from `corner` along `u` and `v`, facing u × v, in `n` x `n` cells.
    pub fn add(&mut self, corner: Vec3, u: Vec3, v: Vec3, n: u32) {
        let first = self.mesh.position.len() as u32;
        let normal = u.cross(v).normalize();
        for i in 0..=n {
            for j in 0..=n {
                self.mesh.position.push(corner + (u * i as f32 + v * j as f32) / n as f32);
                self.mesh.normal.push(normal);
            }
        }
        for i in 0..n {
            for j in 0..n {
                let a = first + i * (n + 1) + j;
                let (b, c, d) = (a + n + 1, a + n + 2, a + 1);
                self.mesh.index.extend([[a, b, c], [a, c, d]]);
            }
        }
    }

    /// Vertices so far.
    pub fn n_vertices(&self) -> usize {
        self.mesh.position.len()
    }

    /// Adds the six sides of the box between two corners.
    pub fn add_box(&mut self, low: Vec3, high: Vec3, facing: Facing, n: u32) {
        let e = high - low;
        let (x, y, z) = (vec3(e.x, 0.0, 0.0), vec3(0.0, e.y, 0.0), vec3(0.0, 0.0, e.z));
        for (u, v) in [(x, y), (y, z), (z, x)] {
            let (u, v) = if facing == Facing::Inwards { (u, v) } else { (v, u) };
            self.add(low, u, v, n);
            self.add(high, -v, -u, n);
        }
    }

    /// Albedo 0.5 everywhere.
    pub fn scene(mut self) -> Scene {
        let n_triangles = self.mesh.index.len();
        self.mesh.material = vec![0; n_triangles];
        self.mesh.group = vec![0; n_triangles];
        Scene {
            mesh: self.mesh,
            materials: vec![Material::default()],
            groups: vec!["sheets".into()],
            report: vec![],
        }
    }
}

/// Where the front of a box's sides is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Facing {
    /// A room.
    Inwards,
    /// A block.
    Outwards,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_face_where_they_are_told() {
        for (facing, sign) in [(Facing::Inwards, -1.0), (Facing::Outwards, 1.0)] {
            let mut sheets = Sheets::default();
            sheets.add_box(Vec3::splat(-1.0), Vec3::ONE, facing, 2);
            let mesh = sheets.scene().mesh;
            assert_eq!(mesh.index.len(), 6 * 8);
            for (p, n) in mesh.position.iter().zip(&mesh.normal) {
                assert!(sign * p.dot(*n) > 0.99, "{p} {n}");
            }
        }
    }
}
