//! How much of the light each SH band of a transfer can carry.
//!
//! With t_v,lm the transfer of vertex v, the light of band l that makes the largest mean square of Σ_m c_m t_v,lm over
//! the vertices, under Σ c_m² = 1, is the first eigenvector of (1/V) Σ_v t t^T, and that mean square its eigenvalue.
//!
//! Based on: Y. Yue et al., 2009, section 4.2, equations 4 and 5 and figure 8.

use lunette_relight::sh::MAX_ORDER;

/// One band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandEnergy {
    /// Greatest mean square of red, green, blue light that the band can make under unit light.
    pub greatest: [f64; 3],
}

/// Power iteration stops after this many steps; eigenvalues closer than a percent are as good as each other.
const STEPS: usize = 60;

/// Energies of the bands of rows \[V, 3 m²\].
pub fn bands(rows: &[f32], m: usize) -> Vec<BandEnergy> {
    let band = |l: usize| BandEnergy {
        greatest: [0, 1, 2].map(|c| greatest(rows, 3 * m * m, c * m * m + l * l, 2 * l + 1)),
    };
    (0..m).map(band).collect()
}

fn greatest(rows: &[f32], width: usize, from: usize, size: usize) -> f64 {
    let mut moments = vec![0.0f64; size * size];
    let mut n = 0;
    for row in rows.chunks_exact(width) {
        let t = &row[from..from + size];
        for (i, a) in t.iter().enumerate() {
            for (j, b) in t.iter().enumerate() {
                moments[i * size + j] += f64::from(*a) * f64::from(*b);
            }
        }
        n += 1;
    }
    let mut vector: Vec<f64> = (0..size).map(|i| 1.0 + 0.1 * i as f64).collect();
    let mut eigenvalue = 0.0;
    for _ in 0..STEPS {
        let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        vector.iter_mut().for_each(|x| *x /= length);
        vector =
            moments.chunks_exact(size).map(|row| row.iter().zip(&vector).map(|(a, b)| a * b).sum()).collect();
        eigenvalue = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    }
    eigenvalue / f64::from(n.max(1))
}

/// Share of the energy in the bands up to each, of all bands given, over the colours together.
pub fn cumulative(bands: &[BandEnergy]) -> Vec<f64> {
    let energy = |b: &BandEnergy| b.greatest.iter().sum::<f64>();
    let total: f64 = bands.iter().map(energy).sum();
    let mut sum = 0.0;
    let mut step = |b| {
        sum += energy(b);
        if total > 0.0 { sum / total } else { 1.0 }
    };
    bands.iter().map(&mut step).collect()
}

/// The fewest bands that hold a share of the energy; at least one.
pub fn order_for(bands: &[BandEnergy], share: f64) -> usize {
    let enough = cumulative(bands).iter().position(|&s| s >= share);
    enough.map_or(bands.len(), |l| l + 1).clamp(1, MAX_ORDER)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_of_a_single_coefficient_is_its_mean_square() {
        // Order 2: only coefficient 2 (band 1) of green, 3 at one vertex and 1 at the other.
        let mut rows = vec![0.0f32; 2 * 12];
        rows[4 + 2] = 3.0;
        rows[12 + 4 + 2] = 1.0;
        let bands = bands(&rows, 2);
        assert!((bands[1].greatest[1] - 5.0).abs() < 1e-9);
        assert_eq!(bands[0].greatest, [0.0; 3]);
        assert_eq!(order_for(&bands, 0.95), 2);
    }
}
