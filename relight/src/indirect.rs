//! Bounced light carried from direct light, whatever it came from.
//!
//! The bake has halved the surface again and again, down to P patches: a tree of N = 2 P - 1 nodes, of which each row,
//! those of the vertices and those of the patches, has K links to some. A frame computes the direct irradiance of all
//! vertices, then, per colour,
//!
//! ```text
//! R[p]  = Σ w ρ E_direct / Σ w                                    over the vertices v of patch p, w = area[v] S[v]
//! B[p]  = R[p] + ρ[p] scale[V + p] Σ_k share²[V + p, k] B[node[V + p, k]]      solved by iteration
//! E(v) += scale[v] Σ_k share²[v, k] B[node[v, k]]
//! ```
//!
//! S\[v\] = scale\[v\] Σ_k share²\[v, k\] being what a vertex sees of others, and so, by reciprocity, what they see of it, and
//! where B of a node with children is Σ part\[c\] B\[c\] over them: about their mean by area, with weights by which a
//! patch sends out through all links together what it does through the rows themselves. E is irradiance without the receiver's albedo, in the unit of
//! the light. A vertex's area is a third of its triangles'.
//!
//! | name | type | |
//! |---|---|---|
//! | `indirect.patch` | u16 \[V\] | node of the patch that a vertex belongs to; [`NO_PATCH`]: none |
//! | `indirect.tree` | u16 \[N,2\] | children of each node, which come after it; 0, 0 for a patch |
//! | `indirect.node` | u16 \[V+P,K\] | rows of the vertices, then of the patches in the order of their nodes |
//! | `indirect.share` | u8 \[V+P,K\] | square root of what the link is worth |
//! | `indirect.scale` | f32 \[V+P\] | |
//! | `indirect.part` | f32 \[N\] | weight of each node in its parent |
//!
//! Where it breaks: the pattern of direct light within a patch is lost to what it bounces on to, so that a patch with
//! a narrow beam on its edge glows as a whole.
//!
//! Based on: Hašan, Pellacini and Bala, Direct-to-Indirect Transfer for Cinematic Relighting, 2006; Hanrahan, Salzman and
//! Aupperle, A Rapid Hierarchical Radiosity Algorithm, 1991.

use glam::{Vec3, Vec4};

use crate::asset::{Asset, Data, NO_PATCH};
use crate::glossy::reflectance;
use crate::light::{Cap, Light, split};
use crate::shell;

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
        let has_carrier = asset.tensor("indirect.node").is_some();
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

/// Most steps by which B is found, each a bounce.
const STEPS: usize = 64;

/// The iteration ends when a step changes all light by less than this part of it.
const CONVERGED: f32 = 3e-4;

/// q² of a byte: a load in place of a conversion and a product.
const SQUARES: [f32; 256] = {
    let mut squares = [0.0; 256];
    let mut q = 0;
    while q < 256 {
        squares[q] = (q * q) as f32;
        q += 1;
    }
    squares
};

/// The direct-to-indirect part of an asset, and the bounced light of the moment.
#[derive(Clone, Debug)]
pub struct Carrier<'a> {
    patch: &'a [u16],
    /// w ρ / Σ w over its patch, per vertex.
    weight: Vec<Vec3>,
    children: &'a [[u16; 2]],
    part: &'a [f32],
    /// Nodes without children, rising.
    leaves: Vec<u16>,
    n_links: usize,
    node: &'a [u16],
    share: &'a [u8],
    scale: &'a [f32],
    /// Of each node that is a patch.
    albedo: Vec<Vec3>,
    reflected: Vec<Vec3>,
    /// Of each node: all that leaves it.
    leaving: Vec<Vec4>,
    /// Of each leaf, in the next step.
    next: Vec<Vec3>,
    steps: usize,
}

