//! Taking, splitting, merging, writing and reading portals.

use glam::{Vec3, vec3};

use super::*;
use crate::{Error, LoadOptions, Scene, load};

fn built(name: &str) -> Scene {
    load(name, &LoadOptions::default()).unwrap()
}

fn globs(list: &[&str]) -> Vec<String> {
    list.iter().map(|g| g.to_string()).collect()
}

/// A rectangle from `low` along `u` and `v`, in n x m squares of two triangles, facing u x v.
fn sheet(low: Vec3, u: Vec3, v: Vec3, n: usize, m: usize) -> Vec<[Vec3; 3]> {
    let at = |i: usize, j: usize| low + u * (i as f32 / n as f32) + v * (j as f32 / m as f32);
    let square =
        |i, j| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]];
    (0..n).flat_map(|i| (0..m).flat_map(move |j| square(i, j))).collect()
}

fn pane(name: &str, triangles: Vec<[Vec3; 3]>) -> Portal {
    Portal::new(name, triangles, Vec3::ONE).unwrap()
}

fn message<T>(result: Result<T, Error>) -> String {
    let Err(error) = result else { panic!("no error") };
    let text = error.to_string();
    assert_eq!(text.lines().count(), 1, "{text}");
    text
}

#[test]
fn taken_window_has_its_area_and_faces_the_room() {
    let mut scene = built("box-room");
    let n = scene.mesh.index.len();
    let portals = take_portals(&mut scene, &globs(&["glass*"])).unwrap();
    let [window] = &portals[..] else { panic!("{} portals", portals.len()) };
    // 1.6 m x 1.2 m in the plane x = -2.125: exact but for the sum of some 200 f32 triangles.
    assert!((window.area() - 1.92).abs() < 1e-5, "{}", window.area());
    assert!(window.centre().distance(vec3(-2.125, 1.6, 0.0)) < 1e-5, "{}", window.centre());
    assert!(window.normal.distance(Vec3::X) < 1e-6 && window.transmission == Vec3::splat(0.9));
    assert!((window.extent() - 2.0).abs() < 1e-5);
    assert_eq!(scene.mesh.index.len() + window.triangles.len(), n);
}

#[test]
fn rest_of_the_mesh_keeps_its_order_and_loses_unused_vertices() {
    let whole = built("chapel:bays=1");
    let mut scene = whole.clone();
    take_portals(&mut scene, &globs(&["windows", "glass_r?se"])).unwrap();
    let kept = |i: &usize| {
        let material = &whole.materials[whole.mesh.material[*i] as usize].name;
        material != "glass" && material != "glass_rose"
    };
    let of = |s: &Scene, i: usize| s.mesh.index[i].map(|v| s.mesh.position[v as usize]);
    let left: Vec<_> = (0..whole.mesh.index.len()).filter(kept).map(|i| of(&whole, i)).collect();
    let got: Vec<_> = (0..scene.mesh.index.len()).map(|i| of(&scene, i)).collect();
    assert_eq!(left, got);
    let mut used = vec![false; scene.mesh.position.len()];
    scene.mesh.index.iter().flatten().for_each(|&v| used[v as usize] = true);
    assert!(used.iter().all(|&u| u) && scene.mesh.normal.len() == used.len());
    assert_eq!(scene.mesh.material.len(), scene.mesh.index.len());
}

#[test]
fn materials_become_portals_whatever_matched() {
    let mut scene = built("chapel:bays=1");
    let portals = take_portals(&mut scene, &globs(&["windows", "rose", "glass_east"])).unwrap();
    let names: Vec<&str> = portals.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["glass", "glass_rose", "glass_east"]);
}

#[test]
fn name_that_matches_nothing_lists_what_there_is_and_changes_nothing() {
    let mut scene = built("box-room");
    let n = scene.mesh.position.len();
    let text = message(take_portals(&mut scene, &globs(&["glass", "Glass*"])));
    assert!(
        text.contains("'Glass*'") && text.contains("materials glass, ") && text.contains("window"),
        "{text}"
    );
    message(take_portals(&mut scene, &globs(&["a[", "glass"])));
    message(take_portals(&mut scene, &globs(&["*"])));
    assert_eq!(scene.mesh.position.len(), n);
}

