//! What holds for every built-in scene, and for the solids and shapes that they are made of.

use std::collections::HashMap;

use glam::{Vec3, vec3};
use proptest::prelude::*;

use super::{build, list};
use crate::{Mesh, Scene};

/// What is wrong with a mesh, if anything is.
fn fault(scene: &Scene) -> Option<String> {
    let mesh = &scene.mesh;
    let triangles = mesh.index.len();
    if triangles == 0 || mesh.material.len() != triangles || mesh.group.len() != triangles {
        return Some("counts do not agree".into());
    }
    if mesh.normal.len() != mesh.position.len() || !mesh.position.iter().all(|p| p.is_finite()) {
        return Some("positions".into());
    }
    // Unit to within the rounding of a normalised f32 vector.
    if let Some(n) = mesh.normal.iter().find(|n| (n.length() - 1.0).abs() > 1e-5 || !n.is_finite()) {
        return Some(format!("normal {n}"));
    }
    let in_range = |v: &[u32], n: usize| v.iter().all(|&i| (i as usize) < n);
    if !in_range(&mesh.material, scene.materials.len()) || !in_range(&mesh.group, scene.groups.len()) {
        return Some("material or group out of range".into());
    }
    let terrain = scene.groups == ["terrain"];
    let mut used = vec![false; mesh.position.len()];
    for t in &mesh.index {
        if !in_range(t, mesh.position.len()) {
            return Some(format!("indices {t:?}"));
        }
        t.iter().for_each(|&v| used[v as usize] = true);
        let face = face_normal(mesh, t);
        // A terrain may be as steep and rough as one likes: there both only have to look up.
        let sound = |n: Vec3| if terrain { face.y > 0.0 && n.y > 0.0 } else { face.dot(n) > 0.0 };
        if !t.iter().all(|&v| sound(mesh.normal[v as usize])) {
            return Some(format!("winding against a normal at {}", mesh.position[t[0] as usize]));
        }
    }
    (!used.iter().all(|&u| u)).then(|| "unused vertices".into())
}

fn face_normal(mesh: &Mesh, t: &[u32; 3]) -> Vec3 {
    let [a, b, c] = t.map(|v| mesh.position[v as usize]);
    (b - a).cross(c - a)
}

#[test]
fn builtins_with_defaults_are_sound() {
    for builtin in list() {
        let scene = build(builtin.name).unwrap();
        assert_eq!(fault(&scene), None, "{}", builtin.name);
        assert!(scene.groups.iter().chain(scene.materials.iter().map(|m| &m.name)).all(|n| !n.is_empty()));
    }
}

#[test]
fn rabbit_does_not_fold_at_any_size_of_triangles() {
    for edge in [0.04, 0.05, 0.06, 0.09, 0.12, 0.14, 0.17, 0.19, 0.21, 0.23, 0.25, 0.27, 0.4] {
        let scene = build(&format!("box-room:edge={edge}")).unwrap();
        assert_eq!(fault(&scene), None, "{edge}");
        let rabbit = |i: usize| scene.groups[scene.mesh.group[i] as usize] == "rabbit";
        assert_eq!(open_edges(&scene.mesh, rabbit), 0, "{edge}");
    }
}

#[test]
fn builtins_at_the_ends_of_their_ranges_are_sound_or_say_why_not() {
    let mut built = 0;
    for builtin in list() {
        for parameter in builtin.parameters {
            // The finest and largest take a while and are the same code.
            let coarsest = builtin.parameters.iter().find(|p| p.name == "edge");
            let ends = match parameter.name {
                "n" => vec![parameter.low],
                "edge" => vec![parameter.high],
                _ => vec![parameter.low, parameter.high],
            };
            for value in ends {
                let coarsest = coarsest.map(|p| format!("edge={},", p.high)).unwrap_or_default();
                let spec = format!("{}:{coarsest}{}={value}", builtin.name, parameter.name);
                match build(&spec) {
                    Ok(scene) => {
                        built += 1;
                        assert_eq!(fault(&scene), None, "{spec}");
                    }
                    Err(e) => assert!(!e.to_string().contains('\n'), "{e}"),
                }
            }
        }
    }
    assert!(built > list().len(), "only {built} could be built");
}