impl<'a> Carrier<'a> {
    /// The carrier of an asset; `None` where none is baked. Bounced light is dark until [`Carrier::reflect`].
    pub fn open(asset: &'a Asset<'a>) -> Option<Carrier<'a>> {
        let names =
            ["patch", "tree", "node", "share", "scale", "part"].map(|part| format!("indirect.{part}"));
        let [patch, tree, node, share, scale, part] = names.each_ref().map(|name| asset.tensor(name));
        let n_links = *node?.shape.get(1)?;
        let (Data::U16(patch), Data::U16(tree), Data::U16(node)) = (&patch?.data, &tree?.data, &node?.data)
        else {
            return None;
        };
        let (Data::U8(share), Data::F32(scale), Data::F32(part)) = (&share?.data, &scale?.data, &part?.data)
        else {
            return None;
        };
        let children: &[[u16; 2]] = bytemuck::try_cast_slice(tree).ok()?;
        check(children, patch, node).ok()?;
        let leaves = leaves(children);
        let n_leaves = leaves.len();
        let rows = patch.len() + n_leaves;
        if patch.len() != asset.n_vertices()
            || scale.len() != rows
            || node.len() != rows * n_links
            || share.len() != node.len()
            || part.len() != children.len()
        {
            return None;
        }
        let seen = |v: usize| -> f64 {
            let squares = share[v * n_links..(v + 1) * n_links].iter().map(|q| f64::from(*q).powi(2));
            f64::from(scale[v]) * squares.sum::<f64>()
        };
        let area = vertex_area(asset).into_iter().enumerate().map(|(v, a)| a * seen(v));
        let weight = weights(asset, patch, &area.collect::<Vec<_>>(), children.len());
        let mut albedo = vec![Vec3::ZERO; children.len()];
        for (p, w) in patch.iter().zip(&weight).filter(|(p, _)| **p != NO_PATCH) {
            albedo[usize::from(*p)] += *w;
        }
        Some(Carrier {
            patch,
            weight,
            children,
            part,
            leaves,
            n_links,
            node,
            share,
            scale,
            albedo,
            reflected: vec![Vec3::ZERO; children.len()],
            leaving: vec![Vec4::ZERO; children.len()],
            next: vec![Vec3::ZERO; n_leaves],
            steps: bounces(asset).saturating_sub(1).min(STEPS),
        })
    }

    /// Takes on the direct irradiance of all vertices.
    ///
    /// # Panics
    /// When `direct` is not one value per vertex.
    pub fn reflect(&mut self, direct: &[[f32; 3]]) {
        self.begin(direct);
        for _ in 0..self.steps {
            let mut next = std::mem::take(&mut self.next);
            next.iter_mut().enumerate().for_each(|(i, next)| *next = self.sent(i));
            if !self.step(next) {
                break;
            }
        }
    }

    /// As [`Carrier::reflect`], over all threads of the current rayon pool.
    ///
    /// # Panics
    /// As [`Carrier::reflect`].
    #[cfg(feature = "rayon")]
    pub fn reflect_parallel(&mut self, direct: &[[f32; 3]]) {
        use rayon::prelude::*;
        self.begin(direct);
        for _ in 0..self.steps {
            let mut next = std::mem::take(&mut self.next);
            let task = 128;
            next.par_chunks_mut(task).enumerate().for_each(|(i, next)| {
                next.iter_mut().enumerate().for_each(|(j, next)| *next = self.sent(i * task + j));
            });
            if !self.step(next) {
                break;
            }
        }
    }

    /// What leaves the patches of direct light.
    fn begin(&mut self, direct: &[[f32; 3]]) {
        assert_eq!(
            direct.len(),
            self.patch.len(),
            "bounced light starts from the direct light of all vertices"
        );
        self.reflected.fill(Vec3::ZERO);
        for ((patch, weight), direct) in self.patch.iter().zip(&self.weight).zip(direct) {
            if let Some(sum) = self.reflected.get_mut(usize::from(*patch)) {
                *sum += *weight * Vec3::from(*direct);
            }
        }
        for (b, r) in self.leaving.iter_mut().zip(&self.reflected) {
            *b = r.extend(0.0);
        }
        self.average();
    }

    /// What leaves leaf `i` under what leaves all now.
    fn sent(&self, i: usize) -> Vec3 {
        let leaf = usize::from(self.leaves[i]);
        self.reflected[leaf] + self.albedo[leaf] * self.arriving(self.patch.len() + i)
    }

    /// Takes on what leaves the patches; whether that changed anything worth another step.
    fn step(&mut self, next: Vec<Vec3>) -> bool {
        let (mut change, mut all) = (Vec3::ZERO, Vec3::ZERO);
        for (leaf, next) in self.leaves.iter().zip(&next) {
            let leaving = &mut self.leaving[usize::from(*leaf)];
            change += (*next - leaving.truncate()).abs();
            all += *next;
            *leaving = next.extend(0.0);
        }
        self.next = next;
        self.average();
        change.element_sum() > CONVERGED * all.element_sum()
    }

    /// Gives nodes with children their mean.
    fn average(&mut self) {
        for node in (0..self.children.len()).rev() {
            let [l, r] = self.children[node].map(usize::from);
            if l > 0 {
                self.leaving[node] = self.part[l] * self.leaving[l] + self.part[r] * self.leaving[r];
            }
        }
    }

    /// Irradiance of a row.
    #[inline]
    fn arriving(&self, row: usize) -> Vec3 {
        let range = row * self.n_links..(row + 1) * self.n_links;
        let mut sums = [Vec4::ZERO; 4];
        let (nodes, shares) = (&self.node[range.clone()], &self.share[range]);
        let (nodes, nodes_rest) = nodes.as_chunks::<4>();
        let (shares, shares_rest) = shares.as_chunks::<4>();
        for (nodes, shares) in nodes.iter().zip(shares) {
            for ((sum, node), q) in sums.iter_mut().zip(nodes).zip(shares) {
                *sum += SQUARES[usize::from(*q)] * self.leaving[usize::from(*node)];
            }
        }
        for (node, q) in nodes_rest.iter().zip(shares_rest) {
            sums[0] += SQUARES[usize::from(*q)] * self.leaving[usize::from(*node)];
        }
        self.scale[row] * (sums[0] + sums[1] + (sums[2] + sums[3])).truncate()
    }

    /// Adds bounced irradiance to the vertices from `first` on.
    ///
    /// # Panics
    /// When there are not that many vertices.
    pub fn add(&self, first: usize, out: &mut [[f32; 3]]) {
        assert!(first + out.len() <= self.patch.len(), "there are not that many vertices");
        for (v, out) in (first..).zip(out) {
            *out = (Vec3::from(*out) + self.arriving(v)).to_array();
        }
    }

    /// K.
    pub fn n_links(&self) -> usize {
        self.n_links
    }

    /// What a vertex stores: its links, their scale, and its own patch.
    pub fn bytes_per_vertex(&self) -> usize {
        3 * self.n_links + 6
    }
}

