use super::*;

/// Radii from a hundredth of the sun to the whole sphere.
const RADII: [f64; 15] =
    [1e-5, 1e-4, 1e-3, 0.002, 0.01, 0.1, 0.5, 1.0, FRAC_PI_2, 2.0, 2.5, 3.0, PI - 1e-3, PI - 1e-5, PI];

/// Overlap by one-dimensional quadrature over circles around the first axis: (area, moment along the first
/// axis, moment towards the second). It knows nothing of spherical triangles.
fn by_quadrature(d: f64, r1: f64, r2: f64) -> (f64, f64, f64) {
    // Where the circle of radius θ meets the second rim at all, its share has kinks: integrate between them.
    let mut cuts = [0.0, (d - r2).abs(), d + r2, 2.0 * PI - d - r2, r1].map(|x| x.clamp(0.0, r1));
    cuts.sort_by(f64::total_cmp);
    let mut sum = (0.0, 0.0, 0.0);
    for pair in cuts.windows(2) {
        add_rings(d, r2, pair[0], pair[1], &mut sum);
    }
    sum
}

fn add_rings(d: f64, r2: f64, from: f64, to: f64, sum: &mut (f64, f64, f64)) {
    let n = 200;
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    for i in 0..n {
        // θ = middle - half cos t takes the roots at both ends out of the integrand; then midpoints converge
        // fast.
        let t = PI * (i as f64 + 0.5) / n as f64;
        let theta = middle - half * t.cos();
        let width = half * t.sin() * PI / n as f64 * theta.sin();
        let share = half_share(d, r2, theta);
        sum.0 += 2.0 * share * width;
        sum.1 += 2.0 * share * theta.cos() * width;
        sum.2 += 2.0 * share.sin() * theta.sin() * width;
    }
}

/// Half the angle of the circle of radius `theta` around the first axis that lies in the second cap.
fn half_share(d: f64, r2: f64, theta: f64) -> f64 {
    let all = theta.sin() * d.sin();
    let versine = 2.0 * (0.5 * (r2 + theta - d)).sin() * (0.5 * (r2 - theta + d)).sin();
    if all <= 0.0 {
        return if versine > 0.0 { PI } else { 0.0 };
    }
    2.0 * (0.5 * versine / all).clamp(0.0, 1.0).sqrt().asin()
}

/// Distances that hold every case and every boundary between cases, from both sides.
fn distances(r1: f64, r2: f64) -> Vec<f64> {
    let boundaries = [0.0, (r1 - r2).abs(), r1 + r2, 2.0 * PI - r1 - r2, PI];
    let steps = [0.0, 1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 0.01, 0.1];
    let around = boundaries.iter().flatten_around(&steps, r1.min(r2));
    let inner = (1..20).map(|i| (r1 - r2).abs() + (r1 + r2 - (r1 - r2).abs()) * f64::from(i) / 20.0);
    around.into_iter().chain(inner).filter(|d| (0.0..=PI).contains(d)).collect()
}

trait Around {
    fn flatten_around(self, steps: &[f64], scale: f64) -> Vec<f64>;
}

impl<'a, I: Iterator<Item = &'a f64>> Around for I {
    /// Each boundary, and points on both sides of it at `steps` in units of `scale`.
    fn flatten_around(self, steps: &[f64], scale: f64) -> Vec<f64> {
        self.flat_map(|b| steps.iter().flat_map(move |s| [b - s * scale, b + s * scale])).collect()
    }
}

fn pairs() -> impl Iterator<Item = (f64, f64)> {
    RADII.into_iter().flat_map(|r1| RADII.into_iter().map(move |r2| (r1, r2)))
}

#[test]
fn intersection_area_matches_numeric_integration_over_all_radii() {
    let mut n = 0;
    for (r1, r2) in pairs() {
        for d in distances(r1, r2) {
            let (truth, ..) = by_quadrature(d, r1, r2);
            let found = intersection_area(d, r1, r2);
            // Midpoints leave 1e-5 of the smaller cap at worst; rounding of sums near 4π leaves 1e-14.
            let tolerance = 1e-4 * area(r1.min(r2)) + 1e-13;
            assert!((found - truth).abs() < tolerance, "d {d}, r1 {r1}, r2 {r2}: {found} against {truth}");
            n += 1;
        }
    }
    assert!(n > 10_000, "only {n} triples");
}

