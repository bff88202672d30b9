//! Direct-to-indirect transport: bounced light as a function of the direct light, whatever shines.
//!
//! The mesh is cut into P patches. With R the light that leaves a patch of itself (albedo times direct
//! irradiance, mean over the patch), F\[v,p\] the share of the cosine-weighted hemisphere of v that patch p fills, and
//! F̄ the mean of F over the vertices of a patch, the light that leaves a patch in all is
//!
//! B = R + ρ F̄ B,   and   E_indirect(v) = Σ_p F\[v,p\] B\[p\].
//!
//! Rows of F look alike, but for what is near: the few patches that fill most of a vertex's view are kept as they are
//! (*near*), and the rest G = F - near in a basis Q of k vectors, the dominant right singular vectors of Ḡ: `gather` =
//! G Q. All bounces go into `spread` = Qᵀ (I + ρ F̄ + ...), so that a frame sums R over patches, multiplies by
//! `spread` once for the coefficients z = Qᵀ B, finds B at the patches, which have rows of their own, and takes k
//! products and the near ones per vertex. A sun an inch wide costs what an overcast sky costs, and is carried as well.
//!
//! Where it breaks: detail of bounced light finer than a patch, which shows beside the edge of a sunlit spot; and backs
//! of one-sided surfaces, which give nothing back.
//!
//! Based on: M. Hašan, F. Pellacini, K. Bala, Direct-to-Indirect Transfer for Cinematic Relighting, 2006; N. Halko,
//! P. Martinsson, J. Tropp, Finding Structure with Randomness, 2011 (subspace iteration).

use std::borrow::Cow;
use std::sync::atomic::Ordering;

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_relight::asset::{Asset, Data, NO_PATCH};
use lunette_relight::indirect::N_NEAR;
use lunette_scenes::Scene;
use rayon::prelude::*;

use crate::fill;
use crate::gather::{Pass, lane_of, packet, vertices};
use crate::glossy::vertex_reflectance;
use crate::sampling::{HemisphereSets, LANES, hash};
use crate::smooth::Smoother;
use crate::{Error, Options, Progress, Surface};

/// What is stored; rows are those of the vertices and then those of the patches.
pub struct Carrier {
    /// Patch of each vertex, \[V\].
    pub patch: Vec<u16>,
    /// Direct reflected light of patches to basis, all bounces, \[P, k, 3\].
    pub spread: Vec<f32>,
    /// Basis to rows, \[V + P, k\].
    pub gather: Vec<f32>,
    /// The patches that fill most of a row's view, and their shares, \[V + P, [`N_NEAR`]\]; a share of 0 is none.
    pub near_patch: Vec<u16>,
    pub near_share: Vec<f32>,
    /// P.
    pub n_patches: usize,
    /// k.
    pub rank: usize,
}

/// Where vertices lie that are not like the others.
pub struct Lie<'a> {
    /// Inside other geometry, ascending.
    pub buried: &'a [usize],
    /// Outside, where no light is worth computing.
    pub unlit: &'a [bool],
    /// Direct irradiance under a uniform light of radiance 1.
    pub uniform: &'a [f32],
    /// Of noise in far rows.
    pub smoother: &'a Smoother,
}

impl Carrier {
    /// Puts the tensors into an asset.
    pub fn insert_into(self, asset: &mut Asset<'static>) {
        let rows = self.gather.len() / self.rank;
        asset.insert("indirect.patch", &[self.patch.len()], Data::U16(Cow::Owned(self.patch)));
        asset.insert("indirect.spread", &[self.n_patches, self.rank, 3], Data::F32(Cow::Owned(self.spread)));
        asset.insert_scaled("indirect.gather", &[rows, self.rank], &self.gather);
        asset.insert("indirect.near.patch", &[rows, N_NEAR], Data::U16(Cow::Owned(self.near_patch)));
        asset.insert_scaled("indirect.near.share", &[rows, N_NEAR], &self.near_share);
    }
}

