use std::f32::consts::{FRAC_PI_2, PI};

use super::*;
use crate::bent::cap_irradiance;
use crate::light::{CieOvercast, Sky, Source};

const NORMAL: [f32; 3] = [0.6, 0.8, 0.0];

/// Irradiance of one vertex whose aperture has this axis and radius.
fn at(axis: [f32; 3], radius: f32, light: &ApertureLight, intersection: Intersection) -> Vec3 {
    let mut out = [[f32::NAN; 3]];
    irradiance(
        Apertures { axis: &[axis], radius: &[radius], normal: &[NORMAL] },
        light,
        intersection,
        &mut out,
    );
    Vec3::from(out[0])
}

fn open_plane(light: &Light, intersection: Intersection) -> Vec3 {
    let mut caps = Vec::new();
    let sky = simplify(light, Vec3::from(NORMAL), &mut caps);
    at(NORMAL, FRAC_PI_2, &ApertureLight { caps: &caps, sky }, intersection)
}

#[test]
fn open_plane_under_uniform_sky_gives_pi() {
    for intersection in [Intersection::Exact, Intersection::Smoothstep] {
        let e = open_plane(&Light::new(Source::Uniform(Vec3::new(1.0, 2.0, 3.0))), intersection);
        // f32 rounding of SH coefficients.
        assert!((e / PI - Vec3::new(1.0, 2.0, 3.0)).abs().max_element() < 1e-5, "{intersection:?}: {e}");
    }
}

#[test]
fn open_plane_under_any_cap_matches_closed_form() {
    for radius in [0.001_f32, 0.05, 0.5, 1.2, 2.5] {
        for tilt in [0.0_f32, 0.4, 1.0, FRAC_PI_2, 2.0] {
            let cap = Cap {
                axis: glam::Quat::from_rotation_z(tilt) * Vec3::from(NORMAL),
                radius,
                radiance: Vec3::ONE,
            };
            let e = open_plane(&Light::new(Source::Cap(cap)), Intersection::Exact).x;
            let exact = cap_irradiance(&cap, Vec3::from(NORMAL));
            // The same closed form by another road; the hemisphere's f32 radius is off by 4e-8.
            assert!(
                (e - exact).abs() < 1e-6 * cap.solid_angle() + 1e-7 * radius,
                "{radius} {tilt}: {e} against {exact}"
            );
        }
    }
}

#[test]
fn cap_in_front_of_a_sky_adds_to_it() {
    let cap = Cap { axis: Vec3::Y, radius: 0.6, radiance: Vec3::splat(2.0) };
    let light = Light { sources: vec![Source::Cap(cap), Source::Uniform(Vec3::ONE)] };
    let e = open_plane(&light, Intersection::Exact).x;
    let exact = PI + 2.0 * cap_irradiance(&cap, Vec3::from(NORMAL));
    assert!((e / exact - 1.0).abs() < 1e-5, "{e} against {exact}");
}

#[test]
fn smoothstep_is_close_for_small_lights() {
    for tilt in [0.0_f32, 0.5, 1.0] {
        let cap = Cap {
            axis: glam::Quat::from_rotation_z(tilt) * Vec3::from(NORMAL),
            radius: 0.1,
            radiance: Vec3::ONE,
        };
        let light = ApertureLight { caps: &[cap], sky: Vec3::ZERO };
        let [exact, cheap] =
            [Intersection::Exact, Intersection::Smoothstep].map(|i| at(NORMAL, 1.2, &light, i).x);
        // The areas differ by a twentieth of the cap when its rim is on the aperture's.
        assert!((exact - cheap).abs() < 0.05 * cap.solid_angle(), "tilt {tilt}: {exact} against {cheap}");
    }
}

