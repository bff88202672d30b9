use std::f32::consts::PI;

use super::*;
use crate::cap;
use crate::light::{Cap, CieOvercast, Equirect, Light, Sky, Source, project_sh};
use crate::sh;

fn directions(n: usize) -> impl Iterator<Item = Vec3> {
    (0..n).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f64 / n as f64;
        let (sin, cos) = (i as f64 * 2.399_963_229_728_653).sin_cos();
        let s = (1.0 - z * z).sqrt();
        Vec3::new((s * cos) as f32, (s * sin) as f32, z as f32)
    })
}

fn projected(light: &Light, n: usize) -> Vec<[f32; 3]> {
    let mut out = vec![[9.0; 3]; n_texels(n)];
    project_light(light, n, &mut out);
    out
}

/// ∫ L dω per colour.
fn energy(n: usize, texels: &[[f32; 3]]) -> Vec3 {
    let weighted = |(t, l): (usize, &[f32; 3])| (Vec3::from(*l) * solid_angle(n, t)).as_dvec3();
    texels.iter().enumerate().map(weighted).sum::<glam::DVec3>().as_vec3()
}

#[test]
fn faces_are_those_of_opengl() {
    // Major axis, then the direction in which columns and rows grow, after the OpenGL table of (sc, tc, ma).
    assert_eq!(texel_of(2, Vec3::new(1.0, 0.5, 0.5)), 0, "+X: columns to -Z, rows to -Y");
    assert_eq!(texel_of(2, Vec3::new(1.0, -0.5, -0.5)), 3);
    assert_eq!(texel_of(2, Vec3::new(-1.0, 0.5, 0.5)), 4 + 1, "-X: columns to +Z");
    assert_eq!(texel_of(2, Vec3::new(0.5, 1.0, 0.5)), 8 + 3, "+Y: columns to +X, rows to +Z");
    assert_eq!(texel_of(2, Vec3::new(0.5, -1.0, 0.5)), 12 + 1, "-Y: rows to -Z");
    assert_eq!(texel_of(2, Vec3::new(0.5, 0.5, 1.0)), 16 + 1, "+Z: columns to +X, rows to -Y");
    assert_eq!(texel_of(2, Vec3::new(0.5, 0.5, -1.0)), 20, "-Z: columns to -X");
}

#[test]
fn texel_and_direction_agree() {
    for n in [8, 13, 32] {
        for t in 0..n_texels(n) {
            for within in [Vec2::splat(0.5), Vec2::new(0.02, 0.9), Vec2::new(0.97, 0.03)] {
                assert_eq!(texel_of(n, direction(n, t, within) * 3.0), t);
            }
        }
    }
}

#[test]
fn texel_of_anything_is_a_texel() {
    let odd =
        [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY, Vec3::new(f32::MIN_POSITIVE, 0.0, 0.0), Vec3::splat(-1.0)];
    for d in odd.into_iter().chain(directions(500)) {
        assert!(texel_of(16, d) < n_texels(16), "{d}");
    }
}

