use std::borrow::Cow;

use super::*;
use crate::asset::Metadata;
use crate::light::{CieOvercast, Sky, Source};

/// A strip of `v` vertices at (i / 2, 0, i mod 2) in triangles, `k` numbers per vertex, two patches.
fn strip(v: usize, k: usize) -> Asset<'static> {
    let mut asset = Asset::new(Metadata::new("strip"));
    let position = (0..v).flat_map(|i| [(i / 2) as f32, 0.0, (i % 2) as f32]).collect();
    asset.insert("mesh.position", &[v, 3], Data::F32(Cow::Owned(position)));
    asset.insert("mesh.normal", &[v, 3], Data::F32(Cow::Owned([0.0, 1.0, 0.0].repeat(v))));
    let albedo = (0..v).flat_map(|i| [0.1 + 0.8 * (i % 3) as f32 / 2.0, 0.5, 0.25]).collect();
    asset.insert("mesh.albedo", &[v, 3], Data::F32(Cow::Owned(albedo)));
    let index = (2..v as u32).flat_map(|i| [i - 2, i - 1, i]).collect();
    asset.insert("mesh.index", &[v - 2, 3], Data::U32(Cow::Owned(index)));
    let patch = (0..v).map(|i| if i == 3 { NO_PATCH } else { (i * 2 / v) as u16 }).collect();
    asset.insert("indirect.patch", &[v], Data::U16(Cow::Owned(patch)));
    let spread = (0..2 * k * 3).map(|i| (i as f32 * 0.7).sin()).collect();
    asset.insert("indirect.spread", &[2, k, 3], Data::F32(Cow::Owned(spread)));
    let rows = v + 2;
    let gather: Vec<f32> = (0..rows * k).map(|i| 1e-4 * (1.2 + (i as f32 * 1.3).cos())).collect();
    asset.insert_scaled("indirect.gather", &[rows, k], &gather);
    // Each row has two near patches, the other one first.
    let near = |i: usize, n: usize| match n {
        0 => (1 - (i % 2) as u16, 0.25),
        1 => ((i % 2) as u16, 0.125),
        _ => (0, 0.0),
    };
    let all = || (0..rows).flat_map(|i| (0..N_NEAR).map(move |n| near(i, n)));
    asset.insert("indirect.near.patch", &[rows, N_NEAR], Data::U16(Cow::Owned(all().map(|n| n.0).collect())));
    let share: Vec<f32> = all().map(|n| n.1).collect();
    asset.insert_scaled("indirect.near.share", &[rows, N_NEAR], &share);
    asset
}

/// The three sums as they are defined.
fn naive(asset: &Asset, direct: &[[f32; 3]]) -> Vec<[f64; 3]> {
    let (v, k) = (direct.len(), asset.tensor("indirect.gather").unwrap().shape[1]);
    let Data::U16(patch) = &asset.tensor("indirect.patch").unwrap().data else { panic!() };
    let Data::F32(spread) = &asset.tensor("indirect.spread").unwrap().data else { panic!() };
    let (gather, scale) = asset.half("indirect.gather").unwrap();
    let mut area = vec![0.0f64; v];
    for t in asset.triangles() {
        // All triangles of the strip are halves of unit squares.
        t.iter().for_each(|&i| area[i as usize] += 0.5 / 3.0);
    }
    let mut out = vec![[0.0; 3]; v];
    for c in 0..3 {
        let (mut r, mut total) = ([0.0f64; 2], [0.0f64; 2]);
        for i in (0..v).filter(|&i| patch[i] != NO_PATCH) {
            let p = usize::from(patch[i]);
            r[p] += area[i] * f64::from(asset.albedo()[i][c]) * f64::from(direct[i][c]);
            total[p] += area[i];
        }
        let z =
            |j: usize| (0..2).map(|p| f64::from(spread[(p * k + j) * 3 + c]) * r[p] / total[p]).sum::<f64>();
        let far = |row: usize| -> f64 {
            (0..k).map(|j| f64::from(gather[row * k + j].to_f32() * scale) * z(j)).sum()
        };
        let near = |row: usize, b: &[f64; 2]| 0.25 * b[1 - row % 2] + 0.125 * b[row % 2];
        let albedo = [0, 1].map(|p| {
            let of = |i: &usize| usize::from(patch[*i]) == p;
            (0..v).filter(of).map(|i| area[i] * f64::from(asset.albedo()[i][c])).sum::<f64>() / total[p]
        });
        let mut b = [r[0] / total[0], r[1] / total[1]];
        for _ in 0..STEPS {
            b = [0, 1].map(|p| r[p] / total[p] + albedo[p] * (far(v + p) + near(v + p, &b)).max(0.0));
        }
        for (i, out) in out.iter_mut().enumerate() {
            out[c] += far(i) + near(i, &b);
        }
    }
    out
}

