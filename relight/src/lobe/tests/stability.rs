use glam::Vec3;

use super::{Random, by_lobes, ground, lamp, traced};
use crate::lobe::{Error, Lamp, Lobe, Options, Policy, Sphere, SphereSet, product, product_integral};

const POLICIES: [Policy; 3] = [Policy::Aggressive, Policy::Conservative, Policy::Proportional];

fn ball(centre: [f32; 3], radius: f32) -> Sphere {
    Sphere { centre: centre.into(), radius }
}

/// `by_lobes` also asserts finite light, not negative.
fn all_policies(positions: &[[f32; 3]], lamps: &[Lamp], spheres: &[Sphere]) -> [Vec<f32>; 3] {
    POLICIES
        .map(|policy| by_lobes(positions, Vec3::Y, lamps, spheres, &Options { policy, ..Options::default() }))
}

#[test]
fn lamp_in_a_blocker_gives_nothing() {
    let spheres = [ball([0.2, 2.0, 0.0], 1.0)];
    for light in all_policies(&ground(12, 5.0), &[lamp([0.0, 2.1, 0.1], 0.3)], &spheres) {
        assert!(light.iter().all(|e| *e == 0.0));
    }
}

#[test]
fn point_in_a_blocker_gets_nothing() {
    let spheres = [ball([0.0, 0.5, 0.0], 1.0)];
    for light in all_policies(&[[0.1, 0.0, 0.0], [0.0, 0.9, 0.3]], &[lamp([0.0, 4.0, 0.0], 0.3)], &spheres) {
        assert!(light.iter().all(|e| *e == 0.0));
    }
}

#[test]
fn point_in_the_lamp_has_light_from_everywhere() {
    let inside = [[0.0, 0.0, 0.0], [0.5, 0.2, 0.1]];
    for light in all_policies(&inside, &[lamp([0.0, 0.1, 0.0], 1.0)], &[]) {
        assert!(light.iter().all(|e| (e - std::f32::consts::PI).abs() < 1e-3));
    }
    for light in all_policies(&inside, &[lamp([0.0, 0.1, 0.0], 1.0)], &[ball([0.0, 0.0, 0.0], 0.1)]) {
        assert_eq!(light[0], 0.0);
    }
}

#[test]
fn blocker_behind_the_lamp_takes_nothing() {
    let lamps = [lamp([0.0, 2.0, 0.0], 0.4)];
    let positions = ground(12, 2.0);
    let open = by_lobes(&positions, Vec3::Y, &lamps, &[], &Options::default());
    for light in all_policies(&positions, &lamps, &[ball([0.0, 4.0, 0.0], 1.2), ball([0.1, 9.0, 0.0], 4.0)]) {
        assert_eq!(light, open);
    }
}

#[test]
fn blocker_that_the_lamp_sticks_out_of_follows_rays() {
    // Half of the lamp is in the blocker: which of them a ray meets first differs over the lamp.
    let light = lamp([0.0, 2.0, 0.0], 0.5);
    let spheres = [ball([0.4, 2.1, 0.0], 0.5)];
    let positions = ground(10, 2.5);
    let ours = by_lobes(&positions, Vec3::Y, &[light], &spheres, &Options::default());
    let truth: Vec<f32> =
        positions.iter().map(|&p| traced(p.into(), Vec3::Y, &light, &spheres, 24)).collect();
    // As for soft shadows, which are 3 %.
    assert!(super::relative_difference(&ours, &truth) < 0.03);
}

#[test]
fn blockers_that_touch_the_horizon_follow_rays() {
    // Spheres that lie on the ground, sink into it, and one as large as a hill, under a low lamp that is half set.
    let spheres = [ball([1.0, 0.5, 0.0], 0.5), ball([0.0, -0.2, 1.0], 0.6), ball([8.0, -40.0, 0.0], 40.2)];
    let positions: Vec<_> = ground(12, 2.0).into_iter().map(|[x, y, z]| [x, y + 1e-3, z]).collect();
    // Of the light without blockers: a lamp that is half set is a bell cut by a straight horizon.
    for (height, tolerance) in [(0.05f32, 0.05), (0.5, 0.01), (1.5, 0.01)] {
        let light = lamp([4.0, height, 0.5], 0.6);
        let truth: Vec<f32> =
            positions.iter().map(|&p| traced(p.into(), Vec3::Y, &light, &spheres, 24)).collect();
        let open: f32 = positions.iter().map(|&p| traced(p.into(), Vec3::Y, &light, &[], 24)).sum();
        for ours in all_policies(&positions, &[light], &spheres) {
            let off: f32 = ours.iter().zip(&truth).map(|(a, b)| (a - b).abs()).sum();
            println!("height {height}: {:.4} of the open light", off / open);
            assert!(off / open < tolerance, "{height}: {}", off / open);
        }
    }
}

