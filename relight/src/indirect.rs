//! Bounced light carried from direct light, whatever it came from.
//!
//! The bake has halved the surface again and again, down to P patches: a tree of N = 2 P - 1 nodes, to some of which each
//! row, those of the vertices and those of the patches, has links: the same for the sixteen rows of a
//! [`block`], each worth something else to each row. A frame computes the direct irradiance of all vertices, then, per
//! colour,
//!
//! ```text
//! R[p]  = Σ w ρ E_direct / Σ w                         over the vertices v of patch p, w = area[v] S[v]
//! B[p]  = R[p] + ρ[p] scale[p] Σ_k value(share[k, p]) B[node[k]]      over the links k of p's block, solved by iteration
//! E(v) += scale[v] Σ_k value(share[k, v]) B[node[k]]                  over the links k of v's block
//! ```
//!
//! S\[v\] = scale\[v\] Σ_k value(share\[k, v\]) being what a vertex sees of others, and so, by reciprocity, what they see of it, and
//! where B of a node with children is Σ part\[c\] B\[c\] over them: about their mean by area, with weights by which a
//! patch sends out through all links together what it does through the rows themselves. E is irradiance without the receiver's albedo, in the unit of
//! the light. A vertex's area is a third of its triangles'.
//!
//! Of V vertices, in A = ⌈V / 16⌉ blocks, and P patches, in C = ⌈P / 16⌉, with L links:
//!
//! | name | type | |
//! |---|---|---|
//! | `indirect.patch` | u16 \[V\] | node of the patch that a vertex belongs to; [`NO_PATCH`]: none |
//! | `indirect.tree` | u16 \[N,2\] | children of each node, which come after it; 0, 0 for a patch |
//! | `indirect.part` | f32 \[N\] | weight of each node in its parent |
//! | `indirect.row` | u16 \[A,16\] | vertices of each block, counted from the first of their group of 1024, of which 64 blocks are; [`NO_ROW`]: none |
//! | `indirect.start` | u32 \[A+C+1\] | block b has the links `start[b]..start[b + 1]`; blocks of vertices, then of patches, 16 after 16 in the order of their nodes |
//! | `indirect.node` | u16 \[L\] | |
//! | `indirect.share` | u8 \[L,16\] | what the link is worth to each row, a small float ([`block::value`]) |
//! | `indirect.scale` | f32 \[A+C,16\] | |
//!
//! What comes through windows glossy vertices send on by their lobes (`shine.rs`), so that of them R is of their albedo alone;
//! ρ counts their lobes as if they were even.
//!
//! Where it breaks: the pattern of direct light within a patch is lost to what it bounces on to, so that a patch with
//! a narrow beam on its edge glows as a whole.
//!
//! Based on: Hašan, Pellacini and Bala, Direct-to-Indirect Transfer for Cinematic Relighting, 2006; Hanrahan, Salzman and
//! Aupperle, A Rapid Hierarchical Radiosity Algorithm, 1991.

use glam::{Vec3, Vec4};

use crate::asset::{Asset, Data, Error, NO_PATCH};
use crate::block::{self, Blocks, LANES, NO_ROW, Sums};
use crate::glossy::reflectance;
use crate::light::{Cap, Light, split};
use crate::shell;

mod shine;

pub(crate) use shine::Shine;

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
    /// Vertices of the first blocks; the others' are patches.
    rows: &'a [[u16; LANES]],
    blocks: Blocks<'a>,
    /// Of each node that is a patch.
    albedo: Vec<Vec3>,
    reflected: Vec<Vec3>,
    /// Of each node: all that leaves it.
    leaving: Vec<Vec4>,
    /// Of each leaf, in the next step.
    next: Vec<Vec3>,
    steps: usize,
    /// What is glossy, if anything is; and whether its light of the moment is known.
    shine: Option<Shine>,
    shines: bool,
    position: &'a [[f32; 3]],
}

