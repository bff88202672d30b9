//! See-through surfaces that are windows: the inside is on one side and the outside on the other.

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
    let panes = of_material.into_iter().filter_map(portal).flat_map(|p| p.windows());
    panes.filter_map(|pane| turned_inside(pane, space)).collect()
}

/// The pane if it is a window, turned if need be.
fn turned_inside(mut pane: Portal, space: &Space) -> Option<Portal> {
    let n = pane.triangles.len();
    let every = n.div_ceil(MOST_POINTS);
    let votes: Vec<i32> = pane.triangles.iter().step_by(every).map(|t| facing(t, space)).collect();
    let (inwards, outwards) =
        (votes.iter().filter(|v| **v > 0).count(), votes.iter().filter(|v| **v < 0).count());
    // Most points of a window, since some are hidden; those of a drinking glass have no outside.
    if 2 * inwards.max(outwards) < votes.len() {
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

/// The side of most cells that are in front of a pane and seen from it.
fn side(space: &Space, p: Vec3, normal: Vec3) -> Side {
    let grid = space.grid;
    let from = p + NEAR * grid.size * normal;
    let (mut n_inside, mut n_outside) = (0, 0);
    for cell in grid.around(p + 0.5 * grid.size * normal) {
        let middle = grid.middle(cell);
        if (middle - from).dot(normal) <= 0.0 || !space.rays.empty(from, middle) {
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
