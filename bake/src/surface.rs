//! The scene as the estimators see it: Embree's tree, where rays start, and what they hit.
//!
//! Rays of a vertex start a hair above the surface. On a border or crease the vertex lies in the plane of the
//! surface beyond (the floor's corner in the wall), where a ray could slip behind that surface, so that the
//! origin is also moved a hair towards the middle of the vertex's own triangles, within their tangent plane.
//! Inside a closed fan it stays over the vertex. Where it breaks: walls thinner than the two hairs, 1e-5 of the
//! scene's diagonal and 1e-3 of the edges.

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_scenes::{Mesh, Portal, Scene};
use rayon::prelude::*;

use crate::Error;
use crate::glossy::reflectance;

/// Height of a ray's origin over the surface, as a share of the scene's diagonal: ten times the rounding of
/// single floats at the far end of the scene.
const LIFT: f32 = 1e-5;

/// Move of a ray's origin away from a border, as a share of the mean edge there.
const INSET: f32 = 1e-3;

/// A surface that faces a pane more squarely than this (sin² of the angle between them) is not moved along.
const LEAST_SLOPE: f32 = 0.1;

/// A scene ready for tracing. Triangle numbers are those of the mesh.
pub struct Surface<'a> {
    /// The tree.
    pub tree: ffi::Scene,
    /// The mesh.
    pub mesh: &'a Mesh,
    /// Reflectance of each triangle for light that bounces.
    pub albedo: Vec<Vec3>,
    /// Longest edge of each triangle, metres.
    pub longest_edge: Vec<f32>,
    /// Where the rays of each vertex start.
    pub origin: Vec<Vec3>,
    /// Height of origins over the surface, metres.
    pub lift: f32,
}

impl<'a> Surface<'a> {
    /// Builds the tree and the origins.
    ///
    /// # Errors
    /// When Embree is missing or refuses the mesh.
    pub fn new(scene: &'a Scene) -> Result<Surface<'a>, Error> {
        let mesh = &scene.mesh;
        let device = ffi::Device::new()?;
        let mut builder = ffi::SceneBuilder::new(&device)?;
        let positions: Vec<[f32; 3]> = mesh.position.iter().map(|p| p.to_array()).collect();
        builder.add_triangles(&positions, &mesh.index)?;
        let (low, high) = mesh.bounds();
        let lift = LIFT * (high - low).length();
        Ok(Surface {
            tree: builder.commit()?,
            mesh,
            albedo: mesh.material.iter().map(|&m| reflectance(&scene.materials[m as usize])).collect(),
            longest_edge: mesh.index.iter().map(|t| longest_edge(mesh, t)).collect(),
            origin: origins(mesh, lift),
            lift,
        })
    }

    /// Moves the origins of vertices that lie on a portal a hair inside, so that their rays to the outside pass it:
    /// a window's reveal often has its pane along an edge loop. The portals' triangles face inside.
    pub fn keep_inside(&mut self, portals: &[Portal]) {
        let near = 4.0 * self.lift;
        for portal in portals {
            let panes = Sweep::new(&portal.triangles);
            let vertices = self.mesh.position.par_iter().zip(&self.mesh.normal);
            self.origin.par_iter_mut().zip(vertices).for_each(|(origin, (p, n))| {
                if let Some([a, b, c]) = panes.within(*p, near) {
                    let inwards = (*b - *a).cross(*c - *a).normalize_or_zero();
                    // Not through the vertex's own surface, where that faces the pane.
                    let way = inwards - inwards.dot(*n).min(0.0) * *n;
                    let slope = way.dot(inwards);
                    if slope > LEAST_SLOPE {
                        *origin += (near - (*origin - *a).dot(inwards)).max(0.0) / slope * way;
                    }
                }
            });
        }
    }

    /// The three corners of a triangle.
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.mesh.index[triangle as usize].map(|v| self.mesh.position[v as usize])
    }
}

/// Triangles in the order in which a plane meets them that sweeps along their longest side.
struct Sweep<'a> {
    axis: usize,
    /// Where each begins, rising, and the triangle.
    begin: Vec<(f32, &'a [Vec3; 3])>,
    /// Of the longest.
    length: f32,
}