#[test]
fn edges_are_no_longer_than_asked_for() {
    // On level and upright faces; a diagonal of a square is sqrt(2) of its edge.
    for spec in ["courtyard:edge=0.5", "box-room:edge=0.4", "chapel:edge=0.7", "horizon-band:edge=0.5"] {
        let scene = build(spec).unwrap();
        let edge: f32 = spec.split('=').nth(1).unwrap().parse().unwrap();
        let longest = scene.mesh.index.iter().flat_map(|t| {
            let [a, b, c] = t.map(|v| scene.mesh.position[v as usize]);
            [a.distance(b), b.distance(c), c.distance(a)]
        });
        let longest = longest.fold(0.0, f32::max);
        assert!(longest < 1.5 * edge, "{spec}: {longest}");
    }
}

#[test]
fn builtins_are_deterministic_and_seeds_matter() {
    for builtin in list() {
        let [a, b] = [(); 2].map(|()| build(builtin.name).unwrap().mesh);
        assert!(a.position == b.position && a.normal == b.normal && a.index == b.index, "{}", builtin.name);
    }
    for name in ["terrain", "town"] {
        let [a, b] = [1, 2].map(|seed| build(&format!("{name}:seed={seed}")).unwrap().mesh.position);
        assert_ne!(a, b, "{name}");
    }
}

#[test]
fn plane_and_terrain_have_the_counts_and_sizes_asked_for() {
    let plane = build("plane:n=5,size=2").unwrap().mesh;
    assert_eq!((plane.position.len(), plane.index.len()), (36, 50));
    assert_eq!(plane.bounds(), (vec3(-1.0, 0.0, -1.0), vec3(1.0, 0.0, 1.0)));
    let terrain = build("terrain:n=65,size=100,height=30").unwrap().mesh;
    assert_eq!((terrain.position.len(), terrain.index.len()), (65 * 65, 2 * 64 * 64));
    let (lo, hi) = terrain.bounds();
    // Heights are stretched in f32.
    assert!(lo.distance(vec3(-50.0, 0.0, -50.0)) < 1e-3 && hi.distance(vec3(50.0, 30.0, 50.0)) < 1e-3);
}

#[test]
fn terrain_looks_the_same_at_every_resolution() {
    // The coarse one's octaves are the fine one's first, and what follows is smaller: half the relief's tenth.
    let [coarse, fine] =
        [65, 257].map(|n| build(&format!("terrain:n={n},height=1,size=1")).unwrap().mesh.position);
    let mean =
        (0..65 * 65).map(|i| (coarse[i].y - fine[(i / 65 * 4) * 257 + i % 65 * 4].y).abs()).sum::<f32>()
            / (65.0 * 65.0);
    assert!(mean < 0.05, "{mean}");
}

#[test]
fn albedo_covers_every_opaque_surface_and_no_glass() {
    let court = build("courtyard:albedo=1").unwrap();
    assert!(court.vertex_albedo().iter().all(|&a| a == Vec3::ONE));
    let room = build("box-room:albedo=1").unwrap();
    for m in &room.materials {
        assert_eq!(m.albedo, if m.name == "glass" { Vec3::ZERO } else { Vec3::ONE }, "{}", m.name);
    }
}

#[test]
fn rooms_have_glass_of_the_size_asked_for() {
    let area = |spec: &str| {
        let scene = build(spec).unwrap();
        let glass = |m: u32| scene.materials[m as usize].name.starts_with("glass");
        let panes = scene.mesh.index.iter().zip(&scene.mesh.material).filter(|(_, m)| glass(**m));
        panes.map(|(t, _)| 0.5 * face_normal(&scene.mesh, t).length()).sum::<f32>()
    };
    // Sums of f32 areas of a few hundred triangles.
    assert!((area("box-room:window-width=2,window-height=1.5") - 3.0).abs() < 1e-3);
    assert!((area("skylight-box:opening=0.5") - 0.25).abs() < 1e-4);
    assert!(area("chapel") > 30.0 && area("car") > 2.0);
}