#[test]
fn solid_angles_sum_to_the_sphere_and_match_sampling() {
    for n in [1, 8, 32, 64] {
        let total: f64 = (0..n_texels(n)).map(|t| f64::from(solid_angle(n, t))).sum();
        // Rounding of each to f32.
        assert!((total / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-6, "{total} at {n}");
    }
    for t in [0, 5, 27, 63] {
        let points = (0..400).map(|i| Vec2::new((i % 20) as f32 + 0.5, (i / 20) as f32 + 0.5) / 20.0);
        let sampled = points.map(|p| sample(8, t, p).1).sum::<f32>() / 400.0;
        // Midpoint rule with steps of 1/80 of a face.
        assert!((sampled / solid_angle(8, t) - 1.0).abs() < 2e-4, "{t}");
    }
}

#[test]
fn uniform_light_is_the_same_in_every_texel() {
    let light = Light::new(Source::Uniform(Vec3::new(1.0, 2.0, 0.5)));
    assert!(projected(&light, 8).iter().all(|l| *l == [1.0, 2.0, 0.5]));
}

#[test]
fn disc_keeps_its_energy_at_every_radius_and_place() {
    for radius in [1e-4, 1e-3, 0.004_653, 0.03, 0.1, 0.7, 1.57, 2.5, PI] {
        for axis in [Vec3::X, Vec3::new(1.0, 1.0, 1.0), Vec3::new(0.3, 0.9, -0.2), Vec3::new(1.0, 0.001, 1.0)]
        {
            let disc = Cap { axis: axis.normalize(), radius, radiance: Vec3::new(1.0, 3.0, 1e4) };
            let texels = projected(&Light::new(Source::Cap(disc)), 32);
            let expected = disc.radiance * disc.solid_angle();
            let found = energy(32, &texels);
            // Rounding to f32: shares are scaled to the exact area.
            assert!(
                (found / expected - 1.0).abs().max_element() < 1e-5,
                "{radius} {axis}: {found} {expected}"
            );
            assert!(texels.iter().all(|l| l[0] >= 0.0 && l[0] < 1.005), "a texel is covered once");
        }
    }
}

#[test]
fn disc_shares_match_brute_force() {
    let disc = Cap { axis: Vec3::new(0.6, 0.5, -0.7).normalize(), radius: 0.11, radiance: Vec3::ONE };
    let texels = projected(&Light::new(Source::Cap(disc)), 16);
    for (t, share) in texels.iter().enumerate() {
        let points = (0..10_000).map(|i| Vec2::new((i % 100) as f32 + 0.5, (i / 100) as f32 + 0.5) / 100.0);
        let (mut inside, mut all) = (0.0, 0.0);
        for (d, weight) in points.map(|p| sample(16, t, p)) {
            inside += weight * disc.radiance_from(d).x;
            all += weight;
        }
        // Counting points of a 100 x 100 grid: a straight edge crosses 100 of them, each wrong by half at most.
        assert!((share[0] - inside / all).abs() < 3e-3, "{t}: {} {}", share[0], inside / all);
    }
}

#[test]
fn overcast_sky_keeps_its_energy_and_its_horizon() {
    for (up, tolerance) in [(Vec3::Y, 1e-5), (Vec3::new(0.3, 0.8, 0.4).normalize(), 1e-3)] {
        for n in [8, 15, 32] {
            let texels =
                projected(&Light::new(Source::CieOvercast(CieOvercast { zenith: Vec3::ONE, up })), n);
            // ∫ (1 + 2 sin)/3 over the upper half = 2π (1 + 1) / 3. Exact but for the texels that the horizon cuts,
            // which have 16 x 16 points; a level horizon cuts the middle row where n is odd, in half.
            let found = energy(n, &texels).x / (4.0 * PI / 3.0);
            assert!((found - 1.0).abs() < tolerance, "{up} at {n}: {found}");
            let size = 2.0 / n as f32;
            for (t, l) in texels.iter().enumerate() {
                let height = direction(n, t, Vec2::splat(0.5)).dot(up);
                assert!(height > -size || l[0] == 0.0);
                assert!(height < size || (l[0] - (1.0 + 2.0 * height) / 3.0).abs() < 2.0 * size * size);
            }
        }
    }
}

#[test]
fn clear_sky_keeps_the_energy_of_dome_and_sun() {
    for (elevation, n) in [(0.9, 32), (0.4, 32), (0.1, 32), (0.7, 8), (0.002, 32), (-0.05, 16)] {
        let light = Light::new(Source::Sky(Sky::new(1.0, elevation, 3.0).unwrap()));
        let mut coefficients = [[0.0; 3]; 1];
        project_sh(&light, 1, &mut coefficients);
        let expected = Vec3::from(coefficients[0]) * (4.0 * PI).sqrt();
        let found = energy(n, &projected(&light, n));
        // Gauss points against the dome's root at the horizon and its peak at the sun; coarse texels with the sun just
        // below the horizon are the worst, at 1.1e-3.
        assert!(
            (found / expected - 1.0).abs().max_element() < 2e-3,
            "{elevation} at {n}: {found} {expected}"
        );
    }
}

#[test]
fn setting_sun_shines_only_above_the_horizon() {
    let light = Light::new(Source::Sky(Sky::new(0.2, 0.0, 3.0).unwrap()));
    let texels = projected(&light, 32);
    let brightest = texels.iter().fold(0.0f32, |a, l| a.max(l[0]));
    let below = (0..n_texels(32)).filter(|&t| direction(32, t, Vec2::splat(0.5)).y < 0.0);
    // Rounding of f64 where boxes end at the horizon.
    assert!(brightest > 0.0 && below.map(|t| texels[t][0]).all(|l| l < 1e-9 * brightest));
}

#[test]
fn clear_sky_texels_match_brute_force() {
    let sky = Sky::new(1.0, 0.5, 3.0).unwrap();
    let light = Light::new(Source::Sky(sky.clone()));
    let texels = projected(&light, 16);
    let mean = energy(16, &texels).y / (4.0 * PI);
    let sun = texel_of(16, sky.sun().unwrap().axis);
    for t in (0..n_texels(16)).filter(|&t| texels[t][1] > 0.0 && texels[t][1] < 20.0 * mean && t != sun) {
        let points = (0..1024).map(|i| Vec2::new((i % 32) as f32 + 0.5, (i / 32) as f32 + 0.5) / 32.0);
        let (mut sum, mut all) = (0.0, 0.0);
        for (d, weight) in points.map(|p| sample(16, t, p)) {
            sum += weight * sky.dome_radiance(d).y;
            all += weight;
        }
        // The dome's steepest texels are those beside the sun and at the horizon.
        assert!((texels[t][1] / (sum / all) - 1.0).abs() < 0.01, "{t}: {} {}", texels[t][1], sum / all);
    }
}

fn picture(width: usize, height: usize, pixel: impl Fn(usize) -> [f32; 3]) -> Equirect {
    Equirect::new(width, height, (0..width * height).map(pixel).collect()).unwrap()
}

#[test]
fn picture_keeps_its_energy_and_a_constant_stays_constant() {
    let turn = glam::Quat::from_axis_angle(Vec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
    for (width, height) in [(4, 2), (64, 32), (300, 150)] {
        let constant = picture(width, height, |_| [1.0, 2.0, 3.0]).rotated(turn).scaled(2.0);
        for l in projected(&Light::new(Source::Equirect(constant)), 16) {
            // Rounding.
            assert!((Vec3::from(l) - Vec3::new(2.0, 4.0, 6.0)).abs().max_element() < 1e-4);
        }
        let sunny =
            picture(width, height, |i| if i == width * height / 3 { [1e5, 1.0, 2.0] } else { [0.5; 3] });
        let light = Light::new(Source::Equirect(sunny.rotated(turn)));
        let mut dc = [[0.0; 3]; 1];
        project_sh(&light, 1, &mut dc);
        let found = energy(16, &projected(&light, 16));
        let expected = Vec3::from(dc[0]) * (4.0 * PI).sqrt();
        // Rounding to f32 of both.
        assert!((found / expected - 1.0).abs().max_element() < 1e-4, "{width}: {found} {expected}");
    }
}

#[test]
fn coarse_picture_is_its_pixels() {
    let coarse = picture(8, 4, |i| [(i % 5) as f32 + 1.0; 3]);
    let texels = projected(&Light::new(Source::Equirect(coarse.clone())), 64);
    let mut matches = 0;
    for (t, texel) in texels.iter().enumerate() {
        let corners =
            [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE].map(|c| coarse.radiance(direction(64, t, c)).x);
        if corners.iter().all(|c| *c == corners[0]) {
            // The energy's factor: samples are counted, not clipped to texels.
            assert!((texel[0] / corners[0] - 1.0).abs() < 2e-3, "{t}");
            matches += 1;
        }
    }
    assert!(matches > 20_000, "most texels lie in one pixel: {matches}");
}

#[test]
fn picture_is_not_kept_for_another_resolution_or_turn() {
    let image = picture(16, 8, |i| [i as f32; 3]);
    let turned = image.rotated(glam::Quat::from_rotation_y(1.0));
    let first = projected(&Light::new(Source::Equirect(image.clone())), 8);
    assert_ne!(projected(&Light::new(Source::Equirect(turned)), 8), first);
    assert_eq!(projected(&Light::new(Source::Equirect(image.clone())), 16).len(), n_texels(16));
    assert_eq!(projected(&Light::new(Source::Equirect(image)), 8), first);
}

#[test]
fn sh_table_of_a_uniform_shell_is_one_coefficient() {
    for n in [8, 9, 32] {
        let mut out = [[0.0; 3]; 100];
        ShTable::new(n, 10).project(&vec![[1.0, 0.5, 2.0]; n_texels(n)], &mut out);
        assert!((out[0][0] - (4.0 * PI).sqrt()).abs() < 2e-5);
        // Sums of 6 n² values below one that cancel.
        assert!(out[1..].iter().flatten().all(|c| c.abs() < 2e-5), "{out:?}");
    }
}

#[test]
fn sh_table_recovers_band_limited_light() {
    let (n, order) = (32, 4);
    let mut texels = vec![[0.0; 3]; n_texels(n)];
    let mut wanted = [[0.0f32; 3]; 16];
    for (i, w) in wanted.iter_mut().enumerate() {
        *w = [i as f32 - 5.0, 1.0 / (i + 1) as f32, 0.5];
    }
    let mut y = [0.0; 16];
    for (t, texel) in texels.iter_mut().enumerate() {
        sh::eval(order, direction(n, t, Vec2::splat(0.5)), &mut y);
        for (w, y) in wanted.iter().zip(y) {
            *texel = (Vec3::from(*texel) + Vec3::from(*w) * y).to_array();
        }
    }
    let mut out = [[0.0; 3]; 16];
    ShTable::new(n, order).project(&texels, &mut out);
    for (a, b) in out.iter().zip(&wanted) {
        // Light taken as its value at the centre: l² times the texel's size squared over 24, of 10 at most.
        assert!((Vec3::from(*a) - Vec3::from(*b)).abs().max_element() < 0.02, "{a:?} {b:?}");
    }
}

#[test]
fn sh_table_of_a_small_disc_is_its_closed_form() {
    let disc = Cap { axis: Vec3::new(0.2, 0.9, 0.4).normalize(), radius: 0.1, radiance: Vec3::ONE };
    let light = Light::new(Source::Cap(disc));
    let (mut exact, mut found) = ([[0.0; 3]; 16], [[0.0; 3]; 16]);
    project_sh(&light, 4, &mut exact);
    ShTable::new(32, 4).project(&projected(&light, 32), &mut found);
    for (a, b) in found.iter().zip(&exact) {
        // The disc spread over whole texels of 0.06 radians shifts by part of one.
        assert!((a[0] - b[0]).abs() < 0.01 * cap::area(0.1) as f32, "{a:?} {b:?}");
    }
}
