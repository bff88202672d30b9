use super::test_scenes::{Geometry, closed_box, floor_with_block};
use super::*;
use crate::tracer::lambert;
use glam::{Quat, Vec2};
use lunette_relight::light::{Cap, CieOvercast, Equirect, Sky, Source};
use std::f32::consts::PI;

fn options(samples: u32, bounces: u32) -> ReferenceOptions {
    ReferenceOptions { samples, bounces, seed: 7 }
}

fn at(
    geometry: &Geometry,
    light: &Light,
    point: Vec3,
    normal: Vec3,
    options: &ReferenceOptions,
) -> (Vec3, Vec3, Vec3) {
    let tracer = Tracer::new(geometry.surface()).unwrap();
    let found = reference_irradiance(&tracer, light, &[point], &[normal], options, |_| ()).unwrap();
    (found.direct[0], found.indirect[0], found.error[0])
}

fn open_floor() -> Geometry {
    let mut geometry = Geometry::default();
    geometry.add(Vec3::new(-1.0, 0.0, -1.0), 2.0 * Vec3::Z, 2.0 * Vec3::X, Vec3::splat(0.7));
    geometry
}

fn cap(axis: Vec3, radius: f32, radiance: f32) -> Light {
    Light::new(Source::Cap(Cap { axis: axis.normalize(), radius, radiance: Vec3::splat(radiance) }))
}

/// Within 4.5 standard errors, where these come from 16 batches (Student's t with 15 degrees of freedom: 4e-4), plus
/// the rounding of f32 sums.
fn agrees(found: Vec3, error: Vec3, expected: Vec3) -> bool {
    (found - expected).abs().cmple(4.5 * error + 2e-5 * expected.abs() + 1e-6).all()
}

#[test]
fn open_plane_under_uniform_light_gets_pi() {
    let light = Light::new(Source::Uniform(Vec3::new(1.0, 2.0, 0.5)));
    let (direct, indirect, error) = at(&open_floor(), &light, Vec3::ZERO, Vec3::Y, &options(64, 3));
    // Cosine sampling has no variance here.
    assert!((direct - PI * Vec3::new(1.0, 2.0, 0.5)).abs().max_element() < 1e-4, "{direct}");
    assert_eq!(indirect, Vec3::ZERO);
    assert!(error.max_element() < 1e-5);
}

#[test]
fn open_plane_under_overcast_sky_matches_moon_and_spencer() {
    let light = Light::new(Source::CieOvercast(CieOvercast::new(Vec3::splat(3.0))));
    let (direct, _, error) = at(&open_floor(), &light, Vec3::ZERO, Vec3::Y, &options(4096, 0));
    // E = 7 pi Lz / 9.
    assert!(agrees(direct, error, Vec3::splat(7.0 * PI / 3.0)), "{direct} {error}");
    assert!(error.x < 1e-3);
}

#[test]
fn open_plane_under_caps_matches_closed_form() {
    for (elevation, radius) in [(1.2f32, 0.3f32), (0.8, 0.6), (0.3, 0.004_653), (0.05, 0.01), (1.5, 1e-3)] {
        let light = cap(Vec3::new(elevation.cos(), elevation.sin(), 0.0), radius, 10.0);
        let (direct, _, error) = at(&open_floor(), &light, Vec3::ZERO, Vec3::Y, &options(1024, 0));
        // A cap above the horizon: E = pi L sin^2(radius) sin(elevation).
        let expected = PI * 10.0 * radius.sin().powi(2) * elevation.sin();
        assert!(
            agrees(direct, error, Vec3::splat(expected)),
            "{elevation} {radius}: {direct} {error} {expected}"
        );
        assert!(error.x < 6e-3 * expected, "{error} {expected}");
    }
}

#[test]
fn half_set_cap_matches_numeric_integral() {
    let radius = 0.2f32;
    let light = cap(Vec3::X, radius, 1.0);
    let (direct, _, error) = at(&open_floor(), &light, Vec3::ZERO, Vec3::Y, &options(4096, 0));
    // Centre on the horizon: integral over the half cap of cos = 2/3-like in the small; summed in rings around the
    // axis: half a ring of angle t has the sum of cosines 2 sin(t), times the ring's sin(t) dt.
    let n = 10_000;
    let ring = |i: usize| 2.0 * ((i as f32 + 0.5) / n as f32 * radius).sin().powi(2) * radius / n as f32;
    let expected: f32 = (0..n).map(ring).sum();
    assert!(agrees(direct, error, Vec3::splat(expected)), "{direct} {error} {expected}");
}