#[test]
fn smoothstep_agrees_where_the_light_is_inside_the_aperture() {
    let cap = Cap { axis: Vec3::Y, radius: 0.2, radiance: Vec3::ONE };
    let light = ApertureLight { caps: &[cap], sky: Vec3::splat(0.3) };
    let [exact, cheap] =
        [Intersection::Exact, Intersection::Smoothstep].map(|i| at(NORMAL, 1.4, &light, i).x);
    // Both know a whole cap's area and centroid exactly.
    assert!((exact / cheap - 1.0).abs() < 1e-5, "{exact} against {cheap}");
}

#[test]
fn light_outside_of_the_aperture_is_shadowed() {
    let sun = Cap { axis: Vec3::X, radius: 0.01, radiance: Vec3::splat(1e6) };
    let light = ApertureLight { caps: &[sun], sky: Vec3::ONE };
    for intersection in [Intersection::Exact, Intersection::Smoothstep] {
        let e = at([0.0, 1.0, 0.0], 0.5, &light, intersection).x;
        let exact = PI * 0.5_f32.sin().powi(2) * 0.8;
        assert!((e / exact - 1.0).abs() < 1e-5, "{intersection:?}: {e} against {exact}");
    }
}

#[test]
fn closed_aperture_is_black_and_never_nan() {
    let cap = Cap { axis: Vec3::Y, radius: 0.5, radiance: Vec3::ONE };
    let light = ApertureLight { caps: &[cap], sky: Vec3::ONE };
    for intersection in [Intersection::Exact, Intersection::Smoothstep] {
        for axis in [[0.0; 3], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]] {
            assert_eq!(at(axis, 0.0, &light, intersection), Vec3::ZERO);
            for radius in [1e-6, 0.5, FRAC_PI_2, PI] {
                let e = at(axis, radius, &light, intersection);
                assert!(e.is_finite() && e.min_element() >= 0.0, "{intersection:?} {axis:?} {radius}: {e}");
            }
        }
    }
}

#[test]
fn average_sky_gives_a_level_plane_its_irradiance() {
    let up = Vec3::Y;
    for source in [
        Source::CieOvercast(CieOvercast::new(Vec3::splat(3.0))),
        Source::Sky(Sky::new(1.0, 0.6, 3.0).expect("in range")),
    ] {
        let light = Light::new(source);
        let mut caps = Vec::new();
        let sky = simplify(&light, up, &mut caps);
        let mut out = [[0.0; 3]];
        let level = Apertures { axis: &[up.to_array()], radius: &[FRAC_PI_2], normal: &[up.to_array()] };
        irradiance(level, &ApertureLight { caps: &caps, sky }, Intersection::Exact, &mut out);
        let truth = level_irradiance(&light);
        // Order-3 SH sees a horizon-cut sky to 2 %.
        assert!(
            (Vec3::from(out[0]) / truth - 1.0).abs().max_element() < 0.02,
            "{:?} against {truth}",
            out[0]
        );
    }
}

/// ∫ L cos θ dω over the upper hemisphere: the dome by midpoints, the sun as a disc.
fn level_irradiance(light: &Light) -> Vec3 {
    let dome = |d: Vec3| match &light.sources[0] {
        Source::Sky(sky) => sky.dome_radiance(d),
        source => source.radiance(d),
    };
    let n = 300;
    let mut sum = Vec3::ZERO;
    for i in 0..n {
        let sin2 = (i as f32 + 0.5) / n as f32;
        for j in 0..n {
            let (sin, cos) = ((j as f32 + 0.5) * std::f32::consts::TAU / n as f32).sin_cos();
            sum += dome(Vec3::new(sin2.sqrt() * cos, (1.0 - sin2).sqrt(), sin2.sqrt() * sin));
        }
    }
    let sun = match &light.sources[0] {
        Source::Sky(sky) => sky.sun().map_or(Vec3::ZERO, |sun| sun.radiance * cap_irradiance(&sun, Vec3::Y)),
        _ => Vec3::ZERO,
    };
    sum * (PI / (n * n) as f32) + sun
}
