//! The reference behind windows, and on glossy surfaces.

use super::test_scenes::Geometry;
use super::*;
use crate::tracer::Gloss;
use lunette_relight::light::{Cap, CieOvercast, Source};
use std::f32::consts::PI;

/// The hole in the ceiling of the room.
const SKYLIGHT: [[Vec3; 3]; 2] = [
    [Vec3::new(1.0, 2.0, 1.0), Vec3::new(1.6, 2.0, 1.0), Vec3::new(1.6, 2.0, 1.5)],
    [Vec3::new(1.0, 2.0, 1.0), Vec3::new(1.6, 2.0, 1.5), Vec3::new(1.0, 2.0, 1.5)],
];

/// A room of 3 x 2 x 3 m with a skylight and a box on the floor.
fn room() -> Geometry {
    let mut room = Geometry::default();
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    room.add(Vec3::ZERO, 3.0 * z, 3.0 * x, Vec3::splat(0.6));
    room.add(Vec3::ZERO, 3.0 * x, 2.0 * y, Vec3::new(0.8, 0.4, 0.3));
    room.add(3.0 * z, 2.0 * y, 3.0 * x, Vec3::splat(0.7));
    room.add(Vec3::ZERO, 2.0 * y, 3.0 * z, Vec3::splat(0.7));
    room.add(3.0 * x, 3.0 * z, 2.0 * y, Vec3::new(0.3, 0.7, 0.4));
    for (corner, along_x, along_z) in
        [(Vec3::ZERO, 1.0, 3.0), (1.6 * x, 1.4, 3.0), (1.0 * x, 0.6, 1.0), (1.0 * x + 1.5 * z, 0.6, 1.5)]
    {
        room.add(corner + 2.0 * y, along_x * x, along_z * z, Vec3::splat(0.8));
    }
    room.add_box(Vec3::new(0.4, 0.0, 1.8), Vec3::new(0.6, 0.5, 0.7), Vec3::splat(0.5), 1.0);
    room
}

fn overcast_and_sun() -> Light {
    let sun = Cap { axis: Vec3::new(0.3, 0.9, -0.2).normalize(), radius: 0.08, radiance: Vec3::splat(60.0) };
    Light { sources: vec![Source::CieOvercast(CieOvercast::new(Vec3::ONE)), Source::Cap(sun)] }
}

fn inside(portals: &[[Vec3; 3]], light: &Light, samples: u32) -> Reference {
    let room = room();
    let tracer = Tracer::new(room.surface()).unwrap().with_portals(portals).unwrap();
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    // The sun's patch, a far corner of the floor, a wall, the ceiling beside the hole, a corner of the box.
    let places = [
        (Vec3::new(0.7, 0.0, 1.65), y),
        (Vec3::new(2.9, 0.0, 0.1), y),
        (Vec3::new(0.0, 1.2, 2.0), x),
        (Vec3::new(1.7, 2.0, 1.2), -y),
        (Vec3::new(0.9, 0.02, 1.8), -z),
    ];
    let (points, normals): (Vec<Vec3>, Vec<Vec3>) = places.into_iter().unzip();
    let options = ReferenceOptions { samples, bounces: 4, seed: 5 };
    reference_irradiance(&tracer, light, &points, &normals, &options, |_| ()).unwrap()
}

/// Whether the hole is named, in part or whole or not at all, moves no expected value.
#[test]
fn portals_change_noise_but_no_value() {
    for light in [overcast_and_sun(), Light::new(Source::Uniform(Vec3::ONE))] {
        let plain = inside(&[], &light, 16_384);
        for portals in [&SKYLIGHT[..], &SKYLIGHT[..1]] {
            let aimed = inside(portals, &light, 8192);
            for i in 0..plain.error.len() {
                let off = (aimed.total()[i] - plain.total()[i]).abs();
                let error = (aimed.error[i].powf(2.0) + plain.error[i].powf(2.0)).map(f32::sqrt);
                // Student's t with some 30 degrees of freedom, 60 values: 4.5 is exceeded with probability 0.006.
                assert!(off.cmple(4.5 * error).all(), "point {i}: {off} {error}");
            }
        }
    }
}

