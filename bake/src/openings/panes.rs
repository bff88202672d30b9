//! See-through surfaces that are windows: the inside is on one side and the outside on the other.
//!
//! A thick pane, modelled as a box or as two sheets, is the portal of its inner face.
//!
//! Where it breaks: the tint of double glazing counts once; where the panes of a bent window are parted, their edges
//! are told apart from a thick pane's by votes.

use std::collections::BTreeMap;

use glam::Vec3;
use lunette_scenes::{Portal, Scene};

use super::cut::{CutLink, Side};
use super::outline::Space;
use super::rays::see_through;

/// Points of a pane that are asked: some may lie behind a curtain.
const MOST_POINTS: usize = 33;

/// Where the sides of a pane are looked at, in cells from it.
const NEAR: f32 = 0.05;

/// Triangles of one face of a thick pane: cosine of the largest angle, 60 degrees.
const SAME_FACE: f32 = 0.5;

/// Panes of one window: cosine of the largest angle between them, 15 degrees, and the farthest that one may lie off the
/// other's plane and beside it, metres.
const PARALLEL: f32 = 0.966;
const SAME_PLANE: f32 = 0.05;
const BESIDE: f32 = 0.5;

/// Thickest glazing, metres.
const GLAZING: f32 = 0.1;

/// Every pane of each see-through material that is a window, wound towards the inside.
pub(super) fn find(scene: &Scene, space: &Space, links: &[CutLink]) -> Vec<Portal> {
    if !links.iter().any(|l| l.through_glass) {
        return Vec::new();
    }
    let mesh = &scene.mesh;
    let mut of_material: BTreeMap<u32, Vec<[Vec3; 3]>> = BTreeMap::new();
    for (t, _) in see_through(scene).iter().enumerate().filter(|(_, glass)| **glass) {
        let corners = mesh.index[t].map(|v| mesh.position[v as usize]);
        of_material.entry(mesh.material[t]).or_default().push(corners);
    }
    let portal = |(material, triangles): (u32, Vec<[Vec3; 3]>)| {
        let material = &scene.materials[material as usize];
        Portal::new(&material.name, triangles, material.transmission)
    };
    let pieces = of_material.into_iter().filter_map(portal).flat_map(|glass| glass.windows());
    let judged: Vec<(Portal, Vec<Portal>)> = pieces
        .map(|piece| {
            let windows = windows(&piece, space);
            (piece, windows)
        })
        .collect();
    let sure: Vec<Portal> = judged.iter().flat_map(|(_, windows)| windows.clone()).collect();
    let windows = |(piece, windows): (Portal, Vec<Portal>)| match windows.is_empty() {
        true => continuing(piece, &sure).into_iter().collect(),
        false => windows,
    };
    innermost(judged.into_iter().flat_map(windows).collect())
}

/// A pane that is no window by its own sides, behind tracery or finer than the cells, but lies in the plane of one that
/// is, beside it.
fn continuing(mut pane: Portal, windows: &[Portal]) -> Option<Portal> {
    let (middle, reach) = (pane.centre(), pane.extent());
    let continues = |window: &&Portal| {
        let is_flat = |p: &Vec3| (*p - window.centre()).dot(window.normal).abs() < SAME_PLANE;
        middle.distance(window.centre()) < reach + window.extent() + BESIDE
            && pane.normal.dot(window.normal).abs() > PARALLEL
            && pane.triangles.iter().flatten().all(is_flat)
    };
    let window = windows.iter().find(continues)?;
    if pane.normal.dot(window.normal) < 0.0 {
        pane.flip();
    }
    Some(pane)
}

/// A piece of glass if it is a window, and of a thick pane its faces, all turned inside.
fn windows(glass: &Portal, space: &Space) -> Vec<Portal> {
    match turned_inside(glass.clone(), space) {
        Some(window) => vec![window],
        None => faces(glass).into_iter().filter_map(|face| turned_inside(face, space)).collect(),
    }
}

/// A piece of glass parted by where its triangles face.
fn faces(glass: &Portal) -> Vec<Portal> {
    let mut faces: Vec<(Vec3, Vec<[Vec3; 3]>)> = Vec::new();
    for &[a, b, c] in &glass.triangles {
        let normal = (b - a).cross(c - a).normalize_or_zero();
        match faces.iter_mut().find(|(facing, _)| facing.dot(normal) > SAME_FACE) {
            Some((_, triangles)) => triangles.push([a, b, c]),
            None => faces.push((normal, vec![[a, b, c]])),
        }
    }
    let portal = |(_, triangles)| Portal::new(&glass.name, triangles, glass.transmission);
    faces.into_iter().filter_map(portal).collect()
}

