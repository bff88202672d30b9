//! What an interior adds: sparse rows and SH of a portal, and bounced light from direct light.

use super::*;
use crate::block::{LANES, NO_ROW};
use crate::portal_frame::PortalFrame;
use crate::sparse::{Encoder, Encoding, RowStore};

/// Links of each block, of which one is of the three vertices and one of the two patches.
const K: usize = 4;
const BLOCKS: usize = 2;

fn room() -> Asset<'static> {
    let mut asset = sample();
    let mut store = RowStore::default();
    let mut encoder = Encoder::new(8, Encoding::default());
    for v in 0..3 {
        let mut row = vec![0.0; 6 * 64];
        // A dark row, one of a few texels, one of many.
        row[70..70 + 20 * v].fill(0.01 * v as f32);
        store.push(&encoder.encode(&row));
    }
    store.insert_into(&mut asset, "portal.0.direct", 8).unwrap();
    asset.insert_scaled("portal.0.indirect.sh", &[3, 4, 3], &[0.1; 36]);
    asset.insert("indirect.patch", &[3], Data::U16(Cow::Owned(vec![1, 2, NO_PATCH])));
    asset.insert("indirect.tree", &[3, 2], Data::U16(Cow::Owned(vec![1, 2, 0, 0, 0, 0])));
    let row = (0..LANES as u16).map(|v| if v < 3 { v } else { NO_ROW }).collect();
    asset.insert("indirect.row", &[1, LANES], Data::U16(Cow::Owned(row)));
    let links = BLOCKS * K;
    asset.insert("indirect.start", &[BLOCKS + 1], Data::U32(Cow::Owned(vec![0, K as u32, links as u32])));
    asset.insert("indirect.node", &[links], Data::U16(Cow::Owned(vec![1; links])));
    asset.insert("indirect.share", &[links, LANES], Data::U8(Cow::Owned(vec![100; links * LANES])));
    asset.insert("indirect.scale", &[BLOCKS, LANES], Data::F32(Cow::Owned(vec![1e-5; BLOCKS * LANES])));
    asset.insert("indirect.part", &[3], Data::F32(Cow::Owned(vec![1.0, 0.5, 0.5])));
    asset
}

/// An asset is refused in one line that names the tensor: when it is written, and when it comes from a file all the same.
fn assert_refused(asset: &Asset, name: &str, what: &str) {
    let written = asset.to_bytes().expect_err(what);
    let read = Asset::from_bytes(&asset.unchecked_bytes().unwrap()).expect_err(what);
    assert_eq!(written, read);
    let line = read.to_string();
    assert!(line.contains(name) && line.contains(what) && !line.contains('\n'), "{line}");
}

#[test]
fn interior_survives_a_round_trip_and_can_be_lit() {
    let bytes = room().to_bytes().unwrap();
    let back = Asset::from_bytes(&bytes).unwrap();
    assert_eq!(back.to_bytes().unwrap(), bytes);
    let frame = PortalFrame::new(&back).unwrap();
    assert_eq!((frame.n_portals(), frame.resolution(0), frame.n_vertices()), (1, 8, 3));
    assert!(crate::indirect::Carrier::open(&back).is_ok_and(|carrier| carrier.is_some()));
}

#[test]
fn every_truncation_of_an_interior_is_an_error() {
    let bytes = room().to_bytes().unwrap();
    for length in 0..bytes.len() {
        let error = Asset::from_bytes(&bytes[..length]).expect_err("it is cut");
        assert!(!error.to_string().contains('\n'), "cut at {length}: {error}");
    }
}

#[test]
fn every_flipped_byte_of_an_interior_is_an_error() {
    let bytes = room().to_bytes().unwrap();
    for at in 0..bytes.len() {
        let mut harmed = bytes.clone();
        harmed[at] ^= 1 << (at % 8);
        match Asset::from_bytes(&harmed) {
            Err(error) => assert!(!error.to_string().contains('\n')),
            Ok(_) => panic!("byte {at} ({:?}) went unnoticed", bytes[at] as char),
        }
    }
}