#[test]
fn glass_of_given_portals_goes_and_other_glass_stays() {
    let whole = built("chapel:bays=1,edge=1");
    let mut without = whole.clone();
    let panes = take_portals(&mut without, &globs(&["glass*"])).unwrap();
    let mut scene = whole.clone();
    // As a file has them: few polygons, whose triangles are others.
    let few = |p: &Portal| Portal::from_polygons(&p.name, &p.polygons(), p.transmission).unwrap();
    let given: Vec<Portal> = panes.iter().map(few).collect();
    unglaze(&mut scene, &given).unwrap();
    assert!(scene.mesh.index == without.mesh.index && scene.mesh.position == without.mesh.position);

    let mut scene = whole.clone();
    unglaze(&mut scene, &given[1..2]).unwrap();
    let n = |s: &Scene, name: &str| {
        let is = |m: &&u32| s.materials[**m as usize].name == name;
        s.mesh.material.iter().filter(is).count()
    };
    assert_eq!((n(&scene, "glass_rose"), n(&scene, "glass")), (0, n(&whole, "glass")));
    assert!(scene.report.iter().any(|line| line.contains("in no portal")), "{:?}", scene.report);

    let mut scene = built("plane:n=1");
    scene.materials.iter_mut().for_each(|m| m.transmission = Vec3::ONE);
    let all = scene.mesh.index.iter().map(|t| t.map(|v| scene.mesh.position[v as usize])).collect();
    let before = scene.mesh.index.clone();
    assert!(message(unglaze(&mut scene, &[pane("all", all)])).contains("none is left"));
    assert_eq!(scene.mesh.index, before);
}

#[test]
fn opaque_material_named_as_a_portal_is_clear_and_said_so() {
    let mut scene = built("box-room");
    let portals = take_portals(&mut scene, &globs(&["east"])).unwrap();
    assert_eq!(portals[0].transmission, Vec3::ONE);
    assert!(scene.report.iter().any(|line| line.contains("opaque")), "{:?}", scene.report);
}

#[test]
fn portal_without_area_is_none() {
    let line = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X];
    let wrong = [Vec3::ZERO, Vec3::X, vec3(f32::NAN, 1.0, 0.0)];
    assert!(Portal::new("a", vec![line, wrong], Vec3::ONE).is_none());
    assert_eq!(pane("a", vec![line, [Vec3::ZERO, Vec3::X, Vec3::Y]]).triangles.len(), 1);
}

#[test]
fn windows_that_face_each_other_have_a_normal_all_the_same() {
    let mut both = sheet(Vec3::ZERO, Vec3::X, Vec3::Y, 2, 2);
    both.extend(sheet(5.0 * Vec3::Z, Vec3::Y, Vec3::X, 2, 2));
    let portal = pane("a", both);
    assert_eq!(portal.normal.z.abs(), 1.0);
    let mut flipped = portal.clone();
    flipped.flip();
    assert_eq!(flipped.normal, -portal.normal);
    assert!((pane("a", flipped.triangles).area() - 2.0).abs() < 1e-6);
}

#[test]
fn polygons_of_sheets_are_their_outlines() {
    let mut triangles = sheet(Vec3::ZERO, 2.0 * Vec3::X, Vec3::Y, 7, 3);
    triangles.extend(sheet(vec3(0.0, 0.0, 1.0), Vec3::X, vec3(0.0, 1.0, 1.0), 3, 5));
    let polygons = pane("a", triangles).polygons();
    assert_eq!(polygons.iter().map(Vec::len).collect::<Vec<_>>(), [4, 4]);
    assert!(polygons[0].contains(&vec3(2.0, 1.0, 0.0)));
}

#[test]
fn polygon_with_a_hole_is_convex_ones_around_it() {
    let mut triangles = sheet(Vec3::ZERO, 3.0 * Vec3::X, 3.0 * Vec3::Y, 3, 3);
    triangles.drain(8..10);
    let polygons = pane("a", triangles).polygons();
    assert!(polygons.len() <= 8, "{}", polygons.len());
    assert!(polygons.iter().all(|p| crate::polygon::is_convex(p)));
    let area: f64 =
        polygons.iter().flat_map(|p| (2..p.len()).map(|i| super::area(&[p[0], p[i - 1], p[i]]))).sum();
    assert!((area - 8.0).abs() < 1e-6, "{area}");
}

