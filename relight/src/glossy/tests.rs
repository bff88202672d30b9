use super::*;
use crate::asset::{Data, Metadata, NO_PATCH};
use crate::cubemap;
use crate::light::{Cap, Light, Source};
use crate::shell::Shell;
use crate::sparse::{Basis, Choice, Encoder, Encoding, RowStore};
use glam::Vec2;
use std::borrow::Cow;

const N: usize = 32;
/// Vertices of the asset; the middle one is glossy.
const V: usize = 3;

/// Three open vertices of albedo 1/2 that look up, one of them glossy; its row is in the basis asked for.
fn open(specular: f32, exponent: f32, basis: Basis) -> Asset<'static> {
    let mut asset = Asset::new(Metadata::new("open"));
    let triples = |v: [[f32; 3]; V]| Data::F32(Cow::Owned(v.concat()));
    asset.insert("mesh.position", &[V, 3], triples([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]));
    asset.insert("mesh.normal", &[V, 3], triples([[0.0, 1.0, 0.0]; V]));
    asset.insert("mesh.albedo", &[V, 3], triples([[0.5; 3]; V]));
    asset.insert("mesh.index", &[1, 3], Data::U32(Cow::Owned(vec![0, 1, 2])));
    let texel = |t: usize| {
        // Sixteen points per texel: the horizon cuts those of the side faces along their border.
        let point = |i: usize| {
            let within = Vec2::new((i % 4) as f32 + 0.5, (i / 4) as f32 + 0.5) / 4.0;
            let (d, solid_angle) = cubemap::sample(N, t, within);
            d.y.max(0.0) * solid_angle / 16.0
        };
        (0..16).map(point).sum::<f32>()
    };
    let row: Vec<f32> = (0..n_texels(N)).map(texel).collect();
    let mut encoder = Encoder::new(N, Encoding { tolerance: 0.002, choice: Choice::Only(basis) });
    let mut store = RowStore::default();
    (0..V).for_each(|_| store.push(&encoder.encode(&row)));
    store.insert_into(&mut asset, "portal.0.direct", N).unwrap();
    asset.metadata.shells.push(crate::asset::Shell { name: "window".into(), ..Default::default() });
    asset.insert("glossy.vertex", &[1], Data::U32(Cow::Owned(vec![1])));
    let lobe = vec![specular, 0.5 * specular, 0.0, exponent];
    asset.insert("glossy.lobe", &[1, 4], Data::F32(Cow::Owned(lobe)));
    asset
}

/// Adds what the glossy vertex sees: all of the upper hemisphere is patch 0, and vertices 0 and 2 are of it.
fn add_seen(asset: &mut Asset<'static>) {
    let all: Vec<usize> = (0..n_texels(DIRECTION_SIDE))
        .filter(|&t| cubemap::direction(DIRECTION_SIDE, t, Vec2::splat(0.5)).y > 0.0)
        .step_by(11)
        .collect();
    let cosine = |t: &usize| cubemap::direction(DIRECTION_SIDE, *t, Vec2::splat(0.5)).y;
    let weight: Vec<f32> =
        all.iter().map(|t| 11.0 * cubemap::solid_angle(DIRECTION_SIDE, *t) * cosine(t)).collect();
    let n = all.len();
    asset.insert("glossy.patch", &[V], Data::U16(Cow::Owned(vec![0, NO_PATCH, 0])));
    asset.insert_scaled("glossy.share", &[V], &[0.75, 1.0, 0.25]);
    asset.insert("glossy.start", &[2], Data::U32(Cow::Owned(vec![0, n as u32])));
    asset.insert("glossy.source", &[n], Data::U16(Cow::Owned(vec![0; n])));
    let direction = all.iter().map(|t| *t as u16).collect();
    asset.insert("glossy.direction", &[n], Data::U16(Cow::Owned(direction)));
    asset.insert_scaled("glossy.weight", &[n], &weight);
}

/// What the glossy vertex sends to an eye at `tilt` radians from its normal, under a shell of radiance (1, 1, 1) and
/// this irradiance of all vertices.
fn sent(asset: &Asset, tilt: f32, irradiance: f32) -> Vec3 {
    let mut frame = PortalFrame::new(asset).unwrap();
    let texels = vec![[1.0; 3]; n_texels(N)];
    frame.set_shell(0, Shell::new(N, &texels).unwrap()).unwrap();
    let mut glossy = Glossy::open(asset).unwrap().unwrap();
    glossy.project(&frame, &[[irradiance; 3]; V]);
    let mut out = [[0.0; 3]];
    glossy.radiance([1.0 + 3.0 * tilt.sin(), 3.0 * tilt.cos(), 0.0], 0, &mut out);
    Vec3::from(out[0])
}

