use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::Vec3;

use super::Random;
use crate::lobe::{Lobe, cap_lobe, cap_lobe_least_squares, product, product_integral, triple_integral};

/// ∫ cosᵐ⁺¹ β dβ over ±π/2, by recurrence down to the exact values at m + 1 in 0..2 is not open to real m, so by
/// the trapezoid rule in a variable that flattens the ends: β = π/2 tanh(½π sinh s).
fn double_exponential(f: impl Fn(f64) -> f64, low: f64, high: f64, n: usize) -> f64 {
    let (half, middle) = (0.5 * (high - low), 0.5 * (high + low));
    let h = 8.0 / n as f64;
    let term = |i: usize| {
        let s = -4.0 + (i as f64 + 0.5) * h;
        let t = FRAC_PI_2 * s.sinh();
        half * f(middle + half * t.tanh()) * FRAC_PI_2 * s.cosh() / t.cosh().powi(2)
    };
    h * (0..n).map(term).sum::<f64>()
}

/// The exact integral of a product of lobes, as two integrals of one variable, each over the part that matters.
pub(super) fn exact(e1: f64, e2: f64, phi: f64) -> f64 {
    let (a, b) = (e1.max(e2), e1.min(e2));
    let peak = if a + b > 0.0 { 0.5 * (phi + ((b - a) / (a + b) * phi.sin()).asin()) } else { 0.5 * phi };
    let (low, high) = (phi - FRAC_PI_2, FRAC_PI_2);
    let reach = 12.0 / (a + b + 1.0).sqrt();
    let (low, high) = (low.max(peak - reach), high.min(peak + reach));
    let in_plane = |psi: f64| psi.cos().max(0.0).powf(a) * (phi - psi).cos().max(0.0).powf(b);
    let across = |beta: f64| beta.cos().powf(a + b + 1.0);
    let wide = FRAC_PI_2.min(reach);
    double_exponential(in_plane, low, high, 240) * double_exponential(across, -wide, wide, 160)
}

/// The paper's sampling: 16 exponents in each of [0, 1], [1, 10] … [10⁴, 10⁵].
fn exponents() -> Vec<f64> {
    let decade = |k: i32| {
        let low = if k == 0 { 0.0 } else { 10f64.powi(k - 1) };
        (0..16).map(move |i| low + (10f64.powi(k) - low) * f64::from(i) / 16.0)
    };
    (0..6).flat_map(decade).chain([1e5]).collect()
}

/// ∫ f over the interval by Simpson's rule, halved until a half changes by less than `tolerance`.
fn adaptive(f: &dyn Fn(f64) -> f64, low: f64, high: f64, tolerance: f64, depth: u32) -> f64 {
    let simpson = |low: f64, high: f64| (f(low) + 4.0 * f(0.5 * (low + high)) + f(high)) * (high - low) / 6.0;
    let middle = 0.5 * (low + high);
    let (whole, halves) = (simpson(low, high), simpson(low, middle) + simpson(middle, high));
    if depth == 0 || (halves - whole).abs() < 15.0 * tolerance {
        return halves + (halves - whole) / 15.0;
    }
    let half = |low, high| adaptive(f, low, high, 0.5 * tolerance, depth - 1);
    half(low, middle) + half(middle, high)
}

#[test]
fn exact_integral_is_that_of_adaptive_quadrature_over_the_sphere() {
    // Polar coordinates about the first axis, with none of the split into longitude and latitude.
    for (e1, e2) in [(0.0f64, 0.0), (0.3, 0.7), (1.0, 1.0), (6.0, 2.5), (40.0, 1.0), (300.0, 60.0)] {
        for phi in [0.0f64, 0.4, 1.2, 1.57, 2.2] {
            let ring = |theta: f64| {
                let value = |turn: f64| {
                    let cos = theta.cos() * phi.cos() + theta.sin() * turn.cos() * phi.sin();
                    if cos > 0.0 { cos.powf(e2) } else { 0.0 }
                };
                let around = 2.0 * adaptive(&value, 0.0, PI, 1e-8, 18);
                theta.sin() * theta.cos().max(0.0).powf(e1) * around
            };
            // In pieces, so that no lobe falls between the first few places.
            let piece = |k: i32| {
                let step = FRAC_PI_2 / 16.0;
                adaptive(&ring, f64::from(k) * step, f64::from(k + 1) * step, 1e-7, 12)
            };
            let sphere: f64 = (0..16).map(piece).sum();
            // 16 pieces of 1e-7, and as much again from within.
            assert!((sphere - exact(e1, e2, phi)).abs() < 5e-6, "{e1} {e2} {phi}: {sphere}");
        }
    }
}

