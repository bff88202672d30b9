//! What subdivision keeps.

use std::collections::HashMap;

use glam::Vec3;
use lunette_scenes::{LoadOptions, Scene, cut_edges, subdivide};

use crate::{area, assert_valid, load_files};

/// A cube of side 1 with one face of another material, and a long thin triangle that stands apart.
fn cube() -> Scene {
    let text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nv 5 0 0\nv 9 0 0\nv 9 0 -0.1\n\
                g box\nusemtl a\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nusemtl b\nf 4 1 5 8\n\
                g sliver\nf 9 10 11\n";
    load_files(&[("a.obj", text.as_bytes())], &LoadOptions::default()).unwrap()
}

fn longest_edge(scene: &Scene) -> f32 {
    let p = |v: u32| scene.mesh.position[v as usize];
    let edge = |t: &[u32; 3]| (0..3).map(|k| p(t[k]).distance(p(t[(k + 1) % 3]))).fold(0.0, f32::max);
    scene.mesh.index.iter().map(edge).fold(0.0, f32::max)
}

#[test]
fn all_edges_end_up_short_and_nothing_else_changes() {
    let before = cube();
    let mut after = before.clone();
    subdivide(&mut after, 0.15).unwrap();
    assert_valid(&after);
    assert!(longest_edge(&after) <= 0.15);
    // Some thousand f32 areas of 0.01 summed: relative rounding of about 1e-5.
    assert!((area(&after) / area(&before) - 1.0).abs() < 1e-4);
    let n = before.mesh.position.len();
    assert_eq!(after.mesh.position[..n], before.mesh.position);
    assert_eq!(after.mesh.normal[..n], before.mesh.normal);
    assert_eq!((after.materials, after.groups), (before.materials, before.groups));
}

#[test]
fn materials_and_groups_keep_their_areas() {
    let (before, mut after) = (cube(), cube());
    subdivide(&mut after, 0.3).unwrap();
    let area_of = |scene: &Scene, material, group| {
        let mut part = scene.clone();
        let mut is_in =
            scene.mesh.material.iter().zip(&scene.mesh.group).map(|pair| pair == (&material, &group));
        part.mesh.index.retain(|_| is_in.next().unwrap());
        area(&part)
    };
    for (material, group) in [(0, 0), (1, 0), (1, 1)] {
        let (a, b) = (area_of(&after, material, group), area_of(&before, material, group));
        // A few hundred f32 areas summed.
        assert!(b > 0.0 && (a / b - 1.0).abs() < 1e-5, "{a} {b}");
    }
}

#[test]
fn surface_stays_closed_across_creases_and_materials() {
    for limit in [0.9, 0.45, 0.2, 0.07] {
        let mut scene = cube();
        subdivide(&mut scene, limit).unwrap();
        assert!(is_closed(&scene), "a crack at limit {limit}");
    }
}

/// Whether every edge of the box, by the places of its ends, is there once in each direction.
fn is_closed(scene: &Scene) -> bool {
    let mut edges: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
    let place = |v: u32| (scene.mesh.position[v as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    for (t, _) in scene.mesh.index.iter().zip(&scene.mesh.group).filter(|(_, group)| **group == 0) {
        for k in 0..3 {
            let (a, b) = (place(t[k]), place(t[(k + 1) % 3]));
            *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    edges.values().all(|&balance| balance == 0)
}

#[test]
fn chosen_edges_are_cut_on_both_sides_of_a_crease() {
    let before = cube();
    let at = |v: u32| before.mesh.position[v as usize];
    // One edge of the box, of which only the vertices of its upper face are asked for.
    let is_upper = |v: u32| before.mesh.normal[v as usize] == Vec3::Y && at(v).z == 1.0;
    let mut after = before.clone();
    let n_more = cut_edges(&mut after, |_, a, b| is_upper(a) && is_upper(b)).unwrap();
    assert_eq!(n_more, 2, "a triangle of each of two faces");
    assert_valid(&after);
    assert!(is_closed(&after));
    let middle = Vec3::new(0.5, 1.0, 1.0);
    assert_eq!(after.mesh.position.iter().filter(|p| **p == middle).count(), 2, "of two normals");
    assert!((area(&after) / area(&before) - 1.0).abs() < 1e-5);
    let once = after.clone();
    assert_eq!(cut_edges(&mut after, |_, _, _| false).unwrap(), 0);
    assert_eq!(after.mesh.index, once.mesh.index);
}

#[test]
fn shared_vertices_stay_shared() {
    let mut scene = cube();
    subdivide(&mut scene, 0.9).unwrap();
    // A face of the box: 4 corners; its sides and its diagonal are cut once, and the halves of the diagonal are
    // short: 4 + 4 + 1 = 9 vertices on 8 triangles.
    let face: Vec<_> =
        scene.mesh.position.iter().zip(&scene.mesh.normal).filter(|(_, n)| **n == Vec3::Z).collect();
    assert_eq!(face.len(), 9);
}

#[test]
fn normals_are_interpolated() {
    let text = "v 0 0 0\nv 2 0 0\nv 0 0 -2\nvn 0.6 0.8 0\nvn -0.6 0.8 0\nf 1//1 2//2 3//1\n";
    let mut scene = load_files(&[("a.obj", text.as_bytes())], &LoadOptions::default()).unwrap();
    subdivide(&mut scene, 1.5).unwrap();
    let middle = scene.mesh.position.iter().position(|&p| p == Vec3::X).expect("the first edge is halved");
    // One normalisation in f32.
    assert!((scene.mesh.normal[middle] - Vec3::Y).length() < 1e-6);
}

#[test]
fn mesh_that_is_fine_enough_stays_as_it_is() {
    let mut scene = cube();
    subdivide(&mut scene, 10.0).unwrap();
    assert_eq!(scene.mesh.index, cube().mesh.index);
}

#[test]
fn absurd_limits_are_refused_at_once() {
    for (limit, expected) in [
        (0.0, "subdivide: the longest edge has to be a positive number of metres, not 0"),
        (-1.0, "subdivide: the longest edge has to be a positive number of metres, not -1"),
        (f32::NAN, "subdivide: the longest edge has to be a positive number of metres, not NaN"),
        (1e-5, "subdivide: edges of at most 0.00001 m take over"),
        (1e-30, "subdivide: edges of at most"),
    ] {
        let mut scene = cube();
        let error = subdivide(&mut scene, limit).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
        assert_eq!(scene.mesh.index, cube().mesh.index, "an error leaves the scene alone");
    }
}

#[test]
fn edges_too_short_for_f32_are_refused() {
    // At 16 million metres f32 counts in steps of 1 and 2.
    let text = "v 16777216 0 0\nv 16777220 0 0\nv 16777216 0 -4\nf 1 2 3\n";
    let mut scene = load_files(&[("a.obj", text.as_bytes())], &LoadOptions::default()).unwrap();
    let error = subdivide(&mut scene, 0.5).unwrap_err().to_string();
    assert!(error.contains("32-bit numbers have no room between"), "{error}");
}
