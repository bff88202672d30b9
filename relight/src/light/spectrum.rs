//! The sun's radiance through a turbid atmosphere, as linear Rec.709.
//!
//! ```text
//! L = ∫ L₀(λ) τ_R(λ) τ_a(λ) τ_o(λ) (r̄, ḡ, b̄)(λ) dλ      [W/(m² sr), colour-matched]
//! ```
//!
//! with the extraterrestrial radiance L₀, Rayleigh scattering τ_R = exp(-0.008735 m λ^-4.08), Ångström's
//! aerosol τ_a = exp(-β m λ^-1.3) with β = 0.04608 T - 0.04586 for turbidity T, and 0.35 cm of ozone; λ in
//! micrometres and m the relative air mass of Kasten. Water vapour and mixed gases absorb outside of the
//! visible and are left out.
//!
//! Limits: β would be negative under turbidity 1; the air mass is fitted for a sun above the horizon and held
//! there.
//!
//! Based on: Preetham, Shirley and Smits, A Practical Analytic Model for Daylight, 1999 (appendix; after Iqbal,
//! An Introduction to Solar Radiation, 1983); Wyman, Sloan and Shirley, Simple Analytic Approximations to the
//! CIE XYZ Color Matching Functions, 2013.

use glam::{DMat3, DVec3, Vec3};

/// First wavelength of the tables, nanometres.
const FIRST_NM: f64 = 380.0;

/// Spacing of the tables, nanometres.
const STEP_NM: f64 = 10.0;

/// Extraterrestrial radiance of the sun's disc, W/(m² sr nm) / 10, from 380 to 750 nm.
const SUN_RADIANCE: [f64; 38] = [
    1655.9, 1623.37, 2112.75, 2588.82, 2582.91, 2423.23, 2676.05, 2965.83, 3054.54, 3005.75, 3066.37,
    2883.04, 2871.21, 2782.5, 2710.06, 2723.36, 2636.13, 2550.38, 2506.02, 2531.16, 2535.59, 2513.42,
    2463.15, 2417.32, 2368.53, 2321.21, 2282.77, 2233.98, 2197.02, 2152.67, 2109.79, 2072.83, 2024.04,
    1987.08, 1942.72, 1907.24, 1862.89, 1825.92,
];

/// Absorption of ozone, 1/cm, from 380 to 750 nm: the Chappuis band.
const OZONE: [f64; 38] = [
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.003, 0.006, 0.009, 0.014, 0.021, 0.03, 0.04, 0.048, 0.063, 0.075,
    0.085, 0.103, 0.12, 0.12, 0.115, 0.125, 0.12, 0.105, 0.09, 0.079, 0.067, 0.057, 0.048, 0.036, 0.028,
    0.023, 0.018, 0.014, 0.011, 0.01, 0.009,
];

/// Ozone in a column of the atmosphere, cm at standard conditions: a mid-latitude mean.
const OZONE_COLUMN: f64 = 0.35;

/// Radiance of the sun's disc with the sun at `elevation` (radians; below 0 counts as 0) through `turbidity`
/// 1..=10.
pub(super) fn sun_radiance(elevation: f32, turbidity: f32) -> Vec3 {
    let mass = air_mass(f64::from(elevation).max(0.0));
    let beta = (0.04608 * f64::from(turbidity) - 0.04586).max(0.0);
    let xyz: DVec3 = (0..SUN_RADIANCE.len())
        .map(|i| {
            let nm = FIRST_NM + STEP_NM * i as f64;
            colour_matching(nm)
                * (10.0 * SUN_RADIANCE[i] * transmittance(nm / 1000.0, mass, beta, OZONE[i]) * STEP_NM)
        })
        .sum();
    (XYZ_TO_REC709 * xyz).max(DVec3::ZERO).as_vec3()
}

/// What the atmosphere lets through at wavelength `um` (micrometres).
fn transmittance(um: f64, mass: f64, beta: f64, ozone: f64) -> f64 {
    let rayleigh = 0.008_735 * um.powf(-4.08);
    let aerosol = beta * um.powf(-1.3);
    (-mass * (rayleigh + aerosol + OZONE_COLUMN * ozone)).exp()
}

/// Relative optical air mass: 1 at the zenith, 37 at the horizon. Based on: Kasten, A New Table and
/// Approximation Formula for the Relative Optical Air Mass, 1965.
fn air_mass(elevation: f64) -> f64 {
    1.0 / (elevation.sin() + 0.15 * (elevation.to_degrees() + 3.885).powf(-1.253))
}

/// From CIE XYZ to linear Rec.709 with white D65 (columns).
const XYZ_TO_REC709: DMat3 = DMat3::from_cols_array(&[
    3.240_454_2,
    -0.969_266_0,
    0.055_643_4,
    -1.537_138_5,
    1.876_010_8,
    -0.204_025_9,
    -0.498_531_4,
    0.041_556_0,
    1.057_225_2,
]);

/// x̄, ȳ, z̄ of the CIE 1931 observer at `nm`: the multi-lobe fit of Wyman, Sloan and Shirley.
fn colour_matching(nm: f64) -> DVec3 {
    let lobe = |centre: f64, below: f64, above: f64| {
        let t = (nm - centre) * if nm < centre { below } else { above };
        (-0.5 * t * t).exp()
    };
    DVec3::new(
        0.362 * lobe(442.0, 0.0624, 0.0374) + 1.056 * lobe(599.8, 0.0264, 0.0323)
            - 0.065 * lobe(501.1, 0.0490, 0.0382),
        0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322),
        1.217 * lobe(437.0, 0.0845, 0.0278) + 0.681 * lobe(459.0, 0.0385, 0.0725),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solar_table_gives_the_solar_illuminance_constant() {
        let y: f64 = (0..SUN_RADIANCE.len())
            .map(|i| colour_matching(FIRST_NM + STEP_NM * i as f64).y * 10.0 * SUN_RADIANCE[i] * STEP_NM)
            .sum();
        let solid_angle = crate::cap::area(f64::from(super::super::sky::SUN_RADIUS));
        let lux = 683.0 * y * solid_angle;
        // Published values range from 127.5 klx (IES) to 133.3 klx (ASTM E490).
        assert!((126e3..134e3).contains(&lux), "{lux} lx outside of the atmosphere");
    }

    #[test]
    fn colour_matching_integrates_to_equal_energy_white() {
        let sum: DVec3 = (0..400).map(|i| colour_matching(360.0 + f64::from(i))).sum();
        // 106.86 nm for each of the three curves; the fits keep it to half a percent.
        assert!((sum / 106.86 - 1.0).abs().max_element() < 0.006, "{sum}");
    }

    #[test]
    fn sun_reddens_and_dims_towards_the_horizon() {
        let radiance = |degrees: f32| sun_radiance(degrees.to_radians(), 3.0);
        for (low, high) in [(0.0, 5.0), (5.0, 20.0), (20.0, 90.0)] {
            let (l, h) = (radiance(low), radiance(high));
            assert!(l.y < h.y, "{low} degrees is not dimmer than {high}");
            assert!(l.z / l.x < h.z / h.x, "{low} degrees is not redder than {high}");
        }
        assert_eq!(radiance(-1.0), radiance(0.0), "below the horizon the air mass is held");
    }
}
