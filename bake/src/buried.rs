//! What lies inside other geometry.
//!
//! A vertex there (of the floor within a column's foot, of a ceiling within a lamp) gets next to no light, or what
//! there is within the object, and says nothing of those parts of its triangles that can be seen. It takes its
//! neighbours' light instead ([`crate::fill`]). It is known by its rays: none gets away, and either most of them meet
//! backs, or they end so near that a triangle of its reaches out of what closes it in.
//!
//! Where it breaks: a column of one sheet wound the wrong way shows fronts within; what is open by less than a 64th
//! of the hemisphere counts as closed.

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_scenes::Scene;
use rayon::prelude::*;

use crate::gather::{lane_of, packet};
use crate::sampling::{Directions, Frame, HemisphereSets, LANES, hash};
use crate::{Error, Surface};

/// Rays of a vertex.
const RAYS: usize = 64;

/// What more than this share of rays meets the backs of lies around the vertex.
const BACKS: f32 = 0.75;

/// A vertex is closed in if its longest edge is this many times longer than its longest ray.
const CLOSED_IN: f32 = 2.0;

/// Those vertices of the list that lie inside other geometry.
pub fn buried(surface: &Surface, sets: &HemisphereSets, list: &[usize]) -> Vec<usize> {
    let mut longest_edge = vec![0.0_f32; surface.mesh.position.len()];
    for (triangle, length) in surface.mesh.index.iter().zip(&surface.longest_edge) {
        triangle.iter().for_each(|&v| longest_edge[v as usize] = longest_edge[v as usize].max(*length));
    }
    let is_buried = |&v: &usize| {
        Cover::of(surface, surface.origin[v], sets.at(v, surface.mesh.normal[v]))
            .is_some_and(|cover| cover.backs > BACKS || CLOSED_IN * cover.farthest < longest_edge[v])
    };
    list.par_iter().copied().filter(is_buried).collect()
}

/// Whether each of some points of a scene's surface lies inside other geometry, so that nobody sees it; `normals` are
/// theirs, of unit length, one for each.
///
/// # Errors
/// When Embree cannot be had or refuses the scene.
pub fn inside_others(scene: &Scene, points: &[Vec3], normals: &[Vec3]) -> Result<Vec<bool>, Error> {
    let surface = Surface::new(scene)?;
    let sets = sets(0);
    let is_inside = |(i, (p, n)): (usize, (&Vec3, &Vec3))| {
        Cover::of(&surface, *p + surface.lift * *n, sets.at(i, *n)).is_some_and(|cover| cover.backs > BACKS)
    };
    Ok(points.par_iter().zip(normals).enumerate().map(is_inside).collect())
}

/// Few directions, enough to know what is around a vertex.
pub fn sets(seed: u64) -> HemisphereSets {
    HemisphereSets::new(RAYS, hash(seed, u64::MAX))
}

/// What the rays of a point meet, all of them something.
struct Cover {
    /// Share that meets backs.
    backs: f32,
    /// Length of the longest, metres.
    farthest: f32,
}

impl Cover {
    /// `None` where a ray gets away.
    fn of(surface: &Surface, origin: Vec3, (set, frame): (&[Directions], Frame)) -> Option<Cover> {
        let (mut n_backs, mut farthest) = (0, 0.0_f32);
        for local in set {
            let (mut rays, world) = packet(origin, &frame, local);
            let mut hits = ffi::Hits::<LANES>::default();
            surface.tree.intersect_packet(&ffi::Mask::all(), &mut rays, &mut hits);
            for lane in 0..LANES {
                let hit = hits.get(&rays, lane)?;
                n_backs += usize::from(lane_of(&world, lane).dot(Vec3::from(hit.normal)) > 0.0);
                farthest = farthest.max(hit.t);
            }
        }
        Some(Cover { backs: n_backs as f32 / (set.len() * LANES) as f32, farthest })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lunette_scenes::{Material, Mesh};

    /// A floor of four triangles about its middle, 1 m to each side, and over the middle a box of a half edge and of
    /// a winding that shows its backs within, or its fronts; with a lid or without. Vertex 0 is the middle.
    fn floor_under_box(half: f32, shows_backs: bool, has_lid: bool) -> Scene {
        let mut position =
            vec![Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 0.0, -1.0), Vec3::new(-1.0, 0.0, -1.0)];
        position.push(Vec3::new(-1.0, 0.0, 1.0));
        let mut index = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]];
        let mut quad = |corners: [[f32; 3]; 4]| {
            let first = position.len() as u32;
            position.extend(corners.map(|c| half * Vec3::from(c)));
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| first + k);
            index.extend(if shows_backs { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
        };
        for side in 0..4 {
            let turn = |[x, y, z]: [f32; 3]| match side {
                0 => [x, y, z],
                1 => [z, y, -x],
                2 => [-x, y, -z],
                _ => [-z, y, x],
            };
            quad([[1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [1.0, 2.0, -1.0], [1.0, 2.0, 1.0]].map(turn));
        }
        if has_lid {
            quad([[-1.0, 2.0, -1.0], [-1.0, 2.0, 1.0], [1.0, 2.0, 1.0], [1.0, 2.0, -1.0]]);
        }
        let n = index.len();
        // Only the floor's normals are asked for.
        let normal = vec![Vec3::Y; position.len()];
        Scene {
            mesh: Mesh { position, normal, index, material: vec![0; n], group: vec![0; n] },
            materials: vec![Material::default()],
            groups: vec!["floor".into()],
            report: Vec::new(),
        }
    }

    fn middle_is_buried(scene: &Scene) -> bool {
        let surface = Surface::new(scene).expect("a tree");
        let found = buried(&surface, &sets(0), &[0, 1]);
        assert!(!found.contains(&1), "the floor's corner is under the sky");
        found == [0]
    }

    #[test]
    fn the_floor_is_buried_within_an_object() {
        assert!(middle_is_buried(&floor_under_box(0.1, true, true)));
        assert!(!middle_is_buried(&floor_under_box(0.1, true, false)), "light falls in from above");
    }

    #[test]
    fn the_floor_is_buried_within_what_its_triangles_reach_out_of() {
        // The floor's edges are 2 m long; the longest ray within is 2.45 half edges long.
        assert!(middle_is_buried(&floor_under_box(0.1, false, true)));
        assert!(!middle_is_buried(&floor_under_box(0.1, false, false)), "light falls in from above");
        assert!(!middle_is_buried(&floor_under_box(0.9, false, true)), "a room of its own");
    }

    #[test]
    fn nobody_sees_what_shows_only_within_an_object() {
        let points = [Vec3::ZERO, Vec3::new(0.05, 0.0, 0.03), Vec3::new(0.5, 0.0, 0.5)];
        let inside = |scene: &Scene| inside_others(scene, &points, &[Vec3::Y; 3]).expect("a tree");
        assert_eq!(inside(&floor_under_box(0.1, true, true)), [true, true, false]);
        assert_eq!(inside(&floor_under_box(0.1, true, false)), [false; 3]);
        assert_eq!(inside(&floor_under_box(0.1, false, true)), [false; 3], "a closed room may be looked at");
    }
}
