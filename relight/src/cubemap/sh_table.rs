//! Spherical harmonics of a captured shell: Lᵢ = Σ L\[t\] ∫ over texel t of yᵢ dω.

use glam::Vec2;

use super::{n_texels, sample};
use crate::light::quadrature::gauss_legendre;
use crate::sh;

/// Texels of one step of a projection: three colours of them stay in the nearest cache.
const BLOCK: usize = 256;

/// Lanes of a sum.
const LANES: usize = 8;

/// Integrals of the basis functions over the texels of one resolution, computed once.
#[derive(Clone, Debug)]
pub struct ShTable {
    n: usize,
    order: usize,
    /// \[order²\]\[6 n²\], steradians times the basis.
    weights: Vec<f32>,
}

impl ShTable {
    /// The table of an `n` x `n` x 6 cubemap: 6 n² order² floats. Sixteen Gauss points per texel integrate ten
    /// bands to 1e-6 of their maximum from n = 8 on.
    ///
    /// # Panics
    /// When `order` is not in 1..=[`sh::MAX_ORDER`], or n is 0.
    pub fn new(n: usize, order: usize) -> ShTable {
        let (texels, coefficients) = (n_texels(n), order * order);
        let mut weights = vec![0.0; texels * coefficients];
        for t in 0..texels {
            let ([x, y, z], density) = gauss_points(n, t);
            let mut values = [[0.0; 16]; sh::MAX_COEFFICIENTS];
            sh::eval_wide(order, &x, &y, &z, &mut values[..coefficients]);
            for (i, value) in values[..coefficients].iter().enumerate() {
                weights[i * texels + t] = value.iter().zip(&density).map(|(y, w)| y * w).sum();
            }
        }
        ShTable { n, order, weights }
    }

    /// Texels on a side.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Bands.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Mean of basis function `i` over texel `t`: a light that is this on a cubemap makes a row of transfer give its
    /// SH coefficient.
    ///
    /// # Panics
    /// When there is no such function or texel.
    pub fn mean(&self, i: usize, t: usize) -> f32 {
        self.weights[i * n_texels(self.n) + t] / super::solid_angle(self.n, t)
    }

    /// SH coefficients of the average radiances `texels`, written to `out[..order²]`. Does not allocate.
    ///
    /// # Panics
    /// When there are not 6 n² texels, or `out` is too short.
    pub fn project(&self, texels: &[[f32; 3]], out: &mut [[f32; 3]]) {
        assert_eq!(texels.len(), n_texels(self.n), "a shell has one radiance per texel");
        let out = &mut out[..self.order * self.order];
        out.fill([0.0; 3]);
        let mut planes = [[0.0f32; BLOCK]; 3];
        for (block, texels_of_block) in texels.chunks(BLOCK).enumerate() {
            for (i, texel) in texels_of_block.iter().enumerate() {
                for (plane, l) in planes.iter_mut().zip(texel) {
                    plane[i] = *l;
                }
            }
            let first = block * BLOCK;
            for (out, row) in out.iter_mut().zip(self.weights.chunks_exact(texels.len())) {
                let weights = &row[first..first + texels_of_block.len()];
                for (o, plane) in out.iter_mut().zip(&planes) {
                    *o += dot(weights, plane);
                }
            }
        }
    }
}

/// Σ a b over the length of `a`.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; LANES];
    let (a, rest) = a.as_chunks::<LANES>();
    for (a, b) in a.iter().zip(b.as_chunks::<LANES>().0) {
        for i in 0..LANES {
            sums[i] += a[i] * b[i];
        }
    }
    let tail: f32 = rest.iter().zip(&b[a.len() * LANES..]).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + tail
}

/// Sixteen directions in a texel, and their shares of its solid angle.
fn gauss_points(n: usize, texel: usize) -> ([[f32; 16]; 3], [f32; 16]) {
    let rule = gauss_legendre::<4>();
    let (mut points, mut density) = ([[0.0; 16]; 3], [0.0; 16]);
    for i in 0..16 {
        let ((x, weight_x), (y, weight_y)) = (rule[i % 4], rule[i / 4]);
        let (d, solid_angle) = sample(n, texel, Vec2::new(x as f32, y as f32) * 0.5 + 0.5);
        for (plane, c) in points.iter_mut().zip(d.to_array()) {
            plane[i] = c;
        }
        density[i] = (0.25 * weight_x * weight_y) as f32 * solid_angle;
    }
    (points, density)
}
