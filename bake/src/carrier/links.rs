//! Rows of shares as links to nodes of the tree.
//!
//! A link says that its node's share S is spread over the node's patches by their weights w: F\[p\] ≈ S w_p / W. What
//! it then gets wrong, under light that differs from patch to patch, is at most about
//!
//! Σ b_p |F\[p\] - S w_p / W| <= √(W Σ b_p² w_p (F\[p\] / w_p - S / W)²),
//!
//! b being the patches' expected brightness. From the root on, the link with the largest such bound is replaced by those to
//! its two children, until there are K. Rows are linked by sixteens that lie together, of a [`block`]: all have the same
//! links, of which each has its own shares, and the square that counts is the sum of theirs.
//!
//! Weights are at first what the vertices of a patch see of others. But then a patch that many rows see more of than of its neighbours would send out too
//! little in all, and the room would be darker than it is: weights are multiplied by what the patches' rows themselves
//! say that a patch sends, over what their links do, and links are chosen again.
//!
//! Shares take a byte, a small float ([`block::value`]), since many links are small. What rounding leaves of one goes on to
//! the next, and the scale is set last, so that the row keeps its sum.

use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::{Carrier, Tree};
use lunette_relight::block::{self, LANES};

/// Finds the links of rows.
pub struct Linker<'a> {
    pub tree: &'a Tree,
    /// Light expected to leave each patch.
    pub bright: Vec<f32>,
    /// K.
    pub n_links: usize,
}

/// Rows of links, in blocks.
pub struct Links {
    /// Block b has the links `start[b]..start[b + 1]`.
    pub start: Vec<u32>,
    pub node: Vec<u16>,
    /// Of each link, and of each row of its block.
    pub share: Vec<[u8; LANES]>,
    pub scale: Vec<[f32; LANES]>,
}

/// What the rows of a block have of each node.
#[derive(Clone, Copy, Default)]
struct Sums {
    share: [f32; LANES],
    /// Σ b² F of each, and Σ b² F² / w of all.
    bright: [f32; LANES],
    squares: f32,
}

/// Nodes and what they are worth to each row.
type Chosen = Vec<(u16, [f32; LANES])>;

/// The same in bytes, and the scale of each row.
type Encoded = (Vec<(u16, [u8; LANES])>, [f32; LANES]);

/// A link that may be replaced.
#[derive(PartialEq)]
struct Open {
    error: f32,
    node: usize,
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Open) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    fn cmp(&self, other: &Open) -> std::cmp::Ordering {
        self.error.total_cmp(&other.error).then(other.node.cmp(&self.node))
    }
}

impl Linker<'_> {
    /// The rows of blocks of things, of each of which `fill` writes the shares of all patches into zeros.
    ///
    /// # Panics
    /// When a block has more than [`LANES`].
    pub fn link<T: Sync>(
        &self,
        weight: &[f32],
        blocks: &[impl AsRef<[T]> + Sync],
        fill: impl Fn(&T, &mut [f32]) + Sync,
    ) -> Links {
        let leaves = self.tree.leaves();
        // Of each node: W, and Σ b² w.
        let mut size = vec![(0.0f32, 0.0f32); self.tree.children.len()];
        for ((&node, w), b) in leaves.iter().zip(weight).zip(&self.bright) {
            size[node] = (*w, w * b * b);
        }
        self.tree.add_up(&mut size, |l, r| (l.0 + r.0, l.1 + r.1));
        let rows: Vec<Encoded> = blocks
            .par_iter()
            .map_init(
                || (vec![0.0; leaves.len()], vec![Sums::default(); size.len()]),
                |(dense, sums), things| {
                    sums.fill(Sums::default());
                    for (lane, thing) in things.as_ref().iter().enumerate() {
                        dense.fill(0.0);
                        fill(thing, dense);
                        leaves.iter().zip(&*dense).for_each(|(&node, share)| sums[node].share[lane] = *share);
                    }
                    encode(&self.choose(&leaves, weight, &size, sums))
                },
            )
            .collect();
        let mut links = Links::default();
        for (row, scale) in rows {
            links.node.extend(row.iter().map(|link| link.0));
            links.share.extend(row.iter().map(|link| link.1));
            links.start.push(links.node.len() as u32);
            links.scale.push(scale);
        }
        links
    }

    /// What each patch sends by the links of rows of these areas.
    pub fn sent(&self, weight: &[f32], areas: &[f32], links: &Links) -> Vec<f32> {
        let mut nodes = vec![0.0f32; self.tree.children.len()];
        for (b, areas) in areas.chunks(LANES).enumerate() {
            let block = links.start[b] as usize..links.start[b + 1] as usize;
            for (node, shares) in links.node[block.clone()].iter().zip(&links.share[block]) {
                for ((area, q), scale) in areas.iter().zip(shares).zip(&links.scale[b]) {
                    nodes[usize::from(*node)] += area * scale * block::value(*q);
                }
            }
        }
        // Down the tree, by weight.
        let whole = wholes(self.tree, weight);
        for node in 0..nodes.len() {
            for child in self.tree.children[node].map(usize::from).into_iter().filter(|c| *c > 0) {
                nodes[child] += nodes[node] * whole[child] / whole[node].max(f32::MIN_POSITIVE);
            }
        }
        self.tree.leaves().iter().map(|&node| nodes[node]).collect()
    }

    /// The links of a block by the shares of its leaves.
    fn choose(&self, leaves: &[usize], weight: &[f32], size: &[(f32, f32)], sums: &mut [Sums]) -> Chosen {
        for ((&node, &w), b) in leaves.iter().zip(weight).zip(&self.bright) {
            let Sums { share, bright, squares } = &mut sums[node];
            *bright = share.map(|share| b * b * share);
            let products = share.iter().zip(&*bright).map(|(share, bright)| share * bright);
            *squares = if w > 0.0 { products.sum::<f32>() / w } else { 0.0 };
        }
        self.tree.add_up(sums, |l, r| Sums {
            share: add(&l.share, &r.share),
            bright: add(&l.bright, &r.bright),
            squares: l.squares + r.squares,
        });
        let open = |node: usize| {
            let (Sums { share, bright, squares }, (whole, size)) = (&sums[node], size[node]);
            let is_patch = self.tree.children[node] == [0, 0];
            let of_row = |(share, bright): (&f32, &f32)| {
                let mean = share / whole.max(f32::MIN_POSITIVE);
                mean * (mean * size - 2.0 * bright)
            };
            let square = whole * (squares + share.iter().zip(bright).map(of_row).sum::<f32>());
            Open { error: if is_patch { 0.0 } else { square.max(0.0) }, node }
        };
        let is_seen = |node: usize| sums[node].share.iter().any(|share| *share > 0.0);
        let mut heap = BinaryHeap::new();
        if is_seen(0) {
            heap.push(open(0));
        }
        while heap.len() < self.n_links {
            match heap.peek() {
                Some(top) if top.error > 0.0 => {}
                _ => break,
            }
            let Some(top) = heap.pop() else { break };
            let children = self.tree.children[top.node].map(usize::from);
            children.into_iter().filter(|&c| is_seen(c)).for_each(|c| heap.push(open(c)));
        }
        let mut chosen: Chosen =
            heap.into_iter().map(|open| (open.node as u16, sums[open.node].share)).collect();
        chosen.sort_unstable_by_key(|link| link.0);
        chosen
    }
}