#[test]
fn arch_and_the_rest_of_a_window_are_one_polygon() {
    // The sheet has corners on the edge that they share, the arch has none.
    let mut triangles = sheet(Vec3::ZERO, 2.0 * Vec3::X, Vec3::Y, 4, 2);
    let rim = |i: usize| {
        let (sine, cosine) = (std::f32::consts::PI * i as f32 / 8.0).sin_cos();
        if i.is_multiple_of(8) {
            vec3(if i == 0 { 2.0 } else { 0.0 }, 1.0, 0.0)
        } else {
            vec3(1.0 + cosine, 1.0 + sine, 0.0)
        }
    };
    triangles.extend((1..8).map(|i| [rim(0), rim(i), rim(i + 1)]));
    let polygons = pane("a", triangles.clone()).polygons();
    assert_eq!(polygons.iter().map(Vec::len).collect::<Vec<_>>(), [11]);
    // In another plane it is one of its own; so it is where both together are not convex.
    let bent = |p: Vec3| if p.y > 1.0 { p + (p.y - 1.0) * Vec3::Z } else { p };
    assert_eq!(pane("a", triangles.iter().map(|t| t.map(bent)).collect()).polygons().len(), 2);
    triangles.truncate(16);
    triangles.push([vec3(2.0, 1.0, 0.0), vec3(4.0, 2.0, 0.0), vec3(0.0, 1.0, 0.0)]);
    assert_eq!(pane("a", triangles).polygons().len(), 2);
}

#[test]
fn extent_of_many_points_is_that_of_all_pairs() {
    let triangles = sheet(vec3(0.3, 0.2, 0.1), vec3(3.0, 1.0, 0.0), vec3(-0.4, 1.2, 2.0), 40, 30);
    let all: Vec<Vec3> = triangles.concat();
    let exact =
        all.iter().map(|p| all.iter().map(|q| p.distance(*q)).fold(0.0, f32::max)).fold(0.0, f32::max);
    assert!(all.len() / 6 > 512);
    assert!((pane("a", triangles).extent() - exact).abs() < 1e-5 * exact);
}

#[test]
fn splitting_keeps_the_area_and_brings_every_piece_under_the_limit() {
    let mut triangles = sheet(Vec3::ZERO, vec3(4.0, 0.3, 0.0), Vec3::Y, 5, 2);
    triangles.extend(sheet(vec3(6.0, 0.0, 1.0), 0.5 * Vec3::X, 0.5 * Vec3::Y, 1, 1));
    let whole = pane("glass", triangles);
    // 5 degrees at 3 m: half a metre, the paper's example.
    let theta = 5f32.to_radians();
    let split = split_portals(vec![whole.clone()], theta, 3.0).unwrap();
    let limit = 2.0 * 3.0 * theta;
    assert!(split.portals.iter().all(|p| p.extent() < limit), "limit {limit}");
    let area: f32 = split.portals.iter().map(Portal::area).sum();
    // Cut corners are rounded to f32, some 1e-7 of the size each.
    assert!((area - whole.area()).abs() < 1e-5 * whole.area());
    // At least as many as the area of a square of that diagonal goes into it.
    assert!(split.portals.len() as f32 >= whole.area() / (0.5 * limit * limit));
    assert!(split.portals.iter().all(|p| p.normal.dot(whole.normal) > 0.99));
    let names: std::collections::HashSet<&str> = split.portals.iter().map(|p| p.name.as_str()).collect();
    assert!(names.len() == split.portals.len() && names.contains("glass 1"));
}

#[test]
fn splitting_parts_windows_before_it_cuts_them() {
    let triangles =
        [0.0, 0.6, 5.0].map(|x| sheet(vec3(x, 0.0, 0.0), 0.3 * Vec3::X, 0.3 * Vec3::Y, 3, 3)).concat();
    let split = split_portals(vec![pane("glass", triangles)], 0.1, 6.0).unwrap();
    let extents: Vec<f32> = split.portals.iter().map(Portal::extent).collect();
    // Two windows 0.9 m across are one piece under the limit of 1.2 m.
    assert!(extents.len() == 2 && (extents[0] - 0.9f32.hypot(0.3)).abs() < 1e-5, "{extents:?}");
    let near = split_portals(split.portals.clone(), 0.1, 100.0).unwrap();
    assert_eq!(near.portals, split.portals, "what holds is left alone");
    assert!(near.report.is_empty());
}

