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
//! the average would spread its light. Where it is known what the rays of vertices meet ([`Smoother::kernel`]), the surface is cut
//! into some regions, and a vertex is averaged over no more rings of neighbours than leave it the share s of its hemisphere that
//! each of them fills, but for noise: of n stratified rays, those on the region's edge count by chance, about √(s n) of them,
//! so that a change δ from the average is noise while
//!
//! δ² <= c √(s n) / n² ((1 - w)² + Σ w'²),
//!
//! with the weights of the vertex itself and of its neighbours in it. Where the light of neighbours grows evenly across a vertex,
//! nothing changes. Some vertices are farther off by chance alone and would stay as specks, so that each takes the median of
//! the rings found for it and its neighbours. Rows of SH are averaged over all rings: their noise is that of bright places,
//! not of regions, and they are for smooth skies.
//!
//! Based on: G. Ward, F. Rubinstein, R. Clear, A Ray Tracing Solution for Diffuse Interreflection, 1988 (equation 3);
//! D. P. Mitchell, Consequences of Stratified Sampling in Graphics, 1996 (the noise).

use lunette_scenes::Mesh;
use rayon::prelude::*;

use crate::Surface;
use crate::gather::trace;
use crate::portal::Gates;
use crate::sampling::HemisphereSets;

/// Ward's a: the change that is let pass.
const CHANGE: f32 = 0.4;

/// Rings of neighbours that a vertex reaches.
const RINGS: u8 = 3;

/// Regions of the surface.
pub const REGIONS: usize = 32;

/// c: four standard errors.
const DOUBT: f32 = 16.0;

/// The share of a vertex's hemisphere that each region fills.
pub type Shares = [f32; REGIONS];

/// Averages over neighbours.
pub struct Smoother {
    /// Of vertex v: from\[v\]..from\[v + 1\] in the list.
    from: Vec<usize>,
    list: Vec<(u32, f32)>,
}

