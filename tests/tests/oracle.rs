//! Visibility against brute force by a naive oracle, at 4,096 rays per vertex.

use glam::Vec3;
use lunette_bake::Options;
use lunette_relight::asset::Asset;
use lunette_scenes::Scene;
use lunette_tests::baked::{baked, direct_only, row, scene};
use lunette_tests::brute::{Oracle, Seen};
use lunette_tests::measure::{degrees_between, rms, spread};

/// Vertices of a scene that the oracle looks at.
const SAMPLES: usize = 96;

/// Rays of the oracle per vertex: 112². Its own error is a third of the least tolerance.
const SIDE: usize = 112;

const ORDER: usize = 5;

/// Cosine-weighted share of the sky over a vertex in the open: not inside other geometry, and in no crevice where the
/// height of a ray's origin decides.
const IN_THE_OPEN: f64 = 0.05;

struct Judged {
    asset: Asset<'static>,
    /// Vertex and what it sees.
    truth: Vec<(usize, Seen)>,
}

fn judged(scene: &Scene) -> Judged {
    let asset = baked(scene, &Options { order: ORDER, rays: 4096, ..direct_only() });
    let oracle = Oracle::new(&scene.mesh);
    let look = |v: usize| (v, oracle.look(scene.mesh.position[v], scene.mesh.normal[v], SIDE, ORDER));
    let truth = spread(asset.n_vertices(), SAMPLES).map(look).filter(|(_, seen)| seen.ao > IN_THE_OPEN);
    let truth = truth.collect();
    Judged { asset, truth }
}

impl Judged {
    fn value(&self, tensor: &str, v: usize) -> f64 {
        f64::from(row(&self.asset, tensor, v)[0])
    }
}

fn check(scene: &Scene) {
    let judged = judged(scene);

    let ao = rms(judged.truth.iter().map(|(v, seen)| judged.value("sky.ao", *v) - seen.ao));
    assert!(ao < 0.005, "ambient occlusion is off by {ao} RMS");

    // In units of the DC coefficient of an open vertex, √π / 2.
    let coefficients = judged.truth.iter().flat_map(|(v, seen)| {
        let baked = row(&judged.asset, "sky.direct.sh", *v);
        seen.sh.iter().zip(baked).map(|(truth, baked)| f64::from(baked) - truth).collect::<Vec<_>>()
    });
    let dc = rms(judged.truth.iter().map(|(_, seen)| seen.sh[0]));
    let sh = rms(coefficients) / dc;
    assert!(sh < 0.005, "SH transfer is off by {sh} of DC, RMS");

    let aperture = rms(judged.truth.iter().map(|(v, s)| judged.value("sky.aperture", *v) - s.aperture()));
    assert!(aperture < 0.01, "the aperture is off by {aperture} rad RMS");

    let bent = judged.truth.iter().filter(|(_, seen)| seen.aperture() > 0.3).map(|(v, seen)| {
        degrees_between(Vec3::from_slice(&row(&judged.asset, "sky.bent", *v)), seen.bent.as_vec3())
    });
    let bent = rms(bent);
    assert!(bent < 0.5, "the bent normal is off by {bent} degrees RMS");
}

#[test]
fn visibility_on_sphere_and_plane_matches_brute_force() {
    check(&scene("sphere-on-plane:edge=0.4"));
}

#[test]
fn visibility_on_mountains_matches_brute_force() {
    check(&scene("terrain:n=41,size=4000"));
}

#[test]
fn visibility_around_a_post_matches_brute_force() {
    check(&scene("cylinder-on-plane:edge=0.6"));
}
