//! The sky shell: direct transfer in every basis asked for, and bounced light as SH.
//!
//! With B bounces the light that arrives at the vertices is found by iteration: S₀ is direct, and S_b is direct
//! plus what the surroundings throw back of S_(b-1); what they throw back of S_(B-1) is the result. As each vertex
//! averages over the vertices that its rays meet, bounced light needs fewer rays than a shadow does.

use std::borrow::Cow;
use std::sync::atomic::AtomicU64;

use glam::Vec3;
use lunette_relight::asset::{Asset, Data, Metadata};
use lunette_scenes::Scene;

use crate::buried::{self, buried};
use crate::carrier::{Lie, carrier};
use crate::fill::{self, Donors};
use crate::gather::{AO, Arriving, BENT, Many, OPEN, Pass, SH, bounced, direct, direct_width};
use crate::rows::{self, Aim, Lies, Opening, Row, Stage};
use crate::sampling::{HemisphereSets, hash};
use crate::smooth::{self, Smoother};
use crate::{Basis, Error, Options, Progress, Surface};

/// One in so many rays is also asked what it meets, but not fewer than this many.
const BOUNCE_SHARE: usize = 4;
const FEWEST_BOUNCE_RAYS: usize = 128;

/// Iterations stop early when another bounce adds less than this share of the light.
const CONVERGED: f64 = 1e-4;

/// Bakes the sky's tensors into a new asset.
pub fn bake(
    scene: &Scene,
    surface: &Surface,
    options: &Options,
    progress: &dyn Progress,
) -> Result<Asset<'static>, Error> {
    let order = if options.has(Basis::Sh) { options.order } else { 0 };
    let work = Work::new(surface, options, order, progress);
    let (rows, donors) = work.direct()?;
    let bounced = if work.bounces > 0 { work.bounced(&rows, &donors)? } else { Vec::new() };
    report(&donors, progress);
    let mut asset = asset(scene, options, order, &rows, &bounced);
    if options.has(Basis::Haar) {
        work.insert_rows(&donors, &mut asset)?;
    }
    if options.has(Basis::DirectToIndirect) && options.bounces > 0 {
        work.insert_carrier(scene, &rows, &donors, &mut asset)?;
    }
    Ok(asset)
}

struct Work<'a> {
    surface: &'a Surface<'a>,
    options: &'a Options,
    order: usize,
    bounces: usize,
    progress: &'a dyn Progress,
    total: u64,
    done: AtomicU64,
}

impl<'a> Work<'a> {
    fn new(surface: &'a Surface<'a>, options: &'a Options, order: usize, progress: &'a dyn Progress) -> Self {
        let bounces = if order > 0 { options.bounces } else { 0 };
        let per_vertex = options.rays.next_multiple_of(16) + bounces * bounce_rays(options);
        let total = (surface.mesh.position.len() * per_vertex) as u64;
        Work { surface, options, order, bounces, progress, total, done: AtomicU64::new(0) }
    }

