//! White and black furnaces.

use std::f32::consts::PI;

use glam::Vec3;
use lunette_bake::Options;
use lunette_relight::frame::Method;
use lunette_tests::baked::{baked, irradiance, light, row, scene};

/// A uniform light needs one band, and as a furnace is white whatever the rays, the fewest of them.
fn one_band(bounces: usize) -> Options {
    Options { order: 1, indirect_order: 1, rays: 16, bounces, ..Options::default() }
}

#[test]
fn white_scene_under_uniform_sky_receives_pi_everywhere() {
    let court = scene("courtyard:size=6,columns=1,edge=2,albedo=1");
    let asset = baked(&court, &one_band(1000));
    for (v, e) in irradiance(&asset, &light("uniform"), Method::default()).into_iter().enumerate() {
        let share = e / PI;
        assert!(
            (share - 1.0).abs().max_element() < 0.01,
            "vertex {v} at {}: {share}",
            court.mesh.position[v]
        );
    }
}

#[test]
fn black_scene_has_no_bounced_light_at_all() {
    let asset = baked(&scene("courtyard:size=6,columns=1,edge=2,albedo=0"), &one_band(3));
    for v in 0..asset.n_vertices() {
        assert_eq!(row(&asset, "sky.indirect.sh", v), [0.0; 3], "vertex {v}");
    }
}

#[test]
fn coloured_bounce_takes_the_colour_of_the_walls() {
    // Grey walls bounce grey, whatever the order of the transfer's planes.
    let asset = baked(&scene("courtyard:size=6,columns=1,edge=2,albedo=0.5"), &one_band(2));
    let direct = baked(&scene("courtyard:size=6,columns=1,edge=2,albedo=0.5"), &one_band(0));
    let sum = |asset| irradiance(asset, &light("uniform:1,0.5,0.25"), Method::default()).iter().sum::<Vec3>();
    let bounced = sum(&asset) - sum(&direct);
    assert!((bounced / bounced.x - Vec3::new(1.0, 0.5, 0.25)).abs().max_element() < 1e-3, "{bounced}");
}
