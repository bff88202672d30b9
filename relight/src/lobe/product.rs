//! The product of two cosine lobes: its integral, and the one lobe that stands for it.
//!
//! Let φ be the angle between the axes, a ≥ b the exponents, m = a + b. In longitude ψ along the great circle
//! through both axes and latitude β across it, a lobe is cosᵉβ cosᵉ(ψ - ψ₀), so the integral over the sphere
//! is a product of two integrals,
//!
//! ```text
//! I(a, b, φ) = ∫ cos^(m+1) β dβ  ·  ∫ cosᵃ ψ cosᵇ(φ - ψ) dψ,     ψ from φ - π/2 to π/2
//! ```
//!
//! the first √π Γ(m/2 + 1) / Γ(m/2 + 3/2). The second has no elementary form. With A = a + 1, B = b + 1, and
//! in the variable u = ln(sin t / sin(π - φ - t)), t = π/2 - ψ, its integrand has a smooth, interior peak for
//! all exponents, 0 included, where A tan x = B tan y, x + y = φ, and Laplace's method gives
//!
//! ```text
//! J ≈ cosᵃ x cosᵇ y √(2π / k),     k = A / cos² x + B / cos² y
//! ```
//!
//! Its second-order term κ, which is a closed expression too, lies in 0..=3/8 and carries nearly all of what is
//! missing; ln(I / Laplace) = κ (c₀ + c₁κ + …) with five fitted numbers is within 3 % of the exact value for
//! all exponents in 0..=100,000 and all angles, and within 0.4 % RMS.
//!
//! The lobe: its axis is the product's maximum, a tan x = b tan y (with the exponents themselves), that is
//! sin(2x - φ) = (b - a)/(a + b) sin φ. Its exponent is the geometric mean of the two curvatures of the
//! product there, plus 1.15 (1 - cos φ), which brings it to the least-squares exponent where exponents are
//! small. Its scale keeps the integral I: least squares over both would give up to 12 % of the light away
//! where the lobes hardly meet.
//!
//! No table: one of the same error costs more time, see `benches/benches/lobes.rs`.
//!
//! Where it breaks: the single lobe is round, the product is not. Both exponents below 1 and axes 90° or more
//! apart leave a relative L2 difference of a half (the best round lobe leaves as much); the integral stays
//! within 3 %.
//!
//! Based on: Meunier, Meneveaux, Aveneau and Ghazanfarpour, Cosine Lobes for Interactive Direct Lighting in
//! Dynamic Scenes, 2009.

use std::f32::consts::{LOG2_E, TAU};

use glam::Vec3;

use super::Lobe;
use super::fast::{exp2, log2, log2_1p};

/// ln(I / Laplace) = κ (C₀ + C₁ κ + C₂ κ sin(φ/2) + C₃ κ / (m + 2) + C₄ κ²): least squares over 18 exponents
/// from 0 to 100,000, pairwise, and 34 angles, against the exact integral.
const CORRECTION: [f32; 5] = [1.052_9, 1.080_95, -2.157_41, -1.317_07, 1.696_47];
/// ∫ cos^(m+1) β dβ = √(2π / (m + 3/2 + LATITUDE.0 / (m + LATITUDE.1))), within 1e-4 for every m ≥ 0.
const LATITUDE: (f32, f32) = (0.135_5, 1.914);
/// What the least-squares exponent exceeds the mean curvature by, times 1 - cos φ; from numeric fits at
/// exponents 0.2 to 10 and angles 0.3 to 1.8.
const EXPONENT_SHIFT: f32 = 1.15;
/// log2 of 2π.
const LOG2_TAU: f32 = 2.651_496_1;
/// Products of lobes that hardly meet grow without bound; beyond this an axis of f32 has no digits left.
const MAX_EXPONENT: f32 = 1e12;

/// tan² y for the stationary point A tan x = B tan y, x + y = φ, with ratio = B / A ≤ 1 and versine 1 - cos φ.
///
/// tan y solves tan φ (1 - r t²) = (1 + r) t; written with sin and cos of φ, and by either end of the
/// quadratic formula, so that no digits cancel. At most 1e12: beyond, the lobes do not meet.
#[inline(always)]
fn stationary_tan_squared(ratio: f32, versine: f32) -> f32 {
    let cos = 1.0 - versine;
    let sin_squared = (versine * (2.0 - versine)).max(1e-12 * versine);
    let g = (1.0 + ratio) * cos;
    let q = (g * g + 4.0 * ratio * sin_squared).sqrt();
    let denominator = if cos > 0.0 { g + q } else { 4.0 * ratio * sin_squared / (q - g + 1e-37) };
    (4.0 * sin_squared / (denominator * denominator + 1e-37)).min(1e12)
}

/// ∫ max(a₁·v, 0)^e₁ max(a₂·v, 0)^e₂ dv over the sphere \[sr\], with versine = 1 - a₁·a₂ in 0..=2.
///
/// Exponents from 0 up. Within 3 % of the exact integral.
#[inline(always)]
pub fn product_integral(e1: f32, e2: f32, versine: f32) -> f32 {
    let (power, squared) = laplace(e1, e2, versine);
    // The floor of `exp2` is not 0, but an integral this small is.
    let peak = if power < -120.0 { 0.0 } else { exp2(power) };
    TAU * peak / squared.sqrt()
}

