//! Noise of gathered light, taken out where light must be smooth.
//!
//! Bounced light changes over a distance of about that to the surfaces it comes from: between two points d apart whose
//! normals agree, by no more than about d / R of itself, R being the harmonic mean of the distances that their rays go.
//! A vertex's row is averaged with those of its neighbours, as far as that says that they must be alike, by the weight
//!
//! w = max(0, 1 - d / (a R)) max(0, n·n').
//!
//! In a corner R is small, and nothing is averaged. Sums over the whole surface are kept only nearly.
//!
//! That is true of light that comes from everywhere alike. Beside something bright and small in an empty room R is large, and
//! the average would spread its light. So the surface is cut into some regions, and a vertex is averaged over no more rings of
//! neighbours than leave it the share s of its hemisphere that each of them fills, but for noise: of n stratified rays,
//! those on the region's edge count by chance, about √(s n) of them, so that a change δ from the average is noise while
//!
//! δ² <= c √(s n) / n² ((1 - w)² + Σ w'²),
//!
//! with the weights of the vertex itself and of its neighbours in it. Where the light of neighbours grows evenly across a vertex,
//! nothing changes.
//!
//! Based on: G. Ward, F. Rubinstein, R. Clear, A Ray Tracing Solution for Diffuse Interreflection, 1988 (equation 3);
//! D. P. Mitchell, Consequences of Stratified Sampling in Graphics, 1996 (the noise).

use glam::Vec3;
use lunette_ffi as ffi;
use lunette_scenes::{Mesh, Scene};
use rayon::prelude::*;

use crate::carrier::{Tree, sizes};
use crate::gather::{lane_of, nearest_vertex, packet};
use crate::portal::Gates;
use crate::sampling::{HemisphereSets, LANES, hash};
use crate::{Error, Options, Progress, Surface};

/// Ward's a: the change that is let pass.
const CHANGE: f32 = 0.4;

/// Rings of neighbours that a vertex reaches.
const RINGS: u8 = 3;

/// Rays by which vertices are compared: as many as of the rows, but not more than this.
const MOST_RAYS: usize = 4096;

/// Vertices looked from between two looks at the progress.
const BLOCK: usize = 4096;

/// Regions of the surface.
const REGIONS: usize = 32;

/// c: four standard errors.
const DOUBT: f32 = 16.0;

/// Averages over neighbours.
pub struct Smoother {
    /// Of vertex v: from\[v\]..from\[v + 1\] in the list.
    from: Vec<usize>,
    list: Vec<(u32, f32)>,
    /// Of each vertex, up to [`RINGS`].
    rings: Vec<u8>,
}

/// What rays of a vertex see: R, metres, and the share of each region.
struct Seen {
    reach: f32,
    shares: [f32; REGIONS],
}

