//! Glossy vertices: what their Phong lobes send to an eye, evaluated anew for each view.
//!
//! With d the direction from the eye, n the normal and r = d - 2 (d·n) n its mirror direction, a vertex of specular
//! reflectance Ks and exponent e sends out, beside what its albedo does,
//!
//! ```text
//! L(r) = Ks (e + 2)/(2π) ∫ L_i(ω) max(r·ω, 0)^e max(n·ω, 0) dω
//!      ≈ Ks (e + 2)/(2π) Σ_j M[j] L[j] max(r·ω_j, 0)^e
//! ```
//!
//! in the light's unit. The matrix from light to outgoing directions is never multiplied out: its kernel is known, so
//! that M\[j\] = ∫ V max(n·ω, 0) dω, steradians, and a direction ω_j are all there is to store, for any number of outgoing
//! directions. Direct light takes M from the vertex's own row on the portal's cubemap, without a byte more: j is a
//! texel. A small disc of the shell, a sun, shines sharper than a texel
//! ([`PortalFrame::set_shell_with_discs`]): its lobe is that of its axis. Bounced light comes from P patches of the surface: j is a patch that the vertex sees, in the mean direction
//! in which it sees it, and L\[j\] what the patch sends out diffusely under the irradiance of the moment, bounces of all
//! orders included; so a sun, other glass and any number of portals need no other matrix.
//!
//! A lobe of exponent 10 halves within 0.37 radians; texels of 0.05 and patches cut to be seen under angles of that
//! order are fine enough for it, up to [`HIGHEST_EXPONENT`].
//!
//! Tensors (V vertices, G of them glossy, N entries):
//!
//! | name | type | |
//! |---|---|---|
//! | `glossy.vertex` | u32 \[G\] | which, rising |
//! | `glossy.lobe` | f32 \[G,4\] | Ks red, green, blue; exponent |
//! | `glossy.patch` | u16 \[V\] | patch of each vertex of the mesh |
//! | `glossy.share` | f16 \[V\] | part of its patch that it stands for, times the tensor's scale: 1 over a patch |
//! | `glossy.start` | u32 \[G+1\] | row g has the entries `start[g]..start[g+1]` |
//! | `glossy.source` | u16 \[N\] | patch |
//! | `glossy.direction` | u16 \[N\] | texel of a 104 x 104 x 6 cubemap |
//! | `glossy.weight` | f16 \[N\] | M, times the tensor's scale |
//!
//! The last six are absent where no bounced light is baked.
//!
//! What glossy vertices send on to others: see [`indirect`](crate::indirect).
//!
//! Where it breaks: a patch shines evenly, also where its edge is in the sun; lobes see other glossy surfaces as diffuse ones
//! of the same mean reflectance ([`mean_reflectance`]); and a frame's radiance is that of vertices, so that a mesh must be fine
//! where it curves, or each point be asked for ([`Glossy::radiance_at`]), as pictures do.
//!
//! Based on: Yue, Iwasaki, Chen, Dobashi and Nishita, Interactive Rendering of Interior Scenes with Dynamic
//! Environment Illumination, 2009, section 4.1 (rows per outgoing direction); Lafortune and Willems, Using the Modified
//! Phong Reflectance Model for Physically Based Rendering, 1994.

use std::f32::consts::PI;

use glam::{Vec3, Vec4};
use half::f16;

use crate::asset::{Asset, Error};
use crate::cubemap::n_texels;
use crate::portal_frame::{Detail, Point, PortalFrame, Scratch};
use crate::sparse::{Rows, decode};

mod lobe;
mod matrix;
#[cfg(test)]
mod tests;

pub use lobe::mean_reflectance;
use lobe::{Entries, Lobe};
pub(crate) use matrix::check;
use matrix::{Matrix, Seen};

/// Materials of a higher exponent are to be shaded as diffuse.
pub const HIGHEST_EXPONENT: f32 = 64.0;

