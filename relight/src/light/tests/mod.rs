use std::f32::consts::{FRAC_PI_2, PI};

use super::sky::compass_direction;
use super::*;

mod clear_sky;
mod parse;
mod project;
mod split;

/// A picture with another colour in every pixel.
fn colourful(width: usize, height: usize) -> Equirect {
    let pixel = |i: usize| [(i % 7) as f32, (i % 5) as f32 + 0.5, (i * i % 11) as f32];
    Equirect::new(width, height, (0..width * height).map(pixel).collect()).expect("a good picture")
}

/// Directions all over the sphere (a Fibonacci lattice).
fn directions(n: usize) -> impl Iterator<Item = Vec3> {
    (0..n).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f64 / n as f64;
        let (sin, cos) = (i as f64 * 2.399_963_229_728_653).sin_cos();
        let s = (1.0 - z * z).sqrt();
        Vec3::new((s * cos) as f32, (s * sin) as f32, z as f32)
    })
}

fn some_turn() -> Quat {
    Quat::from_axis_angle(Vec3::new(1.0, 2.0, -0.5).normalize(), 1.1)
}

#[test]
fn equirect_looks_along_minus_z_in_the_centre() {
    // Twelve columns of 30 degrees, six rows; directions aim at the middle of pixels.
    let image = colourful(12, 6);
    let level = |azimuth_degrees: f32| compass_direction(azimuth_degrees.to_radians(), 0.1);
    assert_eq!(image.pixel_at(level(15.0)), (6, 2), "right of -Z");
    assert_eq!(image.pixel_at(level(-15.0)), (5, 2), "left of -Z");
    assert_eq!(image.pixel_at(level(105.0)), (9, 2), "u grows towards +X");
    assert_eq!(image.pixel_at(level(-165.0)), (0, 2), "the left edge is +Z");
    assert_eq!(image.pixel_at(level(165.0)), (11, 2), "and so is the right edge");
    assert_eq!(image.pixel_at(Vec3::new(0.01, 0.999, -0.01).normalize()).1, 0, "the top row is +Y");
    assert_eq!(image.pixel_at(Vec3::new(0.01, -0.999, -0.01).normalize()).1, 5, "the bottom row is -Y");
    assert_eq!(image.radiance(level(15.0)), Vec3::from(image.pixels()[2 * 12 + 6]));
}

#[test]
fn equirect_direction_and_pixel_agree() {
    let image = colourful(16, 8).rotated(some_turn());
    for row in 0..8 {
        for column in 0..16 {
            let d = image.direction((column as f32 + 0.5) / 16.0, (row as f32 + 0.5) / 8.0);
            assert_eq!(image.pixel_at(d), (column, row));
        }
    }
}

#[test]
fn equirect_lookup_never_leaves_the_picture() {
    let image = colourful(3, 2);
    for d in directions(500).chain([Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z]) {
        let (column, row) = image.pixel_at(d);
        assert!(column < 3 && row < 2, "{d}");
    }
}

#[test]
fn equirect_mends_negative_samples_and_refuses_the_rest() {
    let good = Equirect::new(2, 1, vec![[1.0, -2.0, 3.0], [-0.5, 0.0, 0.0]]).expect("mended");
    assert_eq!(good.n_negative(), 2);
    assert_eq!(good.pixels(), [[1.0, 0.0, 3.0], [0.0, 0.0, 0.0]]);

    assert_eq!(Equirect::new(0, 4, vec![]).unwrap_err(), EquirectError::Empty { width: 0, height: 4 });
    let wrong = Equirect::new(2, 2, vec![[0.0; 3]; 3]).unwrap_err();
    assert_eq!(wrong, EquirectError::WrongLength { expected: 4, found: 3 });
    let ridden = vec![[1.0; 3], [0.0, f32::NAN, 0.0], [f32::INFINITY, 0.0, -1e13], [1.0; 3]];
    let error = Equirect::new(2, 2, ridden).unwrap_err();
    assert_eq!(error, EquirectError::NotFinite { column: 1, row: 0, n_pixels: 2 });
    assert!(!error.to_string().contains('\n'));
}

#[test]
fn cap_contains_its_rim_at_every_scale() {
    for radius in [1e-4_f32, 0.004_65, 0.3, FRAC_PI_2, 2.5] {
        let cap = Cap { axis: Vec3::Y, radius, radiance: Vec3::ONE };
        let at = |angle: f32| Vec3::new(angle.sin(), angle.cos(), 0.0);
        // A thousandth of the radius is well above the rounding of f32 here.
        assert!(cap.contains(at(0.999 * radius)), "radius {radius}");
        assert!(!cap.contains(at(1.001 * radius)), "radius {radius}");
    }
    let everything = Cap { axis: Vec3::X, radius: PI, radiance: Vec3::ONE };
    assert!(directions(200).all(|d| everything.contains(d)), "a cap of radius pi is the whole sphere");
}

#[test]
fn cie_overcast_is_three_times_brighter_at_the_zenith() {
    let light = Light::new(Source::CieOvercast(CieOvercast::new(Vec3::splat(3.0))));
    assert_eq!(light.radiance(Vec3::Y), Vec3::splat(3.0));
    assert!((light.radiance(Vec3::new(1.0, 1e-6, 0.0)).x - 1.0).abs() < 1e-5);
    assert_eq!(light.radiance(Vec3::new(1.0, -1e-6, 0.0)), Vec3::ZERO);
}

#[test]
fn rotated_light_is_the_light_seen_from_a_turned_head() {
    let q = some_turn();
    let light = Light {
        sources: vec![
            Source::Uniform(Vec3::new(0.1, 0.2, 0.3)),
            Source::CieOvercast(CieOvercast::new(Vec3::ONE)),
            Source::Cap(Cap { axis: Vec3::X, radius: 0.7, radiance: Vec3::ONE }),
            Source::Sky(Sky::new(1.0, 0.5, 4.0).expect("in range")),
            Source::Equirect(colourful(8, 4)),
        ],
    };
    let turned = light.rotated(q);
    // A direction on an edge may fall on either side of it after the turn: allow a few of them.
    let differs = |d: &Vec3| !turned.radiance(q * *d).abs_diff_eq(light.radiance(*d), 1e-3);
    assert!(directions(2000).filter(differs).count() <= 4);
}

#[test]
fn lamp_far_away_gives_the_inverse_square_law() {
    let cap = Cap::of_sphere(Vec3::new(0.0, 100.0, 0.0), 0.5, Vec3::splat(7.0), Vec3::ZERO).expect("outside");
    let irradiance = 7.0 * crate::bent::cap_irradiance(&cap, Vec3::Y);
    // A sphere of radiance L and radius a at distance D gives exactly pi L (a/D)²; what is left is f32
    // rounding.
    let exact = PI * 7.0 * (0.5_f32 / 100.0).powi(2);
    assert!((irradiance / exact - 1.0).abs() < 1e-5, "{irradiance} against {exact}");
    assert!(Cap::of_sphere(Vec3::X, 2.0, Vec3::ONE, Vec3::ZERO).is_none(), "inside the lamp there is no cap");
}
