//! Vertex normals with creases.
//!
//! Around a place of the mesh, two faces that share an edge there are smooth if their normals differ by at most the
//! crease angle. Faces joined by smooth edges form a smooth group; the normal of its corners is
//!
//! n = normalise( sum over faces f of the group of  angle_f * n_f ),
//!
//! with the angle that face f spans there. Weighting by angle makes the result independent of how a flat part is
//! cut into triangles.
//!
//! Based on: Thürmer & Wüthrich, Computing Vertex Normals from Polygonal Facets, 1998.
//!
//! A fan of many faces may bend so far from edge to edge that the mean lies behind one of them (a saddle, a sharp
//! cone): such corners get the normal of their own face, and are reported.

use glam::Vec3;

use crate::names::count;
use crate::repair::{Fans, Soup, cross};

/// Cosines this much below that of the crease angle still count as smooth: dot products of unit f32 vectors are that
/// far off, and flat faces have to be smooth at a crease angle of 0.
const SAME: f32 = 1e-6;

/// Fills the corners of `soup` that have no normal (zero). `same` names the first vertex in the place of each vertex,
/// `crease` is in radians.
pub(crate) fn fill(soup: &mut Soup, same: &[u32], crease: f32, report: &mut Vec<String>) {
    let missing = |n: &Vec3| *n == Vec3::ZERO;
    if !soup.normal.iter().flatten().any(missing) {
        return;
    }
    let place: Vec<[u32; 3]> = soup.triangle.iter().map(|t| t.map(|v| same[v as usize])).collect();
    let faces = Faces {
        normal: soup.triangle.iter().map(|t| face_normal(t.map(|v| soup.position[v as usize]))).collect(),
        place: &place,
        cos_crease: crease.cos() - SAME,
    };
    let fans = Fans::new(same.len(), place.as_flattened().iter().copied());
    let mut group = Groups::default();
    let mut n_behind = 0;
    for v in 0..same.len() {
        let fan = fans.of(v);
        if fan.iter().all(|&c| !missing(&corner_normal(soup, c))) {
            continue;
        }
        group.find(fan, &faces);
        let mean = group.means(fan, &faces, soup);
        for (k, &c) in fan.iter().enumerate() {
            if missing(&corner_normal(soup, c)) {
                let face = faces.normal[c as usize / 3];
                let (normal, behind) = facing(mean[group.root[k] as usize], face);
                n_behind += usize::from(behind);
                soup.normal[c as usize / 3][c as usize % 3] = normal;
            }
        }
    }
    if n_behind > 0 {
        let n = count(n_behind, "smooth normal");
        report.push(format!("{n} more than 90 degrees off the face replaced by that of the face"));
    }
}

/// Unit normal of a triangle that has an area.
pub(crate) fn face_normal(corner: [Vec3; 3]) -> Vec3 {
    cross(corner).normalize().as_vec3()
}

/// The mean as a unit normal if it lies in front of the face, or else the normal of the face; and whether it did not.
fn facing(mean: Vec3, face: Vec3) -> (Vec3, bool) {
    match mean.try_normalize().filter(|n| n.dot(face) > 0.0) {
        Some(normal) => (normal, false),
        None => (face, true),
    }
}

fn corner_normal(soup: &Soup, c: u32) -> Vec3 {
    soup.normal[c as usize / 3][c as usize % 3]
}

struct Faces<'a> {
    /// Unit, per triangle.
    normal: Vec<Vec3>,
    /// Vertices by place, per triangle.
    place: &'a [[u32; 3]],
    cos_crease: f32,
}

impl Faces<'_> {
    fn are_smooth(&self, a: u32, b: u32) -> bool {
        self.normal[a as usize / 3].dot(self.normal[b as usize / 3]) >= self.cos_crease
    }

    /// The two vertices across from corner `c`.
    fn spokes(&self, c: u32) -> [u32; 2] {
        let (t, k) = (&self.place[c as usize / 3], c as usize % 3);
        [t[(k + 1) % 3], t[(k + 2) % 3]]
    }
}

/// Smooth groups of one fan.
#[derive(Default)]
struct Groups {
    /// Place in the fan of a member that stands for the group, per corner of the fan.
    root: Vec<u32>,
    /// (vertex at the far end of an edge, place in the fan)
    spokes: Vec<(u32, u32)>,
    /// Places in the fan of one face of each direction that meets at an edge.
    leaders: Vec<u32>,
}

impl Groups {
    fn find(&mut self, fan: &[u32], faces: &Faces) {
        self.root.clear();
        self.root.extend(0..fan.len() as u32);
        self.spokes.clear();
        for (k, &c) in fan.iter().enumerate() {
            self.spokes.extend(faces.spokes(c).map(|end| (end, k as u32)));
        }
        self.spokes.sort_unstable();
        let spokes = std::mem::take(&mut self.spokes);
        for edge in spokes.chunk_by(|a, b| a.0 == b.0) {
            self.join_edge(edge, fan, faces);
        }
        self.spokes = spokes;
        for k in 0..fan.len() as u32 {
            self.root[k as usize] = self.leader(k);
        }
    }

    /// Joins the faces at one edge that are smooth. Each is held against one face of every direction so far, of
    /// which there are few, so that an edge with very many faces takes no longer than their number.
    fn join_edge(&mut self, edge: &[(u32, u32)], fan: &[u32], faces: &Faces) {
        self.leaders.clear();
        for &(_, k) in edge {
            let smooth = |l: &&u32| faces.are_smooth(fan[k as usize], fan[**l as usize]);
            match self.leaders.iter().find(smooth).copied() {
                Some(leader) => {
                    let (a, b) = (self.leader(k), self.leader(leader));
                    self.root[a.max(b) as usize] = a.min(b);
                }
                None => self.leaders.push(k),
            }
        }
    }

