//! The openings as rays see them: which portal, if any, a ray leaves through.

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_scenes::Portal;

use crate::Error;

/// All portal triangles in one tree. They block nothing; light through several portals in a row counts for the
/// one nearest to the receiver, so that no direction counts twice.
pub struct Gates {
    tree: ffi::Scene,
    portal_of: Vec<u32>,
    lie_in_one_plane: bool,
}

/// Triangles whose unit normals differ by less than this, and whose distances from a plane are less than this share of
/// their distance from its point, lie in it.
const SAME_PLANE: f32 = 1e-4;

impl Gates {
    /// Builds the tree.
    ///
    /// # Errors
    /// When Embree is missing or refuses the triangles.
    pub fn new(portals: &[Portal]) -> Result<Gates, Error> {
        let mut builder = ffi::SceneBuilder::new(&ffi::Device::new()?)?;
        let corners: Vec<[f32; 3]> =
            portals.iter().flat_map(|p| p.triangles.iter().flatten().map(|c| c.to_array())).collect();
        let index: Vec<[u32; 3]> =
            (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        builder.add_triangles(&corners, &index)?;
        let owner = |(k, p): (usize, &Portal)| std::iter::repeat_n(k as u32, p.triangles.len());
        let triangles: Vec<[Vec3; 3]> = portals.iter().flat_map(|p| p.triangles.iter().copied()).collect();
        Ok(Gates {
            tree: builder.commit()?,
            portal_of: portals.iter().enumerate().flat_map(owner).collect(),
            lie_in_one_plane: lie_in_one_plane(&triangles),
        })
    }

    /// Whether no ray can pass two of the triangles.
    pub fn lie_in_one_plane(&self) -> bool {
        self.lie_in_one_plane
    }

    /// The first portal that a ray passes.
    pub fn first(&self, origin: Vec3, d: Vec3) -> Option<u32> {
        let hit = self.tree.intersect(&ffi::Ray::new(origin.into(), d.into()))?;
        Some(self.portal_of[hit.primitive as usize])
    }

    /// The first portal that a ray passes within a distance.
    pub fn first_before(&self, origin: Vec3, d: Vec3, distance: f32) -> Option<u32> {
        let ray = ffi::Ray { tfar: distance, ..ffi::Ray::new(origin.into(), d.into()) };
        Some(self.portal_of[self.tree.intersect(&ray)?.primitive as usize])
    }

    /// How far a ray goes to the first portal that it passes, in lengths of `d`.
    pub fn way(&self, origin: Vec3, d: Vec3) -> Option<f32> {
        Some(self.tree.intersect(&ffi::Ray::new(origin.into(), d.into()))?.t)
    }

    /// For each ray of a packet whether it passes a portal before its end; not for lanes that are off.
    pub fn any(&self, mask: &ffi::Mask<16>, rays: &ffi::Packet<16>) -> [bool; 16] {
        let mut rays = *rays;
        self.tree.occluded_packet(mask, &mut rays);
        std::array::from_fn(|lane| mask.is_on(lane) && rays.is_occluded(lane))
    }
}

fn lie_in_one_plane(triangles: &[[Vec3; 3]]) -> bool {
    let normal = |[a, b, c]: &[Vec3; 3]| (*b - *a).cross(*c - *a).normalize_or_zero();
    let Some(first) = triangles.first() else { return true };
    let (point, up) = (first[0], normal(first));
    triangles.iter().all(|t| {
        normal(t).dot(up).abs() > 1.0 - SAME_PLANE
            && t.iter().all(|p| (*p - point).dot(up).abs() <= SAME_PLANE * (*p - point).length())
    })
}
