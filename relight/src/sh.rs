//! Real spherical harmonics: evaluation, zonal projection and rotation.
//!
//! The basis is orthonormal over the sphere, Cartesian in world x, y, z, with the Condon-Shortley sign and
//! index l(l+1)+m, so that y₀ = 0.2821, y₁ = -0.4886 y, y₂ = 0.4886 z, y₃ = -0.4886 x. *Order n* means n bands,
//! n² coefficients. A transfer vector T and a light vector L meet in a dot product:
//!
//! E = ∫ L(ω) V(ω) max(n·ω, 0) dω ≈ Σᵢ Tᵢ Lᵢ with Tᵢ = ∫ V yᵢ max(n·ω, 0) dω and Lᵢ = ∫ L yᵢ dω.
//!
//! Where it breaks: n bands hold features no finer than about π/n radians. A sun disc projected into ten bands
//! is still twenty degrees wide, and every sharp edge rings: light may come out negative.
//!
//! Based on: P.-P. Sloan, Stupid Spherical Harmonics Tricks, 2008; rotation after J. Ivanic and K. Ruedenberg,
//! Rotation Matrices for Real Spherical Harmonics. Direct Determination by Recursion, 1996 (with the 1998
//! correction).

use std::f64::consts::PI;
use std::sync::LazyLock;

use glam::{DMat3, DQuat, Quat, Vec3};

/// The largest number of bands.
pub const MAX_ORDER: usize = 10;

/// Coefficients at the largest order.
pub const MAX_COEFFICIENTS: usize = MAX_ORDER * MAX_ORDER;

/// The fewest bands that hold `n` coefficients.
pub const fn order_of(n: usize) -> usize {
    let root = n.isqrt();
    if root * root < n { root + 1 } else { root }
}

/// Factors of the recurrence p(l,m) = a z p(l-1,m) + b p(l-2,m), and the diagonal p(m,m).
struct Recurrence {
    diagonal: [f32; MAX_ORDER],
    a: [[f32; MAX_ORDER]; MAX_ORDER],
    b: [[f32; MAX_ORDER]; MAX_ORDER],
}

static RECURRENCE: LazyLock<Recurrence> = LazyLock::new(|| {
    let mut r = Recurrence { diagonal: [0.0; 10], a: [[0.0; 10]; 10], b: [[0.0; 10]; 10] };
    let mut diagonal = (1.0 / (4.0 * PI)).sqrt();
    for m in 0..MAX_ORDER {
        let k = m as f64;
        if m > 0 {
            diagonal *= -((2.0 * k + 1.0) / (2.0 * k)).sqrt();
        }
        // The factor √2 of the real basis goes into the diagonal, from which all of column m follows.
        r.diagonal[m] = (diagonal * if m > 0 { 2f64.sqrt() } else { 1.0 }) as f32;
        for l in m + 1..MAX_ORDER {
            let j = l as f64;
            let square = j * j - k * k;
            r.a[l][m] = ((4.0 * j * j - 1.0) / square).sqrt() as f32;
            if l >= m + 2 {
                r.b[l][m] = -((((j - 1.0).powi(2) - k * k) * (2.0 * j + 1.0)) / ((2.0 * j - 3.0) * square))
                    .sqrt() as f32;
            }
        }
    }
    r
});

/// The n² basis values at the unit direction `d`.
///
/// # Panics
/// When `order` is not in 1..=[`MAX_ORDER`] or `out` is shorter than order².
pub fn eval(order: usize, d: Vec3, out: &mut [f32]) {
    let mut wide = [[0.0f32; 1]; MAX_COEFFICIENTS];
    eval_wide(order, &[d.x], &[d.y], &[d.z], &mut wide[..order * order]);
    for (o, w) in out[..order * order].iter_mut().zip(&wide) {
        *o = w[0];
    }
}

