use glam::{Vec2, Vec3};

use super::*;
use crate::cubemap::{n_texels, project_light, solid_angle};
use crate::light::{Cap, CieOvercast, Light, Sky, Source};

fn blurred(n: usize, radians: f32, texels: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut out = vec![[9.0; 3]; texels.len()];
    Blur::new(n, radians).apply(texels, &mut out);
    out
}

fn spot(n: usize, at: usize) -> Vec<[f32; 3]> {
    let mut texels = vec![[0.0; 3]; n_texels(n)];
    texels[at] = [1.0, 2.0, 3.0];
    texels
}

fn energy(n: usize, texels: &[[f32; 3]]) -> f32 {
    texels.iter().enumerate().map(|(t, l)| l[0] * solid_angle(n, t)).sum()
}

#[test]
fn blur_keeps_constants_and_energy() {
    for n in [8, 12, 32] {
        for radians in [0.01, 0.1, 0.5, 1.5, 3.1] {
            for l in blurred(n, radians, &vec![[2.0; 3]; n_texels(n)]) {
                // Scaling ends within 1e-4, once per stage.
                assert!((l[0] - 2.0).abs() < 6e-4, "{} at {n}, {radians}", l[0]);
            }
            for at in [0, n * n / 2 + n / 2, 3 * n * n - 1] {
                let (before, after) = (spot(n, at), blurred(n, radians, &spot(n, at)));
                // f32 sums.
                assert!((energy(n, &after) / energy(n, &before) - 1.0).abs() < 1e-4, "{n} {radians} {at}");
            }
        }
    }
}

#[test]
fn blur_has_the_width_asked_for() {
    for radians in [0.15f32, 0.3, 0.6] {
        let n = 32;
        let middle = n * n / 2 + n / 2;
        let after = blurred(n, radians, &spot(n, middle));
        let axis = cubemap::direction(n, middle, Vec2::splat(0.5));
        let (mut sum, mut total) = (0.0, 0.0);
        for (t, l) in after.iter().enumerate() {
            let weight = l[0] * solid_angle(n, t);
            sum += weight * (1.0 - cubemap::direction(n, t, Vec2::splat(0.5)).dot(axis));
            total += weight;
        }
        // Mean of 1 - cos γ under exp((cos γ - 1)/σ²): σ² - 2/(e^(2/σ²) - 1); the cut-off tail and the texels'
        // own width take and add some percent.
        let s2 = radians * radians;
        let expected = s2 - 2.0 / ((2.0 / s2).exp() - 1.0);
        assert!((sum / total / expected - 1.0).abs() < 0.06, "{radians}: {} {expected}", sum / total);
    }
}

#[test]
fn blur_has_no_seams() {
    // A texel at the middle of a face and one at a corner where three faces meet spread alike.
    let n = 32;
    for at in [0, n * n / 2 + n / 2] {
        let after = blurred(n, 0.4, &spot(n, at));
        let axis = cubemap::direction(n, at, Vec2::splat(0.5));
        let peak = after[at][0] / solid_angle(n, at);
        for (t, l) in after.iter().enumerate() {
            let exponent = (cubemap::direction(n, t, Vec2::splat(0.5)).dot(axis) - 1.0) / (0.4 * 0.4);
            let expected = peak * exponent.exp();
            // The coarse cubemap's texels differ by five in size; the tail is cut off.
            assert!((l[0] / solid_angle(n, at) - expected).abs() < 0.06 * peak, "{t}: {} {expected}", l[0]);
        }
    }
}

#[test]
fn blurred_sun_moves_with_the_sun() {
    // Neighbouring texels lie in one coarse texel of a blur this wide, or not, and no matter which.
    let n = 32;
    let centroid = |at: usize| {
        let after = blurred(n, 0.5, &spot(n, at));
        let weighted = |(t, l): (usize, &[f32; 3])| {
            cubemap::direction(n, t, Vec2::splat(0.5)) * (l[0] * solid_angle(n, t))
        };
        after.iter().enumerate().map(weighted).sum::<Vec3>().normalize()
    };
    for at in [500, 501, 502, 503, 504] {
        let wanted = cubemap::direction(n, at, Vec2::splat(0.5));
        // A tenth of a texel of 0.06.
        assert!(centroid(at).angle_between(wanted) < 0.01, "{}", centroid(at).angle_between(wanted));
    }
}