/// Directed edges between places, not vertices, that have no partner the other way. Places are told apart at 0.1 mm.
fn open_edges(mesh: &Mesh, keep: impl Fn(usize) -> bool) -> usize {
    let place = |v: u32| (mesh.position[v as usize] * 1e4).round().to_array().map(|x| x as i64);
    let mut edges: HashMap<_, i64> = HashMap::new();
    for (_, t) in mesh.index.iter().enumerate().filter(|(i, _)| keep(*i)) {
        for k in 0..3 {
            let (a, b) = (place(t[k]), place(t[(k + 1) % 3]));
            let (key, way) = if a < b { ((a, b), 1) } else { ((b, a), -1) };
            *edges.entry(key).or_default() += way;
        }
    }
    edges.values().filter(|&&n| n != 0).count()
}

#[test]
fn skins_and_round_things_are_closed() {
    // Everything that is not a pane, which has borders.
    for spec in ["courtyard", "courtyard:columns=3,size=9,edge=0.4", "skylight-box", "town", "car"] {
        let scene = build(spec).unwrap();
        let opaque = |i: usize| scene.materials[scene.mesh.material[i] as usize].transmission == Vec3::ZERO;
        assert_eq!(open_edges(&scene.mesh, opaque), 0, "{spec}");
    }
    let scene = build("sphere-on-plane").unwrap();
    assert_eq!(open_edges(&scene.mesh, |i| scene.groups[scene.mesh.group[i] as usize] == "sphere"), 0);
    let scene = build("horizon-band").unwrap();
    assert_eq!(open_edges(&scene.mesh, |i| scene.groups[scene.mesh.group[i] as usize] == "canopy"), 0);
    // The cylinder stands on a hole in the plane: together they have one border, the plane's, of 4 * 80 edges.
    let scene = build("cylinder-on-plane").unwrap();
    assert_eq!(open_edges(&scene.mesh, |_| true), 320);
}

/// How many rays from `eye` leave through no surface, and how many hit the back of one that is no pane. Directions
/// lie on a spiral; only those that point below `steepest` (sine of the elevation) count.
fn leaks(scene: &Scene, eye: Vec3, steepest: f32) -> [usize; 2] {
    const RAYS: usize = 300;
    let mesh = &scene.mesh;
    let golden = 2.399_963_2;
    let mut found = [0; 2];
    for i in 0..RAYS {
        let y = 1.0 - 2.0 * (i as f32 + 0.5) / RAYS as f32;
        let (r, a) = ((1.0 - y * y).sqrt(), golden * i as f32);
        let ray = vec3(r * a.cos(), y, r * a.sin());
        if y > steepest {
            continue;
        }
        let hits = mesh.index.iter().enumerate().filter_map(|(i, t)| Some((distance(mesh, t, eye, ray)?, i)));
        match hits.min_by(|a, b| a.0.total_cmp(&b.0)) {
            None => found[0] += 1,
            Some((_, i)) if face_normal(mesh, &mesh.index[i]).dot(ray) > 0.0 => found[1] += 1,
            Some(_) => {}
        }
    }
    found
}

/// Where a ray meets a triangle (Möller & Trumbore 1997); borders count as inside.
fn distance(mesh: &Mesh, t: &[u32; 3], eye: Vec3, ray: Vec3) -> Option<f32> {
    let [a, b, c] = t.map(|v| mesh.position[v as usize]);
    let (u, v, from) = (b - a, c - a, eye - a);
    let p = ray.cross(v);
    let det = u.dot(p);
    let q = from.cross(u);
    let (x, y, d) = (from.dot(p) / det, ray.dot(q) / det, v.dot(q) / det);
    // Borders a hair wider than they are, so that rounding opens no seam between neighbours.
    (x >= -1e-4 && y >= -1e-4 && x + y <= 1.0002 && d > 1e-4).then_some(d)
}

