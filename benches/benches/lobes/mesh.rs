//! Shadows of spheres by lobes against rays: past the same spheres, and past the true mesh.

use glam::Vec3;
use lunette_ffi::{Device, Ray, SceneBuilder};
use lunette_relight::lobe::{
    Lamp, Options, Points, Scene, Scratch, Sphere, SphereSet, Target, add_irradiance,
};

use super::scene::{Body, HEIGHTS, blockers, lamp_of, motion, plane};

/// Points along a side of the plane.
const SIDE: usize = 40;
/// Radii of the lamp, metres, 5 m over the plane.
const RADII: [f32; 3] = [0.1, 0.4, 1.0];

pub fn against_rays(body: &Body, set: &SphereSet) -> Result<(), Box<dyn std::error::Error>> {
    println!("{}, depth 5, proportional: relative difference, whole plane", body.name);
    println!(
        "{:>7} {:>7} {:>13} {:>10} {:>22}",
        "radius", "height", "same spheres", "true mesh", "spheres from mesh, rays"
    );
    let device = Device::new()?;
    for radius in RADII {
        for height in HEIGHTS {
            let lit = by_lobes(set, height, radius);
            let rays = Rays { rings: 20, lamp: lamp_of(radius) };
            let spheres = moved(set, height);
            let positions = plane(SIDE).position;
            let by_spheres: Vec<f32> =
                positions.iter().map(|&p| rays.light(p.into(), hits_spheres(&spheres))).collect();
            let place = motion(height);
            let position: Vec<[f32; 3]> =
                body.position.iter().map(|p| (place.rotation * *p + place.translation).to_array()).collect();
            let mut builder = SceneBuilder::new(&device)?;
            builder.add_triangles(&position, &body.index)?;
            let mesh = builder.commit()?;
            let hit = |origin: Vec3, direction: Vec3| {
                mesh.occluded(&Ray::new(origin.to_array(), direction.to_array()))
            };
            let by_mesh: Vec<f32> = positions.iter().map(|&p| rays.light(p.into(), hit)).collect();
            let (same, true_mesh) = (relative(&lit, &by_spheres), relative(&lit, &by_mesh));
            let fit = relative(&by_spheres, &by_mesh);
            println!("{radius:>7} {height:>7} {same:>13.5} {true_mesh:>10.5} {fit:>22.5}");
        }
    }
    Ok(())
}

fn by_lobes(set: &SphereSet, height: f32, radius: f32) -> Vec<f32> {
    let (plane, blockers) = (plane(SIDE), blockers(set, height));
    let mut light = vec![[0.0; 3]; plane.position.len()];
    let points = Points { position: &plane.position, normal: &plane.normal };
    let scene = Scene { lamps: &[lamp_of(radius)], blockers: &blockers };
    let mut target = Target { light: &mut light, products: None };
    add_irradiance(&points, &scene, &Options::default(), &mut Scratch::default(), &mut target);
    light.iter().map(|c| c[0]).collect()
}

fn relative(a: &[f32], b: &[f32]) -> f64 {
    let off: f64 = a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum();
    off / b.iter().map(|b| f64::from(*b)).sum::<f64>()
}

/// The set's spheres where the body stands.
pub fn moved(set: &SphereSet, height: f32) -> Vec<Sphere> {
    let place = motion(height);
    let centre = |s: &Sphere| place.rotation * s.centre + place.translation;
    set.spheres().iter().map(|s| Sphere { centre: centre(s), radius: s.radius }).collect()
}

/// Whether a ray from a point meets one of the spheres.
pub fn hits_spheres(spheres: &[Sphere]) -> impl Fn(Vec3, Vec3) -> bool {
    |origin, direction| {
        spheres.iter().any(|s| {
            let to = s.centre - origin;
            let along = to.dot(direction);
            along > 0.0 && (to - along * direction).length_squared() < s.radius * s.radius
        })
    }
}

/// Rays over a lamp's cap, `rings` × 4 `rings`, in equal-area coordinates. Nothing stands behind the lamp.
pub struct Rays {
    pub rings: usize,
    pub lamp: Lamp,
}

impl Rays {
    /// Irradiance of a point that faces up.
    pub fn light(&self, point: Vec3, hit: impl Fn(Vec3, Vec3) -> bool) -> f32 {
        let to = self.lamp.centre - point;
        let sin = self.lamp.radius / to.length();
        let versine = sin * sin / (1.0 + (1.0 - sin * sin).sqrt());
        let axis = to.normalize();
        let (across, up) = axis.any_orthonormal_pair();
        let spokes = 4 * self.rings;
        let mut sum = 0.0f64;
        for k in 0..self.rings * spokes {
            let drop = versine * ((k / spokes) as f32 + 0.5) / self.rings as f32;
            let (s, c) = (std::f32::consts::TAU * ((k % spokes) as f32 + 0.5) / spokes as f32).sin_cos();
            let direction = axis * (1.0 - drop) + (across * c + up * s) * (drop * (2.0 - drop)).sqrt();
            if !hit(point, direction) {
                sum += f64::from(direction.y);
            }
        }
        (sum / (self.rings * spokes) as f64 * f64::from(versine) * std::f64::consts::TAU) as f32
    }
}
