//! What of an opening is seen through each texel of a cubemap about a point, and what it is worth.
//!
//! A convex polygon is cut by the horizon of the point's normal n, by the pyramid of each face, and by the texels. A
//! piece, in a face's plane coordinates (x, y), has the exact cosine-weighted solid angle
//!
//! F = ∫ max(n·ω, 0) dω = ½ |Σ over edges θ (n · γ)|,
//!
//! θ being the angle that an edge subtends and γ the unit normal of the plane through it and the point.
//!
//! Based on: J. H. Lambert, Photometria, 1760; I. Sutherland and G. Hodgman, Reentrant Polygon Clipping, 1974.

use glam::{DVec3, Vec2, Vec3};

use super::{face_axes, flat};

/// Nearest that a clipped polygon comes to the eye, as a share of its own distance scale.
const NEAR: f32 = 1e-6;

/// Pieces worth less than this, sr, are dropped: what rounding leaves along a texel's border.
const LEAST: f32 = 1e-10;

/// Square of a tangent from which on its angle is no longer looked for by a series.
const SMALL: f64 = 0.02;

/// A part of one opening within one texel.
#[derive(Clone, Copy, Debug)]
pub struct Cell {
    /// Of the cubemap.
    pub texel: usize,
    /// As it was numbered.
    pub polygon: usize,
    /// Exact cosine-weighted solid angle, sr.
    pub worth: f32,
    start: usize,
    end: usize,
}

/// The cells about one point; reused from point to point.
#[derive(Clone, Debug, Default)]
pub struct Footprint {
    /// In the order in which they were added.
    pub cells: Vec<Cell>,
    points: Vec<Vec2>,
    /// Where clipping goes on.
    solid: [Vec<Vec3>; 2],
    flat: [Vec<Vec2>; 2],
    band: Vec<Vec2>,
}

/// The point that looks, and the resolution.
#[derive(Clone, Copy, Debug)]
pub struct Eye {
    /// Metres.
    pub origin: Vec3,
    /// Of unit length.
    pub normal: Vec3,
    /// Texels on a side of a face.
    pub n: usize,
}

impl Footprint {
    /// Forgets all cells.
    pub fn clear(&mut self) {
        self.cells.clear();
        self.points.clear();
    }

    /// Adds the cells of a convex polygon.
    pub fn add_polygon(&mut self, eye: &Eye, number: usize, polygon: &[Vec3]) {
        let heights = || polygon.iter().map(|c| (*c - eye.origin).dot(eye.normal));
        if heights().all(|h| h <= 0.0) {
            return;
        }
        let is_cut = heights().any(|h| h < 0.0);
        let scale = polygon.iter().map(|c| (*c - eye.origin).abs().max_element()).fold(0.0, f32::max);
        for face in 0..6 {
            let [axis, s, t] = face_axes(face);
            let local = |d: Vec3| Vec3::new(d.dot(s), d.dot(t), d.dot(axis));
            let [from, to] = &mut self.solid;
            from.clear();
            from.extend(polygon.iter().map(|c| local(*c - eye.origin)));
            let planes: [fn(Vec3) -> f32; 4] = [|p| p.z - p.x, |p| p.z + p.x, |p| p.z - p.y, |p| p.z + p.y];
            if planes.iter().any(|plane| from.iter().all(|p| plane(*p) <= 0.0)) {
                continue;
            }
            if is_cut {
                let normal = local(eye.normal);
                clip(from, to, |p| p.dot(normal));
                std::mem::swap(from, to);
            }
            clip(from, to, |p| p.z - NEAR * scale);
            for plane in planes {
                std::mem::swap(from, to);
                clip(from, to, plane);
            }
            let flat = &mut self.flat[0];
            flat.clear();
            flat.extend(self.solid[1].iter().map(|p| Vec2::new(p.x, p.y) / p.z));
            self.cut(eye, number, face);
        }
    }

