use std::borrow::Cow;

use super::*;
use crate::asset::Metadata;
use crate::cubemap::{n_texels, project_light};
use crate::light::{Light, Source};
use crate::portal_frame::{Detail, Point, PortalFrame};
use crate::shell::{Material, Shell};
use crate::sparse::{Choice, Encoder, Encoding, RowStore};

const N: usize = 32;
/// Vertices along a side of the floor, 8 m x 8 m.
const SIDE: usize = 40;
const HEIGHT: f32 = 3.0;

/// A window in the ceiling of two panes that touch, the second a triangle.
fn panes() -> [Vec<Vec3>; 2] {
    let at = |x: f32, z: f32| Vec3::new(x, HEIGHT, z);
    [
        vec![at(-1.0, -0.5), at(0.5, -0.5), at(0.5, 1.0), at(-1.0, 1.0)],
        vec![at(0.5, -0.5), at(2.0, 0.1), at(0.5, 1.0)],
    ]
}

/// Holes half-way up, with bars between them, before a part of the window and beyond its rim.
fn holes() -> Vec<Vec<Vec3>> {
    let hole = |i: usize| {
        let (x, z) = (0.4 * (i % 4) as f32 - 0.5, 0.5 * (i / 4) as f32 - 1.2);
        let at = |x: f32, z: f32| Vec3::new(x, 0.5 * HEIGHT, z);
        vec![at(x, z), at(x + 0.35, z), at(x + 0.35, z + 0.4), at(x, z + 0.4)]
    };
    (0..12).map(hole).collect()
}

/// A floor whose normals lean, of which a part `seen` of what the window sends arrives; vertex 7 is outside, under the
/// open sky.
fn floor(seen: f32, choice: Choice) -> Asset<'static> {
    let mut asset = Asset::new(Metadata::new("floor"));
    let v = SIDE * SIDE;
    let place = |i: usize| {
        let [x, z] = [i % SIDE, i / SIDE].map(|k| 8.0 * (k as f32 + 0.5) / SIDE as f32 - 4.0);
        Vec3::new(x, 0.0, z)
    };
    let normal = |i: usize| Vec3::new((i as f32).sin(), 1.5, (1.7 * i as f32).cos()).normalize();
    let triples = |f: &dyn Fn(usize) -> Vec3| Data::F32((0..v).flat_map(|i| f(i).to_array()).collect());
    asset.insert("mesh.position", &[v, 3], triples(&place));
    asset.insert("mesh.normal", &[v, 3], triples(&normal));
    asset.insert("mesh.albedo", &[v, 3], triples(&|_| Vec3::ONE));
    asset.insert("mesh.index", &[1, 3], Data::U32(Cow::Owned(vec![0, 1, 2])));
    asset.metadata.shells.push(crate::asset::Shell { name: "window".into(), ..Default::default() });
    let (mut encoder, mut store) =
        (Encoder::new(N, Encoding { tolerance: 0.002, choice }), RowStore::default());
    for i in 0..v {
        let mut footprint = Footprint::default();
        let eye = Eye { origin: place(i), normal: normal(i), n: N };
        match i {
            7 => footprint.add_hemisphere(&eye),
            _ => panes().iter().for_each(|p| footprint.add_polygon(&eye, 0, p)),
        }
        let mut row = vec![0.0; n_texels(N)];
        footprint.cells.iter().for_each(|cell| row[cell.texel] += seen * cell.worth);
        store.push(&encoder.encode(&row));
    }
    store.insert_into(&mut asset, "portal.0.direct", N).unwrap();
    let corners: Vec<f32> = panes().concat().iter().flat_map(|c| c.to_array()).collect();
    asset.insert("portal.0.corner", &[7, 3], Data::F32(Cow::Owned(corners)));
    asset.insert("portal.0.polygon", &[3], Data::U32(Cow::Owned(vec![0, 4, 7])));
    asset.insert("portal.0.open", &[1], Data::U32(Cow::Owned(vec![7])));
    asset
}