#[test]
fn equirect_equals_the_cap_painted_into_it() {
    // A bright spot on a dim ground, turned: the sum over pixels is exact.
    let (width, height) = (64, 32);
    let mut pixels = vec![[0.2, 0.1, 0.05]; width * height];
    pixels[6 * width + 40] = [500.0, 400.0, 300.0];
    let turn = Quat::from_rotation_x(0.4);
    let image = Equirect::new(width, height, pixels.clone()).unwrap().rotated(turn);
    let mut expected = glam::DVec3::ZERO;
    let fine = 8;
    for (i, pixel) in pixels.iter().enumerate() {
        for k in 0..fine * fine {
            let u = (i % width) as f32 + ((k % fine) as f32 + 0.5) / fine as f32;
            let v = (i / width) as f32 + ((k / fine) as f32 + 0.5) / fine as f32;
            let d = image.direction(u / width as f32, v / height as f32);
            let sin = f64::from(v / height as f32 * PI).sin();
            let solid_angle =
                2.0 * std::f64::consts::PI.powi(2) / (width * height * fine * fine) as f64 * sin;
            expected += Vec3::from(*pixel).as_dvec3() * f64::from(d.y.max(0.0)) * solid_angle;
        }
    }
    let light = Light::new(Source::Equirect(image));
    let (direct, _, error) = at(&open_floor(), &light, Vec3::ZERO, Vec3::Y, &options(4096, 0));
    // The sum itself is good to 1e-4 (64 points in each pixel).
    let allowed = error + 2e-5 * expected.as_vec3();
    assert!(agrees(direct, allowed, expected.as_vec3()), "{direct} {error} {expected}");
    assert!(error.cmplt(2e-3 * expected.as_vec3()).all(), "{error}");
}

#[test]
fn clear_sky_matches_a_sum_over_the_dome() {
    let sky = Sky::new(2.0, 0.7, 3.0).unwrap();
    let sun = sky.sun().unwrap();
    let light = Light::new(Source::Sky(sky.clone()));
    let (direct, _, error) = at(&open_floor(), &light, Vec3::ZERO, Vec3::Y, &options(4096, 0));
    let (rows, columns) = (600, 1200);
    let mut expected = glam::DVec3::ZERO;
    for i in 0..rows * columns {
        // Equal steps of the squared height weigh with the cosine.
        let y = ((i / columns) as f32 + 0.5) / rows as f32;
        let (sin, cos) = ((i % columns) as f32 / columns as f32 * 2.0 * PI).sin_cos();
        let d = Vec3::new((1.0 - y).sqrt() * cos, y.sqrt(), (1.0 - y).sqrt() * sin);
        expected += sky.dome_radiance(d).as_dvec3() * std::f64::consts::PI / f64::from(rows * columns);
    }
    let disc = sun.radiance * PI * sun.radius.sin().powi(2) * sun.axis.y;
    let expected = expected.as_vec3() + disc;
    // The sum over the dome is good to 1e-4 of the dome, which is a fifth of the whole.
    assert!(agrees(direct, error + 1e-5 * expected, expected), "{direct} {error} {expected}");
    assert!(error.cmplt(3e-3 * expected).all(), "{error} {expected}");
}

/// In a white box with a hole, light 1 everywhere outside, every point has E = pi after enough bounces.
#[test]
fn white_furnace_tends_to_pi() {
    let mut geometry = Geometry::default();
    geometry.add_box(Vec3::splat(-1.0), Vec3::splat(2.0), Vec3::ONE, -1.0);
    // Without its lid.
    let lid =
        geometry.index.iter().position(|t| t.iter().all(|&v| geometry.position[v as usize].y > 0.9)).unwrap();
    geometry.index.drain(lid..lid + 2);
    let light = Light::new(Source::Uniform(Vec3::ONE));
    let point = Vec3::new(-0.9, -1.0, 0.8);
    let (direct, indirect, error) = at(&geometry, &light, point, Vec3::Y, &options(2048, 200));
    assert!(agrees(direct + indirect, error, Vec3::splat(PI)), "{direct} {indirect} {error}");
    assert!(error.max_element() < 0.02 * PI);
    let (_, one_bounce, _) = at(&geometry, &light, point, Vec3::Y, &options(2048, 1));
    assert!(one_bounce.x < indirect.x);
}