impl Smoother {
    /// By rays that end at a portal's edge as bounced light does; `skip` says of whom nobody asks.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn new(
        scene: &Scene,
        (surface, gates): (&Surface, Option<&Gates>),
        options: &Options,
        skip: &[bool],
        progress: &dyn Progress,
    ) -> Result<Smoother, Error> {
        let mesh = &scene.mesh;
        let n_vertices = mesh.position.len();
        let tree = Tree::new(scene, &sizes(&mesh.vertex_area()), &vec![0.0; n_vertices], skip, REGIONS);
        let region = tree.leaf_of_vertices();
        let sets = HemisphereSets::new(options.rays.min(MOST_RAYS), hash(options.seed, u64::MAX));
        let look = |v: usize| if skip[v] { Seen::NOTHING } else { look(surface, gates, &sets, &region, v) };
        let rays = |n_vertices: usize| (n_vertices * sets.n_rays()) as u64;
        let mut seen = Vec::with_capacity(n_vertices);
        for first in (0..n_vertices).step_by(BLOCK) {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let end = n_vertices.min(first + BLOCK);
            seen.par_extend((first..end).into_par_iter().map(look));
            progress.report("likeness of neighbours", rays(end), rays(n_vertices));
        }
        let mut smoother = Smoother::within(mesh, &seen.iter().map(|s| s.reach).collect::<Vec<_>>());
        let rings = |v: usize| smoother.rings_of(v, &seen, sets.n_rays() as f32);
        smoother.rings = (0..n_vertices).into_par_iter().map(rings).collect();
        Ok(smoother)
    }

    /// Over all rings; `reach` is R of each vertex, metres.
    fn within(mesh: &Mesh, reach: &[f32]) -> Smoother {
        let mut pairs: Vec<(u32, u32)> = mesh
            .index
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)])
            .collect();
        pairs.par_sort_unstable();
        pairs.dedup();
        let weight = |&(v, u): &(u32, u32)| {
            let (v, u) = (v as usize, u as usize);
            let d = mesh.position[v].distance(mesh.position[u]);
            let r = reach[v].min(reach[u]);
            let near = if r > 0.0 { (1.0 - d / (CHANGE * r)).max(0.0) } else { 0.0 };
            near * mesh.normal[v].dot(mesh.normal[u]).max(0.0)
        };
        let n_vertices = mesh.position.len();
        let mut smoother =
            Smoother { from: vec![0; n_vertices + 1], list: Vec::new(), rings: vec![RINGS; n_vertices] };
        let mut at = 0;
        for v in 0..n_vertices {
            while at < pairs.len() && pairs[at].0 as usize == v {
                let w = weight(&pairs[at]);
                if w > 0.0 {
                    smoother.list.push((pairs[at].1, w));
                }
                at += 1;
            }
            smoother.from[v + 1] = smoother.list.len();
        }
        smoother
    }

    /// How many rings leave a vertex what it sees of each region.
    fn rings_of(&self, v: usize, seen: &[Seen], n_rays: f32) -> u8 {
        let keeps = |rings: u8| {
            let (mut mean, mut weights) = ([0.0; REGIONS], 0.0);
            for (u, w) in self.kernel_of(v, rings) {
                mean.iter_mut().zip(&seen[u as usize].shares).for_each(|(mean, share)| *mean += w * share);
                weights += if u as usize == v { (1.0 - w) * (1.0 - w) } else { w * w };
            }
            seen[v].shares.iter().zip(mean).all(|(own, mean)| {
                let on_edge = (mean.min(1.0 - mean) * n_rays).max(1.0).sqrt();
                (own - mean) * (own - mean) <= DOUBT * weights * on_edge / (n_rays * n_rays)
            })
        };
        (1..=RINGS).rev().find(|&rings| keeps(rings)).unwrap_or(0)
    }

    /// Of which vertices' rows, and with what weights, [`apply`](Self::apply) makes the row of `v`; rising.
    pub fn kernel(&self, v: usize) -> Vec<(u32, f32)> {
        self.kernel_of(v, self.rings[v])
    }

    fn kernel_of(&self, v: usize, rings: u8) -> Vec<(u32, f32)> {
        let mut kernel = vec![(v as u32, 1.0)];
        for _ in 0..rings {
            let mut next = Vec::with_capacity(8 * kernel.len());
            for (u, weight) in kernel {
                let neighbours = &self.list[self.from[u as usize]..self.from[u as usize + 1]];
                let per_weight = weight / (1.0 + neighbours.iter().map(|n| n.1).sum::<f32>());
                next.push((u, per_weight));
                next.extend(neighbours.iter().map(|&(n, w)| (n, w * per_weight)));
            }
            next.sort_by_key(|entry: &(u32, f32)| entry.0);
            next.dedup_by(|from, to| {
                let is_same = from.0 == to.0;
                if is_same {
                    to.1 += from.1;
                }
                is_same
            });
            kernel = next;
        }
        kernel
    }

    /// Averages rows, \[V, width\].
    pub fn apply(&self, rows: &mut [f32], width: usize) {
        let mut last = rows.to_vec();
        for ring in 1..=RINGS {
            let mut next = vec![0.0; last.len()];
            next.par_chunks_mut(width).enumerate().for_each(|(v, out)| {
                let neighbours = &self.list[self.from[v]..self.from[v + 1]];
                let per_weight = 1.0 / (1.0 + neighbours.iter().map(|n| n.1).sum::<f32>());
                let own = (v as u32, 1.0);
                for (u, w) in std::iter::once(&own).chain(neighbours) {
                    let row = &last[*u as usize * width..][..width];
                    out.iter_mut().zip(row).for_each(|(o, r)| *o += w * per_weight * r);
                }
            });
            let both = rows.chunks_exact_mut(width).zip(next.chunks_exact(width));
            for ((row, next), rings) in both.zip(&self.rings) {
                if ring <= *rings {
                    row.copy_from_slice(next);
                }
            }
            last = next;
        }
    }
}

impl Seen {
    const NOTHING: Seen = Seen { reach: 0.0, shares: [0.0; REGIONS] };
}