/// Rays per vertex: as many as for shadows, but not fewer than this.
const FEWEST_RAYS: usize = 256;

/// Rays per vertex for the patch-to-patch shares; each patch averages over its vertices.
const PATCH_RAYS: usize = 64;

/// A patch that fills less of a view than this is not near: the basis holds it well enough, and a share of a few rays
/// is noise that smoothing takes out of the rest of the row, and not of what is kept apart.
const LEAST_NEAR: f32 = 0.03;

/// Subspace iterations: singular values of form factors fall fast, two leave no more than sampling noise.
const POWER_ITERATIONS: usize = 2;

/// Weight of a normal against a position in the cutting of patches, in diagonals of the scene: opposite sides of a wall
/// must part.
const NORMAL_WEIGHT: f32 = 0.25;

/// Casts the rays and finds patches, basis and rows.
pub fn carrier(
    scene: &Scene,
    surface: &Surface,
    options: &Options,
    lie: &Lie,
    progress: &dyn Progress,
) -> Result<Carrier, Error> {
    let n_vertices = scene.mesh.position.len();
    let area = scene.mesh.vertex_area();
    let albedo = vertex_reflectance(scene);
    let patch = cut(scene, &area, lie.unlit, options.patches.min(n_vertices.div_ceil(4)).max(1));
    let n_patches = patch.iter().filter(|p| **p != NO_PATCH).max().map_or(1, |&p| p as usize + 1);
    let rank = options.rank.min(n_patches);
    let rho = mean_albedo(&patch, n_patches, &area, &albedo);

    let done = std::sync::atomic::AtomicU64::new(0);
    let rays = options.rays.max(FEWEST_RAYS).next_multiple_of(LANES);
    let total = (n_vertices * (PATCH_RAYS + rays)) as u64;
    let sets = HemisphereSets::new(PATCH_RAYS, hash(options.seed, 0xf0));
    let pass =
        Pass { surface, sets: &sets, order: 0, seed: options.seed, stage: "patches", total, done: &done };
    let shares = patch_shares(&pass, &patch, n_patches, &area, progress)?;
    let bright = brightness(&shares, &patch, &area, lie.uniform, &rho);
    let reached = reached(&shares, &patch, lie.uniform, n_patches);
    let mut far = shares.clone();
    let patches_near: Vec<Near> = far.par_chunks_mut(n_patches).map(take_near).collect();
    far.chunks_exact_mut(n_patches).for_each(|row| row.iter_mut().zip(&bright).for_each(|(f, b)| *f *= b));
    let mut basis = dominant(&far, n_patches, rank, options.seed);
    let mut patch_gather = multiply(&far, Transposed::No, &basis, n_patches, n_patches, rank);
    // From here on the basis takes shares as they are: D Q.
    basis.chunks_exact_mut(rank).zip(&bright).for_each(|(row, b)| row.iter_mut().for_each(|q| *q *= b));

    let sets = HemisphereSets::new(rays, hash(options.seed, 0xf1));
    let pass = Pass { sets: &sets, stage: "direct to indirect", ..pass };
    // A row is its products with the basis, then its near shares, then their patches.
    let width = rank + 2 * N_NEAR;
    let mut rows = vec![0.0; n_vertices * width];
    vertices(&pass, width, &mut rows, progress, |v, row| {
        row.fill(0.0);
        if lie.unlit[v] {
            return;
        }
        let mut shares = vec![0.0f32; n_patches];
        for_each_patch_hit(&pass, &patch, v, |p, share| shares[p] += share);
        // The basis would leave a trace of light where none can come.
        if shares.iter().zip(&reached).all(|(share, reached)| *share == 0.0 || !reached) {
            return;
        }
        let near = take_near(&mut shares);
        for (p, share) in shares.iter().enumerate().filter(|(_, s)| **s != 0.0) {
            row.iter_mut().zip(&basis[p * rank..][..rank]).for_each(|(out, q)| *out += share * q);
        }
        for (i, (p, share)) in near.into_iter().enumerate() {
            (row[rank + i], row[rank + N_NEAR + i]) = (share, f32::from(p));
        }
    })?;
    // What lies in other geometry takes the row of a neighbour.
    let donors = fill::donors(&scene.mesh, lie.buried).sources(n_vertices);
    let row = |v: usize| &rows[donors[v] * width..][..width];
    let mut gather: Vec<f32> = (0..n_vertices).flat_map(|v| row(v)[..rank].iter().copied()).collect();
    lie.smoother.apply(&mut gather, rank);
    let mut near_share: Vec<f32> =
        (0..n_vertices).flat_map(|v| row(v)[rank..][..N_NEAR].iter().copied()).collect();
    let mut near_patch: Vec<u16> =
        (0..n_vertices).flat_map(|v| row(v)[rank + N_NEAR..].iter().map(|p| *p as u16)).collect();
    gather.append(&mut patch_gather);
    near_patch.extend(patches_near.iter().flatten().map(|n| n.0));
    near_share.extend(patches_near.iter().flatten().map(|n| n.1));
    // And light leaving patches is measured against the expected: D⁻¹ Q.
    basis.chunks_exact_mut(rank).zip(&bright).for_each(|(row, b)| row.iter_mut().for_each(|q| *q /= b * b));
    let spread = spread(&shares, &basis, &rho, n_patches, rank, options.bounces);
    Ok(Carrier { patch, spread, gather, near_patch, near_share, n_patches, rank })
}

