//! Cut links sorted by the hole that they go through.

use std::collections::HashMap;

use glam::Vec3;

use super::cut::CutLink;
use super::grid::{FREE, Grid, N_HALF};

/// Cells of one hole face the same way: cosine of the largest angle, 45 degrees. Two openings that meet in a corner
/// are two.
const ALIKE: f32 = 0.7;

/// Links through thin air whose inner cells hang together, free of each other's sight, and face the same way.
pub(super) fn clusters(grid: &Grid, links: &[CutLink]) -> Vec<Vec<CutLink>> {
    let mut of_cell: HashMap<usize, Vec<CutLink>> = HashMap::new();
    for link in links.iter().filter(|l| !l.through_glass) {
        of_cell.entry(link.inside).or_default().push(*link);
    }
    let facing = facings(grid, &of_cell);
    let mut clusters = Vec::new();
    for seed in links {
        let Some(first) = of_cell.remove(&seed.inside) else { continue };
        let mut sum = facing[&seed.inside];
        let mut open = vec![seed.inside];
        let mut cluster = first;
        while let Some(cell) = open.pop() {
            for next in joined(grid, cell) {
                let alike = facing.get(&next).is_some_and(|f| f.dot(sum.normalize_or_zero()) > ALIKE);
                if let Some(more) = alike.then(|| of_cell.remove(&next)).flatten() {
                    sum += facing[&next];
                    cluster.extend(more);
                    open.push(next);
                }
            }
        }
        clusters.push(cluster);
    }
    clusters
}

/// Unit vector inwards at each cell, from the links of the cell and of those around it.
fn facings(grid: &Grid, of_cell: &HashMap<usize, Vec<CutLink>>) -> HashMap<usize, Vec3> {
    let own = |cell: usize| of_cell.get(&cell).map_or(Vec3::ZERO, |l| l.iter().map(|l| l.inwards).sum());
    let smooth = |cell: usize| own(cell) + joined(grid, cell).map(own).sum::<Vec3>();
    of_cell.keys().map(|&cell| (cell, smooth(cell).normalize_or_zero())).collect()
}

/// Neighbours that a free way joins.
fn joined(grid: &Grid, cell: usize) -> impl Iterator<Item = usize> + '_ {
    (0..2 * N_HALF)
        .filter_map(move |d| grid.step(cell, d))
        .filter(|(_, link)| link & FREE != 0)
        .map(|(next, _)| next)
}