#[test]
fn lamp_radius_to_zero_keeps_its_shadow() {
    // Power fixed: radiance grows as the lamp shrinks, and the light tends to that of a point.
    let positions = ground(16, 2.0);
    let spheres = [ball([0.3, 1.0, 0.2], 0.5)];
    let at = |radius: f32| {
        let radiance = Vec3::splat(1.0 / (radius * radius));
        let light = Lamp::new(Vec3::new(0.0, 3.0, 0.0), radius, radiance).unwrap();
        by_lobes(&positions, Vec3::Y, &[light], &spheres, &Options::default())
    };
    let small = at(1e-3);
    for radius in [1e-4, 1e-6, 1e-9] {
        // One of 256 points may have its sun's rim on the edge of the shadow.
        let differing =
            at(radius).iter().zip(&small).filter(|(a, b)| (*a - *b).abs() > 0.01 * **b + 1e-4).count();
        assert!(differing <= 2, "{radius}: {differing}");
    }
    for (&position, e) in positions.iter().zip(&small) {
        let to = Vec3::new(0.0, 3.0, 0.0) - Vec3::from(position);
        let shadowed = super::hit(position.into(), to.normalize(), &spheres[0]).is_some();
        let truth = if shadowed { 0.0 } else { std::f32::consts::PI * to.y / to.length().powi(3) };
        assert!((e - truth).abs() < 0.01 * truth + 1e-4, "{position:?} {e} {truth}");
    }
}

#[test]
fn lamp_of_half_the_sky_follows_rays() {
    // The point almost touches the lamp, upright and on its side.
    for distance in [1.0001f32, 1.01, 1.05, 1.2] {
        for centre in [[0.0, distance, 0.0], [distance, 0.0, 0.0]] {
            let light = lamp(centre, 1.0);
            let gap = distance - 1.0;
            let spheres = [ball((Vec3::from(centre) * 0.5 * gap).to_array(), 0.3 * gap)];
            for spheres in [&spheres[..0], &spheres[..]] {
                let truth = traced(Vec3::ZERO, Vec3::Y, &light, spheres, 60);
                for (ours, policy) in all_policies(&[[0.0; 3]], &[light], spheres).iter().zip(POLICIES) {
                    println!("{distance} {centre:?} {} {policy:?}: {}", spheres.len(), ours[0] / truth);
                    // Relative; a lamp that is half set is a bell cut by the horizon, and with a shadow of half
                    // the light a cell of 5° is wide, all around it.
                    let tolerance = match (spheres.len(), policy) {
                        (0, _) => 0.05,
                        (_, Policy::Proportional) => 0.05,
                        _ => 0.13,
                    };
                    assert!((ours[0] / truth - 1.0).abs() < tolerance, "{distance} {} {truth}", ours[0]);
                }
            }
        }
    }
}

#[test]
fn more_blockers_never_give_more_light() {
    let mut random = Random(13);
    let positions = ground(10, 2.0);
    let lamps = [lamp([0.3, 4.0, 0.1], 0.7)];
    let mut spheres = Vec::new();
    let mut before: Vec<Vec<f32>> = POLICIES.map(|_| vec![f32::INFINITY; positions.len()]).into();
    let open = by_lobes(&positions, Vec3::Y, &lamps, &[], &Options::default());
    for n in [1usize, 3, 10, 30, 100, 300, 1000] {
        while spheres.len() < n {
            let place = random.direction() * (1.5 * random.unit()) as f32 + Vec3::Y * 2.0;
            spheres.push(Sphere { centre: place, radius: (0.02 + 0.2 * random.unit()) as f32 });
        }
        let now = all_policies(&positions, &lamps, &spheres);
        for (now, before) in now.iter().zip(&before) {
            for ((n, b), o) in now.iter().zip(before).zip(&open) {
                // Four leaves that become one take the same light away, within two percent of the open light.
                assert!(*n <= *b + 0.02 * o, "{n} after {b}, open {o}");
            }
        }
        before = now.into();
    }
}

#[test]
fn hundreds_of_overlapping_blockers_are_as_dark_as_one() {
    let one = [ball([0.0, 1.5, 0.0], 0.6)];
    let many: Vec<Sphere> = (0..500).map(|i| ball([0.0, 1.5, 0.0], 0.6 - 1e-4 * i as f32)).collect();
    let lamps = [lamp([0.0, 4.0, 0.0], 0.5)];
    let positions = ground(14, 1.5);
    let (one, many) = (all_policies(&positions, &lamps, &one), all_policies(&positions, &lamps, &many));
    assert_eq!(one, many);
}

#[test]
fn full_cover_is_dark_however_it_is_made() {
    // A lid of small spheres, each far smaller than the lamp, together hiding it.
    let mut lid = Vec::new();
    for i in -20..=20 {
        lid.extend((-20..=20).map(|j| ball([0.05 * i as f32, 1.0, 0.05 * j as f32], 0.06)));
    }
    let lamps = [lamp([0.0, 3.0, 0.0], 0.4)];
    let positions = ground(6, 0.2);
    let open = by_lobes(&positions, Vec3::Y, &lamps, &[], &Options::default());
    for light in all_policies(&positions, &lamps, &lid) {
        assert!(light.iter().zip(&open).all(|(e, o)| *e < 0.005 * o), "{light:?}");
    }
}

