//! Shadows of spheres by lobes against rays: past the same spheres, and past the true mesh.

use glam::Vec3;
use lunette_ffi::{Device, Ray, SceneBuilder};
use lunette_relight::lobe::{
    Lamp, Options, Points, Policy, Scene, Scratch, Sphere, SphereSet, Target, add_irradiance,
};

use super::scene::{Body, HEIGHTS, blockers, lamp_of, motion, plane};

/// Points along a side of the plane.
const SIDE: usize = 40;
/// Radii of the lamp, metres, 5 m over the plane.
const RADII: [f32; 3] = [0.1, 0.4, 1.0];

/// Five spheres, the paper's Fig. 13; the lowest is 0.6 m over the plane.
pub fn five_spheres() -> Result<SphereSet, Box<dyn std::error::Error>> {
    let places = [[0.0, 1.0, 0.0], [1.2, 0.9, 0.4], [-1.1, 1.0, 0.7], [0.4, 1.8, -0.9], [-0.5, 1.1, -1.3]];
    let sphere =
        |(i, centre): (usize, &[f32; 3])| Sphere { centre: (*centre).into(), radius: 0.3 + 0.06 * i as f32 };
    Ok(SphereSet::new(places.iter().enumerate().map(sphere).collect())?)
}

/// The spheres' shadows against rays past the same spheres and, where there is one, past the mesh they stand for.
pub fn against_rays(
    name: &str,
    set: &SphereSet,
    body: Option<&Body>,
) -> Result<(), Box<dyn std::error::Error>> {
    println!(
        "\n{name}, depth 5: relative difference over the plane, and where a percent or more of the light is hidden"
    );
    println!("{:>7} {:>7} {:>23} {:>23} {:>23}", "", "", "proportional", "aggressive", "proportional");
    println!(
        "{:>7} {:>7} {:>23} {:>23} {:>23} {:>20}",
        "radius",
        "height",
        "same spheres, shadow",
        "same spheres, shadow",
        "true mesh, of hidden",
        "spheres from mesh"
    );
    for (radius, height) in RADII.into_iter().flat_map(|r| HEIGHTS.map(|h| (r, h))) {
        let [lit, aggressive] = [Policy::Proportional, Policy::Aggressive]
            .map(|policy| by_lobes(set, height, radius, &Options { policy, ..Options::default() }));
        let rays = Rays { rings: 20, lamp: lamp_of(radius) };
        let spheres = moved(set, height);
        let by_spheres = rays.over_plane(hits_spheres(&spheres));
        let open = rays.over_plane(|_, _| false);
        let judge = |a: &[f32], b: &[f32]| {
            let everywhere = relative(a, b, |_| true);
            let shadow = relative(a, b, |k| b[k] < 0.99 * open[k]);
            format!("{everywhere:.5}, {shadow:.5}")
        };
        let (same, by_aggressive) = (judge(&lit, &by_spheres), judge(&aggressive, &by_spheres));
        let mesh = match body {
            None => String::new(),
            Some(body) => {
                let by_mesh = by_embree(body, height, &rays)?;
                // Of the light that the mesh hides: in a deep umbra hardly any is left to be relative to.
                let hidden: Vec<f32> = open.iter().zip(&by_mesh).map(|(open, lit)| open - lit).collect();
                let ours: Vec<f32> = open.iter().zip(&lit).map(|(open, lit)| open - lit).collect();
                let everywhere = relative(&lit, &by_mesh, |_| true);
                let judged = format!("{everywhere:.5}, {:.5}", relative(&ours, &hidden, |_| true));
                format!(" {judged:>23} {:>20.5}", relative(&by_spheres, &by_mesh, |_| true))
            }
        };
        println!("{radius:>7} {height:>7} {same:>23} {by_aggressive:>23}{mesh}");
    }
    Ok(())
}

fn by_embree(body: &Body, height: f32, rays: &Rays) -> Result<Vec<f32>, Box<dyn std::error::Error>> {
    let place = motion(height);
    let position: Vec<[f32; 3]> =
        body.position.iter().map(|p| (place.rotation * *p + place.translation).to_array()).collect();
    let device = Device::new()?;
    let mut builder = SceneBuilder::new(&device)?;
    builder.add_triangles(&position, &body.index)?;
    let mesh = builder.commit()?;
    Ok(rays.over_plane(|origin, direction| mesh.occluded(&Ray::new(origin.to_array(), direction.to_array()))))
}

fn by_lobes(set: &SphereSet, height: f32, radius: f32, options: &Options) -> Vec<f32> {
    let (plane, blockers) = (plane(SIDE), blockers(set, height));
    let mut light = vec![[0.0; 3]; plane.position.len()];
    let points = Points { position: &plane.position, normal: &plane.normal };
    let scene = Scene { lamps: &[lamp_of(radius)], blockers: &blockers };
    let mut target = Target { light: &mut light, products: None };
    add_irradiance(&points, &scene, options, &mut Scratch::default(), &mut target);
    light.iter().map(|c| c[0]).collect()
}

/// Σ|a - b| / Σ b over the points that count.
fn relative(a: &[f32], b: &[f32], counts: impl Fn(usize) -> bool) -> f64 {
    let (mut off, mut all) = (0.0, 0.0);
    for k in (0..a.len()).filter(|&k| counts(k)) {
        off += f64::from((a[k] - b[k]).abs());
        all += f64::from(b[k]);
    }
    off / all
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
    fn over_plane(&self, hit: impl Fn(Vec3, Vec3) -> bool) -> Vec<f32> {
        plane(SIDE).position.iter().map(|&p| self.light(p.into(), &hit)).collect()
    }

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
