use super::*;
use crate::exterior::Pose;
use crate::reference::test_scenes::Geometry;
use glam::Quat;
use lunette_relight::light::{CieOvercast, Sky};
use std::f32::consts::PI;

fn captured(light: &Light, exterior: Option<&Exterior>, centre: Vec3, n: usize) -> Vec<[f32; 3]> {
    let mut texels = vec![[f32::NAN; 3]; n_texels(n)];
    capture(&Backdrop::new(light, n).unwrap(), exterior, centre, &mut texels).unwrap();
    texels
}

fn energy(texels: &[[f32; 3]], n: usize) -> Vec3 {
    let texels = texels.iter().enumerate();
    texels.map(|(i, texel)| Vec3::from(*texel) * cubemap::solid_angle(n, i)).sum()
}

fn cap(axis: Vec3, radius: f32, radiance: f32) -> Source {
    Source::Cap(Cap { axis: axis.normalize(), radius, radiance: Vec3::splat(radiance) })
}

/// A box of 2 m around `middle`.
fn block(middle: Vec3, albedo: f32) -> Geometry {
    let mut geometry = Geometry::default();
    geometry.add_box(middle - 1.0, Vec3::splat(2.0), Vec3::splat(albedo), 1.0);
    geometry
}

#[test]
fn shell_without_exterior_is_the_projected_light() {
    let light = Light {
        sources: vec![
            Source::CieOvercast(CieOvercast::new(Vec3::ONE)),
            cap(Vec3::new(1.0, 0.3, -0.4), 0.005, 1e4),
            Source::Sky(Sky::new(1.0, 0.4, 3.0).unwrap()),
        ],
    };
    for n in [8, 9, 32] {
        let mut expected = vec![[0.0; 3]; n_texels(n)];
        project_light(&light, n, &mut expected);
        for (found, expected) in captured(&light, None, Vec3::ZERO, n).iter().zip(expected) {
            let (found, expected) = (Vec3::from(*found), Vec3::from(expected));
            // Suns are taken out and put back: rounding of the brightest texel, some 1e4.
            assert!((found - expected).abs().max_element() < 1e-6 * expected.max_element() + 2e-3);
        }
    }
}

/// A sphere of directions is covered by a box around the centre: everything is its light, nothing the sky's.
#[test]
fn closed_exterior_hides_light_and_sun() {
    let light = Light { sources: vec![Source::Uniform(Vec3::ONE), cap(Vec3::Y, 0.005, 1e5)] };
    let exterior = Exterior::new(&[block(Vec3::ZERO, 0.5).surface()]).unwrap();
    let texels = captured(&light, Some(&exterior), Vec3::new(0.2, 0.1, -0.3), 16);
    // Seen from inside, where the outside's transfer is shown, by design of two-sided sheets: albedo E / pi = 0.5 of
    // the uniform light; the sun's shadow rays are blocked.
    for texel in &texels {
        assert!((texel[0] - 0.5).abs() < 0.02, "{texel:?}");
    }
}

/// The solid angle of a square of side 2 m, 3 m away, is 4 asin(1 / (1 + 9)): what it covers of a white sky, black.
#[test]
fn covered_share_matches_the_solid_angle() {
    let light = Light::new(Source::Uniform(Vec3::ONE));
    let exterior = Exterior::new(&[block(Vec3::ZERO, 0.0).surface()]).unwrap();
    let solid_angle = 4.0 * (1.0f32 / 10.0).asin();
    for (n, axis) in [(8, Vec3::X), (15, Vec3::NEG_Y), (32, Vec3::Z), (32, Vec3::NEG_X)] {
        let texels = captured(&light, Some(&exterior), 4.0 * axis, n);
        let hidden = 4.0 * PI - energy(&texels, n).x;
        // 4 to 16 rays in each of 10 to 130 texels, most of them inside.
        let allowed = 0.3 / n as f32;
        assert!((hidden / solid_angle - 1.0).abs() < allowed, "{n} {axis}: {hidden} {solid_angle}");
    }
}

/// Light falls off the near face of a box by its closed form, under a sky and a sun.
#[test]
fn covered_texels_show_the_lit_surface() {
    let sun = cap(Vec3::new(0.6, 0.8, 0.0), 0.005, 2000.0);
    let light = Light { sources: vec![Source::Uniform(Vec3::ONE), sun] };
    let exterior = Exterior::new(&[block(Vec3::ZERO, 0.4).surface()]).unwrap();
    let n = 16;
    let sun_power = 2000.0 * PI * 0.005f32.powi(2);
    for (axis, cos) in [(Vec3::X, 0.6), (Vec3::Y, 0.8), (Vec3::NEG_X, 0.0), (Vec3::Z, 0.0)] {
        let texels = captured(&light, Some(&exterior), 3.0 * axis, n);
        let found = texels[cubemap::texel_of(n, -axis + Vec3::splat(0.01))][0];
        let expected = 0.4 * (1.0 + sun_power * cos / PI);
        // Uniform light has no variance in the transfer; 1e-3 is left for rounding and the sun's width.
        assert!((found / expected - 1.0).abs() < 1e-3, "{axis}: {found} {expected}");
    }
}