/// [`eval`] for `W` unit directions at once, one per lane: `out[i][lane]`.
///
/// # Panics
/// As [`eval`].
#[inline(always)]
pub fn eval_wide<const W: usize>(
    order: usize,
    x: &[f32; W],
    y: &[f32; W],
    z: &[f32; W],
    out: &mut [[f32; W]],
) {
    assert!((1..=MAX_ORDER).contains(&order), "SH order {order} is not in 1..=10");
    let r = &*RECURRENCE;
    let out = &mut out[..order * order];
    // (cos, sin)(m φ) sin^m θ are the real and imaginary part of (x + i y)^m.
    let (mut c, mut s) = ([1.0f32; W], [0.0f32; W]);
    for m in 0..order {
        if m > 0 {
            for i in 0..W {
                (c[i], s[i]) = (x[i] * c[i] - y[i] * s[i], x[i] * s[i] + y[i] * c[i]);
            }
        }
        let mut before = [0.0f32; W];
        let mut p = [r.diagonal[m]; W];
        for l in m..order {
            if l > m {
                let (a, b) = (r.a[l][m], r.b[l][m]);
                for i in 0..W {
                    (before[i], p[i]) = (p[i], a * z[i] * p[i] + b * before[i]);
                }
            }
            let at = l * (l + 1);
            for i in 0..W {
                out[at + m][i] = p[i] * c[i];
            }
            if m > 0 {
                for i in 0..W {
                    out[at - m][i] = p[i] * s[i];
                }
            }
        }
    }
}

/// Adds `weight[lane] y_i(direction[lane])` to `sums[i][lane]` for sixteen unit directions: the inner loop of a
/// projection by sampling. Runs with the widest vectors of the processor.
///
/// # Panics
/// When `order` is above [`MAX_ORDER`] or `sums` is shorter than order².
pub fn accumulate(order: usize, [x, y, z]: &[[f32; 16]; 3], weight: &[f32; 16], sums: &mut [[f32; 16]]) {
    #[cfg(target_arch = "x86_64")]
    if x86::accumulate(order, [x, y, z], weight, sums) {
        return;
    }
    accumulate_lanes(order, [x, y, z], weight, sums);
}

