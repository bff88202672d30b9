//! Directions over the hemisphere: Owen-scrambled Sobol points, mapped with equal area.
//!
//! A handful of independently scrambled sets is made once, each sorted so that sixteen neighbours in memory lie
//! in one small patch of the hemisphere and share their way through the ray tracer's tree. A vertex takes one of
//! the sets and turns it about its normal by an angle of its own, so that neighbouring vertices do not share
//! their error, and no random number is drawn per ray.
//!
//! Based on: A. Owen, Scrambling Sobol' and Niederreiter-Xing Points, 1998; B. Burley, Practical Hash-based Owen
//! Scrambling, 2020; P. Shirley and K. Chiu, A Low Distortion Map Between Disk and Square, 1997 (cosine weights).

use std::f32::consts::{FRAC_PI_4, PI};

use glam::{Vec2, Vec3};

/// Rays of one packet.
pub const LANES: usize = 16;

/// Directions kept over all sets: 384 KiB, so that they stay in the second cache level.
const DIRECTIONS_KEPT: usize = 32768;

/// Sixteen directions about +z, one per lane.
#[derive(Clone, Copy, Debug)]
pub struct Directions {
    /// Along the first tangent.
    pub x: [f32; LANES],
    /// Along the second tangent.
    pub y: [f32; LANES],
    /// Along the normal, 0..=1.
    pub z: [f32; LANES],
}

/// Several sets of directions, uniform over the hemisphere about +z.
pub struct HemisphereSets {
    sets: Vec<Vec<Directions>>,
    seed: u64,
}

impl HemisphereSets {
    /// Sets of `rays` directions, rounded up to a multiple of sixteen.
    pub fn new(rays: usize, seed: u64) -> HemisphereSets {
        let rays = rays.next_multiple_of(LANES);
        let n_sets = (DIRECTIONS_KEPT / rays).clamp(8, 64);
        let sets = (0..n_sets).map(|i| set(rays, hash(seed ^ 0x5e75, i as u64))).collect();
        HemisphereSets { sets, seed }
    }

    /// Directions of one set.
    pub fn n_rays(&self) -> usize {
        self.sets[0].len() * LANES
    }

    /// The set and the frame of a vertex.
    pub fn at(&self, vertex: usize, normal: Vec3) -> (&[Directions], Frame) {
        let h = hash(self.seed, vertex as u64);
        let set = &self.sets[(h >> 40) as usize % self.sets.len()];
        let angle = (h & 0xffffff) as f32 / (1 << 24) as f32 * 2.0 * PI;
        (set, Frame::around(normal, angle))
    }
}

fn set(rays: usize, seed: u64) -> Vec<Directions> {
    let (seed_x, seed_y) = (seed as u32, (seed >> 32) as u32);
    let mut points: Vec<(u32, u32)> =
        (0..rays as u32).map(|i| (owen(i.reverse_bits(), seed_x), owen(sobol_second(i), seed_y))).collect();
    points.sort_by_key(|&(x, y)| morton(x) | morton(y) << 1);
    let unit = |v: u32| (v >> 8) as f32 / (1 << 24) as f32 + 0.5 / (1 << 24) as f32;
    points
        .chunks_exact(LANES)
        .map(|points| {
            let d: [Vec3; LANES] =
                std::array::from_fn(|i| uniform_hemisphere(Vec2::new(unit(points[i].0), unit(points[i].1))));
            Directions { x: d.map(|d| d.x), y: d.map(|d| d.y), z: d.map(|d| d.z) }
        })
        .collect()
}

/// The sixteen upper bits of `v`, spread to the even places.
fn morton(v: u32) -> u32 {
    let mut v = v >> 16;
    for (shift, mask) in [(8, 0x00ff00ff), (4, 0x0f0f0f0f), (2, 0x33333333), (1, 0x55555555)] {
        v = (v | v << shift) & mask;
    }
    v
}

/// Second dimension of the Sobol sequence: direction numbers by the primitive polynomial x + 1.
fn sobol_second(index: u32) -> u32 {
    let (mut result, mut direction, mut i) = (0, 1u32 << 31, index);
    while i != 0 {
        if i & 1 != 0 {
            result ^= direction;
        }
        direction ^= direction >> 1;
        i >>= 1;
    }
    result
}

/// Owen scrambling in base two of a 32-bit fraction (Laine-Karras hash with Vegdahl's constants).
fn owen(v: u32, seed: u32) -> u32 {
    let mut x = v.reverse_bits();
    x ^= x.wrapping_mul(0x3d20adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x05526c56);
    x ^= x.wrapping_mul(0x53a22864);
    x.reverse_bits()
}

/// A well-mixed 64-bit hash of a pair (SplitMix64's finaliser).
pub fn hash(seed: u64, index: u64) -> u64 {
    let mut x = seed.wrapping_mul(0x9e3779b97f4a7c15).wrapping_add(index).wrapping_mul(0xbf58476d1ce4e5b9);
    x ^= x >> 30;
    x = x.wrapping_mul(0xbf58476d1ce4e5b9);
    x ^= x >> 27;
    x = x.wrapping_mul(0x94d049bb133111eb);
    x ^ x >> 31
}

/// Two fractions in 0..1 from a hash.
pub fn fractions(h: u64) -> Vec2 {
    let unit = |v: u32| (v >> 8) as f32 / (1 << 24) as f32;
    Vec2::new(unit(h as u32), unit((h >> 32) as u32))
}

