//! Which side of a portal is the interior: the one from which more rays meet something.

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_scenes::Portal;

use crate::Surface;
use crate::sampling::{HemisphereSets, LANES};

/// Rays on each side of a triangle.
const RAYS: usize = 64;

/// The portals with their triangles wound and their normals turned into the interior.
pub fn inwards(portals: &[Portal], surface: &Surface) -> Vec<Portal> {
    let sets = HemisphereSets::new(RAYS, 0x1d);
    let mut seed = 0;
    let mut turn = |t: &[Vec3; 3]| {
        seed += 1;
        let normal = (t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero();
        let middle = (t[0] + t[1] + t[2]) / 3.0;
        let side = |n: Vec3| n_hits(surface, &sets, seed, middle + surface.lift * n, n);
        if side(normal) < side(-normal) { [t[0], t[2], t[1]] } else { *t }
    };
    let turned = |p: &Portal| {
        let triangles = p.triangles.iter().map(&mut turn).collect();
        Portal::new(&p.name, triangles, p.transmission).unwrap_or_else(|| p.clone())
    };
    portals.iter().map(turned).collect()
}

fn n_hits(surface: &Surface, sets: &HemisphereSets, seed: usize, origin: Vec3, normal: Vec3) -> usize {
    let (set, frame) = sets.at(seed, normal);
    let hits = set.iter().flat_map(|d| (0..LANES).map(move |i| Vec3::new(d.x[i], d.y[i], d.z[i])));
    hits.filter(|d| surface.tree.occluded(&ffi::Ray::new(origin.into(), frame.to_world(*d).into()))).count()
}
