//! Polygons cut into triangles.
//!
//! Convex polygons become a fan around their first corner, as most programs cut them; others are cut ear by ear
//! in the plane of their mean normal, so that the area comes out right for concave ones too.
//!
//! Based on: Newell's normal (Sutherland, Sproull & Schumacker, A Characterization of Ten Hidden-Surface
//! Algorithms, 1974); Meisters, Polygons Have Ears, 1975;
//! S. Hertel, K. Mehlhorn, Fast Triangulation of Simple Polygons, 1983 (convex parts from triangles).
//!
//! A polygon that crosses itself has no right answer: what cannot be cut as ears becomes a fan.

use glam::{DVec2, DVec3, Vec3};

/// Concave polygons with more corners than this are cut as a fan: ears take time with the square of the corners,
/// and 4096 of them take some 10 ms.
const MAX_EAR_CORNERS: usize = 4096;

/// Convex parts are no longer joined where there are more than this: that takes time with their square.
const MOST_PARTS: usize = 256;

/// Turns flatter than this (twice the area over the squared size) count as straight: a few units in the last place
/// of a f32 position.
const STRAIGHT: f64 = 1e-9;

/// Cuts the polygon with these corners; triangles are positions in `corner`, wound as the polygon is.
pub(crate) fn triangulate(corner: &[Vec3], out: &mut Vec<[usize; 3]>) {
    out.clear();
    if corner.len() <= 3 {
        out.extend((corner.len() == 3).then_some([0, 1, 2]));
        return;
    }
    let flat = flatten(corner);
    let all: Vec<usize> = (0..corner.len()).collect();
    if turns_one_way(&flat, &all) || corner.len() > MAX_EAR_CORNERS {
        fan(&all, out);
    } else {
        clip_ears(&flat, all, out);
    }
}

/// Whether it is convex.
pub(crate) fn is_convex(corner: &[Vec3]) -> bool {
    let all: Vec<usize> = (0..corner.len()).collect();
    corner.len() >= 3 && turns_one_way(&flatten(corner), &all)
}

/// Cuts the polygon into convex ones, few though not the fewest: positions in `corner`, wound as the polygon is.
pub(crate) fn convex_parts(corner: &[Vec3]) -> Vec<Vec<usize>> {
    let all: Vec<usize> = (0..corner.len()).collect();
    let flat = flatten(corner);
    if corner.len() == 3 || turns_one_way(&flat, &all) {
        return vec![all];
    }
    let mut triangles = Vec::new();
    triangulate(corner, &mut triangles);
    let mut parts: Vec<Vec<usize>> = Vec::new();
    for triangle in triangles {
        let mut part = triangle.to_vec();
        // What it makes convex together with it may do so with others again.
        while let Some((i, joined)) = joined_to_one(&flat, &parts, &part) {
            parts.swap_remove(i);
            part = joined;
        }
        parts.push(part);
    }
    parts
}

/// The first part that shares an edge with a ring and is convex together with it, and the two as one.
fn joined_to_one(flat: &[DVec2], parts: &[Vec<usize>], ring: &[usize]) -> Option<(usize, Vec<usize>)> {
    if parts.len() > MOST_PARTS {
        return None;
    }
    parts.iter().enumerate().find_map(|(i, part)| {
        let joined = joined(part, ring)?;
        turns_one_way(flat, &joined).then_some((i, joined))
    })
}

/// Two rings without the edge between them, if there is one.
fn joined(a: &[usize], b: &[usize]) -> Option<Vec<usize>> {
    let edge = |ring: &[usize], i: usize| (ring[i], ring[(i + 1) % ring.len()]);
    let shares = |i: usize| {
        let (from, to) = edge(a, i);
        (0..b.len()).find(|&j| edge(b, j) == (to, from)).map(|j| (i, j))
    };
    let (i, j) = (0..a.len()).find_map(shares)?;
    // All of a, from the edge's end around to its start, and then what of b is not on the edge.
    let around = (1..=a.len()).map(|k| a[(i + k) % a.len()]);
    Some(around.chain((2..b.len()).map(|k| b[(j + k) % b.len()])).collect())
}

fn turns_one_way(flat: &[DVec2], ring: &[usize]) -> bool {
    (0..ring.len()).all(|i| turn(flat, ring, i) > STRAIGHT)
}

/// The polygon seen against its mean normal, counter-clockwise, shrunk to unit size.
fn flatten(corner: &[Vec3]) -> Vec<DVec2> {
    let origin = corner[0].as_dvec3();
    let p: Vec<DVec3> = corner.iter().map(|c| c.as_dvec3() - origin).collect();
    let size = p.iter().map(|q| q.abs().max_element()).fold(f64::MIN_POSITIVE, f64::max);
    let normal: DVec3 = (0..p.len()).map(|i| p[i].cross(p[(i + 1) % p.len()])).sum();
    let (u, v) = normal.try_normalize().unwrap_or(DVec3::Z).any_orthonormal_pair();
    p.iter().map(|q| DVec2::new(q.dot(u), q.dot(v)) / size).collect()
}

/// Twice the signed area of the triangle at place `i` of the remaining ring.
fn turn(flat: &[DVec2], ring: &[usize], i: usize) -> f64 {
    let [a, b, c] = neighbours(ring, i).map(|k| flat[k]);
    (b - a).perp_dot(c - b)
}

fn neighbours(ring: &[usize], i: usize) -> [usize; 3] {
    let n = ring.len();
    [ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]]
}