#[test]
fn narrow_blur_leaves_texels_alone() {
    let n = 16;
    let before = spot(n, 300);
    for (a, b) in before.iter().zip(blurred(n, 1e-3, &before)) {
        assert!((a[2] - b[2]).abs() < 1e-6);
    }
}

#[test]
fn shells_are_checked() {
    let texels = vec![[1.0; 3]; n_texels(8)];
    assert!(Shell::new(8, &texels).is_ok());
    assert_eq!(Shell::new(4, &texels[..96]).unwrap_err(), ShellError::Side(4));
    assert_eq!(Shell::new(8, &texels[1..]).unwrap_err(), ShellError::Length { expected: 384, found: 383 });
    for bad in [f32::NAN, f32::INFINITY, -0.5] {
        let mut texels = texels.clone();
        texels[7][1] = bad;
        let error = Shell::new(8, &texels).unwrap_err().to_string();
        assert!(error.contains("texel 7") && !error.contains('\n'), "{error}");
    }
}

#[test]
fn suns_are_seen_in_a_shell() {
    let has_sun = |source: Source| {
        let mut texels = vec![[0.0; 3]; n_texels(32)];
        project_light(&Light::new(source), 32, &mut texels);
        Shell::new(32, &texels).unwrap().has_sun()
    };
    let disc = |radius| Cap { axis: Vec3::new(0.3, 0.8, 0.5).normalize(), radius, radiance: Vec3::ONE };
    assert!(has_sun(Source::Sky(Sky::new(1.0, 0.6, 3.0).unwrap())));
    assert!(has_sun(Source::Cap(disc(0.1))));
    assert!(!has_sun(Source::Cap(disc(1.5))));
    assert!(!has_sun(Source::Uniform(Vec3::ONE)));
    assert!(!has_sun(Source::CieOvercast(CieOvercast::new(Vec3::ONE))));
    assert!(!has_sun(Source::Sky(Sky::new(1.0, -0.1, 3.0).unwrap())), "twilight");
    assert!(!has_sun(Source::Uniform(Vec3::ZERO)), "dark");
}

#[test]
fn materials_parse() {
    let parse = |spec: &str| parse_material(spec).unwrap();
    assert_eq!(parse("glass=clear"), ("glass".to_string(), Material::CLEAR));
    assert_eq!(parse("a=b = closed"), ("a=b".to_string(), Material::CLOSED));
    assert_eq!(parse("w=tint:1, .5,2").1, Material { tint: [1.0, 0.5, 2.0], frost: 0.0 });
    assert_eq!(parse("w=frosted:0.3").1.frost, 0.3);
    let both = parse("w = tint:1,0.5,0 + frosted:0.3").1;
    assert_eq!(both, Material { tint: [1.0, 0.5, 0.0], frost: 0.3 });
}

#[test]
fn material_errors_point_at_the_place() {
    let cases = [
        ("glass", 1, "NAME=MATERIAL"),
        ("=clear", 1, "NAME=MATERIAL"),
        ("w=blue", 3, "is no material"),
        ("w=tint:1,2", 8, "tint:r,g,b"),
        ("w=tint", 7, "tint:r,g,b"),
        ("w=tint:1,x,2", 10, "\"x\" is not a number"),
        ("w=tint:1,NaN,2", 10, "not a number"),
        ("w=tint:1,1,-2", 12, "out of range"),
        ("w=frosted:4", 11, "out of range"),
        ("w=closed:1", 9, "without numbers"),
        ("ö=clear+ frosted:", 18, "is not a number"),
    ];
    for (spec, column, says) in cases {
        let error = parse_material(spec).expect_err(spec);
        let line = error.to_string();
        assert!(line.contains(says) && !line.contains('\n'), "{line}");
        assert_eq!(error.column, column, "{line}");
    }
}