#[test]
fn lamps_hide_each_other() {
    // The nearer lamp covers the farther one: only its own light is left.
    let near = lamp([0.0, 2.0, 0.0], 0.5);
    let far = lamp([0.0, 4.0, 0.0], 0.5);
    let at = |lamps: &[Lamp]| by_lobes(&[[0.0; 3]], Vec3::Y, lamps, &[], &Options::default())[0];
    assert_eq!(at(&[near, far]), at(&[near]));
    assert_eq!(at(&[far, near]), at(&[near]));
    // Side by side and through each other, they give no more than the sum and no less than either.
    let through = lamp([0.4, 2.0, 0.0], 0.5);
    let both = at(&[near, through]);
    assert!(both < at(&[near]) + at(&[through]) && both > at(&[through]));
}

#[test]
fn colours_and_lamps_add_up() {
    let red = Lamp::new(Vec3::new(-2.0, 3.0, 0.0), 0.3, Vec3::X * 4.0).unwrap();
    let blue = Lamp::new(Vec3::new(2.0, 3.0, 0.0), 0.3, Vec3::Z * 2.0).unwrap();
    let points = crate::lobe::Points { position: &[[0.0; 3]], normal: &[[0.0, 1.0, 0.0]] };
    let mut light = [[1.0; 3]];
    let mut target = crate::lobe::Target { light: &mut light, products: None };
    let scene = crate::lobe::Scene { lamps: &[red, blue], blockers: &crate::lobe::Blockers::default() };
    let scratch = &mut crate::lobe::Scratch::default();
    crate::lobe::add_irradiance(&points, &scene, &Options::default(), scratch, &mut target);
    // Light is added to what is there; the lamps mirror each other.
    assert_eq!(light[0][1], 1.0);
    assert!(((light[0][0] - 1.0) / (light[0][2] - 1.0) - 2.0).abs() < 1e-5);
}

#[test]
fn products_are_finite_at_every_extreme() {
    let exponents = [0.0f32, 1e-6, 0.5, 1.0, 1e3, 1e5, 1e9];
    let angles =
        [0.0f32, 1e-6, 1e-3, 0.5, 1.57, std::f32::consts::FRAC_PI_2, 1.58, 3.0, 3.1, std::f32::consts::PI];
    for (&a, &b) in exponents.iter().flat_map(|a| exponents.iter().map(move |b| (a, b))) {
        let mut before = f32::INFINITY;
        for angle in angles {
            let one = Lobe { axis: Vec3::Z, exponent: a, scale: 1.0 };
            let two = Lobe { axis: Vec3::new(angle.sin(), 0.0, angle.cos()), exponent: b, scale: 1.0 };
            let both = product(&one, &two);
            assert!(
                both.axis.is_finite() && both.exponent.is_finite() && both.scale >= 0.0,
                "{a} {b} {angle}"
            );
            assert!(both.scale.is_finite(), "{a} {b} {angle}: {both:?}");
            let integral = product_integral(a, b, 1.0 - angle.cos());
            // Turning lobes apart never brightens; the fit may ripple by what it is off.
            assert!(integral >= 0.0 && integral <= before * 1.03 + 1e-12, "{a} {b} {angle}");
            before = integral;
        }
    }
    let two_hemispheres = product_integral(0.0, 0.0, 2.0);
    assert!(two_hemispheres < 1e-2, "{two_hemispheres}");
}

#[test]
fn bad_lamps_and_spheres_are_refused_in_one_line() {
    let lamp = |radius, radiance: Vec3, x| Lamp::new(Vec3::new(x, 0.0, 0.0), radius, radiance);
    for radius in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(lamp(radius, Vec3::ONE, 0.0), Err(Error::Radius(_))));
        assert!(matches!(SphereSet::new(vec![ball([0.0; 3], radius)]), Err(Error::Radius(_))));
    }
    assert!(matches!(lamp(1.0, Vec3::NEG_X, 0.0), Err(Error::NotANumber(_))));
    assert!(matches!(lamp(1.0, Vec3::NAN, 0.0), Err(Error::NotANumber(_))));
    assert!(matches!(lamp(1.0, Vec3::ONE, f32::NAN), Err(Error::NotANumber(_))));
    assert!(matches!(SphereSet::new(vec![ball([f32::NAN; 3], 1.0)]), Err(Error::NotANumber(_))));
    assert!(matches!(SphereSet::new(vec![]), Err(Error::NoSphere)));
    let options = Options { depth: 6, ..Options::default() };
    assert!(matches!(options.check(), Err(Error::Depth(6))));
    let options = Options { threshold: f32::NAN, ..Options::default() };
    assert!(matches!(options.check(), Err(Error::Threshold(_))));
    let errors = [Error::Radius(-1.0), Error::NoSphere, Error::Depth(9), Error::TooManySpheres(1 << 30)];
    assert!(errors.iter().all(|e| !e.to_string().contains('\n') && !e.to_string().is_empty()));
}