impl<'a> Sweep<'a> {
    fn new(triangles: &'a [[Vec3; 3]]) -> Sweep<'a> {
        let corners = || triangles.iter().flatten().copied();
        let low = corners().fold(Vec3::INFINITY, Vec3::min);
        let high = corners().fold(Vec3::NEG_INFINITY, Vec3::max);
        let axis = (high - low).max_position();
        let ends = |t: &[Vec3; 3]| {
            let along = t.map(|p| p[axis]);
            (
                along.into_iter().fold(f32::INFINITY, f32::min),
                along.into_iter().fold(f32::NEG_INFINITY, f32::max),
            )
        };
        let mut begin: Vec<(f32, &[Vec3; 3])> = triangles.iter().map(|t| (ends(t).0, t)).collect();
        begin.sort_by(|a, b| a.0.total_cmp(&b.0));
        let length = triangles.iter().map(|t| ends(t).1 - ends(t).0).fold(0.0, f32::max);
        Sweep { axis, begin, length }
    }

    /// A triangle that is nearer to `p` than this.
    fn within(&self, p: Vec3, distance: f32) -> Option<&'a [Vec3; 3]> {
        let at = p[self.axis];
        let first = self.begin.partition_point(|(begin, _)| *begin < at - self.length - distance);
        let after = self.begin[first..].iter().take_while(|(begin, _)| *begin <= at + distance);
        let mut near = after.map(|(_, triangle)| *triangle);
        near.find(|triangle| nearest(triangle, p).distance(p) < distance)
    }
}

/// The point of a triangle that is nearest to `p`.
///
/// Based on: C. Ericson, Real-Time Collision Detection, 2005, section 5.1.5.
fn nearest(&[a, b, c]: &[Vec3; 3], p: Vec3) -> Vec3 {
    let (ab, ac) = (b - a, c - a);
    let along = |q: Vec3| (ab.dot(p - q), ac.dot(p - q));
    let ((d1, d2), (d3, d4), (d5, d6)) = (along(a), along(b), along(c));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    a + (ab * vb + ac * vc) / (va + vb + vc)
}

fn longest_edge(mesh: &Mesh, triangle: &[u32; 3]) -> f32 {
    let [a, b, c] = triangle.map(|v| mesh.position[v as usize]);
    (b - a).length().max((c - b).length()).max((a - c).length())
}

fn origins(mesh: &Mesh, lift: f32) -> Vec<Vec3> {
    let fans = Fans::new(mesh);
    (0..mesh.position.len())
        .map(|v| {
            let (p, n) = (mesh.position[v], mesh.normal[v]);
            p + fans.inset(v, n, lift) + lift * n
        })
        .collect()
}

/// For each vertex, what its triangles say about it: the sum of the unit vectors along its border edges tells a
/// closed fan (none) from an open one.
struct Fans {
    /// Sum of unit directions to the middles of the vertex's triangles.
    inwards: Vec<Vec3>,
    /// Sum of edge lengths and their number.
    edges: Vec<(f32, u32)>,
    /// Sum over triangles of (next - previous) as vertex numbers: zero for a closed fan.
    boundary: Vec<i64>,
}

impl Fans {
    fn new(mesh: &Mesh) -> Fans {
        let n = mesh.position.len();
        let mut fans = Fans { inwards: vec![Vec3::ZERO; n], edges: vec![(0.0, 0); n], boundary: vec![0; n] };
        for triangle in &mesh.index {
            let p = triangle.map(|v| mesh.position[v as usize]);
            let middle = (p[0] + p[1] + p[2]) / 3.0;
            for i in 0..3 {
                let (v, next, previous) =
                    (triangle[i] as usize, triangle[(i + 1) % 3], triangle[(i + 2) % 3]);
                fans.inwards[v] += (middle - p[i]).normalize_or_zero();
                fans.edges[v].0 += (p[(i + 1) % 3] - p[i]).length() + (p[(i + 2) % 3] - p[i]).length();
                fans.edges[v].1 += 2;
                // Around a closed fan every neighbour is next once and previous once. The mixing keeps sums of
                // open fans from cancelling by accident.
                let mix = |w: u32| (u64::from(w) + 1).wrapping_mul(0x9e3779b97f4a7c15) as i64 >> 8;
                fans.boundary[v] = fans.boundary[v].wrapping_add(mix(next)).wrapping_sub(mix(previous));
            }
        }
        fans
    }