impl Smoother {
    /// `reach` is R of each vertex, metres.
    pub fn new(mesh: &Mesh, reach: &[f32]) -> Smoother {
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
        let mut smoother = Smoother { from: vec![0; mesh.position.len() + 1], list: Vec::new() };
        let mut at = 0;
        for v in 0..mesh.position.len() {
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

    /// Over how many rings of neighbours the row of each vertex is averaged: no more than leave it what it sees, by `n_rays`
    /// rays each, as the median over it and its neighbours says.
    pub fn rings(&self, seen: &[Shares], n_rays: usize) -> Vec<u8> {
        let own: Vec<u8> = (0..seen.len()).into_par_iter().map(|v| self.rings_of(v, seen, n_rays)).collect();
        let median = |v: usize| {
            let mut all: Vec<u8> = self.neighbours(v).iter().map(|n| own[n.0 as usize]).collect();
            all.push(own[v]);
            all.sort_unstable();
            all[all.len() / 2]
        };
        (0..seen.len()).into_par_iter().map(median).collect()
    }

    fn rings_of(&self, v: usize, seen: &[Shares], n_rays: usize) -> u8 {
        let n_rays = n_rays as f32;
        let keeps = |rings: &u8| {
            let (mut mean, mut weights) = ([0.0; REGIONS], 0.0);
            for (u, w) in self.kernel(v, *rings) {
                mean.iter_mut().zip(&seen[u as usize]).for_each(|(mean, share)| *mean += w * share);
                weights += if u as usize == v { (1.0 - w) * (1.0 - w) } else { w * w };
            }
            seen[v].iter().zip(mean).all(|(own, mean)| {
                let on_edge = (mean.min(1.0 - mean) * n_rays).max(1.0).sqrt();
                (own - mean) * (own - mean) <= DOUBT * weights * on_edge / (n_rays * n_rays)
            })
        };
        (1..=RINGS).rev().find(keeps).unwrap_or(0)
    }

    /// Of which vertices' rows, and with what weights, as many averages over neighbours make the row of `v`; rising.
    pub fn kernel(&self, v: usize, rings: u8) -> Vec<(u32, f32)> {
        let mut kernel = vec![(v as u32, 1.0)];
        for _ in 0..rings {
            let mut next = Vec::with_capacity(8 * kernel.len());
            for (u, weight) in kernel {
                let neighbours = self.neighbours(u as usize);
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

    fn neighbours(&self, v: usize) -> &[(u32, f32)] {
        &self.list[self.from[v]..self.from[v + 1]]
    }

    /// Averages rows, \[V, width\].
    pub fn apply(&self, rows: &mut Vec<f32>, width: usize) {
        for _ in 0..RINGS {
            let mut next = vec![0.0; rows.len()];
            next.par_chunks_mut(width).enumerate().for_each(|(v, out)| {
                let neighbours = self.neighbours(v);
                let per_weight = 1.0 / (1.0 + neighbours.iter().map(|n| n.1).sum::<f32>());
                let own = (v as u32, 1.0);
                for (u, w) in std::iter::once(&own).chain(neighbours) {
                    let row = &rows[*u as usize * width..][..width];
                    out.iter_mut().zip(row).for_each(|(o, r)| *o += w * per_weight * r);
                }
            });
            *rows = next;
        }
    }
}

/// Harmonic mean of the distances that rays of each vertex go, to a surface or a portal, metres: bounced light ends at a
/// portal's edge. Endless where they meet nothing, 0 where `skip` says that nobody asks.
pub fn reach(surface: &Surface, gates: Option<&Gates>, sets: &HemisphereSets, skip: &[bool]) -> Vec<f32> {
    let of = |v: usize| {
        if skip.get(v) == Some(&true) {
            return 0.0;
        }
        let mut inverse = 0.0;
        trace(surface, sets, (v, v), |_, _, d, hit| {
            let wall = hit.map_or(f32::INFINITY, |hit| hit.t);
            let pane = gates.and_then(|gates| gates.way(surface.origin[v], d)).unwrap_or(f32::INFINITY);
            inverse += 1.0 / wall.min(pane).max(surface.lift);
        });
        sets.n_rays() as f32 / inverse
    };
    (0..surface.origin.len()).into_par_iter().map(of).collect()
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
        let smoother = Smoother::new(&strip(n), &vec![100.0; n]);
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
        let smoother = Smoother::new(&strip(n), &reach);
        let given: Vec<f32> = (0..n).map(|i| (i as f32 * 1.7).sin()).collect();
        let mut rows = given.clone();
        smoother.apply(&mut rows, 1);
        for (v, row) in rows.iter().enumerate() {
            let sum: f32 = smoother.kernel(v, RINGS).iter().map(|(u, w)| w * given[*u as usize]).sum();
            // f32 sums of up to seven numbers below one.
            assert!((sum - row).abs() < 1e-6, "{sum} {row}");
        }
    }

    #[test]
    fn rings_end_where_they_would_change_what_is_seen() {
        let n = 41;
        let smoother = Smoother::new(&strip(n), &vec![100.0; n]);
        let rings = |share: &dyn Fn(usize) -> f32, n_rays: usize| -> Vec<u8> {
            let seen: Vec<Shares> = (0..n).map(|v| [share(v); REGIONS]).collect();
            // Ends of the strip have neighbours on one side.
            smoother.rings(&seen, n_rays)[3..n - 3].to_vec()
        };
        assert!(
            rings(&|v| 0.1 + 0.01 * v as f32, 1_000_000).iter().all(|r| *r == RINGS),
            "a slope stays a slope"
        );
        let peak = |v: usize| if v == 20 { 0.2 } else { 0.1 };
        let found = rings(&peak, 1024);
        // Noise of 10 hits of a hundred is a third of a percent of all, four of which a peak of ten is above.
        assert_eq!(found[17], 0, "{found:?}");
        assert!(found[..10].iter().all(|r| *r == RINGS), "{found:?}");
        assert!(rings(&peak, 16).iter().all(|r| *r == RINGS), "as little as that is noise");
        // Five standard errors of one vertex, which its neighbours' averages hardly feel.
        let chance = |v: usize| if v == 20 { 0.1 + 5.0 * 102.4f32.sqrt().sqrt() / 1024.0 } else { 0.1 };
        let seen: Vec<Shares> = (0..n).map(|v| [chance(v); REGIONS]).collect();
        assert!(smoother.rings_of(20, &seen, 1024) < RINGS);
        assert!(
            rings(&chance, 1024).iter().all(|r| *r == RINGS),
            "one in a thousand is as far off by chance"
        );
    }

    #[test]
    fn corners_are_left_alone() {
        let n = 9;
        let smoother = Smoother::new(&strip(n), &vec![2.0; n]);
        let mut rows: Vec<f32> = (0..n).map(|i| i as f32 * i as f32).collect();
        smoother.apply(&mut rows, 1);
        assert_eq!(rows, (0..n).map(|i| (i * i) as f32).collect::<Vec<_>>());
    }
}
