//! Interiors and skies in sparse rows against the path-traced reference, at vertices within flat faces: there both see
//! the same point. Between vertices suns are held to it, all else is judged by the command `compare`.

use glam::Vec3;
use lunette_bake::{Basis, Options};
use lunette_relight::frame::Method;
use lunette_relight::indirect::Indirect;
use lunette_relight::portal_frame::{Detail, Point};
use lunette_relight::shell::Material;
use lunette_render::{
    NOISE_MARGIN, Reference, ReferenceOptions, Surface, Tracer, difference, noise, reference_irradiance,
};
use lunette_scenes::{Portal, Scene};
use lunette_tests::baked::{baked, irradiance, light, scene};
use lunette_tests::interior::{built, frame_through, in_flat_faces, lit};
use lunette_tests::measure::spread;

const BOUNCES: usize = 3;

/// Points of a scene, and what truly falls on them.
struct Truth {
    at: Vec<usize>,
    reference: Reference,
}

fn truth(scene: &Scene, portals: &[Portal], at: Vec<usize>, spec: &str, options: ReferenceOptions) -> Truth {
    let pick = |of: &[Vec3]| at.iter().map(|&v| of[v]).collect::<Vec<_>>();
    let (points, normals) = (pick(&scene.mesh.position), pick(&scene.mesh.normal));
    Truth { reference: truth_at(scene, portals, &points, &normals, spec, options), at }
}

fn truth_at(
    scene: &Scene,
    portals: &[Portal],
    points: &[Vec3],
    normals: &[Vec3],
    spec: &str,
    options: ReferenceOptions,
) -> Reference {
    let mesh = &scene.mesh;
    let albedo = scene.vertex_albedo();
    let surface =
        Surface { position: &mesh.position, normal: &mesh.normal, index: &mesh.index, albedo: &albedo };
    let panes: Vec<[Vec3; 3]> = portals.iter().flat_map(|p| p.triangles.iter().copied()).collect();
    let mut tracer = Tracer::new(surface).expect("a tracer");
    if !panes.is_empty() {
        tracer = tracer.with_portals(&panes).expect("panes");
    }
    reference_irradiance(&tracer, &light(spec), points, normals, &options, |_| {}).expect("a reference")
}

/// What is held against the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Direct,
    All,
}

impl Truth {
    /// Without the points that receive nothing at all, direct or bounced: they lie in a wall's footprint, and the bake
    /// gives them the light of their neighbours on purpose.
    fn without_buried(mut self) -> Truth {
        let lit: Vec<bool> = self.reference.total().iter().map(|e| *e != Vec3::ZERO).collect();
        let r = &mut self.reference;
        for list in [&mut r.direct, &mut r.indirect, &mut r.error, &mut r.direct_error, &mut r.indirect_error]
        {
            let mut keep = lit.iter();
            list.retain(|_| *keep.next().expect("one for each point"));
        }
        let mut keep = lit.iter();
        self.at.retain(|_| *keep.next().expect("one for each point"));
        self
    }

    /// Bias of bounced light, of that at all vertices.
    fn bounced_off(&self, found: &[Vec3]) -> f64 {
        let found: Vec<Vec3> = self.at.iter().map(|&v| found[v]).collect();
        bias(&found, &self.reference.indirect)
    }

    /// Asserts that the relative difference is within a bound and the reference's noise five times smaller than it.
    fn judge(&self, name: &str, found: &[Vec3], part: Part, bound: f64) {
        let truth = match part {
            Part::Direct => self.reference.direct.clone(),
            Part::All => self.reference.total(),
        };
        let error = if part == Part::Direct { &self.reference.direct_error } else { &self.reference.error };
        let found: Vec<Vec3> = self.at.iter().map(|&v| found[v]).collect();
        let relative = difference(&found, &truth, None).expect("numbers").relative;
        let noise = noise(error, &truth, None).expect("numbers");
        let bias = bias(&found, &truth);
        println!("{name}, {part:?}: {relative:.5} (bias {bias:.5}), the reference's noise {noise:.5}");
        assert!(NOISE_MARGIN * noise <= bound, "{name}: a reference with a noise of {noise} judges nothing");
        assert!(relative < bound, "{name}, {part:?}: {relative}");
    }
}