#[test]
fn portals_take_noise_away() {
    let sum = |reference: &Reference| reference.error.iter().map(|e| e.y).sum::<f32>();
    for light in [overcast_and_sun(), Light::new(Source::Uniform(Vec3::ONE))] {
        let (plain, aimed) = (inside(&[], &light, 2048), inside(&SKYLIGHT, &light, 2048));
        // Found about 4; each is uncertain by a tenth.
        assert!(sum(&plain) > 2.0 * sum(&aimed), "{} {}", sum(&plain), sum(&aimed));
    }
}

/// The radiance of a floor of albedo 0.3, seen along `d`, in its middle.
fn seen_floor(gloss: Option<(f32, f32)>, light: &Light, d: Vec3) -> (f32, f32) {
    let mut floor = Geometry::default();
    floor.add(Vec3::new(-5.0, 0.0, -5.0), 10.0 * Vec3::Z, 10.0 * Vec3::X, Vec3::splat(0.3));
    let (specular, exponent) = gloss.unwrap_or_default();
    let (specular, exponent) = (vec![Vec3::splat(specular); 4], vec![exponent; 4]);
    let tracer = Tracer::new(floor.surface()).unwrap();
    let tracer = tracer.with_gloss(Gloss { specular: &specular, exponent: &exponent }).unwrap();
    let camera = Camera::new(-3.0 * d, Vec3::ZERO, 0.01);
    let options = ReferenceOptions { samples: 8192, bounces: 1, seed: 2 };
    let seen = reference_image(&tracer, light, &camera, (1, 1), &options, |_| ()).unwrap();
    assert_eq!(seen.image, seen.direct, "nothing to bounce off");
    (seen.image.pixels[0].x, seen.error.pixels[0].x)
}

/// Seen straight from above, under light from everywhere, it sends back albedo and Ks.
#[test]
fn glossy_floor_in_a_furnace_sends_back_its_reflectances() {
    let light = Light::new(Source::Uniform(Vec3::ONE));
    let straight_down = Vec3::new(1e-3, -1.0, 0.0).normalize();
    for exponent in [0.0, 1.0, 10.0, 100.0] {
        let (found, error) = seen_floor(Some((0.5, exponent)), &light, straight_down);
        assert!((found - 0.8).abs() < 4.5 * error + 1e-3, "{exponent}: {found} {error}");
        assert!(error < 5e-3);
    }
    let (matt, _) = seen_floor(None, &light, straight_down);
    assert!((matt - 0.3).abs() < 1e-4);
}

/// A small lamp, once in the mirror direction, once 0.2 rad beside it.
#[test]
fn highlight_follows_the_lobe() {
    let d = Vec3::new(0.6, -0.8, 0.0);
    let (specular, exponent, radius) = (0.4, 20.0, 0.01f32);
    for beside in [0.0f32, 0.2] {
        let axis = glam::Quat::from_rotation_z(beside) * d.reflect(Vec3::Y);
        let light = Light::new(Source::Cap(Cap { axis, radius, radiance: Vec3::splat(1e4) }));
        let (found, error) = seen_floor(Some((specular, exponent)), &light, d);
        let reflected = 0.3 / PI + specular * (exponent + 2.0) / (2.0 * PI) * beside.cos().powf(exponent);
        let expected = reflected * axis.y * 1e4 * PI * radius.sin().powi(2);
        // Within a disc of 0.01 rad the lobe changes by 0.1 % on average.
        assert!(
            (found - expected).abs() < 4.5 * error + 2e-3 * expected,
            "{beside}: {found} {expected} {error}"
        );
    }
}
