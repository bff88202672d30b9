//! Windows of every size and vertices at every distance, under a uniform sky of radiance 1. Rows keep their sums through
//! the encoding, and a sheet hides nothing of its own window, so that closed forms hold to single precision but for
//! where a ray starts: a hair off the surface, and a thousandth of an edge inside its border.

use std::f32::consts::PI;
use std::sync::Mutex;

use glam::{EulerRot, Quat, Vec2, Vec3, vec2, vec3};
use lunette_bake::{Error, Options, PortalOptions, Progress, Silent, bake_portals};
use lunette_relight::indirect::Indirect;
use lunette_scenes::Portal;
use lunette_tests::baked::light;
use lunette_tests::closed_form::{facing_rectangle, over_corners, upright_rectangle};
use lunette_tests::interior::{
    Interior, ROOM, Window, bounced_options, built, direct_options, lit, room, room_with,
};

/// Irradiance of a vertex of the wall opposite or of the floor.
fn expected(window: &Window, p: Vec3, n: Vec3) -> f64 {
    let p = p.as_dvec3();
    let [low, high] = [window.low, window.high].map(|c| [f64::from(c.x) - p.x, f64::from(c.y) - p.y]);
    let share = if n.z < -0.5 {
        over_corners(low, high, |a, b| facing_rectangle(a, b, p.z))
    } else {
        // On the floor b runs up. On the window's very plane c goes to 0 from inside.
        over_corners(low, high, |a, b| upright_rectangle(a, b, p.z.max(1e-9)))
    };
    std::f64::consts::PI * share
}

/// Position, normal and direct irradiance of the vertices of the wall opposite and of the floor.
fn facing_or_floor(interior: &Interior) -> Vec<(Vec3, Vec3, f32)> {
    let e = lit(&interior.bake(&direct_options()), &light("uniform"), Indirect::None).direct;
    let mesh = interior.mesh();
    let all = mesh.position.iter().zip(&mesh.normal).zip(&e).map(|((p, n), e)| (*p, *n, e.x));
    all.filter(|(p, n, _)| (p.z == ROOM.z && n.z < -0.5) || (p.y == 0.0 && n.y > 0.5)).collect()
}

#[test]
fn window_of_a_whole_wall_has_its_closed_form() {
    let found = facing_or_floor(&room_with(Window::WALL, 8, 0.5));
    assert_eq!(found.len(), 2 * 81);
    let on_plane = found.iter().filter(|(p, _, _)| p.z == 0.0).count();
    assert_eq!(on_plane, 9, "the floor reaches to the window's plane");
    for (p, n, e) in found {
        let expected = expected(&Window::WALL, p, n);
        let is_inner = p.x > 0.0
            && p.x < ROOM.x
            && if n.z < -0.5 { p.y > 0.0 && p.y < ROOM.y } else { p.z > 0.0 && p.z < ROOM.z };
        // Origins lie 7e-5 m off the wall, and on its borders half a millimetre inside, of some metres.
        let tolerance = if is_inner { 1e-4 } else { 2e-3 };
        // In the window's edge an origin half a millimetre to the side sees all of the window's half space.
        let corner = p.z == 0.0 && (p.x == 0.0 || p.x == ROOM.x);
        if !corner {
            assert!((f64::from(e) / expected - 1.0).abs() < tolerance, "{p} {n}: {e} {expected}");
        }
    }
}

#[test]
fn light_falls_with_the_area_of_a_small_window() {
    for side in [0.4, 0.1, 0.02, 0.004] {
        let window = Window::square(side);
        let found = facing_or_floor(&room_with(window, 4, 0.5));
        assert_eq!(found.len(), 2 * 25);
        for (p, n, e) in found.into_iter().filter(|(p, _, _)| p.z > 0.0) {
            // Corners rounded to 1e-7 m make the area of the smallest uncertain by 1e-4; borders as above.
            let closed = expected(&window, p, n);
            assert!((f64::from(e) / closed - 1.0).abs() < 3e-3, "{side} m, {p} {n}: {e} {closed}");
            // E -> A cos cos / r², up to the window's solid angle.
            let to = (0.5 * ROOM.truncate()).extend(0.0) - p;
            let far = f64::from(window.area() * to.dot(n) * -to.z / to.length_squared().powi(2));
            let relative = f64::from(side * side / to.length_squared());
            assert!((f64::from(e) / far - 1.0).abs() < 3.0 * relative + 3e-3, "{side} m, {p} {n}: {e} {far}");
        }
    }
}

