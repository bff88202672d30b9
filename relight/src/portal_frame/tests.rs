use std::borrow::Cow;

use glam::{Vec2, Vec3};

use super::*;
use crate::asset::{Data, Metadata, Shell as ShellInfo};
use crate::block::{LANES, NO_ROW};
use crate::cubemap;
use crate::sh;
use crate::sparse::{Encoder, Encoding, RowStore};

const V: usize = 30;

/// Transfer of vertex `v` through portal `k`: a cap of texels whose size grows with v, some of it wide enough for
/// Haar.
fn transfer(n: usize, k: usize, v: usize) -> Vec<f32> {
    let axis = [Vec3::X, Vec3::new(-0.5, 0.7, 0.5).normalize()][k];
    let inside = |t: usize| cubemap::direction(n, t, Vec2::splat(0.5)).dot(axis) > 1.0 - 0.03 * v as f32;
    let value = |t: usize| {
        let cosine = cubemap::direction(n, t, Vec2::splat(0.5)).dot(axis).max(0.0);
        if inside(t) { cubemap::solid_angle(n, t) * cosine } else { 0.0 }
    };
    (0..n_texels(n)).map(value).collect()
}

fn bounced(i: usize) -> f32 {
    (i as f32 * 0.37).sin()
}

/// Two portals of different resolution; the first has bounced light of order 3.
fn room() -> Asset<'static> {
    let mut asset = Asset::new(Metadata::new("room"));
    for (name, value) in [("mesh.position", 0.5), ("mesh.normal", 0.0), ("mesh.albedo", 0.5)] {
        let values = (0..3 * V).map(|i| value + if name == "mesh.position" { (i % 7) as f32 } else { 0.0 });
        asset.insert(name, &[V, 3], Data::F32(Cow::Owned(values.collect())));
    }
    let index = (2..V as u32).flat_map(|i| [i - 2, i - 1, i]).collect();
    asset.insert("mesh.index", &[V - 2, 3], Data::U32(Cow::Owned(index)));
    for (k, n) in [32, 16].into_iter().enumerate() {
        let (mut encoder, mut store) = (Encoder::new(n, Encoding::default()), RowStore::default());
        (0..V).for_each(|v| store.push(&encoder.encode(&transfer(n, k, v))));
        store.insert_into(&mut asset, &format!("portal.{k}.direct"), n).unwrap();
        asset.metadata.shells.push(ShellInfo { name: format!("window {k}"), ..ShellInfo::default() });
    }
    let rows: Vec<f32> = (0..V * 27).map(bounced).collect();
    asset.insert_scaled("portal.0.indirect.sh", &[V, 9, 3], &rows);
    asset
}

fn shell(n: usize, seed: f32) -> Vec<[f32; 3]> {
    (0..n_texels(n))
        .map(|t| [1.0 + (t as f32 * seed).sin(), 2.0, 0.5 + 0.5 * (t as f32 * 0.1).cos()])
        .collect()
}

fn lit(asset: &Asset<'static>, materials: [Material; 2]) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let mut frame = PortalFrame::new(asset).unwrap();
    for (k, material) in materials.into_iter().enumerate() {
        frame.set_material(k, material);
        let texels = shell(frame.resolution(k), 0.3 + k as f32);
        frame.set_shell(k, Shell::new(frame.resolution(k), &texels).unwrap()).unwrap();
    }
    let (mut direct, mut indirect) = (vec![[9.0; 3]; V], vec![[0.0; 3]; V]);
    frame.direct(0, &mut direct);
    frame.reflect(&direct);
    frame.add_indirect(0, &mut indirect);
    (direct, indirect)
}

#[test]
fn direct_light_is_the_sum_over_portals_and_texels() {
    let (direct, _) = lit(&room(), [Material::CLEAR; 2]);
    for (v, found) in direct.iter().enumerate() {
        let mut expected = Vec3::ZERO;
        let mut size = 0.0;
        for (k, n) in [32, 16].into_iter().enumerate() {
            for (t, l) in transfer(n, k, v).iter().zip(shell(n, 0.3 + k as f32)) {
                expected += *t * Vec3::from(l);
                size += t;
            }
        }
        // A hundredth of a Haar row is dropped, under light that wavers from texel to texel.
        assert!(
            (Vec3::from(*found) - expected).abs().max_element() <= 0.01 * size,
            "{v}: {found:?} {expected}"
        );
    }
    assert_eq!(direct[0], [0.0; 3], "a vertex without any row");
}