/// Texels on a side of the cubemap whose texels number stored directions: the finest that 16 bits count, 0.015 radians.
pub const DIRECTION_SIDE: usize = 104;

/// How a vertex is glossy.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GlossyVertex {
    pub vertex: u32,
    pub normal: Vec3,
    pub specular: Vec3,
    pub exponent: f32,
}

/// The glossy vertices of an asset, rising.
///
/// # Errors
/// When their tensors do not hold together.
pub(crate) fn glossy_vertices(asset: &Asset) -> Result<Vec<GlossyVertex>, Error> {
    let Some(matrix) = Matrix::open(asset)? else { return Ok(Vec::new()) };
    let of = |(&vertex, &[r, g, b, exponent]): (&u32, &[f32; 4])| {
        let normal = Vec3::from(asset.normals()[vertex as usize]);
        GlossyVertex { vertex, normal, specular: Vec3::new(r, g, b), exponent }
    };
    Ok(matrix.vertex.iter().zip(matrix.lobe).map(of).collect())
}

/// The glossy vertices of an asset, and the light of the moment on all that they see.
pub struct Glossy<'a> {
    matrix: Matrix<'a>,
    position: &'a [[f32; 3]],
    normal: &'a [[f32; 3]],
    direct: Vec<Direct>,
    bounced: Option<Bounced>,
    beams: Vec<Beam>,
    scratch: Scratch,
}

/// A small disc of light through a portal.
struct Beam {
    /// Towards it.
    axis: Vec3,
    /// By it, of each glossy vertex.
    irradiance: Vec<Vec3>,
}

/// Rows of the glossy vertices on a portal's cubemap, texel by texel, and its light.
struct Direct {
    start: Vec<u32>,
    weight: Vec<f32>,
    texel: Vec<u16>,
    side: usize,
    light: Vec<Vec4>,
}

/// What patches send out.
struct Bounced {
    weight: Vec<f32>,
    /// The vertex's part of its patch times its reflectance over π, per vertex of the mesh.
    share: Vec<Vec3>,
    light: Vec<Vec4>,
}

