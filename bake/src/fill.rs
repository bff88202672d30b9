//! Buried vertices take the light of their nearest lit neighbours.
//!
//! Left black, a vertex inside other geometry ([`crate::buried`]) would darken every triangle around it. Layer by layer
//! from the rim inwards, it gets the mean of its neighbours along edges, weighted by one over their distance. A patch
//! without a lit neighbour takes the light of the vertices in the same place, from which a crease or another material has
//! split it.

use std::collections::{BTreeMap, HashMap};

use lunette_scenes::Mesh;

/// For each buried vertex, in an order in which it can be filled, its donors and their weights.
pub struct Donors {
    list: Vec<(usize, Vec<(usize, f32)>)>,
    /// Buried vertices that no lit vertex reaches; they stay as they are.
    pub unreachable: usize,
}

/// Finds donors for the buried vertices (ascending).
pub fn donors(mesh: &Mesh, buried: &[usize]) -> Donors {
    let mut neighbours: BTreeMap<usize, Vec<usize>> = buried.iter().map(|&v| (v, Vec::new())).collect();
    for triangle in &mesh.index {
        for i in 0..3 {
            if let Some(list) = neighbours.get_mut(&(triangle[i] as usize)) {
                list.extend([triangle[(i + 1) % 3] as usize, triangle[(i + 2) % 3] as usize]);
            }
        }
    }
    let mut donors = Donors { list: Vec::new(), unreachable: 0 };
    let mut are_twins_joined = false;
    while !neighbours.is_empty() {
        let layer: Vec<(usize, Vec<(usize, f32)>)> = neighbours
            .iter()
            .map(|(&v, list)| (v, weights(mesh, v, list.iter().filter(|w| !neighbours.contains_key(w)))))
            .filter(|(_, weights)| !weights.is_empty())
            .collect();
        if layer.is_empty() && !are_twins_joined {
            join_twins(mesh, &mut neighbours);
            are_twins_joined = true;
            continue;
        }
        if layer.is_empty() {
            donors.unreachable = neighbours.len();
            break;
        }
        for (v, _) in &layer {
            neighbours.remove(v);
        }
        donors.list.extend(layer);
    }
    donors
}

/// Adds the vertices in the same place to the neighbours.
fn join_twins(mesh: &Mesh, neighbours: &mut BTreeMap<usize, Vec<usize>>) {
    // Adding zero makes the two zeros one.
    let place = |v: usize| mesh.position[v].to_array().map(|x| (x + 0.0).to_bits());
    let mut twins: HashMap<[u32; 3], Vec<usize>> =
        neighbours.keys().map(|&v| (place(v), Vec::new())).collect();
    for v in 0..mesh.position.len() {
        if let Some(list) = twins.get_mut(&place(v)) {
            list.push(v);
        }
    }
    for (&v, list) in neighbours {
        list.extend(twins[&place(v)].iter().filter(|&&w| w != v));
    }
}

/// Least distance between a vertex and its donor that counts, metres, so that one over it stays a number.
const NEAREST: f32 = 1e-9;

fn weights<'a>(mesh: &Mesh, v: usize, lit: impl Iterator<Item = &'a usize>) -> Vec<(usize, f32)> {
    let distance = |w: usize| (mesh.position[w] - mesh.position[v]).length().max(NEAREST);
    let raw: Vec<(usize, f32)> = lit.map(|&w| (w, 1.0 / distance(w))).collect();
    let sum: f32 = raw.iter().map(|(_, w)| w).sum();
    raw.into_iter().map(|(v, w)| (v, w / sum)).collect()
}

impl Donors {
    /// Fills the rows, \[V, width\].
    pub fn fill(&self, rows: &mut [f32], width: usize) {
        let mut mean = vec![0.0; width];
        for (v, donors) in &self.list {
            mean.fill(0.0);
            for &(donor, weight) in donors {
                for (m, value) in mean.iter_mut().zip(&rows[donor * width..][..width]) {
                    *m += weight * value;
                }
            }
            rows[v * width..][..width].copy_from_slice(&mean);
        }
    }

    /// For each of `n_vertices` the vertex whose place it takes: itself, or the nearest of its donors' own sources.
    pub fn sources(&self, n_vertices: usize) -> Vec<usize> {
        let mut sources: Vec<usize> = (0..n_vertices).collect();
        for (v, donors) in &self.list {
            if let Some((donor, _)) = donors.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
                sources[*v] = sources[*donor];
            }
        }
        sources
    }

    /// The vertices that are filled, ascending.
    pub fn filled(&self) -> Vec<usize> {
        let mut list: Vec<usize> = self.list.iter().map(|(v, _)| *v).collect();
        list.sort_unstable();
        list
    }

    /// How many vertices are filled.
    pub fn n_filled(&self) -> usize {
        self.list.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn strip() -> Mesh {
        Mesh {
            position: (0..6).map(|i| Vec3::new((i / 2) as f32, 0.0, (i % 2) as f32)).collect(),
            normal: vec![Vec3::Y; 6],
            index: vec![[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]],
            material: vec![0; 4],
            group: vec![0; 4],
        }
    }

    #[test]
    fn buried_vertices_are_filled_layer_by_layer() {
        let donors = donors(&strip(), &[2, 3, 4, 5]);
        let mut rows = vec![4.0, 4.0, 0.0, 0.0, 0.0, 0.0];
        donors.fill(&mut rows, 1);
        assert!(rows.iter().all(|v| (v - 4.0f32).abs() < 1e-6), "{rows:?}");
        assert_eq!((donors.n_filled(), donors.unreachable), (4, 0));
    }

    #[test]
    fn buried_patches_take_the_light_of_their_twins_across_a_crease() {
        // A strip, and a copy of it that shares no vertex with it.
        let mut mesh = strip();
        mesh.position.extend(strip().position);
        mesh.normal.extend([Vec3::X; 6]);
        mesh.index.extend(strip().index.iter().map(|t| t.map(|v| v + 6)));
        let donors = donors(&mesh, &[6, 7, 8, 9, 10, 11]);
        let mut rows: Vec<f32> = (0..12).map(|v| if v < 6 { v as f32 } else { 0.0 }).collect();
        donors.fill(&mut rows, 1);
        assert_eq!(rows[..6], rows[6..]);
    }

    #[test]
    fn wholly_buried_meshes_stay_as_they_are() {
        let donors = donors(&strip(), &[0, 1, 2, 3, 4, 5]);
        assert_eq!((donors.n_filled(), donors.unreachable), (0, 6));
    }
}