/// How much more there is in all than there should be, as a share of it.
fn bias(found: &[Vec3], truth: &[Vec3]) -> f64 {
    let sum = |list: &[Vec3]| list.iter().map(|e| f64::from(e.element_sum())).sum::<f64>();
    sum(found) / sum(truth) - 1.0
}

/// Bounds on the relative difference: of direct light, of all light with the bounced part in SH, and carried.
struct Bounds {
    light: &'static str,
    samples: u32,
    direct: f64,
    sh: f64,
    carried: f64,
}

fn judge_interior(spec: &str, all: &[Bounds]) {
    let interior = built(spec);
    let basis = vec![Basis::Sh, Basis::DirectToIndirect];
    let options = Options { basis, bounces: BOUNCES, rays: 512, ..Options::default() };
    let asset = interior.bake(&options);
    let inner = interior.inner_vertices();
    let at: Vec<usize> = spread(inner.len(), 60).map(|i| inner[i]).collect();
    assert!(at.len() > 30, "too few points inside: {}", at.len());
    for b in all {
        let options = ReferenceOptions { samples: b.samples, bounces: BOUNCES as u32, seed: 3 };
        let truth = truth(&interior.scene, &interior.portals, at.clone(), b.light, options).without_buried();
        assert!(truth.at.len() + 3 >= at.len(), "{}: {} of {} points lit", b.light, truth.at.len(), at.len());
        let [sh, carried] =
            [Indirect::Sh, Indirect::DirectToIndirect].map(|way| lit(&asset, &light(b.light), way));
        truth.judge(b.light, &sh.direct, Part::Direct, b.direct);
        truth.judge(&format!("{}, SH", b.light), &sh.total(), Part::All, b.sh);
        truth.judge(&format!("{}, carried", b.light), &carried.total(), Part::All, b.carried);
    }
}

/// Many windows, of three portals, in walls 0.6 m thick; direct light is nearly exact where a few rays per texel find the
/// edges of columns and reveals (found 0.008). Bounced light comes from vertices up to two metres apart: found 0.04 of all
/// light in SH and carried under the uniform sky, 0.06 and 0.07 under the overcast one.
#[test]
fn chapel_matches_the_reference() {
    judge_interior(
        "chapel:bays=1,edge=2",
        &[
            Bounds { light: "uniform", samples: 8192, direct: 0.02, sh: 0.06, carried: 0.06 },
            Bounds { light: "cie-overcast", samples: 8192, direct: 0.025, sh: 0.08, carried: 0.09 },
        ],
    );
}

/// A spot's edge is as wide as a cell of the mesh, here 0.6 m: found 0.047. SH of five bands spread what bounces
/// (found 0.12 of all light), what is carried from direct light keeps its place but for the size of a patch (0.063).
#[test]
fn sun_in_a_room_matches_the_reference() {
    judge_interior(
        "box-room:window-width=3,window-height=2,edge=0.6",
        &[Bounds { light: "cap:-1,0.5,0.1,0.1,100", samples: 4096, direct: 0.06, sh: 0.18, carried: 0.09 }],
    );
}

/// Suns of a tenth of a radian and of half a degree, through walls 0.25 m and 0.6 m thick whose outer edges bound half of
/// each spot: what is left is the noise of the reference (found 0.0027 and 0.0029), and for the small sun the mean over a
/// vertex's cell in place of the vertex (0.015).
#[test]
fn suns_are_as_sharp_as_the_window() {
    let cases = [
        ("box-room:window-width=3,window-height=2,edge=0.1", "cap:-1,0.5,0.1,0.1,100", 0.01),
        ("box-room:window-width=3,window-height=2,edge=0.1", "cap:-1,0.5,0.1,0.004653,40000", 0.025),
        ("chapel:bays=1,edge=0.25", "cap:0.123,0.707,0.696,0.1,100", 0.02),
    ];
    for (name, spec, bound) in cases {
        let interior = built(name);
        let asset = interior.bake(&Options { bounces: 0, rays: 4096, ..Options::default() });
        let inner = interior.inner_vertices();
        let at: Vec<usize> = spread(inner.len(), 600).map(|i| inner[i]).collect();
        let options = ReferenceOptions { samples: 8192, bounces: 0, seed: 3 };
        let truth = truth(&interior.scene, &interior.portals, at, spec, options).without_buried();
        let found = lit(&asset, &light(spec), Indirect::None);
        truth.judge(&format!("{name}, {spec}"), &found.direct, Part::Direct, bound);
    }
}