#[test]
fn bounced_light_is_the_dot_product_of_harmonics() {
    let (_, indirect) = lit(&room(), [Material::CLEAR; 2]);
    let texels = shell(32, 0.3);
    let mut light = [[0.0f64; 3]; 9];
    let mut y = [0.0; 9];
    for (t, l) in texels.iter().enumerate() {
        for i in 0..64 {
            let within = Vec2::new((i % 8) as f32 + 0.5, (i / 8) as f32 + 0.5) / 8.0;
            let (d, solid_angle) = cubemap::sample(32, t, within);
            sh::eval(3, d, &mut y);
            for (light, y) in light.iter_mut().zip(y) {
                for c in 0..3 {
                    light[c] += f64::from(l[c] * y * solid_angle) / 64.0;
                }
            }
        }
    }
    for (v, found) in indirect.iter().enumerate() {
        for c in 0..3 {
            let expected: f64 = (0..9).map(|i| f64::from(bounced((v * 9 + i) * 3 + c)) * light[i][c]).sum();
            // f16 transfer below one, times coefficients of about ten.
            assert!((f64::from(found[c]) - expected).abs() < 0.02, "{v}: {} {expected}", found[c]);
        }
    }
}

#[test]
fn glass_changes_the_light_as_it_says() {
    let asset = room();
    let (clear, clear_indirect) = lit(&asset, [Material::CLEAR; 2]);
    let (closed, closed_indirect) = lit(&asset, [Material::CLOSED; 2]);
    assert!(closed.iter().chain(&closed_indirect).all(|e| *e == [0.0; 3]), "exactly dark");

    let red = Material { tint: [1.0, 0.5, 0.0], frost: 0.0 };
    let (tinted, tinted_indirect) = lit(&asset, [red; 2]);
    for (a, b) in clear.iter().zip(&tinted).chain(clear_indirect.iter().zip(&tinted_indirect)) {
        // Rounding.
        assert!((b[0] - a[0]).abs() < 1e-5 && (b[1] - 0.5 * a[1]).abs() < 1e-5 && b[2] == 0.0);
    }

    let milky = Material { frost: 3.0, ..Material::CLEAR };
    let (frosted, _) = lit(&asset, [milky; 2]);
    let mean = |n: usize, k: usize| {
        let texels = shell(n, 0.3 + k as f32);
        let sum: f32 = texels.iter().enumerate().map(|(t, l)| l[0] * cubemap::solid_angle(n, t)).sum();
        sum / (4.0 * std::f32::consts::PI)
    };
    for (v, frosted) in frosted.iter().enumerate().take(V).skip(1) {
        let expected: f32 = [32, 16]
            .iter()
            .enumerate()
            .map(|(k, &n)| transfer(n, k, v).iter().sum::<f32>() * mean(n, k))
            .sum();
        // A blur of three radians leaves a tenth of the shell's unevenness, which is small here.
        assert!((frosted[0] / expected - 1.0).abs() < 0.03, "{v}: {} {expected}", frosted[0]);
    }
}

#[test]
fn glass_may_change_under_a_standing_light() {
    let asset = room();
    let mut frame = PortalFrame::new(&asset).unwrap();
    let texels = shell(32, 0.3);
    frame.set_shell(0, Shell::new(32, &texels).unwrap()).unwrap();
    let mut first = vec![[0.0; 3]; V];
    frame.direct(0, &mut first);
    for material in [Material::CLOSED, Material { frost: 0.4, tint: [0.3; 3] }, Material::CLEAR] {
        frame.set_material(0, material);
    }
    let mut last = vec![[0.0; 3]; V];
    frame.direct(0, &mut last);
    assert_eq!(first, last, "clear again");
}