fn direct(asset: &Asset, material: Material, disc: &Cap, is_told: bool) -> Vec<f32> {
    let mut texels = vec![[0.0; 3]; n_texels(N)];
    project_light(&Light::new(Source::Cap(*disc)), N, &mut texels);
    let mut frame = PortalFrame::new(asset).unwrap();
    frame.set_material(0, material);
    let shell = Shell::new(N, &texels).unwrap();
    frame.set_shell_with_discs(0, shell, &[*disc][..usize::from(is_told)]).unwrap();
    let mut out = vec![[0.0; 3]; asset.n_vertices()];
    frame.direct(0, &mut out);
    out.into_iter().map(|e| e[1]).collect()
}

/// A frame under a disc, and the direct light of its vertices.
fn lit<'a>(asset: &'a Asset<'a>, disc: &Cap) -> (PortalFrame<'a>, Vec<[f32; 3]>) {
    let mut texels = vec![[0.0; 3]; n_texels(N)];
    project_light(&Light::new(Source::Cap(*disc)), N, &mut texels);
    let mut frame = PortalFrame::new(asset).unwrap();
    frame.set_shell_with_discs(0, Shell::new(N, &texels).unwrap(), &[*disc]).unwrap();
    let mut direct = vec![[0.0; 3]; asset.n_vertices()];
    frame.direct(0, &mut direct);
    (frame, direct)
}

/// By many points of the disc, each of which is in a pane or not.
fn truth(asset: &Asset, disc: &Cap, v: usize) -> f32 {
    match v {
        7 => outside(asset.normals()[v].into(), disc),
        _ => truth_at(asset.positions()[v].into(), asset.normals()[v].into(), disc),
    }
}

fn truth_at(p: Vec3, n: Vec3, disc: &Cap) -> f32 {
    by_points(n, disc, |d| is_in_pane(p, d))
}

fn is_in_pane(p: Vec3, d: Vec3) -> bool {
    let hit = p + d * ((HEIGHT - p.y) / d.y);
    let is_in = |pane: &Vec<Vec3>| {
        let side = |i: usize| (pane[(i + 1) % pane.len()] - pane[i]).cross(hit - pane[i]).y <= 0.0;
        (0..pane.len()).all(side)
    };
    d.y > 0.0 && panes().iter().any(is_in)
}

fn outside(n: Vec3, disc: &Cap) -> f32 {
    by_points(n, disc, |_| true)
}

fn by_points(n: Vec3, disc: &Cap, is_seen: impl Fn(Vec3) -> bool) -> f32 {
    let (s, t) = disc.axis.any_orthonormal_pair();
    const POINTS: usize = 2000;
    let point = |i: usize| {
        let (r, turn) = (((i as f32 + 0.5) / POINTS as f32).sqrt() * disc.radius, 2.399_963 * i as f32);
        let d = (disc.axis + r.tan() * (turn.cos() * s + turn.sin() * t)).normalize();
        if is_seen(d) { n.dot(d).max(0.0) } else { 0.0 }
    };
    (0..POINTS).map(point).sum::<f32>() / POINTS as f32 * disc.solid_angle() * disc.radiance.y
}

fn disc(radius: f32, turn: f32) -> Cap {
    let axis = Vec3::new(0.8 * turn.cos(), 1.0, 0.6 * turn.sin()).normalize();
    let power = 1.0 / (PI * radius * radius);
    Cap { axis, radius, radiance: Vec3::new(0.5, 1.0, 2.0) * power }
}

#[test]
fn disc_through_a_window_is_as_sharp_as_the_window() {
    for choice in [Choice::Smaller, Choice::Only(crate::sparse::Basis::Haar)] {
        let asset = floor(1.0, choice);
        for (i, radius) in [0.0047, 0.03, 0.1, 0.12].into_iter().enumerate() {
            let disc = disc(radius, 1.1 * i as f32);
            let found = direct(&asset, Material::CLEAR, &disc, true);
            let coarse = direct(&asset, Material::CLEAR, &disc, false);
            let (mut off, mut coarse_off, mut all) = (0.0, 0.0, 0.0);
            for v in 0..asset.n_vertices() {
                let expected = truth(&asset, &disc, v);
                // A disc of power 1: the rows' rounding at its edge, and 2000 points.
                assert!((found[v] - expected).abs() < 0.05, "{v}: {} {expected}, radius {radius}", found[v]);
                off += (found[v] - expected).abs();
                coarse_off += (coarse[v] - expected).abs();
                all += expected;
            }
            // Measured 0.002 to 0.2 %, most by the corners that stand for the disc; in texels 1.3 to 16 %.
            assert!(all > 10.0 && off < 0.004 * all && coarse_off > 5.0 * off, "{off} {coarse_off} of {all}");
        }
    }
}