    /// Adds all texels above the horizon.
    pub fn add_hemisphere(&mut self, eye: &Eye) {
        for face in 0..6 {
            let normal = flat(face_axes(face), eye.normal);
            let [from, to] = &mut self.flat;
            from.clear();
            from.extend([Vec2::new(-1.0, -1.0), Vec2::new(1.0, -1.0), Vec2::ONE, Vec2::new(-1.0, 1.0)]);
            clip(from, to, |p| normal.dot(p.extend(1.0)));
            std::mem::swap(from, to);
            self.cut(eye, 0, face);
        }
    }

    /// Cuts the face's polygon, flat\[0\], into texels.
    fn cut(&mut self, eye: &Eye, number: usize, face: usize) {
        let n = eye.n;
        if self.flat[0].len() < 3 {
            return;
        }
        let [axis, s, t] = face_axes(face);
        let normal = Vec3::new(eye.normal.dot(s), eye.normal.dot(t), eye.normal.dot(axis)).as_dvec3();
        let line = |i: usize| 2.0 * i as f32 / n as f32 - 1.0;
        let cell = |x: f32| ((x + 1.0) * 0.5 * n as f32).clamp(0.0, (n - 1) as f32) as usize;
        let [whole, part] = &mut self.flat;
        let extent = |list: &[Vec2], axis: usize| {
            list.iter().fold((f32::MAX, f32::MIN), |(lo, hi), p| (lo.min(p[axis]), hi.max(p[axis])))
        };
        let (low, high) = extent(whole, 1);
        for row in cell(low)..=cell(high) {
            clip(whole, part, |p| p.y - line(row));
            clip(part, &mut self.band, |p| line(row + 1) - p.y);
            let (left, right) = extent(&self.band, 0);
            if self.band.len() < 3 {
                continue;
            }
            let columns = cell(left)..=cell(right);
            let is_alone = columns.start() == columns.end();
            for column in columns {
                let start = self.points.len();
                if is_alone {
                    self.points.extend(&self.band);
                } else {
                    clip(&self.band, part, |p| p.x - line(column));
                    clip_onto(part, &mut self.points, |p| line(column + 1) - p.x);
                }
                let worth = worth(&self.points[start..], normal);
                if worth < LEAST {
                    self.points.truncate(start);
                    continue;
                }
                let texel = (face * n + row) * n + column;
                self.cells.push(Cell { texel, polygon: number, worth, start, end: self.points.len() });
            }
        }
    }

    /// Corners of a cell on its face, -1..=1 along columns and rows.
    pub fn points(&self, cell: &Cell) -> &[Vec2] {
        &self.points[cell.start..cell.end]
    }

    /// A direction within a cell, u uniform over 0..1 each, and its weight: the mean over many of weight times a
    /// function's value, over the mean weight, is the function's cosine-weighted mean over the cell.
    pub fn sample(&self, eye: &Eye, cell: &Cell, u: Vec2) -> (Vec3, f32) {
        let p = within(self.points(cell), u);
        let [axis, s, t] = face_axes(cell.texel / (eye.n * eye.n));
        let d = axis + p.x * s + p.y * t;
        let square = d.length_squared();
        (d / square.sqrt(), eye.normal.dot(d).max(0.0) / (square * square))
    }
}

/// The part of a convex polygon where `inside` is not negative.
pub(crate) fn clip<P: Point>(polygon: &[P], out: &mut Vec<P>, inside: impl Fn(P) -> f32) {
    out.clear();
    clip_onto(polygon, out, inside);
}

/// As [`clip`], after what is there already.
fn clip_onto<P: Point>(polygon: &[P], out: &mut Vec<P>, inside: impl Fn(P) -> f32) {
    clip_each(polygon, inside, |p| out.push(p));
}

/// Calls `push` with the corners of what [`clip`] leaves.
#[inline]
pub(crate) fn clip_each<P: Point>(polygon: &[P], inside: impl Fn(P) -> f32, mut push: impl FnMut(P)) {
    let Some(&last) = polygon.last() else { return };
    let mut previous = (last, inside(last));
    for &q in polygon {
        let (p, a) = previous;
        let b = inside(q);
        if (a >= 0.0) != (b >= 0.0) {
            push(p.towards(q, a / (a - b)));
        }
        if b >= 0.0 {
            push(q);
        }
        previous = (q, b);
    }
}

/// A point of the plane or of space.
pub(crate) trait Point: Copy {
    fn towards(self, other: Self, share: f32) -> Self;
}