/// Takes the triangles of a group away; their vertices stay.
fn without_group(scene: &mut Scene, name: &str) {
    let group = scene.groups.iter().position(|g| g == name).expect("a group of that name") as u32;
    let mesh = &mut scene.mesh;
    let keep: Vec<bool> = mesh.group.iter().map(|g| *g != group).collect();
    let mut of = keep.iter();
    mesh.index.retain(|_| *of.next().expect("one each"));
    let mut of = keep.iter();
    mesh.material.retain(|_| *of.next().expect("one each"));
    mesh.group.retain(|g| *g != group);
}

/// Direct light of suns in the middles of triangles of an empty room, whose bounds are given.
fn judge_between_vertices(spec: &str, suns: &[(&str, f64)]) {
    let mut interior = built(spec);
    without_group(&mut interior.scene, "rabbit");
    let asset = interior.bake(&Options { bounces: 0, rays: 4096, ..Options::default() });
    let mesh = interior.mesh();
    let inside = lunette_bake::openings::inside(&interior.scene, &interior.portals).expect("Embree");
    let is_inside = |t: &&[u32; 3]| t.iter().all(|&v| inside[v as usize]);
    let triangles: Vec<[u32; 3]> = mesh.index.iter().filter(is_inside).copied().collect();
    let middle = |of: &[Vec3], t: &[u32; 3]| t.map(|v| of[v as usize]).iter().sum::<Vec3>() / 3.0;
    let points: Vec<Vec3> = triangles.iter().map(|t| middle(&mesh.position, t)).collect();
    let normals: Vec<Vec3> = triangles.iter().map(|t| middle(&mesh.normal, t).normalize()).collect();
    for &(spec, bound) in suns {
        let options = ReferenceOptions { samples: 4096, bounces: 0, seed: 5 };
        let truth = truth_at(&interior.scene, &interior.portals, &points, &normals, spec, options).direct;
        let frame = frame_through(&asset, &light(spec), Indirect::None, Material::CLEAR);
        let mut direct = vec![[0.0; 3]; asset.n_vertices()];
        frame.direct(0, &mut direct);
        let direct: Vec<Vec3> = direct.into_iter().map(Vec3::from).collect();
        let plain: Vec<Vec3> = triangles.iter().map(|t| middle(&direct, t)).collect();
        let point = |t: &[u32; 3]| Point { corners: *t, weights: [1.0 / 3.0; 3], radius: 0.0 };
        let mut detail = Detail::new(&frame);
        let more = triangles.iter().map(|t| Vec3::from(detail.at(&point(t))));
        let sharp: Vec<Vec3> = plain.iter().zip(more).map(|(e, more)| e + more).collect();
        let off = |found: &[Vec3]| difference(found, &truth, None).expect("numbers").relative;
        println!("{spec}: {:.4}, interpolated {:.4}", off(&sharp), off(&plain));
        assert!(off(&sharp) < bound && off(&plain) > 2.0 * off(&sharp));
    }
}

/// Triangles 0.3 m wide, walls 0.25 m thick: found 0.0025, of which most is the noise of the reference, and 0.0004, where
/// interpolation is 0.052 and 0.17 off.
#[test]
fn between_vertices_suns_are_as_sharp_as_the_window() {
    judge_between_vertices(
        "box-room:window-width=3,window-height=2,edge=0.3",
        &[("cap:-1,0.5,0.1,0.1,100", 0.005), ("cap:-1,0.5,0.1,0.004653,40000", 0.002)],
    );
}

/// Bars 3 cm wide and 5 cm deep, finer than texels: found 0.0040 and 0.0028, where interpolation is 0.10 and 0.32 off.
#[test]
fn bars_of_a_window_are_in_the_sun_s_spot() {
    judge_between_vertices(
        "box-room:window-width=3,window-height=2,edge=0.3,bars=3",
        &[("cap:-1,0.5,0.1,0.1,100", 0.006), ("cap:-1,0.5,0.1,0.004653,40000", 0.005)],
    );
}

