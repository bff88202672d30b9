//! Bounced light carried from direct light, whatever it came from.
//!
//! The bake has cut the surface into P patches. A frame computes the direct irradiance of all vertices, then
//!
//! ```text
//! R[p]  = Σ area ρ E_direct / Σ area            over the vertices of patch p, per colour
//! z[j]  = Σ_p spread[p, j] R[p]                 per colour, k of them
//! E(v) += Σ_j gather[v, j] z[j]
//! ```
//!
//! `spread` holds all bounces and their colours, `gather` what a vertex sees of the patches: E is irradiance without
//! the receiver's albedo, in the unit of the light. A vertex's area is a third of its triangles'.
//!
//! Where it breaks: the pattern of direct light within a patch is lost to what it bounces on to, so that a patch with
//! a narrow beam on its edge glows as a whole.
//!
//! Based on: Hašan, Pellacini and Bala, Direct-to-Indirect Transfer for Cinematic Relighting, 2006.

use glam::Vec3;
use half::f16;

use crate::asset::{Asset, Data, NO_PATCH};
use crate::glossy::reflectance;
use crate::light::{Cap, Light, split};
use crate::{dot, shell};

/// How bounced light is carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Indirect {
    /// Not at all: direct light alone.
    None,
    /// Spherical harmonics of the light: smooth skies.
    #[default]
    Sh,
    /// [`Carrier`]: suns, too.
    DirectToIndirect,
}

impl Indirect {
    /// What suits a light: direct to indirect where it is baked and the light has a sun (or no SH is baked), SH where
    /// that is baked otherwise.
    pub fn for_light(asset: &Asset, light: &Light) -> Indirect {
        let mut caps: Vec<Cap> = Vec::new();
        split(light, &mut caps);
        let is_sunny = caps.iter().any(|cap| cap.radius < WIDEST_SUN);
        Indirect::choose(asset, if is_sunny { Kind::Sunny } else { Kind::Smooth })
    }

    /// As [`Indirect::for_light`], for captured shells.
    pub fn for_shells<'s>(asset: &Asset, shells: impl IntoIterator<Item = shell::Shell<'s>>) -> Indirect {
        let is_sunny = shells.into_iter().any(|shell| shell.has_sun());
        Indirect::choose(asset, if is_sunny { Kind::Sunny } else { Kind::Smooth })
    }

    fn choose(asset: &Asset, kind: Kind) -> Indirect {
        let has_carrier = asset.tensor("indirect.gather").is_some();
        let has_sh = asset.tensors().any(|(name, _)| name.ends_with(".indirect.sh"));
        match (has_carrier, has_sh) {
            (true, false) => Indirect::DirectToIndirect,
            (true, true) if kind == Kind::Sunny => Indirect::DirectToIndirect,
            (_, true) => Indirect::Sh,
            (false, false) => Indirect::None,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Sunny,
    Smooth,
}

/// A disc narrower than this, radians, is a sun: SH of order 4 holds features of about π / 4.
const WIDEST_SUN: f32 = 0.4;

/// Vertices whose sums lie on the stack at a time.
const BLOCK: usize = 128;

/// The direct-to-indirect part of an asset, and the bounced light of the moment.
#[derive(Clone, Debug)]
pub struct Carrier<'a> {
    patch: &'a [u16],
    /// area ρ / area of the patch, per vertex.
    weight: Vec<Vec3>,
    spread: &'a [[f32; 3]],
    gather: &'a [f16],
    scale: f32,
    reflected: Vec<[f32; 3]>,
    z: Vec<[f32; 3]>,
}

