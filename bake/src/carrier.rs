//! Direct-to-indirect transport: bounced light as a function of the direct light, whatever shines.
//!
//! The surface is halved again and again, down to P patches: a binary tree of 2 P - 1 nodes ([`tree`]). With R the light
//! that leaves a patch of itself (albedo times direct irradiance, mean over the patch by what its vertices see of
//! others), F\[v,p\] the share of the cosine-weighted hemisphere of v that patch p fills, and F̄ the mean of F over the
//! vertices of a patch, the light that leaves a patch in all is
//!
//! B = R + ρ F̄ B,   and   E_indirect(v) = Σ_p F\[v,p\] B\[p\].
//!
//! A row of F is kept as K *links* to nodes ([`links`]): fine ones where the row changes from patch to patch, coarse ones
//! where it is even, so that what is lit may be as small as a patch wherever it is; neighbours share theirs. A frame
//! averages R over the nodes, iterates B at the patches, which have rows of their own, and takes K products per vertex.
//!
//! Patches are cut where vertices send light to others inside ([`importance`]), by few rays under an even light: not on
//! ground far outside of the windows.
//!
//! What a vertex sees of small and far patches is known better than few rays tell ([`expected`]).
//!
//! Where it breaks: detail of bounced light finer than a patch, which shows beside the edge of a sunlit spot; noise of the
//! rays within a node, where a sun lights a small part of what a vertex sees; and backs of one-sided surfaces, which give
//! nothing back.
//!
//! Based on: M. Hašan, F. Pellacini, K. Bala, Direct-to-Indirect Transfer for Cinematic Relighting, 2006; P. Hanrahan,
//! D. Salzman, L. Aupperle, A Rapid Hierarchical Radiosity Algorithm, 1991 (links to nodes of a tree).

mod expected;
mod links;
mod tree;

use std::sync::atomic::AtomicU64;

use glam::Vec3;
use half::f16;
use lunette_relight::asset::{Asset, Data};
use lunette_relight::block::{self, GROUP, LANES};
use lunette_scenes::Scene;
use rayon::prelude::*;

use crate::fill;
use crate::gather::{Arriving, Pass, bounced, fronts};
use crate::glossy::vertex_reflectance;
use crate::sampling::{HemisphereSets, LANES as RAYS, hash};
use crate::smooth::{REGIONS, Shares, Smoother};
use crate::{Error, Options, Progress, Surface};
use expected::Expected;
use links::{Linker, Links};
pub use tree::Tree;

/// What is stored.
pub struct Carrier {
    tree: Tree,
    /// Vertices of the blocks.
    rows: Vec<[u16; LANES]>,
    /// Of the blocks of vertices, and then of the patches in the order of their nodes.
    links: Links,
    /// Weight of each node against its parent's.
    part: Vec<f32>,
}

/// Where vertices lie that are not like the others.
pub struct Lie<'a> {
    /// Inside other geometry, ascending.
    pub buried: &'a [usize],
    /// Outside, where no light is worth computing.
    pub unlit: &'a [bool],
    /// Outside, and lit by the sky.
    pub outer: &'a [bool],
    /// Direct irradiance under a uniform light of radiance 1.
    pub uniform: &'a [f32],
    /// Of noise in rows.
    pub smoother: &'a Smoother,
}

impl Carrier {
    /// Puts the tensors into an asset.
    pub fn insert_into(self, asset: &mut Asset<'static>) {
        let Carrier { tree, rows, links, part } = self;
        asset.insert("indirect.patch", &[tree.patch.len()], Data::U16(tree.patch.into()));
        asset.insert("indirect.tree", &[tree.children.len(), 2], Data::U16(tree.children.concat().into()));
        asset.insert("indirect.part", &[part.len()], Data::F32(part.into()));
        asset.insert("indirect.row", &[rows.len(), LANES], Data::U16(rows.into_flattened().into()));
        asset.insert("indirect.start", &[links.start.len()], Data::U32(links.start.into()));
        let (n, blocks) = (links.node.len(), links.scale.len());
        asset.insert("indirect.node", &[n], Data::U16(links.node.into()));
        asset.insert("indirect.share", &[n, LANES], Data::U8(links.share.into_flattened().into()));
        asset.insert("indirect.scale", &[blocks, LANES], Data::F32(links.scale.into_flattened().into()));
    }
}

