//! Rays against what blocks light and against glass, apart from each other.

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_scenes::{Mesh, Portal, Scene};

use crate::{Error, LANES};

/// A segment is made longer at both ends by this share: a wall that passes exactly through the end that two segments
/// share is then met by both, and not by neither.
const OVERLAP: f32 = 1e-3;

/// A scene's triangles in two trees.
pub(super) struct Rays {
    solid: ffi::Scene,
    glass: Option<ffi::Scene>,
}

impl Rays {
    /// What the scene's own glass lets through, it does not block.
    pub fn new(scene: &Scene) -> Result<Rays, Error> {
        let see_through = see_through(scene);
        let glass = tree(&scene.mesh, &see_through)?;
        let solid: Vec<bool> = see_through.iter().map(|g| !g).collect();
        Ok(Rays { solid: tree(&scene.mesh, &solid)?.ok_or(Error::EmptyScene)?, glass })
    }

    /// Only what blocks light.
    pub fn solid(scene: &Scene) -> Result<Rays, Error> {
        Ok(Rays { glass: None, ..Rays::new(scene)? })
    }

    /// Whether nothing solid is on the way.
    pub fn clear(&self, from: Vec3, to: Vec3) -> bool {
        !self.solid.occluded(&segment(from, to))
    }

    /// Whether nothing, not even glass, is on the way.
    pub fn empty(&self, from: Vec3, to: Vec3) -> bool {
        let ray = segment(from, to);
        !self.solid.occluded(&ray) && !self.glass.as_ref().is_some_and(|g| g.occluded(&ray))
    }

    /// Whether glass is on the way.
    pub fn meets_glass(&self, from: Vec3, to: Vec3) -> bool {
        self.glass.as_ref().is_some_and(|g| g.occluded(&segment(from, to)))
    }

    /// How far along the segment, 0..=1, the first solid surface is.
    pub fn first(&self, from: Vec3, to: Vec3) -> Option<f32> {
        let ray = ffi::Ray { tfar: 1.0, ..ffi::Ray::new(from.into(), (to - from).into()) };
        self.solid.intersect(&ray).map(|hit| hit.t)
    }

    /// The first solid surface.
    pub fn surface(&self, from: Vec3, direction: Vec3) -> Option<Met> {
        let hit = self.solid.intersect(&ffi::Ray::new(from.into(), direction.into()))?;
        let normal = Vec3::from(hit.normal).normalize_or_zero();
        let is_back = normal.dot(direction) > 0.0;
        Some(Met { distance: hit.t, normal: if is_back { -normal } else { normal }, is_back })
    }

    /// For each of up to sixteen segments, whether nothing solid and whether no glass is on the way.
    pub fn clear_each(&self, segments: &[(Vec3, Vec3)]) -> [(bool, bool); LANES] {
        let mut packet = ffi::Packet::<LANES>::default();
        for (lane, &(from, to)) in segments.iter().enumerate() {
            packet.set(lane, &segment(from, to));
        }
        let lanes = ffi::Mask::first(segments.len());
        let free = |tree: &ffi::Scene| {
            let mut packet = packet;
            tree.occluded_packet(&lanes, &mut packet);
            std::array::from_fn::<bool, LANES, _>(|lane| !packet.is_occluded(lane))
        };
        let solid = free(&self.solid);
        let glass = self.glass.as_ref().map_or([true; LANES], free);
        std::array::from_fn(|lane| (solid[lane], glass[lane]))
    }

    /// What endless rays in these directions meet.
    pub fn view(&self, from: Vec3, directions: &[Vec3]) -> View {
        let (mut n_clear, mut n_empty, mut reach) = (0, 0, 0.0);
        for chunk in directions.chunks(LANES) {
            let mut packet = ffi::Packet::<LANES>::default();
            for (lane, d) in chunk.iter().enumerate() {
                packet.set(lane, &ffi::Ray::new(from.into(), (*d).into()));
            }
            let lanes = ffi::Mask::first(chunk.len());
            let glass = self.glass.as_ref().map(|glass| {
                let mut packet = packet;
                glass.occluded_packet(&lanes, &mut packet);
                packet
            });
            let mut hits = ffi::Hits::<LANES>::default();
            self.solid.intersect_packet(&lanes, &mut packet, &mut hits);
            for lane in 0..chunk.len() {
                if hits.geometry[lane] != ffi::NO_HIT {
                    reach += packet.tfar[lane];
                } else {
                    n_clear += 1;
                    n_empty += usize::from(!glass.as_ref().is_some_and(|g| g.is_occluded(lane)));
                }
            }
        }
        let n = directions.len();
        View {
            clear: n_clear as f32 / n as f32,
            empty: n_empty as f32 / n as f32,
            reach: if n_clear < n { reach / (n - n_clear) as f32 } else { f32::INFINITY },
        }
    }
}

/// Where a ray in a unit direction ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Met {
    /// Metres.
    pub distance: f32,
    /// Unit, turned towards the ray's origin.
    pub normal: Vec3,
    /// Whether the triangle's back is seen.
    pub is_back: bool,
}

/// What a point sees all around.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct View {
    /// Share of rays that meet nothing solid.
    pub clear: f32,
    /// Share of rays that meet nothing, not even glass.
    pub empty: f32,
    /// Mean distance of what is solid, metres.
    pub reach: f32,
}

/// Whether each triangle is of glass.
pub(super) fn see_through(scene: &Scene) -> Vec<bool> {
    let glass = |&m: &u32| scene.materials[m as usize].is_see_through();
    scene.mesh.material.iter().map(glass).collect()
}

/// All triangles of portals in one tree; `None` without any.
pub(super) fn portal_tree(portals: &[Portal]) -> Result<Option<ffi::Scene>, Error> {
    let position: Vec<Vec3> = portals.iter().flat_map(|p| p.triangles.concat()).collect();
    let index: Vec<[u32; 3]> =
        (0..position.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let all = vec![true; index.len()];
    tree(&Mesh { position, index, ..Mesh::default() }, &all)
}

fn tree(mesh: &Mesh, which: &[bool]) -> Result<Option<ffi::Scene>, Error> {
    let index: Vec<[u32; 3]> = mesh.index.iter().zip(which).filter(|(_, w)| **w).map(|(t, _)| *t).collect();
    if index.is_empty() {
        return Ok(None);
    }
    let mut builder = ffi::SceneBuilder::new(&ffi::Device::new()?)?;
    let position: Vec<[f32; 3]> = mesh.position.iter().map(|p| p.to_array()).collect();
    builder.add_triangles(&position, &index)?;
    Ok(Some(builder.commit()?))
}

fn segment(from: Vec3, to: Vec3) -> ffi::Ray {
    let way = to - from;
    let mut ray = ffi::Ray::new((from - OVERLAP * way).into(), way.into());
    ray.tfar = 1.0 + 2.0 * OVERLAP;
    ray
}

/// `n` unit vectors evenly over the sphere: a Fibonacci spiral.
pub(super) fn sphere(n: usize) -> Vec<Vec3> {
    let at = |i: usize| {
        let y = 1.0 - (2 * i + 1) as f32 / n as f32;
        let (sin, cos) = (i as f32 * std::f32::consts::PI * (3.0 - 5f32.sqrt())).sin_cos();
        let r = (1.0 - y * y).sqrt();
        Vec3::new(r * cos, y, r * sin)
    };
    (0..n).map(at).collect()
}
