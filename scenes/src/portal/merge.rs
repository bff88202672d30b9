//! Triangles gathered into flat polygons.

use std::collections::{BTreeMap, HashMap};

use glam::Vec3;

use crate::{polygon, repair};

/// Neighbours whose unit normals differ by at most this, squared, lie in one plane: ten times what f32 corners of a
/// pane of a few metres, cut at centimetres, leave.
const SAME_PLANE: f64 = 1e-8;

/// Corners that turn by less than this sine are on a straight edge.
const STRAIGHT: f32 = 1e-4;

/// Largest difference in area, as a share, between a polygon and its triangles.
const SAME_AREA: f64 = 1e-4;

/// The edge between two triangles as each of them runs along it.
type Edge = (u32, u32);

/// Few polygons that cover what the triangles cover.
pub(super) fn polygons(triangles: &[[Vec3; 3]]) -> Vec<Vec<Vec3>> {
    joined(outlines(triangles))
}

/// The outline of each part that hangs together in one plane; triangles where it has a hole.
pub(super) fn outlines(triangles: &[[Vec3; 3]]) -> Vec<Vec<Vec3>> {
    let (position, index) = weld(triangles);
    let parts = flat_parts(triangles, &index);
    let mut list = Vec::new();
    for part in parts {
        let whole = ring(&index, &part).map(|ring| {
            let corners: Vec<Vec3> = ring.iter().map(|&i| position[i as usize]).collect();
            straightened(&corners)
        });
        match whole.filter(|p| covers(p, triangles, &part)) {
            Some(polygon) => list.push(polygon),
            None => list.extend(part.iter().map(|&t| triangles[t].to_vec())),
        }
    }
    list
}

/// Polygons of which no two lie in one plane, share a whole edge and are convex together: the arch of a window and the
/// rest of it are one pane, of which the wall around is known all around.
fn joined(mut list: Vec<Vec<Vec3>>) -> Vec<Vec<Vec3>> {
    let edges = |p: &[Vec3]| -> Vec<[[u32; 3]; 2]> {
        (0..p.len()).map(|i| [p[i], p[(i + 1) % p.len()]].map(repair::bits)).collect()
    };
    let mut owner: HashMap<[[u32; 3]; 2], usize> =
        list.iter().enumerate().flat_map(|(i, p)| edges(p).into_iter().map(move |e| (e, i))).collect();
    for i in 0..list.len() {
        let mut edge = 0;
        while edge < list[i].len() {
            let [a, b] = edges(&list[i])[edge];
            let other = owner.get(&[b, a]).copied().filter(|j| *j != i);
            let Some((j, both)) =
                other.and_then(|j| Some((j, convex_together(&list[i], edge, &list[j], b)?)))
            else {
                edge += 1;
                continue;
            };
            for edge in [i, j].into_iter().flat_map(|k| edges(&list[k])) {
                owner.remove(&edge);
            }
            owner.extend(edges(&both).into_iter().map(|e| (e, i)));
            list[i] = both;
            list[j].clear();
            edge = 0;
        }
    }
    list.retain(|p| !p.is_empty());
    list
}

/// One polygon and, across an edge of it, another in which the same edge begins with the corner `b`, as one.
fn convex_together(one: &[Vec3], edge: usize, other: &[Vec3], b: [u32; 3]) -> Option<Vec<Vec3>> {
    let normal = |p: &[Vec3]| repair::cross([p[0], p[1], p[2]]).normalize();
    if normal(one).distance_squared(normal(other)) >= SAME_PLANE {
        return None;
    }
    let first = other.iter().position(|p| repair::bits(*p) == b)?;
    let after = (0..other.len() - 2).map(|k| other[(first + 2 + k) % other.len()]);
    let mut ring = one[..=edge].to_vec();
    ring.extend(after);
    ring.extend(&one[edge + 1..]);
    let ring = straightened(&ring);
    polygon::is_convex(&ring).then_some(ring)
}

/// Corners in exactly the same place are one.
pub(super) fn weld(triangles: &[[Vec3; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut number = HashMap::new();
    let mut position = Vec::new();
    let mut index = |p: Vec3| {
        *number.entry(repair::bits(p)).or_insert_with(|| {
            position.push(p);
            position.len() as u32 - 1
        })
    };
    let index = triangles.iter().map(|t| t.map(&mut index)).collect();
    (position, index)
}

fn edges(t: [u32; 3]) -> [Edge; 3] {
    [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]
}

/// Triangles, as lists in their order, that hang together by edges in one plane.
fn flat_parts(triangles: &[[Vec3; 3]], index: &[[u32; 3]]) -> Vec<Vec<usize>> {
    let normal: Vec<_> = triangles.iter().map(|t| repair::cross(*t).normalize()).collect();
    let owner: HashMap<Edge, usize> =
        index.iter().enumerate().flat_map(|(t, i)| edges(*i).map(|e| (e, t))).collect();
    let mut part_of = vec![usize::MAX; triangles.len()];
    let mut parts = Vec::new();
    for seed in 0..triangles.len() {
        if part_of[seed] != usize::MAX {
            continue;
        }
        part_of[seed] = parts.len();
        let mut part = vec![seed];
        let mut at = 0;
        while at < part.len() {
            for (a, b) in edges(index[part[at]]) {
                let Some(&next) = owner.get(&(b, a)) else { continue };
                // Against the seed's normal, so that a bend of many small steps is not taken for flat.
                let flat = normal[next].distance_squared(normal[seed]) < SAME_PLANE;
                if flat && part_of[next] == usize::MAX {
                    part_of[next] = parts.len();
                    part.push(next);
                }
            }
            at += 1;
        }
        part.sort_unstable();
        parts.push(part);
    }
    parts
}

/// The border of a part, if it is one ring that passes no corner twice.
fn ring(index: &[[u32; 3]], part: &[usize]) -> Option<Vec<u32>> {
    let all: Vec<Edge> = part.iter().flat_map(|&t| edges(index[t])).collect();
    let known: std::collections::HashSet<Edge> = all.iter().copied().collect();
    let mut next = BTreeMap::new();
    for &(a, b) in all.iter().filter(|(a, b)| !known.contains(&(*b, *a))) {
        if next.insert(a, b).is_some() {
            return None;
        }
    }
    let (&first, _) = next.iter().next()?;
    let mut ring = vec![first];
    while ring.len() <= next.len() {
        let to = *next.get(&ring[ring.len() - 1])?;
        if to == first {
            return (ring.len() == next.len()).then_some(ring);
        }
        ring.push(to);
    }
    None
}

fn straightened(ring: &[Vec3]) -> Vec<Vec3> {
    let n = ring.len();
    let corner = |i: usize| ring[i % n];
    let turns = |i: &usize| {
        let (before, after) = (corner(*i) - corner(i + n - 1), corner(i + 1) - corner(*i));
        before.cross(after).length() > STRAIGHT * before.length() * after.length()
    };
    (0..n).filter(turns).map(corner).collect()
}

/// Whether the polygon, cut as a reader of it would cut it, has the part's area.
fn covers(polygon: &[Vec3], triangles: &[[Vec3; 3]], part: &[usize]) -> bool {
    let mut cut = Vec::new();
    polygon::triangulate(polygon, &mut cut);
    let area = |t: [Vec3; 3]| repair::cross(t).length();
    let cut: f64 = cut.iter().map(|t| area(t.map(|i| polygon[i]))).sum();
    let whole: f64 = part.iter().map(|&t| area(triangles[t])).sum();
    (cut - whole).abs() <= SAME_AREA * whole
}