#[test]
fn open_vertex_in_a_furnace_sends_its_specular_reflectance_straight_up() {
    for basis in [Basis::Pulse, Basis::Columns, Basis::Haar] {
        for exponent in [0.0, 1.0, 10.0, 12.5, HIGHEST_EXPONENT] {
            let found = sent(&open(0.8, exponent, basis), 0.0, 0.0);
            // Texels of 0.05 radians under a lobe that halves within 0.19 at the highest exponent: 0.2 %; rows are
            // stored to 0.2 %.
            let expected = Vec3::new(0.8, 0.4, 0.0);
            assert!((found - expected).abs().max_element() < 0.004, "{basis:?} {exponent}: {found}");
        }
    }
}

#[test]
fn linear_lobe_in_a_furnace_has_its_closed_form_from_every_side() {
    // ∫ max(r·ω, 0) max(n·ω, 0) dω = 2/3 (sin t + (π - t) cos t) for unit vectors t apart.
    for tilt in [0.0f32, 0.4, 0.9, 1.3, 1.55] {
        let expected = 3.0 / (2.0 * PI) * (2.0 / 3.0) * (tilt.sin() + (PI - tilt) * tilt.cos());
        let found = sent(&open(1.0, 1.0, Basis::Pulse), tilt, 0.0).x;
        assert!((found - expected).abs() < 0.003, "{tilt}: {found} {expected}");
    }
}

#[test]
fn no_lobe_sends_more_than_falls_in() {
    for exponent in [0.0, 3.0, 17.5, HIGHEST_EXPONENT] {
        for tilt in 0..16 {
            let found = sent(&open(1.0, exponent, Basis::Pulse), 0.1 * tilt as f32, 0.0).x;
            assert!(found < 1.003, "{exponent} {tilt}: {found}");
        }
    }
}

#[test]
fn bounced_light_is_what_the_patches_send_out() {
    let mut asset = open(0.8, 10.0, Basis::Pulse);
    let dark = sent(&asset, 0.3, 2.0);
    add_seen(&mut asset);
    asset.to_bytes().expect("good tensors");
    // All around is a patch of albedo 1/2 under irradiance 2: radiance 1 / π beside the shell's 1.
    let found = sent(&asset, 0.3, 2.0);
    // One direction in eleven stands for its neighbours.
    assert!((found / dark - (1.0 + 1.0 / PI)).truncate().abs().max_element() < 0.003, "{found} {dark}");
    assert_eq!(sent(&asset, 0.3, 0.0), dark);
    let glossy = Glossy::open(&asset).unwrap().unwrap();
    let entries = asset.tensor("glossy.source").unwrap().data.len() as f32;
    assert_eq!(glossy.entries_per_vertex().1, entries);
    assert_eq!(glossy.bytes_per_vertex(), 20.0 + 6.0 * entries + 2.0 * 4.0 + 3.0 * 4.0);
}

#[test]
fn parts_of_the_vertices_may_be_asked_for() {
    let asset = open(0.8, 10.0, Basis::Pulse);
    let glossy = Glossy::open(&asset).unwrap().unwrap();
    assert_eq!(glossy.vertices(), [1]);
    glossy.radiance([0.0; 3], 1, &mut []);
    // An eye in the vertex itself has no direction: nothing, not NaN.
    let mut out = [[9.0; 3]];
    glossy.radiance([1.0, 0.0, 0.0], 0, &mut out);
    assert_eq!(out, [[0.0; 3]]);
}

#[test]
fn kernel_is_the_power_of_the_cosine() {
    let r = Vec3::new(0.6, -0.48, 0.64);
    for side in [8, 32, DIRECTION_SIDE] {
        let all = n_texels(side);
        let light: Vec<Vec4> = (0..all).map(|i| Vec4::new((i % 91) as f32, 1.0, 2.0, 0.0)).collect();
        for exponent in [0.0, 1.0, 2.0, 7.0, 10.0, 33.0, 2.5] {
            for n in [0usize, 1, 31, 32, 33, 100, all] {
                let places: Vec<u16> = (0..n).map(|i| (i * 3779 % all) as u16).collect();
                let weight: Vec<f32> = (0..n).map(|i| 0.01 * (i % 100) as f32 + 0.1).collect();
                let entries = Entries { weight: &weight, direction: &places, side, source: &places };
                let mut expected = glam::DVec4::ZERO;
                for (&p, w) in places.iter().zip(&weight) {
                    let d = cubemap::direction(side, p.into(), Vec2::splat(0.5));
                    let cos = f64::from(d.dot(r));
                    let kernel = if cos > 0.0 { cos.powf(f64::from(exponent)) } else { 0.0 };
                    expected += kernel * f64::from(*w) * light[usize::from(p)].as_dvec4();
                }
                let lobe = Lobe::new(r, exponent);
                for found in [lobe.sum(&entries, &light), lobe.sum_portable(&entries, &light)] {
                    // f32 sums of up to 64,896 terms, in two strands; and an edge of texels that r is square to.
                    let off = (found.as_dvec4() - expected).abs().max_element();
                    assert!(off <= 3e-5 * expected.abs().max_element(), "{side} {exponent} {n}: {off}");
                }
            }
        }
    }
}