#[test]
fn integral_of_product_follows_quadrature_over_the_whole_range() {
    let exponents = exponents();
    let (mut sum, mut n, mut worst) = (0.0, 0, (0.0, 0.0, 0.0, 0.0));
    for (i, &a) in exponents.iter().enumerate().step_by(2) {
        for &b in exponents[..=i].iter().step_by(3) {
            for k in 0..24 {
                let phi = (f64::from(k) + 0.5) / 24.0 * PI;
                let truth = exact(a, b, phi);
                let ours = f64::from(product_integral(a as f32, b as f32, (1.0 - phi.cos()) as f32));
                sum += (ours - truth).abs();
                n += 1;
                let relative = (ours - truth).abs() / truth.max(1e-12);
                if relative > worst.0 {
                    worst = (relative, a, b, phi);
                }
            }
        }
    }
    println!("mean absolute error {:.2e} over {n}; worst relative {worst:?}", sum / f64::from(n));
    // The paper's table reaches 7.1e-4; the fit was made to 2.7 % at worst, and f32 adds a little for products
    // so faint that their logarithm is large.
    assert!(sum / f64::from(n) < 4e-4);
    assert!(worst.0 < 0.03, "{worst:?}");
}

#[test]
fn integral_of_product_holds_where_the_paper_fails() {
    // Both exponents in 0..=1 and axes about 90° apart: there the paper's product is up to 50 % off.
    let mut worst: f64 = 0.0;
    for (i, j, k) in (0..=5).flat_map(|i| (0..=5).flat_map(move |j| (0..=8).map(move |k| (i, j, k)))) {
        let (a, b, phi) = (0.2 * f64::from(i), 0.2 * f64::from(j), 1.1 + 0.12 * f64::from(k));
        let ours = f64::from(product_integral(a as f32, b as f32, (1.0 - phi.cos()) as f32));
        worst = worst.max((ours / exact(a, b, phi) - 1.0).abs());
    }
    println!("worst relative error {worst:.4}");
    // 5 % is asked for; the fit has 2.7 % everywhere.
    assert!(worst < 0.028);
}

#[test]
fn aligned_products_are_exact() {
    for e1 in [0.0f32, 0.5, 1.0, 7.0, 100_000.0] {
        for e2 in [0.0f32, 1.0, 33.0, 100_000.0] {
            let one = Lobe { axis: Vec3::X, exponent: e1, scale: 2.0 };
            let both = product(&one, &Lobe { axis: Vec3::X, exponent: e2, scale: 3.0 });
            assert!((both.exponent - (e1 + e2)).abs() <= 2e-6 * (e1 + e2));
            assert!(both.axis.distance(Vec3::X) < 1e-6);
            // Only the fitted integral errs: by 2.9 % for two hemispheres, 0.6 % or less from exponent 3 on.
            let tolerance = if e1 + e2 < 3.0 { 0.029 } else { 0.006 };
            assert!((both.scale / 6.0 - 1.0).abs() < tolerance, "{e1} {e2} {both:?}");
        }
    }
}

