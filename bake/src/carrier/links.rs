//! Rows of shares as links to nodes of the tree.
//!
//! A link says that its node's share S is spread over the node's patches by their weights w: F\[p\] ≈ S w_p / W. What
//! it then gets wrong, under light that differs from patch to patch, is at most about
//!
//! Σ b_p |F\[p\] - S w_p / W| <= √(W Σ b_p² w_p (F\[p\] / w_p - S / W)²),
//!
//! b being the patches' expected brightness. From the root on, the link with the largest such bound is replaced by those to
//! its two children, until there are K.
//!
//! Weights are at first what the vertices of a patch see of others. But then a patch that many rows see more of than of its neighbours would send out too
//! little in all, and the room would be darker than it is: weights are multiplied by what the patches' rows themselves
//! say that a patch sends, over what their links do, and links are chosen again.
//!
//! Shares take a byte: S = scale q², since many links are small. What rounding leaves of one goes on to the next, and
//! the scale is set last, so that the row keeps its sum.

use std::collections::BinaryHeap;

use rayon::prelude::*;

use super::{Carrier, Tree};

/// Finds the links of rows.
pub struct Linker<'a> {
    pub tree: &'a Tree,
    /// Light expected to leave each patch.
    pub bright: Vec<f32>,
    /// K.
    pub n_links: usize,
}

/// Rows of K links.
pub struct Links {
    n_links: usize,
    node: Vec<u16>,
    share: Vec<u8>,
    scale: Vec<f32>,
}

/// What a row has of each node.
#[derive(Clone, Copy, Default)]
struct Sums {
    share: f32,
    /// Σ b² F, and Σ b² F² / w.
    bright: f32,
    squares: f32,
}

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
    /// The rows of some things, of which `fill` writes the shares of all patches into zeros.
    pub fn link<T: Sync>(&self, weight: &[f32], things: &[T], fill: impl Fn(&T, &mut [f32]) + Sync) -> Links {
        let leaves = self.tree.leaves();
        // Of each node: W, and Σ b² w.
        let mut size = vec![(0.0f32, 0.0f32); self.tree.children.len()];
        for ((&node, w), b) in leaves.iter().zip(weight).zip(&self.bright) {
            size[node] = (*w, w * b * b);
        }
        self.tree.add_up(&mut size, |l, r| (l.0 + r.0, l.1 + r.1));
        let rows: Vec<(Vec<(u16, u8)>, f32)> = things
            .par_iter()
            .map_init(
                || (vec![0.0; leaves.len()], vec![Sums::default(); size.len()]),
                |(dense, sums), thing| {
                    dense.fill(0.0);
                    fill(thing, dense);
                    encode(self.choose(&leaves, weight, &size, dense, sums))
                },
            )
            .collect();
        let mut links = Links::new(self.n_links);
        for (row, scale) in rows {
            let rest = std::iter::repeat_n((0, 0), self.n_links - row.len());
            for (node, q) in row.into_iter().chain(rest) {
                links.node.push(node);
                links.share.push(q);
            }
            links.scale.push(scale);
        }
        links
    }

    /// What each patch sends by the links of rows of these areas.
    pub fn sent(&self, weight: &[f32], areas: &[f32], links: &Links) -> Vec<f32> {
        let mut nodes = vec![0.0f32; self.tree.children.len()];
        for (i, area) in areas.iter().enumerate() {
            let row = i * links.n_links..(i + 1) * links.n_links;
            for (node, q) in links.node[row.clone()].iter().zip(&links.share[row]) {
                nodes[usize::from(*node)] += area * links.scale[i] * f32::from(*q).powi(2);
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

    /// Nodes and their shares.
    fn choose(
        &self,
        leaves: &[usize],
        weight: &[f32],
        size: &[(f32, f32)],
        dense: &[f32],
        sums: &mut [Sums],
    ) -> Vec<(u16, f32)> {
        for (((&node, &share), &w), b) in leaves.iter().zip(dense).zip(weight).zip(&self.bright) {
            let bright = b * b * share;
            let squares = if w > 0.0 { bright * share / w } else { 0.0 };
            sums[node] = Sums { share, bright, squares };
        }
        self.tree.add_up(sums, |l, r| Sums {
            share: l.share + r.share,
            bright: l.bright + r.bright,
            squares: l.squares + r.squares,
        });
        let open = |node: usize| {
            let (Sums { share, bright, squares }, (whole, size)) = (sums[node], size[node]);
            let is_patch = self.tree.children[node] == [0, 0];
            let mean = share / whole.max(f32::MIN_POSITIVE);
            let square = whole * (squares - 2.0 * mean * bright + mean * mean * size);
            Open { error: if is_patch { 0.0 } else { square.max(0.0) }, node }
        };
        let mut heap = BinaryHeap::new();
        if sums[0].share > 0.0 {
            heap.push(open(0));
        }
        while heap.len() < self.n_links {
            match heap.peek() {
                Some(top) if top.error > 0.0 => {}
                _ => break,
            }
            let Some(top) = heap.pop() else { break };
            let children = self.tree.children[top.node].map(usize::from);
            children.into_iter().filter(|&c| sums[c].share > 0.0).for_each(|c| heap.push(open(c)));
        }
        let mut chosen: Vec<(u16, f32)> =
            heap.into_iter().map(|open| (open.node as u16, sums[open.node].share)).collect();
        chosen.sort_unstable_by_key(|link| link.0);
        chosen
    }
}

/// Shares as bytes, and their scale.
fn encode(links: Vec<(u16, f32)>) -> (Vec<(u16, u8)>, f32) {
    let largest = links.iter().fold(0.0f32, |a, l| a.max(l.1));
    if largest <= 0.0 {
        return (Vec::new(), 0.0);
    }
    let scale = largest / (255.0 * 255.0);
    let (mut carry, mut total, mut stored) = (0.0, 0.0f64, 0.0f64);
    let encode = |(node, share): (u16, f32)| {
        let wanted = (share + carry).max(0.0);
        let q = (wanted / scale).sqrt().round().min(255.0);
        carry = share + carry - scale * q * q;
        total += f64::from(share);
        stored += f64::from(scale * q * q);
        (node, q as u8)
    };
    let row: Vec<(u16, u8)> = links.into_iter().map(encode).collect();
    (row, (f64::from(scale) * total / stored) as f32)
}

impl Links {
    pub fn new(n_links: usize) -> Links {
        Links { n_links, node: Vec::new(), share: Vec::new(), scale: Vec::new() }
    }

    pub fn extend(&mut self, other: Links) {
        self.node.extend(other.node);
        self.share.extend(other.share);
        self.scale.extend(other.scale);
    }

    pub fn into_carrier(self, tree: Tree, weight: &[f32]) -> Carrier {
        let whole = wholes(&tree, weight);
        let mut part = vec![1.0; whole.len()];
        for (node, pair) in tree.children.iter().enumerate() {
            for child in pair.map(usize::from).into_iter().filter(|c| *c > 0) {
                part[child] = if whole[node] > 0.0 { whole[child] / whole[node] } else { 0.5 };
            }
        }
        Carrier { part, tree, n_links: self.n_links, node: self.node, share: self.share, scale: self.scale }
    }
}

/// Weights of all nodes, from those of the patches.
fn wholes(tree: &Tree, weight: &[f32]) -> Vec<f32> {
    let mut whole = vec![0.0; tree.children.len()];
    tree.leaves().into_iter().zip(weight).for_each(|(node, w)| whole[node] = *w);
    tree.add_up(&mut whole, |l, r| l + r);
    whole
}
