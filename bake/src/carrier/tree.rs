//! The surface, halved again and again.
//!
//! The heaviest part is halved first, by area, across its widest extent in space, normal and expected light, until there
//! are as many parts as asked for; weight is area times that extent, so that a patch does not lie in two rooms.

use lunette_relight::asset::NO_PATCH;
use lunette_scenes::Scene;

/// Weight of a normal, and of the light as a part of that in the open, against a position in the cutting of patches, in
/// diagonals of the scene: opposite sides of a wall must part, and what lies outside of a window from what lies inside.
const NORMAL_WEIGHT: f32 = 0.25;

/// Of place, normal and light.
const AXES: usize = 7;

/// A binary tree of parts of the surface; node 0 is all of it, and children come after their parents.
pub struct Tree {
    /// Children of each node; \[0, 0\] for a patch, which has none.
    pub children: Vec<[u16; 2]>,
    /// Node of each vertex's patch, or [`NO_PATCH`].
    pub patch: Vec<u16>,
}

impl Tree {
    /// Cuts the vertices that are not `unlit` into at most `most` patches. `uniform` is the irradiance of each under a
    /// uniform sky of radiance 1.
    pub fn new(scene: &Scene, area: &[f32], uniform: &[f32], unlit: &[bool], most: usize) -> Tree {
        let (low, high) = scene.mesh.bounds();
        let weight = NORMAL_WEIGHT * (high - low).length();
        let key = |v: usize| {
            let (p, n) = (scene.mesh.position[v], scene.mesh.normal[v] * weight);
            [p.x, p.y, p.z, n.x, n.y, n.z, weight * uniform[v] / std::f32::consts::PI]
        };
        let all: Vec<usize> = (0..area.len()).filter(|&v| !unlit[v]).collect();
        let extent = |list: &[usize], axis: usize| {
            let values = list.iter().map(|&v| key(v)[axis]);
            let (lo, hi) = values.fold((f32::MAX, f32::MIN), |(lo, hi), x| (lo.min(x), hi.max(x)));
            if lo < hi { hi - lo } else { 0.0 }
        };
        // Wide ones before compact ones.
        let weigh = |list: &[usize]| {
            let widest = (0..AXES).map(|axis| extent(list, axis)).fold(0.0, f32::max);
            f64::from(widest) * list.iter().map(|&v| f64::from(area[v])).sum::<f64>()
        };
        let mut tree = Tree { children: vec![[0, 0]], patch: vec![NO_PATCH; area.len()] };
        // The number breaks ties, so that the order is the same everywhere.
        let mut heap = std::collections::BTreeMap::from([((weigh(&all).to_bits(), 0usize), all)]);
        let mut finished: Vec<(usize, Vec<usize>)> = Vec::new();
        while heap.len() + finished.len() < most.min(usize::from(NO_PATCH) / 2) {
            let Some(((_, node), mut list)) = heap.pop_last() else { break };
            let axis = (0..AXES).max_by(|&a, &b| extent(&list, a).total_cmp(&extent(&list, b))).unwrap_or(0);
            if list.len() < 2 || extent(&list, axis) <= 0.0 {
                finished.push((node, list));
                continue;
            }
            list.sort_by(|&a, &b| key(a)[axis].total_cmp(&key(b)[axis]).then(a.cmp(&b)));
            let rest = list.split_off(middle(&list, area));
            for (side, part) in [list, rest].into_iter().enumerate() {
                let child = tree.children.len();
                tree.children[node][side] = child as u16;
                tree.children.push([0, 0]);
                heap.insert((weigh(&part).to_bits(), child), part);
            }
        }
        let parts = finished.into_iter().chain(heap.into_iter().map(|((_, node), list)| (node, list)));
        for (node, list) in parts {
            list.into_iter().for_each(|v| tree.patch[v] = node as u16);
        }
        tree.depth_first()
    }

    /// The same with its nodes numbered one branch after the other, so that neighbours have numbers close together.
    fn depth_first(self) -> Tree {
        let mut number = vec![0u16; self.children.len()];
        let mut children = Vec::with_capacity(self.children.len());
        let mut open = vec![0usize];
        while let Some(node) = open.pop() {
            number[node] = children.len() as u16;
            children.push(self.children[node]);
            open.extend(self.children[node].into_iter().rev().filter(|c| *c > 0).map(usize::from));
        }
        let renumber = |node: u16| number.get(usize::from(node)).copied().unwrap_or(NO_PATCH);
        // 0 is nobody's child, and keeps its number.
        let children = children.into_iter().map(|pair| pair.map(renumber)).collect();
        Tree { children, patch: self.patch.into_iter().map(renumber).collect() }
    }

    /// Nodes without children, rising.
    pub fn leaves(&self) -> Vec<usize> {
        (0..self.children.len()).filter(|&node| self.children[node] == [0, 0]).collect()
    }

    /// Makes the value of each node with children the sum of theirs.
    pub fn add_up<T: Copy>(&self, values: &mut [T], add: impl Fn(T, T) -> T) {
        for (node, pair) in self.children.iter().enumerate().rev() {
            let [l, r] = pair.map(usize::from);
            if l > 0 {
                values[node] = add(values[l], values[r]);
            }
        }
    }

    /// P.
    pub fn n_leaves(&self) -> usize {
        self.children.len().div_ceil(2)
    }

    /// Which of the leaves, counted from 0, each vertex belongs to.
    pub fn leaf_of_vertices(&self) -> Vec<Option<u16>> {
        let mut number = vec![None; self.children.len()];
        self.leaves().into_iter().enumerate().for_each(|(i, node)| number[node] = Some(i as u16));
        self.patch.iter().map(|&node| number.get(usize::from(node)).copied().flatten()).collect()
    }

    /// Vertices of each leaf.
    pub fn members(&self) -> Vec<Vec<usize>> {
        let mut members = vec![Vec::new(); self.n_leaves()];
        for (v, leaf) in self.leaf_of_vertices().into_iter().enumerate() {
            if let Some(leaf) = leaf {
                members[usize::from(leaf)].push(v);
            }
        }
        members
    }
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
