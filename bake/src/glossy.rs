//! Glossy vertices: which patches of the surface each sees, in which direction, and how large.
//!
//! With N rays ω_k uniform over the hemisphere of a glossy vertex and z_k = n·ω_k, the entry of patch p is
//!
//! M\[p\] = π Σ z_k / Σ_all z, steradians, and the direction Σ z_k ω_k, over the rays that meet the front of p.
//!
//! Dividing by Σ z makes an enclosure as bright as its walls with any number of rays. Patches are cut by importance:
//! where the lobes of the glossy vertices look, the surface is divided finely, elsewhere hardly, so that each patch
//! sends them about the same share of light. The importance of a mesh vertex is found with a few rays first.
//!
//! Direct light needs nothing here: a vertex's row on the portal's cubemap is reweighted by the lobe at run time.
//!
//! Where it breaks: a patch that is seen under an angle wider than the lobe shines evenly; light on backs of one-sided
//! surfaces is missed.
//!
//! Based on: Yue et al., Interactive Rendering of Interior Scenes with Dynamic Environment Illumination, 2009 (final
//! gathering of outgoing radiance at glossy vertices); M. Hašan, F. Pellacini, K. Bala, Direct-to-Indirect Transfer for
//! Cinematic Relighting, 2006 (bounced light from the direct light of the moment).

use std::borrow::Cow;
use std::f32::consts::PI;

use glam::Vec3;
use lunette_relight::asset::{Asset, Data, NO_PATCH};
use lunette_relight::cubemap;
use lunette_relight::glossy::{DIRECTION_SIDE, HIGHEST_EXPONENT, mean_reflectance};
use lunette_scenes::{Material, Scene};
use rayon::prelude::*;

use crate::carrier::Tree;
use crate::gather::fronts;
use crate::sampling::{HemisphereSets, hash};
use crate::{Error, Progress, Surface};

/// Patches by default.
pub const PATCHES: usize = 4096;

/// Rays of each glossy vertex by which importance is found: all of them together are many.
const PILOT_RAYS: usize = 64;

/// Share of a mesh vertex's area in its importance, beside what the few rays found, of the mean: that no patch is without.
const FLOOR: f64 = 1e-3;

/// How far apart the directions of an entry may lie, as 1 - |mean direction| times (exponent + 1): the variance on each of
/// two axes against that of the lobe, 1 / (exponent + 1). A lobe is seen that much broader than it is.
const WIDEST: f32 = 0.04;

/// Vertices traced between two looks at the progress.
const BLOCK: usize = 2048;

/// How fine.
#[derive(Clone, Copy, Debug)]
pub struct GlossyOptions {
    /// Most patches, 1..=65535.
    pub patches: usize,
    /// Rays per glossy vertex.
    pub rays: usize,
    /// How often light may bounce; 0 leaves bounced light out.
    pub bounces: usize,
    /// Seed.
    pub seed: u64,
}

/// Diffuse reflectance of a material for light that bounces: the lobe of a glossy one counts as diffuse.
pub fn reflectance(material: &Material) -> Vec3 {
    match material.lobe(HIGHEST_EXPONENT) {
        Some(lobe) => material.albedo + lobe.specular * mean_reflectance(lobe.exponent),
        None => material.albedo,
    }
}

/// As [`reflectance`], of each vertex.
pub fn vertex_reflectance(scene: &Scene) -> Vec<Vec3> {
    let lobes = scene.vertex_lobes(HIGHEST_EXPONENT);
    let of = |(albedo, l): (Vec3, &lunette_scenes::Lobe)| albedo + l.specular * mean_reflectance(l.exponent);
    scene.vertex_albedo().into_iter().zip(&lobes).map(of).collect()
}