#[test]
fn intersection_moment_matches_numeric_integration_over_all_radii() {
    let a = DVec3::new(0.6, 0.0, 0.8);
    let sideways = DVec3::new(0.8, 0.0, -0.6);
    for (r1, r2) in pairs() {
        for d in distances(r1, r2) {
            let b = a * d.cos() + sideways * d.sin();
            let (_, along, towards) = by_quadrature(d, r1, r2);
            let truth = a * along + sideways * towards;
            let found = intersection_moment(a, r1, b, r2);
            // As for the area; unit vectors as given are unit to 1e-16, which moves tangencies by as much.
            let tolerance = 1e-4 * area(r1.min(r2)) + 1e-13;
            assert!((found - truth).length() < tolerance, "d {d}, r1 {r1}, r2 {r2}: {found} against {truth}");
        }
    }
}

#[test]
fn intersection_is_continuous_at_every_case_boundary() {
    for (r1, r2) in pairs() {
        for boundary in [(r1 - r2).abs(), r1 + r2, 2.0 * PI - r1 - r2] {
            let step = 1e-7 * r1.min(r2);
            let (before, after) = (boundary - step, boundary + step);
            if before < 0.0 || after > PI {
                continue;
            }
            let jump = (intersection_area(after, r1, r2) - intersection_area(before, r1, r2)).abs();
            // The overlap cannot change faster than the smaller rim is wide: 2 sin r per radian; plus
            // rounding where r has lost its digits next to π.
            let most = 2.0 * step * 2.0 * r1.min(r2).sin() + 1e-11 * area(r1.min(r2));
            assert!(jump <= most, "d {boundary}, r1 {r1}, r2 {r2}: {jump}");
            let smooth = (smoothstep_area(after, r1, r2) - smoothstep_area(before, r1, r2)).abs();
            assert!(
                smooth <= 1e-5 * area(r1.min(r2)) + 1e-14,
                "smoothstep at d {boundary}, r1 {r1}, r2 {r2}: {smooth}"
            );
        }
    }
}

#[test]
fn overlap_falls_with_distance_and_swaps() {
    for (r1, r2) in pairs() {
        let mut before = f64::INFINITY;
        for i in 0..=500 {
            let d = PI * f64::from(i) / 500.0;
            let found = intersection_area(d, r1, r2);
            // Rounding of the three parts of a lens.
            assert!(found <= before + 1e-14 && found >= 0.0, "d {d}, r1 {r1}, r2 {r2}");
            assert!((found - intersection_area(d, r2, r1)).abs() <= 1e-14, "d {d}, r1 {r1}, r2 {r2}");
            before = found;
        }
    }
}

#[test]
fn tiny_caps_overlap_like_discs_in_a_plane() {
    for r in [1e-3, 1e-4, 1e-5, 1e-6] {
        for x in [0.01, 0.3, 1.0, 1.7, 1.99] {
            let half: f64 = 0.5 * x;
            let plane = r * r * (2.0 * half.acos() - x * (1.0 - half * half).sqrt());
            let found = intersection_area(x * r, r, r);
            // Curvature is r²; a lens of nearly touching discs has lost some digits.
            assert!(
                (found / plane - 1.0).abs() < r * r + 1e-9,
                "r {r}, distance {x} r: {found} against {plane}"
            );
        }
    }
}

#[test]
fn hemispheres_share_a_lune() {
    for d in [0.0, 1e-6, 0.3, 1.0, FRAC_PI_2, 3.0, PI] {
        // A lune of angle π - d has area 2 (π - d).
        assert!((intersection_area(d, FRAC_PI_2, FRAC_PI_2) - 2.0 * (PI - d)).abs() < 1e-14, "d {d}");
    }
}

#[test]
fn smoothstep_meets_the_exact_area_at_both_ends() {
    for (r1, r2) in pairs() {
        let (full, gone) = ((r1 - r2).abs(), (r1 + r2).min(2.0 * PI - r1 - r2));
        for d in [full, gone] {
            let (exact, cheap) = (intersection_area(d, r1, r2), smoothstep_area(d, r1, r2));
            // Rounding: a tangency can be missed by one unit in the last place of d.
            assert!((exact - cheap).abs() < 1e-13, "d {d}, r1 {r1}, r2 {r2}: {exact} against {cheap}");
        }
    }
}

