use std::f32::consts::{FRAC_1_PI, PI};

use glam::{Quat, Vec3};

use super::{Random, hit, lamp};
use crate::lobe::reflectance::{ColouredLobe, Cosine, Reflectance, ShapedLobe, reflectance_lobes};
use crate::lobe::{
    Blockers, Lamp, Motion, Options, Points, Scene, Scratch, Sphere, SphereSet, Surface, Target, add_radiance,
};

/// On the ground, with the tangent along x and so the bitangent along -z.
fn lobes(material: &Reflectance, view: Vec3) -> Vec<ColouredLobe> {
    let all = reflectance_lobes(material, Vec3::Y, Vec3::X, view);
    all.into_iter().filter(|lobe| lobe.scale != Vec3::ZERO).collect()
}

fn value(lobes: &[ColouredLobe], v: Vec3) -> f32 {
    lobes.iter().map(|l| l.scale.x * l.axis.dot(v).max(0.0).powf(l.exponent)).sum()
}

fn lafortune(direction: Vec3, exponent: f32) -> Reflectance {
    let lobe = ShapedLobe { direction, exponent, scale: Vec3::splat(0.3), cosine: Cosine::Times };
    Reflectance::lafortune(Vec3::splat(0.2), &[lobe])
}

#[test]
fn lambert_and_phong_are_exact() {
    let view = Vec3::new(0.3, 0.8, -0.2).normalize();
    let mirrored = Vec3::new(-view.x, view.y, -view.z);
    let phong = Reflectance::phong(Vec3::splat(0.1), Vec3::splat(0.6), 30.0);
    let diffuse = lobes(&Reflectance::lambert(Vec3::splat(0.5)), view);
    let glossy = lobes(&phong, view);
    let mut random = Random(1);
    for _ in 0..200 {
        let v = random.direction();
        assert!((value(&diffuse, v) - 0.5 * FRAC_1_PI * v.y.max(0.0)).abs() < 1e-6);
        let truth = 0.1 * v.y.max(0.0) + 0.6 * mirrored.dot(v).max(0.0).powi(30);
        assert!((value(&glossy, v) - truth).abs() < 1e-5);
    }
}

#[test]
fn modified_phong_reflects_no_more_than_it_gets() {
    let white = Reflectance::modified_phong(Vec3::splat(0.4), Vec3::splat(0.6), 20.0);
    for i in 1..20 {
        let angle = i as f32 / 20.0 * 0.5 * PI;
        let view = Vec3::new(angle.sin(), angle.cos(), 0.0);
        let lobes = lobes(&white, view);
        let reflected: f32 = lobes.iter().map(|l| 2.0 * PI * l.scale.x / (l.exponent + 1.0)).sum();
        // Equality for a view along the normal, where the lobes' product is within 0.5 %.
        assert!(reflected < 1.005, "{angle}: {reflected}");
    }
}

#[test]
fn lafortune_lobes_point_where_they_should() {
    let view = Vec3::new(0.5, 0.8, 0.1).normalize();
    let axis = |direction| lobes(&lafortune(direction, 40.0), view)[1].axis;
    // Local axes are tangent X, bitangent, normal Y. The cosine pulls lobes a little towards the normal.
    let mirrored = Vec3::new(-view.x, view.y, -view.z);
    assert!(axis(Vec3::new(-1.0, -1.0, 1.0)).dot(mirrored) > 0.999);
    assert!(axis(Vec3::ONE).dot(view) > 0.999);
    // Off-specular: further from the normal than the mirror direction.
    assert!(axis(Vec3::new(-1.0, -1.0, 0.6)).y < mirrored.y - 0.1);
    // Anisotropic: a quarter turn of the tangent changes it.
    let direction = Vec3::new(-1.0, -0.3, 0.9);
    let other = reflectance_lobes(&lafortune(direction, 40.0), Vec3::Y, Vec3::Z, view)[1].axis;
    assert!(axis(direction).distance(other) > 0.1);
}

#[test]
fn lafortune_value_is_the_models() {
    let (direction, exponent) = (Vec3::new(-0.9, -0.7, 0.8), 25.0);
    let view = Vec3::new(0.4, 0.85, -0.3).normalize();
    let lobes = lobes(&lafortune(direction, exponent), view);
    let local = |v: Vec3| Vec3::new(v.x, -v.z, v.y);
    let mut random = Random(2);
    let (mut off, mut all) = (0.0, 0.0);
    for _ in 0..4000 {
        let v = random.direction();
        let model = (direction * local(view)).dot(local(v)).max(0.0).powf(exponent);
        let truth = (0.2 * FRAC_1_PI + 0.3 * model) * v.y.max(0.0);
        off += (value(&lobes, v) - truth).abs();
        all += truth;
    }
    // Lobe times cosine as one lobe: the linear cosine bends a lobe of exponent 25 by about a percent.
    assert!(off / all < 0.02, "{}", off / all);
}