/// Windows parted finely against the triangles: corners then look past the pane through which a point has the sun, or agree
/// about the wrong one.
#[test]
fn no_point_within_a_spot_is_dark() {
    const POINTS: usize = 200;
    let interior = built("box-room:window-width=3,window-height=2,edge=0.8,bars=8");
    let asset = interior.bake(&Options { rays: 64, bounces: 0, ..Options::default() });
    let mesh = interior.mesh();
    let inside = lunette_bake::openings::inside(&interior.scene, &interior.portals).expect("Embree");
    let spec = "cap:-1,0.7,0.13,0.004653,40000";
    let frame = frame_through(&asset, &light(spec), Indirect::None, Material::CLEAR);
    let mut direct = vec![[0.0; 3]; asset.n_vertices()];
    frame.direct(0, &mut direct);
    let mut detail = Detail::new(&frame);
    let (mut points, mut normals, mut found) = (Vec::new(), Vec::new(), Vec::new());
    for t in mesh.index.iter().filter(|t| t.iter().all(|&v| inside[v as usize])) {
        for i in 0..POINTS {
            // R2, folded onto the triangle.
            let [x, y] = [0.754_877_7, 0.569_840_3].map(|step| (0.5 + i as f32 * step).fract());
            let (x, y) = if x + y > 1.0 { (1.0 - x, 1.0 - y) } else { (x, y) };
            let weights = [1.0 - x - y, x, y];
            let mean = |of: &dyn Fn(usize) -> Vec3| {
                t.iter().zip(weights).map(|(v, w)| w * of(*v as usize)).sum::<Vec3>()
            };
            let (p, n) = (mean(&|v| mesh.position[v]), mean(&|v| mesh.normal[v]).normalize());
            // In the room, past the rabbit and its shadow.
            if p.x <= -1.9 || p.z <= -0.7 || n.abs().max_element() <= 0.999 {
                continue;
            }
            let more = detail.at(&Point { corners: *t, weights, radius: 0.0 })[1];
            points.push(p);
            normals.push(n);
            found.push(mean(&|v| direct[v].into()).y + more);
        }
    }
    let options = ReferenceOptions { samples: 16, bounces: 0, seed: 5 };
    let truth = truth_at(&interior.scene, &interior.portals, &points, &normals, spec, options).direct;
    let power = 40_000.0 * std::f32::consts::PI * 0.004_653f32.powi(2);
    let sun = Vec3::new(-1.0, 0.7, 0.13).normalize();
    let full = |i: &usize| truth[*i].y > 0.95 * power * sun.dot(normals[*i]).max(0.0) && truth[*i].y > 0.1;
    let lit: Vec<usize> = (0..points.len()).filter(full).collect();
    let dark = lit.iter().filter(|&&i| found[i] < 0.2 * truth[i].y).count();
    println!("{dark} of {} points in the sun are dark", lit.len());
    assert!(lit.len() > 1000 && dark == 0, "{dark} of {}", lit.len());
}

/// A high sun on the bars of a window, of which the outer halves throw light in: found 0.099 of it missing around the
/// window in triangles of 0.2 m, 0.059 in those of 0.1 m, and 0.191 where those halves are dark; without bars 0.011.
#[test]
fn outer_halves_of_bars_send_light_in() {
    let interior = built("box-room:window-width=3,window-height=2,edge=0.2,bars=4");
    let basis = vec![Basis::DirectToIndirect];
    let asset = interior.bake(&Options { basis, bounces: 1, rays: 1024, ..Options::default() });
    let sun = "cap:-1,1.5,0.1,0.1,100";
    let mesh = interior.mesh();
    let inner = interior.inner_vertices();
    let near = |v: &usize| mesh.position[*v].x < -1.0 && mesh.position[*v].y > 1.0;
    let at: Vec<usize> = inner.into_iter().filter(near).collect();
    let options = ReferenceOptions { samples: 4096, bounces: 1, seed: 3 };
    let truth = truth(&interior.scene, &interior.portals, at, sun, options).without_buried();
    let found = lit(&asset, &light(sun), Indirect::DirectToIndirect);
    let off = truth.bounced_off(&found.indirect);
    println!("{} vertices: {off:.3}", truth.at.len());
    assert!(truth.at.len() > 50 && off.abs() < 0.13, "{off}");
}