#[test]
fn rooms_are_closed_seen_from_inside() {
    let eyes = [
        ("box-room:edge=0.5", vec3(-1.0, 1.3, 1.5)),
        ("skylight-box:edge=0.5", vec3(1.0, 2.0, 1.5)),
        ("car:edge=0.2", vec3(0.05, 1.15, 0.5)),
        ("car:edge=0.2", vec3(-0.5, 0.5, 0.6)),
        ("chapel:edge=1.5", vec3(0.3, 2.0, 8.0)),
        ("chapel:edge=1.5", vec3(-5.0, 5.0, -3.0)),
        ("chapel:edge=1.5", vec3(0.2, 5.5, -12.0)),
        ("chapel:edge=1.5", vec3(0.2, 11.0, 2.0)),
    ];
    for (spec, eye) in eyes {
        assert_eq!(leaks(&build(spec).unwrap(), eye, 1.0), [0, 0], "{spec} from {eye}");
    }
}

#[test]
fn courtyard_is_open_only_above() {
    let scene = build("courtyard:edge=1").unwrap();
    // In the middle of the court, walls of 6.9 m at 6 m hide everything below 40 degrees but at the fountain;
    // in the walk's corner only what is seen through an arch, under the far wall's top, is above 25 degrees.
    assert_eq!(leaks(&scene, vec3(1.9, 0.5, 0.4), 0.5), [0, 0]);
    assert_eq!(leaks(&scene, vec3(-8.2, 1.7, -7.0), 0.2), [0, 0]);
    assert!(leaks(&scene, vec3(1.9, 0.5, 0.4), 1.0)[0] > 20);
}

#[test]
fn wrong_specs_say_what_there_is() {
    let message = |spec: &str| build(spec).unwrap_err().to_string();
    assert!(message("plain").contains("did you mean `plane`?"));
    assert!(message("nothing-like-it").contains("There are: plane, sphere-on-plane"));
    assert!(message("courtyard:colums=3").contains("did you mean `columns`?"));
    assert!(message("plane:n").contains("name=value"));
    for spec in ["plane:n=1.5", "plane:n=x", "plane:n=0", "plane:size=nan", "plane:size=inf", "plane:size=-1"]
    {
        assert!(message(spec).contains("should be a"), "{spec}");
    }
    assert!(message("courtyard:columns=24").contains("arches of"));
    assert!(message("cylinder-on-plane:radius=5").contains("does not fit"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn any_spec_gives_a_scene_or_one_line(name in "[a-z-]{0,9}", rest in "(:[a-z]{0,4}=?[0-9.e-]{0,4},?)?") {
        if let Err(e) = build(&format!("{name}{rest}")) {
            prop_assert!(!e.to_string().contains('\n'));
        }
    }
}

#[test]
fn terrain_drains_to_its_border() {
    // Every inner point has a lower neighbour, but for lakes and for river beds that creep has closed: 173 points of
    // 65,025 here. Noise without rivers leaves several percent.
    let n = 257;
    let position = build("terrain").unwrap().mesh.position;
    let height = |x: usize, y: usize| position[y * n + x].y;
    let inner = || (1..n - 1).flat_map(|y| (1..n - 1).map(move |x| (x, y)));
    let is_hollow = |&(x, y): &(usize, usize)| {
        let around = (0..9).filter(|k| *k != 4).map(|k| height(x + k % 3 - 1, y + k / 3 - 1));
        around.fold(f32::MAX, f32::min) >= height(x, y)
    };
    let hollows = inner().filter(is_hollow).count();
    assert!(hollows * 200 < inner().count(), "{hollows}");
}
