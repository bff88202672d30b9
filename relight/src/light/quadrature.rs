//! Gauss-Legendre quadrature: ∫ over [a, b] exact for polynomials up to degree 2 N - 1.

/// Nodes and weights of a rule with `N` points on [-1, 1].
///
/// Newton's iteration on the Legendre polynomial P_N from Chebyshev's guess; N² operations per step.
pub fn gauss_legendre<const N: usize>() -> [(f64, f64); N] {
    let mut rule = [(0.0, 0.0); N];
    for (i, node) in rule.iter_mut().enumerate() {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (N as f64 + 0.5)).cos();
        // Quadratic convergence: four steps reach rounding, the others are for safety.
        for _ in 0..8 {
            let (p, slope) = legendre_with_slope(N, x);
            x -= p / slope;
        }
        let (_, slope) = legendre_with_slope(N, x);
        *node = (x, 2.0 / ((1.0 - x * x) * slope * slope));
    }
    rule
}

/// The rule's points moved to [a, b]: (position, weight).
pub fn over<const N: usize>(rule: &[(f64, f64); N], a: f64, b: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    rule.iter().map(move |&(x, w)| (middle + half * x, half * w))
}

/// Legendre polynomials P_0(x) to P_{N-1}(x).
pub fn legendre<const N: usize>(x: f64) -> [f64; N] {
    let mut p = [1.0; N];
    for l in 1..N {
        let two_back = if l >= 2 { p[l - 2] } else { 0.0 };
        p[l] = ((2 * l - 1) as f64 * x * p[l - 1] - (l - 1) as f64 * two_back) / l as f64;
    }
    p
}

/// P_n(x) and its derivative, |x| < 1.
fn legendre_with_slope(n: usize, x: f64) -> (f64, f64) {
    let (mut before, mut p) = (0.0, 1.0);
    for l in 1..=n {
        (before, p) = (p, ((2 * l - 1) as f64 * x * p - (l - 1) as f64 * before) / l as f64);
    }
    (p, n as f64 * (before - x * p) / (1.0 - x * x))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadrature_is_exact_up_to_its_degree() {
        let rule = gauss_legendre::<6>();
        for degree in 0..12 {
            let sum: f64 = over(&rule, 0.0, 2.0).map(|(x, w)| w * x.powi(degree)).sum();
            let exact = 2.0_f64.powi(degree + 1) / f64::from(degree + 1);
            // Rounding of a dozen terms.
            assert!((sum / exact - 1.0).abs() < 1e-13, "degree {degree}: {sum} against {exact}");
        }
        let beyond: f64 = over(&rule, 0.0, 2.0).map(|(x, w)| w * x.powi(16)).sum();
        assert!((beyond * 17.0 / 2.0_f64.powi(17) - 1.0).abs() > 1e-9, "degree 16 is beyond six points");
    }

    #[test]
    fn legendre_polynomials_have_their_known_values() {
        let p = legendre::<5>(0.5);
        let known = [1.0, 0.5, -0.125, -0.4375, -0.289_062_5];
        for l in 0..5 {
            // Dyadic numbers: exact.
            assert_eq!(p[l], known[l], "P_{l}(1/2)");
        }
    }
}