impl<'a> Carrier<'a> {
    /// The carrier of an asset; `None` where none is baked. Bounced light is dark until [`Carrier::reflect`].
    ///
    /// # Errors
    /// When its tensors do not hold together, which an asset that was read cannot have.
    pub fn open(asset: &'a Asset<'a>) -> Result<Option<Carrier<'a>>, Error> {
        let Some(parts) = Parts::open(asset)? else { return Ok(None) };
        let Parts { patch, children, part, rows, blocks } = parts;
        let leaves = leaves(children);
        let n_leaves = leaves.len();
        let mut weighted = vertex_area(asset);
        let ones = vec![Vec4::ONE; children.len()];
        let mut seen = [[0.0; LANES]; 3];
        for (b, vertices) in blocks_of_vertices(rows) {
            blocks.sums(b, &ones, &mut seen);
            vertices.for_each(|(lane, v)| weighted[v] *= f64::from(seen[0][lane] * blocks.scale[b][lane]));
        }
        let share = shares(patch, &weighted, children.len());
        let shine = Shine::open(asset, (patch, &share), (children, part), &blocks)?;
        let weight: Vec<Vec3> =
            share.into_iter().zip(reflectance(asset)).map(|(share, rho)| share * rho).collect();
        let mut albedo = vec![Vec3::ZERO; children.len()];
        for (p, w) in patch.iter().zip(&weight).filter(|(p, _)| **p != NO_PATCH) {
            albedo[usize::from(*p)] += *w;
        }
        Ok(Some(Carrier {
            patch,
            weight,
            children,
            part,
            leaves,
            rows,
            blocks,
            albedo,
            reflected: vec![Vec3::ZERO; children.len()],
            leaving: vec![Vec4::ZERO; children.len()],
            next: vec![Vec3::ZERO; n_leaves],
            steps: bounces(asset).saturating_sub(1).min(STEPS),
            shine,
            shines: false,
            position: asset.positions(),
        }))
    }

    /// Whether anything is glossy.
    pub(crate) fn has_shine(&self) -> bool {
        self.shine.is_some()
    }

    /// What is glossy, to be told of direct light before each [`Carrier::reflect`], which then sends it on by lobes; who
    /// never asks for it has it sent on evenly.
    pub(crate) fn shine(&mut self) -> Option<&mut Shine> {
        self.shines = self.shine.is_some();
        self.shine.as_mut()
    }

    /// Takes on the direct irradiance of all vertices.
    ///
    /// # Panics
    /// When `direct` is not one value per vertex.
    pub fn reflect(&mut self, direct: &[[f32; 3]]) {
        self.begin(direct);
        for _ in 0..self.steps {
            let mut next = std::mem::take(&mut self.next);
            next.chunks_mut(LANES).enumerate().for_each(|(j, next)| self.send(j, next));
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
            let task = 8;
            let blocks = next.par_chunks_mut(LANES).enumerate().with_min_len(task);
            blocks.for_each(|(j, next)| self.send(j, next));
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
        if let Some(shine) = self.shine.as_mut().filter(|_| self.shines) {
            for (v, (node, even)) in shine.vertices().zip(shine.even()) {
                self.reflected[node] -= even * Vec3::from(direct[v]);
            }
            shine.finish(self.children, self.part);
            if self.steps > 0 {
                self.add_shine_to_patches();
            }
        }
        for (b, r) in self.leaving.iter_mut().zip(&self.reflected) {
            *b = r.extend(0.0);
        }
        self.average();
    }

    /// What the patches send on of what the lobes of others send them.
    fn add_shine_to_patches(&mut self) {
        let Some(shine) = &self.shine else { return };
        for (j, leaves) in self.leaves.chunks(LANES).enumerate() {
            let middle = |i: usize| leaves.get(i).map_or(Vec3::ZERO, |leaf| shine.middle(usize::from(*leaf)));
            let (block, mut sums) = (self.rows.len() + j, [[0.0; LANES]; 3]);
            shine.add_to(block, &self.blocks, &std::array::from_fn(middle), &mut sums);
            for (i, (leaf, scale)) in leaves.iter().zip(&self.blocks.scale[block]).enumerate() {
                let leaf = usize::from(*leaf);
                self.reflected[leaf] += self.albedo[leaf] * *scale * Vec3::from(sums.map(|sums| sums[i]));
            }
        }
    }

    /// Adds what the lobes send to the vertices of block `b`.
    fn shine_on(&self, shine: &Shine, b: usize, sums: &mut Sums) {
        let place = |row: u16| {
            let v = block::first_row(b) + usize::from(row);
            self.position.get(v).map_or(Vec3::ZERO, |p| Vec3::from(*p))
        };
        shine.add_to(b, &self.blocks, &self.rows[b].map(place), sums);
    }

    /// What leaves the patches of their block `j` under what leaves all now.
    fn send(&self, j: usize, next: &mut [Vec3]) {
        let (block, mut sums) = (self.rows.len() + j, [[0.0; LANES]; 3]);
        self.blocks.sums(block, &self.leaving, &mut sums);
        let leaves = self.leaves[j * LANES..].iter().zip(&self.blocks.scale[block]);
        for (i, (next, (leaf, scale))) in next.iter_mut().zip(leaves).enumerate() {
            let leaf = usize::from(*leaf);
            *next = self.reflected[leaf] + self.albedo[leaf] * *scale * Vec3::from(sums.map(|sums| sums[i]));
        }
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
        let leaving = &mut self.leaving;
        for node in (0..self.children.len()).rev() {
            let [l, r] = self.children[node].map(usize::from);
            if l > 0 {
                leaving[node] = self.part[l] * leaving[l] + self.part[r] * leaving[r];
            }
        }
    }

    /// Adds bounced irradiance to the vertices from `first` on: best by multiples of [`block::GROUP`].
    ///
    /// # Panics
    /// When there are not that many vertices.
    pub fn add(&self, first: usize, out: &mut [[f32; 3]]) {
        assert!(first + out.len() <= self.patch.len(), "there are not that many vertices");
        let mut sums = [[0.0; LANES]; 3];
        for b in block::range(first, out.len(), self.rows.len()) {
            if self.blocks.start[b] < self.blocks.start[b + 1] {
                self.blocks.sums(b, &self.leaving, &mut sums);
                if let Some(shine) = self.shine.as_ref().filter(|_| self.shines) {
                    self.shine_on(shine, b, &mut sums);
                }
                let scale = &self.blocks.scale[b];
                block::add_to(&sums, scale, &self.rows[b], (block::first_row(b), first), out);
            }
        }
    }

    /// What a vertex stores in the mean: its links, their scale, its own patch, and its place in a block.
    pub fn bytes_per_vertex(&self) -> f32 {
        let (blocks, vertices) = (self.rows.len(), self.patch.len());
        let links = self.blocks.start[blocks] as usize;
        let bytes = (2 + LANES) * links + (4 + 6 * LANES) * blocks + 2 * vertices;
        bytes as f32 / vertices.max(1) as f32
    }
}

