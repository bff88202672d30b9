//! Buried vertices take the light of their nearest lit neighbours.
//!
//! A vertex inside other geometry sees only backs of triangles. Left black, it would darken every triangle
//! around it (the floor about a column's foot). Layer by layer from the rim inwards, it gets the mean of its
//! neighbours along edges, weighted by one over their distance.

use std::collections::BTreeMap;

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
    while !neighbours.is_empty() {
        let layer: Vec<(usize, Vec<(usize, f32)>)> = neighbours
            .iter()
            .map(|(&v, list)| (v, weights(mesh, v, list.iter().filter(|w| !neighbours.contains_key(w)))))
            .filter(|(_, weights)| !weights.is_empty())
            .collect();
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

fn weights<'a>(mesh: &Mesh, v: usize, lit: impl Iterator<Item = &'a usize>) -> Vec<(usize, f32)> {
    let distance = |w: usize| (mesh.position[w] - mesh.position[v]).length().max(f32::MIN_POSITIVE);
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
    fn wholly_buried_meshes_stay_as_they_are() {
        let donors = donors(&strip(), &[0, 1, 2, 3, 4, 5]);
        assert_eq!((donors.n_filled(), donors.unreachable), (0, 6));
    }
}