#[test]
fn product_axis_is_the_maximum() {
    let mut random = Random(3);
    let mut tried = 0;
    for _ in 0..300 {
        let exponent = |u: f64| (10f64.powf(6.0 * u - 1.0)) as f32;
        let one = Lobe { axis: random.direction(), exponent: exponent(random.unit()), scale: 1.0 };
        let two = Lobe { axis: random.direction(), exponent: exponent(random.unit()), scale: 1.0 };
        let axis = product(&one, &two).axis.as_dvec3();
        let log = |v: glam::DVec3| {
            let cos = |l: &Lobe| v.dot(l.axis.as_dvec3());
            if cos(&one) <= 0.0 || cos(&two) <= 0.0 {
                return f64::NEG_INFINITY;
            }
            f64::from(one.exponent) * cos(&one).ln() + f64::from(two.exponent) * cos(&two).ln()
        };
        // A maximum on the very horizon of one of them is beyond the rounding of its axis.
        if axis.dot(one.axis.as_dvec3()).min(axis.dot(two.axis.as_dvec3())) < 1e-4 {
            continue;
        }
        let across = one.axis.cross(two.axis).as_dvec3().normalize().cross(axis);
        // A step of 3e-3 either way never gains; the axis itself has the rounding of f32.
        let best = log((axis + across * 3e-3).normalize()).max(log((axis - across * 3e-3).normalize()));
        assert!(log(axis) >= best - 1e-9, "{one:?} {two:?}");
        tried += 1;
    }
    assert!(tried > 200, "{tried}");
}

#[test]
fn product_lobe_is_near_the_least_squares_lobe() {
    // Relative L2 distance of the product and its lobe, against that of the best exponent with the same axis and
    // integral, on a grid of directions.
    let distance = |one: &Lobe, two: &Lobe, lobe: &Lobe| {
        let mut random = Random(11);
        let (mut off, mut all) = (0.0, 0.0);
        for _ in 0..20_000 {
            let v = random.direction();
            let p = f64::from(one.value(v) * two.value(v));
            off += (p - f64::from(lobe.value(v))).powi(2);
            all += p * p;
        }
        (off / all).sqrt()
    };
    for (e1, e2) in [(1.0f32, 1.0f32), (5.0, 5.0), (10.0, 1.0), (40.0, 3.0), (0.4, 0.2)] {
        for phi in [0.3f32, 0.8, 1.3, 1.57] {
            let one = Lobe { axis: Vec3::Z, exponent: e1, scale: 1.0 };
            let two = Lobe { axis: Vec3::new(phi.sin(), 0.0, phi.cos()), exponent: e2, scale: 1.0 };
            let ours = product(&one, &two);
            let mut best = f64::INFINITY;
            for step in -14..=14 {
                let exponent = ours.exponent * 1.06f32.powi(step);
                let scale = ours.integral() * (exponent + 1.0) / std::f32::consts::TAU;
                best = best.min(distance(&one, &two, &Lobe { axis: ours.axis, exponent, scale }));
            }
            let got = distance(&one, &two, &ours);
            // The exponent is a formula, not a search: a tenth more than the least distance, and a hundredth of
            // the product where both are tiny.
            assert!(got < 1.1 * best + 0.01, "{e1} {e2} {phi}: {got} against {best}");
        }
    }
}

#[test]
fn cap_lobe_keeps_solid_angle_and_aligned_product() {
    for radius in [1e-3f64, 0.02, 0.2, 0.7, 1.2, 1.5] {
        for partner in [1.0f64, 4.0, 50.0, 3000.0] {
            let lobe = cap_lobe(Vec3::Y, radius as f32, partner as f32);
            let versine = 2.0 * (0.5 * radius).sin().powi(2);
            let c = 1.0 - versine;
            let solid = TAU * versine;
            assert!((f64::from(lobe.integral()) / solid - 1.0).abs() < 1e-3, "{radius} {partner}");
            let truth = TAU * -((partner + 1.0) * (-versine).ln_1p()).exp_m1() / (partner + 1.0);
            let ours = TAU * f64::from(lobe.scale) / (f64::from(lobe.exponent) + partner + 1.0);
            // Single precision, of 1 - ρ at worst.
            assert!((ours / truth - 1.0).abs() < 3e-3, "{radius} {partner}: {ours} {truth}, cos {c}");
        }
    }
    let half = cap_lobe(Vec3::Y, FRAC_PI_2 as f32, 1.0);
    assert!(half.exponent < 1e-3 && (half.scale - 1.0).abs() < 1e-3);
}

#[test]
fn least_squares_cap_gives_too_much_light() {
    // For small caps the minimum of the paper's equation 32 has e = 2 u / σ² with exp(-u) (1 + u) = 3/4.
    let lobe = cap_lobe_least_squares(Vec3::Y, 0.02);
    assert!((lobe.exponent * 0.02 * 0.02 / 2.0 - 0.961).abs() < 0.005);
    let ratio = lobe.integral() / (TAU as f32 * (1.0 - 0.02f32.cos()));
    assert!((ratio - 1.04).abs() < 0.01, "{ratio}");
}