#[test]
fn bounced_light_needs_all_of_its_tensors() {
    let names = ["patch", "tree", "node", "share", "scale", "part"].map(|part| format!("indirect.{part}"));
    for name in names {
        let mut asset = room();
        asset.tensors.remove(&name);
        assert_refused(&asset, &name, "missing");
    }
    for name in ["start", "index", "value", "scale", "basis"] {
        let mut asset = room();
        asset.tensors.remove(&format!("portal.0.direct.{name}"));
        assert_refused(&asset, &format!("portal.0.direct.{name}"), "missing");
    }
}

#[test]
fn bounced_light_has_a_row_for_each_vertex_and_patch() {
    // One link or block too few or too many.
    for links in [BLOCKS * K - 1, BLOCKS * K + 1, 0] {
        let mut asset = room();
        asset.insert("indirect.share", &[links, LANES], Data::U8(Cow::Owned(vec![1; links * LANES])));
        assert_refused(&asset, "indirect.share", &format!("{links} links instead of {}", BLOCKS * K));
    }
    for blocks in [BLOCKS - 1, BLOCKS + 1] {
        let mut asset = room();
        let scale = vec![0.0; blocks * LANES];
        asset.insert("indirect.scale", &[blocks, LANES], Data::F32(Cow::Owned(scale)));
        assert_refused(&asset, "indirect.scale", &format!("{blocks} blocks instead of {BLOCKS}"));
    }
    let mut asset = room();
    let mut share = vec![100; BLOCKS * K * LANES];
    share[3] = 15;
    asset.insert("indirect.share", &[BLOCKS * K, LANES], Data::U8(Cow::Owned(share)));
    assert_refused(&asset, "indirect.share", "value 3 is 15");
    asset.insert("indirect.share", &[BLOCKS * K, 15], Data::U8(Cow::Owned(vec![1; BLOCKS * K * 15])));
    assert_refused(&asset, "indirect.share", "shape");
}

#[test]
fn bounced_light_is_finite_and_of_its_types() {
    for (name, shape) in [("indirect.scale", &[BLOCKS, LANES][..]), ("indirect.part", &[3])] {
        for bad in [f32::NAN, f32::INFINITY] {
            let mut values = vec![0.1; shape.iter().product()];
            values[2] = bad;
            let mut asset = room();
            asset.insert(name, shape, Data::F32(Cow::Owned(values)));
            assert_refused(&asset, name, "value 2 is not a finite number");
        }
    }
    let name = "portal.0.indirect.sh";
    for bad in [f32::NAN, f32::INFINITY] {
        let mut values = vec![0.1; 36];
        values[7] = bad;
        let mut asset = room();
        asset.insert_scaled(name, &[3, 4, 3], &values);
        assert_refused(&asset, name, "value 7 is not a finite number");
    }
    for scale in [0.0, -1.0, f32::NAN] {
        let mut asset = room();
        asset.metadata.scale.insert(name.into(), scale);
        // JSON has no NaN: such a file cannot even be described.
        match asset.unchecked_bytes().map(|bytes| Asset::from_bytes(&bytes).err()) {
            Ok(Some(error)) => assert!(!error.to_string().contains('\n'), "{error}"),
            Ok(None) => panic!("{name}: scale {scale} went unnoticed"),
            Err(_) => {}
        }
        assert!(asset.to_bytes().unwrap_err().to_string().contains("is not a positive number"));
    }
    let mut asset = room();
    asset.insert("indirect.node", &[BLOCKS * K], Data::U32(Cow::Owned(vec![0; BLOCKS * K])));
    assert_refused(&asset, "indirect.node", "U32 instead of U16");
    let mut asset = room();
    let share = vec![0.1; BLOCKS * K * LANES];
    asset.insert("indirect.share", &[BLOCKS * K, LANES], Data::F32(Cow::Owned(share)));
    assert_refused(&asset, "indirect.share", "F32 instead of U8");
}