/// Blocks and their vertices, with their place in the block.
fn blocks_of_vertices(
    rows: &[[u16; LANES]],
) -> impl Iterator<Item = (usize, impl Iterator<Item = (usize, usize)>)> {
    let vertices = |b: usize, rows: &[u16; LANES]| {
        let there = rows.map(|row| (row != NO_ROW).then(|| block::first_row(b) + usize::from(row)));
        there.into_iter().enumerate().filter_map(|(lane, v)| Some((lane, v?)))
    };
    rows.iter().enumerate().map(move |(b, rows)| (b, vertices(b, rows)))
}

/// The tensors of a carrier, which hold together.
struct Parts<'a> {
    patch: &'a [u16],
    children: &'a [[u16; 2]],
    part: &'a [f32],
    rows: &'a [[u16; LANES]],
    blocks: Blocks<'a>,
}

/// That the tensors of a carrier hold together where there are some.
pub(crate) fn check(asset: &Asset) -> Result<(), Error> {
    Parts::open(asset).map(|_| ())
}

impl<'a> Parts<'a> {
    fn open(asset: &'a Asset<'a>) -> Result<Option<Parts<'a>>, Error> {
        const NAMES: [&str; 8] = ["patch", "tree", "part", "row", "start", "node", "share", "scale"];
        let is_there = |part: &&str| asset.tensor(&format!("indirect.{part}")).is_some();
        if !NAMES.iter().any(is_there) {
            return Ok(None);
        }
        if let Some(part) = NAMES.iter().find(|name| !is_there(name)) {
            return Err(wrong(part, "missing"));
        }
        let patch = tensor(asset, "patch", Data::as_u16)?;
        let children = bytemuck::try_cast_slice(tensor(asset, "tree", Data::as_u16)?)
            .map_err(|_| wrong("tree", "not in pairs"))?;
        check_tree(children, patch).map_err(|(part, what)| wrong(part, &what))?;
        let part = tensor(asset, "part", Data::as_f32)?;
        expect_length("part", part.len(), children.len(), "nodes")?;
        let n_vertices = asset.n_vertices();
        let of_vertices = n_vertices.div_ceil(LANES);
        let n_blocks = of_vertices + leaves(children).len().div_ceil(LANES);
        let rows: &[[u16; LANES]] = sixteens("row", tensor(asset, "row", Data::as_u16)?)?;
        expect_length("row", rows.len(), of_vertices, "blocks")?;
        check_rows(rows, n_vertices).map_err(|what| wrong("row", &what))?;
        let start = tensor(asset, "start", Data::as_u32)?;
        expect_length("start", start.len(), n_blocks + 1, "starts of blocks")?;
        let node = tensor(asset, "node", Data::as_u16)?;
        if start[0] != 0 || !start.is_sorted() {
            return Err(wrong("start", "not a rising list from 0"));
        }
        expect_length("node", node.len(), start[n_blocks] as usize, "links")?;
        if let Some(at) = node.iter().position(|&i| usize::from(i) >= children.len()) {
            return Err(wrong("node", &format!("link {at} points past node {}", children.len())));
        }
        let share = sixteens("share", tensor(asset, "share", Data::as_u8)?)?;
        expect_length("share", share.len(), node.len(), "links")?;
        if let Some(at) = share.as_flattened().iter().position(|&byte| !block::is_share(byte)) {
            let byte = share.as_flattened()[at];
            return Err(wrong("share", &format!("value {at} is {byte}, no small float")));
        }
        let scale = sixteens("scale", tensor(asset, "scale", Data::as_f32)?)?;
        expect_length("scale", scale.len(), n_blocks, "blocks")?;
        for (name, values) in [("scale", scale.as_flattened()), ("part", part)] {
            if let Some(at) = values.iter().position(|x| *x < 0.0) {
                return Err(wrong(name, &format!("value {at} is negative")));
            }
        }
        let blocks = Blocks { start, entry: node, share, scale };
        Ok(Some(Parts { patch, children, part, rows, blocks }))
    }
}