#[test]
fn light_thrown_back_is_the_papers_car() {
    // 2 m² seen from 2.8 m take 2 % of the sphere.
    let portal = pane("screen", sheet(Vec3::ZERO, 2.0 * Vec3::X, Vec3::Y, 1, 1));
    assert!((thrown_back(std::slice::from_ref(&portal), 2.8) - 0.0203).abs() < 1e-4);
    // A window of the same portal in the wall across is not seen from there.
    let mut both = portal.triangles.clone();
    both.extend(sheet(5.0 * Vec3::Z, 2.0 * Vec3::Y, Vec3::X, 1, 1));
    assert!((thrown_back(&[pane("screen", both)], 2.8) - 0.0203).abs() < 1e-4);
    let split = split_portals(vec![portal], 1.0, 2.0).unwrap();
    assert!(split.report.iter().any(|line| line.contains("thrown back")), "{:?}", split.report);
}

#[test]
fn splitting_refuses_what_it_cannot_do_in_one_line() {
    let portal = || vec![pane("glass", sheet(Vec3::ZERO, 20.0 * Vec3::X, 3.0 * Vec3::Y, 1, 1))];
    assert!(message(split_portals(portal(), 0.01, 1.0)).contains("256 portals"));
    for (theta, r) in [(0.0, 1.0), (0.1, -1.0), (f32::NAN, 1.0), (0.1, f32::INFINITY)] {
        message(split_portals(portal(), theta, r));
    }
}

#[test]
fn sidecar_comes_back_as_it_was_written() {
    let mut scene = built("chapel:bays=1,edge=1");
    let portals = take_portals(&mut scene, &globs(&["glass*"])).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("chapel.portals.json");
    write_portals(&path, &portals).unwrap();
    let again = read_portals(&path).unwrap();
    assert_eq!(again.len(), portals.len());
    for (a, b) in again.iter().zip(&portals) {
        assert_eq!((&a.name, a.transmission), (&b.name, b.transmission));
        // Polygons are cut again, at other places; corners left out of straight edges are straight to 1e-4.
        assert!((a.area() - b.area()).abs() < 1e-4 * b.area(), "{} {}", a.area(), b.area());
        assert!(a.centre().distance(b.centre()) < 1e-3 && a.normal.distance(b.normal) < 1e-3);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
}

#[test]
fn sidecar_errors_name_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.portals.json");
    let square = "[[0,0,0],[1,0,0],[1,1,0],[0,1,0]]";
    let document = |portals: &str| {
        format!("{{\"format\": \"lunette-portals\", \"version\": 1,\n\"portals\": [{portals}]}}")
    };
    let cases = [
        ("".to_string(), "empty"),
        ("{".into(), ":1:1: "),
        ("[]".into(), "\"format\""),
        (document("").replace("1,", "7,"), "version 7"),
        (document("").replace("\"version\": 1", "\"version\": \"1\""), "\"version\""),
        (document(""), "no portal"),
        (document("{\"name\": \"a\"}"), ":2:"),
        (document(&format!("{{\"name\":\"a\",\"polygon\":[{square}]}}")), "unknown field `polygon`"),
        (document(&format!("{{\"name\":\" \",\"polygons\":[{square}]}}")), "portal 1 has no name"),
        (document(&vec![format!("{{\"name\":\"a\",\"polygons\":[{square}]}}"); 2].join(",")), "two portals"),
        (document("{\"name\":\"a\",\"polygons\":[]}"), "'a' has no polygon"),
        (
            document(&format!("{{\"name\":\"a\",\"polygons\":[{square},[[0,0,0],[1,1,1]]]}}")),
            "polygon 2: 2 corner",
        ),
        (document("{\"name\":\"a\",\"polygons\":[[[0,0,0],[1,1,1],[2,2,2]]]}"), "polygon 1: it has no area"),
        (document("{\"name\":\"a\",\"polygons\":[[[0,0,0],[1,0,1],[1,1,0],[0,1,1]]]}"), "not flat"),
        (
            document("{\"name\":\"a\",\"polygons\":[[[0,0,0],[1,0,1e30],[1,1,0]]]}"),
            "polygon 1: corner [1, 0, 1",
        ),
        (
            document(&format!("{{\"name\":\"a\",\"transmission\":[1,1,1.5],\"polygons\":[{square}]}}")),
            "transmission",
        ),
    ];
    for (text, expected) in cases {
        std::fs::write(&path, &text).unwrap();
        let told = message(read_portals(&path));
        assert!(told.contains(expected) && told.contains("a.portals.json"), "{text}: {told}");
    }
    assert!(message(read_portals(&folder.path().join("none"))).contains("none"));
}

