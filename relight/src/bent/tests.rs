use std::f32::consts::PI;

use super::*;
use crate::light::{CieOvercast, Light, Sky, Source, split};

fn open(light: &Light, normal: Vec3) -> Vec3 {
    let mut caps = Vec::new();
    let smooth = split(light, &mut caps);
    open_irradiance(&BentLight { caps: &caps, smooth: &smooth }, normal)
}

#[test]
fn open_plane_under_uniform_sky_gives_pi() {
    let light = Light::new(Source::Uniform(Vec3::new(1.0, 2.0, 3.0)));
    for normal in [Vec3::Y, Vec3::NEG_X, Vec3::new(1.0, 2.0, -2.0) / 3.0] {
        let e = open(&light, normal);
        // f32 rounding of nine coefficients.
        assert!((e / PI - Vec3::new(1.0, 2.0, 3.0)).abs().max_element() < 1e-5, "{e}");
    }
}

#[test]
fn open_plane_under_overcast_sky_gives_seven_ninths_of_pi() {
    let e = open(&Light::new(Source::CieOvercast(CieOvercast::new(Vec3::ONE))), Vec3::Y).x;
    // ∫ (1 + 2 sin γ)/3 sin γ dω = 7π/9 exactly; order 3 leaves out bands from 4 on, which hold 1 %.
    assert!((e / (7.0 / 9.0 * PI) - 1.0).abs() < 0.015, "{e}");
}

#[test]
fn occlusion_scales_and_a_blind_vertex_is_black() {
    let cap = Cap { axis: Vec3::Y, radius: 0.5, radiance: Vec3::ONE };
    let smooth = [[0.0; 3]; 9];
    let light = BentLight { caps: &[cap], smooth: &smooth };
    let mut out = [[f32::NAN; 3]; 3];
    irradiance(&[1.0, 0.25, 0.0], &[[0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]], &light, &mut out);
    let exact = PI * 0.5_f32.sin().powi(2);
    assert!((out[0][0] / exact - 1.0).abs() < 1e-6);
    assert_eq!(out[1][0], 0.25 * out[0][0]);
    assert_eq!(out[2], [0.0; 3]);
}

#[test]
fn sun_of_a_sky_shines_through_its_closed_form() {
    let sky = Sky::new(0.3, 0.7, 3.0).expect("in range");
    let sun = sky.sun().expect("by day");
    let light = Light::new(Source::Sky(sky));
    let (facing, away) = (open(&light, sun.axis), open(&light, -sun.axis));
    let alone = sun.radiance * cap_irradiance(&sun, sun.axis);
    assert!(facing.y > alone.y, "the dome adds to the sun");
    assert!(away.y < 0.1 * alone.y, "and no sun reaches the other side");
}