fn fan(ring: &[usize], out: &mut Vec<[usize; 3]>) {
    out.extend((2..ring.len()).map(|i| [ring[0], ring[i - 1], ring[i]]));
}

fn clip_ears(flat: &[DVec2], mut ring: Vec<usize>, out: &mut Vec<[usize; 3]>) {
    let mut start = 0;
    while ring.len() > 3 {
        let n = ring.len();
        let Some(i) = (0..n).map(|k| (start + k) % n).find(|&i| is_ear(flat, &ring, i)) else { break };
        out.push(neighbours(&ring, i));
        ring.remove(i);
        start = i;
    }
    fan(&ring, out);
}

/// Turns left, and no other corner of the ring lies in the triangle. A corner in the same place as one of the three
/// (a bridge to a hole) does not count.
fn is_ear(flat: &[DVec2], ring: &[usize], i: usize) -> bool {
    if turn(flat, ring, i) <= STRAIGHT {
        return false;
    }
    let [a, b, c] = neighbours(ring, i).map(|k| flat[k]);
    !ring.iter().map(|&k| flat[k]).any(|p| p != a && p != b && p != c && inside(p, a, b, c))
}

fn inside(p: DVec2, a: DVec2, b: DVec2, c: DVec2) -> bool {
    let left_of = |from: DVec2, to: DVec2| (to - from).perp_dot(p - from) >= -STRAIGHT;
    left_of(a, b) && left_of(b, c) && left_of(c, a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(corner: &[[f32; 2]]) -> (Vec<[usize; 3]>, f32) {
        let corner: Vec<Vec3> = corner.iter().map(|c| Vec3::new(c[0], 0.3 * c[0], -c[1])).collect();
        let mut out = Vec::new();
        triangulate(&corner, &mut out);
        let normal = Vec3::new(-0.3, 1.0, 0.0).normalize();
        let signed = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|i| corner[i]);
            (b - a).cross(c - a).dot(normal) / 2.0
        };
        assert!(out.iter().all(|t| signed(t) > 0.0), "every triangle is wound like the polygon");
        let area = out.iter().map(signed).sum();
        (out, area)
    }

    /// Areas of the tilted test plane over those of its plan.
    const TILT: f32 = 1.044_030_7;

    #[test]
    fn convex_quad_is_a_fan_from_its_first_corner() {
        let (triangles, _) = cut(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]);
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn concave_polygons_keep_their_area() {
        // An arrow head whose fan from corner 0 would cover the notch, and an L of area 3.
        let (_, arrow) = cut(&[[0.0, 0.0], [2.0, -1.0], [1.0, 0.0], [2.0, 1.0]]);
        let (_, ell) = cut(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]);
        // Sums of a few f32 products of size 1.
        assert!((arrow - TILT).abs() < 1e-5 && (ell - 3.0 * TILT).abs() < 1e-5, "{arrow} {ell}");
    }

    #[test]
    fn convex_parts_are_few_and_cover_the_polygon() {
        // An L, a comb of three teeth, and the upper half of a ring of 2 x 16 corners.
        let ell = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        let mut comb = vec![[0.0, 0.0], [5.0, 0.0]];
        for x in [4.0, 2.0, 0.0] {
            comb.extend([[x + 1.0, 2.0], [x, 2.0], [x, 1.0], [x - 1.0, 1.0]]);
        }
        comb.truncate(comb.len() - 2);
        let arc = |radius: f32, i: usize| {
            let (sine, cosine) = (std::f32::consts::PI * i as f32 / 15.0).sin_cos();
            [radius * cosine, radius * sine]
        };
        let ring: Vec<[f32; 2]> =
            (0..16).map(|i| arc(2.0, i)).chain((0..16).rev().map(|i| arc(1.0, i))).collect();
        for (name, corner, area, most) in
            [("L", ell, 3.0, 2), ("comb", comb, 8.0, 6), ("ring", ring, 1.5 * 15.0 * (0.209_44f32).sin(), 16)]
        {
            let corner: Vec<Vec3> = corner.iter().map(|c| Vec3::new(c[0], 0.0, -c[1])).collect();
            let parts = convex_parts(&corner);
            let doubled = |part: &Vec<usize>| {
                assert!(is_convex(&part.iter().map(|&i| corner[i]).collect::<Vec<_>>()), "{name}: {part:?}");
                let p = |i: usize| corner[part[i % part.len()]];
                (1..part.len() - 1).map(|i| (p(i) - p(0)).cross(p(i + 1) - p(0)).y).sum::<f32>()
            };
            let found = 0.5 * parts.iter().map(doubled).sum::<f32>();
            // Sums of a few f32 products of size 1.
            assert!((found - area).abs() < 1e-4, "{name}: {found} instead of {area}");
            assert!(parts.len() <= most, "{name}: {}", parts.len());
        }
    }

    fn is_convex(corner: &[Vec3]) -> bool {
        turns_one_way(&flatten(corner), &(0..corner.len()).collect::<Vec<_>>())
    }

    #[test]
    fn corner_on_a_straight_edge_stays_a_corner() {
        let (triangles, area) = cut(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
        assert!((area - 4.0 * TILT).abs() < 1e-5);
        assert!(triangles.iter().flatten().any(|&c| c == 1), "no T-junction is made: {triangles:?}");
    }

    #[test]
    fn self_crossing_and_flat_polygons_still_end() {
        let mut out = Vec::new();
        triangulate(&[Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0), Vec3::X, Vec3::Y], &mut out);
        assert_eq!(out.len(), 2);
        triangulate(&[Vec3::ONE; 5], &mut out);
        assert_eq!(out.len(), 3);
    }
}