#[test]
fn black_walls_bounce_nothing_and_closed_boxes_are_dark() {
    let light = cap(Vec3::Y, 1.0, 5.0);
    let mut black = floor_with_block();
    black.albedo.fill(Vec3::ZERO);
    let (_, indirect, _) = at(&black, &light, Vec3::new(2.0, 0.0, 0.0), Vec3::Y, &options(256, 8));
    assert_eq!(indirect, Vec3::ZERO);
    let (direct, indirect, _) =
        at(&closed_box(Vec3::ONE), &light, Vec3::NEG_Y * 0.5, Vec3::Y, &options(4096, 8));
    assert_eq!((direct, indirect), (Vec3::ZERO, Vec3::ZERO));
}

/// A wide wall beside a point hides half the sky and sends back half of what it gets itself: one bounce in closed form.
#[test]
fn infinite_corner_bounces_a_quarter() {
    let albedo = Vec3::new(0.8, 0.5, 0.0);
    let mut geometry = Geometry::default();
    let big = 4000.0;
    geometry.add(Vec3::new(-big, 0.0, -big), 2.0 * big * Vec3::Z, 2.0 * big * Vec3::X, Vec3::ZERO);
    geometry.add(Vec3::new(0.0, 0.0, -big), 2.0 * big * Vec3::Z, big * Vec3::Y, albedo);
    let light = Light::new(Source::CieOvercast(CieOvercast::new(Vec3::ONE)));
    let (_, indirect, error) = at(&geometry, &light, Vec3::new(-1.0, 0.0, 0.0), Vec3::Y, &options(4096, 4));
    // The wall sees a quarter sphere of overcast sky: E = integral of (1 + 2 y)/3 max(n.w, 0) = pi/6 + 4/9, half of it
    // goes to the floor: the view factor of a wall of infinite height from a point at its foot.
    let wall = PI / 6.0 + 4.0 / 9.0;
    // The wall ends at 4 km: a ray in 10^7 passes over it.
    assert!(agrees(indirect, error, 0.5 * wall * albedo), "{indirect} {error} {wall}");
}

#[test]
fn standard_error_is_honest() {
    let geometry = floor_with_block();
    let tracer = Tracer::new(geometry.surface()).unwrap();
    let light = Light {
        sources: vec![
            Source::CieOvercast(CieOvercast::new(Vec3::ONE)),
            Source::Cap(Cap { axis: Vec3::new(0.8, 0.6, 0.0), radius: 0.1, radiance: Vec3::splat(30.0) }),
        ],
    };
    let points: Vec<Vec3> = (0..100)
        .map(|i| Vec3::new(-3.8 + 0.76 * (i % 10) as f32, 0.0, -3.8 + 0.76 * (i / 10) as f32))
        .collect();
    let normals = vec![Vec3::Y; points.len()];
    let run = |samples, seed| {
        let options = ReferenceOptions { samples, bounces: 2, seed };
        reference_irradiance(&tracer, &light, &points, &normals, &options, |_| ()).unwrap()
    };
    let (few, many) = (run(64, 1), run(4096, 2));
    let mut squares = 0.0;
    let mut n = 0.0;
    for i in 0..points.len() {
        let variance = few.error[i].x.powi(2) + many.error[i].x.powi(2);
        if variance > 1e-12 {
            squares += f64::from((few.total()[i].x - many.total()[i].x).powi(2) / variance);
            n += 1.0;
        }
    }
    // Squares of Student's t with 15 degrees of freedom have mean 15/13 and variance 3.6; the mean of 90 of them has a
    // standard deviation of 0.2.
    assert!(n > 80.0 && squares / n > 0.5 && squares / n < 2.0, "{n} {}", squares / n);
}

