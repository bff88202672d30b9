//! The panes of a window, parted by bars, made one polygon again.
//!
//! Bars block light by themselves; a portal over them is a few numbers that may be edited, and a bake parts it again
//! ([`parted`](super::parted)). Panes that lie nearly in one plane with no more than a bar between them become their convex
//! hull, where they fill half of it and more.

use glam::{Vec2, Vec3};

use super::rays::Rays;

/// Panes of one window face the same way: cosine of the largest angle, 15 degrees.
const ALIKE: f32 = 0.966;

/// Less of the hull than this share open is no window with bars.
const LEAST_OPEN: f32 = 0.5;

/// More of the hull than this share with glass, and the holes are those that coloured panes leave.
const MOST_GLAZED: f32 = 0.05;

/// Polygons with those that are no more than `widest_bar` metres apart joined, but not over glass that lies between
/// them.
pub(super) fn joined(mut polygons: Vec<Vec<Vec3>>, widest_bar: f32, rays: &Rays) -> Vec<Vec<Vec3>> {
    if widest_bar == 0.0 {
        return polygons;
    }
    // The largest first, so that windows grow from their panes and not from cracks.
    polygons.sort_by(|a, b| vector(b).length().total_cmp(&vector(a).length()));
    let mut windows = Vec::new();
    let mut left: Vec<Option<Vec<Vec3>>> = polygons.into_iter().map(Some).collect();
    for first in 0..left.len() {
        let Some(pane) = left[first].take() else { continue };
        let mut window = vec![pane];
        let mut at = 0;
        while at < window.len() {
            for other in &mut left {
                if let Some(pane) = other.take_if(|o| beside(&window[at], o, widest_bar)) {
                    window.push(pane);
                }
            }
            at += 1;
        }
        windows.extend(whole(window, widest_bar, rays));
    }
    windows
}

/// Twice the area, along the normal.
fn vector(polygon: &[Vec3]) -> Vec3 {
    let n = polygon.len();
    (0..n).map(|i| (polygon[i] - polygon[0]).cross(polygon[(i + 1) % n] - polygon[0])).sum()
}

fn beside(a: &[Vec3], b: &[Vec3], gap: f32) -> bool {
    let (n, m) = (vector(a).normalize_or_zero(), vector(b).normalize_or_zero());
    n.dot(m) > ALIKE && (b[0] - a[0]).dot(n).abs() < 2.0 * gap && distance(a, b) < gap
}

/// The smallest distance of a corner of one to an edge of the other.
fn distance(a: &[Vec3], b: &[Vec3]) -> f32 {
    let to_edges = |p: Vec3, polygon: &[Vec3]| {
        let n = polygon.len();
        let to_edge = |i: usize| {
            let (q, way) = (polygon[i], polygon[(i + 1) % n] - polygon[i]);
            let t = ((p - q).dot(way) / way.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            p.distance(q + t * way)
        };
        (0..n).map(to_edge).fold(f32::INFINITY, f32::min)
    };
    let of_a = a.iter().map(|p| to_edges(*p, b)).fold(f32::INFINITY, f32::min);
    b.iter().map(|p| to_edges(*p, a)).fold(of_a, f32::min)
}

/// One polygon around all panes, or the panes where they fill too little of it.
fn whole(panes: Vec<Vec<Vec3>>, reach: f32, rays: &Rays) -> Vec<Vec<Vec3>> {
    let total: Vec3 = panes.iter().map(|p| vector(p)).sum();
    let Some(normal) = total.try_normalize().filter(|_| panes.len() > 1) else { return panes };
    let (u, v) = axes(normal);
    let corners = panes.concat();
    let height = panes.iter().map(|p| p[0].dot(normal) * vector(p).length()).sum::<f32>()
        / panes.iter().map(|p| vector(p).length()).sum::<f32>();
    let flat: Vec<Vec2> = corners.iter().map(|c| Vec2::new(c.dot(u), c.dot(v))).collect();
    let hull: Vec<Vec3> = hull(flat).into_iter().map(|p| p.x * u + p.y * v + height * normal).collect();
    let is_window = total.length() >= LEAST_OPEN * vector(&hull).length();
    if is_window && glazed_share(&hull, reach * normal, rays) < MOST_GLAZED { vec![hull] } else { panes }
}

/// Of points in a convex polygon, how many have glass before or behind them.
fn glazed_share(polygon: &[Vec3], reach: Vec3, rays: &Rays) -> f32 {
    const N: usize = 12;
    let middle = polygon.iter().sum::<Vec3>() / polygon.len() as f32;
    let point = |i: usize| {
        // From the middle to a place on the border, evenly over the area.
        let (around, outwards) = ((i % N) as f32 / N as f32, ((i / N) as f32 + 0.5) / N as f32);
        let at = around * polygon.len() as f32;
        let (corner, next) = (at as usize, (at as usize + 1) % polygon.len());
        middle.lerp(polygon[corner].lerp(polygon[next], at.fract()), outwards.sqrt())
    };
    let glazed = (0..N * N).map(point).filter(|p| rays.meets_glass(*p - reach, *p + reach));
    glazed.count() as f32 / (N * N) as f32
}

/// Level and upright in the plane of this normal.
fn axes(normal: Vec3) -> (Vec3, Vec3) {
    let u = Vec3::Y.cross(normal).try_normalize().filter(|_| normal.y.abs() < 0.999).unwrap_or(Vec3::X);
    let u = u.reject_from_normalized(normal).normalize();
    (u, normal.cross(u))
}

/// Convex hull, counter-clockwise.
///
/// Based on: Andrew, Another Efficient Algorithm for Convex Hulls in Two Dimensions, 1979.
fn hull(mut points: Vec<Vec2>) -> Vec<Vec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let half = |points: &mut dyn Iterator<Item = Vec2>| {
        let mut chain: Vec<Vec2> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                if (b - a).perp_dot(p - b) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut ring = half(&mut points.iter().copied());
    ring.extend(half(&mut points.iter().rev().copied()));
    ring
}