/// The outer wall beside an upper window sees no pane, but it lights the roof before the window, which lights the window's
/// reveals: found 0.009 of bounced light missing there, and 0.074 where that wall is dark.
#[test]
fn what_lights_the_ground_before_a_window_counts() {
    let interior = built("chapel:bays=1,edge=0.2");
    let basis = vec![Basis::Sh];
    let options =
        Options { basis, bounces: 3, indirect_order: 1, rays: 256, resolution: 8, ..Options::default() };
    let asset = interior.bake(&options);
    let mesh = interior.mesh();
    let in_reveal = |v: &usize| {
        let p = mesh.position[*v];
        (3.25..3.5).contains(&p.x.abs()) && (7.0..8.7).contains(&p.y) && p.z.abs() < 1.0
    };
    let at: Vec<usize> = (0..mesh.position.len()).filter(in_reveal).collect();
    let options = ReferenceOptions { samples: 1024, bounces: 3, seed: 3 };
    let truth = truth(&interior.scene, &interior.portals, at, "uniform:1", options).without_buried();
    let found = lit(&asset, &light("uniform:1"), Indirect::Sh);
    let off = truth.bounced_off(&found.indirect);
    println!("{} vertices: {off:.3}", truth.at.len());
    assert!(truth.at.len() > 50 && off.abs() < 0.03, "{off}");
}

/// What a sunlit rabbit sends to the floor within 25 cm of it: found 0.057 off; averages over neighbours, where those see
/// more or less of it, spread it and are 0.136 off.
#[test]
fn light_beside_a_small_bright_object_is_not_spread() {
    let interior = built("box-room:edge=0.1");
    let basis = vec![Basis::DirectToIndirect];
    let asset = interior.bake(&Options { basis, bounces: 1, rays: 1024, ..Options::default() });
    let (mesh, groups) = (interior.mesh(), &interior.scene.groups);
    let rabbit: Vec<Vec3> = (mesh.index.iter().zip(&mesh.group))
        .filter(|(_, group)| groups[**group as usize] == "rabbit")
        .map(|(t, _)| mesh.position[t[0] as usize])
        .collect();
    let sun = "cap:-0.883,0.469,0,0.00465,40000";
    let found = lit(&asset, &light(sun), Indirect::DirectToIndirect);
    let near = |v: &usize| {
        let p = mesh.position[*v];
        let distance = rabbit.iter().map(|r| r.distance(p)).fold(f32::MAX, f32::min);
        p.y.abs() < 1e-3 && (0.06..0.25).contains(&distance) && found.direct[*v].x > 1.0
    };
    let at: Vec<usize> = (0..mesh.position.len()).filter(near).collect();
    let options = ReferenceOptions { samples: 4096, bounces: 1, seed: 3 };
    let truth = truth(&interior.scene, &interior.portals, at, sun, options);
    let found: Vec<Vec3> = truth.at.iter().map(|&v| found.indirect[v]).collect();
    let off = difference(&found, &truth.reference.indirect, None).expect("numbers").relative;
    println!("{} vertices: {off:.3}", found.len());
    assert!(found.len() > 20 && off < 0.06, "{off}");
}

