//! No light where none can come, no black where light is.

use glam::{Vec3, vec3};
use lunette_bake::Options;
use lunette_relight::frame::Method;
use lunette_scenes::Scene;
use lunette_tests::baked::{baked, direct_only, irradiance, light, scene};
use lunette_tests::sheets::{Facing, Sheets};

fn uniform(scene: &Scene, options: &Options) -> Vec<f32> {
    irradiance(&baked(scene, options), &light("uniform"), Method::default()).iter().map(|e| e.x).collect()
}

fn with_bounces() -> Options {
    Options { order: 3, indirect_order: 3, bounces: 2, ..Options::default() }
}

#[test]
fn closed_box_of_thin_sheets_is_black_to_its_corners() {
    for size in [0.01, 1.0, 1000.0] {
        // Off the origin, so that coordinates round.
        let low = vec3(3.3, -1.7, 12.9) * size;
        let mut sheets = Sheets::default();
        sheets.add_box(low, low + vec3(2.0, 1.0, 3.0) * size, Facing::Inwards, 6);
        let scene = sheets.scene();
        for (v, e) in uniform(&scene, &with_bounces()).into_iter().enumerate() {
            assert_eq!(e, 0.0, "light at {}", scene.mesh.position[v]);
        }
    }
}

#[test]
fn room_within_thick_walls_is_black_and_its_outside_is_not() {
    let mut sheets = Sheets::default();
    sheets.add_box(Vec3::splat(-1.0), Vec3::splat(1.0), Facing::Inwards, 5);
    let n_inside = sheets.n_vertices();
    sheets.add_box(Vec3::splat(-1.1), Vec3::splat(1.1), Facing::Outwards, 5);
    let light = uniform(&sheets.scene(), &with_bounces());
    assert!(light[..n_inside].iter().all(|&e| e == 0.0), "light inside");
    // A convex block hides none of its own sky.
    assert!(
        light[n_inside..].iter().all(|&e| (e / std::f32::consts::PI - 1.0).abs() < 1e-3),
        "shadow outside"
    );
}

#[test]
fn floor_under_a_pillar_takes_the_light_around_it() {
    let mut sheets = Sheets::default();
    sheets.add(vec3(-2.0, 0.0, -2.0), vec3(0.0, 0.0, 4.0), vec3(4.0, 0.0, 0.0), 40);
    let n_floor = sheets.n_vertices();
    sheets.add_box(vec3(-0.52, -0.5, -0.52), vec3(0.52, 3.0, 0.52), Facing::Outwards, 12);
    let scene = sheets.scene();
    let light = uniform(&scene, &direct_only());

    let reach = |p: Vec3| p.x.abs().max(p.z.abs());
    let around = |low: f32, high: f32| {
        let within = (0..n_floor).filter(|&v| (low..high).contains(&reach(scene.mesh.position[v])));
        within.map(|v| light[v]).collect::<Vec<f32>>()
    };
    let rim = around(0.52, 0.65);
    let (least, most) = rim.iter().fold((f32::MAX, 0f32), |(lo, hi), &e| (lo.min(e), hi.max(e)));
    let under = around(0.0, 0.52);
    assert!(under.len() > 100 && rim.len() > 40);
    for e in under {
        // A mean of what is around cannot leave its range; f16 rounds by 5e-4.
        assert!((0.999 * least..1.001 * most).contains(&e), "{e} under the pillar, {least} to {most} around");
    }
}

#[test]
fn contact_of_sphere_and_plane_darkens_without_specks() {
    let scene = scene("sphere-on-plane:edge=0.3");
    let light = uniform(&scene, &Options { rays: 1024, ..direct_only() });
    let floor = (0..light.len()).filter(|&v| {
        let (p, n) = (scene.mesh.position[v], scene.mesh.normal[v]);
        p.y.abs() < 1e-4 && n.y > 0.999 && p.x.hypot(p.z) > 0.05
    });
    let mut checked = 0;
    for v in floor {
        let r = scene.mesh.position[v].x.hypot(scene.mesh.position[v].z);
        // A sphere of radius 1 at height 1 over the floor covers (1 / distance²) cos(zenith) of the cosine-weighted
        // hemisphere where it is above the horizon, as it is from every point of the floor.
        let distance2 = 1.0 + r * r;
        let expected = std::f32::consts::PI * (1.0 - distance2.powf(-1.5));
        // The tessellated ball is inside of the sphere by up to edge² / 8 = 0.011 of its radius, and covers less by
        // twice that; rays add 0.003.
        let error = light[v] / std::f32::consts::PI - expected / std::f32::consts::PI;
        assert!((-0.004..0.03).contains(&error), "{} instead of {expected} at distance {r}", light[v]);
        checked += 1;
    }
    assert!(checked > 100);
}
