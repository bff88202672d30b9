//! The overlap of two lobes of fixed exponents as a function of the angle between them, made once for many leaves.
//!
//! With exponents e and d fixed, log2 of ∫ cᵉ cᵈ is close to a straight line in the versine v = 1 - cos φ, of slope
//! near -(e + 1)(d + 1) / (e + d + 2) log2 e. A cubic through four Chebyshev nodes over the versines that matter
//! stands for it within 5e-4 of the peak, at a fifth of the cost of [`product_log2`](super::product).
//!
//! Where it breaks: lobes wide apart, whose logarithm falls without bound; and the widest lobes, where the fitted
//! integral has a term in √v that no cubic follows to v = 0. Beyond [`WIDEST`] and below [`LEAST_EXPONENT`] there is no
//! profile, and the integral itself is to be taken.

use super::fast::exp2;
use super::product::product_log2;

/// Largest versine of a profile: 37°.
const WIDEST: f32 = 0.2;
/// Least exponent of either lobe.
const LEAST_EXPONENT: f32 = 6.0;
/// Powers of two below the peak that a profile follows; beyond, its last value stands for nothing.
const DEEPEST: f32 = 24.0;
/// Chebyshev nodes (1 - cos((2k + 1) π / 8)) / 2.
const NODES: [f32; 4] = [0.038_060_233, 0.308_658_28, 0.691_341_7, 0.961_939_8];

/// log2 of the overlap, a cubic in v over `reach`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Profile {
    coefficients: [f32; 4],
    inverse_reach: f32,
}

impl Profile {
    /// Of ∫ max(a·v, 0)^`one` max(b·v, 0)^`two` dv times `scale`, for versines up to `reach`; none where they lie too
    /// far apart.
    #[inline(always)]
    pub fn new(one: f32, two: f32, reach: f32, scale: f32) -> Option<Profile> {
        let slope = (one + 1.0) * (two + 1.0) / (one + two + 2.0) * std::f32::consts::LOG2_E;
        let reach = reach.max(1e-20).min(DEEPEST / slope);
        if reach > WIDEST || one.min(two) < LEAST_EXPONENT {
            return None;
        }
        let scale = super::fast::log2(scale.max(1e-30));
        let values = NODES.map(|x| scale + product_log2(one, two, x * reach));
        Some(Profile { coefficients: cubic(values), inverse_reach: 1.0 / reach })
    }

    /// The overlap at a versine.
    #[inline(always)]
    pub fn at(&self, versine: f32) -> f32 {
        let x = (versine * self.inverse_reach).min(1.0);
        let [c0, c1, c2, c3] = self.coefficients;
        exp2(c0 + x * (c1 + x * (c2 + x * c3)))
    }
}

/// Coefficients of the cubic with these values at [`NODES`], by divided differences.
#[inline(always)]
fn cubic(values: [f32; 4]) -> [f32; 4] {
    let [x0, x1, x2, x3] = NODES;
    let [y0, y1, y2, y3] = values;
    let (d01, d12, d23) =
        ((y1 - y0) * (1.0 / (x1 - x0)), (y2 - y1) * (1.0 / (x2 - x1)), (y3 - y2) * (1.0 / (x3 - x2)));
    let (d012, d123) = ((d12 - d01) * (1.0 / (x2 - x0)), (d23 - d12) * (1.0 / (x3 - x1)));
    let d = (d123 - d012) * (1.0 / (x3 - x0));
    // Newton's form, multiplied out.
    let c2 = d012 - d * (x0 + x1 + x2);
    let c1 = d01 - d012 * (x0 + x1) + d * (x0 * x1 + x0 * x2 + x1 * x2);
    let c0 = y0 - d01 * x0 + d012 * x0 * x1 - d * x0 * x1 * x2;
    [c0, c1, c2, d]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobe::product_integral;

    #[test]
    fn profile_follows_the_integral() {
        let mut tried = 0;
        for one in [6.0f32, 9.0, 60.0, 700.0, 20_000.0, 1e7] {
            for two in [6.0f32, 12.0, 90.0, 1500.0, 50_000.0, 1e9] {
                for reach in [1e-8f32, 1e-5, 1e-3, 0.02, 0.1, 0.2] {
                    let Some(profile) = Profile::new(one, two, reach, 1.0) else { continue };
                    let peak = product_integral(one, two, 0.0);
                    tried += 1;
                    for k in 0..=20 {
                        let versine = reach * k as f32 / 20.0;
                        let off = (profile.at(versine) - product_integral(one, two, versine)).abs();
                        // Of the peak: a shadow's error by its mask is several times that.
                        assert!(off < 5e-4 * peak, "{one} {two} {reach} {versine}: {}", off / peak);
                    }
                }
            }
        }
        assert!(tried > 150, "{tried}");
    }

    #[test]
    fn lobes_far_apart_have_no_profile() {
        assert!(Profile::new(5.0, 6.0, 1.0, 1.0).is_none());
        assert!(Profile::new(5.0, 0.5, 0.1, 1.0).is_none());
        // Narrow ones meet nothing there, and their profile ends before.
        assert!(Profile::new(1e5, 1e5, 1.0, 1.0).is_some_and(|p| p.at(0.5) < 1e-10));
    }
}
