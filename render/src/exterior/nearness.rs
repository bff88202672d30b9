//! How near outside objects are: the two conditions under which a shell is the same for all of its portal.
//!
//! A shell is captured from the portal's centre; an object at the distance r from there is seen under a direction that is
//! wrong by up to `l / 2r` at the portal's far ends, l apart. An object inside the interior is not outside at all.
//!
//! Based on: Ericson, Real-Time Collision Detection, 2004, 5.1.5 (closest point of a triangle); Sutherland and Hodgman,
//! Reentrant Polygon Clipping, 1974.

use super::Exterior;
use glam::Vec3;
use rayon::prelude::*;

/// An outside object that reaches into a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// Which one.
    pub object: usize,
    /// Area of its surface inside the box, m².
    pub area: f32,
}

impl Exterior {
    /// The objects whose surfaces reach into a box, e.g. that of the interior, as they are posed now. A street that
    /// merely surrounds a car does not overlap it.
    pub fn overlaps(&self, low: Vec3, high: Vec3) -> Vec<Overlap> {
        let objects = self.objects.iter().enumerate();
        let areas = objects.map(|(object, mesh)| Overlap {
            object,
            area: mesh.triangles().map(|t| area_inside(t, low, high)).sum(),
        });
        areas.filter(|overlap| overlap.area > 0.0).collect()
    }

    /// Distance from a point, e.g. a portal's centre, to the nearest outside surface, as posed now, metres; infinite
    /// without any.
    pub fn nearest(&self, point: Vec3) -> f32 {
        let nearest = |t: [Vec3; 3]| closest_point(t, point).distance(point);
        let objects = self.objects.iter();
        let distances = objects.map(|o| o.triangles().map(nearest).reduce(|| f32::INFINITY, f32::min));
        distances.fold(f32::INFINITY, f32::min)
    }
}

/// Area of the part of a triangle inside a box, m².
fn area_inside(triangle: [Vec3; 3], low: Vec3, high: Vec3) -> f32 {
    let [a, b, c] = triangle;
    if a.max(b).max(c).cmplt(low).any() || a.min(b).min(c).cmpgt(high).any() {
        return 0.0;
    }
    let mut polygon = triangle.to_vec();
    for axis in 0..3 {
        polygon = clipped(&polygon, |p| p[axis] - low[axis]);
        polygon = clipped(&polygon, |p| high[axis] - p[axis]);
    }
    let fan = polygon.windows(2).skip(1).map(|e| (e[0] - polygon[0]).cross(e[1] - polygon[0]));
    0.5 * fan.sum::<Vec3>().length()
}

/// The part of a convex polygon where a linear function is not negative.
fn clipped(polygon: &[Vec3], height: impl Fn(Vec3) -> f32) -> Vec<Vec3> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (hp, hq) = (height(p), height(q));
        if hp >= 0.0 {
            out.push(p);
        }
        if (hp >= 0.0) != (hq >= 0.0) {
            out.push(p + (q - p) * (hp / (hp - hq)));
        }
    }
    out
}

/// The point of a triangle that is closest to `p`.
fn closest_point([a, b, c]: [Vec3; 3], p: Vec3) -> Vec3 {
    let n = (b - a).cross(c - a);
    let is_inside = |u: Vec3, v: Vec3| (v - u).cross(p - u).dot(n) >= 0.0;
    if n.length_squared() > 0.0 && is_inside(a, b) && is_inside(b, c) && is_inside(c, a) {
        return p - n * ((p - a).dot(n) / n.length_squared());
    }
    let on_edge = |u: Vec3, v: Vec3| {
        let along = v - u;
        let square = along.length_squared();
        let t = if square > 0.0 { ((p - u).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
        u + t * along
    };
    let edges = [on_edge(a, b), on_edge(b, c), on_edge(c, a)];
    edges.into_iter().min_by(|x, y| x.distance(p).total_cmp(&y.distance(p))).unwrap_or(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [Vec3; 3] = [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 2.0)];

    #[test]
    fn area_inside_a_box_matches_by_hand() {
        let inside = |low: [f32; 3], high: [f32; 3]| area_inside(TRIANGLE, low.into(), high.into());
        assert_eq!(inside([-1.0; 3], [3.0; 3]), 2.0);
        // A unit square's corner, and a slice beyond it.
        assert!((inside([-1.0; 3], [1.0, 1.0, 1.0]) - 1.0).abs() < 1e-6);
        assert!((inside([1.0, -1.0, -1.0], [3.0; 3]) - 0.5).abs() < 1e-6);
        assert_eq!(inside([-1.0, 0.1, -1.0], [3.0; 3]), 0.0);
        assert_eq!(inside([1.5, -1.0, 1.5], [3.0; 3]), 0.0);
    }

    #[test]
    fn closest_point_matches_a_fine_search() {
        let grid = |n: usize| (0..=n).flat_map(move |i| (0..=n - i).map(move |j| (i, j)));
        for p in [
            Vec3::new(0.3, 0.7, 0.4),
            Vec3::new(3.0, 0.2, -1.0),
            Vec3::new(-1.0, 0.5, 0.9),
            Vec3::new(2.0, -1.0, 2.0),
        ] {
            let point = |(i, j): (usize, usize)| Vec3::new(i as f32 / 100.0, 0.0, j as f32 / 100.0);
            let searched = grid(200).map(|ij| point(ij).distance(p)).fold(f32::INFINITY, f32::min);
            let found = closest_point(TRIANGLE, p);
            // The search is on a grid of 0.01 m.
            assert!((found.distance(p) - searched).abs() < 1e-4, "{p}: {found}");
            assert!(found.y == 0.0 || found.y.abs() < 1e-6);
        }
    }
}