/// log2 of [`product_integral`], which may be far below the least f32.
#[inline(always)]
pub(super) fn product_log2(e1: f32, e2: f32, versine: f32) -> f32 {
    let (power, squared) = laplace(e1, e2, versine);
    LOG2_TAU + power - 0.5 * log2(squared)
}

/// p and q of the integral 2π 2ᵖ / √q.
#[inline(always)]
fn laplace(e1: f32, e2: f32, versine: f32) -> (f32, f32) {
    let (a, b) = if e1 > e2 { (e1, e2) } else { (e2, e1) };
    let (shifted_a, shifted_b) = (a + 1.0, b + 1.0);
    let m = a + b;
    let r = shifted_b / shifted_a;
    let tau = stationary_tan_squared(r, versine);
    let tau_x = r * r * tau;
    let bend = shifted_b * tau * (1.0 + r);
    let k = m + 2.0 + bend;
    let inverse_k = 1.0 / k;
    // κ: Laplace's second-order term.
    let beta = bend * inverse_k;
    let w = (1.0 - r) * (1.0 - r) * tau;
    let fourth =
        shifted_a * (1.0 + 3.0 * tau_x) * (1.0 + tau_x) + shifted_b * (1.0 + 3.0 * tau) * (1.0 + tau);
    let kappa = (0.5 * (w + 2.0 + tau_x + tau) - 0.25 * fourth * inverse_k
        + w * beta * (5.0 / 6.0 * beta - 1.0))
        * inverse_k;
    let kappa = kappa.clamp(0.0, 0.375);
    let [c0, c1, c2, c3, c4] = CORRECTION;
    let half_chord = (0.5 * versine).sqrt();
    let correction = kappa * (c0 + kappa * (c1 + c2 * half_chord + c3 / (m + 2.0) + c4 * kappa));
    let peak = -0.5 * (a * log2_1p(tau_x) + b * log2_1p(tau));
    let latitude = m + 1.5 + LATITUDE.0 / (m + LATITUDE.1);
    (peak + LOG2_E * correction, k * latitude)
}

/// The product's shape without its axis: exponent, and the weights of the two axes in the new one.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    pub exponent: f32,
    pub weight_1: f32,
    pub weight_2: f32,
}

/// Exponent and axis (not yet of unit length) of the lobe that stands for a product.
#[inline(always)]
pub(super) fn product_shape(e1: f32, e2: f32, versine: f32) -> Shape {
    let first = e1 > e2;
    let (a, b) = if first { (e1, e2) } else { (e2, e1) };
    // Two constants have their product's centre halfway; a constant and a lobe, at the lobe.
    let r = if a > 0.0 { (b / a).max(1e-12) } else { 1.0 };
    let tau = stationary_tan_squared(r, versine);
    let tau_x = r * r * tau;
    let across = a + b;
    let along = across + b * tau * (1.0 + r);
    let exponent = ((along * across).sqrt() + EXPONENT_SHIFT * versine).min(MAX_EXPONENT);
    // sin y and sin x, both divided by tan y, which may be 0.
    let weight_a = 1.0 / (1.0 + tau).sqrt();
    let weight_b = r / (1.0 + tau_x).sqrt();
    let (weight_1, weight_2) = if first { (weight_a, weight_b) } else { (weight_b, weight_a) };
    Shape { exponent, weight_1, weight_2 }
}

/// The lobe that stands for the product of two: same integral (within 3 %), axis at the product's maximum,
/// least-squares width.
///
/// Axes of unit length. Lobes that do not meet give scale 0.
#[inline]
pub fn product(one: &Lobe, two: &Lobe) -> Lobe {
    let versine = 0.5 * (one.axis - two.axis).length_squared().min(4.0);
    let Shape { exponent, weight_1, weight_2 } = product_shape(one.exponent, two.exponent, versine);
    let axis = (one.axis * weight_1 + two.axis * weight_2).try_normalize().unwrap_or(one.axis);
    let integral = product_integral(one.exponent, two.exponent, versine);
    let scale = one.scale * two.scale * integral * (exponent + 1.0) / TAU;
    Lobe { axis, exponent, scale }
}

/// Sum of lobes times sum of lobes, integrated; products whose integral is below `threshold` \[sr times the
/// scales\] are left out. Gives the integral and how many products were kept.
///
/// The order of the paper's section 5.4: `first` times `second`, and only what survives times `third`.
pub fn triple_integral(first: &[Lobe], second: &[Lobe], third: &[Lobe], threshold: f32) -> (f32, usize) {
    let mut sum = 0.0;
    let mut products = 0;
    for (f, s) in first.iter().flat_map(|f| second.iter().map(move |s| (f, s))) {
        let pair = product(f, s);
        if pair.integral().abs() < threshold {
            continue;
        }
        products += 1;
        for t in third {
            let versine = 0.5 * (pair.axis - t.axis).length_squared();
            let term = pair.scale * t.scale * product_integral(pair.exponent, t.exponent, versine);
            if term.abs() >= threshold {
                sum += term;
                products += 1;
            }
        }
    }
    (sum, products)
}

/// Axis of the product of two lobes, for callers that have axes at hand.
#[inline(always)]
pub(super) fn product_axis(shape: &Shape, one: Vec3, two: Vec3) -> Vec3 {
    let axis = one * shape.weight_1 + two * shape.weight_2;
    axis / axis.length().max(1e-20)
}
