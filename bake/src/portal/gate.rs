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
}

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
        Ok(Gates { tree: builder.commit()?, portal_of: portals.iter().enumerate().flat_map(owner).collect() })
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

    /// For each ray of a packet whether it passes any portal.
    pub fn any(&self, rays: &ffi::Packet<16>) -> [bool; 16] {
        let mut rays = *rays;
        self.tree.occluded_packet(&ffi::Mask::all(), &mut rays);
        std::array::from_fn(|lane| rays.is_occluded(lane))
    }

    /// For each ray of a packet whether the first portal it passes is `portal`.
    pub fn pass(&self, portal: u32, rays: &ffi::Packet<16>) -> [bool; 16] {
        let mut rays = *rays;
        let mut hits = ffi::Hits::<16>::default();
        self.tree.intersect_packet(&ffi::Mask::all(), &mut rays, &mut hits);
        std::array::from_fn(|lane| {
            hits.geometry[lane] != ffi::NO_HIT && self.portal_of[hits.primitive[lane] as usize] == portal
        })
    }
}