#[test]
fn vertices_in_the_plane_of_a_window_see_nothing_of_it() {
    let interior = room_with(Window::square(1.0), 4, 0.5);
    let e = lit(&interior.bake(&direct_options()), &light("uniform"), Indirect::None).direct;
    let mesh = interior.mesh();
    let beside: Vec<usize> = (0..e.len()).filter(|&v| mesh.normal[v].z > 0.5).collect();
    // Four parts of the wall, some vertices on the window's own edge.
    assert_eq!(beside.len(), 4 * 25);
    for v in beside {
        assert_eq!(e[v], Vec3::ZERO, "{}", mesh.position[v]);
    }
    // The rest of the room is lit.
    assert!((0..e.len()).filter(|&v| mesh.normal[v].z < -0.5).all(|v| e[v].x > 0.01));
}

#[test]
fn vertex_a_millimetre_from_a_window_receives_pi_and_none_more() {
    let window = Window::square(1.0);
    let mut sheets = room(Some(window), 4);
    let first = sheets.n_vertices();
    let middle = 0.5 * ROOM.truncate();
    sheets.add((middle - 0.01).extend(1e-3), 0.02 * Vec3::Y, 0.02 * Vec3::X, 2);
    let interior = Interior { scene: sheets.scene(), portals: vec![window.portal("window")] };
    assert!(interior.mesh().normal[first].z < -0.5, "it faces the window");
    let e = lit(&interior.bake(&direct_options()), &light("uniform"), Indirect::None).direct;
    for e in &e[first..] {
        // From a millimetre the rest of the half space, beyond half a metre, is (1/500)² of it.
        assert!((e.x - PI).abs() < 1e-4, "{e}");
    }
    for (v, e) in e.iter().enumerate() {
        assert!(e.x <= PI * (1.0 + 1e-5), "{}: {e}", interior.mesh().position[v]);
    }
}

#[test]
fn distance_to_a_window_may_go_to_nothing() {
    // A staircase of small sheets facing the window from 1 m down to a tenth of a millimetre, which is nearer than the
    // hair by which origins on a pane are moved.
    let window = Window::square(1.0);
    let mut sheets = room(Some(window), 2);
    let first = sheets.n_vertices();
    let distances = [1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4];
    for (i, z) in distances.into_iter().enumerate() {
        // Side by side along the window, each in the others' shade as little as can be.
        let corner = vec3(1.6 + 0.1 * i as f32, 1.5, z);
        sheets.add(corner, 1e-3 * Vec3::Y, 1e-3 * Vec3::X, 1);
    }
    let interior = Interior { scene: sheets.scene(), portals: vec![window.portal("window")] };
    let e = lit(&interior.bake(&direct_options()), &light("uniform"), Indirect::None).direct;
    for (i, z) in distances.into_iter().enumerate() {
        let v = first + 4 * i;
        let p = interior.mesh().position[v];
        let closed = expected(&window, p, -Vec3::Z);
        // The others, a square millimetre each, hide at most 1e-6 / (2e-1)² of it.
        assert!((f64::from(e[v].x) / closed - 1.0).abs() < 1e-3, "{z} m: {} {closed}", e[v].x);
    }
}

#[test]
fn pane_given_from_both_sides_lights_once() {
    let interior = room_with(Window::square(1.5), 6, 0.5);
    let mut twice = room_with(Window::square(1.5), 6, 0.5);
    // The other way round, and cut along the other diagonal.
    let mut back = twice.portals[0].convex_polygons();
    back.iter_mut().for_each(|polygon| polygon.reverse());
    let back = Portal::from_polygons("back", &back, Vec3::ONE).expect("an area");
    twice.portals[0].triangles.extend(back.triangles);
    let bytes = |interior: &Interior| {
        let options = Options { bounces: 1, rays: 64, ..direct_options() };
        interior.bake(&options).to_bytes().expect("bytes")
    };
    assert!(bytes(&interior) == bytes(&twice), "the same light, to the bit");
}