#[test]
fn sun_goes_behind_a_moving_object() {
    let light = Light::new(cap(Vec3::X, 0.02, 1000.0));
    let mut exterior = Exterior::new(&[block(Vec3::ZERO, 0.0).surface()]).unwrap();
    let n = 32;
    let whole = energy(&captured(&light, None, Vec3::ZERO, n), n).x;
    let mut shares = Vec::new();
    for y in [3.0, 1.2, 1.0, 0.0] {
        let pose = Pose { position: Vec3::new(11.0, y, 0.0), ..Pose::default() };
        exterior.set_pose(0, pose).unwrap();
        shares.push(energy(&captured(&light, Some(&exterior), Vec3::ZERO, n), n).x / whole);
    }
    // The near face is 10 m away: at a height of 1 m its edge halves the disc, at 1.2 m it just leaves it (0.2 m).
    let expected = [1.0, 1.0, 0.5, 0.0];
    // 64 stratified rays.
    assert!(shares.iter().zip(expected).all(|(s, e)| (s - e).abs() < 0.04), "{shares:?}");
}

/// A slab over a floor: the floor below it is in its shadow, the floor beside it in the sun.
#[test]
fn objects_shade_each_other_from_the_sun() {
    let mut floor = Geometry::default();
    floor.add(Vec3::new(-50.0, 0.0, -50.0), 100.0 * Vec3::Z, 100.0 * Vec3::X, Vec3::splat(0.5));
    let slab = block(Vec3::ZERO, 0.5);
    let mut exterior = Exterior::new(&[floor.surface(), slab.surface()]).unwrap();
    exterior
        .set_pose(1, Pose { position: Vec3::new(0.0, 6.0, 0.0), rotation: Quat::from_rotation_y(0.4) })
        .unwrap();
    let light = Light::new(cap(Vec3::Y, 0.01, 1e4));
    let centre = Vec3::new(0.0, 2.5, 0.0);
    let n = 16;
    let texels = captured(&light, Some(&exterior), centre, n);
    let seen = |p: Vec3| texels[cubemap::texel_of(n, p - centre)][0];
    let in_sun = 0.5 * 1e4 * 0.01f32.powi(2);
    assert_eq!(seen(Vec3::new(0.1, 0.0, 0.1)), 0.0);
    assert!((seen(Vec3::new(3.0, 0.0, 0.5)) / in_sun - 1.0).abs() < 2e-3);
    assert_eq!(seen(Vec3::new(0.1, 6.0, 0.1)), 0.0, "the slab's underside");
}

/// A box that is turned shows the same light as one built turned.
#[test]
fn turned_object_is_lit_like_one_built_turned() {
    let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.3);
    let at = Vec3::new(0.5, 0.3, -5.0);
    let mut built = block(Vec3::ZERO, 0.7);
    built.position.iter_mut().for_each(|p| *p = turn * *p + at);
    built.normal.iter_mut().for_each(|n| *n = turn * *n);
    let mut moved = Exterior::new(&[block(Vec3::ZERO, 0.7).surface()]).unwrap();
    moved.set_pose(0, Pose { rotation: turn, position: at }).unwrap();
    let light =
        Light { sources: vec![Source::CieOvercast(CieOvercast::new(Vec3::ONE)), cap(Vec3::X, 0.05, 50.0)] };
    let n = 24;
    let (a, b) = (
        captured(&light, Some(&Exterior::new(&[built.surface()]).unwrap()), Vec3::ZERO, n),
        captured(&light, Some(&moved), Vec3::ZERO, n),
    );
    let worst = a.iter().zip(&b).map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, f32::max);
    // Same rays but for rounding; the transfers come from 64 other rays each.
    assert!(worst < 0.03, "{worst}");
}

#[test]
fn unusable_shells_are_refused() {
    let light = Light::dark();
    for n in [0, 7, 65] {
        assert!(Backdrop::new(&light, n).is_err());
    }
    let backdrop = Backdrop::new(&light, 8).unwrap();
    assert!(capture(&backdrop, None, Vec3::ZERO, &mut [[0.0; 3]; 7]).is_err());
    assert!(capture(&backdrop, None, Vec3::NAN, &mut [[0.0; 3]; 384]).is_err());
}
