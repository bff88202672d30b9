//! Panes that lie in the place of others: glass modelled from both sides, or listed twice.
//!
//! Light would enter through each of them. A triangle that others before it cover is left out; one that they cover in part
//! is an error, since which of them is meant is not for us to decide. Panes one behind the other, as of a double glazing, are
//! no such: of those a ray counts the nearest.

use glam::Vec3;

use super::split::{Triangles, clipped};
use super::{Portal, area};
use crate::repair;
use crate::scene::Error;

/// Panes lie in one plane within this part of their size, and their normals within this angle, radians.
const SAME_PLANE: f32 = 1e-4;

/// Less than this part of a triangle is let pass: corners are rounded, and frames are drawn by hand.
const LEAST_PART: f64 = 0.01;

struct Pane<'a> {
    corners: &'a [Vec3; 3],
    portal: usize,
    /// Along the axis by which panes are sorted.
    low: f32,
    high: f32,
}

/// Portals without the triangles that lie on others, and how many those were.
///
/// # Errors
/// [`Error::Invalid`] where a triangle lies in part on others, or nothing is left of a portal; it says where.
pub fn without_doubled(portals: &[Portal]) -> Result<(Vec<Portal>, usize), Error> {
    let corners = || portals.iter().flat_map(|p| p.triangles.iter().flatten());
    let low = corners().fold(Vec3::INFINITY, |a, p| a.min(*p));
    let high = corners().fold(Vec3::NEG_INFINITY, |a, p| a.max(*p));
    let axis = (high - low).max_position();
    let panes: Vec<Pane> = (portals.iter().enumerate())
        .flat_map(|(portal, p)| p.triangles.iter().map(move |corners| (portal, corners)))
        .map(|(portal, corners)| {
            let [a, b, c] = corners.map(|p| p[axis]);
            Pane { corners, portal, low: a.min(b).min(c), high: a.max(b).max(c) }
        })
        .collect();
    let mut sorted: Vec<usize> = (0..panes.len()).collect();
    sorted.sort_by(|&i, &j| panes[i].low.total_cmp(&panes[j].low));
    // Of each pane those before it in the list that it lies on, and how much of it.
    let mut on: Vec<Vec<(usize, f64)>> = vec![Vec::new(); panes.len()];
    for (k, &i) in sorted.iter().enumerate() {
        for &j in sorted[k + 1..].iter().take_while(|&&j| panes[j].low < panes[i].high) {
            let common = common_area(panes[i].corners, panes[j].corners);
            if common > 0.0 {
                on[i.max(j)].push((i.min(j), common));
            }
        }
    }
    let mut is_kept = vec![true; panes.len()];
    for (i, pane) in panes.iter().enumerate() {
        let covered = on[i].iter().filter(|(j, _)| is_kept[*j]).map(|(_, common)| common).sum::<f64>();
        let part = covered / area(pane.corners);
        is_kept[i] = part < LEAST_PART;
        if (LEAST_PART..1.0 - LEAST_PART).contains(&part) {
            let other =
                on[i].iter().find(|(j, _)| is_kept[*j]).map_or(pane.portal, |(j, _)| panes[*j].portal);
            return Err(overlapping(portals, pane, other, covered));
        }
    }
    let mut kept = is_kept.iter();
    let mut parted = Vec::with_capacity(portals.len());
    for portal in portals {
        let left = portal.triangles.iter().filter(|_| kept.next() == Some(&true)).copied().collect();
        parted.push(Portal::new(&portal.name, left, portal.transmission).ok_or_else(|| hidden(portal))?);
    }
    Ok((parted, is_kept.iter().filter(|kept| !**kept).count()))
}

/// What triangles in one plane have in common, m².
fn common_area(a: &[Vec3; 3], b: &[Vec3; 3]) -> f64 {
    let [across, other] = [a, b].map(|t| repair::cross(*t).as_vec3().normalize_or_zero());
    let size = area(a).max(area(b)).sqrt() as f32;
    let is_level = |p: &Vec3| (*p - a[0]).dot(across).abs() <= SAME_PLANE * size;
    if across.cross(other).length() > SAME_PLANE || !b.iter().all(is_level) {
        return 0.0;
    }
    let mut left: Triangles = vec![*b];
    for (from, to) in [(a[0], a[1]), (a[1], a[2]), (a[2], a[0])] {
        let inwards = across.cross(to - from);
        left = left.iter().flat_map(|t| clipped(t, |p| (p - from).dot(inwards))).collect();
    }
    left.iter().map(area).sum()
}

fn overlapping(portals: &[Portal], pane: &Pane, other: usize, covered: f64) -> Error {
    let middle = pane.corners.iter().sum::<Vec3>() / 3.0;
    invalid(format!(
        "a pane of '{}' near {:.2}, {:.2}, {:.2} lies with {covered:.2} m² on one of '{}', where light would enter twice; \
         let them only touch",
        portals[pane.portal].name, middle.x, middle.y, middle.z, portals[other].name
    ))
}

fn hidden(portal: &Portal) -> Error {
    invalid(format!(
        "all of '{}' lies on other portals, through which its light enters; leave it out",
        portal.name
    ))
}

fn invalid(what: String) -> Error {
    Error::Invalid { at: "portals".into(), what }
}
