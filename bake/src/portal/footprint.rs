//! Which texels of a cubemap about a point a triangle covers, wholly or in part.
//!
//! The triangle is clipped to the pyramid of each face and projected; row by row, the clipped polygon's extent
//! gives the texels. No texel that the triangle touches is left out.

use glam::{Vec2, Vec3};
use lunette_relight::cubemap::face_axes;

/// Nearest that a clipped polygon comes to the eye, as a share of its own distance scale.
const NEAR: f32 = 1e-6;

/// Marks the texels of an `n` x `n` x 6 cubemap about `eye` that the triangle touches.
pub fn mark(triangle: &[Vec3; 3], eye: Vec3, n: usize, mut touch: impl FnMut(usize)) {
    let corners = triangle.map(|c| c - eye);
    let scale = corners.iter().map(|c| c.abs().max_element()).fold(0.0, f32::max);
    for face in 0..6 {
        let [axis, s, t] = face_axes(face);
        let mut polygon: Vec<Vec3> =
            corners.iter().map(|c| Vec3::new(c.dot(s), c.dot(t), c.dot(axis))).collect();
        let planes: [fn(Vec3) -> f32; 4] = [|p| p.z - p.x, |p| p.z + p.x, |p| p.z - p.y, |p| p.z + p.y];
        polygon = clip(&polygon, |p| p.z - NEAR * scale);
        for plane in planes {
            polygon = clip(&polygon, plane);
        }
        if polygon.len() < 3 {
            continue;
        }
        let half = 0.5 * n as f32;
        let flat: Vec<Vec2> = polygon.iter().map(|p| (Vec2::new(p.x, p.y) / p.z + 1.0) * half).collect();
        rows(&flat, n, |row, from, to| (from..=to).for_each(|column| touch((face * n + row) * n + column)));
    }
}

/// The part of a convex polygon where `inside` is not negative.
fn clip(polygon: &[Vec3], inside: impl Fn(Vec3) -> f32) -> Vec<Vec3> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (a, b) = (inside(p), inside(q));
        if a >= 0.0 {
            out.push(p);
        }
        if (a >= 0.0) != (b >= 0.0) {
            out.push(p + (q - p) * (a / (a - b)));
        }
    }
    out
}

/// Columns that a convex polygon touches in each row.
fn rows(polygon: &[Vec2], n: usize, mut span: impl FnMut(usize, usize, usize)) {
    let cell = |x: f32| (x.max(0.0) as usize).min(n - 1);
    let (low, high) = polygon.iter().fold((f32::MAX, f32::MIN), |(lo, hi), p| (lo.min(p.y), hi.max(p.y)));
    for row in cell(low)..=cell(high) {
        let (top, bottom) = (row as f32, (row + 1) as f32);
        let mut extent = (f32::MAX, f32::MIN);
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            // The edge's part within the row, by its parameter.
            let (a, b) = if p.y == q.y {
                (0.0, 1.0)
            } else {
                ((top - p.y) / (q.y - p.y), (bottom - p.y) / (q.y - p.y))
            };
            let (from, to) = (a.min(b).max(0.0), a.max(b).min(1.0));
            if from <= to && p.y.min(q.y) <= bottom && p.y.max(q.y) >= top {
                for x in [p.lerp(q, from).x, p.lerp(q, to).x] {
                    extent = (extent.0.min(x), extent.1.max(x));
                }
            }
        }
        if extent.0 <= extent.1 {
            span(row, cell(extent.0), cell(extent.1));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lunette_relight::cubemap;

    #[test]
    fn footprint_holds_every_texel_that_points_of_the_triangle_fall_into() {
        let triangles = [
            [Vec3::new(1.0, 0.2, 0.1), Vec3::new(1.0, 2.0, -0.4), Vec3::new(-0.7, 1.0, 1.5)],
            [Vec3::new(-1.0, -2.0, 3.0), Vec3::new(4.0, -2.0, 3.0), Vec3::new(0.0, -2.0, -5.0)],
            [Vec3::new(0.5, 0.5, 0.5), Vec3::new(0.5, 0.6, 0.5), Vec3::new(0.5, 0.5, 0.6)],
        ];
        for triangle in triangles {
            let mut marked = std::collections::BTreeSet::new();
            mark(&triangle, Vec3::ZERO, 16, |t| {
                marked.insert(t);
            });
            for i in 0..=200 {
                for j in 0..=200 - i {
                    let (u, v) = (i as f32 / 200.0, j as f32 / 200.0);
                    let p = triangle[0] * (1.0 - u - v) + triangle[1] * u + triangle[2] * v;
                    assert!(marked.contains(&cubemap::texel_of(16, p.normalize())), "{p}");
                }
            }
            assert!(marked.len() < 6 * 16 * 16);
        }
    }
}