/// What is wrong with a tree, the patches of vertices, or the nodes of links: the tensor and why.
pub(crate) fn check(
    children: &[[u16; 2]],
    patch: &[u16],
    node: &[u16],
) -> Result<(), (&'static str, String)> {
    let n = children.len();
    let is_tree = |(i, pair): (usize, &[u16; 2])| {
        *pair == [0, 0] || pair.iter().all(|&c| usize::from(c) > i && usize::from(c) < n)
    };
    if let Some(i) = children.iter().enumerate().position(|entry| !is_tree(entry)) {
        return Err(("tree", format!("children of node {i} do not come after it, or are not there")));
    }
    let mut parents = vec![0u8; n];
    for child in children.iter().flatten().filter(|c| **c > 0) {
        parents[usize::from(*child)] = parents[usize::from(*child)].saturating_add(1);
    }
    if let Some(i) = (1..n).find(|&i| parents[i] != 1) {
        return Err(("tree", format!("node {i} has {} parents instead of one", parents[i])));
    }
    let is_patch = |p: u16| children.get(usize::from(p)) == Some(&[0, 0]);
    if let Some(v) = patch.iter().position(|&p| p != NO_PATCH && !is_patch(p)) {
        return Err(("patch", format!("vertex {v} points to node {}, which is no patch", patch[v])));
    }
    match node.iter().position(|&i| usize::from(i) >= n) {
        Some(at) => Err(("node", format!("link {at} points past node {n}"))),
        None => Ok(()),
    }
}

/// Nodes without children, rising.
pub(crate) fn leaves(children: &[[u16; 2]]) -> Vec<u16> {
    (0..children.len()).filter(|&i| children[i] == [0, 0]).map(|i| i as u16).collect()
}

/// How often light bounces in an asset; endlessly where it does not say.
fn bounces(asset: &Asset) -> usize {
    let value = asset.metadata.options.get("bounces").and_then(serde_json::Value::as_u64);
    value.map_or(usize::MAX, |n| n as usize)
}

/// w ρ / Σ w over the patch, per vertex; 0 for a patch that sees nothing.
fn weights(asset: &Asset, patch: &[u16], w: &[f64], n_nodes: usize) -> Vec<Vec3> {
    let mut whole = vec![0.0; n_nodes];
    for (p, w) in patch.iter().zip(w).filter(|(p, _)| **p != NO_PATCH) {
        whole[usize::from(*p)] += w;
    }
    let weight = |((p, w), albedo): ((&u16, &f64), Vec3)| match whole.get(usize::from(*p)) {
        Some(whole) if *whole > 0.0 => albedo * (w / whole) as f32,
        _ => Vec3::ZERO,
    };
    patch.iter().zip(w).zip(reflectance(asset)).map(weight).collect()
}

/// A third of its triangles' area for each vertex, m².
pub(crate) fn vertex_area(asset: &Asset) -> Vec<f64> {
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