#[test]
fn results_do_not_depend_on_threads() {
    let geometry = floor_with_block();
    let tracer = Tracer::new(geometry.surface()).unwrap();
    let light = Light::new(Source::Sky(Sky::new(1.0, 0.5, 3.0).unwrap()));
    let camera = Camera::new(Vec3::new(5.0, 4.0, 6.0), Vec3::ZERO, 40.0);
    let run = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| reference_image(&tracer, &light, &camera, (40, 24), &options(4, 2), |_| ()).unwrap())
    };
    let (one, three) = (run(1), run(3));
    assert_eq!(one.image, three.image);
    assert_eq!(one.direct, three.direct);
    assert_eq!(one.error, three.error);
}

#[test]
fn reference_image_agrees_with_reference_points() {
    let geometry = floor_with_block();
    let tracer = Tracer::new(geometry.surface()).unwrap();
    let light = cap(Vec3::new(0.3, 0.8, 0.5), 0.4, 2.0);
    // One pixel of a hundredth of a degree: a point.
    let camera = Camera::new(Vec3::new(2.0, 3.0, 2.0), Vec3::new(1.5, 0.0, 1.0), 0.01);
    let picture = reference_image(&tracer, &light, &camera, (1, 1), &options(8192, 4), |_| ()).unwrap();
    let (direct, indirect, error) = at(&geometry, &light, camera.target, Vec3::Y, &options(8192, 4));
    let expected = lambert(Vec3::splat(0.6), direct + indirect);
    assert!(
        agrees(picture.image.pixels[0], picture.error.pixels[0] + error, expected),
        "{picture:?} {expected}"
    );
    assert!(expected.x > 0.05);
}

#[test]
fn both_sides_of_a_surface_are_lit() {
    let geometry = open_floor();
    let tracer = Tracer::new(geometry.surface()).unwrap();
    let light = cap(Vec3::NEG_Y, 0.5, 1.0);
    let seen = |y: f32| {
        let camera = Camera::new(Vec3::new(0.0, y, 0.0), Vec3::ZERO, 1.0);
        reference_image(&tracer, &light, &camera, (1, 1), &options(4096, 1), |_| ()).unwrap()
    };
    let (above, below) = (seen(1.0), seen(-1.0));
    assert_eq!(above.image.pixels[0], Vec3::ZERO);
    let expected = Vec3::splat(0.7 * 0.5f32.sin().powi(2));
    assert!(agrees(below.image.pixels[0], below.error.pixels[0], expected), "{below:?} {expected}");
    assert!(below.error.pixels[0].x < 0.01 * expected.x);
}

#[test]
fn unusable_options_are_refused() {
    let geometry = open_floor();
    let tracer = Tracer::new(geometry.surface()).unwrap();
    let light = Light::dark();
    let none = reference_irradiance(&tracer, &light, &[Vec3::ZERO], &[Vec3::Y], &options(1, 1), |_| ());
    assert!(none.is_err());
    assert!(reference_irradiance(&tracer, &light, &[Vec3::ZERO], &[], &options(16, 1), |_| ()).is_err());
    let done = std::sync::atomic::AtomicUsize::new(0);
    let count = |n| {
        done.fetch_add(n, std::sync::atomic::Ordering::Relaxed);
    };
    let points = vec![Vec3::ZERO; 70];
    reference_irradiance(&tracer, &light, &points, &[Vec3::Y; 70], &options(2, 0), count).unwrap();
    assert_eq!(done.into_inner(), 70);
}

#[test]
fn batches_cover_all_samples() {
    for samples in [2, 3, 15, 31, 32, 100] {
        let plan = Plan::new(&options(samples, 0)).unwrap();
        assert!(plan.n_batches >= 2 && plan.n_batches * plan.per_batch >= samples);
        let average = plan.average(3, |draw| {
            let Vec2 { x, y } = draw.point(0);
            Gathered { direct: Vec3::splat(x), indirect: Vec3::splat(y) }
        });
        let total = average.mean.direct + average.mean.indirect;
        assert!((total.x - 1.0).abs() < 0.9 && average.error.x > 0.0);
    }
}