impl<'a> Glossy<'a> {
    /// The glossy vertices of an asset, in darkness; `None` where it has none. Rows in wavelets are unpacked here.
    ///
    /// # Errors
    /// When its tensors do not hold together, which an asset that was read cannot have.
    pub fn open(asset: &'a Asset<'a>) -> Result<Option<Glossy<'a>>, Error> {
        let Some(matrix) = Matrix::open(asset)? else { return Ok(None) };
        let mut direct = Vec::new();
        while let Some(rows) = Rows::open(asset, &format!("portal.{}.direct", direct.len()))? {
            direct.push(Direct::unpack(&rows, matrix.vertex));
        }
        let bounced = matrix.seen.as_ref().map(|seen| Bounced {
            weight: seen.weight.iter().map(|w| w.to_f32() * seen.scale).collect(),
            share: shares(asset, seen),
            light: vec![Vec4::ZERO; seen.n_patches],
        });
        let (position, normal) = (asset.positions(), asset.normals());
        Ok(Some(Glossy {
            matrix,
            position,
            normal,
            direct,
            bounced,
            beams: Vec::new(),
            scratch: Scratch::default(),
        }))
    }

    /// The glossy vertices, rising.
    pub fn vertices(&self) -> &'a [u32] {
        self.matrix.vertex
    }

    /// Takes on the light behind the glass of all portals, and the irradiance of all vertices of the mesh, direct and
    /// bounced together, of which patches send on. Allocates only for more small discs than ever before.
    ///
    /// # Panics
    /// When the frame is of another asset, or `irradiance` is not one value per vertex.
    pub fn project(&mut self, frame: &PortalFrame, irradiance: &[[f32; 3]]) {
        assert_eq!(frame.n_portals(), self.direct.len(), "a frame of the same asset");
        let mut n_beams = 0;
        for (k, direct) in self.direct.iter_mut().enumerate() {
            let (texels, shafts) = frame.apart(k);
            for (to, &[r, g, b]) in direct.light.iter_mut().zip(texels) {
                *to = Vec4::new(r, g, b, 0.0);
            }
            for shaft in shafts {
                if self.beams.len() == n_beams {
                    self.beams.push(Beam { axis: Vec3::Y, irradiance: Vec::new() });
                }
                let beam = &mut self.beams[n_beams];
                beam.axis = shaft.axis();
                beam.irradiance.clear();
                let of = |&v: &u32| shaft.irradiance(v as usize, &mut self.scratch);
                beam.irradiance.extend(self.matrix.vertex.iter().map(of));
                n_beams += 1;
            }
        }
        self.beams.truncate(n_beams);
        let (Some(bounced), Some(seen)) = (&mut self.bounced, &self.matrix.seen) else { return };
        assert_eq!(irradiance.len(), bounced.share.len(), "one irradiance per vertex");
        bounced.light.fill(Vec4::ZERO);
        for ((patch, share), e) in seen.patch.iter().zip(&bounced.share).zip(irradiance) {
            if let Some(light) = bounced.light.get_mut(usize::from(*patch)) {
                *light += (*share * Vec3::from(*e)).extend(0.0);
            }
        }
    }

    /// Writes the radiance that the glossy vertices from the `first`th on send to `eye` (metres) by their lobes. Does not
    /// allocate.
    ///
    /// # Panics
    /// When there are not that many.
    pub fn radiance(&self, eye: [f32; 3], first: usize, out: &mut [[f32; 3]]) {
        for (g, out) in (first..first + out.len()).zip(out) {
            let v = self.matrix.vertex[g] as usize;
            let d = (Vec3::from(self.position[v]) - Vec3::from(eye)).normalize_or_zero();
            let beams = self.beams.iter().map(|beam| (beam.axis, beam.irradiance[g]));
            *out = self.reflected(g, d.reflect(Vec3::from(self.normal[v])), beams).to_array();
        }
    }

    /// As [`Glossy::radiance`], over all threads of the current rayon pool.
    ///
    /// # Panics
    /// When `out` is not one value per glossy vertex.
    #[cfg(feature = "rayon")]
    pub fn radiance_parallel(&self, eye: [f32; 3], out: &mut [[f32; 3]]) {
        use rayon::prelude::*;
        assert_eq!(out.len(), self.matrix.vertex.len(), "one radiance per glossy vertex");
        let task = 64;
        out.par_chunks_mut(task).enumerate().for_each(|(i, out)| self.radiance(eye, i * task, out));
    }

    /// The radiance that lobes send to `eye` (metres) at a point between vertices, of which those corners count that are
    /// glossy: what each receives, mirrored as at the point, and beams as sharp as `detail`, of the projected frame, has them.
    /// Sharper than [`radiance`](Self::radiance) interpolated where a surface curves, for more time.
    ///
    /// # Panics
    /// When there are no such vertices.
    pub fn radiance_at(&self, eye: [f32; 3], point: &Point, detail: &mut Detail) -> [f32; 3] {
        let corners = point.corners.map(|v| self.matrix.vertex.binary_search(&v).ok());
        let glossy = || corners.into_iter().zip(point.weights).filter_map(|(g, w)| Some((g?, w)));
        if glossy().all(|(_, weight)| weight <= 0.0) {
            return [0.0; 3];
        }
        let normal_of = |g: usize| Vec3::from(self.normal[self.matrix.vertex[g] as usize]);
        let normal = glossy().map(|(g, w)| w * normal_of(g)).sum::<Vec3>().normalize_or_zero();
        let d = (point.mean(self.position) - Vec3::from(eye)).normalize_or_zero();
        let r = d.reflect(normal);
        let beams = detail.beams(point);
        let seen = |(g, weight)| weight * self.reflected(g, r, beams.iter().copied());
        glossy().map(seen).sum::<Vec3>().to_array()
    }

    /// The radiance that the lobe of glossy vertex number `g` about the unit mirror direction `r` brings, from beams in these
    /// directions, of which that is the irradiance, and all else.
    fn reflected(&self, g: usize, r: Vec3, beams: impl Iterator<Item = (Vec3, Vec3)>) -> Vec3 {
        let [red, green, blue, exponent] = self.matrix.lobe[g];
        let lobe = Lobe::new(r, exponent);
        let mut sum = Vec4::ZERO;
        for direct in &self.direct {
            let row = direct.start[g] as usize..direct.start[g + 1] as usize;
            let (weight, texel) = (&direct.weight[row.clone()], &direct.texel[row]);
            let entries = Entries { weight, direction: texel, side: direct.side, source: texel };
            sum += lobe.sum(&entries, &direct.light);
        }
        for (axis, irradiance) in beams {
            sum += lobe.kernel(axis) * irradiance.extend(0.0);
        }
        if let (Some(bounced), Some(seen)) = (&self.bounced, &self.matrix.seen) {
            let row = seen.start[g] as usize..seen.start[g + 1] as usize;
            let entries = Entries {
                weight: &bounced.weight[row.clone()],
                direction: &seen.direction[row.clone()],
                side: DIRECTION_SIDE,
                source: &seen.source[row],
            };
            sum += lobe.sum(&entries, &bounced.light);
        }
        Vec3::new(red, green, blue) * lobe.normalisation() * sum.truncate()
    }

    /// Bytes in the file for each glossy vertex, beyond the direct rows that every vertex has.
    pub fn bytes_per_vertex(&self) -> f32 {
        let seen = self.matrix.seen.as_ref();
        let bytes = seen.map_or(0, |s| 6 * s.source.len() + 4 * s.start.len() + 4 * s.patch.len());
        20.0 + bytes as f32 / self.matrix.vertex.len() as f32
    }

    /// Entries that a view reads for each glossy vertex, in the mean: texels and patches.
    pub fn entries_per_vertex(&self) -> (f32, f32) {
        let texels: usize = self.direct.iter().map(|d| d.texel.len()).sum();
        let patches = self.bounced.as_ref().map_or(0, |b| b.weight.len());
        let n = self.matrix.vertex.len() as f32;
        (texels as f32 / n, patches as f32 / n)
    }
}

