//! The Phong kernel max(r·ω, 0)^e and its sums and means.
#![allow(unsafe_code, reason = "the same code for wider vectors, several times as fast")]

use std::f64::consts::PI;

use glam::{Vec3, Vec4};

use crate::cubemap::{face_axes, flat};
use crate::sh::{MAX_ORDER, clamped_cosine};

/// A row: for each entry a weight, a direction as a texel of a cubemap of so many texels on a side, towards whose middle it
/// is, and a number of a light.
pub struct Entries<'a> {
    pub weight: &'a [f32],
    pub direction: &'a [u16],
    pub side: usize,
    pub source: &'a [u16],
}

/// The kernel about one mirror direction.
pub struct Lobe {
    r: Vec3,
    exponent: f32,
    power: Power,
    /// r in the coordinates of each face, and twice the last: an index of three bits.
    faces: [Vec4; 8],
}

#[derive(Clone, Copy)]
enum Power {
    /// By repeated squaring: most exponents are whole, and the library's power is ten times as slow.
    Whole(u32),
    Real(f32),
}

/// Entries at a time: long enough that vectors fill and branches are few.
const LANES: usize = 32;

/// Sums of their own, since an addition takes longer than its turn.
const STRANDS: usize = 4;

impl Lobe {
    /// `r` is of unit length.
    pub fn new(r: Vec3, exponent: f32) -> Lobe {
        let is_whole = exponent.fract() == 0.0 && exponent <= 1024.0;
        let power = if is_whole { Power::Whole(exponent as u32) } else { Power::Real(exponent) };
        let face = |f: usize| flat(face_axes(f.min(5)), r).extend(0.0);
        Lobe { r, exponent, power, faces: std::array::from_fn(face) }
    }

    /// (e + 2) / 2π, 1/sr: the reflected share is then Ks from straight above.
    pub fn normalisation(&self) -> f32 {
        (self.exponent + 2.0) / (2.0 * PI) as f32
    }

    /// max(r·ω, 0)^e.
    pub fn kernel(&self, direction: Vec3) -> f32 {
        self.r.dot(direction).max(0.0).powf(self.exponent)
    }

    /// Σ weight light max(r·ω, 0)^e.
    ///
    /// # Panics
    /// When a number is beyond `light`.
    pub fn sum(&self, entries: &Entries, light: &[Vec4]) -> Vec4 {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the processor has the features that `sum_avx2` is compiled for.
            return unsafe { self.sum_avx2(entries, light) };
        }
        self.sum_portable(entries, light)
    }

    /// The same code in wider vectors.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn sum_avx2(&self, entries: &Entries, light: &[Vec4]) -> Vec4 {
        self.sum_portable(entries, light)
    }

    #[inline(always)]
    pub(super) fn sum_portable(&self, entries: &Entries, light: &[Vec4]) -> Vec4 {
        let (weight, weight_rest) = entries.weight.as_chunks::<LANES>();
        let (direction, direction_rest) = entries.direction.as_chunks::<LANES>();
        let (source, source_rest) = entries.source.as_chunks::<LANES>();
        let side = entries.side as f32;
        let mut sums = [Vec4::ZERO; STRANDS];
        for ((weight, direction), source) in weight.iter().zip(direction).zip(source) {
            self.add_lanes(weight, direction, (side, source), light, &mut sums);
        }
        // The rest goes on as entries of no weight.
        let n = weight_rest.len();
        if n > 0 {
            let (mut weight, mut direction, mut source) = ([0.0; LANES], [0; LANES], [0; LANES]);
            weight[..n].copy_from_slice(weight_rest);
            direction[..n].copy_from_slice(direction_rest);
            source[..n].copy_from_slice(source_rest);
            self.add_lanes(&weight, &direction, (side, &source), light, &mut sums);
        }
        sums.into_iter().sum()
    }

    #[inline(always)]
    fn add_lanes(
        &self,
        weight: &[f32; LANES],
        direction: &[u16; LANES],
        (side, source): (f32, &[u16; LANES]),
        light: &[Vec4],
        sums: &mut [Vec4; STRANDS],
    ) {
        // Texel = (face side + row) side + column; half a texel keeps quotients of whole numbers off their rounding.
        let (per_row, per_face) = (1.0 / side, 1.0 / (side * side));
        let (mut face, mut kernel) = ([0u8; LANES], [0.0f32; LANES]);
        let (mut s, mut t) = ([0.0f32; LANES], [0.0f32; LANES]);
        for i in 0..LANES {
            let texel = f32::from(direction[i]);
            let f = whole((texel + 0.5) * per_face);
            let within = texel - f * side * side;
            let row = whole((within + 0.5) * per_row);
            face[i] = (f + SHIFT).to_bits() as u8;
            s[i] = (within - row * side + 0.5) * (2.0 * per_row) - 1.0;
            t[i] = (row + 0.5) * (2.0 * per_row) - 1.0;
        }
        let mut r = [[0.0f32; LANES]; 3];
        for i in 0..LANES {
            let face = self.faces[usize::from(face[i] & 7)];
            (r[0][i], r[1][i], r[2][i]) = (face.x, face.y, face.z);
        }
        for i in 0..LANES {
            let along = r[0][i] * s[i] + r[1][i] * t[i] + r[2][i];
            kernel[i] = along / (1.0 + s[i] * s[i] + t[i] * t[i]).sqrt();
        }
        self.raise(&mut kernel);
        for i in 0..LANES {
            kernel[i] *= weight[i];
        }
        for (kernel, source) in kernel.as_chunks::<STRANDS>().0.iter().zip(source.as_chunks::<STRANDS>().0) {
            for ((sum, k), s) in sums.iter_mut().zip(kernel).zip(source) {
                *sum += *k * light[usize::from(*s)];
            }
        }
    }

    /// Cosines to the power of the exponent; 0 behind the plane of r, for exponent 0 too.
    #[inline(always)]
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

/// A float of this size keeps nothing below 1, and whole numbers up to 2^22 in its lowest bits.
const SHIFT: f32 = 12_582_912.0;

/// Without what is less than 1; of numbers that are 0 to 2^22, and not whole.
#[inline(always)]
fn whole(x: f32) -> f32 {
    (x - 0.5 + SHIFT) - SHIFT
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
