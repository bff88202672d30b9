//! Irradiance against the path-traced reference.

use glam::Vec3;
use lunette_bake::Options;
use lunette_relight::frame::Method;
use lunette_render::{Reference, ReferenceOptions, Surface, Tracer, difference, noise, reference_irradiance};
use lunette_scenes::Scene;
use lunette_tests::baked::{baked, irradiance, light, scene};
use lunette_tests::measure::{mean, spread};

/// Cosine-weighted share of the sky over a vertex in the open.
const IN_THE_OPEN: f32 = 0.3;

struct Judged {
    baked: Vec<Vec3>,
    truth: Reference,
    area: Vec<f32>,
}

/// Vertices in the open, relit from a bake and by path tracing.
fn judged(scene: &Scene, spec: &str, bounces: usize, samples: u32) -> Judged {
    let asset = baked(scene, &Options { rays: 4096, bounces, ..Options::default() });
    let baked = irradiance(&asset, &light(spec), Method::default());
    let open: Vec<usize> = (0..baked.len())
        .filter(|&v| lunette_tests::baked::row(&asset, "sky.ao", v)[0] > IN_THE_OPEN)
        .collect();
    let sample: Vec<usize> = spread(open.len(), 250).map(|i| open[i]).collect();
    let mesh = &scene.mesh;
    let area = mesh.vertex_area();
    let albedo = scene.vertex_albedo();
    let surface =
        Surface { position: &mesh.position, normal: &mesh.normal, index: &mesh.index, albedo: &albedo };
    let pick = |of: &[Vec3]| sample.iter().map(|&v| of[v]).collect::<Vec<_>>();
    let truth = reference_irradiance(
        &Tracer::new(surface).expect("a tracer"),
        &light(spec),
        &pick(&mesh.position),
        &pick(&mesh.normal),
        &ReferenceOptions { samples, bounces: bounces as u32, seed: 1 },
        |_| {},
    )
    .expect("a reference");
    Judged { baked: pick(&baked), truth, area: sample.iter().map(|&v| area[v]).collect() }
}

impl Judged {
    /// Relative difference by area, and the reference's own noise in the same unit.
    fn difference(&self) -> (f64, f64) {
        let truth = self.truth.total();
        let relative = difference(&self.baked, &truth, Some(&self.area)).expect("numbers").relative;
        (relative, noise(&self.truth.error, &truth, Some(&self.area)).expect("numbers"))
    }
}

#[test]
fn direct_light_of_overcast_mountains_matches_the_reference() {
    let mountains = scene("terrain:n=49,size=6000,height=500");
    let (relative, noise) = judged(&mountains, "cie-overcast", 0, 6144).difference();
    assert!(noise < 0.001, "a reference with a noise of {noise} judges nothing");
    assert!(relative < 0.005, "{relative}");
}

#[test]
fn four_bounces_in_overcast_mountains_match_the_reference() {
    let mountains = scene("terrain:n=49,size=6000,height=500,albedo=0.5");
    let (relative, noise) = judged(&mountains, "cie-overcast", 4, 4096).difference();
    assert!(noise < 0.002, "a reference with a noise of {noise} judges nothing");
    assert!(relative < 0.01, "{relative}");
}

#[test]
fn bounced_light_around_a_sphere_has_no_bias() {
    // A uniform light needs but the first band, so that rays are the only source of error: the deviations from the
    // reference, each in units of its own standard error, must average to nothing.
    let ball = scene("sphere-on-plane:edge=0.2,albedo=0.5");
    let judged = judged(&ball, "uniform", 4, 1024);
    let truth = judged.truth.total();
    let relative = mean(judged.baked.iter().zip(&truth).map(|(a, b)| f64::from(a.x) / f64::from(b.x) - 1.0));
    let standard_error = mean(judged.truth.error.iter().zip(&truth).map(|(e, b)| f64::from(e.x / b.x)))
        / (truth.len() as f64).sqrt();
    // Interpolating bounced light between vertices 0.2 m apart leaves some 1e-3 where the ball touches the floor.
    assert!(relative.abs() < 4.0 * standard_error + 0.002, "{relative} ± {standard_error}");
}