/// Adds the tensors of the scene's glossy vertices to an asset and gives a line about them; nothing where it has none.
/// Vertex v is computed as if it lay where `source[v]` lies.
///
/// # Errors
/// When `progress` asks to stop.
pub fn insert(
    asset: &mut Asset<'static>,
    scene: &Scene,
    surface: &Surface,
    source: &[usize],
    options: &GlossyOptions,
    progress: &dyn Progress,
) -> Result<Option<String>, Error> {
    let lobes = scene.vertex_lobes(HIGHEST_EXPONENT);
    let glossy: Vec<usize> = (0..lobes.len()).filter(|&v| lobes[v].specular != Vec3::ZERO).collect();
    if glossy.is_empty() {
        return Ok(None);
    }
    let number = |&v: &usize| v as u32;
    asset.insert("glossy.vertex", &[glossy.len()], Data::U32(glossy.iter().map(number).collect()));
    let lobe = |&v: &usize| lobes[v].specular.extend(lobes[v].exponent).to_array();
    asset.insert("glossy.lobe", &[glossy.len(), 4], Data::F32(glossy.iter().flat_map(lobe).collect()));
    if options.bounces == 0 {
        return Ok(Some(format!("{} glossy vertices", glossy.len())));
    }
    let exponents: Vec<f32> = lobes.iter().map(|l| l.exponent).collect();
    let work = Work { surface, source, glossy: &glossy, exponents: &exponents, seed: options.seed, progress };
    let importance = work.importance()?;
    let (all, evenly) = ([(0..importance.len()).collect()], vec![0.0; importance.len()]);
    let patches = options.patches.clamp(1, usize::from(u16::MAX));
    let leaf = Tree::new(scene, &importance, &evenly, &all, patches).leaf_of_vertices();
    let patch: Vec<u16> = leaf.into_iter().map(|leaf| leaf.unwrap_or(NO_PATCH)).collect();
    let rows = work.rows(&patch, options.rays)?;
    let bytes = 20.0 + 6.0 * rows.weight.len() as f64 / glossy.len() as f64;
    rows.insert_into(asset);
    asset.insert_scaled("glossy.share", &[patch.len()], &shares(&patch, &importance));
    asset.insert("glossy.patch", &[patch.len()], Data::U16(Cow::Owned(patch)));
    Ok(Some(format!("{} glossy vertices, {bytes:.0} bytes of bounced light for each", glossy.len())))
}

struct Work<'a> {
    surface: &'a Surface<'a>,
    source: &'a [usize],
    glossy: &'a [usize],
    /// Phong exponent of each vertex of the mesh.
    exponents: &'a [f32],
    seed: u64,
    progress: &'a dyn Progress,
}

/// The part of its patch that each vertex stands for: of what the glossy vertices see of it, so that a corner hidden from
/// all of them, in the dark below the object, does not count.
fn shares(patch: &[u16], importance: &[f32]) -> Vec<f32> {
    let mut sums = vec![0.0f64; patch.iter().max().map_or(0, |&p| usize::from(p) + 1)];
    patch.iter().zip(importance).for_each(|(&p, i)| sums[usize::from(p)] += f64::from(*i));
    let share = |(&p, i): (&u16, &f32)| (f64::from(*i) / sums[usize::from(p)].max(f64::MIN_POSITIVE)) as f32;
    patch.iter().zip(importance).map(share).collect()
}

/// A part of a patch as a vertex sees it.
#[derive(Clone, Copy)]
struct Entry {
    patch: u16,
    /// Of any length.
    direction: Vec3,
    /// Steradians, cosine included.
    weight: f32,
}

/// Makes one entry of many of one patch, or where they lie farther apart than `spread`, several: halved at the mean
/// along the axis on which they differ most. With R the length of their mean direction, 1 - R is that of a disc of
/// radius a to the viewer, a²/4.
fn merge(seen: &mut [Entry], spread: f32, entries: &mut Vec<Entry>) {
    let (mut sum, mut squares, mut weight) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for e in seen.iter() {
        sum += e.weight * e.direction;
        squares += e.weight * e.direction * e.direction;
        weight += e.weight;
    }
    if weight <= 0.0 {
        return;
    }
    let mean = sum / weight;
    if 1.0 - mean.length() <= spread {
        entries.push(Entry { patch: seen[0].patch, direction: mean, weight });
        return;
    }
    let variance = squares / weight - mean * mean;
    let axis = variance.max_position();
    seen.sort_by(|a, b| a.direction[axis].total_cmp(&b.direction[axis]));
    let middle = seen.partition_point(|e| e.direction[axis] < mean[axis]).clamp(1, seen.len() - 1);
    let (low, high) = seen.split_at_mut(middle);
    merge(low, spread, entries);
    merge(high, spread, entries);
}

/// Entries of all glossy vertices.
#[derive(Default)]
struct Rows {
    start: Vec<u32>,
    source: Vec<u16>,
    direction: Vec<u16>,
    weight: Vec<f32>,
}