/// Rays per vertex: as many as for shadows, but not fewer than this.
const FEWEST_RAYS: usize = 256;

/// How often the patches' weights in their nodes are balanced.
const BALANCES: usize = 2;

/// Vertices traced or linked between two looks at the progress.
const BLOCK: usize = 4096;

/// Casts the rays, finds patches and links.
pub fn carrier(
    scene: &Scene,
    surface: &Surface,
    options: &Options,
    lie: &Lie,
    progress: &dyn Progress,
) -> Result<Carrier, Error> {
    let n_vertices = scene.mesh.position.len();
    let area = scene.mesh.vertex_area();
    let most = options.patches.min(n_vertices.div_ceil(4)).max(1);
    let importance = importance(surface, options, lie, progress)?;
    let sizes = sizes(&area, &importance);
    let groups = groups(&sizes, &importance, lie);
    let cut = |most| Tree::new(scene, &sizes, lie.uniform, &groups, most);
    let tree = cut(most);
    let leaf = tree.leaf_of_vertices();
    let rays = options.rays.max(FEWEST_RAYS).next_multiple_of(RAYS);
    let sets = HemisphereSets::new(rays, hash(options.seed, 0xf1));
    let rows = Rows::trace(surface, &sets, (&leaf, tree.n_leaves()), lie, progress)?;
    // What lies in other geometry takes the row of a neighbour.
    let donors = fill::donors(&scene.mesh, lie.buried).sources(n_vertices);
    // What a vertex sends to others is what it sees of them: not its light on the sky.
    let sending: Vec<f32> =
        area.iter().enumerate().map(|(v, a)| a * rows.of(v).map(|(_, share)| share).sum::<f32>()).collect();
    let patches = Patches { members: tree.members(), sending: &sending, rho: expected_reflectance(scene) };
    let reached = patches.reached(&rows, lie.uniform);
    let linker = Linker { tree: &tree, bright: patches.brightness(lie.uniform), n_links: options.links };
    let sees_light = |v: usize| rows.of(v).any(|(p, _)| reached[p]);
    // A patch lies in one of the first few parts that the surface is cut into.
    let region_of_vertex = cut(REGIONS.min(most)).leaf_of_vertices();
    let region: Vec<usize> = patches
        .members
        .iter()
        .map(|list| list.first().and_then(|&v| region_of_vertex[v]).map_or(0, usize::from))
        .collect();
    let shares = |v: usize| {
        let mut shares = [0.0; REGIONS];
        rows.of(v).for_each(|(p, share)| shares[region[p]] += share);
        shares
    };
    let seen: Vec<Shares> = (0..n_vertices).into_par_iter().map(shares).collect();
    let rings = lie.smoother.rings(&seen, sets.n_rays());
    // What sees nothing lies in other geometry.
    let open: Vec<f32> =
        sending.iter().zip(&area).map(|(sending, area)| if *sending > 0.0 { *area } else { 0.0 }).collect();
    let expected = Expected::new(&tree, &scene.mesh, &patches.members, &open);
    let of_vertex = |&v: &usize, dense: &mut [f32]| {
        // Not a trace of light where none can come.
        let v = donors[v];
        if sees_light(v) {
            let mut weights = 0.0;
            for (u, weight) in lie.smoother.kernel(v, rings[v]) {
                rows.of(u as usize).for_each(|(p, share)| dense[p] += weight * share);
                weights += weight * weight;
            }
            let point = (scene.mesh.position[v], scene.mesh.normal[v]);
            expected.refine(point, sets.n_rays() as f32 / weights, dense);
            let unreached = dense.iter_mut().zip(&reached).filter(|(_, reached)| !**reached);
            unreached.for_each(|(share, _)| *share = 0.0);
        }
    };
    let of_patch = |members: &Vec<usize>, dense: &mut [f32]| {
        let whole: f32 = members.iter().map(|&v| sending[v]).sum();
        for &v in members {
            let weight = sending[v] / whole.max(f32::MIN_POSITIVE);
            rows.of(v).for_each(|(p, share)| dense[p] += weight * share);
        }
    };
    let mut weight = patches.sending();
    let areas: Vec<f32> = patches.members.iter().map(|list| list.iter().map(|&v| area[v]).sum()).collect();
    // What each patch sends to all others.
    let mut sent = vec![0.0; areas.len()];
    let mut dense = vec![0.0; areas.len()];
    for (members, area) in patches.members.iter().zip(&areas) {
        dense.fill(0.0);
        of_patch(members, &mut dense);
        sent.iter_mut().zip(&dense).for_each(|(sum, share)| *sum += area * share);
    }
    for _ in 0..BALANCES {
        let found = linker.link(&weight, &patches.blocks(), of_patch);
        let linked = linker.sent(&weight, &areas, &found);
        for ((w, all), linked) in weight.iter_mut().zip(&sent).zip(linked) {
            *w *= (all / linked.max(f32::MIN_POSITIVE)).clamp(0.5, 2.0);
        }
    }
    let triples = |list: &[Vec3]| list.iter().map(|p| p.to_array()).collect::<Vec<_>>();
    let order = block::order(&triples(&scene.mesh.position), &triples(&scene.mesh.normal));
    let mut all = Links::default();
    for (g, order) in order.chunks(GROUP).enumerate() {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let vertices: Vec<usize> = order.iter().map(|&row| g * GROUP + usize::from(row)).collect();
        all.extend(linker.link(&weight, &vertices.chunks(LANES).collect::<Vec<_>>(), of_vertex));
    }
    all.extend(linker.link(&weight, &patches.blocks(), of_patch));
    Ok(all.into_carrier(&order, tree, &weight))
}

