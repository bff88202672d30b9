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
//! and, with the light B that leaves each patch, what comes from the few patches that fill most of a row's view,
//!
//! ```text
//! B[p]  = R[p] + ρ[p] (Σ_j gather[V + p, j] z[j] + Σ_n share[V + p, n] B[patch[V + p, n]])     solved by iteration
//! E(v) += Σ_n share[v, n] B[patch[v, n]]
//! ```
//!
//! `spread` holds all bounces and their colours, `gather` what a vertex sees of the patches, but for the near ones: E is
//! irradiance without the receiver's albedo, in the unit of the light. A vertex's area is a third of its triangles'.
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

/// Patches of a row that are kept one by one.
pub const N_NEAR: usize = 12;

/// Most steps by which B is found, each a bounce: a near patch gives back at most its albedo, mostly much less.
const STEPS: usize = 8;

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
    near_patch: &'a [u16],
    near_share: &'a [f16],
    near_scale: f32,
    /// Of each patch.
    albedo: Vec<Vec3>,
    reflected: Vec<[f32; 3]>,
    z: Vec<[f32; 3]>,
    /// Light at the patches from far, and all that leaves them.
    far: Vec<[f32; 3]>,
    leaving: Vec<Vec3>,
    next: Vec<Vec3>,
    steps: usize,
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
        let (near_share, near_scale) = asset.half("indirect.near.share")?;
        let Data::U16(near_patch) = &asset.tensor("indirect.near.patch")?.data else { return None };
        // All hold for every asset that was read; one made by hand may break them.
        let n_rows = patch.len() + n_patches;
        let fits = gather.len() == n_rows * k
            && near_share.len() == n_rows * N_NEAR
            && near_patch.len() == n_rows * N_NEAR
            && near_patch.iter().all(|&p| usize::from(p) < n_patches);
        if !fits || patch.len() != asset.n_vertices() || k == 0 {
            return None;
        }
        let weight = weights(asset, patch, n_patches);
        let mut albedo = vec![Vec3::ZERO; n_patches];
        for (p, w) in patch.iter().zip(&weight) {
            if let Some(sum) = albedo.get_mut(usize::from(*p)) {
                *sum += *w;
            }
        }
        Some(Carrier {
            patch,
            weight,
            spread: bytemuck::cast_slice(spread),
            gather,
            scale,
            near_patch,
            near_share,
            near_scale,
            albedo,
            reflected: vec![[0.0; 3]; n_patches],
            z: vec![[0.0; 3]; k],
            far: vec![[0.0; 3]; n_patches],
            leaving: vec![Vec3::ZERO; n_patches],
            next: vec![Vec3::ZERO; n_patches],
            steps: bounces(asset).saturating_sub(1).min(STEPS),
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
        self.leave();
    }

    /// Finds the light that leaves the patches.
    fn leave(&mut self) {
        let (k, n_vertices) = (self.z.len(), self.patch.len());
        dot::sh(&self.gather[n_vertices * k..], &self.z, &mut self.far);
        let mut next = std::mem::take(&mut self.next);
        self.leaving.iter_mut().zip(&self.reflected).for_each(|(b, r)| *b = Vec3::from(*r));
        for _ in 0..self.steps {
            for (p, next) in next.iter_mut().enumerate() {
                let arriving = Vec3::from(self.far[p]) + self.near(n_vertices + p, &self.leaving);
                *next = Vec3::from(self.reflected[p]) + self.albedo[p] * arriving.max(Vec3::ZERO);
            }
            std::mem::swap(&mut self.leaving, &mut next);
        }
        self.next = next;
    }

    /// Light from the near patches of a row.
    fn near(&self, row: usize, leaving: &[Vec3]) -> Vec3 {
        let range = row * N_NEAR..(row + 1) * N_NEAR;
        let (shares, patches) = (&self.near_share[range.clone()], &self.near_patch[range]);
        let mut sum = Vec3::ZERO;
        for (share, p) in shares.iter().zip(patches) {
            let share = share.to_f32();
            if share == 0.0 {
                break;
            }
            sum += share * leaving[usize::from(*p)];
        }
        self.near_scale * sum
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
        for (i, out) in out.iter_mut().enumerate() {
            *out = (Vec3::from(*out) + self.near(first + i, &self.leaving)).to_array();
        }
    }

    /// k.
    pub fn rank(&self) -> usize {
        self.z.len()
    }

    /// What a vertex stores: k numbers, its near patches and shares, and its own patch.
    pub fn bytes_per_vertex(&self) -> usize {
        2 * self.rank() + 4 * N_NEAR + 2
    }
}

/// How often light bounces in an asset; endlessly where it does not say.
fn bounces(asset: &Asset) -> usize {
    let value = asset.metadata.options.get("bounces").and_then(serde_json::Value::as_u64);
    value.map_or(usize::MAX, |n| n as usize)
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