    fn leader(&mut self, mut k: u32) -> u32 {
        while self.root[k as usize] != k {
            let up = self.root[self.root[k as usize] as usize];
            self.root[k as usize] = up;
            k = up;
        }
        k
    }

    /// Angle-weighted sum of face normals, at the place in the fan of the root of each group.
    fn means(&self, fan: &[u32], faces: &Faces, soup: &Soup) -> Vec<Vec3> {
        let mut sum = vec![Vec3::ZERO; fan.len()];
        for (k, &c) in fan.iter().enumerate() {
            sum[self.root[k] as usize] += angle(soup, c) * faces.normal[c as usize / 3];
        }
        sum
    }
}

/// Angle of a triangle at one of its corners, radians.
fn angle(soup: &Soup, c: u32) -> f32 {
    let (t, k) = (soup.triangle[c as usize / 3], c as usize % 3);
    let [p, q, r] = [0, 1, 2].map(|i| soup.position[t[(k + i) % 3] as usize].as_dvec3());
    let (u, v) = (q - p, r - p);
    u.cross(v).length().atan2(u.dot(v)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normals of a soup whose vertices are all in different places.
    fn normals(
        position: &[[f32; 3]],
        triangle: &[[u32; 3]],
        crease_degrees: f32,
    ) -> (Vec<[Vec3; 3]>, Vec<String>) {
        let mut soup = Soup {
            position: position.iter().map(|&p| p.into()).collect(),
            triangle: triangle.to_vec(),
            normal: vec![[Vec3::ZERO; 3]; triangle.len()],
            ..Soup::default()
        };
        let same: Vec<u32> = (0..position.len() as u32).collect();
        let mut report = Vec::new();
        fill(&mut soup, &same, crease_degrees.to_radians(), &mut report);
        (soup.normal, report)
    }

    /// Two unit squares that meet at the z axis and rise by `degrees` there.
    fn roof(degrees: f32, crease: f32) -> Vec<[Vec3; 3]> {
        let (s, c) = degrees.to_radians().sin_cos();
        let p = [[0., 0., 0.], [0., 0., 1.], [1., 0., 1.], [1., 0., 0.], [-c, s, 0.], [-c, s, 1.]];
        normals(&p, &[[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 1]], crease).0
    }

    #[test]
    fn edge_is_smooth_up_to_the_crease_angle() {
        let (smooth, sharp) = (roof(39.0, 40.0), roof(41.0, 40.0));
        assert_eq!(smooth[0][0], smooth[2][0]);
        // The mean of two directions 39 degrees apart: f32 sums of two unit vectors.
        assert!((smooth[0][0].angle_between(Vec3::Y) - 19.5_f32.to_radians()).abs() < 1e-3);
        assert_eq!(sharp[0], [Vec3::Y; 3]);
        assert!((sharp[2][0].angle_between(Vec3::Y) - 41_f32.to_radians()).abs() < 1e-3);
    }

    #[test]
    fn flat_faces_are_smooth_at_any_crease_angle() {
        // On a tilted plane, as near as f32 gets.
        let p = [[0.1, 0.2], [1.3, 0.4], [0.9, 1.7], [-0.3, 1.5]].map(|[x, y]| [x, y, 0.3 * x + 0.7 * y]);
        let (n, _) = normals(&p, &[[0, 1, 2], [0, 2, 3]], 0.0);
        assert_eq!(n[0][0], n[1][0]);
    }

    #[test]
    fn angle_weights_make_cube_corner_point_along_its_diagonal() {
        // Three faces of a cube; one of them is cut so that it has two triangles at the corner.
        let p = [
            [0., 0., 0.],
            [1., 0., 0.],
            [1., 1., 0.],
            [0., 1., 0.],
            [0., 0., 1.],
            [1., 0., 1.],
            [0., 1., 1.],
        ];
        let t = [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 5, 4], [0, 4, 3], [4, 6, 3]];
        let (n, _) = normals(&p, &t, 100.0);
        let diagonal = Vec3::splat(-1.0).normalize();
        // A few roundings of f32.
        assert!((n[0][0] - diagonal).length() < 1e-6, "{}", n[0][0]);
        assert_eq!(n[0][0], n[2][0]);
    }

    #[test]
    fn very_many_faces_at_one_edge_take_linear_time() {
        let n = 100_000;
        let p: Vec<[f32; 3]> = (0..n)
            .map(|i| std::f32::consts::TAU * i as f32 / n as f32)
            .map(|a| [a.cos(), a.sin(), 0.5])
            .chain([[0.0; 3], [0.0, 0.0, 1.0]])
            .collect();
        let t: Vec<[u32; 3]> = (0..n as u32).map(|i| [n as u32, n as u32 + 1, i]).collect();
        let start = std::time::Instant::now();
        let (normal, _) = normals(&p, &t, 10.0);
        // Quadratic time would be 1e10 comparisons, half a minute at the least.
        assert!(start.elapsed().as_secs() < 5);
        assert!(normal.iter().flatten().all(|n| n.is_normalized()));
    }

    #[test]
    fn mean_behind_its_face_gives_way_to_the_face() {
        // A spike so thin that, with everything smooth, the mean at its tip lies behind one face.
        let p = [[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], [0.9, 0., -0.1], [0.9, 0.0, 0.1]];
        let t = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [0, 4, 2]];
        let (n, report) = normals(&p, &t, 180.0);
        assert!(report.iter().any(|line| line.contains("smooth normal")), "{report:?}");
        for (triangle, normal) in t.iter().zip(&n) {
            let face = face_normal(triangle.map(|v| p[v as usize].into()));
            assert!(normal.iter().all(|n| n.dot(face) > 0.0));
        }
    }
}
