use super::*;

fn luminance(v: Vec3) -> f32 {
    v.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Horizontal irradiance of the dome and irradiance of the sun at normal incidence, luminous, in lux.
fn lux(degrees: f32, turbidity: f32) -> (f32, f32) {
    let sky = Sky::new(0.7, degrees.to_radians(), turbidity).expect("in range");
    let mut smooth = [[0.0; 3]; 9];
    super::super::project::add_dome(&sky, 3, &mut smooth);
    let sun = sky.sun_above_horizon().map_or(0.0, |sun| luminance(sun.radiance) * sun.solid_angle());
    (683.0 * luminance(crate::bent::smooth_irradiance(&smooth, Vec3::Y)), 683.0 * sun)
}

#[test]
fn clear_day_has_the_illuminances_of_the_handbooks() {
    // Clear sky with the sun at 45 degrees: 10 to 20 klx from the dome, 75 to 100 klx from the sun. That both
    // hold in the same unit says that the model's RGB and the sun's spectrum are on one scale.
    for turbidity in [2.0, 3.0] {
        let (dome, sun) = lux(45.0, turbidity);
        assert!((10e3..20e3).contains(&dome), "turbidity {turbidity}: dome {dome} lx");
        assert!((75e3..100e3).contains(&sun), "turbidity {turbidity}: sun {sun} lx");
    }
}

#[test]
fn haze_moves_light_from_sun_to_dome() {
    let (clear, hazy) = (lux(40.0, 2.0), lux(40.0, 8.0));
    assert!(hazy.0 > clear.0 && hazy.1 < 0.6 * clear.1, "{clear:?} {hazy:?}");
}

#[test]
fn twilight_fades_smoothly_to_night() {
    let mut before = lux(1.0, 3.0).0;
    for step in 0..=40 {
        let degrees = 0.5 - 0.5 * step as f32;
        let (dome, _) = lux(degrees, 3.0);
        assert!(
            dome <= before && dome >= 0.25 * before * f32::from(degrees > -16.0),
            "{degrees}: {before} to {dome} lx"
        );
        before = dome;
    }
    assert_eq!(lux(-18.1, 3.0), (0.0, 0.0));
    assert!((1.0..40.0).contains(&lux(-6.0, 3.0).0), "civil twilight ends at a few lux");
}

#[test]
fn sunset_cuts_the_disc() {
    let sun = |degrees: f32| Sky::new(0.0, degrees.to_radians(), 3.0).expect("in range");
    let whole = sun(1.0).sun_above_horizon().expect("up");
    assert!((luminance(whole.radiance) / luminance(sun(1.0).sun().expect("up").radiance) - 1.0).abs() < 1e-6);
    let half = sun(0.0);
    let visible = luminance(half.sun_above_horizon().expect("half up").radiance)
        / luminance(half.sun().expect("up").radiance);
    // Half a small disc: the horizon is straight to 1e-3 over its width.
    assert!((visible - 0.5).abs() < 1e-3, "{visible}");
    assert!(sun(-0.3).sun().is_none() && sun(-0.3).sun_above_horizon().is_none());
    let just_below = compass_direction(0.0, -1e-4);
    assert_eq!(half.radiance(just_below), Vec3::ZERO, "nothing shines from below the horizon");
}

#[test]
fn sky_is_finite_and_not_negative_everywhere() {
    for degrees in [-17.0_f32, -1.0, 0.0, 0.5, 3.0, 30.0, 90.0] {
        for turbidity in [1.0, 2.5, 10.0] {
            let sky = Sky::new(-2.0, degrees.to_radians(), turbidity).expect("in range");
            for d in directions(2000).chain([Vec3::Y, sky.sun().map_or(Vec3::X, |s| s.axis)]) {
                let l = sky.radiance(d);
                assert!(
                    l.is_finite() && l.min_element() >= 0.0,
                    "{degrees} degrees, turbidity {turbidity}, {d}: {l}"
                );
            }
        }
    }
}

#[test]
fn sky_refuses_what_its_model_does_not_cover() {
    use super::super::sky::SkyError;
    assert_eq!(Sky::new(0.0, 1.6, 3.0).unwrap_err(), SkyError::Elevation(1.6));
    assert_eq!(Sky::new(0.0, 1.0, 0.9).unwrap_err(), SkyError::Turbidity(0.9));
    assert!(matches!(Sky::new(f32::NAN, 1.0, 3.0), Err(SkyError::Azimuth(_))));
    assert!(matches!(Sky::new(0.0, f32::NAN, 3.0), Err(SkyError::Elevation(_))));
    assert!(matches!(Sky::new(0.0, 1.0, f32::NAN), Err(SkyError::Turbidity(_))));
    assert_eq!(Sky::over_ground(0.0, 1.0, 3.0, 1.5).unwrap_err(), SkyError::GroundAlbedo(1.5));
}

#[test]
fn dome_is_that_of_the_model() {
    use hw_skymodel::rgb::{Channel, SkyParams, SkyState};

    for (elevation, turbidity) in [(0.9, 3.0), (0.2, 7.3), (0.0, 1.0)] {
        let sky = Sky::new(0.7, elevation, turbidity).unwrap();
        let albedo = [crate::light::sky::DEFAULT_GROUND_ALBEDO; 3];
        let model = SkyState::new(&SkyParams { elevation, turbidity, albedo }).unwrap();
        let sun = compass_direction(0.7, elevation);
        for d in directions(500).filter(|d| d.y > 1e-3) {
            let channel = |c| model.radiance(d.y.acos(), d.angle_between(sun), c).max(0.0);
            let expected = Vec3::new(channel(Channel::R), channel(Channel::G), channel(Channel::B));
            let found = sky.dome_radiance(d);
            // cos(acos y) costs digits near the zenith and the horizon.
            assert!(
                (found - expected).abs().max_element() < 1e-4 * expected.max_element(),
                "{found} {expected}"
            );
        }
    }
}