impl<'a> Carrier<'a> {
    /// The carrier of an asset; `None` where none is baked. Bounced light is dark until [`Carrier::reflect`].
    pub fn open(asset: &'a Asset<'a>) -> Option<Carrier<'a>> {
        let spread = asset.tensor("indirect.spread")?;
        let &[n_patches, k, 3] = spread.shape.as_slice() else { return None };
        let (Data::F32(spread), Data::U16(patch)) = (&spread.data, &asset.tensor("indirect.patch")?.data)
        else {
            return None;
        };
        let (gather, scale) = asset.half("indirect.gather")?;
        // Both hold for every asset that was read; one made by hand may break them.
        if gather.len() != patch.len() * k || patch.len() != asset.n_vertices() || k == 0 {
            return None;
        }
        Some(Carrier {
            patch,
            weight: weights(asset, patch, n_patches),
            spread: bytemuck::cast_slice(spread),
            gather,
            scale,
            reflected: vec![[0.0; 3]; n_patches],
            z: vec![[0.0; 3]; k],
        })
    }

    /// Takes on the direct irradiance of all vertices.
    ///
    /// # Panics
    /// When `direct` is not one value per vertex.
    pub fn reflect(&mut self, direct: &[[f32; 3]]) {
        assert_eq!(
            direct.len(),
            self.patch.len(),
            "bounced light starts from the direct light of all vertices"
        );
        self.reflected.fill([0.0; 3]);
        for ((patch, weight), direct) in self.patch.iter().zip(&self.weight).zip(direct) {
            if let Some(sum) = self.reflected.get_mut(usize::from(*patch)) {
                for ((s, w), e) in sum.iter_mut().zip(weight.to_array()).zip(direct) {
                    *s += w * e;
                }
            }
        }
        self.z.fill([0.0; 3]);
        for (row, reflected) in self.spread.chunks_exact(self.z.len()).zip(&self.reflected) {
            for (z, spread) in self.z.iter_mut().zip(row) {
                for c in 0..3 {
                    z[c] += self.scale * spread[c] * reflected[c];
                }
            }
        }
    }

    /// Adds bounced irradiance to the vertices from `first` on.
    ///
    /// # Panics
    /// When there are not that many vertices.
    pub fn add(&self, first: usize, out: &mut [[f32; 3]]) {
        let k = self.z.len();
        let rows = &self.gather[first * k..(first + out.len()) * k];
        let mut sums = [[0.0; 3]; BLOCK];
        for (rows, out) in rows.chunks(BLOCK * k).zip(out.chunks_mut(BLOCK)) {
            let sums = &mut sums[..out.len()];
            dot::sh(rows, &self.z, sums);
            for (o, s) in out.as_flattened_mut().iter_mut().zip(sums.as_flattened()) {
                *o += s;
            }
        }
    }

    /// k: what a vertex stores, two bytes each, and two more for its patch.
    pub fn rank(&self) -> usize {
        self.z.len()
    }
}

/// area ρ / area of the patch, per vertex; 0 for a patch without area.
fn weights(asset: &Asset, patch: &[u16], n_patches: usize) -> Vec<Vec3> {
    let area = vertex_area(asset);
    let mut patch_area = vec![0.0f64; n_patches];
    for (p, area) in patch.iter().zip(&area) {
        if *p != NO_PATCH {
            patch_area[usize::from(*p).min(n_patches - 1)] += area;
        }
    }
    let weight = |((p, area), albedo): ((&u16, &f64), Vec3)| match patch_area.get(usize::from(*p)) {
        Some(total) if *total > 0.0 => albedo * (area / total) as f32,
        _ => Vec3::ZERO,
    };
    patch.iter().zip(&area).zip(reflectance(asset)).map(weight).collect()
}

fn vertex_area(asset: &Asset) -> Vec<f64> {
    let position = asset.positions();
    let mut area = vec![0.0; position.len()];
    for triangle in asset.triangles() {
        let [p, q, r] = triangle.map(|v| Vec3::from(position[v as usize]).as_dvec3());
        for v in triangle {
            area[*v as usize] += (q - p).cross(r - p).length() / 6.0;
        }
    }
    area
}

#[cfg(test)]
mod tests;