/// Whether light reaches each patch, over however many others.
fn reached(shares: &[f32], patch: &[u16], uniform: &[f32], n: usize) -> Vec<bool> {
    let mut reached = vec![false; n];
    for (&p, _) in patch.iter().zip(uniform).filter(|(p, e)| **p != NO_PATCH && **e > 0.0) {
        reached[usize::from(p)] = true;
    }
    loop {
        let before = reached.clone();
        let sees = |p: &usize| (0..n).any(|q| before[q] && shares[p * n + q] > 0.0);
        let more: Vec<usize> = (0..n).into_par_iter().filter(|p| !before[*p] && sees(p)).collect();
        if more.is_empty() {
            return reached;
        }
        more.into_iter().for_each(|p| reached[p] = true);
    }
}

/// Darkest that a patch is expected to be, as a share of the mean.
const DARKEST: f32 = 0.2;

/// How often light is bounced for [`brightness`].
const BRIGHTNESS_BOUNCES: usize = 4;

/// D: how much light is expected to leave each patch, that under a uniform sky.
fn brightness(shares: &[f32], patch: &[u16], area: &[f32], uniform: &[f32], rho: &[Vec3]) -> Vec<f32> {
    let n = rho.len();
    let mut sums = vec![(0.0f32, 0.0f32); n];
    for ((&p, a), e) in patch.iter().zip(area).zip(uniform) {
        if let Some(sum) = sums.get_mut(usize::from(p)) {
            *sum = (sum.0 + a * e, sum.1 + a);
        }
    }
    let grey = |p: usize| rho[p].element_sum() / 3.0;
    let straight: Vec<f32> =
        sums.iter().enumerate().map(|(p, (e, a))| grey(p) * e / a.max(f32::MIN_POSITIVE)).collect();
    let mut leaving = straight.clone();
    for _ in 0..BRIGHTNESS_BOUNCES {
        let arriving = multiply(shares, Transposed::No, &leaving, n, n, 1);
        for (p, b) in leaving.iter_mut().enumerate() {
            *b = straight[p] + grey(p) * arriving[p];
        }
    }
    let mean = leaving.iter().sum::<f32>() / n as f32;
    let least = if mean > 0.0 { DARKEST * mean } else { 1.0 };
    leaving.into_iter().map(|b| b.max(least)).collect()
}

/// Patches and shares, the largest first; what is not needed has share 0.
type Near = [(u16, f32); N_NEAR];