    fn pass<'b>(&'b self, stage: &'b str, order: usize, stream: usize, sets: &'b HemisphereSets) -> Pass<'b> {
        let seed = hash(self.options.seed, stream as u64);
        Pass { surface: self.surface, sets, order, seed, stage, total: self.total, done: &self.done }
    }

    /// Sparse rows of direct light.
    fn insert_rows(&self, donors: &Donors, asset: &mut Asset<'static>) -> Result<(), Error> {
        let aim = Aim {
            surface: self.surface,
            opening: Opening::Sky(None),
            n: self.options.resolution,
            rays: self.options.rays,
            seed: hash(self.options.seed, 0xd0),
        };
        let n_vertices = self.surface.mesh.position.len();
        let source = donors.sources(n_vertices);
        let stage = Stage { name: "sky in texels", rays: self.options.rays, progress: self.progress };
        let compute = |v: usize, [row, _]: &mut [Row; 2]| {
            aim.row(v, source[v], row);
            Lies::Inside
        };
        let (store, worst) = rows::encode(aim.n, n_vertices, &stage, compute)?;
        let per_vertex = store.bytes() / n_vertices;
        let haar = 100 * store.n_haar() / n_vertices;
        self.progress.note(&format!(
            "sky: {per_vertex} bytes of direct light per vertex ({haar} % of rows in Haar wavelets), at most {:.1} % of a row lost",
            100.0 * worst
        ));
        store.insert_into(asset, "sky.direct", aim.n).map_err(|e| Error::TooLarge(e.to_string()))
    }

    fn insert_carrier(
        &self,
        scene: &Scene,
        direct: &[f32],
        donors: &Donors,
        asset: &mut Asset<'static>,
    ) -> Result<(), Error> {
        let width = direct_width(self.order);
        let uniform: Vec<f32> = direct.chunks_exact(width).map(|r| std::f32::consts::PI * r[AO]).collect();
        let unlit = vec![false; uniform.len()];
        let sets = buried::sets(self.options.seed);
        let smoother = Smoother::new(&scene.mesh, &smooth::reach(self.surface, None, &sets, &[]));
        let lie = Lie {
            buried: &donors.filled(),
            unlit: &unlit,
            outer: &unlit,
            uniform: &uniform,
            smoother: &smoother,
        };
        carrier(scene, self.surface, self.options, &lie, self.progress)?.insert_into(asset);
        Ok(())
    }

    /// Rows of direct light, with buried vertices filled.
    fn direct(&self) -> Result<(Vec<f32>, Donors), Error> {
        let width = direct_width(self.order);
        let mut rows = vec![0.0; self.surface.mesh.position.len() * width];
        let sets = HemisphereSets::new(self.options.rays, self.options.seed);
        direct(&self.pass("direct light", self.order, 0, &sets), &mut rows, self.progress)?;
        let dark = rows.chunks_exact(width).enumerate().filter(|(_, r)| r[OPEN] == 0.0).map(|(v, _)| v);
        let buried = buried(self.surface, &buried::sets(self.options.seed), &dark.collect::<Vec<_>>());
        let donors = fill::donors(self.surface.mesh, &buried);
        donors.fill(&mut rows, width);
        Ok((rows, donors))
    }

    /// Rows of light that has bounced up to `bounces` times, red, green, blue.
    fn bounced(&self, direct: &[f32], donors: &Donors) -> Result<Vec<f32>, Error> {
        let m = self.options.indirect_order;
        let width = 3 * m * m;
        let ao: Vec<f32> = direct.chunks_exact(direct_width(self.order)).map(|r| r[AO]).collect();
        let mut rows = vec![0.0; ao.len() * width];
        let mut last = arriving(direct, self.order, &rows, m);
        let mut before_last = Vec::new();
        let many = HemisphereSets::new(self.options.rays, self.options.seed);
        for b in 1..=self.bounces {
            let sets = HemisphereSets::new(bounce_rays(self.options), hash(self.options.seed, b as u64));
            let light = Arriving {
                last: &last,
                before_last: &before_last,
                many: Some(Many { sets: &many, ao: &ao }),
                columns: 0..m * m,
                escapes: &|_, _, _| true,
                unlit: &[],
            };
            bounced(&self.pass(&format!("bounce {b}"), m, b, &sets), &light, &mut rows, self.progress)?;
            donors.fill(&mut rows, width);
            if b == self.bounces {
                break;
            }
            before_last = std::mem::replace(&mut last, arriving(direct, self.order, &rows, m));
            let added = added(&last, &before_last);
            if added < CONVERGED {
                let percent = added * 100.0;
                self.progress.note(&format!(
                    "light has settled after {b} bounces (the last one added {percent:.3} %)"
                ));
                break;
            }
        }
        Ok(rows)
    }
}

fn bounce_rays(options: &Options) -> usize {
    (options.rays / BOUNCE_SHARE).max(FEWEST_BOUNCE_RAYS).min(options.rays).next_multiple_of(16)
}

/// Direct and bounced light of each vertex together: rows of 3 m², red, green, blue.
fn arriving(direct: &[f32], order: usize, bounced: &[f32], m: usize) -> Vec<f32> {
    let n = m * m;
    let mut all = bounced.to_vec();
    for (row, direct) in all.chunks_exact_mut(3 * n).zip(direct.chunks_exact(direct_width(order))) {
        for plane in row.chunks_exact_mut(n) {
            plane.iter_mut().zip(&direct[SH..]).for_each(|(a, d)| *a += d);
        }
    }
    all
}