impl Point for Vec2 {
    fn towards(self, other: Vec2, share: f32) -> Vec2 {
        self + (other - self) * share
    }
}

impl Point for Vec3 {
    fn towards(self, other: Vec3, share: f32) -> Vec3 {
        self + (other - self) * share
    }
}

/// Lambert's formula for a polygon in a face's plane at distance 1, sr.
fn worth(polygon: &[Vec2], normal: DVec3) -> f32 {
    normal.dot(vector_area(polygon)).abs() as f32
}

/// ± ∫ ω dω over a polygon in a face's plane at distance 1, in the face's coordinates.
pub(crate) fn vector_area(polygon: &[Vec2]) -> DVec3 {
    let corner = |p: Vec2| p.extend(1.0).as_dvec3();
    let mut sum = DVec3::ZERO;
    let Some(last) = polygon.last() else { return sum };
    let mut p = corner(*last);
    for q in polygon {
        let q = corner(*q);
        let cross = p.cross(q);
        sum += cross * angle_by_cross(cross.length_squared(), p.dot(q));
        p = q;
    }
    0.5 * sum
}

/// The angle of two vectors over the length of their cross product, by its square and their dot product; 0 where they are
/// opposite.
fn angle_by_cross(square: f64, dot: f64) -> f64 {
    // Within texels angles are small: atan(x) / x by its series, to 1e-10.
    let x2 = square / (dot * dot);
    if x2 < SMALL && dot > 0.0 {
        return (1.0 - x2 * (1.0 / 3.0 - x2 * (1.0 / 5.0 - x2 * (1.0 / 7.0 - x2 / 9.0)))) / dot;
    }
    let sine = square.sqrt();
    if sine > 0.0 { sine.atan2(dot) / sine } else { 0.0 }
}

