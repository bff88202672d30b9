//! Reveals of built-in rooms, whose walls are known, and of walls made here.

use glam::vec3;
use lunette_scenes::{LoadOptions, Mesh, Portal, Scene, load, take_portals};

use super::*;

/// Of each polygon and edge the steps.
fn steps(scene: &Scene, polygons: &[Vec<Vec3>]) -> Vec<Vec<Vec<Reveal>>> {
    let of_edges = |reveals: Vec<Reveal>| reveals.chunks(STEPS).map(<[Reveal]>::to_vec).collect();
    reveals(&Surface::new(scene).unwrap(), polygons, 7).into_iter().map(of_edges).collect()
}

/// Of each polygon and edge the only step.
fn found(scene: &Scene, polygons: &[Vec<Vec3>]) -> Vec<Vec<Reveal>> {
    let only = |steps: Vec<Reveal>| {
        assert!(steps[1..].iter().all(|step| *step == [0.0; 4]), "{steps:?}");
        steps[0]
    };
    steps(scene, polygons).into_iter().map(|edges| edges.into_iter().map(only).collect()).collect()
}

fn built(name: &str) -> (Scene, Vec<Portal>) {
    let mut scene = load(name, &LoadOptions::default()).unwrap();
    let portals = take_portals(&mut scene, &["glass*".to_string()]).unwrap();
    (scene, portals)
}

fn assert_near(found: Reveal, expected: Reveal) {
    // Of panes a metre or two wide, by angles found to 1e-6.
    let far = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(far < 1e-3, "{found:?} instead of {expected:?}");
}

#[test]
fn glass_in_the_middle_of_a_thick_wall_has_half_of_it_on_each_side() {
    let (scene, portals) = built("box-room:edge=0.4");
    let polygons = portals[0].convex_polygons();
    for reveal in found(&scene, &polygons).concat() {
        assert_near(reveal, [0.125, 0.0, 0.125, 0.0]);
    }
}

#[test]
fn straight_edges_of_a_chapel_have_its_walls() {
    let (scene, portals) = built("chapel:bays=1,edge=0.8");
    let all: Vec<Vec<Reveal>> =
        portals.iter().flat_map(|p| steps(&scene, &p.convex_polygons()).concat()).collect();
    let has = |edge: &&Vec<Reveal>| edge.iter().any(|step| (0.05..0.7).contains(&step[0]));
    let deep = all.iter().filter(has).count();
    println!("{deep} of {} edges lie in a deep wall", all.len());
    assert!(2 * deep > all.len(), "{deep} of {}: {all:?}", all.len());
}

/// Boxes, closed, about a pane of 1 m x 1 m at z = 0 whose inside is at +z.
fn boxes(list: &[(Vec3, Vec3)]) -> Scene {
    let mut mesh = Mesh::default();
    for (low, high) in list {
        let first = mesh.position.len() as u32;
        let corner = |i: u32| {
            let pick = |bit: u32| if i >> bit & 1 == 1 { high[bit as usize] } else { low[bit as usize] };
            vec3(pick(0), pick(1), pick(2))
        };
        mesh.position.extend((0..8).map(corner));
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let quads = faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]);
        mesh.index.extend(quads.map(|t: [u32; 3]| t.map(|i| first + i)));
    }
    mesh.normal = vec![Vec3::Y; mesh.position.len()];
    mesh.material = vec![0; mesh.index.len()];
    mesh.group = vec![0; mesh.index.len()];
    Scene { mesh, materials: vec![Default::default()], groups: vec!["wall".into()], ..Scene::default() }
}

fn pane() -> Vec<Vec<Vec3>> {
    vec![vec![vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(1.0, 1.0, 0.0), vec3(0.0, 1.0, 0.0)]]
}

#[test]
fn each_edge_has_its_own_wall() {
    // Below a sill that is 0.4 m deep outside; on the right a wall set back by 0.1 m, from 0.2 m outside to 0.3 m inside; on
    // the left a sheet in the pane's plane; above nothing.
    let scene = boxes(&[
        (vec3(-20.0, -20.0, -0.4), vec3(20.0, 0.0, 0.0)),
        (vec3(1.1, -20.0, -0.2), vec3(20.0, 20.0, 0.3)),
        (vec3(-1.0, 0.0, -1e-4), vec3(0.0, 2.0, 1e-4)),
    ]);
    let [bottom, right, top, left] = found(&scene, &pane()).concat()[..] else { panic!("four edges") };
    assert_near(bottom, [0.4, 0.0, 0.0, 0.0]);
    assert_near(right, [0.2, 0.1, 0.3, 0.1]);
    assert_near(top, [0.0; 4]);
    assert_near(left, [0.0; 4]);
}

#[test]
fn wall_in_steps_has_those_that_hide() {
    // On the right a frame of 0.05 m, a step back of 0.1 m that hides nothing past the other two, and a wall set back by 0.15 m
    // that ends 0.6 m inside.
    let scene = boxes(&[
        (vec3(1.0, -20.0, -0.05), vec3(20.0, 20.0, 0.05)),
        (vec3(1.1, -20.0, 0.0), vec3(20.0, 20.0, 0.1)),
        (vec3(1.15, -20.0, 0.0), vec3(20.0, 20.0, 0.6)),
    ]);
    let [right, ..] = &steps(&scene, &pane())[0][1..] else { panic!("four edges") };
    // From 0.014 m on from the edge, the wall hides more than the frame does.
    assert_near(right[0], [0.05, 0.0, 0.6, 0.15]);
    assert_near(right[1], [0.0, 0.0, 0.05, 0.0]);
}

#[test]
fn what_stands_farther_off_counts_as_far_as_it_is_long() {
    // A window in a wall 0.7 m thick, and below it a roof, past whose ends one looks slantwise unless it is long.
    for (half, outer) in [(60.0, [2.0, 0.4]), (2.0, [0.35, 0.0])] {
        let scene = boxes(&[
            (vec3(-20.0, -20.0, -0.35), vec3(20.0, 0.0, 0.35)),
            (vec3(-20.0, 1.0, -0.35), vec3(20.0, 20.0, 0.35)),
            (vec3(-20.0, 0.0, -0.35), vec3(0.0, 1.0, 0.35)),
            (vec3(1.0, 0.0, -0.35), vec3(20.0, 1.0, 0.35)),
            (vec3(-half, -20.0, -2.0), vec3(half, -0.4, -0.35)),
        ]);
        let edges = &steps(&scene, &pane())[0];
        for (i, edge) in edges.iter().enumerate() {
            let expected = if i == 0 { outer } else { [0.35, 0.0] };
            assert_near(edge[0], [expected[0], expected[1], 0.35, 0.0]);
        }
    }
}

#[test]
fn what_is_no_even_wall_is_none() {
    // A wall with a gap, one whose end slants, and a thin pole, past which rays go.
    let mut slanted = boxes(&[
        (vec3(1.0, -1.0, -0.4), vec3(2.0, 0.45, 0.0)),
        (vec3(1.0, 0.55, -0.4), vec3(2.0, 2.0, 0.0)),
        (vec3(-1.0, -1.0, -0.4), vec3(0.0, 2.0, 0.0)),
        (vec3(-1.0, 1.05, -0.12), vec3(2.0, 1.1, -0.1)),
    ]);
    // The left wall's outer face.
    for p in &mut slanted.mesh.position[16..24] {
        if p.z < 0.0 {
            p.z -= 0.2 * p.y;
        }
    }
    for reveal in found(&slanted, &pane()).concat() {
        assert_near(reveal, [0.0; 4]);
    }
}