#[test]
fn mean_reflectance_is_the_integral_over_both_hemispheres() {
    assert!((mean_reflectance(0.0) - 5.0 / 6.0).abs() < 1e-5);
    assert!((mean_reflectance(1e6) - 2.0 / 3.0).abs() < 1e-3, "a mirror that darkens with the cosine");
    for exponent in [1.0, 4.0, 10.0, 31.5] {
        // Over both hemispheres, by the closed form's own integrand on a fine grid: a mirror direction in the x-y plane,
        // by symmetry.
        let mut sum = 0.0;
        let (rows, columns) = (60, 120);
        for i in 0..rows {
            let cos_r = ((i as f32 + 0.5) / rows as f32).sqrt();
            let r = Vec3::new((1.0 - cos_r * cos_r).sqrt(), cos_r, 0.0);
            for j in 0..rows * columns {
                let cos = ((j / columns) as f32 + 0.5) / rows as f32;
                let cos = cos.sqrt();
                let turn = 2.0 * PI * ((j % columns) as f32 + 0.5) / columns as f32;
                let sin = (1.0 - cos * cos).sqrt();
                let c = r.dot(Vec3::new(sin * turn.cos(), cos, sin * turn.sin())).max(0.0);
                // Both cosines are in the densities of the grid, cos / π each.
                sum += c.powf(exponent);
            }
        }
        let mean = sum / (rows * rows * columns) as f32 * PI * (exponent + 2.0) / (2.0 * PI);
        let found = mean_reflectance(exponent);
        // The grid's midpoints leave 2e-3 at the sharpest lobe.
        assert!((found - mean).abs() < 4e-3, "{exponent}: {found} {mean}");
    }
}

#[test]
fn reflectance_of_glossy_vertices_is_more_than_their_albedo() {
    let asset = open(0.4, 10.0, Basis::Pulse);
    let found = reflectance(&asset);
    assert_eq!((found[0], found[2]), (Vec3::splat(0.5), Vec3::splat(0.5)));
    let expected = 0.5 + Vec3::new(0.4, 0.2, 0.0) * mean_reflectance(10.0);
    assert!((found[1] - expected).abs().max_element() < 1e-6);
}

#[test]
fn matt_assets_have_no_glossy_vertices() {
    assert!(Glossy::open(&Asset::new(Metadata::new("matt"))).unwrap().is_none());
}

/// Breaks one tensor of a good asset and expects to be told so, in one line that names a glossy tensor.
fn refused(name: &str, shape: &[usize], data: Data<'static>, what: &str) {
    let mut asset = open(0.5, 10.0, Basis::Pulse);
    add_seen(&mut asset);
    asset.insert(name, shape, data);
    let error = asset.to_bytes().unwrap_err().to_string();
    assert!(error.contains("tensor glossy.") && error.contains(what) && !error.contains('\n'), "{error}");
}

#[test]
fn broken_tensors_cannot_be_written() {
    let words = |v: &[u32]| Data::U32(Cow::Owned(v.to_vec()));
    let shorts = |v: Vec<u16>| Data::U16(Cow::Owned(v));
    let floats = |v: &[f32]| Data::F32(Cow::Owned(v.to_vec()));
    refused("glossy.vertex", &[0], words(&[]), "rising");
    refused("glossy.vertex", &[2], words(&[1, 1]), "rising");
    refused("glossy.vertex", &[1], words(&[3]), "past vertex 3");
    refused("glossy.vertex", &[2], words(&[0, 1]), "1 lobes for 2 vertices");
    refused("glossy.vertex", &[1], floats(&[1.0]), "F32 instead of U32");
    refused("glossy.lobe", &[4], floats(&[0.5; 4]), "rows of four");
    refused("glossy.lobe", &[1, 4], floats(&[0.5, 0.5, 1.5, 1.0]), "vertex 1");
    refused("glossy.lobe", &[1, 4], floats(&[0.5, 0.5, 0.5, -1.0]), "vertex 1");
    refused("glossy.patch", &[2], shorts(vec![0; 2]), "for 3 vertices");
    refused("glossy.patch", &[3], shorts(vec![NO_PATCH; 3]), "source: entry 0 points past patch 0");
    refused("glossy.start", &[2], words(&[0, 5]), "rising");
    refused("glossy.start", &[1], words(&[0]), "rising");
    let n = n_entries();
    refused("glossy.source", &[n], shorts(vec![1; n]), "past patch 1");
    refused("glossy.source", &[n - 1], shorts(vec![0; n - 1]), "rising list from 0");
    refused("glossy.direction", &[n], shorts(vec![u16::MAX; n]), "past direction 64896");
    refused("glossy.direction", &[1], shorts(vec![0]), "1 values");
    refused("glossy.share", &[2], Data::F16(Cow::Owned(vec![f16::ONE; 2])), "2 values for 3 vertices");
    refused("glossy.weight", &[n], shorts(vec![0; n]), "half floats");
}