fn add(l: &[f32; LANES], r: &[f32; LANES]) -> [f32; LANES] {
    std::array::from_fn(|i| l[i] + r[i])
}

/// Shares as bytes, and the scale of each row.
fn encode(links: &Chosen) -> Encoded {
    let mut out: Vec<(u16, [u8; LANES])> = links.iter().map(|(node, _)| (*node, [0; LANES])).collect();
    let mut scales = [0.0; LANES];
    for (lane, scale_of_row) in scales.iter_mut().enumerate() {
        let largest = links.iter().fold(0.0f32, |a, (_, shares)| a.max(shares[lane]));
        if largest <= 0.0 {
            continue;
        }
        let scale = largest / block::LARGEST;
        let (mut carry, mut total, mut stored) = (0.0, 0.0f64, 0.0f64);
        for ((_, shares), (_, bytes)) in links.iter().zip(&mut out) {
            let share = shares[lane];
            // What one row sees of a node says nothing about its neighbours.
            if share <= 0.0 {
                continue;
            }
            let wanted: f32 = (share + carry).max(0.0);
            bytes[lane] = block::byte(wanted / scale);
            let written = scale * block::value(bytes[lane]);
            carry += share - written;
            total += f64::from(share);
            stored += f64::from(written);
        }
        *scale_of_row = (f64::from(scale) * total / stored) as f32;
    }
    (out, scales)
}

impl Default for Links {
    fn default() -> Links {
        Links { start: vec![0], node: Vec::new(), share: Vec::new(), scale: Vec::new() }
    }
}

impl Links {
    pub fn extend(&mut self, other: Links) {
        let from = self.node.len() as u32;
        self.start.extend(other.start[1..].iter().map(|end| from + end));
        self.node.extend(other.node);
        self.share.extend(other.share);
        self.scale.extend(other.scale);
    }

    /// With the vertices of the blocks ([`block::order`]).
    pub fn into_carrier(self, order: &[u16], tree: Tree, weight: &[f32]) -> Carrier {
        let whole = wholes(&tree, weight);
        let mut part = vec![1.0; whole.len()];
        for (node, pair) in tree.children.iter().enumerate() {
            for child in pair.map(usize::from).into_iter().filter(|c| *c > 0) {
                part[child] = if whole[node] > 0.0 { whole[child] / whole[node] } else { 0.5 };
            }
        }
        let of_block = |block: &[u16]| {
            std::array::from_fn::<u16, LANES, _>(|lane| block.get(lane).copied().unwrap_or(block::NO_ROW))
        };
        let rows = order.chunks(LANES).map(of_block).collect();
        Carrier { part, tree, rows, links: self }
    }
}

/// Weights of all nodes, from those of the patches.
fn wholes(tree: &Tree, weight: &[f32]) -> Vec<f32> {
    let mut whole = vec![0.0; tree.children.len()];
    tree.leaves().into_iter().zip(weight).for_each(|(node, w)| whole[node] = *w);
    tree.add_up(&mut whole, |l, r| l + r);
    whole
}