#[test]
fn pane_far_away_bars_nothing() {
    // Turned so that nothing is even in single precision; vertices lie on the pane's very plane. The other pane is outside
    // above the roof, in another plane, so that each ray is asked for panes before its own.
    let mut interior = built("box-room:edge=0.3");
    let turn = Quat::from_euler(EulerRot::YXZ, 0.7, 0.4, 0.2);
    let mesh = &mut interior.scene.mesh;
    mesh.position.iter_mut().for_each(|p| *p = turn * *p + vec3(3.3, 1.7, -5.1));
    mesh.normal.iter_mut().for_each(|n| *n = turn * *n);
    let corners = |portal: &Portal| -> Vec<[Vec3; 3]> {
        portal.triangles.iter().map(|t| t.map(|p| turn * p + vec3(3.3, 1.7, -5.1))).collect()
    };
    let near = corners(&interior.portals[0]);
    let above = [vec3(-1.0, 6.0, -1.0), vec3(-1.0, 6.0, 1.0), vec3(1.0, 6.0, 1.0)];
    let with = |triangles: Vec<[Vec3; 3]>| Interior {
        scene: interior.scene.clone(),
        portals: vec![Portal::new("glass", triangles, Vec3::ONE).expect("an area")],
    };
    let far = above.map(|p| turn * p + vec3(3.3, 1.7, -5.1));
    let [alone, both] = [near.clone(), near.into_iter().chain([far]).collect()].map(|triangles| {
        lit(&with(triangles).bake(&direct_options()), &light("uniform"), Indirect::None).direct
    });
    // Vertices under the sky, on the wall's outer half, may see the pane above; those inside are as without.
    let inside =
        lunette_bake::openings::inside(&interior.scene, &with(corners(&interior.portals[0])).portals)
            .expect("Embree");
    let n_lit = inside.iter().zip(&alone).filter(|(inside, e)| **inside && e.x > 0.1).count();
    assert!(n_lit > 300, "{n_lit}");
    for (v, (alone, both)) in alone.iter().zip(&both).enumerate().filter(|(v, _)| inside[*v]) {
        // Other rays look for what is in the way: the rabbit's shadow is known to a percent of the window's light.
        assert!((alone.x - both.x).abs() < 0.01, "{}: {alone} {both}", interior.mesh().position[v]);
    }
}

#[test]
fn room_with_its_only_portal_elsewhere_is_refused_by_name() {
    // The pane stands free, a metre before the closed wall.
    let window = Window::square(1.0);
    let mut portal = window.portal("window");
    portal.triangles.iter_mut().flatten().for_each(|p| p.z -= 1.0);
    let interior = Interior { scene: room(None, 4).scene(), portals: vec![portal] };
    let options = bounced_options();
    let baked =
        bake_portals(&interior.scene, &interior.portals, &options, &PortalOptions::default(), &Silent);
    assert!(matches!(baked, Err(lunette_bake::Error::UnseenPortal(name)) if name == "window"));
}

#[test]
fn closed_room_beside_a_lit_one_is_exactly_dark() {
    // Two rooms that share nothing; the light of the first one's window is none of the second's.
    let lit_room = room_with(Window::square(1.0), 4, 0.5);
    let mut scene = lit_room.scene.clone();
    let n_lit = scene.mesh.position.len();
    let dark = room(None, 4).scene();
    let shift = Vec3::new(100.0, 0.0, 0.0);
    scene.mesh.position.extend(dark.mesh.position.iter().map(|p| *p + shift));
    scene.mesh.normal.extend(&dark.mesh.normal);
    scene.mesh.index.extend(dark.mesh.index.iter().map(|t| t.map(|v| v + n_lit as u32)));
    scene.mesh.material.extend(&dark.mesh.material);
    scene.mesh.group.extend(&dark.mesh.group);
    let interior = Interior { scene, portals: lit_room.portals };
    let asset = interior.bake(&bounced_options());
    for indirect in [Indirect::Sh, Indirect::DirectToIndirect] {
        let lit = lit(&asset, &light("uniform + cap:0,0.5,-1,0.2,50"), indirect).total();
        assert!(lit[..n_lit].iter().any(|e| e.x > 0.1));
        // Outer walls of the second room face nothing that is lit either.
        assert_eq!(lit[n_lit..], vec![Vec3::ZERO; lit.len() - n_lit], "{indirect:?}");
    }
}

/// Two windows that fill `whole` between them, cut at `at` of its width.
fn cut(whole: Window, at: f32) -> [Window; 2] {
    let x = whole.low.x + at * (whole.high.x - whole.low.x);
    [Window { high: vec2(x, whole.high.y), ..whole }, Window { low: vec2(x, whole.low.y), ..whole }]
}