impl Work<'_> {
    /// How much of their light the glossy vertices together get from each vertex of the mesh.
    fn importance(&self) -> Result<Vec<f32>, Error> {
        let mesh = self.surface.mesh;
        let sets = HemisphereSets::new(PILOT_RAYS, hash(self.seed, 0x9105));
        let mut importance = vec![0.0f64; mesh.position.len()];
        self.for_each_block("glossy: importance", |block| {
            let met: Vec<Vec<(u32, f32)>> = block
                .par_iter()
                .map(|&v| {
                    let mut met = Vec::with_capacity(3 * PILOT_RAYS);
                    fronts(self.surface, &sets, (v, self.source[v]), |corners, weights, _, z| {
                        met.extend(corners.into_iter().zip(weights.map(|w| w * z)));
                    });
                    met
                })
                .collect();
            met.into_iter().flatten().for_each(|(v, z)| importance[v as usize] += f64::from(z));
        })?;
        let area = mesh.vertex_area();
        let total: f64 = importance.iter().sum();
        let total_area: f64 = area.iter().map(|a| f64::from(*a)).sum();
        let floor = FLOOR * total.max(f64::MIN_POSITIVE) / total_area.max(f64::MIN_POSITIVE);
        Ok(importance.iter().zip(area).map(|(i, a)| (i + floor * f64::from(a)) as f32).collect())
    }

    fn rows(&self, patch: &[u16], rays: usize) -> Result<Rows, Error> {
        let sets = HemisphereSets::new(rays, hash(self.seed, 0x9106));
        let mut rows = Rows { start: vec![0], ..Rows::default() };
        self.for_each_block("glossy: patches", |block| {
            let found: Vec<Vec<Entry>> = block.par_iter().map(|&v| self.row(&sets, patch, v)).collect();
            for row in found {
                for entry in row {
                    rows.source.push(entry.patch);
                    rows.direction.push(cubemap::texel_of(DIRECTION_SIDE, entry.direction) as u16);
                    rows.weight.push(entry.weight);
                }
                rows.start.push(rows.source.len() as u32);
            }
        })?;
        // More than 4 billion entries would be 25 GB of them.
        u32::try_from(rows.source.len()).map(|_| rows).map_err(|_| {
            Error::TooLarge(
                "more glossy entries than a file can count: fewer --rays, or fewer vertices".into(),
            )
        })
    }

    /// Entries in the order of their patches.
    fn row(&self, sets: &HemisphereSets, patch: &[u16], v: usize) -> Vec<Entry> {
        let mut seen: Vec<Entry> = Vec::with_capacity(sets.n_rays());
        let all = fronts(self.surface, sets, (v, self.source[v]), |corners, weights, d, z| {
            let patches = corners.map(|v| patch[v as usize]);
            for i in 0..3 {
                // The corners of one patch together, as the first of them.
                let is_first = !patches[..i].contains(&patches[i]);
                let share: f32 = (i..3).filter(|&j| patches[j] == patches[i]).map(|j| weights[j]).sum();
                if is_first && share > 0.0 {
                    seen.push(Entry { patch: patches[i], direction: d, weight: z * share });
                }
            }
        });
        seen.iter_mut().for_each(|entry| entry.weight *= PI / all);
        seen.sort_by_key(|entry| entry.patch);
        let spread = WIDEST / (self.exponents[v] + 1.0);
        let mut entries = Vec::new();
        for group in seen.chunk_by_mut(|a, b| a.patch == b.patch) {
            merge(group, spread, &mut entries);
        }
        entries
    }

    fn for_each_block(&self, stage: &str, mut work: impl FnMut(&[usize])) -> Result<(), Error> {
        for (i, block) in self.glossy.chunks(BLOCK).enumerate() {
            if self.progress.cancelled() {
                return Err(Error::Cancelled);
            }
            work(block);
            self.progress.report(stage, (i * BLOCK + block.len()) as u64, self.glossy.len() as u64);
        }
        Ok(())
    }
}

impl Rows {
    fn insert_into(self, asset: &mut Asset<'static>) {
        asset.insert("glossy.start", &[self.start.len()], Data::U32(Cow::Owned(self.start)));
        asset.insert("glossy.source", &[self.source.len()], Data::U16(Cow::Owned(self.source)));
        asset.insert("glossy.direction", &[self.direction.len()], Data::U16(Cow::Owned(self.direction)));
        asset.insert_scaled("glossy.weight", &[self.weight.len()], &self.weight);
    }
}