fn n_entries() -> usize {
    let mut asset = open(0.5, 10.0, Basis::Pulse);
    add_seen(&mut asset);
    asset.tensor("glossy.source").unwrap().data.len()
}

#[test]
fn every_truncation_of_a_glossy_asset_is_an_error() {
    let mut asset = open(0.5, 10.0, Basis::Pulse);
    add_seen(&mut asset);
    let bytes = asset.to_bytes().unwrap();
    assert!(Glossy::open(&Asset::from_bytes(&bytes).unwrap()).unwrap().is_some());
    for length in 0..bytes.len() {
        let error = Asset::from_bytes(&bytes[..length]).expect_err("cut").to_string();
        assert!(!error.contains('\n'), "{length}: {error}");
    }
}

#[test]
fn missing_tensors_are_named() {
    for part in ["vertex", "lobe", "patch", "share", "start", "source", "direction", "weight"] {
        let mut whole = open(0.5, 10.0, Basis::Pulse);
        add_seen(&mut whole);
        let mut asset = Asset::new(whole.metadata.clone());
        let name = format!("glossy.{part}");
        for (n, tensor) in whole.tensors().filter(|(n, _)| *n != name) {
            asset.insert(n, &tensor.shape, tensor.data.clone());
        }
        let error = asset.to_bytes().unwrap_err().to_string();
        assert!(error.contains(&name) && error.contains("missing"), "{error}");
    }
}

#[test]
fn sun_that_is_told_of_gives_the_highlight_its_place() {
    let mut asset = open(0.5, 20.0, Basis::Pulse);
    // All vertices are outside, under the open sky.
    asset.insert("portal.0.corner", &[3, 3], Data::F32(Cow::Owned(vec![0., 1., 0., 1., 1., 0., 0., 1., 1.])));
    asset.insert("portal.0.polygon", &[2], Data::U32(Cow::Owned(vec![0, 3])));
    asset.insert("portal.0.open", &[V], Data::U32(Cow::Owned(vec![0, 1, 2])));
    let mut glossy = Glossy::open(&asset).unwrap().unwrap();
    let mut frame = PortalFrame::new(&asset).unwrap();
    let mut texels = vec![[0.0; 3]; n_texels(N)];
    let mut off = [0.0f32; 2];
    for i in 0..40 {
        let turn = 0.37 * i as f32;
        let axis = Vec3::new(0.5 * turn.cos(), 1.0, 0.7 * turn.sin()).normalize();
        let sun = Cap { axis, radius: 0.005, radiance: Vec3::splat(1e4) };
        cubemap::project_light(&Light::new(Source::Cap(sun)), N, &mut texels);
        // Seen 0.3 radians beside the mirror direction.
        let r = (axis + 0.3 * axis.any_orthonormal_vector()).normalize();
        let expected =
            0.5 * 22.0 / (2.0 * PI) * r.dot(axis).powi(20) * axis.y * 1e4 * PI * 0.005f32.sin().powi(2);
        let eye = Vec3::X - 4.0 * r.reflect(Vec3::Y);
        let mut out = [[0.0; 3]];
        for (n_told, off) in off.iter_mut().enumerate() {
            let shell = Shell::new(N, &texels).unwrap();
            frame.set_shell_with_discs(0, shell, &[sun][..n_told]).unwrap();
            glossy.project(&frame, &[[0.0; 3]; V]);
            glossy.radiance(eye.to_array(), 0, &mut out);
            *off = off.max((out[0][0] / expected - 1.0).abs());
        }
    }
    // A disc's lobe is that of its middle; from the middle of texels the highlight is off by much more.
    assert!(off[1] < 0.01 && off[0] > 0.1, "{off:?}");
}
