//! Small geometry for tests.

use crate::tracer::Surface;
use glam::Vec3;

/// Owns what a [`Surface`] looks at. Quadrilaterals of one normal and albedo each.
#[derive(Default)]
pub(crate) struct Geometry {
    pub position: Vec<Vec3>,
    pub normal: Vec<Vec3>,
    pub index: Vec<[u32; 3]>,
    pub albedo: Vec<Vec3>,
}

impl Geometry {
    pub fn surface(&self) -> Surface<'_> {
        Surface { position: &self.position, normal: &self.normal, index: &self.index, albedo: &self.albedo }
    }

    /// The parallelogram `corner + s a + t b`, its normal towards `a x b`.
    pub fn add(&mut self, corner: Vec3, a: Vec3, b: Vec3, albedo: Vec3) {
        let first = self.position.len() as u32;
        self.position.extend([corner, corner + a, corner + a + b, corner + b]);
        self.normal.extend([a.cross(b).normalize(); 4]);
        self.albedo.extend([albedo; 4]);
        self.index.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    /// The six sides of a box, normals outwards for a `turn` of 1, inwards for -1.
    pub fn add_box(&mut self, low: Vec3, size: Vec3, albedo: Vec3, turn: f32) {
        let [x, y, z] = [size.x * Vec3::X, size.y * Vec3::Y, size.z * Vec3::Z];
        for (corner, a, b) in
            [(low, z, y), (low, x, z), (low, y, x), (low + x, y, z), (low + y, z, x), (low + z, x, y)]
        {
            let (a, b) = if turn > 0.0 { (a, b) } else { (b, a) };
            self.add(corner, a, b, albedo);
        }
    }
}

/// A white box around the origin, normals inwards.
pub(crate) fn closed_box(size: Vec3) -> Geometry {
    let mut geometry = Geometry::default();
    geometry.add_box(-0.5 * size, size, Vec3::ONE, -1.0);
    geometry
}

/// A grey floor of 8 m with a reddish block and a blue wall on it.
pub(crate) fn floor_with_block() -> Geometry {
    let mut geometry = Geometry::default();
    geometry.add(Vec3::new(-4.0, 0.0, -4.0), 8.0 * Vec3::Z, 8.0 * Vec3::X, Vec3::splat(0.6));
    geometry.add_box(Vec3::new(-0.5, 0.0, -1.0), Vec3::new(1.5, 2.0, 1.5), Vec3::new(0.8, 0.3, 0.2), 1.0);
    geometry.add_box(Vec3::new(-3.0, 0.0, -3.0), Vec3::new(0.3, 3.0, 5.0), Vec3::new(0.2, 0.4, 0.8), 1.0);
    geometry
}
