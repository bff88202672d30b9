//! The surface, halved again and again.
//!
//! The heaviest part is halved first, by size, across its widest extent in space, normal and expected light, until there
//! are as many parts as asked for; weight is size times that extent, so that a patch does not lie in two rooms. Size is
//! area, by what is expected to be sent from it: ground far outside of a window takes no patches from the room.

use glam::Vec3;
use lunette_relight::asset::NO_PATCH;
use lunette_scenes::Scene;

/// Of place, normal and light.
const AXES: usize = 7;

/// Weight of light, as a part of that in the open, against that of a normal: little of it comes into a room, and what
/// gets a tenth of the light is another thing than what gets a hundredth.
const LIGHT: f32 = 4.0;

/// What differs in light by less than this part of that in the open is cut by its place alone.
const ALIKE: f32 = 0.04;

/// A binary tree of parts of the surface; node 0 is all of it, and children come after their parents.
pub struct Tree {
    /// Children of each node; \[0, 0\] for a patch, which has none.
    pub children: Vec<[u16; 2]>,
    /// Node of each vertex's patch, or [`NO_PATCH`].
    pub patch: Vec<u16>,
    /// Nodes of which a group is a child.
    pub joints: Vec<usize>,
}

impl Tree {
    /// Cuts groups of vertices, of which no two share a patch, into at most `most` patches and no fewer than there are
    /// groups. `size` is what each vertex counts, at least 0; `uniform` is its irradiance under a uniform sky of radiance 1.
    pub fn new(scene: &Scene, size: &[f32], uniform: &[f32], groups: &[Vec<usize>], most: usize) -> Tree {
        let key = |v: usize| {
            let (p, n) = (scene.mesh.position[v], scene.mesh.normal[v]);
            [p.x, p.y, p.z, n.x, n.y, n.z, uniform[v] / std::f32::consts::PI]
        };
        let weight = reach(scene, size, &groups.concat());
        // Of each axis, metres.
        let extents = |list: &[usize]| {
            let (mut low, mut high) = ([f32::MAX; AXES], [f32::MIN; AXES]);
            for key in list.iter().map(|&v| key(v)) {
                low.iter_mut().zip(key).for_each(|(low, x)| *low = low.min(x));
                high.iter_mut().zip(key).for_each(|(high, x)| *high = high.max(x));
            }
            let width = |axis: usize| (high[axis] - low[axis]).max(0.0);
            std::array::from_fn::<f32, AXES, _>(|axis| match axis {
                0..3 => width(axis),
                3..6 => weight * width(axis),
                _ => LIGHT * weight * (width(axis) - ALIKE).max(0.0),
            })
        };
        // Wide ones before compact ones.
        let weigh = |list: &[usize]| {
            let widest = extents(list).into_iter().fold(0.0, f32::max);
            f64::from(widest) * list.iter().map(|&v| f64::from(size[v])).sum::<f64>()
        };
        let mut tree = Tree { children: vec![[0, 0]], patch: vec![NO_PATCH; size.len()], joints: Vec::new() };
        // The number breaks ties, so that the order is the same everywhere.
        let mut heap = std::collections::BTreeMap::new();
        let groups: Vec<&Vec<usize>> = groups.iter().filter(|list| !list.is_empty()).collect();
        // A node for each group, and one for all after it.
        let mut rest = 0;
        for (i, &list) in groups.iter().enumerate() {
            let mut own = rest;
            if i + 1 < groups.len() {
                own = tree.children.len();
                tree.joints.push(rest);
                tree.children[rest] = [own as u16, own as u16 + 1];
                tree.children.extend([[0, 0]; 2]);
                rest = own + 1;
            }
            heap.insert((weigh(list).to_bits(), own), list.clone());
        }
        let mut finished: Vec<(usize, Vec<usize>)> = Vec::new();
        while heap.len() + finished.len() < most.min(usize::from(NO_PATCH) / 2) {
            let Some(((_, node), mut list)) = heap.pop_last() else { break };
            let extents = extents(&list);
            let axis = (0..AXES).max_by(|&a, &b| extents[a].total_cmp(&extents[b])).unwrap_or(0);
            if list.len() < 2 || extents[axis] <= 0.0 {
                finished.push((node, list));
                continue;
            }
            list.sort_by(|&a, &b| key(a)[axis].total_cmp(&key(b)[axis]).then(a.cmp(&b)));
            let rest = list.split_off(middle(&list, size));
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
        let joints = self.joints.into_iter().map(|joint| usize::from(number[joint])).collect();
        Tree { children, patch: self.patch.into_iter().map(renumber).collect(), joints }
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

/// Root mean square of distances from the centre of gravity, metres. It is the weight of a normal, and times [`LIGHT`] of
/// the light as a part of that in the open, against a position: opposite sides of a wall must part, and what lies outside
/// of a window from what lies inside. By the whole scene's extent, a long corridor beside the room would be parted by
/// normals alone.
fn reach(scene: &Scene, size: &[f32], all: &[usize]) -> f32 {
    let whole = all.iter().map(|&v| size[v]).sum::<f32>().max(f32::MIN_POSITIVE);
    let centre = all.iter().map(|&v| size[v] / whole * scene.mesh.position[v]).sum::<Vec3>();
    let square = |v: usize| size[v] / whole * (scene.mesh.position[v] - centre).length_squared();
    all.iter().map(|&v| square(v)).sum::<f32>().sqrt()
}

/// Where a sorted list has half of its size on each side; never at an end.
fn middle(list: &[usize], size: &[f32]) -> usize {
    let half: f64 = 0.5 * list.iter().map(|&v| f64::from(size[v])).sum::<f64>();
    let mut sum = 0.0;
    let at = list.iter().take_while(|&&v| {
        sum += f64::from(size[v]);
        sum < half
    });
    at.count().clamp(1, list.len() - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_lie_where_something_is_sent_from() {
        // A room, and the same again 100 m away in which what is sent is a ten thousandth.
        let scene = lunette_scenes::builtin::build("box-room:edge=0.4").unwrap();
        let mut both = scene.clone();
        both.mesh.position.extend(scene.mesh.position.iter().map(|p| *p + Vec3::new(100.0, 0.0, 0.0)));
        both.mesh.normal.extend(&scene.mesh.normal);
        let n = scene.mesh.position.len();
        let size: Vec<f32> = (0..2 * n).map(|v| if v < n { 1.0 } else { 1e-4 }).collect();
        let tree = Tree::new(&both, &size, &vec![0.0; 2 * n], &[(0..2 * n).collect()], 256);
        let (mut here, mut mixed) = (0, 0);
        for members in tree.members() {
            let inside = members.iter().filter(|v| **v < n).count();
            here += usize::from(inside == members.len());
            mixed += usize::from(inside > 0 && inside < members.len());
        }
        assert_eq!((tree.n_leaves(), mixed), (256, 0));
        assert!(here >= 240, "{here} of 256 patches lie in the room that sends");
        // Nothing sends: patches there are none the less.
        let all = [(0..n).collect()];
        assert_eq!(Tree::new(&scene, &vec![0.0; n], &vec![0.0; n], &all, 16).n_leaves(), 16);
    }

    #[test]
    fn groups_share_no_patch() {
        let scene = lunette_scenes::builtin::build("box-room:edge=0.4").unwrap();
        let n = scene.mesh.position.len();
        // Neighbours of three kinds, one of which counts hardly, and some that belong to none.
        let kind = |v: usize| v % 4;
        let groups: Vec<Vec<usize>> = (0..3).map(|k| (0..n).filter(|&v| kind(v) == k).collect()).collect();
        let size: Vec<f32> = (0..n).map(|v| if kind(v) == 1 { 1e-6 } else { 1.0 }).collect();
        for (groups, most, expected) in
            [(&groups[..], 64, 64), (&groups, 1, 3), (&groups[1..2], 8, 8), (&[], 8, 1)]
        {
            let tree = Tree::new(&scene, &size, &vec![0.0; n], groups, most);
            assert_eq!((tree.n_leaves(), tree.leaves().len()), (expected, expected));
            let members = tree.members();
            for list in &members {
                assert!(list.iter().all(|&v| kind(v) == kind(list[0])), "a patch of two groups");
            }
            assert_eq!(members.concat().len(), groups.iter().map(Vec::len).sum::<usize>());
        }
    }
}
