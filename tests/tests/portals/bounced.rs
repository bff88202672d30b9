//! Bounced light: one way against another, by energy, and the same bytes from any number of threads.

use std::f32::consts::PI;

use glam::Vec3;
use lunette_bake::{Basis, Options, PortalOptions, Start};
use lunette_relight::indirect::Indirect;
use lunette_tests::baked::light;
use lunette_tests::interior::{Interior, Window, bounced_options, built, lit, room_with};

/// So many that what is left out does not show: the ways do not end alike. Carried light goes on between near patches,
/// and photons on from the last hit.
const ALL_BOUNCES: usize = 24;

/// Relative difference by area, and that of the sums, which has a sign.
fn differences(interior: &Interior, a: &[Vec3], b: &[Vec3]) -> (f32, f32) {
    let area = interior.mesh().vertex_area();
    let sum = |f: &dyn Fn(usize) -> f32| (0..area.len()).map(|v| area[v] * f(v)).sum::<f32>();
    let total = sum(&|v| b[v].x);
    assert!(total > 0.0, "nothing to compare");
    (sum(&|v| (a[v] - b[v]).x.abs()) / total, sum(&|v| (a[v] - b[v]).x) / total)
}

#[test]
fn gathering_and_photons_agree() {
    let interior = room_with(Window::square(1.5), 8, 0.6);
    let bounced = |start, seed| {
        let options =
            Options { basis: vec![Basis::Sh], seed, bounces: ALL_BOUNCES, rays: 2048, ..bounced_options() };
        let asset = interior.baked(&options, &PortalOptions { start, ..PortalOptions::default() });
        lit(&asset, &light("cie-overcast"), Indirect::Sh).indirect
    };
    let gathered = [1, 2].map(|seed| bounced(Start::Gathering, seed));
    let photons = [3, 4].map(|seed| bounced(Start::Photons(200_000), seed));
    let (noise_g, _) = differences(&interior, &gathered[0], &gathered[1]);
    let (noise_p, _) = differences(&interior, &photons[0], &photons[1]);
    let (off, bias) = differences(&interior, &photons[0], &gathered[0]);
    // Beside the noise of both, as far as the bias goes.
    assert!(off < 0.03 + noise_g.hypot(noise_p), "{off}");
    // Vertices are half a metre apart, over which photons spread and gathered light is interpolated: found 0.048, and
    // 0.010 with vertices half as far apart.
    assert!(bias.abs() < 0.06, "{bias}");
}

#[test]
fn carried_light_agrees_with_ten_bands_under_a_uniform_sky() {
    let interior = room_with(Window::square(1.5), 8, 0.6);
    let options =
        Options { bounces: ALL_BOUNCES, rays: 2048, order: 10, indirect_order: 10, ..bounced_options() };
    let asset = interior.bake(&options);
    let [sh, carried] =
        [Indirect::Sh, Indirect::DirectToIndirect].map(|way| lit(&asset, &light("uniform"), way).indirect);
    let (off, bias) = differences(&interior, &carried, &sh);
    // Patches of four vertices, a metre wide, keep no pattern of light: found 0.048, 0.022 of it of one sign; 0.029 and
    // 0.013 with vertices half as far apart.
    assert!(off < 0.06, "{off}");
    assert!(bias.abs() < 0.03, "{bias}");
}

/// How far above and below white a furnace may be that has settled. Gathering knows direct light exactly and is left with
/// the noise of a thousand rays: found 0.987 to 1.013. What is carried starts from the mean of direct light over the
/// vertices of a patch, here a metre apart, where it falls steeply beside the window: found 0.998 to 1.050.
const FURNACES: [(Indirect, f32, f32); 2] =
    [(Indirect::Sh, 0.97, 1.03), (Indirect::DirectToIndirect, 0.97, 1.08)];

#[test]
fn white_room_with_a_window_is_a_furnace() {
    // Light that comes in from everywhere fills white walls to the radiance of the sky, and no bounce goes beyond it.
    let interior = room_with(Window::WALL, 5, 1.0);
    for (bounces, settled) in [(1, false), (4, false), (60, true)] {
        let asset = interior.bake(&Options { bounces, rays: 4096, ..bounced_options() });
        for (way, least, most) in FURNACES {
            let e: Vec<f32> =
                lit(&asset, &light("uniform"), way).total().into_iter().map(|e| e.x / PI).collect();
            let (low, high) = e.iter().fold((f32::MAX, 0.0f32), |(l, h), e| (l.min(*e), h.max(*e)));
            assert!(high < most, "{bounces} bounces, {way:?}: {high}");
            assert!(!settled || low > least, "{bounces} bounces, {way:?}: {low}");
            assert!(settled || low < 0.9, "{bounces} bounces are too few to fill the room, {way:?}: {low}");
        }
    }
}

#[test]
fn no_more_light_is_bounced_than_surfaces_throw_back() {
    // All light that bounces was direct first: each bounce keeps at most the albedo, so that what arrives by bounces,
    // times area, is at most ρ / (1 - ρ) of what arrives straight.
    for albedo in [0.0, 0.3, 0.8] {
        let interior = room_with(Window::square(1.5), 6, albedo);
        let asset = interior.bake(&Options { bounces: 40, ..bounced_options() });
        let area = interior.mesh().vertex_area();
        for way in [Indirect::Sh, Indirect::DirectToIndirect] {
            for spec in ["uniform", "cap:0.1,0.5,-1,0.15,20"] {
                let lit = lit(&asset, &light(spec), way);
                let sum = |list: &[Vec3]| list.iter().zip(&area).map(|(e, a)| e.x * a).sum::<f32>();
                let (direct, indirect) = (sum(&lit.direct), sum(&lit.indirect));
                let most = albedo / (1.0 - albedo) * direct;
                assert!(direct > 0.0);
                assert!(indirect <= 1.02 * most, "{albedo} {way:?} {spec}: {indirect} of at most {most}");
                assert!(indirect >= 0.5 * most, "{albedo} {way:?} {spec}: {indirect} of {most}");
            }
        }
    }
}

#[test]
fn portal_bytes_do_not_depend_on_the_number_of_threads() {
    let room = built("box-room:edge=0.9");
    let bytes = |threads, seed| {
        let options = Options { threads, seed, bounces: 2, rays: 128, ..bounced_options() };
        room.bake(&options).to_bytes().expect("an asset")
    };
    let one = bytes(1, 1);
    assert!(bytes(3, 1) == one, "three threads give other bytes than one");
    assert!(bytes(3, 2) != one, "the seed does nothing");
}