/// What a vertex sees; R is endless where its rays meet nothing.
fn look(
    surface: &Surface,
    gates: Option<&Gates>,
    sets: &HemisphereSets,
    region: &[Option<u16>],
    v: usize,
) -> Seen {
    let (set, frame) = sets.at(v, surface.mesh.normal[v]);
    let (mut inverse, mut all, mut shares) = (0.0, 0.0, [0.0; REGIONS]);
    for local in set {
        let (mut rays, world) = packet(surface.origin[v], &frame, local);
        let mut hits = ffi::Hits::<LANES>::default();
        surface.tree.intersect_packet(&ffi::Mask::all(), &mut rays, &mut hits);
        for (lane, z) in local.z.into_iter().enumerate() {
            let hit = hits.get(&rays, lane);
            let wall = hit.as_ref().map_or(f32::INFINITY, |hit| hit.t);
            let d = lane_of(&world, lane);
            let pane = gates.and_then(|gates| gates.way(surface.origin[v], d)).unwrap_or(f32::INFINITY);
            inverse += 1.0 / wall.min(pane).max(surface.lift);
            all += z;
            let Some(hit) = hit.filter(|hit| wall <= pane && d.dot(Vec3::from(hit.normal)) < 0.0) else {
                continue;
            };
            if let Some(region) = region[nearest_vertex(surface, &hit)] {
                shares[usize::from(region)] += z;
            }
        }
    }
    Seen { reach: sets.n_rays() as f32 / inverse, shares: shares.map(|share| share / all) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A row of vertices a metre apart.
    fn strip(n: usize) -> Mesh {
        Mesh {
            position: (0..n).map(|i| Vec3::new(i as f32, 0.0, 0.0)).collect(),
            normal: vec![Vec3::Y; n],
            index: (0..n as u32 - 1).map(|i| [i, i + 1, i]).collect(),
            material: vec![0; n - 1],
            group: vec![0; n - 1],
        }
    }

    #[test]
    fn constant_rows_stay_and_noise_falls() {
        let n = 400;
        let smoother = Smoother::within(&strip(n), &vec![100.0; n]);
        let mut rows: Vec<f32> = (0..n)
            .flat_map(|i| [2.0, (crate::sampling::hash(3, i as u64) >> 40) as f32 / (1 << 24) as f32])
            .collect();
        smoother.apply(&mut rows, 2);
        // f32 sums of three.
        assert!(rows.iter().step_by(2).all(|x| (x - 2.0).abs() < 1e-5));
        // Three averages over three: the kernel (1,3,6,7,6,3,1)/27 leaves 0.44 of a deviation of 0.289.
        let noise: f32 = rows.iter().skip(1).step_by(2).map(|x| (x - 0.5).powi(2)).sum::<f32>() / n as f32;
        assert!((0.09..0.16).contains(&noise.sqrt()), "{}", noise.sqrt());
    }

    #[test]
    fn kernel_of_a_vertex_is_what_rows_are_averaged_by() {
        let n = 12;
        let reach: Vec<f32> = (0..n).map(|i| 2.0 + i as f32).collect();
        let smoother = Smoother::within(&strip(n), &reach);
        let given: Vec<f32> = (0..n).map(|i| (i as f32 * 1.7).sin()).collect();
        let mut rows = given.clone();
        smoother.apply(&mut rows, 1);
        for (v, row) in rows.iter().enumerate() {
            let sum: f32 = smoother.kernel(v).iter().map(|(u, w)| w * given[*u as usize]).sum();
            // f32 sums of up to seven numbers below one.
            assert!((sum - row).abs() < 1e-6, "{sum} {row}");
        }
    }

    #[test]
    fn rings_end_where_they_would_change_what_is_seen() {
        let n = 41;
        let smoother = Smoother::within(&strip(n), &vec![100.0; n]);
        let rings = |share: &dyn Fn(usize) -> f32, n_rays: f32| -> Vec<u8> {
            let of = |v: usize| Seen { shares: std::array::from_fn(|_| share(v)), ..Seen::NOTHING };
            let seen: Vec<Seen> = (0..n).map(of).collect();
            // Ends of the strip have neighbours on one side.
            (RINGS.into()..n - usize::from(RINGS)).map(|v| smoother.rings_of(v, &seen, n_rays)).collect()
        };
        assert!(rings(&|v| 0.1 + 0.01 * v as f32, 1e6).iter().all(|r| *r == RINGS), "a slope stays a slope");
        let peak = |v: usize| if v == 20 { 0.2 } else { 0.1 };
        let found = rings(&peak, 1024.0);
        // Noise of 10 hits of a hundred is a third of a percent of all, four of which a peak of ten is above.
        assert_eq!(found[17], 0, "{found:?}");
        assert!(found[..10].iter().all(|r| *r == RINGS), "{found:?}");
        assert!(rings(&peak, 16.0).iter().all(|r| *r == RINGS), "as little as that is noise");
    }

    #[test]
    fn corners_are_left_alone() {
        let n = 9;
        let smoother = Smoother::within(&strip(n), &vec![2.0; n]);
        let mut rows: Vec<f32> = (0..n).map(|i| i as f32 * i as f32).collect();
        smoother.apply(&mut rows, 1);
        assert_eq!(rows, (0..n).map(|i| (i * i) as f32).collect::<Vec<_>>());
    }
}