#[test]
fn bounced_light_may_be_carried_from_direct_light() {
    let mut asset = room();
    assert_eq!(
        PortalFrame::new(&asset).unwrap().set_indirect(Indirect::DirectToIndirect).unwrap_err(),
        Missing::carrier()
    );
    asset.insert("indirect.patch", &[V], Data::U16(Cow::Owned(vec![0; V])));
    asset.insert("indirect.tree", &[1, 2], Data::U16(Cow::Owned(vec![0, 0])));
    asset.insert("indirect.part", &[1], Data::F32(Cow::Owned(vec![1.0])));
    // Blocks of the vertices, and one of the patch, which does not see itself.
    let blocks = V.div_ceil(LANES);
    let row = (0..blocks * LANES).map(|v| if v < V { v as u16 } else { NO_ROW }).collect();
    asset.insert("indirect.row", &[blocks, LANES], Data::U16(Cow::Owned(row)));
    let start = (0..=blocks as u32 + 1).map(|b| 2 * b.min(blocks as u32)).collect();
    asset.insert("indirect.start", &[blocks + 2], Data::U32(Cow::Owned(start)));
    asset.insert("indirect.node", &[2 * blocks], Data::U16(Cow::Owned(vec![0; 2 * blocks])));
    // 1.
    let share = vec![0xf0; 2 * blocks * LANES];
    asset.insert("indirect.share", &[2 * blocks, LANES], Data::U8(Cow::Owned(share)));
    let scale = vec![0.25; (blocks + 1) * LANES];
    asset.insert("indirect.scale", &[blocks + 1, LANES], Data::F32(Cow::Owned(scale)));
    let mut frame = PortalFrame::new(&asset).unwrap();
    assert_eq!(frame.indirect(), Indirect::Sh);
    frame.set_indirect(Indirect::DirectToIndirect).unwrap();
    frame.reflect(&[[4.0, 2.0, 0.0]; V]);
    let mut out = vec![[0.0; 3]; V];
    frame.add_indirect(0, &mut out);
    for e in out {
        // One patch of albedo 1/2 reflects half of everything; two links of a quarter each halve it again.
        assert!((Vec3::from(e) - Vec3::new(1.0, 0.5, 0.0)).abs().max_element() < 1e-5, "{e:?}");
    }
    frame.set_indirect(Indirect::None).unwrap();
    let mut nothing = vec![[0.0; 3]; V];
    frame.add_indirect(0, &mut nothing);
    assert_eq!(nothing, vec![[0.0; 3]; V]);
}

#[cfg(feature = "rayon")]
#[test]
fn parallel_irradiance_is_the_serial_one() {
    let asset = room();
    let mut frame = PortalFrame::new(&asset).unwrap();
    let texels = shell(32, 0.3);
    frame.set_shell(0, Shell::new(32, &texels).unwrap()).unwrap();
    let (mut serial, mut parallel) = (vec![[0.0; 3]; V], vec![[0.0; 3]; V]);
    frame.direct(0, &mut serial);
    frame.add_indirect(0, &mut serial);
    frame.irradiance_parallel(&mut parallel);
    assert_eq!(serial, parallel);
}

#[test]
fn assets_without_portals_and_wrong_shells_are_errors() {
    let asset = Asset::new(Metadata::new("plain"));
    let error = PortalFrame::new(&asset).err().unwrap().to_string();
    assert!(error.contains("no portals") && !error.contains('\n'));
    let asset = room();
    let mut frame = PortalFrame::new(&asset).unwrap();
    assert_eq!((frame.n_portals(), frame.name(1)), (2, "window 1"));
    let texels = shell(16, 1.0);
    let error = frame.set_shell(0, Shell::new(16, &texels).unwrap()).unwrap_err();
    assert_eq!(error, ShellError::Resolution { baked: 32, given: 16 });
}

#[test]
fn broken_portals_cannot_be_written() {
    let mut asset = room();
    asset.insert("portal.1.direct.basis", &[V], Data::U8(Cow::Owned(vec![7; V])));
    assert!(asset.to_bytes().unwrap_err().to_string().contains("portal.1.direct.basis"));
    let mut asset = room();
    asset.insert_scaled("portal.0.indirect.sh", &[V, 8, 3], &[0.1; V * 24]);
    assert!(asset.to_bytes().unwrap_err().to_string().contains("portal.0.indirect.sh"));
    assert!(room().to_bytes().is_ok());
}
