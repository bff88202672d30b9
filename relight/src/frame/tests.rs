use std::borrow::Cow;

use glam::{Vec2, Vec3};

use super::*;
use crate::asset::{Data, Metadata};
use crate::cubemap;
use crate::light::{Cap as Disc, Source};
use crate::sparse::{Encoder, Encoding, RowStore};

/// One vertex on an open plane, its rows on a cubemap.
fn plane(n: usize) -> Asset<'static> {
    let mut asset = Asset::new(Metadata::new("plane"));
    asset.insert("mesh.position", &[1, 3], Data::F32(Cow::Owned(vec![0.0; 3])));
    asset.insert("mesh.normal", &[1, 3], Data::F32(Cow::Owned(vec![0.0, 1.0, 0.0])));
    asset.insert("mesh.albedo", &[1, 3], Data::F32(Cow::Owned(vec![0.5; 3])));
    asset.insert("mesh.index", &[0, 3], Data::U32(Cow::Owned(Vec::new())));
    let mut row = vec![0.0; n_texels(n)];
    for (t, out) in row.iter_mut().enumerate() {
        for i in 0..64 {
            let within = Vec2::new((i % 8) as f32 + 0.5, (i / 8) as f32 + 0.5) / 8.0;
            let (d, solid_angle) = cubemap::sample(n, t, within);
            *out += d.y.max(0.0) * solid_angle / 64.0;
        }
    }
    let mut store = RowStore::default();
    store.push(&Encoder::new(n, Encoding::default()).encode(&row));
    store.insert_into(&mut asset, "sky.direct", n).unwrap();
    asset
}

#[test]
fn sparse_rows_light_an_open_plane_under_every_light() {
    let asset = plane(32);
    let mut frame = Frame::new(&asset, Method::Haar).unwrap();
    let disc = |axis: Vec3, radius| {
        Light::new(Source::Cap(Disc { axis: axis.normalize(), radius, radiance: Vec3::splat(10.0) }))
    };
    let irradiance = |axis: Vec3, radius: f32| {
        10.0 * crate::cap::plane_irradiance(glam::DVec3::Y, axis.normalize().as_dvec3(), f64::from(radius))
            as f32
    };
    let (high, low) = (Vec3::new(0.2, 1.0, 0.3), Vec3::new(1.0, 0.35, 0.1));
    let cases = [
        // The row's sum is kept.
        (Light::new(Source::Uniform(Vec3::ONE)), std::f32::consts::PI, 1e-3),
        // A disc spread over its texels, and 1 % of the row's energy dropped.
        (disc(high, 0.1), irradiance(high, 0.1), 0.02),
        (disc(low, 0.1), irradiance(low, 0.1), 0.03),
        (disc(high, 0.6), irradiance(high, 0.6), 0.01),
    ];
    for (light, expected, tolerance) in cases {
        frame.project(&light);
        let mut out = [[9.0; 3]];
        frame.direct(0, &mut out);
        assert!((out[0][1] / expected - 1.0).abs() < tolerance, "{} {expected}", out[0][1]);
    }
    assert!(frame.bytes_per_vertex().0 < 3000.0, "{:?}", frame.bytes_per_vertex());
}

#[test]
fn methods_that_are_not_baked_are_named() {
    let asset = plane(8);
    let missing = |method| Frame::new(&asset, method).err().unwrap().to_string();
    assert!(missing(Method::default()).contains("sky.direct.sh"));
    let mut frame = Frame::new(&asset, Method::Haar).unwrap();
    assert!(
        frame.set_indirect(Indirect::DirectToIndirect).unwrap_err().to_string().contains("indirect.node")
    );
    assert!(frame.set_indirect(Indirect::Sh).is_err());
    let bare = Asset::new(Metadata::new("bare"));
    assert!(Frame::new(&bare, Method::Haar).err().unwrap().to_string().contains("sky.direct.start"));
}