/// Takes the largest shares out of a row.
fn take_near(row: &mut [f32]) -> Near {
    let mut large: Vec<(u16, f32)> =
        (0..row.len()).filter(|&p| row[p] >= LEAST_NEAR).map(|p| (p as u16, row[p])).collect();
    large.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut near = [(0, 0.0); N_NEAR];
    for (out, entry) in near.iter_mut().zip(large) {
        *out = entry;
        row[usize::from(entry.0)] = 0.0;
    }
    near
}

/// Cuts the vertices into at most `most` patches, halving the one of most area times extent along its widest extent in space and normal.
pub fn cut(scene: &Scene, area: &[f32], unlit: &[bool], most: usize) -> Vec<u16> {
    let (low, high) = scene.mesh.bounds();
    let weight = NORMAL_WEIGHT * (high - low).length();
    let key = |v: usize| {
        let (p, n) = (scene.mesh.position[v], scene.mesh.normal[v] * weight);
        [p.x, p.y, p.z, n.x, n.y, n.z]
    };
    let all: Vec<usize> = (0..area.len()).filter(|&v| !unlit[v]).collect();
    let extent = |list: &[usize], axis: usize| {
        let values = list.iter().map(|&v| key(v)[axis]);
        let (lo, hi) = values.fold((f32::MAX, f32::MIN), |(lo, hi), x| (lo.min(x), hi.max(x)));
        if lo < hi { hi - lo } else { 0.0 }
    };
    // Wide ones before compact ones, so that a patch does not lie in two rooms.
    let weigh = |list: &[usize]| {
        let widest = (0..6).map(|axis| extent(list, axis)).fold(0.0, f32::max);
        f64::from(widest) * list.iter().map(|&v| f64::from(area[v])).sum::<f64>()
    };
    // The heaviest patch first; the number breaks ties, so that the order is the same everywhere.
    let mut heap = std::collections::BTreeMap::from([((weigh(&all).to_bits(), 0usize), all)]);
    let mut finished: Vec<Vec<usize>> = Vec::new();
    let mut next = 1;
    while heap.len() + finished.len() < most.min(usize::from(NO_PATCH)) {
        let Some((_, mut list)) = heap.pop_last() else { break };
        let axis = (0..6).max_by(|&a, &b| extent(&list, a).total_cmp(&extent(&list, b))).unwrap_or(0);
        if list.len() < 2 || extent(&list, axis) <= 0.0 {
            finished.push(list);
            continue;
        }
        list.sort_by(|&a, &b| key(a)[axis].total_cmp(&key(b)[axis]).then(a.cmp(&b)));
        let middle = middle(&list, area);
        let rest = list.split_off(middle);
        for part in [list, rest] {
            heap.insert((weigh(&part).to_bits(), next), part);
            next += 1;
        }
    }
    let mut patch = vec![NO_PATCH; area.len()];
    for (p, list) in finished.iter().chain(heap.values()).enumerate() {
        list.iter().for_each(|&v| patch[v] = p as u16);
    }
    patch
}

/// Where a sorted list has half of its area on each side; never at an end.
fn middle(list: &[usize], area: &[f32]) -> usize {
    let half: f64 = 0.5 * list.iter().map(|&v| f64::from(area[v])).sum::<f64>();
    let mut sum = 0.0;
    let at = list.iter().take_while(|&&v| {
        sum += f64::from(area[v]);
        sum < half
    });
    at.count().clamp(1, list.len() - 1)
}

fn mean_albedo(patch: &[u16], n_patches: usize, area: &[f32], albedo: &[Vec3]) -> Vec<Vec3> {
    let mut sums = vec![(Vec3::ZERO, 0.0f32); n_patches];
    for ((&p, &a), &rho) in patch.iter().zip(area).zip(albedo) {
        if let Some(sum) = sums.get_mut(usize::from(p)) {
            *sum = (sum.0 + a * rho, sum.1 + a);
        }
    }
    sums.into_iter().map(|(rho, a)| if a > 0.0 { rho / a } else { Vec3::ZERO }).collect()
}