/// Passes of [`importance`] that follow light, and rays of each vertex in one.
const IMPORTANCE: (u64, usize) = (4, 16);

/// How much each vertex is expected to send to others inside: irradiance under a uniform light, of few rays, and of an
/// outer one the share that it sends inside.
fn importance(
    surface: &Surface,
    options: &Options,
    lie: &Lie,
    progress: &dyn Progress,
) -> Result<Vec<f32>, Error> {
    let (passes, n_rays) = IMPORTANCE;
    let n = lie.uniform.len();
    let total = ((passes as usize + 2) * n * n_rays) as u64;
    // What vertices get of what all send.
    let gather = |b: u64, last: &[f32], before_last: &[f32], unlit: &[bool]| -> Result<Vec<f32>, Error> {
        let seed = hash(options.seed, 0xe0 + b);
        let sets = HemisphereSets::new(n_rays, seed);
        let done = AtomicU64::new(b * (n * n_rays) as u64);
        let pass =
            Pass { surface, sets: &sets, order: 0, seed, stage: "where light comes", total, done: &done };
        let escapes = |_: u32, _: Vec3, _: Vec3| false;
        let arriving = Arriving { columns: 0..1, last, before_last, many: None, escapes: &escapes, unlit };
        let mut rows = vec![0.0; 3 * n];
        bounced(&pass, &arriving, &mut rows, progress)?;
        Ok(rows)
    };
    let three = |of: &dyn Fn(usize) -> f32| (0..n).flat_map(|v| [of(v); 3]).collect::<Vec<f32>>();
    let direct = three(&|v| lie.uniform[v]);
    let (mut last, mut before_last) = (direct.clone(), Vec::new());
    for b in 0..passes {
        let mut next = gather(b, &last, &before_last, lie.unlit)?;
        next.iter_mut().zip(&direct).for_each(|(e, direct)| *e += direct);
        before_last = std::mem::replace(&mut last, next);
    }
    let inner = three(&|v| if lie.outer[v] || lie.unlit[v] { 0.0 } else { 1.0 });
    let not_outer: Vec<bool> = lie.outer.iter().map(|outer| !outer).collect();
    let mut inwards = gather(passes, &inner, &[], &not_outer)?;
    // And over one more.
    inwards.iter_mut().zip(&inner).for_each(|(share, inner)| *share += inner);
    let inwards = gather(passes + 1, &inwards, &[], &not_outer)?;
    let of = |v: usize| {
        let mean = |rows: &[f32]| rows[3 * v..][..3].iter().sum::<f32>() / 3.0;
        mean(&last) * if lie.outer[v] { mean(&inwards) } else { 1.0 }
    };
    Ok((0..n).map(of).collect())
}

