use glam::Vec3;

use super::{Random, creature, ground, lamp};
use crate::lobe::lamp::cap_exponent;
use crate::lobe::leaves::{Leaves, Order};
use crate::lobe::mask::{Cone, Cover, MAX_DEPTH, Mask, Policy};
use crate::lobe::reflectance::{Reflectance, reflectance_lobes};
use crate::lobe::weights::weights;
use crate::lobe::{
    Blockers, Lamp, Motion, Options, Points, Scene, Scratch, SphereSet, Surface, Target, add_radiance,
};

const EYE: Vec3 = Vec3::new(0.5, 2.5, 4.0);

/// The visibility lobes of one point, in the cone's frame; `None` where all or nothing of the lamp is hidden.
struct Visibility {
    cone: Cone,
    leaves: Leaves,
    full: Leaves,
}

fn visibility(point: Vec3, light: &Lamp, blockers: &Blockers, policy: Policy) -> Result<Visibility, Cover> {
    let to = light.centre - point;
    let cone = Cone::new(point, to.normalize(), to.length(), light.radius);
    let mut mask = Mask::new(MAX_DEPTH, policy);
    let (mut leaves, mut full) = (Leaves::new(), Leaves::new());
    let mut cover = mask.draw(&cone, blockers, std::iter::empty());
    if cover == Cover::Partial {
        cover = leaves.collect(&mask, &cone, weights(), 0.0);
    }
    if cover != Cover::Partial {
        return Err(cover);
    }
    full.collect_full(&cone, weights());
    Ok(Visibility { cone, leaves, full })
}

/// Directions in a cone's frame that are distributed as a lobe about z.
fn directions(exponent: f32, random: &mut Random) -> Vec<Vec3> {
    let n = 44;
    let one = |k: usize, random: &mut Random| {
        let u = ((k / n) as f64 + random.unit()) / n as f64;
        let phi = std::f64::consts::TAU * ((k % n) as f64 + random.unit()) / n as f64;
        let z = u.powf(1.0 / (f64::from(exponent) + 1.0));
        let r = (1.0 - z * z).sqrt();
        Vec3::new((r * phi.cos()) as f32, (r * phi.sin()) as f32, z as f32)
    };
    (0..n * n).map(|k| one(k, random)).collect()
}

/// The sums of lobes that the frame stands for, integrated by sampling the lamp's lobe: reflectance times lamp times
/// (1 - leaves over the full mask).
fn sampled(point: Vec3, material: &Reflectance, light: &Lamp, blockers: &Blockers, policy: Policy) -> f32 {
    let mut random = Random(1 + u64::from(point.x.to_bits() ^ point.z.to_bits().rotate_left(16)));
    let to = light.centre - point;
    let sin = light.radius / to.length();
    let axis = to.normalize();
    let seen = visibility(point, light, blockers, policy);
    let mut total = 0.0;
    for (k, lobe) in
        reflectance_lobes(material, Vec3::Y, Vec3::X, (EYE - point).normalize()).iter().enumerate()
    {
        let (exponent, scale) = cap_exponent(sin * sin, lobe.exponent);
        let order = if k == 0 { Order::Tabulated } else { Order::Weighed { light: exponent } };
        let open = Cone::new(point, axis, to.length(), light.radius);
        let lobe_axis = open.local(lobe.axis);
        let value = |v: Vec3, axis: Vec3, exponent: f32| v.dot(axis).max(0.0).powf(exponent);
        let (leaves, full) = match &seen {
            Err(Cover::Dark) => continue,
            Err(_) => (Vec::new(), Vec::new()),
            Ok(seen) => {
                assert!(seen.cone.axis == axis);
                (seen.leaves.lobes(order), seen.full.lobes(order))
            }
        };
        let sum =
            |lobes: &[(Vec3, f32, f32)], v: Vec3| lobes.iter().map(|l| l.2 * value(v, l.0, l.1)).sum::<f32>();
        let (mut all, mut hidden, mut whole, mut n) = (0.0, 0.0, 0.0, 0.0);
        for v in directions(exponent, &mut random) {
            let f = value(v, lobe_axis, lobe.exponent);
            all += f;
            hidden += f * sum(&leaves, v);
            whole += f * sum(&full, v);
            n += 1.0;
        }
        let part: f32 = if whole > 0.0 { (1.0 - hidden / whole).clamp(0.0, 1.0) } else { 1.0 };
        total += lobe.scale.x * scale * std::f32::consts::TAU / (exponent + 1.0) * all / n * part;
    }
    total
}

#[test]
fn frames_follow_monte_carlo_of_their_own_sums_of_lobes() {
    let mut blockers = Blockers::default();
    blockers.push(&SphereSet::new(creature()).unwrap(), &Motion::default());
    let light = lamp([0.5, 3.0, -1.5], 0.5);
    // Of the paper's kind: a diffuse and a glossy lobe.
    let material = Reflectance::phong(Vec3::splat(0.25), Vec3::splat(0.6), 30.0);
    let positions = ground(24, 1.6);
    let n = positions.len();
    let surface = Surface { materials: &[material], material: &vec![0; n], tangent: &[], eye: EYE };
    let points = Points { position: &positions, normal: &vec![[0.0, 1.0, 0.0]; n] };
    let scene = Scene { lamps: &[light], blockers: &blockers };
    for policy in [Policy::Proportional, Policy::Aggressive] {
        let mut ours = vec![[0.0; 3]; n];
        let options = Options { policy, ..Options::default() };
        let mut target = Target { light: &mut ours, products: None };
        add_radiance(&points, &surface, &scene, &options, &mut Scratch::default(), &mut target);
        let truth: Vec<f32> =
            positions.iter().map(|&p| sampled(p.into(), &material, &light, &blockers, policy)).collect();
        let brightest = truth.iter().copied().fold(0.0, f32::max);
        let off: Vec<f32> =
            ours.iter().zip(&truth).map(|(a, b)| (a[0] - b).abs() * 0.70 / brightest).collect();
        let mean = off.iter().sum::<f32>() / n as f32;
        let most = off.iter().copied().fold(0.0, f32::max);
        println!("{policy:?}: mean difference {mean:.5}, largest {most:.4}, where the brightest is 0.70");
        // The paper's mean is 0.0039 and its largest 0.055. 1,936 stratified directions leave 5e-4.
        assert!(mean < 0.0039 && most < 0.055, "{policy:?}: {mean} {most}");
    }
}