/// Of panes one right behind the other the inner one: light is to pass one portal only.
fn innermost(panes: Vec<Portal>) -> Vec<Portal> {
    let is_outer = |pane: &Portal| {
        let Some(&[a, b, c]) = pane.triangles.first() else { return true };
        let (middle, inwards) = ((a + b + c) / 3.0, (b - a).cross(c - a).normalize_or_zero());
        let others = panes.iter().filter(|other| !std::ptr::eq(*other, pane));
        let mut triangles = others.flat_map(|other| &other.triangles);
        triangles.any(|t| distance(middle, inwards, t).is_some_and(|d| d > 0.0 && d < GLAZING))
    };
    let is_outer: Vec<bool> = panes.iter().map(is_outer).collect();
    panes.into_iter().zip(is_outer).filter(|(_, outer)| !outer).map(|(pane, _)| pane).collect()
}

/// How far along a direction a triangle lies, if it is met.
fn distance(from: Vec3, direction: Vec3, [a, b, c]: &[Vec3; 3]) -> Option<f32> {
    let normal = (*b - *a).cross(*c - *a);
    let distance = (*a - from).dot(normal) / direction.dot(normal);
    let p = from + distance * direction;
    let is_left = |q: Vec3, r: Vec3| (r - q).cross(p - q).dot(normal) >= 0.0;
    (distance.is_finite() && is_left(*a, *b) && is_left(*b, *c) && is_left(*c, *a)).then_some(distance)
}

/// The pane if it is a window, turned if need be.
fn turned_inside(mut pane: Portal, space: &Space) -> Option<Portal> {
    let n = pane.triangles.len();
    let every = n.div_ceil(MOST_POINTS);
    let votes: Vec<i32> = pane.triangles.iter().step_by(every).map(|t| facing(t, space)).collect();
    let (inwards, outwards) =
        (votes.iter().filter(|v| **v > 0).count(), votes.iter().filter(|v| **v < 0).count());
    // Most points of a window, since some are hidden; those of a drinking glass have no outside, and the two faces of a
    // thick pane contradict each other.
    let (most, least) = (inwards.max(outwards), inwards.min(outwards));
    if 2 * most < votes.len() || 4 * least > most {
        return None;
    }
    if outwards > inwards {
        pane.flip();
    }
    Some(pane)
}

/// 1 where the triangle's front looks inside and its back outside, -1 the other way round, 0 if neither.
fn facing(t: &[Vec3; 3], space: &Space) -> i32 {
    let [a, b, c] = *t;
    let middle = (a + b + c) / 3.0;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let front = side(space, middle, normal);
    let back = side(space, middle, -normal);
    match (front, back) {
        (Side::Inside, Side::Outside) => 1,
        (Side::Outside, Side::Inside) => -1,
        _ => 0,
    }
}

/// The side of most cells that are in front of a pane and seen from it: past its other face, where nothing else is.
fn side(space: &Space, p: Vec3, normal: Vec3) -> Side {
    let near = side_seen(space, p, normal, |from, to| space.rays.empty(from, to));
    if near != Side::Neither {
        return near;
    }
    side_seen(space, p, normal, |from, to| space.rays.clear(from, to))
}

fn side_seen(space: &Space, p: Vec3, normal: Vec3, sees: impl Fn(Vec3, Vec3) -> bool) -> Side {
    let grid = space.grid;
    let from = p + NEAR * grid.size * normal;
    let (mut n_inside, mut n_outside) = (0, 0);
    for cell in grid.around(p + 0.5 * grid.size * normal) {
        let middle = grid.middle(cell);
        if (middle - from).dot(normal) <= 0.0 || !sees(from, middle) {
            continue;
        }
        match space.sides[cell] {
            Side::Inside => n_inside += 1,
            Side::Outside => n_outside += 1,
            Side::Neither => {}
        }
    }
    match (n_inside, n_outside) {
        (0, 0) => Side::Neither,
        (i, o) if i > o => Side::Inside,
        _ => Side::Outside,
    }
}