    /// The move into an open fan, within the tangent plane.
    fn inset(&self, v: usize, normal: Vec3, lift: f32) -> Vec3 {
        if self.boundary[v] == 0 {
            return Vec3::ZERO;
        }
        let tangent = self.inwards[v].reject_from_normalized(normal).normalize_or_zero();
        let edge = self.edges[v].0 / self.edges[v].1.max(1) as f32;
        tangent * (INSET * edge).max(2.0 * lift).min(0.1 * edge)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corner_of_floor_and_wall() -> Mesh {
        // Floor z 0..1, wall in the plane z = 0, both meeting in the edge y = z = 0, vertices split there.
        let position =
            [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1], [0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
        Mesh {
            position: position.map(|p: [i32; 3]| Vec3::new(p[0] as f32, p[1] as f32, p[2] as f32)).to_vec(),
            normal: [vec![Vec3::Y; 4], vec![Vec3::Z; 4]].concat(),
            index: vec![[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7]],
            material: vec![0; 4],
            group: vec![0; 4],
        }
    }

    #[test]
    fn nearest_point_of_a_triangle_is_no_farther_than_any_other() {
        let triangle = [Vec3::new(0.1, 0.0, 0.3), Vec3::new(1.2, 0.4, 0.0), Vec3::new(0.3, 1.1, -0.2)];
        for i in 0..1000u64 {
            let h = |k: u64| (crate::sampling::hash(k, i) >> 40) as f32 / (1 << 23) as f32 - 0.6;
            let p = Vec3::new(h(1), h(2), h(3));
            let grid = (0..=40).flat_map(|u| (0..=40 - u).map(move |v| (u as f32 / 40.0, v as f32 / 40.0)));
            let best = grid
                .map(|(u, v)| triangle[0] * (1.0 - u - v) + triangle[1] * u + triangle[2] * v)
                .map(|q| q.distance(p))
                .fold(f32::MAX, f32::min);
            let found = nearest(&triangle, p);
            // The grid's points are up to a fortieth of an edge apart.
            assert!(found.distance(p) < best + 1e-5 && found.distance(p) > best - 0.03, "{p}: {found}");
        }
    }

    #[test]
    fn sweep_finds_what_is_near_any_triangle() {
        let h = |k: u64, i: u64| (crate::sampling::hash(k, i) >> 40) as f32 / (1 << 24) as f32;
        // Some long, most short, in a slab that is longest along z.
        let corner = |i: u64, k: u64| Vec3::new(h(k, i), h(k + 1, i), 6.0 * h(9, i / 3));
        let triangles: Vec<[Vec3; 3]> = (0..80)
            .map(|i| {
                let size = if i % 9 == 0 { 1.0 } else { 0.1 };
                [1, 3, 5].map(|k| corner(i, 1) + size * corner(i, k).with_z(h(k + 2, i)))
            })
            .collect();
        let sweep = Sweep::new(&triangles);
        let mut found = 0;
        for i in 0..2000 {
            let p = Vec3::new(2.0 * h(20, i), 2.0 * h(21, i), 7.0 * h(22, i));
            let is_near = triangles.iter().any(|t| nearest(t, p).distance(p) < 0.25);
            assert_eq!(sweep.within(p, 0.25).is_some(), is_near, "{p}");
            found += usize::from(is_near);
        }
        assert!((100..1900).contains(&found), "{found}");
        assert!(Sweep::new(&[]).within(Vec3::ZERO, 1.0).is_none());
    }

    #[test]
    fn origins_in_a_corner_lie_in_front_of_both_planes() {
        let mesh = corner_of_floor_and_wall();
        for origin in origins(&mesh, 1e-5) {
            assert!(origin.y > 0.0 && origin.z > 0.0, "{origin}");
        }
    }

    #[test]
    fn origins_inside_a_closed_fan_stay_over_their_vertex() {
        let ring = (0..6).map(|i| Vec3::new((i as f32).cos(), 0.0, (i as f32).sin()));
        let mesh = Mesh {
            position: std::iter::once(Vec3::ZERO).chain(ring).collect(),
            normal: vec![Vec3::Y; 7],
            index: (0..6).map(|i| [0, (i + 1) % 6 + 1, i + 1]).collect(),
            material: vec![0; 6],
            group: vec![0; 6],
        };
        assert_eq!(origins(&mesh, 1e-5)[0], Vec3::new(0.0, 1e-5, 0.0));
        assert!(origins(&mesh, 1e-5)[1].x < 1.0);
    }
}
