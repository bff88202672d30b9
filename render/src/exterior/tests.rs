use super::*;
use crate::reference::test_scenes::{Geometry, floor_with_block};
use lunette_relight::light::{CieOvercast, Light, Source, split};

#[test]
fn open_plane_has_the_transfer_of_the_clamped_cosine() {
    let mut geometry = Geometry::default();
    geometry.add(Vec3::ZERO, Vec3::Z, Vec3::X, Vec3::splat(0.5));
    let exterior = Exterior::new(&[geometry.surface()]).unwrap();
    let light = split(&Light::new(Source::CieOvercast(CieOvercast::new(Vec3::ONE))), &mut Vec::new());
    let (irradiance, albedo) = exterior.objects[0].smooth_irradiance(0, &light);
    // 7 pi / 9; of it SH of order 3 holds all but 1 %, and 64 rays find it to 1 %.
    assert!((irradiance.x / (7.0 * PI / 9.0) - 1.0).abs() < 0.03, "{irradiance}");
    assert_eq!(albedo, Vec3::splat(0.5));
}

#[test]
fn nearness_follows_the_pose() {
    let block = floor_with_block();
    let mut exterior = Exterior::new(&[block.surface()]).unwrap();
    let (low, high) = (Vec3::new(-1.0, 0.5, 5.0), Vec3::new(1.0, 1.0, 6.0));
    assert!(exterior.overlaps(low, high).is_empty());
    assert!((exterior.nearest(Vec3::new(0.0, 5.0, -0.5)) - 3.0).abs() < 1e-5);

    let forward = Pose { position: Vec3::new(0.0, 0.7, 5.0), ..Pose::default() };
    exterior.set_pose(0, forward).unwrap();
    let overlaps = exterior.overlaps(low, high);
    // The floor's part, 2 m x 1 m; the block's underside, 1.5 m x 0.5 m, and 0.3 m of three of its walls.
    let expected = 2.0 + 0.75 + 0.3 * (1.5 + 0.5 + 0.5);
    assert_eq!(overlaps[0].object, 0);
    assert!(overlaps.len() == 1 && (overlaps[0].area - expected).abs() < 1e-3, "{overlaps:?}");
    assert!((exterior.nearest(Vec3::new(0.0, 5.0, 4.5)) - 2.3).abs() < 1e-5);
    assert_eq!(Exterior::new(&[]).unwrap().nearest(Vec3::ZERO), f32::INFINITY);
}

#[test]
fn unusable_poses_are_refused() {
    let block = floor_with_block();
    let mut exterior = Exterior::new(&[block.surface()]).unwrap();
    let nan = Pose { position: Vec3::NAN, ..Pose::default() };
    let flat = Pose { rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.1), ..Pose::default() };
    for (object, pose) in [(1, Pose::default()), (0, nan), (0, flat)] {
        let error = exterior.set_pose(object, pose).unwrap_err();
        assert_eq!(error.to_string().lines().count(), 1);
    }
}