/// Lobes are as bright as that many even coats where they shine.
const LOBE: f32 = 4.0;

/// Grey reflectance by which vertices are expected to be bright.
fn expected_reflectance(scene: &Scene) -> Vec<f32> {
    let of = |(all, albedo): (Vec3, Vec3)| (all + (LOBE - 1.0) * (all - albedo)).element_sum() / 3.0;
    vertex_reflectance(scene).into_iter().zip(scene.vertex_albedo()).map(of).collect()
}

/// What sends less than this against the mean, weighted by what it sends, counts less in the cutting of patches.
const UNIMPORTANT: f32 = 0.1;

/// What counts in the cutting of patches, of each vertex: half its part of the area, half its part of all vertices, which
/// are closer together where there is more to see; less where hardly anything is sent from.
fn sizes(area: &[f32], importance: &[f32]) -> Vec<f32> {
    let whole: f64 = area.iter().map(|a| f64::from(*a)).sum();
    let mean = (whole / area.len().max(1) as f64) as f32;
    let sizes: Vec<f32> = area.iter().map(|a| 0.5 * (a + mean)).collect();
    let full = (UNIMPORTANT * mean_important(&sizes, importance)).max(f32::MIN_POSITIVE);
    sizes.iter().zip(importance).map(|(size, i)| size * (i / full).min(1.0)).collect()
}

/// What is expected to send less than this against the mean, weighted by what it sends, makes patches of its own.
const DARK: f32 = 0.005;

/// The vertices of which patches are made: those inside, those outside, far brighter by day, and those that hardly send
/// anything, each apart. The space over a ceiling, of which a patch of the wall reached down into the room, would else see
/// that patch as bright as the room does.
fn groups(sizes: &[f32], importance: &[f32], lie: &Lie) -> [Vec<usize>; 3] {
    let least = DARK * mean_important(sizes, importance);
    let (bright, dark): (Vec<usize>, Vec<usize>) =
        (0..sizes.len()).filter(|&v| !lie.unlit[v]).partition(|&v| importance[v] >= least);
    let (outer, inner) = bright.into_iter().partition(|&v| lie.outer[v]);
    [inner, outer, dark]
}

/// Mean of what is expected to be sent, by size and by itself.
fn mean_important(sizes: &[f32], importance: &[f32]) -> f32 {
    let sum = |of: &dyn Fn(f32) -> f32| -> f64 {
        sizes.iter().zip(importance).map(|(size, i)| f64::from(size * of(*i))).sum()
    };
    (sum(&|i| i * i) / sum(&|i| i).max(f64::MIN_POSITIVE)) as f32
}

/// F, sparse: of each vertex the patches that its rays meet.
struct Rows {
    start: Vec<usize>,
    patch: Vec<u16>,
    /// Times [`SHARE`].
    share: Vec<f16>,
}

/// Shares are stored times this: those of one ray are too small for f16.
const SHARE: f32 = 1024.0;