#[test]
fn smoothstep_stays_near_the_exact_area_between() {
    let mut worst: f64 = 0.0;
    for r1 in [0.005, 0.1, 0.5, 1.0, FRAC_PI_2] {
        for r2 in [0.005, 0.1, 0.5, 1.0, FRAC_PI_2] {
            for i in 0..=100 {
                let d = (r1 + r2) * f64::from(i) / 100.0;
                let error = smoothstep_area(d, r1, r2) - intersection_area(d, r1, r2);
                worst = worst.max(error.abs() / area(r1.min(r2)));
            }
        }
    }
    // Equal caps fall off almost linearly where smoothstep is still flat: a sixth of the cap at worst.
    assert!((0.1..0.17).contains(&worst), "{worst}");
}

#[test]
fn cap_over_plane_matches_closed_form() {
    // Wholly above the horizon: π sin² r cos θ.
    let normal = DVec3::new(1.0, 2.0, -2.0) / 3.0;
    let across = DVec3::new(2.0, 1.0, 2.0) / 3.0;
    let axis = |theta: f64| normal * theta.cos() + across * theta.sin();
    for r in [1e-4, 0.01, 0.3, 1.0, 1.5] {
        for part in [0.0, 0.5, 1.0] {
            let theta = part * (FRAC_PI_2 - r);
            let exact = PI * r.sin().powi(2) * theta.cos();
            let found = plane_irradiance(normal, axis(theta), r);
            // At full tilt the rim touches the horizon to rounding.
            assert!((found / exact - 1.0).abs() < 1e-9, "r {r}, theta {theta}: {found} against {exact}");
        }
    }
    assert!((plane_irradiance(normal, axis(0.4), PI) - PI).abs() < 1e-14, "the whole sphere gives π");
    assert!((plane_irradiance(normal, normal, FRAC_PI_2) - PI).abs() < 1e-14, "so does the hemisphere");
    assert_eq!(plane_irradiance(normal, axis(PI), 0.5), 0.0, "below the horizon");
}

#[test]
fn clipped_cap_over_plane_matches_numeric_integration() {
    for r in [1e-3, 0.004_65, 0.1, 0.7, FRAC_PI_2, 2.2, 3.0, PI - 1e-3] {
        for i in 0..=40 {
            let theta = PI * f64::from(i) / 40.0;
            let axis = DVec3::new(theta.sin(), 0.0, theta.cos());
            // The overlap with the hemisphere from the quadrature above, dotted with the normal +z.
            let (_, along, towards) = by_quadrature(theta, FRAC_PI_2, r);
            let found = plane_irradiance(DVec3::Z, axis, r);
            assert!(
                (found - along).abs() < 1e-4 * area(r) + 1e-13,
                "r {r}, theta {theta}: {found} against {along}"
            );
            assert!(towards.is_finite());
        }
    }
}

#[test]
fn sun_at_the_horizon_keeps_its_digits() {
    // A small disc of radius r half below the horizon gives 2/3 r³.
    for r in [1e-2, 1e-3, 1e-4, 1e-5] {
        let found = plane_irradiance(DVec3::Z, DVec3::X, r);
        assert!((found / (2.0 / 3.0 * r * r * r) - 1.0).abs() < r * r + 1e-9, "r {r}: {found}");
    }
}

#[test]
fn radius_and_area_are_inverse() {
    for r in RADII {
        // Near π the area is flat: 1e-16 of it is 1e-8 of the radius.
        assert!((radius_of_area(area(r)) - r).abs() < 3e-8 + 1e-15 * r, "{r}");
    }
    assert!((area(1e-6) / (PI * 1e-12) - 1.0).abs() < 1e-12, "no cancellation for small caps");
}

proptest::proptest! {
    #[test]
    fn no_caps_give_nan(d in 0.0f32..3.2, r1 in 0.0f32..3.2, r2 in 0.0f32..3.2) {
        let (d, r1, r2) = (f64::from(d), f64::from(r1), f64::from(r2));
        let (x, y) = moment_factors(overlap(d, r1, r2), r1, r2);
        proptest::prop_assert!(intersection_area(d, r1, r2) >= 0.0 && smoothstep_area(d, r1, r2) >= 0.0);
        proptest::prop_assert!(x.is_finite() && y.is_finite());
    }

    #[test]
    fn no_tangent_caps_give_nan(r1 in 0.0f32..1.6, r2 in 0.0f32..1.6) {
        for d in [r1 + r2, (r1 - r2).abs(), 0.0, r1, r2] {
            let (d, r1, r2) = (f64::from(d), f64::from(r1), f64::from(r2));
            let (x, y) = moment_factors(overlap(d, r1, r2), r1, r2);
            proptest::prop_assert!(intersection_area(d, r1, r2) >= 0.0 && x.is_finite() && y.is_finite());
        }
    }
}
