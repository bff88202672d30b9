use super::*;

fn parse(spec: &str) -> Result<Light, ParseError> {
    let mut load = |path: &std::path::Path| match path.to_str() {
        Some("sky+sun.exr" | "C:/a b.HDR") => Ok(colourful(12, 6)),
        _ => Err(format!("{} cannot be read", path.display())),
    };
    Light::parse(spec, &mut ParseContext::new(&mut load))
}

fn error(spec: &str) -> (usize, String) {
    let error = parse(spec).expect_err(spec);
    let line = error.to_string();
    assert!(!line.contains('\n'), "one line: {line}");
    assert!(line.contains(&format!("column {}", error.column)), "{line}");
    (error.column, line)
}

#[test]
fn every_form_of_light_parses() {
    let d = Vec3::new(0.0, 1.0, 0.0);
    assert_eq!(parse("uniform").unwrap().radiance(d), Vec3::ONE);
    assert_eq!(parse("uniform:2").unwrap().radiance(d), Vec3::splat(2.0));
    assert_eq!(parse(" uniform: 1, 2 ,3 ").unwrap().radiance(d), Vec3::new(1.0, 2.0, 3.0));
    assert_eq!(parse("cie-overcast").unwrap().radiance(d), Vec3::ONE);
    assert_eq!(parse("cie-overcast:5").unwrap().radiance(d), Vec3::splat(5.0));
    assert_eq!(parse("cap:0,3,0,0.1,4").unwrap().radiance(d), Vec3::splat(4.0));
    assert_eq!(parse("cap:0,1e15,0,3.1415926535,4,5,6").unwrap().radiance(d), Vec3::new(4.0, 5.0, 6.0));
    assert!(parse("sky:180,30").unwrap().radiance(d).min_element() > 0.0);
    assert!(parse("sky:-90,-5,10").unwrap().radiance(d).min_element() > 0.0);
    assert_eq!(parse("uniform + cie-overcast + cap:0,1,0,1,1").unwrap().radiance(d), Vec3::splat(3.0));
}

#[test]
fn sky_azimuth_is_clockwise_from_north() {
    let light = parse("sky:90,20").unwrap();
    let east = compass_direction(90.0_f32.to_radians(), 20.0_f32.to_radians());
    assert!(east.abs_diff_eq(Vec3::new(20.0_f32.to_radians().cos(), 20.0_f32.to_radians().sin(), 0.0), 1e-6));
    // The disc is thousands of times brighter than any dome.
    assert!(light.radiance(east).x > 1e5 && light.radiance(east * Vec3::new(-1.0, 1.0, 1.0)).x < 1e3);
}

#[test]
fn picture_names_may_hold_a_plus_and_options() {
    let plain = parse("sky+sun.exr").unwrap();
    let sum = parse("sky+sun.exr + uniform").unwrap();
    let east = compass_direction(1.8, 0.1);
    assert_eq!(sum.radiance(east), plain.radiance(east) + Vec3::ONE);

    // A quarter turn clockwise brings north to the east.
    let turned = parse("C:/a b.HDR:rotate=90, scale=2").unwrap();
    for azimuth in [0.3, 1.3, 2.3, 4.0] {
        let at = |azimuth| compass_direction(azimuth, 0.1);
        assert_eq!(turned.radiance(at(azimuth + FRAC_PI_2)), 2.0 * plain.radiance(at(azimuth)));
    }
}

#[test]
fn lamps_are_caps_seen_from_the_centre() {
    let mut load = |_: &std::path::Path| Err(String::new());
    let mut context = ParseContext { centre: Vec3::X, ..ParseContext::new(&mut load) };
    let light = Light::parse(
        "point:1,10,0,1,5 + spot:1,0,20,1,0,0,30,1,3 + spot:1,0,-20,1,0,-40,30,1,3",
        &mut context,
    )
    .expect("good lamps");
    assert_eq!(context.nearest_lamp, 10.0);
    assert_eq!(light.sources.len(), 2, "the last spot shines away from the scene");
    let Source::Cap(point) = &light.sources[0] else { panic!("a cap") };
    assert!(point.axis.abs_diff_eq(Vec3::Y, 1e-6) && (point.radius - 0.1_f32.asin()).abs() < 1e-6);
    assert_eq!(light.radiance(Vec3::Z), Vec3::splat(3.0));
}

#[test]
fn spots_fade_towards_their_edge() {
    let brightness = |target_x: f32| {
        let light = parse(&format!("spot:0,0,20,{target_x},0,0,45,1,1")).unwrap();
        light.radiance(Vec3::Z).x
    };
    let off_axis = |degrees: f32| 20.0 * degrees.to_radians().tan();
    assert_eq!(brightness(off_axis(30.0)), 1.0);
    // Half-way between the core's end (36 degrees) and the edge (45).
    assert!((brightness(off_axis(40.5)) - 0.5).abs() < 1e-3);
    assert_eq!(brightness(off_axis(46.0)), 0.0);
}

#[test]
fn errors_point_at_the_place() {
    assert_eq!(error("cap:0,1,0,x,3").0, 11);
    assert_eq!(
        error("cap:0,1,0,x,3").1,
        "light, column 11: radius \"x\" is not a number (in \"cap:0,1,0,x,3\")"
    );
    assert_eq!(error("uniform + sun:1").0, 11);
    assert_eq!(error("uniform + ").0, 11);
    assert_eq!(error("").0, 1);
    assert_eq!(error("uniform + sky:10,95").0, 18);
    assert_eq!(error("sky:10,20,0.5").0, 11);
    assert_eq!(error("uniform + lost.exr").0, 11);
    assert_eq!(error("sky+sun.exr:rotate=1,tint=3").0, 22);
    assert!(error("uniform:1+cie-overcast").1.contains("spaces around the +"));
    assert!(error("uniform\n:\u{1}x").1.contains("\\n"), "control characters are shown escaped");
}

#[test]
fn absurd_numbers_are_refused() {
    for spec in [
        "uniform:-1",
        "uniform:nan",
        "uniform:inf",
        "uniform:1e999",
        "uniform:1e13",
        "uniform:",
        "uniform:1,2",
        "cie-overcast:-0.1",
        "cap:0,0,0,1,1",
        "cap:0,1,0,0,1",
        "cap:0,1,0,-1,1",
        "cap:0,1,0,3.2,1",
        "cap:0,1,0,1",
        "cap:0,1,0,1,1,1",
        "cap:0,1e300,0,1,1",
        "point:0,0,0,1,1",
        "point:0,5,0,-1,1",
        "point:0,0.5,0,1,1",
        "spot:0,5,0,0,5,0,30,1,1",
        "spot:0,5,0,0,0,0,0,1,1",
        "sky:400,10",
        "sky:10",
        "sky:0,90.1",
        "sky:0,10,11",
        "sky:0,nan",
        "sky+sun.exr:scale=-1",
        "sky+sun.exr:scale",
        "sky+sun.exr:",
    ] {
        error(spec);
    }
}

proptest::proptest! {
    #[test]
    fn any_text_parses_or_explains(spec in "[a-z0-9:,+ .é=\\-]{0,40}") {
        if let Err(error) = parse(&spec) {
            proptest::prop_assert!(!error.to_string().contains('\n'));
            proptest::prop_assert!(error.column <= spec.chars().count() + 1);
        }
    }
}