#[test]
fn sidecar_example_of_the_documentation_reads() {
    let source = include_str!("sidecar.rs");
    let example: String = source
        .lines()
        .skip_while(|line| *line != "//! ```json")
        .skip(1)
        .take_while(|line| *line != "//! ```")
        .map(|line| line.trim_start_matches("//!"))
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.portals.json");
    std::fs::write(&path, example).unwrap();
    let portals = read_portals(&path).unwrap();
    assert!((portals[0].area() - 1.4).abs() < 1e-6 && portals[0].normal == Vec3::X);
}

#[test]
fn sidecar_lies_beside_the_scene() {
    for (scene, path) in [
        ("a/room.obj", "a/room.portals.json"),
        ("chapel:bays=3,edge=0.5", "chapel.portals.json"),
        ("car", "car.portals.json"),
    ] {
        assert_eq!(sidecar_path(scene), std::path::Path::new(path));
    }
}

fn square(corner: Vec3, u: Vec3, v: Vec3) -> Vec<Vec3> {
    vec![corner, corner + u, corner + u + v, corner + v]
}

#[test]
fn panes_in_the_place_of_others_are_left_out() {
    let pane = square(Vec3::new(1.0, 2.0, 3.0), 2.0 * Vec3::X, 1.5 * Vec3::new(0.0, 0.6, 0.8));
    // From the other side, cut along the other diagonal.
    let back: Vec<Vec3> = [3, 2, 1, 0].map(|i| pane[i]).to_vec();
    let beside = square(pane[1], Vec3::X, pane[3] - pane[0]);
    let behind: Vec<Vec3> = pane.iter().map(|p| *p + Vec3::new(0.0, 0.008, -0.006)).collect();
    let portal = |polygons: &[Vec<Vec3>]| Portal::from_polygons("glass", polygons, Vec3::ONE).unwrap();
    let single = portal(&[pane.clone(), beside.clone(), behind.clone()]);
    let (kept, n) = without_doubled(std::slice::from_ref(&single)).unwrap();
    assert_eq!((&kept[..], n), (&[single.clone()][..], 0), "neighbours and double glazing stay");
    let doubled = portal(&[pane.clone(), beside.clone(), behind.clone(), back.clone(), beside.clone()]);
    assert_eq!(without_doubled(&[doubled]).unwrap(), (vec![single], 4));

    let named = |name: &str, polygon: &Vec<Vec3>| {
        Portal::from_polygons(name, std::slice::from_ref(polygon), Vec3::ONE).unwrap()
    };
    let error = without_doubled(&[named("west", &pane), named("east", &back)]).unwrap_err().to_string();
    assert!(error.contains("'east'") && error.contains("leave it out"), "{error}");
    let shifted: Vec<Vec3> = pane.iter().map(|p| *p + 0.5 * Vec3::X).collect();
    let error = without_doubled(&[named("west", &pane), named("east", &shifted)]).unwrap_err().to_string();
    assert!(error.contains("'east'") && error.contains("'west'") && error.contains("m²"), "{error}");
    let hair: Vec<Vec3> = pane.iter().map(|p| *p + 2.002 * Vec3::X - 0.004 * Vec3::X).collect();
    assert_eq!(without_doubled(&[named("west", &pane), named("east", &hair)]).unwrap().1, 0, "2 mm of 2 m");
}
