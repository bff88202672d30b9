use glam::Vec3;

use super::{ground, hit};
use crate::light::Cap;
use crate::lobe::{Blockers, Motion, Options, Scratch, Sphere, SphereSet, Sun};

fn disc(axis: Vec3, radius: f32) -> Cap {
    Cap { axis: axis.normalize(), radius, radiance: Vec3::ONE }
}

const WITHIN: Sphere = Sphere { centre: Vec3::ZERO, radius: 20.0 };

fn parts(disc: &Cap, spheres: &[Sphere], position: &[[f32; 3]]) -> Vec<f32> {
    let mut blockers = Blockers::default();
    blockers.push(&SphereSet::new(spheres.to_vec()).unwrap(), &Motion::default());
    let mut scratch = Scratch::default();
    let sun = Sun::new(disc, WITHIN, &mut scratch).unwrap();
    let mut out = vec![f32::NAN; position.len()];
    sun.visible_part(position, &blockers, &Options::default(), &mut scratch, &mut out);
    out
}

/// The part of the disc that parallel light sees past the spheres: n × 4n rays in equal-area coordinates.
fn traced(disc: &Cap, spheres: &[Sphere], point: Vec3) -> f32 {
    let n = 24;
    let (across, up) = disc.axis.any_orthonormal_pair();
    let versine = 2.0 * (0.5 * disc.radius).sin().powi(2);
    let clear = (0..4 * n * n).filter(|k| {
        let drop = versine * ((k % n) as f32 + 0.5) / n as f32;
        let (s, c) = (std::f32::consts::TAU * ((k / n) as f32 + 0.5) / (4 * n) as f32).sin_cos();
        let r = (drop * (2.0 - drop)).sqrt();
        let direction = disc.axis * (1.0 - drop) + (across * c + up * s) * r;
        !spheres.iter().any(|s| hit(point, direction, s).is_some())
    });
    clear.count() as f32 / (4 * n * n) as f32
}

#[test]
fn sun_past_spheres_follows_rays() {
    let spheres = [
        Sphere { centre: Vec3::new(0.0, 2.0, 0.0), radius: 0.6 },
        Sphere { centre: Vec3::new(0.7, 2.5, 0.2), radius: 0.5 },
    ];
    let position = ground(40, 3.0);
    for radius in [0.004_653f32, 0.1, 0.5] {
        let disc = disc(Vec3::new(0.3, 1.0, 0.2), radius);
        let ours = parts(&disc, &spheres, &position);
        let (mut off, mut shadowed) = (0.0, 0);
        for (&p, ours) in position.iter().zip(&ours) {
            let truth = traced(&disc, &spheres, p.into());
            assert!((0.0..=1.0).contains(ours));
            off += (ours - truth).abs();
            shadowed += usize::from(truth < 1.0);
        }
        let off = off / shadowed as f32;
        println!("radius {radius}: {shadowed} points in shadow, {off:.4} of the disc off on average");
        // Of the whole disc, over the shadow alone: a part of a cell of the mask, and the bell that stands for the
        // disc. A cosine that varies over a disc of 0.5 rad weighs its middle more than these rays do.
        assert!(shadowed > 20 && off < if radius > 0.3 { 0.02 } else { 0.01 }, "{radius}: {off}");
    }
}

#[test]
fn sun_is_whole_without_blockers_and_gone_behind_a_wall() {
    let position = ground(10, 10.0);
    let far = [Sphere { centre: Vec3::new(0.0, -8.0, 0.0), radius: 1.0 }];
    let disc = disc(Vec3::Y, 0.004_653);
    assert!(parts(&disc, &far, &position).iter().all(|p| (p - 1.0).abs() < 1e-4));
    let wall = [Sphere { centre: Vec3::new(0.0, 60.0, 0.0), radius: 55.0 }];
    assert!(parts(&disc, &wall, &position).iter().all(|p| *p == 0.0));
}

#[test]
fn discs_that_are_no_sun_are_left_alone() {
    let mut scratch = Scratch::default();
    assert!(Sun::new(&disc(Vec3::Y, 1.2), WITHIN, &mut scratch).is_none());
    assert!(Sun::new(&disc(Vec3::Y, f32::NAN), WITHIN, &mut scratch).is_none());
    let dark = Cap { radiance: Vec3::ZERO, ..disc(Vec3::Y, 0.1) };
    assert!(Sun::new(&dark, WITHIN, &mut scratch).is_none());
    let endless = Sphere { centre: Vec3::ZERO, radius: f32::INFINITY };
    assert!(Sun::new(&disc(Vec3::Y, 0.1), endless, &mut scratch).is_none());
}
