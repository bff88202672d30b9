//! Which vertices light reaches through portals alone.

use lunette_ffi as ffi;
use lunette_scenes::{Portal, Scene};
use rayon::prelude::*;

use super::orient;
use crate::gather::packet;
use crate::portal::Gates;
use crate::sampling::{HemisphereSets, LANES};
use crate::{Error, Surface};

/// Rays per vertex. One whose leak fills less of its hemisphere than about a hundredth may pass for inside.
const RAYS: usize = 256;

/// For each vertex whether every ray from it that escapes passes a portal: where light transfer through portals is
/// all there is. `scene` is without the portals' triangles. What sees nothing of the outside counts as inside.
///
/// # Errors
/// When Embree cannot be had or refuses the scene.
pub fn inside(scene: &Scene, portals: &[Portal]) -> Result<Vec<bool>, Error> {
    let mut surface = Surface::new(scene)?;
    let mut portals = portals.to_vec();
    orient(scene, &mut portals)?;
    surface.keep_inside(&portals);
    let gates = Gates::new(&portals)?;
    let sets = HemisphereSets::new(RAYS, 0);
    let is_inside = |v: usize| {
        let (set, frame) = sets.at(v, scene.mesh.normal[v]);
        set.iter().all(|local| {
            let (rays, _) = packet(surface.origin[v], &frame, local);
            let mut shadow = rays;
            surface.tree.occluded_packet(&ffi::Mask::all(), &mut shadow);
            let passes = gates.any(&ffi::Mask::all(), &rays);
            (0..LANES).all(|lane| shadow.is_occluded(lane) || passes[lane])
        })
    };
    Ok((0..scene.mesh.position.len()).into_par_iter().map(is_inside).collect())
}