fn tensor<'a, T>(
    asset: &'a Asset<'a>,
    part: &str,
    take: impl Fn(&'a Data<'a>) -> Option<&'a [T]>,
) -> Result<&'a [T], Error> {
    let found = asset.tensor(&format!("indirect.{part}")).and_then(|tensor| take(&tensor.data));
    found.ok_or_else(|| wrong(part, "not of its type"))
}

fn sixteens<'a, T: bytemuck::Pod>(part: &str, list: &'a [T]) -> Result<&'a [[T; LANES]], Error> {
    let (blocks, rest) = list.as_chunks();
    if rest.is_empty() { Ok(blocks) } else { Err(wrong(part, "not in sixteens")) }
}

fn expect_length(part: &str, found: usize, expected: usize, of: &str) -> Result<(), Error> {
    if found == expected {
        return Ok(());
    }
    Err(wrong(part, &format!("{found} {of} instead of {expected}")))
}

fn wrong(part: &str, what: &str) -> Error {
    Error::Tensor { name: format!("indirect.{part}"), what: what.to_string() }
}

/// That each vertex is in one block of its group.
fn check_rows(rows: &[[u16; LANES]], n_vertices: usize) -> Result<(), String> {
    let mut found = vec![false; n_vertices];
    for (b, vertices) in blocks_of_vertices(rows) {
        for (_, v) in vertices {
            match found.get_mut(v) {
                Some(found) if !*found && v < block::first_row(b) + block::GROUP => *found = true,
                _ => return Err(format!("block {b} has a vertex of another, {v}")),
            }
        }
    }
    match found.iter().position(|found| !found) {
        Some(v) => Err(format!("vertex {v} is in no block")),
        None => Ok(()),
    }
}

/// What is wrong with a tree or the patches of vertices: the tensor and why.
fn check_tree(children: &[[u16; 2]], patch: &[u16]) -> Result<(), (&'static str, String)> {
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
    Ok(())
}

/// Nodes without children, rising.
fn leaves(children: &[[u16; 2]]) -> Vec<u16> {
    (0..children.len()).filter(|&i| children[i] == [0, 0]).map(|i| i as u16).collect()
}

/// How often light bounces in an asset; endlessly where it does not say.
fn bounces(asset: &Asset) -> usize {
    let value = asset.metadata.options.get("bounces").and_then(serde_json::Value::as_u64);
    value.map_or(usize::MAX, |n| n as usize)
}

/// w / Σ w over the patch, per vertex; 0 for a patch that sees nothing.
fn shares(patch: &[u16], w: &[f64], n_nodes: usize) -> Vec<f32> {
    let mut whole = vec![0.0; n_nodes];
    for (p, w) in patch.iter().zip(w).filter(|(p, _)| **p != NO_PATCH) {
        whole[usize::from(*p)] += w;
    }
    let share = |(p, w): (&u16, &f64)| match whole.get(usize::from(*p)) {
        Some(whole) if *whole > 0.0 => (w / whole) as f32,
        _ => 0.0,
    };
    patch.iter().zip(w).map(share).collect()
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