/// The share of all light that is in `all` and not in `before`, in the mean over coefficients.
fn added(all: &[f32], before: &[f32]) -> f64 {
    let change: f64 = all.iter().zip(before).map(|(a, b)| f64::from((a - b).abs())).sum();
    change / all.iter().map(|a| f64::from(a.abs())).sum::<f64>().max(f64::MIN_POSITIVE)
}

fn report(donors: &Donors, progress: &dyn Progress) {
    if donors.n_filled() > 0 {
        let n = donors.n_filled();
        progress.note(&format!("{n} vertices lie inside other geometry and took their neighbours' light"));
    }
    if donors.unreachable > 0 {
        progress.note(&format!(
            "{} vertices see only backs of triangles and have no lit neighbour: they stay dark (is their winding reversed?)",
            donors.unreachable
        ));
    }
}

/// The mesh of a scene as an asset without any transfer: what [`crate::bake`] adds to.
pub fn mesh_asset(scene: &Scene) -> Asset<'static> {
    let mesh = &scene.mesh;
    let n = mesh.position.len();
    let mut asset = Asset::new(Metadata::new(""));
    let floats = |v: &[Vec3]| Data::F32(Cow::Owned(v.iter().flat_map(|p| p.to_array()).collect()));
    asset.insert("mesh.position", &[n, 3], floats(&mesh.position));
    asset.insert("mesh.normal", &[n, 3], floats(&mesh.normal));
    asset.insert("mesh.albedo", &[n, 3], floats(&scene.vertex_albedo()));
    asset.insert("mesh.index", &[mesh.index.len(), 3], Data::U32(Cow::Owned(mesh.index.concat())));
    asset.metadata.scene_hash = format!("{:016x}", content_hash(&asset));
    asset
}

fn asset(scene: &Scene, options: &Options, order: usize, rows: &[f32], bounced: &[f32]) -> Asset<'static> {
    let mesh = &scene.mesh;
    let n = mesh.position.len();
    let mut asset = mesh_asset(scene);
    asset.metadata.seed = options.seed;
    asset.metadata.options = options.describe();
    let rows = || rows.chunks_exact(direct_width(order));
    if options.has(Basis::Bent) {
        asset.insert_scaled("sky.ao", &[n], &rows().map(|r| r[AO].min(1.0)).collect::<Vec<_>>());
    }
    if options.has(Basis::Bent) || options.has(Basis::Aperture) {
        let bent = rows().zip(&mesh.normal).flat_map(|(r, &n)| bent_normal(r, n).to_array());
        asset.insert_scaled("sky.bent", &[n, 3], &bent.collect::<Vec<_>>());
    }
    if options.has(Basis::Aperture) {
        let radius = rows().map(|r| (1.0 - r[OPEN].min(1.0)).acos());
        asset.insert_scaled("sky.aperture", &[n], &radius.collect::<Vec<_>>());
    }
    if order > 0 {
        let direct = rows().flat_map(|r| r[SH..].iter().copied());
        asset.insert_scaled("sky.direct.sh", &[n, order.pow(2)], &direct.collect::<Vec<_>>());
    }
    if !bounced.is_empty() {
        let m = options.indirect_order.pow(2);
        let interleaved = bounced
            .chunks_exact(3 * m)
            .flat_map(|r| (0..m).flat_map(move |i| [r[i], r[m + i], r[2 * m + i]]));
        asset.insert_scaled("sky.indirect.sh", &[n, m, 3], &interleaved.collect::<Vec<_>>());
    }
    asset
}

/// The mean visible direction; the normal where nothing is visible.
fn bent_normal(row: &[f32], normal: Vec3) -> Vec3 {
    Vec3::from_slice(&row[BENT..]).try_normalize().unwrap_or(normal)
}

/// FNV-1a over the mesh tensors, by 8 bytes.
fn content_hash(asset: &Asset) -> u64 {
    let mut h = 0xcbf29ce484222325u64;
    for (_, tensor) in asset.tensors() {
        for chunk in tensor.data.bytes().chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            h = (h ^ u64::from_le_bytes(word)).wrapping_mul(0x100000001b3);
        }
    }
    h
}
