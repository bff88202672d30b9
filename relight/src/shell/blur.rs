//! Frosted glass: a blur of a cubemap over the sphere.
//!
//! Every texel becomes a mean of those about it, weighted by exp((cos γ - 1) / σ²) for the angle γ between their
//! centres: on a small part of the sphere a Gaussian of standard deviation σ, and smooth everywhere, faces' edges
//! included. The weights are scaled in turn over what a texel takes and over what it gives until both are 1, so that
//! a constant shell stays constant and the energy is kept.
//!
//! Wide blurs go over a coarser cubemap, whose texels are no wider than σ / 2: a first blur of about half such a texel
//! onto it, a second back, their variances adding up to σ². So the work is bounded whatever σ is, and a sun that moves by
//! less than a coarse texel still moves.
//!
//! Where it breaks: under about half a texel the blur is lost between texels.

use glam::{Vec2, Vec3};

use crate::cubemap::{direction, n_texels, solid_angle};

/// Texels farther than √(2 x this) standard deviations are left out: their weight is under e^-6.
const REACH: f32 = 6.0;

/// Standard deviation of the first blur, in coarse texels: narrower and it would step from texel to texel, wider and
/// little would be left for the second.
const FIRST: f32 = 0.6;

/// Scaling ends when every texel takes 1 to this part.
const TOLERANCE: f32 = 1e-4;

/// Or after this many rounds: narrow blurs, whose texels have few neighbours, settle slowly.
const MAX_ROUNDS: usize = 100;

/// A blur of one width at one resolution: its weights, computed once.
#[derive(Clone, Debug)]
pub struct Blur {
    stages: Vec<Stage>,
    /// What goes into each stage, and the result.
    texels: Vec<Vec<[f32; 4]>>,
}

/// Weighted means of the texels of one cubemap at those of another.
#[derive(Clone, Debug)]
struct Stage {
    /// Per texel, the first of its weights; one more at the end.
    start: Vec<u32>,
    from: Vec<u16>,
    weight: Vec<f32>,
}

impl Blur {
    /// A blur of standard deviation `radians` (in 0..=π, not 0) of `n` x `n` x 6 cubemaps. Costs about a tenth of a
    /// second and ten megabytes at n = 32.
    ///
    /// # Panics
    /// When `radians` is not positive, or n is 0.
    pub fn new(n: usize, radians: f32) -> Blur {
        assert!(radians > 0.0 && n > 0, "a blur has a width");
        let coarse = coarse_side(n, radians);
        let first = FIRST * texel_width(coarse);
        let (sides, widths) = if coarse < n {
            (vec![n, coarse, n], vec![first, (radians * radians - first * first).sqrt()])
        } else {
            (vec![n, n], vec![radians])
        };
        Blur {
            stages: sides
                .windows(2)
                .zip(widths)
                .map(|(side, width)| Stage::new(side[0], side[1], width))
                .collect(),
            texels: sides.iter().map(|&side| vec![[0.0; 4]; n_texels(side)]).collect(),
        }
    }

    /// Writes the blurred `texels` to `out`. Does not allocate.
    ///
    /// # Panics
    /// When either does not have 6 n² texels.
    pub fn apply(&mut self, texels: &[[f32; 3]], out: &mut [[f32; 3]]) {
        let n_stages = self.stages.len();
        assert!(
            texels.len() == self.texels[0].len() && out.len() == texels.len(),
            "a blur fits one resolution"
        );
        for (to, &[r, g, b]) in self.texels[0].iter_mut().zip(texels) {
            *to = [r, g, b, 0.0];
        }
        for (i, stage) in self.stages.iter().enumerate() {
            let (from, to) = self.texels.split_at_mut(i + 1);
            stage.apply(&from[i], &mut to[0]);
        }
        for (out, &[r, g, b, _]) in out.iter_mut().zip(&self.texels[n_stages]) {
            *out = [r, g, b];
        }
    }
}

impl Stage {
    fn new(from: usize, to: usize, radians: f32) -> Stage {
        let mut stage = Stage { start: vec![0], from: Vec::new(), weight: Vec::new() };
        stage.gather(&centres(from), &centres(to), radians);
        stage.scale(&solid_angles(from), &solid_angles(to));
        stage
    }

    fn apply(&self, from: &[[f32; 4]], to: &mut [[f32; 4]]) {
        for (range, to) in self.start.windows(2).zip(to) {
            let range = range[0] as usize..range[1] as usize;
            let mut sum = [0.0f32; 4];
            for (i, weight) in self.from[range.clone()].iter().zip(&self.weight[range]) {
                for (s, l) in sum.iter_mut().zip(from[usize::from(*i)]) {
                    *s += weight * l;
                }
            }
            *to = sum;
        }
    }

    fn gather(&mut self, from: &[Vec3], to: &[Vec3], radians: f32) {
        // Chords instead of cosines, which have no digits left for small angles: 1 - cos γ = chord² / 2.
        let inverse = 0.5 / (radians * radians);
        for d in to {
            let first = self.from.len();
            for (i, source) in from.iter().enumerate() {
                let exponent = d.distance_squared(*source) * inverse;
                if exponent < REACH {
                    self.from.push(i as u16);
                    self.weight.push((-exponent).exp());
                }
            }
            assert!(self.from.len() > first, "a coarse texel reaches the fine ones in it");
            self.start.push(self.from.len() as u32);
        }
    }

    /// Scales in turn the columns, until a source gives its own energy, and the rows, until a texel takes 1.
    fn scale(&mut self, from_energy: &[f32], to_energy: &[f32]) {
        for (weight, from) in self.weight.iter_mut().zip(&self.from) {
            *weight *= from_energy[usize::from(*from)];
        }
        let mut given = vec![0.0f64; from_energy.len()];
        for _ in 0..MAX_ROUNDS {
            let worst = self.scale_rows();
            given.fill(0.0);
            for (range, energy) in self.start.windows(2).zip(to_energy) {
                for i in range[0] as usize..range[1] as usize {
                    given[usize::from(self.from[i])] += f64::from(energy * self.weight[i]);
                }
            }
            for (weight, from) in self.weight.iter_mut().zip(&self.from) {
                *weight *= (f64::from(from_energy[usize::from(*from)]) / given[usize::from(*from)]) as f32;
            }
            if worst < TOLERANCE {
                break;
            }
        }
    }

    /// Makes every row's sum 1; how far the worst was from it.
    fn scale_rows(&mut self) -> f32 {
        let mut worst = 0.0f32;
        for range in self.start.windows(2) {
            let row = &mut self.weight[range[0] as usize..range[1] as usize];
            let sum: f32 = row.iter().sum();
            worst = worst.max((sum - 1.0).abs());
            row.iter_mut().for_each(|weight| *weight /= sum);
        }
        worst
    }
}

/// The smallest side whose texels are no wider than σ / 2.
fn coarse_side(n: usize, radians: f32) -> usize {
    let mut side = n;
    while side.is_multiple_of(2) && side > 4 && texel_width(side / 2) <= 0.5 * radians {
        side /= 2;
    }
    side
}

/// Width of the widest texels, at the middle of a face, radians.
fn texel_width(n: usize) -> f32 {
    2.0 / n as f32
}

fn centres(n: usize) -> Vec<Vec3> {
    (0..n_texels(n)).map(|t| direction(n, t, Vec2::splat(0.5))).collect()
}

fn solid_angles(n: usize) -> Vec<f32> {
    (0..n_texels(n)).map(|t| solid_angle(n, t)).collect()
}
