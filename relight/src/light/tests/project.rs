use std::f64::consts::TAU;

use super::*;
use crate::light::quadrature::{gauss_legendre, over};
use crate::sh;

const ORDER: usize = sh::MAX_ORDER;
const N: usize = ORDER * ORDER;

/// ∫ f y dω by brute force: `n` rows of equal width in a parameter t of 0..=1 (`height` gives cos θ about +Y
/// and its slope) times `2 n` azimuths, midpoints.
fn brute_force(n: usize, height: impl Fn(f64) -> (f64, f64), f: impl Fn(Vec3) -> Vec3) -> [[f64; 3]; N] {
    let (mut sum, mut y) = ([[0.0; 3]; N], [0.0; N]);
    for i in 0..n {
        let (cos, slope) = height((i as f64 + 0.5) / n as f64);
        let sin = (1.0 - cos * cos).sqrt();
        for j in 0..2 * n {
            let phi = (j as f64 + 0.5) * TAU / (2 * n) as f64;
            let d = Vec3::new((sin * phi.sin()) as f32, cos as f32, (-sin * phi.cos()) as f32);
            add_sample(d, slope / n as f64 * TAU / (2 * n) as f64, f(d), &mut y, &mut sum);
        }
    }
    sum
}

fn add_sample(d: Vec3, weight: f64, radiance: Vec3, y: &mut [f32; N], sum: &mut [[f64; 3]; N]) {
    sh::eval(ORDER, d, y);
    let weighted = radiance.as_dvec3() * weight;
    for (sum, y) in sum.iter_mut().zip(y) {
        for c in 0..3 {
            sum[c] += weighted[c] * f64::from(*y);
        }
    }
}

/// Largest difference of coefficients over the largest coefficient.
fn difference(a: &[[f32; 3]], b: &[[f64; 3]]) -> f64 {
    let largest = b.as_flattened().iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let differences = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (f64::from(*a) - b).abs());
    differences.fold(0.0, f64::max) / largest
}

fn project(light: &Light) -> [[f32; 3]; N] {
    let mut out = [[f32::NAN; 3]; N];
    project_sh(light, ORDER, &mut out);
    out
}

#[test]
fn uniform_projects_to_dc_alone() {
    let out = project(&Light::new(Source::Uniform(Vec3::new(1.0, 2.0, 3.0))));
    let dc = (4.0 * PI).sqrt();
    assert_eq!(out[0], [dc, 2.0 * dc, 3.0 * dc]);
    assert!(out[1..].iter().all(|c| *c == [0.0; 3]));
}

#[test]
fn overcast_projects_as_brute_force_says() {
    let light = Light::new(Source::CieOvercast(CieOvercast::new(Vec3::new(1.0, 0.5, 2.0))));
    // Rows over the upper half alone, so that the horizon is a border; midpoints then leave 5e-5 of P_9.
    let truth = brute_force(400, |t| (t, 1.0), |d| light.radiance(d));
    let error = difference(&project(&light), &truth);
    assert!(error < 1e-4, "{error}");
}

#[test]
fn caps_of_all_sizes_project_as_quadrature_over_their_disc() {
    let rule = gauss_legendre::<24>();
    for radius in [1e-3_f32, 0.004_65, 0.1, 1.0, FRAC_PI_2, 2.5, 3.1] {
        let cap =
            Cap { axis: Vec3::new(2.0, -1.0, 0.5).normalize(), radius, radiance: Vec3::new(1.0, 2.0, 0.0) };
        let (mut truth, mut y) = ([[0.0; 3]; N], [0.0; N]);
        let to_axis = Quat::from_rotation_arc(Vec3::Z, cap.axis);
        for (theta, weight) in over(&rule, 0.0, f64::from(radius)) {
            for (phi, weight_phi) in over(&rule, 0.0, TAU) {
                let (s, c) = theta.sin_cos();
                let d = Vec3::new((s * phi.cos()) as f32, (s * phi.sin()) as f32, c as f32);
                add_sample(to_axis * d, weight * weight_phi * s, cap.radiance, &mut y, &mut truth);
            }
        }
        // Gauss-Legendre is exact here; f32 directions and basis values leave a few 1e-6.
        let error = difference(&project(&Light::new(Source::Cap(cap))), &truth);
        assert!(error < 5e-6, "radius {radius}: {error}");
    }
}

#[test]
fn dome_projects_as_brute_force_says() {
    for degrees in [-3.0_f32, 0.3, 8.0, 45.0, 90.0] {
        let sky = Sky::new(2.0, degrees.to_radians().min(FRAC_PI_2), 3.0).expect("in range");
        let mut out = [[0.0; 3]; N];
        super::super::project::add_dome(&sky, ORDER, &mut out);
        // Elevation π/2 (1 - t)²: even at the zenith and dense at the horizon, where the dome has a root.
        let rows = |t: f64| {
            let (sin, cos) = (0.5 * std::f64::consts::PI * (1.0 - t).powi(2)).sin_cos();
            (sin, cos * std::f64::consts::PI * (1.0 - t))
        };
        let truth = brute_force(400, rows, |d| sky.dome_radiance(d));
        // The promise is 1e-4 of DC; the brute force itself is good to a few 1e-5 at the sun's kink.
        let error = difference(&out, &truth);
        assert!(error < 1e-4, "{degrees} degrees: {error}");
    }
}