#[inline(always)]
fn accumulate_lanes(order: usize, [x, y, z]: [&[f32; 16]; 3], weight: &[f32; 16], sums: &mut [[f32; 16]]) {
    let mut values = [[0.0; 16]; MAX_COEFFICIENTS];
    eval_wide(order, x, y, z, &mut values);
    for (sum, y) in sums[..order * order].iter_mut().zip(&values) {
        for i in 0..16 {
            sum[i] += weight[i] * y[i];
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    #![allow(unsafe_code, reason = "the same loop compiled for wider vectors, see the bake bench")]

    use super::accumulate_lanes;

    /// Whether the work was done: false leaves it to the baseline.
    #[inline]
    pub fn accumulate(order: usize, d: [&[f32; 16]; 3], weight: &[f32; 16], sums: &mut [[f32; 16]]) -> bool {
        let detected = is_x86_feature_detected!("avx2");
        if detected {
            // SAFETY: the processor has the feature that `accumulate_avx2` is compiled for.
            unsafe { accumulate_avx2(order, d, weight, sums) };
        }
        detected
    }

    // Without FMA, so that the sums are those of the baseline to the bit.
    #[target_feature(enable = "avx2")]
    fn accumulate_avx2(order: usize, d: [&[f32; 16]; 3], weight: &[f32; 16], sums: &mut [[f32; 16]]) {
        accumulate_lanes(order, d, weight, sums);
    }
}

/// SH coefficients of a function that is symmetric about `axis`, from its zonal coefficients
/// z_l = ∫ f(θ) y_l0(θ) dω about +z: out[l(l+1)+m] = √(4π/(2l+1)) z_l y_lm(axis). Adds `weight` times that.
pub fn add_zonal(zonal: &[f32], axis: Vec3, weight: Vec3, out: &mut [[f32; 3]]) {
    let order = zonal.len();
    let mut y = [0.0; MAX_COEFFICIENTS];
    eval(order, axis, &mut y);
    for (l, &z) in zonal.iter().enumerate() {
        let scale = (4.0 * std::f32::consts::PI / (2 * l + 1) as f32).sqrt() * z;
        for i in l * l..(l + 1) * (l + 1) {
            for (o, w) in out[i].iter_mut().zip(weight.to_array()) {
                *o += w * scale * y[i];
            }
        }
    }
}

/// Zonal coefficients z_l of the clamped cosine max(cos θ, 0): the transfer of an unoccluded vertex.
///
/// Closed form of Ramamoorthi and Hanrahan, An Efficient Representation for Irradiance Environment Maps, 2001:
/// the convolution factors A_l = π, 2π/3, π/4, 0, -π/24, ... times √((2l+1)/4π).
pub fn clamped_cosine(order: usize, zonal: &mut [f32]) {
    for (l, z) in zonal[..order].iter_mut().enumerate() {
        let a = match l {
            0 => PI,
            1 => 2.0 * PI / 3.0,
            l if l % 2 == 1 => 0.0,
            l => {
                let k = l as f64;
                let half = l as u32 / 2;
                // l! / (2^l (l/2)!²) as a product, to stay within range.
                let binomial: f64 = (1..=half).map(|i| (half + i) as f64 / (4.0 * i as f64)).product();
                let sign = if half % 2 == 1 { 1.0 } else { -1.0 };
                2.0 * PI * sign * binomial / ((k + 2.0) * (k - 1.0))
            }
        };
        *z = (a * ((2 * l + 1) as f64 / (4.0 * PI)).sqrt()) as f32;
    }
}

/// Turns coefficients of f into those of the turned function g(ω) = f(q⁻¹ ω). Exact within each band, no
/// allocation; cost grows with order³.
///
/// # Panics
/// When `from` or `to` is shorter than order².
pub fn rotate(order: usize, q: Quat, from: &[[f32; 3]], to: &mut [[f32; 3]]) {
    let r = DMat3::from_quat(DQuat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into()).normalize());
    let mut bands = BandRotation::new(r);
    for l in 0..order {
        bands.advance_to(l);
        let (size, at) = (2 * l + 1, l * l);
        for m in 0..size {
            let mut sum = [0.0f64; 3];
            for k in 0..size {
                let w = bands.signed(m, k);
                for (s, f) in sum.iter_mut().zip(from[at + k]) {
                    *s += w * f64::from(f);
                }
            }
            to[at + m] = sum.map(|s| s as f32);
        }
    }
}

/// The largest band's side, 2 (MAX_ORDER - 1) + 1.
const SIDE: usize = 2 * MAX_ORDER - 1;

/// Rotation matrices band by band, without the Condon-Shortley sign; row and column m + l.
struct BandRotation {
    l: usize,
    first: [[f64; 3]; 3],
    before: [[f64; SIDE]; SIDE],
    current: [[f64; SIDE]; SIDE],
}

impl BandRotation {
    fn new(r: DMat3) -> Self {
        // Band 1 without the sign is (y, z, x).
        let order = [1, 2, 0];
        let first = std::array::from_fn(|i| std::array::from_fn(|j| r.col(order[j])[order[i]]));
        let mut current = [[0.0; SIDE]; SIDE];
        current[0][0] = 1.0;
        BandRotation { l: 0, first, before: [[0.0; SIDE]; SIDE], current }
    }

    fn advance_to(&mut self, l: usize) {
        while self.l < l {
            self.l += 1;
            self.before = self.current;
            let l = self.l as i32;
            for m in -l..=l {
                for n in -l..=l {
                    self.current[(m + l) as usize][(n + l) as usize] = self.entry(m, n);
                }
            }
        }
    }

    /// Element with the sign (-1)^m of the basis on both sides.
    fn signed(&self, row: usize, column: usize) -> f64 {
        let value = self.current[row][column];
        if (row + column) % 2 == 1 { -value } else { value }
    }

    /// The recursion of Ivanic and Ruedenberg: band l from bands 1 and l-1.
    fn entry(&self, m: i32, n: i32) -> f64 {
        let l = self.l as i32;
        if l == 1 {
            return self.first[(m + 1) as usize][(n + 1) as usize];
        }
        let denominator = if n.abs() == l { 2 * l * (2 * l - 1) } else { (l + n) * (l - n) } as f64;
        let a = m.abs();
        let delta = if m == 0 { 1.0 } else { 0.0 };
        let u = ((l + m) * (l - m)) as f64 / denominator;
        let v = (1.0 + delta) * ((l + a - 1) * (l + a)) as f64 / denominator;
        let w = ((l - a - 1) * (l - a)) as f64 / denominator;
        let mut sum = 0.0;
        if u > 0.0 {
            sum += u.sqrt() * self.p(0, m, n);
        }
        if v > 0.0 {
            sum += 0.5 * (1.0 - 2.0 * delta) * v.sqrt() * self.v_term(m, n);
        }
        if w > 0.0 && m != 0 {
            sum -= 0.5 * w.sqrt() * self.w_term(m, n);
        }
        sum
    }

    fn v_term(&self, m: i32, n: i32) -> f64 {
        match m {
            0 => self.p(1, 1, n) + self.p(-1, -1, n),
            1 => 2f64.sqrt() * self.p(1, 0, n),
            -1 => 2f64.sqrt() * self.p(-1, 0, n),
            m if m > 0 => self.p(1, m - 1, n) - self.p(-1, 1 - m, n),
            m => self.p(1, m + 1, n) + self.p(-1, -m - 1, n),
        }
    }

    fn w_term(&self, m: i32, n: i32) -> f64 {
        if m > 0 {
            self.p(1, m + 1, n) + self.p(-1, -m - 1, n)
        } else {
            self.p(1, m - 1, n) - self.p(-1, 1 - m, n)
        }
    }

    fn p(&self, i: i32, a: i32, b: i32) -> f64 {
        let l = self.l as i32;
        let r = |j: i32| self.first[(i + 1) as usize][(j + 1) as usize];
        let before = |b: i32| self.before[(a + l - 1) as usize][(b + l - 1) as usize];
        if b == l {
            r(1) * before(l - 1) - r(-1) * before(1 - l)
        } else if b == -l {
            r(1) * before(1 - l) + r(-1) * before(l - 1)
        } else {
            r(0) * before(b)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A midpoint rule: exact in φ for what is tested here, of second order in z.
    fn sphere(rows: usize, columns: usize, mut f: impl FnMut(Vec3, f64)) {
        for i in 0..rows {
            let z = (i as f64 + 0.5) / rows as f64 * 2.0 - 1.0;
            let s = (1.0 - z * z).sqrt();
            for j in 0..columns {
                let phi = (j as f64 + 0.5) / columns as f64 * 2.0 * PI;
                let d = Vec3::new((s * phi.cos()) as f32, (s * phi.sin()) as f32, z as f32);
                f(d, 4.0 * PI / (rows * columns) as f64);
            }
        }
    }

    #[test]
    fn first_bands_have_the_signs_of_the_conventions() {
        let d = Vec3::new(0.36, 0.48, 0.8);
        let mut y = [0.0; 9];
        eval(3, d, &mut y);
        let expected = [0.282095, -0.488603 * d.y, 0.488603 * d.z, -0.488603 * d.x, 1.092548 * d.x * d.y];
        for (a, b) in y.iter().zip(expected) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
    }

    #[test]
    fn basis_is_orthonormal() {
        let n = MAX_COEFFICIENTS;
        let mut gram = vec![0.0f64; n * n];
        let mut y = vec![0.0; n];
        sphere(512, 64, |d, w| {
            eval(MAX_ORDER, d, &mut y);
            for i in 0..n {
                for j in 0..=i {
                    gram[i * n + j] += w * f64::from(y[i]) * f64::from(y[j]);
                }
            }
        });
        for i in 0..n {
            for j in 0..=i {
                let expected = if i == j { 1.0 } else { 0.0 };
                // 512 midpoint rows of a degree-18 polynomial: under 2e-3 (order h² l²).
                assert!((gram[i * n + j] - expected).abs() < 2e-3, "{i} {j} {}", gram[i * n + j]);
            }
        }
    }

    #[test]
    fn clamped_cosine_matches_its_integral() {
        let mut zonal = [0.0; 10];
        clamped_cosine(10, &mut zonal);
        let mut numeric = [0.0f64; 10];
        let mut y = [0.0; 100];
        sphere(8192, 4, |d, w| {
            eval(10, d, &mut y);
            for (l, n) in numeric.iter_mut().enumerate() {
                *n += w * f64::from(y[l * (l + 1)]) * f64::from(d.z.max(0.0));
            }
        });
        for (a, b) in zonal.iter().zip(numeric) {
            // Second order: l⁴ h² / 24 with h = 1/4096, under 2e-5 at l = 9.
            assert!((f64::from(*a) - b).abs() < 1e-4, "{a} {b}");
        }
    }

    #[test]
    fn rotation_turns_the_function() {
        let q = Quat::from_euler(glam::EulerRot::XYZ, 0.7, -1.9, 2.4);
        let from: Vec<[f32; 3]> =
            (0..100).map(|i| [(i as f32 * 0.7).sin(), 1.0 / (i + 1) as f32, 0.3]).collect();
        let mut to = vec![[0.0; 3]; 100];
        rotate(10, q, &from, &mut to);
        let value = |c: &[[f32; 3]], d: Vec3, k: usize| {
            let mut y = [0.0; 100];
            eval(10, d, &mut y);
            c.iter().zip(y).map(|(c, y)| c[k] * y).sum::<f32>()
        };
        for i in 0..50 {
            let t = i as f32;
            let d = Vec3::new((t * 1.3).sin(), (t * 2.1).cos(), (t * 0.7).sin() + 0.2).normalize();
            for k in 0..3 {
                let (a, b) = (value(&to, q * d, k), value(&from, d, k));
                // f32 sums of a hundred terms of size one.
                assert!((a - b).abs() < 3e-5 * (1.0 + b.abs()), "{a} {b}");
            }
        }
    }

    #[test]
    fn accumulation_is_the_same_with_wide_vectors_to_the_bit() {
        let lanes = |f: fn(f32) -> f32| std::array::from_fn(|i| f(i as f32));
        let (mut a, mut b) = (vec![[0.5; 16]; 100], vec![[0.5; 16]; 100]);
        let d =
            [lanes(|i| (i * 0.7).sin() * 0.6), lanes(|i| (i * 0.7).cos() * 0.6), lanes(|i| 0.8 - 0.0 * i)];
        let weight = lanes(|i| 0.1 * i);
        accumulate(10, &d, &weight, &mut a);
        accumulate_lanes(10, [&d[0], &d[1], &d[2]], &weight, &mut b);
        assert_eq!(a, b);
        let mut y = [0.0; 100];
        eval(10, Vec3::new(d[0][3], d[1][3], d[2][3]), &mut y);
        assert!(y.iter().zip(&a).all(|(y, a)| (0.5 + weight[3] * y - a[3]).abs() < 1e-6));
    }

    #[test]
    fn zonal_of_open_vertex_gives_pi_under_uniform_light() {
        let mut zonal = [0.0; 10];
        clamped_cosine(10, &mut zonal);
        let mut transfer = [[0.0; 3]; 100];
        add_zonal(&zonal, Vec3::new(0.6, 0.0, -0.8), Vec3::ONE, &mut transfer);
        // L₀ of unit radiance is √(4π).
        assert!((transfer[0][0] * (4.0 * PI as f32).sqrt() - PI as f32).abs() < 1e-5);
    }
}