/// A uniform point of a convex polygon: as it is in a rectangle along the axes, which most texels are; else a triangle of
/// its fan by area, then a point of that.
fn within(polygon: &[Vec2], u: Vec2) -> Vec2 {
    if let [a, b, c, d] = *polygon {
        let (is_flat, is_steep) = (a.y == b.y && c.y == d.y, a.x == b.x && c.x == d.x);
        if (is_flat && b.x == c.x && d.x == a.x) || (is_steep && b.y == c.y && d.y == a.y) {
            return a + (c - a) * u;
        }
    }
    let area = |i: usize| (polygon[i] - polygon[0]).perp_dot(polygon[i + 1] - polygon[0]).abs();
    let total: f32 = (1..polygon.len() - 1).map(area).sum();
    let mut at = u.x * total;
    let mut i = 1;
    while i + 2 < polygon.len() && at >= area(i) {
        at -= area(i);
        i += 1;
    }
    let root = (at / area(i).max(f32::MIN_POSITIVE)).clamp(0.0, 1.0).sqrt();
    let (a, b, c) = (polygon[0], polygon[i], polygon[i + 1]);
    a + root * ((b - a) * (1.0 - u.y) + (c - a) * u.y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cubemap;

    const TRIANGLES: [[Vec3; 3]; 3] = [
        [Vec3::new(1.0, 0.2, 0.1), Vec3::new(1.0, 2.0, -0.4), Vec3::new(-0.7, 1.0, 1.5)],
        [Vec3::new(-1.0, -2.0, 3.0), Vec3::new(4.0, -2.0, 3.0), Vec3::new(0.0, -2.0, -5.0)],
        [Vec3::new(0.5, 0.5, 0.5), Vec3::new(0.5, 0.6, 0.5), Vec3::new(0.5, 0.5, 0.6)],
    ];

    fn seen(triangle: &[Vec3], normal: Vec3, n: usize) -> Footprint {
        let mut footprint = Footprint::default();
        footprint.add_polygon(&Eye { origin: Vec3::ZERO, normal, n }, 0, triangle);
        footprint
    }

    #[test]
    fn footprint_holds_every_texel_that_points_of_the_triangle_fall_into() {
        for triangle in TRIANGLES {
            let normal = Vec3::new(0.2, -0.3, 0.6).normalize();
            let marked: Vec<usize> = seen(&triangle, normal, 16).cells.iter().map(|c| c.texel).collect();
            for i in 0..=200 {
                for j in 0..=200 - i {
                    let (u, v) = (i as f32 / 200.0, j as f32 / 200.0);
                    let p = triangle[0] * (1.0 - u - v) + triangle[1] * u + triangle[2] * v;
                    // Points on a border may fall either way.
                    let is_inner = i > 0 && j > 0 && i + j < 200 && normal.dot(p) > 1e-3;
                    assert!(!is_inner || marked.contains(&cubemap::texel_of(16, p.normalize())), "{p}");
                }
            }
        }
    }

    #[test]
    fn worths_add_up_to_lamberts_formula_for_the_whole() {
        let normal = Vec3::new(0.3, 0.8, 0.4).normalize();
        for triangle in TRIANGLES {
            let [one, many] = [1, 32].map(|n| seen(&triangle, normal, n));
            let sum = |f: &Footprint| f.cells.iter().map(|c| f64::from(c.worth)).sum::<f64>();
            // f32 corners of a thousand pieces.
            assert!((sum(&one) - sum(&many)).abs() < 1e-5, "{} {}", sum(&one), sum(&many));
        }
    }

    #[test]
    fn angles_by_series_are_those_by_their_tangent() {
        for i in 0..4000 {
            let angle = f64::from(i) * 1e-3 * std::f64::consts::FRAC_PI_4;
            let (sine, cosine) = angle.sin_cos();
            let expected = if i > 0 { angle / sine } else { 1.0 };
            let found = angle_by_cross(sine * sine, cosine);
            // What the series leaves out is x^10 / 11, 3e-10 at its end.
            assert!((found - expected).abs() < 4e-10 * expected, "{angle}: {found} {expected}");
        }
        assert_eq!(angle_by_cross(0.0, -1.0), 0.0);
    }

    #[test]
    fn hemisphere_is_worth_pi() {
        for normal in [Vec3::Y, Vec3::new(0.5, -0.6, 0.2).normalize()] {
            let mut footprint = Footprint::default();
            footprint.add_hemisphere(&Eye { origin: Vec3::ZERO, normal, n: 32 });
            let sum: f64 = footprint.cells.iter().map(|c| f64::from(c.worth)).sum();
            assert!((sum - std::f64::consts::PI).abs() < 1e-4, "{sum}");
        }
    }

    #[test]
    fn samples_lie_in_their_texel_and_carry_the_cosine() {
        let eye = Eye { origin: Vec3::ZERO, normal: Vec3::new(0.3, 0.8, 0.4).normalize(), n: 8 };
        let footprint = seen(&TRIANGLES[0], eye.normal, eye.n);
        for cell in &footprint.cells {
            // The mean of a linear function, weighted, against its closed form by the weights alone: here only that
            // samples stay inside, and that the weights' mean times the area is the worth.
            let points = footprint.points(cell);
            let area: f32 = (1..points.len() - 1)
                .map(|i| 0.5 * (points[i] - points[0]).perp_dot(points[i + 1] - points[0]))
                .sum();
            let n = 4096;
            let mut mean = 0.0;
            for j in 0..n {
                let u = Vec2::new((j as f32 + 0.5) / n as f32, (j as f32 * 0.618_034).fract());
                let (d, weight) = footprint.sample(&eye, cell, u);
                let inside = cubemap::texel_of(8, d * (1.0 + 1e-6));
                assert!(inside == cell.texel || is_near(&d, cell.texel), "{d}");
                mean += weight / n as f32;
            }
            // A low-discrepancy mean over a smooth weight.
            assert!(
                (mean * area.abs() - cell.worth).abs() < 2e-3 * cell.worth.max(1e-4),
                "{mean} {area} {cell:?}"
            );
        }
    }

    /// Whether a direction lies on the border of a texel, to rounding.
    fn is_near(d: &Vec3, texel: usize) -> bool {
        [Vec3::X, Vec3::Y, Vec3::Z]
            .iter()
            .any(|axis| [1e-5, -1e-5].iter().any(|e| cubemap::texel_of(8, *d + *axis * *e) == texel))
    }
}
