//! A piecewise constant density on the unit square.

use glam::Vec2;

/// Density proportional to the weights of a grid of cells, 1 on average.
pub(crate) struct Table {
    width: usize,
    height: usize,
    /// Densities, row by row.
    density: Vec<f32>,
    /// Sums of a row's weights up to and with each cell, scaled to end at 1.
    in_row: Vec<f32>,
    /// Sums of rows, likewise.
    rows: Vec<f32>,
}

impl Table {
    /// `None` where all weights are 0: nothing to aim at.
    pub fn new(width: usize, height: usize, weights: &[f32]) -> Option<Table> {
        let sums: Vec<f64> =
            weights.chunks(width).map(|row| row.iter().map(|w| f64::from(*w)).sum()).collect();
        let total: f64 = sums.iter().sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        let mean = total / weights.len() as f64;
        Some(Table {
            width,
            height,
            density: weights.iter().map(|w| (f64::from(*w) / mean) as f32).collect(),
            in_row: weights
                .chunks(width)
                .flat_map(|row| running_share(row.iter().map(|w| f64::from(*w))))
                .collect(),
            rows: running_share(sums.iter().copied()),
        })
    }

    /// A point with this density, from a uniform one.
    pub fn sample(&self, u: Vec2) -> Vec2 {
        let (row, y) = invert(&self.rows, u.y);
        let (column, x) = invert(&self.in_row[row * self.width..(row + 1) * self.width], u.x);
        Vec2::new((column as f32 + x) / self.width as f32, (row as f32 + y) / self.height as f32)
    }

    /// Density at a cell.
    pub fn density(&self, column: usize, row: usize) -> f32 {
        self.density[row * self.width + column]
    }

    /// Density at a point.
    pub fn density_at(&self, p: Vec2) -> f32 {
        let cell = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1);
        self.density(cell(p.x, self.width), cell(p.y, self.height))
    }
}

/// Running sums scaled to end at 1; all 0 where nothing is to be summed.
fn running_share(x: impl Iterator<Item = f64> + Clone) -> Vec<f32> {
    let total: f64 = x.clone().sum();
    let scale = if total > 0.0 { 1.0 / total } else { 0.0 };
    x.scan(0.0, |sum, x| {
        *sum += x * scale;
        Some(*sum as f32)
    })
    .collect()
}

/// The cell in which the running sum passes `u`, and how far into it, 0..1.
fn invert(running: &[f32], u: f32) -> (usize, f32) {
    // Only cells with a weight are passed: the sum rises in them.
    let found = running.partition_point(|s| *s <= u);
    // Rounding may end the sum a hair below u: then it is the last cell that has a weight.
    let cell = if found < running.len() {
        found
    } else {
        running.partition_point(|s| *s < running[running.len() - 1])
    };
    let before = if cell > 0 { running[cell - 1] } else { 0.0 };
    let inside = (u - before) / (running[cell] - before);
    (cell, inside.clamp(0.0, 1.0 - f32::EPSILON / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::hash;

    #[test]
    fn samples_follow_the_density() {
        let weights = [1.0, 0.0, 3.0, 0.0, 0.0, 0.0, 2.0, 5.0, 1.0];
        let table = Table::new(3, 3, &weights).unwrap();
        let n = 120_000;
        let mut counts = [0u32; 9];
        for i in 0..n {
            let p = table.sample(hash::uniform_2d(hash::mix([i, 5])));
            counts[(p.y * 3.0) as usize * 3 + (p.x * 3.0) as usize] += 1;
        }
        let mut chi = 0.0;
        for (count, weight) in counts.iter().zip(weights) {
            let expected = f64::from(n) * f64::from(weight) / 12.0;
            assert!(weight > 0.0 || *count == 0, "a cell without weight was sampled");
            chi += if weight > 0.0 { (f64::from(*count) - expected).powi(2) / expected } else { 0.0 };
        }
        // 4 degrees of freedom: 18.5 is exceeded with probability 0.001.
        assert!(chi < 18.5, "chi-squared {chi}");
        assert_eq!(table.density_at(Vec2::new(0.5, 0.9)), 5.0 * 9.0 / 12.0);
    }

    #[test]
    fn corners_of_the_square_stay_in_cells_with_weight() {
        let table = Table::new(3, 2, &[0.0, 1.0, 0.0, 0.0, 0.3, 0.0]).unwrap();
        for u in [0.0, 1.0 - f32::EPSILON / 2.0] {
            // A step inwards: the place in a cell is rounded.
            let p = table.sample(Vec2::splat(u)).lerp(Vec2::splat(0.5), 1e-5);
            assert!(table.density_at(p) > 0.0, "{p}");
        }
    }

    #[test]
    fn black_has_no_table() {
        assert!(Table::new(2, 1, &[0.0, 0.0]).is_none());
    }
}