#[test]
fn nothing_is_reflected_to_a_view_from_below() {
    let material = Reflectance::lambert(Vec3::ONE);
    assert!(lobes(&material, Vec3::NEG_Y).is_empty());
    let mut light = [[0.0; 3]];
    let surface =
        Surface { materials: &[material], material: &[0], tangent: &[], eye: Vec3::new(0.0, -1.0, 0.0) };
    let points = Points { position: &[[0.0; 3]], normal: &[[0.0, 1.0, 0.0]] };
    let lamps = [lamp([0.0, 2.0, 0.0], 0.5)];
    let mut target = Target { light: &mut light, products: None };
    let scene = Scene { lamps: &lamps, blockers: &Blockers::default() };
    add_radiance(&points, &surface, &scene, &Options::default(), &mut Scratch::default(), &mut target);
    assert_eq!(light, [[0.0; 3]]);
}

/// Reflected radiance by rays over the lamp's cap, of the model itself.
fn traced(point: Vec3, view: Vec3, f: impl Fn(Vec3) -> f32, lamp: &Lamp, spheres: &[Sphere]) -> f32 {
    let to = lamp.centre - point;
    let sin = lamp.radius / to.length();
    let versine = 1.0 - (1.0 - sin * sin).sqrt();
    let turn = Quat::from_rotation_arc(Vec3::Z, to.normalize());
    let n = 96;
    let mut sum = 0.0;
    for k in 0..n * n {
        let drop = versine * ((k % n) as f32 + 0.5) / n as f32;
        let (s, c) = (2.0 * PI * ((k / n) as f32 + 0.5) / n as f32).sin_cos();
        let r = (drop * (2.0 - drop)).sqrt();
        let v = turn * Vec3::new(r * c, r * s, 1.0 - drop);
        let clear = !spheres.iter().any(|s| hit(point, v, s).is_some());
        sum += if clear && view.y > 0.0 { f(v) } else { 0.0 };
    }
    sum / (n * n) as f32 * 2.0 * PI * versine
}

#[test]
fn glossy_ground_follows_rays() {
    let specular = 0.5;
    for exponent in [10.0f32, 80.0, 600.0] {
        let material = Reflectance::phong(Vec3::splat(0.1), Vec3::splat(specular), exponent);
        let eye = Vec3::new(0.0, 2.5, 5.0);
        let light = lamp([0.0, 3.0, -4.0], 0.8);
        let spheres = [Sphere { centre: Vec3::new(0.5, 1.2, -1.2), radius: 0.5 }];
        let mut blockers = Blockers::default();
        blockers.push(&SphereSet::new(spheres.to_vec()).unwrap(), &Motion::default());
        let positions = super::ground(24, 3.0);
        let normals = vec![[0.0, 1.0, 0.0]; positions.len()];
        let which = vec![0; positions.len()];
        let surface = Surface { materials: &[material], material: &which, tangent: &[], eye };
        let points = Points { position: &positions, normal: &normals };
        let mut out = vec![[0.0; 3]; positions.len()];
        let mut target = Target { light: &mut out, products: None };
        let scene = Scene { lamps: &[light], blockers: &blockers };
        add_radiance(&points, &surface, &scene, &Options::default(), &mut Scratch::default(), &mut target);
        let truth: Vec<f32> = positions
            .iter()
            .map(|&p| {
                let point = Vec3::from(p);
                let view = (eye - point).normalize();
                let mirrored = Vec3::new(-view.x, view.y, -view.z);
                let f = |v: Vec3| 0.1 * v.y + specular * mirrored.dot(v).max(0.0).powf(exponent);
                traced(point, view, f, &light, &spheres)
            })
            .collect();
        let ours: Vec<f32> = out.iter().map(|c| c[0]).collect();
        let difference = super::relative_difference(&ours, &truth);
        println!("exponent {exponent}: relative difference {difference:.4}");
        // A disc of light becomes a bell: the rim of a highlight is softer than it should be, the more the
        // narrower the lobe is against the lamp (0.15 rad).
        assert!(difference < if exponent < 100.0 { 0.05 } else { 0.12 }, "{exponent}: {difference}");
    }
}
