//! The Phong kernel max(r·ω, 0)^e and its sums and means.

use std::f64::consts::PI;

use glam::{Vec3, Vec4};

use crate::sh::{MAX_ORDER, clamped_cosine};

/// A row: for each entry a weight, a number of a direction, and a number of a light.
pub struct Entries<'a> {
    pub weight: &'a [f32],
    pub direction: &'a [u16],
    pub source: &'a [u16],
}

/// The kernel about one mirror direction.
pub struct Lobe {
    r: Vec4,
    exponent: f32,
    power: Power,
}

#[derive(Clone, Copy)]
enum Power {
    /// By repeated squaring: most exponents are whole, and the library's power is ten times as slow.
    Whole(u32),
    Real(f32),
}

/// Entries at a time: long enough that vectors fill and branches are few.
const LANES: usize = 32;

impl Lobe {
    /// `r` is of unit length.
    pub fn new(r: Vec3, exponent: f32) -> Lobe {
        let is_whole = exponent.fract() == 0.0 && exponent <= 1024.0;
        let power = if is_whole { Power::Whole(exponent as u32) } else { Power::Real(exponent) };
        Lobe { r: r.extend(0.0), exponent, power }
    }

    /// (e + 2) / 2π, 1/sr: the reflected share is then Ks from straight above.
    pub fn normalisation(&self) -> f32 {
        (self.exponent + 2.0) / (2.0 * PI) as f32
    }

    /// max(r·ω, 0)^e.
    pub fn kernel(&self, direction: Vec3) -> f32 {
        self.r.truncate().dot(direction).max(0.0).powf(self.exponent)
    }

    /// Σ weight light max(r·ω, 0)^e.
    ///
    /// # Panics
    /// When a number is beyond `directions` or `light`.
    pub fn sum(&self, entries: &Entries, directions: &[Vec4], light: &[Vec4]) -> Vec4 {
        let (weight, weight_rest) = entries.weight.as_chunks::<LANES>();
        let (direction, direction_rest) = entries.direction.as_chunks::<LANES>();
        let (source, source_rest) = entries.source.as_chunks::<LANES>();
        let mut sum = Vec4::ZERO;
        for ((weight, direction), source) in weight.iter().zip(direction).zip(source) {
            sum += self.sum_lanes(weight, direction, source, directions, light);
        }
        // The rest goes on as entries of no weight.
        let n = weight_rest.len();
        if n > 0 {
            let (mut weight, mut direction, mut source) = ([0.0; LANES], [0; LANES], [0; LANES]);
            weight[..n].copy_from_slice(weight_rest);
            direction[..n].copy_from_slice(direction_rest);
            source[..n].copy_from_slice(source_rest);
            sum += self.sum_lanes(&weight, &direction, &source, directions, light);
        }
        sum
    }

    #[inline(always)]
    fn sum_lanes(
        &self,
        weight: &[f32; LANES],
        direction: &[u16; LANES],
        source: &[u16; LANES],
        directions: &[Vec4],
        light: &[Vec4],
    ) -> Vec4 {
        let mut kernel = [0.0; LANES];
        for (c, &d) in kernel.iter_mut().zip(direction) {
            let d = directions[usize::from(d)];
            *c = d.x * self.r.x + d.y * self.r.y + d.z * self.r.z;
        }
        self.raise(&mut kernel);
        let mut sum = Vec4::ZERO;
        for ((k, w), &s) in kernel.iter().zip(weight).zip(source) {
            sum += k * w * light[usize::from(s)];
        }
        sum
    }

    /// Cosines to the power of the exponent; 0 behind the plane of r, for exponent 0 too.
    fn raise(&self, cosines: &mut [f32; LANES]) {
        let mut raised = [1.0f32; LANES];
        match self.power {
            Power::Whole(mut e) => {
                let mut square = *cosines;
                while e > 0 {
                    if e & 1 == 1 {
                        raised.iter_mut().zip(&square).for_each(|(k, s)| *k *= s);
                    }
                    square.iter_mut().for_each(|s| *s *= *s);
                    e >>= 1;
                }
            }
            Power::Real(e) => raised.iter_mut().zip(&*cosines).for_each(|(k, c)| *k = c.max(0.0).powf(e)),
        }
        for (c, k) in cosines.iter_mut().zip(raised) {
            *c = if *c > 0.0 { k } else { 0.0 };
        }
    }
}

/// The share of evenly falling light that a lobe of Ks 1 sends back: 5/6 for exponent 0, falling to 2/3 for a mirror,
/// since the model's cosine darkens what is seen from the side.
///
/// (e + 2)/(2π²) ∫∫ max(r·ω, 0)^e max(n·r, 0) max(n·ω, 0) dω dr = (e + 2)/(2π²) Σ_l λ_l z_l², by the theorem of Funk
/// and Hecke: z_l are the clamped cosine's zonal coefficients, λ_l = 2π ∫₀¹ x^e P_l(x) dx the kernel's eigenvalues.
/// Ten bands leave 1e-4.
pub fn mean_reflectance(exponent: f32) -> f32 {
    let e = f64::from(exponent);
    let mut cosine = [0.0; MAX_ORDER];
    clamped_cosine(MAX_ORDER, &mut cosine);
    // ∫₀¹ x^e P_l(x) dx by its recurrence over every second band.
    let mut moment = [0.0; MAX_ORDER];
    let mut sum = 0.0;
    for l in 0..MAX_ORDER {
        moment[l] = match l {
            0 => 1.0 / (e + 1.0),
            1 => 1.0 / (e + 2.0),
            _ => moment[l - 2] * (e + 2.0 - l as f64) / (e + 1.0 + l as f64),
        };
        sum += 2.0 * PI * moment[l] * f64::from(cosine[l]).powi(2);
    }
    ((e + 2.0) / (2.0 * PI * PI) * sum) as f32
}