/// Calls `add` with the patch and share of each ray of `v` that meets the front of a surface.
fn for_each_patch_hit(pass: &Pass, patch: &[u16], v: usize, mut add: impl FnMut(usize, f32)) {
    let (set, frame) = pass.sets.at(v, pass.surface.mesh.normal[v]);
    for local in set {
        let (mut rays, world) = packet(pass.surface.origin[v], &frame, local);
        let mut hits = ffi::Hits::<LANES>::default();
        pass.surface.tree.intersect_packet(&ffi::Mask::all(), &mut rays, &mut hits);
        for (lane, z) in local.z.into_iter().enumerate() {
            let Some(hit) = hits.get(&rays, lane) else { continue };
            if lane_of(&world, lane).dot(Vec3::from(hit.normal)) < 0.0 {
                let corners = pass.surface.mesh.index[hit.primitive as usize];
                let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
                let nearest = (0..3).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap_or(0);
                let p = patch[corners[nearest] as usize];
                if p != NO_PATCH {
                    add(usize::from(p), 2.0 * z / pass.sets.n_rays() as f32);
                }
            }
        }
    }
}

/// F̄, \[P, P\]: of what each patch sees, the share that each other patch fills.
fn patch_shares(
    pass: &Pass,
    patch: &[u16],
    n_patches: usize,
    area: &[f32],
    progress: &dyn Progress,
) -> Result<Vec<f32>, Error> {
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); n_patches];
    for (v, &p) in patch.iter().enumerate() {
        if let Some(list) = members.get_mut(usize::from(p)) {
            list.push(v);
        }
    }
    let mut shares = vec![0.0; n_patches * n_patches];
    shares.par_chunks_mut(n_patches).zip(&members).try_for_each(|(row, members)| {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let sum: f32 = members.iter().map(|&v| area[v]).sum();
        for &v in members {
            let weight = area[v] / sum.max(f32::MIN_POSITIVE);
            for_each_patch_hit(pass, patch, v, |p, share| row[p] += weight * share);
        }
        let rays = (members.len() * pass.sets.n_rays()) as u64;
        let done = pass.done.fetch_add(rays, Ordering::Relaxed);
        progress.report(pass.stage, done + rays, pass.total);
        Ok(())
    })?;
    Ok(shares)
}

/// An orthonormal basis, \[P, k\], of the dominant right singular vectors of `a`, \[P, P\].
fn dominant(a: &[f32], p: usize, k: usize, seed: u64) -> Vec<f32> {
    let unit = |h: u64| (h >> 40) as f32 / (1 << 24) as f32 - 0.5;
    let mut q: Vec<f32> = (0..p * k).map(|i| unit(hash(seed ^ 0x9a11, i as u64))).collect();
    orthonormalise(&mut q, p, k);
    for _ in 0..=POWER_ITERATIONS {
        let y = multiply(a, Transposed::No, &q, p, p, k);
        q = multiply(a, Transposed::Yes, &y, p, p, k);
        orthonormalise(&mut q, p, k);
    }
    q
}

#[derive(Clone, Copy, PartialEq)]
enum Transposed {
    No,
    Yes,
}

/// A B or Aᵀ B for row-major A \[m, n\] and B with k columns. The inner loop runs along a row of B, which stays in
/// the first cache level with the band of the result.
fn multiply(a: &[f32], transposed: Transposed, b: &[f32], m: usize, n: usize, k: usize) -> Vec<f32> {
    const BAND: usize = 32;
    let rows = if transposed == Transposed::No { m } else { n };
    let inner = if transposed == Transposed::No { n } else { m };
    let mut out = vec![0.0; rows * k];
    out.par_chunks_mut(BAND * k).enumerate().for_each(|(band, out)| {
        for j in 0..inner {
            let b = &b[j * k..][..k];
            for (i, out) in out.chunks_exact_mut(k).enumerate() {
                let i = band * BAND + i;
                let factor = if transposed == Transposed::No { a[i * n + j] } else { a[j * n + i] };
                if factor != 0.0 {
                    out.iter_mut().zip(b).for_each(|(o, b)| *o += factor * b);
                }
            }
        }
    });
    out
}

