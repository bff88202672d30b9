use super::*;

/// A grey sky with a sun of four pixels.
fn sunny_picture() -> Equirect {
    let (width, height) = (256, 128);
    let mut pixels = vec![[1.0; 3]; width * height];
    for (column, row) in [(200, 30), (201, 30), (200, 31), (201, 31)] {
        pixels[row * width + column] = [20_000.0, 15_000.0, 10_000.0];
    }
    Equirect::new(width, height, pixels).expect("a good picture")
}

#[test]
fn sun_in_a_picture_becomes_a_cap_of_its_energy() {
    let image = sunny_picture().rotated(some_turn()).scaled(0.5);
    let mut caps = Vec::new();
    let smooth = split(&Light::new(Source::Equirect(image.clone())), &mut caps);
    assert_eq!(caps.len(), 1);
    let sun = caps[0];
    assert!(sun.axis.abs_diff_eq(image.direction(201.0 / 256.0, 31.0 / 128.0), 2e-3), "{}", sun.axis);
    // Four pixels of (π/128)² sin θ sr at 0.5 × 20,000.
    let pixel = (PI / 128.0).powi(2) * (PI * 31.0 / 128.0).sin();
    assert!((sun.solid_angle() / (4.0 * pixel) - 1.0).abs() < 1e-3);
    assert!((sun.radiance.x / 10_000.0 - 1.0).abs() < 1e-3 && (sun.radiance.z / 5_000.0 - 1.0).abs() < 1e-3);
    // What is left is 0.5 everywhere but for four pixels as bright as the picture's mean.
    assert!((smooth[0][0] / (0.5 * (4.0 * PI).sqrt()) - 1.0).abs() < 1e-3, "{:?}", smooth[0]);
    assert!(smooth[1..].iter().flatten().all(|c| c.abs() < 3e-3), "{smooth:?}");
}

#[test]
fn spots_and_rest_add_up_to_the_picture() {
    let light = Light::new(Source::Equirect(sunny_picture()));
    let mut caps = Vec::new();
    let mut sum = split(&light, &mut caps);
    for cap in &caps {
        project_source_sh(&Source::Cap(*cap), SMOOTH_ORDER, &mut sum);
    }
    let mut whole = [[0.0; 3]; 9];
    project_sh(&light, SMOOTH_ORDER, &mut whole);
    for (a, b) in sum.as_flattened().iter().zip(whole.as_flattened()) {
        // A square of pixels against a round disc: the second band tells them apart a little.
        assert!((a - b).abs() < 2e-3 * whole[0][0], "{a} against {b}");
    }
}

#[test]
fn light_with_spots_as_discs_is_the_light_to_a_cubemap() {
    let image = sunny_picture().rotated(some_turn()).scaled(0.5);
    let light = Light { sources: vec![Source::Equirect(image), Source::Uniform(Vec3::ONE)] };
    let apart = light.with_spots_as_discs();
    assert_eq!(apart.discs().count(), 1);
    const N: usize = 8;
    let texels = |light: &Light| {
        let mut texels = vec![[0.0; 3]; crate::cubemap::n_texels(N)];
        crate::cubemap::project_light(light, N, &mut texels);
        texels
    };
    let (whole, sum) = (texels(&light), texels(&apart));
    let brightest = whole.iter().map(|t| t[0]).fold(0.0, f32::max);
    assert!(brightest > 50.0, "{brightest}");
    let mut off = 0.0;
    for (a, b) in whole.iter().zip(&sum) {
        // A square of pixels against a round disc, both cut in two by an edge of texels.
        assert!((a[0] - b[0]).abs() < 0.15 * brightest, "{a:?} {b:?}");
        off += a[0] - b[0];
    }
    // What one texel lacks the other has.
    assert!(off.abs() < 0.01 * brightest, "{off}");
    assert_eq!(apart.with_spots_as_discs().discs().count(), 1, "once is enough");
}

#[test]
fn smooth_picture_has_no_spots() {
    let mut caps = vec![Cap { axis: Vec3::Y, radius: 1.0, radiance: Vec3::ONE }];
    split(&Light::new(Source::Equirect(colourful(64, 32))), &mut caps);
    assert!(caps.is_empty(), "and caps of the frame before are gone");
}

#[test]
fn all_of_a_light_is_in_its_parts() {
    let light = Light {
        sources: vec![
            Source::Uniform(Vec3::splat(0.2)),
            Source::Sky(Sky::new(1.0, 0.8, 3.0).expect("in range")),
            Source::Cap(Cap { axis: Vec3::X, radius: 0.4, radiance: Vec3::ONE }),
            Source::CieOvercast(CieOvercast::new(Vec3::ONE)),
        ],
    };
    let mut caps = Vec::new();
    let mut sum = split(&light, &mut caps);
    assert_eq!(caps.len(), 2, "the sun and the cap");
    for cap in &caps {
        project_source_sh(&Source::Cap(*cap), SMOOTH_ORDER, &mut sum);
    }
    let mut whole = [[0.0; 3]; 9];
    project_sh(&light, SMOOTH_ORDER, &mut whole);
    for (a, b) in sum.as_flattened().iter().zip(whole.as_flattened()) {
        // The same sums in another order.
        assert!((a - b).abs() < 1e-5 * whole[0][0], "{a} against {b}");
    }
}