#[test]
fn two_portals_give_the_direct_light_of_the_window_they_fill() {
    let whole = Window { low: vec2(1.1, 0.7), high: vec2(3.2, 2.5) };
    let one = room_with(whole, 4, 0.5);
    let parts = cut(whole, 0.37).map(|w| w.portal("part"));
    let two = Interior { scene: one.scene.clone(), portals: parts.to_vec() };
    let [one, two] = [one, two].map(|i| i.bake(&direct_options()));
    // A uniform light sees the rows' sums, which the encoding keeps; others see texels rounded to 8 bits of the row's
    // largest, wavelets cut at 1 % of the row, and no more than 1 % of the mean of either is lost.
    for (spec, tolerance) in [("uniform", 1e-5), ("cie-overcast", 0.01), ("cap:0.1,0.6,-1,0.4,1", 0.02)] {
        let [a, b] = [&one, &two].map(|asset| lit(asset, &light(spec), Indirect::None).direct);
        let total: f32 = a.iter().map(|e| e.x).sum();
        let off: f32 = a.iter().zip(&b).map(|(a, b)| (a.x - b.x).abs()).sum();
        assert!(total > 0.0 && off < tolerance * total, "{spec}: {}", off / total);
    }
}

#[test]
fn two_portals_bounce_the_light_of_the_window_they_fill() {
    let whole = Window { low: vec2(1.1, 0.7), high: vec2(3.2, 2.5) };
    let one = room_with(whole, 8, 0.5);
    let parts = cut(whole, 0.37).map(|w| w.portal("part"));
    let two = Interior { scene: one.scene.clone(), portals: parts.to_vec() };
    let options = Options { rays: 2048, ..bounced_options() };
    let [one, two] = [one, two].map(|i| i.bake(&options));
    // SH of each portal has rays of its own, whose noise this is; what is carried from direct light has the same.
    for (way, tolerance) in [(Indirect::Sh, 0.04), (Indirect::DirectToIndirect, 0.01)] {
        for spec in ["uniform", "cap:0.1,0.6,-1,0.4,1"] {
            let [a, b] = [&one, &two].map(|asset| lit(asset, &light(spec), way).indirect);
            let total: f32 = a.iter().map(|e| e.x).sum();
            let off: f32 = a.iter().zip(&b).map(|(a, b)| (a.x - b.x).abs()).sum();
            println!("{way:?}, {spec}: {}", off / total);
            assert!(total > 0.0 && off < tolerance * total, "{way:?}, {spec}: {}", off / total);
        }
    }
}

#[test]
fn closed_forms_of_this_file_know_the_empty_and_the_full_view() {
    let (near, far) = (vec3(2.0, 1.5, 1e-6), vec3(2.0, 1.5, 1e4));
    assert!((expected(&Window::WALL, near, -Vec3::Z) - std::f64::consts::PI).abs() < 1e-5);
    let size = ROOM.as_dvec3();
    let small = size.x * size.y / 1e8;
    assert!((expected(&Window::WALL, far, -Vec3::Z) / small - 1.0).abs() < 1e-6);
    assert_eq!(Window { low: Vec2::ONE, high: Vec2::splat(3.0) }.area(), 4.0);
}

/// Asks to stop at the end of a stage.
struct StopAfter {
    /// None: goes through.
    stage: Option<String>,
    seen: Mutex<Vec<String>>,
}

impl Progress for StopAfter {
    fn report(&self, stage: &str, done: u64, total: u64) {
        assert!(done <= total, "{stage}: {done} of {total}");
        let mut seen = self.seen.lock().expect("the stages");
        if seen.last().is_none_or(|last| last != stage) {
            seen.push(stage.to_string());
        }
    }

    fn cancelled(&self) -> bool {
        let seen = self.seen.lock().expect("the stages");
        self.stage.as_ref().is_some_and(|stage| seen.contains(stage))
    }
}

#[test]
fn a_bake_stops_in_whatever_stage_it_is_asked_to() {
    let interior = built("box-room:edge=0.4,bars=1");
    let options = Options { rays: 64, bounces: 2, ..bounced_options() };
    let bake = |stage: Option<String>| {
        let progress = StopAfter { stage, seen: Mutex::default() };
        let result =
            bake_portals(&interior.scene, &interior.portals, &options, &PortalOptions::default(), &progress);
        (result.map(|_| ()), progress.seen.into_inner().expect("the stages"))
    };
    let (result, stages) = bake(None);
    result.expect("a bake");
    println!("{stages:?}");
    assert!(stages.contains(&"bars in windows".to_string()) && stages.len() > 3, "{stages:?}");
    for (i, stage) in stages.iter().enumerate().take(stages.len() - 1) {
        let (result, seen) = bake(Some(stage.clone()));
        assert!(matches!(result, Err(Error::Cancelled)), "{stage}: {result:?}");
        assert_eq!(seen, stages[..=i], "nothing was begun after it");
    }
}