/// As [`floor`], with the holes, through which as much light comes as through the window behind them.
fn floor_behind_holes() -> Asset<'static> {
    let mut asset = floor(1.0, Choice::Smaller);
    let mut store = RowStore::default();
    let mut encoder = Encoder::new(N, Encoding { tolerance: 0.002, choice: Choice::Smaller });
    for (p, n) in asset.positions().iter().zip(asset.normals()) {
        let eye = Eye { origin: Vec3::from(*p), normal: Vec3::from(*n), n: N };
        let mut row = vec![0.0; n_texels(N)];
        let mut add = |sign: f32, polygon: &[Vec3]| {
            let mut footprint = Footprint::default();
            footprint.add_polygon(&eye, 0, polygon);
            footprint.cells.iter().for_each(|cell| row[cell.texel] += sign * cell.worth);
        };
        panes().iter().for_each(|pane| add(1.0, pane));
        for (hole, pane) in holes().iter().flat_map(|hole| panes().map(|pane| (hole, pane))) {
            // Twice as far, in the window's plane, what both have in common.
            let shadow: Vec<Vec3> = hole.iter().map(|c| eye.origin + 2.0 * (*c - eye.origin)).collect();
            let (mut common, mut other) = (shadow.clone(), Vec::new());
            for k in 0..pane.len() {
                let (a, along) = (pane[k], pane[(k + 1) % pane.len()] - pane[k]);
                clip(&common, &mut other, |q| -along.cross(q - a).y);
                std::mem::swap(&mut common, &mut other);
            }
            add(-1.0, &common);
        }
        holes().iter().for_each(|hole| add(1.0, hole));
        row.iter_mut().for_each(|t| *t = t.max(0.0));
        store.push(&encoder.encode(&row));
    }
    store.insert_into(&mut asset, "portal.0.direct", N).unwrap();
    let corners: Vec<f32> =
        [panes().concat(), holes().concat()].concat().iter().flat_map(|c| c.to_array()).collect();
    let ends =
        [0, 4, 7].into_iter().chain((1..=holes().len() as u32).map(|i| 7 + 4 * i)).collect::<Vec<u32>>();
    asset.insert("portal.0.corner", &[corners.len() / 3, 3], Data::F32(Cow::Owned(corners)));
    asset.insert("portal.0.polygon", &[ends.len()], Data::U32(Cow::Owned(ends)));
    asset
}

#[test]
fn panes_in_a_row_count_once() {
    let asset = floor_behind_holes();
    let is_in_hole = |p: Vec3, d: Vec3| {
        let hit = p + d * ((0.5 * HEIGHT - p.y) / d.y);
        let side = |hole: &Vec<Vec3>, k: usize| (hole[(k + 1) % 4] - hole[k]).cross(hit - hole[k]).y <= 0.0;
        d.y > 0.0 && holes().iter().any(|hole| (0..4).all(|k| side(hole, k)))
    };
    for (i, radius) in [0.0047, 0.03, 0.1].into_iter().enumerate() {
        let disc = disc(radius, 1.1 * i as f32);
        let (frame, direct) = lit(&asset, &disc);
        let mut detail = Detail::new(&frame);
        let (mut off, mut all, mut between) = (0.0, 0.0, 0.0);
        for v in (0..SIDE * (SIDE - 1)).filter(|v| v % SIDE < SIDE - 1 && !(6..=7).contains(v)) {
            let truth = |p: Vec3, n: Vec3| by_points(n, &disc, |d| is_in_pane(p, d) || is_in_hole(p, d));
            let expected = truth(asset.positions()[v].into(), asset.normals()[v].into());
            assert!((direct[v][1] - expected).abs() < 0.05, "{v}: {} {expected}", direct[v][1]);
            off += (direct[v][1] - expected).abs();
            all += expected;
            let corners = [v, v + 1, v + SIDE].map(|v| v as u32);
            let point = Point { corners, weights: [0.5, 0.2, 0.3], radius: 0.0 };
            let [p, n, plain] = [asset.positions(), asset.normals(), &direct[..]].map(|of| point.mean(of));
            between += (plain.y + detail.at(&point)[1] - truth(p, n.normalize())).abs();
        }
        // Found 0.0013 at most; where panes count twice, single vertices are 0.2 off.
        assert!(all > 10.0 && off < 0.004 * all && between < 0.006 * all, "{off} {between} of {all}");
    }
}