#[test]
fn sky_projection_is_dome_plus_sun() {
    let sky = Sky::new(2.0, 0.6, 3.0).expect("in range");
    let whole = project(&Light::new(Source::Sky(sky.clone())));
    let mut parts = project(&Light::new(Source::Cap(sky.sun().expect("by day"))));
    super::super::project::add_dome(&sky, ORDER, &mut parts);
    let parts = parts.map(|c| c.map(f64::from));
    assert!(difference(&whole, &parts) < 1e-6);
}

#[test]
fn equirect_projects_as_the_sum_over_its_boxes() {
    let image = colourful(6, 3).rotated(some_turn()).scaled(2.0);
    // Rows even in the angle from the top, so that each pixel gets 80 x 80 samples and no edge cuts one.
    let polar =
        |t: f64| ((std::f64::consts::PI * t).cos(), std::f64::consts::PI * (std::f64::consts::PI * t).sin());
    let own_frame = Equirect::rotated(&image, image.orientation().inverse());
    let truth = brute_force(240, polar, |d| own_frame.radiance(d));
    let mut turned = [[0.0; 3]; N];
    sh::rotate(ORDER, some_turn(), &truth.map(|c| c.map(|x| x as f32)), &mut turned);
    // Midpoints over 80 steps per pixel: 1e-4 of the strongest coefficient.
    let error = difference(&project(&Light::new(Source::Equirect(image))), &turned.map(|c| c.map(f64::from)));
    assert!(error < 2e-4, "{error}");
}

#[test]
fn uniform_picture_of_one_pixel_is_a_uniform_light() {
    let image = Equirect::new(1, 1, vec![[2.0, 1.0, 0.5]]).expect("a good picture");
    let uniform = project(&Light::new(Source::Uniform(Vec3::new(2.0, 1.0, 0.5))));
    let error =
        difference(&project(&Light::new(Source::Equirect(image))), &uniform.map(|c| c.map(f64::from)));
    // f32 basis values.
    assert!(error < 1e-5, "{error}");
}

#[test]
fn projecting_a_turned_light_turns_its_projection() {
    let q = some_turn();
    for source in [
        Source::CieOvercast(CieOvercast::new(Vec3::ONE)),
        Source::Cap(Cap { axis: Vec3::X, radius: 0.2, radiance: Vec3::ONE }),
        Source::Sky(Sky::new(1.0, 0.3, 5.0).expect("in range")),
        Source::Equirect(colourful(32, 16)),
    ] {
        let light = Light::new(source);
        let mut turned = [[0.0; 3]; N];
        sh::rotate(ORDER, q, &project(&light), &mut turned);
        // Two roads through f32 matrices and basis values.
        let error = difference(&project(&light.rotated(q)), &turned.map(|c| c.map(f64::from)));
        assert!(error < 1e-5, "{light:?}: {error}");
    }
}

#[test]
fn lower_orders_are_prefixes_of_higher_ones() {
    let light = Light {
        sources: vec![
            Source::Sky(Sky::new(1.0, 0.3, 5.0).expect("in range")),
            Source::Equirect(colourful(8, 4)),
        ],
    };
    let whole = project(&light);
    for order in 1..ORDER {
        let mut out = vec![[0.0; 3]; order * order];
        project_sh(&light, order, &mut out);
        let error = difference(&out, &whole.map(|c| c.map(f64::from))[..order * order]);
        assert!(error < 1e-6, "order {order}: {error}");
    }
}

#[test]
fn windows_keep_dc_and_dampen_higher_bands_more() {
    for kind in [Window::Lanczos { strength: 1.0 }, Window::Laplacian { strength: 0.01 }] {
        let mut coefficients = [[1.0; 3]; 25];
        window(5, kind, &mut coefficients);
        assert_eq!(coefficients[0], [1.0; 3]);
        for l in 1..5 {
            assert!(coefficients[l * l][0] < coefficients[l * l - 1][0] && coefficients[l * l][0] > 0.0);
            assert!(coefficients[l * l..(l + 1) * (l + 1)].iter().all(|c| *c == coefficients[l * l]));
        }
    }
    let mut untouched = [[1.5; 3]; 25];
    window(5, Window::Laplacian { strength: 0.0 }, &mut untouched);
    window(5, Window::Lanczos { strength: 0.0 }, &mut untouched);
    assert_eq!(untouched, [[1.5; 3]; 25]);
}

#[test]
fn window_takes_the_negative_light_out_of_a_sun() {
    let mut sun = project(&Light::new(Source::Cap(Cap { axis: Vec3::Y, radius: 0.05, radiance: Vec3::ONE })));
    let darkest = |coefficients: &[[f32; 3]; N]| {
        let mut y = [0.0; N];
        let value = |d| {
            sh::eval(5, d, &mut y);
            (0..25).map(|i| y[i] * coefficients[i][0]).sum::<f32>()
        };
        directions(2000).map(value).fold(f32::INFINITY, f32::min)
    };
    let ringing = darkest(&sun);
    window(5, Window::Lanczos { strength: 1.0 }, &mut sun);
    // Lanczos leaves about a tenth of the ripple.
    assert!(ringing < 0.0 && darkest(&sun) > 0.25 * ringing, "{ringing} before, {} after", darkest(&sun));
}