#[test]
fn sums_of_lobes_follow_monte_carlo() {
    // Random sums as the method makes them: a diffuse and a glossy lobe, two lamps, and a visibility of 1 less
    // six leaves. Their integrals, over the brightest of them scaled to 0.70, must differ by 0.0039 on average.
    let mut random = Random(5);
    let (mut ours, mut truth) = (Vec::new(), Vec::new());
    for _ in 0..120 {
        let mut lobe = |low: f64, high: f64, scale: f64| Lobe {
            axis: (Vec3::Y * 1.2 + random.direction()).normalize(),
            exponent: (low * (high / low).powf(random.unit())) as f32,
            scale: scale as f32,
        };
        let reflectance = [Lobe { axis: Vec3::Y, exponent: 1.0, scale: 0.25 }, lobe(5.0, 60.0, 0.8)];
        let light = [lobe(2.0, 100.0, 1.0), lobe(2.0, 100.0, 0.6)];
        let mut visibility = vec![Lobe { axis: Vec3::Y, exponent: 0.0, scale: 1.0 }];
        visibility.extend((0..6).map(|_| lobe(40.0, 400.0, -0.5)));
        let everywhere = visibility.remove(0);
        let (open, _) = triple_integral(&reflectance, &light, &[everywhere], 0.0);
        // The unit lobe of visibility is 1 over the whole sphere: the pair itself.
        let pairs = reflectance.iter().flat_map(|f| light.iter().map(move |l| product(f, l).integral()));
        let pairs: f32 = pairs.sum();
        assert!(open <= pairs * 1.03);
        let (blocked, _) = triple_integral(&reflectance, &light, &visibility, 0.0);
        ours.push(pairs + blocked);
        truth.push(integrate(&reflectance, &light, &visibility));
    }
    let brightest = truth.iter().copied().fold(0.0, f32::max);
    let mean = ours.iter().zip(&truth).map(|(a, b)| (a - b).abs()).sum::<f32>() / ours.len() as f32;
    let mean = mean * 0.70 / brightest;
    println!("mean difference {mean:.5} where the brightest is 0.70");
    // The paper's 0.0039; the quadrature's own error is 1e-4.
    assert!(mean < 0.0039, "{mean}");
}

/// ∫ (Σ f)(Σ l)(1 + Σ v) over the sphere on 300 × 600 equal-area cells.
fn integrate(f: &[Lobe], l: &[Lobe], v: &[Lobe]) -> f32 {
    let (rows, columns) = (150, 300);
    let sum = |lobes: &[Lobe], w: Vec3| lobes.iter().map(|lobe| lobe.value(w)).sum::<f32>();
    let mut total = 0.0f64;
    for i in 0..rows {
        let y = 1.0 - 2.0 * (i as f32 + 0.5) / rows as f32;
        let r = (1.0 - y * y).sqrt();
        for j in 0..columns {
            let (sin, cos) = (std::f32::consts::TAU * (j as f32 + 0.5) / columns as f32).sin_cos();
            let w = Vec3::new(r * cos, y, r * sin);
            total += f64::from(sum(f, w) * sum(l, w) * (1.0 + sum(v, w)));
        }
    }
    (total * 2.0 * TAU / (rows * columns) as f64) as f32
}

#[test]
fn threshold_drops_only_what_is_small() {
    let mut random = Random(9);
    let mut lobes = |n: usize| -> Vec<Lobe> {
        (0..n).map(|_| Lobe { axis: random.direction(), exponent: 20.0, scale: 1.0 }).collect()
    };
    let (f, l, v) = (lobes(4), lobes(5), lobes(6));
    let (all, n_all) = triple_integral(&f, &l, &v, 0.0);
    let (most, n_most) = triple_integral(&f, &l, &v, 1e-4);
    assert!(n_most < n_all / 2, "{n_most} of {n_all}");
    // Each of the 120 products left out is below 1e-4, or its pair is, and a pair's product is below the pair.
    assert!((all - most).abs() <= 120.0 * 1e-4);
}