/// Modified Gram-Schmidt on the columns of \[p, k\], twice, in f64; a column that vanishes becomes zero.
fn orthonormalise(q: &mut [f32], p: usize, k: usize) {
    let mut columns: Vec<Vec<f64>> =
        (0..k).map(|j| (0..p).map(|i| f64::from(q[i * k + j])).collect()).collect();
    for j in 0..k {
        for _ in 0..2 {
            let (before, rest) = columns.split_at_mut(j);
            let column = &mut rest[0];
            for other in before.iter() {
                let dot: f64 = other.iter().zip(column.iter()).map(|(a, b)| a * b).sum();
                column.iter_mut().zip(other).for_each(|(c, o)| *c -= dot * o);
            }
        }
        let length = columns[j].iter().map(|x| x * x).sum::<f64>().sqrt();
        let scale = if length > 1e-12 { 1.0 / length } else { 0.0 };
        columns[j].iter_mut().for_each(|x| *x *= scale);
    }
    for (i, row) in q.chunks_exact_mut(k).enumerate() {
        row.iter_mut().zip(&columns).for_each(|(out, column)| *out = column[i] as f32);
    }
}

/// Qᵀ (I + ρ F̄ + (ρ F̄)² + ... up to B-1), as \[P, k, 3\].
fn spread(shares: &[f32], basis: &[f32], rho: &[Vec3], p: usize, k: usize, bounces: usize) -> Vec<f32> {
    let mut out = vec![0.0; p * k * 3];
    for c in 0..3 {
        // Transposed throughout: Z \[P, k\] <- Q + F̄ᵀ ρ Z.
        let mut z = basis.to_vec();
        for _ in 1..bounces {
            let mut reflected = z.clone();
            for (row, rho) in reflected.chunks_exact_mut(k).zip(rho) {
                row.iter_mut().for_each(|x| *x *= rho[c]);
            }
            let mut next = multiply(shares, Transposed::Yes, &reflected, p, p, k);
            next.iter_mut().zip(basis).for_each(|(n, q)| *n += q);
            let change: f64 = next.iter().zip(&z).map(|(a, b)| f64::from((a - b).abs())).sum();
            let size: f64 = next.iter().map(|a| f64::from(a.abs())).sum();
            z = next;
            if change < 1e-5 * size {
                break;
            }
        }
        out.chunks_exact_mut(3).zip(&z).for_each(|(o, z)| o[c] = *z);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dominant_vectors_span_a_matrix_of_low_rank() {
        // A sum of three outer products: three vectors must carry all of it.
        let p = 40;
        let f = |i: usize, j: usize| {
            (i as f32 * 0.3).sin() * (j as f32 * 0.7).cos() + 0.2 * (i as f32) * (j as f32 * 0.1).sin() + 1.0
        };
        let a: Vec<f32> = (0..p * p).map(|i| f(i / p, i % p)).collect();
        let q = dominant(&a, p, 3, 1);
        let u = multiply(&a, Transposed::No, &q, p, p, 3);
        for i in 0..p {
            for j in 0..p {
                let back: f32 = (0..3).map(|k| u[i * 3 + k] * q[j * 3 + k]).sum();
                // f32 rounding of values up to nine.
                assert!((back - a[i * p + j]).abs() < 1e-4, "{i} {j}");
            }
        }
    }

    #[test]
    fn spread_of_a_white_enclosure_adds_up_the_bounces() {
        // Two patches that see only each other, albedo a half: 1 + 1/2 + 1/4 for three bounces.
        let z = spread(&[0.0, 1.0, 1.0, 0.0], &[1.0, 0.0, 0.0, 1.0], &[Vec3::splat(0.5); 2], 2, 2, 3);
        assert!((z[0] + z[3] + z[6] + z[9] - 2.0 * 1.75).abs() < 1e-6, "{z:?}");
    }
}