#[test]
fn what_hides_a_part_of_the_window_hides_it_from_the_disc() {
    let (whole, half) = (floor(1.0, Choice::Smaller), floor(0.5, Choice::Smaller));
    let disc = disc(0.02, 0.4);
    let [whole, half] = [&whole, &half].map(|asset| direct(asset, Material::CLEAR, &disc, true));
    for (a, b) in whole.iter().zip(&half) {
        // Rounding of rows to 8 bits, in a disc of power 1.
        assert!((0.5 * a - b).abs() < 0.02, "{a} {b}");
    }
}

#[test]
fn glass_tints_a_disc_and_frosted_glass_spreads_it() {
    let asset = floor(1.0, Choice::Smaller);
    let disc = disc(0.02, 0.4);
    let clear = direct(&asset, Material::CLEAR, &disc, true);
    let tinted = direct(&asset, Material { tint: [1.0, 0.25, 0.5], frost: 0.0 }, &disc, true);
    assert!(clear.iter().zip(&tinted).all(|(a, b)| (0.25 * a - b).abs() < 1e-5));
    let frosted = Material { tint: [1.0; 3], frost: 0.2 };
    assert_eq!(direct(&asset, frosted, &disc, true), direct(&asset, frosted, &disc, false));
    assert!(direct(&asset, Material::CLOSED, &disc, true).iter().all(|e| *e == 0.0));
}

#[test]
fn broad_and_dark_discs_stay_in_their_texels() {
    let asset = floor(1.0, Choice::Smaller);
    let broad = disc(0.3, 0.0);
    assert_eq!(direct(&asset, Material::CLEAR, &broad, true), direct(&asset, Material::CLEAR, &broad, false));
    assert!(!Beam::suits(&Cap { radiance: Vec3::ZERO, ..disc(0.01, 0.0) }));
}

#[test]
fn broken_panes_are_named() {
    let break_it = |part: &str, data: Data<'static>| {
        let mut asset = floor(1.0, Choice::Only(crate::sparse::Basis::Pulse));
        asset.insert(&format!("portal.0.{part}"), &[data.len()], data);
        asset.to_bytes().unwrap_err().to_string()
    };
    let words = |list: &[u32]| Data::U32(Cow::Owned(list.to_vec()));
    let cases = [
        ("polygon", words(&[0, 2, 7])),
        ("polygon", words(&[0, 4, 9])),
        ("polygon", words(&[])),
        ("open", words(&[5, 3])),
        ("open", words(&[2000])),
        ("corner", words(&[0; 21])),
        ("corner", Data::F32(Cow::Owned(vec![0.0; 20]))),
        ("reveal", words(&[0; 28])),
        ("reveal", Data::F32(Cow::Owned(vec![0.1; 27]))),
        ("reveal", Data::F32(Cow::Owned(vec![0.1; 24]))),
        ("reveal", Data::F32(Cow::Owned(vec![-0.1; 28]))),
        ("reveal", Data::F32(Cow::Owned(vec![f32::NAN; 28]))),
    ];
    for (part, data) in cases {
        let error = break_it(part, data);
        assert!(error.contains(&format!("portal.0.{part}")), "{error}");
    }
}

