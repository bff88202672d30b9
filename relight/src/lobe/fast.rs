//! Logarithm and exponential of base 2 in plain arithmetic, so that loops over lanes become vector code.
//!
//! Both are within 3e-7 of the exact value, relative; arguments out of range are clamped, never NaN for a
//! number that is not NaN. Neither calls the C library, so results are the same on every machine that rounds
//! as IEEE 754 says.

use std::f32::consts::LOG2_E;

/// Adding it leaves the nearest whole number in the low bits of the mantissa.
const ROUNDING: f32 = 12_582_912.0;
/// Bits of √½: mantissas are taken from √½ to √2, around 1, where the series below is shortest.
const HALF_ROOT: i32 = 0x3f35_04f3;

/// 2^x for x clamped to ±126.
#[inline(always)]
pub fn exp2(x: f32) -> f32 {
    let x = x.clamp(-126.0, 126.0);
    let shifted = x + ROUNDING;
    let f = x - (shifted - ROUNDING);
    // Taylor series of 2^f on ±½; the next term is 1.2e-7.
    let series = 1.540_353e-4;
    let series = series * f + 1.333_355_8e-3;
    let series = series * f + 9.618_129e-3;
    let series = series * f + 5.550_411e-2;
    let series = series * f + 2.402_265e-1;
    let series = series * f + std::f32::consts::LN_2;
    let series = series * f + 1.0;
    f32::from_bits(series.to_bits().wrapping_add(shifted.to_bits() << 23))
}

/// log2(1 + x) for x ≥ 0, exact to rounding also where 1 + x rounds to 1.
#[inline(always)]
pub fn log2_1p(x: f32) -> f32 {
    let y = 1.0 + x;
    // What the sum rounded away: ln(1 + x) = ln y + (x - (y - 1)) / y.
    log2(y) + LOG2_E * ((x - (y - 1.0)) / y)
}

/// log2 of a normal number above 0.
#[inline(always)]
pub fn log2(y: f32) -> f32 {
    let bits = y.to_bits() as i32;
    let exponent = (bits - HALF_ROOT) >> 23;
    let m = f32::from_bits((bits - (exponent << 23)) as u32);
    // ln m = 2 artanh((m - 1) / (m + 1)), |s| ≤ 0.172; the next term is 4e-10.
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let series = 2.0 + q * (2.0 / 3.0 + q * (0.4 + q * (2.0 / 7.0 + q * (2.0 / 9.0))));
    exponent as f32 + LOG2_E * s * series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_follows_the_library() {
        // The series stops at a term of 1.2e-7; rounding adds as much again.
        for i in -12_000..12_000 {
            let x = i as f32 * 0.0101;
            let exact = f64::from(x).exp2();
            assert!((f64::from(exp2(x)) / exact - 1.0).abs() < 4e-7, "{x}");
        }
        assert!(exp2(-1e30) < 1.2e-38 && exp2(1e30).is_finite());
    }

    #[test]
    fn logarithm_keeps_digits_of_tiny_arguments() {
        for i in -60..60 {
            let x = 1.7f32.powi(i);
            let exact = f64::from(x).ln_1p() / std::f64::consts::LN_2;
            assert!((f64::from(log2_1p(x)) / exact - 1.0).abs() < 4e-7, "{x}");
        }
        assert_eq!(log2_1p(0.0), 0.0);
        for i in -80..80 {
            let x = 2.9f32.powi(i);
            // Of the logarithm itself, or of 1 where it is small.
            let exact = f64::from(x).log2();
            assert!((f64::from(log2(x)) - exact).abs() < 4e-7 * exact.abs().max(1.0), "{x}");
        }
    }
}
