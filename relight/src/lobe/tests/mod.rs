//! Ground truth for the method: quadrature of products, and rays against spheres, sharing no code with it.

mod algebra;
mod reflectance;
mod shadows;
mod stability;
mod sums;
mod sun;

use glam::Vec3;

use super::{
    Blockers, Lamp, Motion, Options, Points, Scene, Scratch, Sphere, SphereSet, Target, add_irradiance,
};

/// Repeatable numbers in 0..1 (xorshift64*).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn direction(&mut self) -> Vec3 {
        let z = 2.0 * self.unit() - 1.0;
        let (sin, cos) = (std::f64::consts::TAU * self.unit()).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new((r * cos) as f32, (r * sin) as f32, z as f32)
    }
}

/// Distance to the first hit of a ray with a sphere, from outside or inside.
fn hit(origin: Vec3, direction: Vec3, sphere: &Sphere) -> Option<f32> {
    let to = sphere.centre - origin;
    let along = to.dot(direction);
    let root = sphere.radius * sphere.radius - (to - along * direction).length_squared();
    if root < 0.0 {
        return None;
    }
    let near = along - root.sqrt();
    let far = along + root.sqrt();
    if near > 0.0 { Some(near) } else { (far > 0.0).then_some(far) }
}

/// Irradiance from one lamp of radiance 1 past spheres: a midpoint rule, n × 4n rays, over the lamp's cap in
/// equal-area coordinates.
fn traced(point: Vec3, normal: Vec3, lamp: &Lamp, spheres: &[Sphere], n: usize) -> f32 {
    let to = lamp.centre - point;
    let axis = to.normalize();
    let sin = lamp.radius / to.length();
    let versine = sin * sin / (1.0 + (1.0 - sin * sin).sqrt());
    let (across, up) = axis.any_orthonormal_pair();
    let light = Sphere { centre: lamp.centre, radius: lamp.radius };
    if spheres.iter().any(|s| s.centre.distance(point) < s.radius) {
        return 0.0;
    }
    let mut sum = 0.0f64;
    for i in 0..n {
        for j in 0..4 * n {
            let drop = versine * (i as f32 + 0.5) / n as f32;
            let angle = std::f32::consts::TAU * (j as f32 + 0.5) / (4 * n) as f32;
            let r = (drop * (2.0 - drop)).sqrt();
            let direction = axis * (1.0 - drop) + (across * angle.cos() + up * angle.sin()) * r;
            let cos = direction.dot(normal);
            let Some(limit) = hit(point, direction, &light).filter(|_| cos > 0.0) else { continue };
            let blocks = |s: &Sphere| hit(point, direction, s).is_some_and(|t| t < limit);
            let blocked = spheres.iter().any(blocks);
            sum += if blocked { 0.0 } else { f64::from(cos) };
        }
    }
    (sum / (4 * n * n) as f64 * f64::from(versine) * std::f64::consts::TAU) as f32
}

/// The lobes' irradiance, first channel.
fn by_lobes(
    positions: &[[f32; 3]],
    normal: Vec3,
    lamps: &[Lamp],
    spheres: &[Sphere],
    options: &Options,
) -> Vec<f32> {
    let mut blockers = Blockers::default();
    if !spheres.is_empty() {
        blockers.push(&SphereSet::new(spheres.to_vec()).unwrap(), &Motion::default());
    }
    let normals = vec![normal.to_array(); positions.len()];
    let mut light = vec![[0.0; 3]; positions.len()];
    let points = Points { position: positions, normal: &normals };
    let mut target = Target { light: &mut light, products: None };
    let scene = Scene { lamps, blockers: &blockers };
    add_irradiance(&points, &scene, options, &mut Scratch::default(), &mut target);
    assert!(light.iter().flatten().all(|e| e.is_finite() && *e >= 0.0), "light is finite and not negative");
    light.iter().map(|e| e[0]).collect()
}

/// n × n points on the ground, over a square of this half side.
fn ground(n: usize, half: f32) -> Vec<[f32; 3]> {
    let at = |i: usize| ((i as f32 + 0.5) / n as f32 * 2.0 - 1.0) * half;
    (0..n * n).map(|k| [at(k % n), 0.0, at(k / n)]).collect()
}

fn lamp(centre: [f32; 3], radius: f32) -> Lamp {
    Lamp::new(centre.into(), radius, Vec3::ONE).unwrap()
}

/// Σ|a - b| / Σ|b|.
fn relative_difference(a: &[f32], b: &[f32]) -> f64 {
    let difference: f64 = a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum();
    difference / b.iter().map(|b| f64::from(b.abs())).sum::<f64>()
}

/// A creature of 64 spheres, about as large as 1 m, standing on y = 0: body, haunch, head and two ears.
fn creature() -> Vec<Sphere> {
    let mut spheres = Vec::new();
    let mut random = Random(7);
    let parts = [
        ([0.0, 0.3, 0.0], [0.34, 0.28, 0.24], 28),
        ([-0.2, 0.22, 0.0], [0.2, 0.2, 0.25], 12),
        ([0.3, 0.6, 0.0], [0.17, 0.15, 0.14], 12),
        ([0.27, 0.85, 0.08], [0.04, 0.17, 0.05], 6),
        ([0.27, 0.85, -0.08], [0.04, 0.17, 0.05], 6),
    ];
    for (centre, size, n) in parts {
        let size = Vec3::from(size);
        for _ in 0..n {
            let place = random.direction() * (0.7 * random.unit().cbrt()) as f32;
            let room = 1.0 - place.length();
            let radius = size.min_element() * (0.35 + 0.65 * room);
            spheres.push(Sphere { centre: Vec3::from(centre) + place * size, radius });
        }
    }
    spheres
}