impl Rows {
    fn trace(
        surface: &Surface,
        sets: &HemisphereSets,
        (leaf, n_leaves): (&[Option<u16>], usize),
        lie: &Lie,
        progress: &dyn Progress,
    ) -> Result<Rows, Error> {
        let rays = |n_vertices: usize| (n_vertices * sets.n_rays()) as u64;
        let mut rows = Rows { start: vec![0], patch: Vec::new(), share: Vec::new() };
        for first in (0..leaf.len()).step_by(BLOCK) {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let end = leaf.len().min(first + BLOCK);
            let found: Vec<Vec<(u16, f16)>> = (first..end)
                .into_par_iter()
                .map_init(
                    || vec![0.0f32; n_leaves],
                    |dense, v| if lie.unlit[v] { Vec::new() } else { row(surface, sets, leaf, v, dense) },
                )
                .collect();
            for row in found {
                rows.patch.extend(row.iter().map(|entry| entry.0));
                rows.share.extend(row.iter().map(|entry| entry.1));
                rows.start.push(rows.patch.len());
            }
            progress.report("direct to indirect", rays(end), rays(leaf.len()));
        }
        Ok(rows)
    }

    /// Patches and shares of a vertex.
    fn of(&self, v: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let range = self.start[v]..self.start[v + 1];
        let pairs = self.patch[range.clone()].iter().zip(&self.share[range]);
        pairs.map(|(p, share)| (usize::from(*p), share.to_f32() / SHARE))
    }
}

/// The row of a vertex; `dense` is zeros before and after.
fn row(
    surface: &Surface,
    sets: &HemisphereSets,
    leaf: &[Option<u16>],
    v: usize,
    dense: &mut [f32],
) -> Vec<(u16, f16)> {
    let mut touched: Vec<u16> = Vec::new();
    let all = fronts(surface, sets, (v, v), |corners, weights, _, z| {
        let nearest = (0..3).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap_or(0);
        if let Some(p) = leaf[corners[nearest] as usize] {
            let sum = &mut dense[usize::from(p)];
            if *sum == 0.0 {
                touched.push(p);
            }
            *sum += z;
        }
    });
    touched.sort_unstable();
    let take = |p: u16| (p, f16::from_f32(std::mem::take(&mut dense[usize::from(p)]) * (SHARE / all)));
    touched.into_iter().map(take).collect()
}

/// The patches and their vertices.
struct Patches<'a> {
    members: Vec<Vec<usize>>,
    /// Area of each vertex times what it sees of patches, m².
    sending: &'a [f32],
    /// Grey reflectance of each vertex.
    rho: Vec<f32>,
}

/// Darkest that a patch is expected to be, as a share of the mean.
const DARKEST: f32 = 0.2;

impl Patches<'_> {
    /// Sixteen at a time.
    fn blocks(&self) -> Vec<&[Vec<usize>]> {
        self.members.chunks(LANES).collect()
    }

    /// m².
    fn sending(&self) -> Vec<f32> {
        self.members.iter().map(|list| list.iter().map(|&v| self.sending[v]).sum()).collect()
    }

    /// Whether light reaches each patch, over however many others.
    fn reached(&self, rows: &Rows, uniform: &[f32]) -> Vec<bool> {
        let mut reached: Vec<bool> =
            self.members.iter().map(|list| list.iter().any(|&v| uniform[v] > 0.0)).collect();
        loop {
            let sees = |list: &Vec<usize>| list.iter().any(|&v| rows.of(v).any(|(p, _)| reached[p]));
            let next: Vec<bool> =
                self.members.par_iter().zip(&reached).map(|(list, r)| *r || sees(list)).collect();
            if next == reached {
                return reached;
            }
            reached = next;
        }
    }

    /// How much light is expected to leave each patch before it bounces on: that under a uniform sky.
    fn brightness(&self, uniform: &[f32]) -> Vec<f32> {
        let mean = |list: &Vec<usize>| {
            let whole: f32 = list.iter().map(|&v| self.sending[v]).sum();
            list.iter().map(|&v| self.sending[v] * self.rho[v] * uniform[v]).sum::<f32>()
                / whole.max(f32::MIN_POSITIVE)
        };
        let leaving: Vec<f32> = self.members.iter().map(mean).collect();
        let mean = leaving.iter().sum::<f32>() / leaving.len().max(1) as f32;
        let least = if mean > 0.0 { DARKEST * mean } else { 1.0 };
        leaving.into_iter().map(|b| b.max(least)).collect()
    }
}