impl Direct {
    fn unpack(rows: &Rows, vertices: &[u32]) -> Direct {
        let n = rows.n();
        let (mut start, mut weight, mut texel) = (vec![0], Vec::new(), Vec::new());
        for &v in vertices {
            for (t, w) in decode(n, &rows.row(v as usize)).into_iter().enumerate() {
                if w != 0.0 {
                    weight.push(w);
                    texel.push(t as u16);
                }
            }
            start.push(weight.len() as u32);
        }
        Direct { start, weight, texel, side: n, light: vec![Vec4::ZERO; n_texels(n)] }
    }
}

/// Reflectance of each vertex for light that bounces: its albedo, and where it is glossy, Ks times
/// [`mean_reflectance`] as if that were diffuse.
pub fn reflectance(asset: &Asset) -> Vec<Vec3> {
    let mut reflectance: Vec<Vec3> = asset.albedo().iter().map(|a| Vec3::from(*a)).collect();
    if let Ok(Some(matrix)) = Matrix::open(asset) {
        for (&v, &[r, g, b, exponent]) in matrix.vertex.iter().zip(matrix.lobe) {
            reflectance[v as usize] += Vec3::new(r, g, b) * mean_reflectance(exponent);
        }
    }
    reflectance
}

/// Per vertex the radiance that its patch sends out for each unit of the vertex's irradiance.
fn shares(asset: &Asset, seen: &Seen) -> Vec<Vec3> {
    let share = |(share, rho): (&f16, Vec3)| rho * share.to_f32() * seen.share_scale / PI;
    seen.share.iter().zip(reflectance(asset)).map(share).collect()
}
