//! The open plane, where every answer is known.

use std::f64::consts::PI;

use glam::{Vec3, dvec3};
use lunette_bake::Options;
use lunette_relight::aperture::Intersection;
use lunette_relight::asset::Asset;
use lunette_relight::frame::Method;
use lunette_tests::baked::{baked, direct_only, irradiance, light, row, scene};
use lunette_tests::closed_form::{OVERCAST_OVER_PLANE, disc_over_plane, disc_over_plane_in_bands};
use lunette_tests::measure::degrees_between;

const ALL_METHODS: [Method; 4] = [
    Method::Bent,
    Method::Aperture(Intersection::Exact),
    Method::Aperture(Intersection::Smoothstep),
    Method::Sh { order: 10, window: None },
];

/// Methods without an approximation of their own over an open plane.
const EXACT_METHODS: [Method; 2] = [Method::Bent, Method::Aperture(Intersection::Exact)];

fn open_plane(order: usize, rays: usize) -> Asset<'static> {
    let options = Options { order, indirect_order: 1, rays, ..direct_only() };
    baked(&scene("plane:n=2"), &options)
}

/// Where the rays' own error would hide what is tested.
const MANY_RAYS: usize = 32768;

#[test]
fn open_plane_sees_the_whole_hemisphere() {
    let asset = open_plane(3, 1024);
    for v in 0..asset.n_vertices() {
        // f16 holds pi/2 to 5e-4.
        assert!((row(&asset, "sky.aperture", v)[0] - std::f32::consts::FRAC_PI_2).abs() < 5e-4);
        // The cosine's mean over 1024 stratified rays is right to 1e-4; f16 holds 1 exactly and 1 - 2^-11 below it.
        assert!((row(&asset, "sky.ao", v)[0] - 1.0).abs() < 1e-3);
        let bent = Vec3::from_slice(&row(&asset, "sky.bent", v));
        // Stratified rays leave a mean direction that is some 1e-3 off.
        assert!(degrees_between(bent, Vec3::Y) < 0.2, "{bent}");
    }
}

#[test]
fn open_plane_under_uniform_sky_receives_pi_by_every_method() {
    for order in [1, 2, 5, 10] {
        let asset = open_plane(order, Options::default().rays);
        for method in ALL_METHODS {
            for e in irradiance(&asset, &light("uniform:1,2,0.5"), method) {
                let relative = (e / Vec3::new(1.0, 2.0, 0.5)).as_dvec3() / PI - 1.0;
                assert!(relative.abs().max_element() < 1e-3, "order {order}, {method:?}: {e}");
            }
        }
    }
}

#[test]
fn caps_over_open_plane_match_their_closed_form() {
    let asset = open_plane(3, MANY_RAYS);
    for radius in [0.001, 0.01, 0.1, 0.5, 1.0, 1.5] {
        for zenith in [0.0, 0.3, 0.8, 1.2, 1.5, PI / 2.0] {
            let expected = disc_over_plane(zenith, radius);
            for method in EXACT_METHODS {
                for e in irradiance(&asset, &cap(zenith, radius), method) {
                    // In units of the same disc at the zenith. f16 turns the axis by up to 5e-4 rad, and ambient
                    // occlusion and rays add as much again.
                    let error = (f64::from(e.x) - expected) / disc_over_plane(0.0, radius);
                    assert!(error.abs() < 1e-3, "radius {radius}, zenith {zenith}, {method:?}: {error}");
                }
            }
        }
    }
}

#[test]
fn caps_over_open_plane_match_their_closed_form_cut_to_the_bands() {
    for order in [2, 5, 10] {
        let asset = open_plane(order, MANY_RAYS);
        for radius in [0.01, 0.3, 0.8, 1.3] {
            for zenith in [0.0, 0.4, 0.9, 1.4, 2.0] {
                let expected = disc_over_plane_in_bands(zenith, radius, order);
                for e in irradiance(&asset, &cap(zenith, radius), Method::default()) {
                    // In units of the same disc at the zenith. Each coefficient is off by some 2e-4, and a hundred of
                    // them add up by chance to sqrt(100 / 4 pi) = 3 times that.
                    let error = (f64::from(e.x) - expected) / disc_over_plane(0.0, radius);
                    assert!(error.abs() < 3e-3, "order {order}, radius {radius}, zenith {zenith}: {error}");
                }
            }
        }
    }
}

#[test]
fn overcast_sky_over_open_plane_gives_seven_ninths_of_pi() {
    for (order, tolerance) in [(3, 0.006), (5, 0.002), (10, 0.002)] {
        // The overcast sky's step at the horizon is where a level plane's cosine is zero, so that few bands hold it;
        // three, which are also all that the other methods have of a sky, leave half a percent.
        let asset = open_plane(order, MANY_RAYS);
        for method in ALL_METHODS {
            for e in irradiance(&asset, &light("cie-overcast:3"), method) {
                let error = f64::from(e.y) / (3.0 * OVERCAST_OVER_PLANE) - 1.0;
                let tolerance = if matches!(method, Method::Sh { .. }) { tolerance } else { 0.006 };
                assert!(error.abs() < tolerance, "order {order}, {method:?}: {error}");
            }
        }
    }
}

fn cap(zenith: f64, radius: f64) -> lunette_relight::light::Light {
    let d = dvec3(zenith.sin() * 0.6, zenith.cos(), zenith.sin() * 0.8);
    light(&format!("cap:{},{},{},{radius},1", d.x, d.y, d.z))
}