/// Points of the floor about the feet of the rabbit, which a sun lights past its belly: found 0.122 off in triangles 0.1 m wide,
/// and 0.035 with some of their edges halved twice, by 281 vertices.
#[test]
fn refined_triangles_know_where_near_shadows_end() {
    let sun = "cap:-0.883,0.469,0,0.00465,40000";
    let plain = built("box-room:edge=0.1");
    let feet = |p: Vec3| p.y.abs() < 1e-3 && (0.15..0.6).contains(&p.x) && (-0.75..0.1).contains(&p.z);
    let off = |times: usize| {
        let mut interior = built("box-room:edge=0.1");
        lunette_bake::refine(&mut interior.scene, &interior.portals, times).expect("Embree");
        let asset = interior.bake(&Options { bounces: 0, rays: 512, ..Options::default() });
        let mesh = interior.mesh();
        let frame = frame_through(&asset, &light(sun), Indirect::None, Material::CLEAR);
        let mut direct = vec![[0.0; 3]; asset.n_vertices()];
        frame.direct(0, &mut direct);
        // A grid of points as good as any, each in its triangle.
        let mut detail = Detail::new(&frame);
        let (mut points, mut found) = (Vec::new(), Vec::new());
        for t in &mesh.index {
            let [a, b, c] = t.map(|v| mesh.position[v as usize]);
            let whole = (b - a).cross(c - a).y;
            if ![a, b, c].iter().all(|p| p.y.abs() < 1e-3) || whole <= 0.0 {
                continue;
            }
            let (low, high) = (a.min(b).min(c) / STEP, a.max(b).max(c) / STEP);
            for i in low.x.ceil() as i32..=high.x.floor() as i32 {
                for j in low.z.ceil() as i32..=high.z.floor() as i32 {
                    let p = Vec3::new(i as f32 * STEP, 0.0, j as f32 * STEP);
                    let part = |p: Vec3, q: Vec3, r: Vec3| (q - p).cross(r - p).y / whole;
                    let weights = [part(p, b, c), part(p, c, a), part(p, a, b)];
                    if feet(p) && weights.iter().all(|w| *w > 0.0) {
                        let plain: f32 = (0..3).map(|k| weights[k] * direct[t[k] as usize][0]).sum();
                        let more = detail.at(&Point { corners: *t, weights, radius: 0.0 })[0];
                        points.push(p);
                        found.push(Vec3::splat(plain + more));
                    }
                }
            }
        }
        let options = ReferenceOptions { samples: 64, bounces: 0, seed: 5 };
        let normals = vec![Vec3::Y; points.len()];
        let truth = truth_at(&plain.scene, &plain.portals, &points, &normals, sun, options).direct;
        let more = mesh.position.len() - plain.mesh().position.len();
        (difference(&found, &truth, None).expect("numbers").relative, more)
    };
    let ((coarse, none), (fine, more)) = (off(0), off(2));
    println!("{coarse:.3}; {fine:.3} with {more} vertices more");
    assert!(none == 0 && more > 50 && more < 2000 && fine < 0.5 * coarse && coarse > 0.1);
}

/// Between points of the floor, metres; of no edge a part.
const STEP: f32 = 0.0137;

fn sky_rows() -> Options {
    Options { basis: vec![Basis::Haar], bounces: 0, rays: 512, ..Options::default() }
}

#[test]
fn open_plane_in_sparse_rows_receives_pi() {
    let asset = baked(&scene("plane:n=2"), &sky_rows());
    for e in irradiance(&asset, &light("uniform"), Method::Haar) {
        // Rows keep their sums through the encoding; thousands of texels in single precision.
        assert!((e / std::f32::consts::PI - 1.0).abs().max_element() < 1e-5, "{e}");
    }
}

#[test]
fn shadow_of_a_post_in_sparse_rows_matches_the_reference() {
    let post = scene("cylinder-on-plane:edge=0.25");
    let asset = baked(&post, &sky_rows());
    let spec = "cap:0.6,0.7,0.2,0.1,100";
    let flat = in_flat_faces(&post.mesh);
    let flat: Vec<usize> = (0..flat.len()).filter(|&v| flat[v]).collect();
    let at = spread(flat.len(), 1200).map(|i| flat[i]).collect();
    let found = irradiance(&asset, &light(spec), Method::Haar);
    let options = ReferenceOptions { samples: 1024, bounces: 0, seed: 3 };
    let truth = truth(&post, &[], at, spec, options);
    // There is a shadow, and it has an edge.
    let e = |i: usize| truth.reference.direct[i].x;
    let most = (0..truth.at.len()).map(e).fold(0.0, f32::max);
    let dark = (0..truth.at.len()).filter(|&i| e(i) == 0.0).count();
    let edge = (0..truth.at.len()).filter(|&i| e(i) > 0.0 && e(i) < 0.9 * most).count();
    assert!(dark > 5 && edge > 5);
    // Found 0.003 with the reference's own noise in it; half of the points are far from the shadow.
    truth.judge(spec, &found, Part::Direct, 0.01);
}
