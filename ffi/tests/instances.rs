//! Instances: where they are, which way their normals point, and moving them.

use std::sync::Arc;

use lunette_ffi::{Device, Error, Hits, Mask, Packet, Ray, Scene, SceneBuilder, Transform};

const IDENTITY: Transform = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

/// A quarter turn about y (x to -z, z to x), then a step.
fn quarter_turn_to([x, y, z]: [f32; 3]) -> Transform {
    [[0.0, 0.0, 1.0, x], [0.0, 1.0, 0.0, y], [-1.0, 0.0, 0.0, z]]
}

/// Geometry 1 is a triangle in z = 0 around the origin, with normal (0, 0, 4).
fn triangle(device: &Device) -> Arc<Scene> {
    let mut builder = SceneBuilder::new(device).expect("scene");
    let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    builder.add_triangles(&corners.map(|[x, y, _]| [x, y, -50.0]), &[[0, 1, 2]]).expect("far mesh");
    assert_eq!(builder.add_triangles(&corners, &[[0, 1, 2]]), Ok(1));
    Arc::new(builder.commit().expect("commit"))
}

fn down_z_at(x: f32) -> Ray {
    Ray::new([x, 0.0, 9.0], [0.0, 0.0, -1.0])
}

fn down_x_at(z: f32) -> Ray {
    Ray::new([9.0, 0.0, z], [-1.0, 0.0, 0.0])
}

#[test]
fn instance_hit_names_instance_geometry_and_triangle() {
    let device = Device::new().expect("Embree");
    let inner = triangle(&device);
    let mut builder = SceneBuilder::new(&device).expect("scene");
    let at = |x| [[1.0, 0.0, 0.0, x], IDENTITY[1], IDENTITY[2]];
    let ground = [[-99.0, -9.0, -99.0], [99.0, -9.0, -99.0], [0.0, -9.0, 99.0]];
    assert_eq!(builder.add_instance(&inner, at(-4.0)), Ok(0));
    assert_eq!(builder.add_triangles(&ground, &[[0, 1, 2]]), Ok(1));
    assert_eq!(builder.add_instance(&inner, at(4.0)), Ok(2));
    let scene = builder.commit().expect("commit");

    let ids = |ray| {
        let hit = scene.intersect(&ray)?;
        assert!(is_nine(hit.t), "{}", hit.t);
        Some((hit.instance, hit.geometry, hit.primitive))
    };
    assert_eq!(ids(down_z_at(-4.0)), Some((Some(0), 1, 0)));
    assert_eq!(ids(down_z_at(4.0)), Some((Some(2), 1, 0)));
    assert_eq!(ids(down_z_at(0.0)), None);
    assert_eq!(ids(Ray::new([0.0; 3], [0.0, -1.0, 0.0])), Some((None, 1, 0)));
}

#[test]
fn instance_normal_is_in_world_space_by_every_road() {
    let device = Device::new().expect("Embree");
    let mut builder = SceneBuilder::new(&device).expect("scene");
    builder.add_instance(&triangle(&device), quarter_turn_to([0.0, 0.0, 3.0])).expect("instance");
    let scene = builder.commit().expect("commit");

    let ray = down_x_at(3.0);
    let single = scene.intersect(&ray).expect("hit");
    // z turns to x; whole numbers, so that single precision is exact but for the distance.
    assert!(is_nine(single.t) && single.normal == [4.0, 0.0, 0.0], "{single:?}");

    let (mut packet, mut hits) = (Packet::<8>::default(), Hits::default());
    packet.set(5, &ray);
    scene.intersect_packet(&Mask::from_fn(|lane| lane == 5), &mut packet, &mut hits);
    assert_eq!(hits.get(&packet, 5), Some(single));
}

#[test]
fn scaled_instance_keeps_the_cross_product_of_its_moved_edges() {
    let device = Device::new().expect("Embree");
    let mut builder = SceneBuilder::new(&device).expect("scene");
    // Twice as wide, mirrored in y: area doubles and the normal turns over.
    let transform = [[2.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    builder.add_instance(&triangle(&device), transform).expect("instance");
    let scene = builder.commit().expect("commit");
    assert_eq!(scene.intersect(&down_z_at(0.0)).map(|hit| hit.normal), Some([0.0, 0.0, -8.0]));
}

#[test]
fn moved_instance_is_hit_where_it_went() {
    let device = Device::new().expect("Embree");
    let mut builder = SceneBuilder::new(&device).expect("scene");
    let number = builder.add_instance(&triangle(&device), IDENTITY).expect("instance");
    let mut scene = builder.commit().expect("commit");
    assert!(scene.occluded(&down_z_at(0.0)) && !scene.occluded(&down_x_at(6.0)));

    for step in 1..20 {
        let z = 6.0 * step as f32;
        scene.set_instance_transform(number, quarter_turn_to([0.0, 0.0, z])).expect("move");
        assert!(!scene.occluded(&down_z_at(0.5)) && !scene.occluded(&down_x_at(z - 6.0)));
        let hit = scene.intersect(&down_x_at(z)).expect("hit");
        assert!(is_nine(hit.t), "{}", hit.t);
        assert_eq!((hit.normal, hit.instance), ([4.0, 0.0, 0.0], Some(number)));
    }
}

#[test]
fn instance_outlives_the_handle_to_its_scene() {
    let device = Device::new().expect("Embree");
    let mut inner = triangle(&device);
    let mut builder = SceneBuilder::new(&device).expect("scene");
    builder.add_instance(&inner, IDENTITY).expect("instance");
    let scene = builder.commit().expect("commit");
    drop(device);
    assert!(Arc::get_mut(&mut inner).is_none(), "an instanced scene must not be changed");
    drop(inner);
    assert!(scene.occluded(&down_z_at(0.0)));
}

#[test]
fn instance_with_bad_input_is_an_error() {
    let device = Device::new().expect("Embree");
    let inner = triangle(&device);
    let mut builder = SceneBuilder::new(&device).expect("scene");
    let flat = [IDENTITY[0], IDENTITY[0], IDENTITY[2]];
    let nan = [[f32::NAN, 0.0, 0.0, 0.0], IDENTITY[1], IDENTITY[2]];
    let far = [[1.0, 0.0, 0.0, f32::INFINITY], IDENTITY[1], IDENTITY[2]];
    for transform in [flat, nan, far] {
        assert_eq!(builder.add_instance(&inner, transform), Err(Error::BadTransform));
    }
    let foreign = triangle(&Device::new().expect("Embree"));
    assert_eq!(builder.add_instance(&foreign, IDENTITY), Err(Error::ForeignScene));

    assert_eq!(builder.add_triangles(&[[0.0; 3]], &[[0; 3]]), Ok(0));
    assert_eq!(builder.add_instance(&inner, IDENTITY), Ok(1));
    let mut scene = builder.commit().expect("commit");
    assert_eq!(scene.set_instance_transform(0, IDENTITY), Err(Error::NotAnInstance { geometry: 0 }));
    assert_eq!(scene.set_instance_transform(2, IDENTITY), Err(Error::NotAnInstance { geometry: 2 }));
    assert_eq!(scene.set_instance_transform(1, nan), Err(Error::BadTransform));

    let mut outer = SceneBuilder::new(&device).expect("scene");
    assert_eq!(outer.add_instance(&Arc::new(scene), IDENTITY), Err(Error::NestedInstance));
}

/// Embree divides by a reciprocal that the processor approximates, makers each in their way, and refines it: the last
/// bits differ.
fn is_nine(t: f32) -> bool {
    (t - 9.0).abs() < 9.0 * 4.0 * f32::EPSILON
}