#[test]
fn between_vertices_a_disc_is_as_sharp_as_at_them() {
    for (seen, choice) in [(1.0, Choice::Smaller), (0.5, Choice::Only(crate::sparse::Basis::Haar))] {
        let asset = floor(seen, choice);
        for (i, radius) in [0.0047, 0.03, 0.1].into_iter().enumerate() {
            let disc = disc(radius, 1.1 * i as f32);
            let (frame, direct) = lit(&asset, &disc);
            let mut detail = Detail::new(&frame);
            let (mut off, mut all) = (0.0, 0.0);
            for v in (0..SIDE * (SIDE - 1)).filter(|v| v % SIDE < SIDE - 1 && !(6..=7).contains(v)) {
                let corners = [v, v + 1, v + SIDE].map(|v| v as u32);
                let mut at = |weights: [f32; 3]| {
                    let more = detail.at(&Point { corners, weights, radius: 0.0 })[1];
                    let plain =
                        corners.iter().zip(weights).map(|(v, w)| w * direct[*v as usize][1]).sum::<f32>();
                    plain + more
                };
                let corner = at([1.0, 0.0, 0.0]);
                // Where all is seen in part, rows' rounding to 8 bits makes edges of different trust: power 1.
                assert!((corner - direct[v][1]).abs() < 0.02, "{v}: {corner} {}", direct[v][1]);
                let weights = [0.5, 0.2, 0.3];
                let mean = |of: &[[f32; 3]]| -> Vec3 {
                    corners.iter().zip(weights).map(|(v, w)| w * Vec3::from(of[*v as usize])).sum()
                };
                let (p, n) = (mean(asset.positions()), mean(asset.normals()).normalize());
                let expected = seen * truth_at(p, n, &disc);
                off += (at(weights) - expected).abs();
                all += expected;
            }
            // Found 0.00005 to 0.0035.
            assert!(all > 10.0 && off < 0.006 * all, "{off} of {all}");
        }
    }
}

#[test]
fn only_what_panes_in_a_row_have_in_common_is_cut_off() {
    // Round panes of forty corners, seen from the origin; the sides of one by its corners.
    let round = |x: f32, z: f32, radius: f32| -> Vec<Vec3> {
        let corner = |i: usize| {
            let (sine, cosine) = (std::f32::consts::TAU * i as f32 / 40.0).sin_cos();
            Vec3::new(x + radius * cosine, radius * sine, z)
        };
        (0..40).map(corner).collect()
    };
    let sides = |pane: &[Vec3]| -> Vec<Vec3> {
        let inwards = |side: Vec3| side * side.dot(pane[0] + pane[20]).signum();
        (0..40).map(|i| inwards(pane[i].cross(pane[(i + 1) % 40]))).collect()
    };
    let area = |part: &Vec<Vec3>| -> f32 {
        let to = |i: usize| part[i] - part[0];
        (2..part.len()).map(|i| 0.5 * to(i - 1).cross(to(i)).length()).sum()
    };
    let (pane, whole) = (round(0.0, 2.0, 1.0), area(&round(0.0, 2.0, 1.0)));
    // Beside it, behind the eye, and as far as its edge: nothing is cut.
    for other in [round(3.0, 2.0, 1.0), round(0.0, -2.0, 1.0), round(1.0, 1.0, 0.49)] {
        assert_eq!(without(Vec3::ZERO, &pane, &sides(&other)), std::slice::from_ref(&pane));
    }
    // A half as large at half the distance hides a quarter of it; asked again, it hides no more and cuts nothing.
    let other = sides(&round(0.0, 1.0, 0.25));
    let once = without(Vec3::ZERO, &pane, &other);
    let left = |parts: &[Vec<Vec3>]| parts.iter().map(area).sum::<f32>() / whole;
    assert!((left(&once) - 0.75).abs() < 1e-4, "{}", left(&once));
    let again: Vec<Vec<Vec3>> = once.iter().flat_map(|part| without(Vec3::ZERO, part, &other)).collect();
    assert!(again.len() == once.len() && (left(&again) - left(&once)).abs() < 1e-4, "{}", again.len());
    // As large as itself, and once more: nothing is left.
    assert!(without(Vec3::ZERO, &pane, &sides(&pane)).is_empty());
}