/// Uniform direction about +z; p(ω) = 1 / 2π \[1/sr\].
///
/// Archimedes' map, with the height itself stratified: the sum of heights over an open hemisphere, its irradiance,
/// is then right to 1e-4 with 256 points, fifteen times nearer than by way of the concentric disk.
pub fn uniform_hemisphere(u: Vec2) -> Vec3 {
    let (sin, cos) = (2.0 * PI * u.y).sin_cos();
    let r = (1.0 - u.x * u.x).max(0.0).sqrt();
    Vec3::new(r * cos, r * sin, u.x)
}

/// Cosine-weighted direction about +z; p(ω) = cos θ / π \[1/sr\].
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let d = concentric_disk(u);
    d.extend((1.0 - d.length_squared()).max(0.0).sqrt())
}

/// The unit square onto the unit disk, squares about the centre onto circles, areas kept.
fn concentric_disk(u: Vec2) -> Vec2 {
    let p = u * 2.0 - 1.0;
    if p == Vec2::ZERO {
        return Vec2::ZERO;
    }
    let (r, angle) = if p.x.abs() > p.y.abs() {
        (p.x, FRAC_PI_4 * p.y / p.x)
    } else {
        (p.y, 2.0 * FRAC_PI_4 - FRAC_PI_4 * p.x / p.y)
    };
    r * Vec2::new(angle.cos(), angle.sin())
}

/// An orthonormal basis with a unit normal as its third axis.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// First axis.
    pub tangent: Vec3,
    /// Second axis.
    pub bitangent: Vec3,
    /// Third axis.
    pub normal: Vec3,
}

impl Frame {
    /// The basis about `normal`, turned about it by `angle` radians.
    ///
    /// Based on: T. Duff et al., Building an Orthonormal Basis, Revisited, 2017.
    pub fn around(normal: Vec3, angle: f32) -> Frame {
        let sign = 1f32.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        let t = Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
        let s = Vec3::new(b, sign + normal.y * normal.y * a, -normal.y);
        let (sin, cos) = angle.sin_cos();
        Frame { tangent: t * cos + s * sin, bitangent: s * cos - t * sin, normal }
    }

    /// From this basis into the world.
    pub fn to_world(&self, d: Vec3) -> Vec3 {
        self.tangent * d.x + self.bitangent * d.y + self.normal * d.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(sets: &HemisphereSets, vertex: usize, normal: Vec3) -> Vec<Vec3> {
        let (set, frame) = sets.at(vertex, normal);
        let at = |d: &Directions, i: usize| frame.to_world(Vec3::new(d.x[i], d.y[i], d.z[i]));
        set.iter().flat_map(|d| (0..LANES).map(move |i| at(d, i))).collect()
    }

    #[test]
    fn hemisphere_sets_are_uniform_by_chi_square() {
        // 64 sets of 256 points in 16 x 16 cells of equal area. Scrambled points are more even than random ones,
        // so only an upper bound can fail: 293.2 is the 5 % point of chi-square with 255 degrees of freedom.
        let sets = HemisphereSets::new(256, 9);
        let mut count = [0f64; 256];
        for set in &sets.sets {
            for d in set {
                for i in 0..LANES {
                    let phi = d.y[i].atan2(d.x[i]) / (2.0 * PI) + 0.5;
                    let (a, b) = ((phi * 16.0) as usize % 16, ((d.z[i] * 16.0) as usize).min(15));
                    count[a * 16 + b] += 1.0;
                }
            }
        }
        let expected = (sets.sets.len() * 256) as f64 / 256.0;
        let chi2: f64 = count.iter().map(|c| (c - expected).powi(2) / expected).sum();
        assert!(chi2 < 293.2, "chi-square {chi2}");
    }

    #[test]
    fn cosine_integrates_to_a_half_far_better_than_random() {
        // Random points would leave 0.29 / sqrt(256) = 0.018; scrambled Sobol points some 1e-4.
        let sets = HemisphereSets::new(256, 3);
        for vertex in 0..200 {
            let d = all(&sets, vertex, Vec3::Y);
            let mean = d.iter().map(|d| d.y).sum::<f32>() / d.len() as f32;
            assert!((mean - 0.5).abs() < 1e-3, "{mean}");
        }
    }

    #[test]
    fn packets_are_narrow_bundles() {
        // Sixteen of 1024 neighbours: a 64th of the hemisphere, a cap of 10 degrees if it were round.
        let sets = HemisphereSets::new(1024, 3);
        let d = all(&sets, 5, Vec3::new(0.6, 0.0, 0.8));
        let spread = |c: &[Vec3]| {
            let axis = c.iter().copied().sum::<Vec3>().normalize();
            c.iter().map(|d| d.dot(axis).min(1.0).acos()).fold(0.0, f32::max)
        };
        let mean = d.chunks(LANES).map(spread).sum::<f32>() / (d.len() / LANES) as f32;
        assert!(mean < 0.35, "{mean}");
    }

    #[test]
    fn frames_are_orthonormal_at_the_poles_too() {
        for n in [Vec3::Z, -Vec3::Z, Vec3::X, -Vec3::Y, Vec3::new(1e-4, 0.0, -1.0).normalize()] {
            let f = Frame::around(n, 1.2);
            for (a, b) in [(f.tangent, f.bitangent), (f.tangent, n), (f.bitangent, n)] {
                assert!(a.dot(b).abs() < 1e-6);
            }
            assert!((f.tangent.cross(f.bitangent) - n).length() < 1e-6);
        }
    }
}