#[test]
fn carrier_is_its_three_sums() {
    for (v, k) in [(10, 1), (12, 7), (301, 16), (40, 64), (33, 100), (35, 128), (20, 250)] {
        let asset = strip(v, k);
        asset.to_bytes().expect("a good asset");
        let direct: Vec<[f32; 3]> = (0..v).map(|i| [i as f32, 1.0, (i % 5) as f32]).collect();
        let mut carrier = Carrier::open(&asset).unwrap();
        assert_eq!(carrier.rank(), k);
        carrier.reflect(&direct);
        let mut out = vec![[1.0; 3]; v];
        carrier.add(0, &mut out);
        let expected = naive(&asset, &direct);
        let size = expected.iter().flatten().fold(0.0f64, |a, x| a.max(x.abs()));
        for (a, b) in out.iter().zip(&expected) {
            for c in 0..3 {
                // f32 sums onto a one.
                assert!((f64::from(a[c]) - 1.0 - b[c]).abs() < 1e-5 * size + 3e-7, "{a:?} {b:?}, k = {k}");
            }
        }
        let mut part = vec![[1.0; 3]; v - 5];
        carrier.add(5, &mut part);
        for (a, b) in part.iter().flatten().zip(out[5..].iter().flatten()) {
            // Rows fall into other groups of four.
            assert!((a - b).abs() < 1e-6 * b.abs().max(1.0));
        }
    }
}

#[test]
fn dark_direct_light_bounces_nothing() {
    let asset = strip(12, 9);
    let mut carrier = Carrier::open(&asset).unwrap();
    carrier.reflect(&[[3.0; 3]; 12]);
    carrier.reflect(&[[0.0; 3]; 12]);
    let mut out = [[0.0; 3]; 12];
    carrier.add(0, &mut out);
    assert_eq!(out, [[0.0; 3]; 12], "nothing is left of the frame before");
}

#[test]
fn broken_carriers_are_named() {
    let error = |name: &str, shape: &[usize], data| {
        let mut asset = strip(12, 9);
        asset.insert(name, shape, data);
        asset.to_bytes().unwrap_err().to_string()
    };
    let words = |words: Vec<u16>| Data::U16(Cow::Owned(words));
    assert!(error("indirect.patch", &[12], words(vec![2; 12])).contains("vertex 0 points past patch 2"));
    assert!(error("indirect.patch", &[11], words(vec![0; 11])).contains("does not fit"));
    let halves = |count| Data::F16(Cow::Owned(vec![f16::ONE; count]));
    assert!(error("indirect.gather", &[12, 8], halves(96)).contains("shape [12, 8] instead of [14, 9]"));
    assert!(
        error("indirect.spread", &[2, 9, 2], Data::F32(Cow::Owned(vec![0.0; 36]))).contains("does not fit")
    );
}

#[test]
fn a_sun_takes_the_carrier_and_a_smooth_sky_sh() {
    let mut asset = strip(12, 9);
    let sunny = Light::new(Source::Sky(Sky::new(0.3, 0.5, 3.0).unwrap()));
    let overcast = Light::new(Source::CieOvercast(CieOvercast::new(Vec3::ONE)));
    assert_eq!(Indirect::for_light(&asset, &overcast), Indirect::DirectToIndirect, "there is nothing else");
    asset.insert_scaled("portal.0.indirect.sh", &[12, 4, 3], &[0.5; 144]);
    assert_eq!(Indirect::for_light(&asset, &overcast), Indirect::Sh);
    assert_eq!(Indirect::for_light(&asset, &sunny), Indirect::DirectToIndirect);
    let none = Asset::new(Metadata::new("nothing"));
    assert_eq!(Indirect::for_light(&none, &sunny), Indirect::None);
}
