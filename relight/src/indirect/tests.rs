use std::borrow::Cow;

use super::*;
use crate::asset::Metadata;
use crate::block::{self, GROUP};
use crate::light::{CieOvercast, Sky, Source};

/// A strip of `v` vertices at (i / 2, 0, i mod 2) in triangles, `k` links per row; three patches, the first apart from
/// the other two: node 0 -> 1, 2; node 2 -> 3, 4.
fn strip(v: usize, k: usize) -> Asset<'static> {
    let mut asset = Asset::new(Metadata::new("strip"));
    let position = (0..v).flat_map(|i| [(i / 2) as f32, 0.0, (i % 2) as f32]).collect();
    asset.insert("mesh.position", &[v, 3], Data::F32(Cow::Owned(position)));
    asset.insert("mesh.normal", &[v, 3], Data::F32(Cow::Owned([0.0, 1.0, 0.0].repeat(v))));
    let albedo = (0..v).flat_map(|i| [0.1 + 0.8 * (i % 3) as f32 / 2.0, 0.5, 0.25]).collect();
    asset.insert("mesh.albedo", &[v, 3], Data::F32(Cow::Owned(albedo)));
    let index = (2..v as u32).flat_map(|i| [i - 2, i - 1, i]).collect();
    asset.insert("mesh.index", &[v - 2, 3], Data::U32(Cow::Owned(index)));
    let patch = (0..v).map(|i| if i == 3 { NO_PATCH } else { [1, 3, 4][i * 3 / v] }).collect();
    asset.insert("indirect.patch", &[v], Data::U16(Cow::Owned(patch)));
    let tree = vec![1, 2, 0, 0, 3, 4, 0, 0, 0, 0];
    asset.insert("indirect.tree", &[5, 2], Data::U16(Cow::Owned(tree)));
    asset.insert("indirect.part", &[5], Data::F32(Cow::Owned(vec![1.0, 0.4, 0.6, 0.3, 0.7])));
    // Groups from their last vertex to their first.
    let mut row = vec![NO_ROW; v.div_ceil(LANES) * LANES];
    (0..v).for_each(|i| row[place(v, i)] = (i % GROUP) as u16);
    let blocks = v.div_ceil(LANES) + 1;
    asset.insert("indirect.row", &[row.len() / LANES, LANES], Data::U16(Cow::Owned(row)));
    let start = (0..=blocks).map(|b| (b * k) as u32).collect();
    asset.insert("indirect.start", &[blocks + 1], Data::U32(Cow::Owned(start)));
    let links = blocks * k;
    let node = (0..links).map(|i| (i * 7 % 5) as u16).collect();
    asset.insert("indirect.node", &[links], Data::U16(Cow::Owned(node)));
    let share = (0..LANES * links).map(|i| (208 + i * 31 % 48) as u8).collect();
    asset.insert("indirect.share", &[links, LANES], Data::U8(Cow::Owned(share)));
    // Rows of about a half in all.
    let scale = (0..LANES * blocks).map(|i| (1.0 + 0.2 * (i as f32).sin()) * 0.6 / k as f32).collect();
    asset.insert("indirect.scale", &[blocks, LANES], Data::F32(Cow::Owned(scale)));
    asset
}

/// Where row `i`, of a vertex or a patch of a strip, is in its blocks.
fn place(v: usize, i: usize) -> usize {
    match i.checked_sub(v) {
        Some(patch) => v.next_multiple_of(LANES) + patch,
        None => {
            let group = i / GROUP * GROUP;
            group + v.min(group + GROUP) - 1 - i
        }
    }
}

/// The sums as they are defined, iterated to the end.
fn naive(asset: &Asset, direct: &[[f32; 3]]) -> Vec<[f64; 3]> {
    let v = direct.len();
    let Data::U16(patch) = &asset.tensor("indirect.patch").unwrap().data else { panic!() };
    let Data::U16(node) = &asset.tensor("indirect.node").unwrap().data else { panic!() };
    let Data::U8(share) = &asset.tensor("indirect.share").unwrap().data else { panic!() };
    let Data::F32(scale) = &asset.tensor("indirect.scale").unwrap().data else { panic!() };
    let Data::U32(start) = &asset.tensor("indirect.start").unwrap().data else { panic!() };
    // Nodes and worths of a row.
    let links = |i: usize| {
        let (block, lane) = (place(v, i) / LANES, place(v, i) % LANES);
        let scale = f64::from(scale[LANES * block + lane]);
        let link = move |l: usize| (node[l], scale * f64::from(block::value(share[LANES * l + lane])));
        (start[block] as usize..start[block + 1] as usize).map(link)
    };
    let mut area = vec![0.0f64; v];
    for t in asset.triangles() {
        // All triangles of the strip are halves of unit squares.
        t.iter().for_each(|&i| area[i as usize] += 0.5 / 3.0);
    }
    // Weighed by what a vertex sees.
    for (i, area) in area.iter_mut().enumerate() {
        *area *= links(i).map(|link| link.1).sum::<f64>();
    }
    let mut out = vec![[0.0; 3]; v];
    for c in 0..3 {
        let mean = |p: u16, of: &dyn Fn(usize) -> f64| {
            let list: Vec<usize> = (0..v).filter(|&i| patch[i] == p).collect();
            let whole: f64 = list.iter().map(|&i| area[i]).sum();
            list.iter().map(|&i| area[i] * f64::from(asset.albedo()[i][c]) * of(i)).sum::<f64>() / whole
        };
        let leaves = [1u16, 3, 4];
        let own = leaves.map(|p| mean(p, &|i| f64::from(direct[i][c])));
        let albedo = leaves.map(|p| mean(p, &|_| 1.0));
        let nodes = |b: [f64; 3]| {
            let second = 0.3 * b[1] + 0.7 * b[2];
            [f64::from(0.4f32) * b[0] + f64::from(0.6f32) * second, b[0], second, b[1], b[2]]
        };
        let row = |r: usize, b: [f64; 3]| -> f64 {
            links(r).map(|(node, worth)| worth * nodes(b)[usize::from(node)]).sum()
        };
        let mut b = own;
        for _ in 0..200 {
            b = [0, 1, 2].map(|i| own[i] + albedo[i] * row(v + i, b));
        }
        for (i, out) in out.iter_mut().enumerate() {
            out[c] = row(i, b);
        }
    }
    out
}

#[test]
fn carrier_is_its_sums() {
    for (v, k) in [(10, 1), (12, 7), (301, 16), (40, 64), (33, 99), (35, 160), (1100, 5)] {
        let asset = strip(v, k);
        asset.to_bytes().expect("a good asset");
        let direct: Vec<[f32; 3]> = (0..v).map(|i| [i as f32, 1.0, (i % 5) as f32]).collect();
        let mut carrier = Carrier::open(&asset).unwrap().unwrap();
        carrier.reflect(&direct);
        let mut out = vec![[1.0; 3]; v];
        carrier.add(0, &mut out);
        let expected = naive(&asset, &direct);
        let size = expected.iter().flatten().fold(0.0f64, |a, x| a.max(x.abs()));
        for (a, b) in out.iter().zip(&expected) {
            for c in 0..3 {
                // The iteration ends when a step changes 3e-4 of all, of which albedo and rows keep a half.
                assert!((f64::from(a[c]) - 1.0 - b[c]).abs() < 2e-3 * size, "{a:?} {b:?}, k = {k}");
            }
        }
        let mut part = vec![[1.0; 3]; v - 5];
        carrier.add(5, &mut part);
        assert_eq!(part, out[5..]);
    }
}

#[test]
fn light_bounces_as_often_as_the_bake_says() {
    let mut asset = strip(12, 9);
    let direct = [[2.0, 1.0, 3.0]; 12];
    let lit = |asset: &Asset<'static>| {
        let mut carrier = Carrier::open(asset).unwrap().unwrap();
        carrier.reflect(&direct);
        let mut out = [[0.0; 3]; 12];
        carrier.add(0, &mut out);
        out[0][1]
    };
    let endless = lit(&asset);
    let mut last = 0.0;
    for bounces in 1..6 {
        asset.metadata.options.insert("bounces".into(), bounces.into());
        let now = lit(&asset);
        assert!(now > last && now < 1.01 * endless, "{bounces} bounces: {last}, {now}, {endless}");
        last = now;
    }
}

#[test]
fn dark_direct_light_bounces_nothing() {
    let asset = strip(12, 9);
    let mut carrier = Carrier::open(&asset).unwrap().unwrap();
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
        let error = asset.to_bytes().unwrap_err().to_string();
        assert!(error.contains(name), "{error}");
        error
    };
    let words = |words: Vec<u16>| Data::U16(Cow::Owned(words));
    let floats = |floats: Vec<f32>| Data::F32(Cow::Owned(floats));
    assert!(error("indirect.patch", &[12], words(vec![2; 12])).contains("vertex 0 points to node 2"));
    assert!(error("indirect.patch", &[12], words(vec![9; 12])).contains("no patch"));
    assert!(error("indirect.patch", &[11], words(vec![1; 11])).contains("does not fit"));
    let tree = |list: [u16; 10]| error("indirect.tree", &[5, 2], words(list.to_vec()));
    assert!(tree([1, 2, 0, 0, 3, 4, 0, 0, 4, 3]).contains("node 4 do not come after it"));
    assert!(tree([1, 2, 0, 0, 3, 5, 0, 0, 0, 0]).contains("node 2 do not come after it"));
    assert!(tree([1, 2, 0, 0, 3, 0, 0, 0, 0, 0]).contains("node 2 do not"));
    assert!(tree([1, 2, 3, 4, 3, 4, 0, 0, 0, 0]).contains("node 3 has 2 parents"));
    assert!(tree([1, 2, 0, 0, 0, 0, 0, 0, 0, 0]).contains("node 3 has 0 parents"));
    // One block of vertices and one of patches.
    assert!(error("indirect.node", &[18], words(vec![5; 18])).contains("link 0 points past node 5"));
    assert!(error("indirect.node", &[17], words(vec![0; 17])).contains("17 links instead of 18"));
    let starts = |list: Vec<u32>| error("indirect.start", &[list.len()], Data::U32(Cow::Owned(list)));
    assert!(starts(vec![0, 19, 18]).contains("not a rising list from 0"));
    assert!(starts(vec![0, 18]).contains("2 starts of blocks instead of 3"));
    let row = |list: Vec<u16>| error("indirect.row", &[list.len() / LANES, LANES], words(list));
    let rows = |last: u16| (0..11).chain([last]).chain([NO_ROW; 4]).collect::<Vec<u16>>();
    assert!(row(rows(NO_ROW)).contains("vertex 11 is in no block"));
    assert!(row(rows(12)).contains("block 0 has a vertex of another, 12"));
    assert!(row(rows(3)).contains("block 0 has a vertex of another, 3"));
    assert!(row([rows(11), vec![NO_ROW; LANES]].concat()).contains("2 blocks instead of 1"));
    let bytes = |n| Data::U8(Cow::Owned(vec![1; n]));
    assert!(error("indirect.share", &[17, LANES], bytes(17 * LANES)).contains("17 links instead of 18"));
    assert!(error("indirect.share", &[18, 8], bytes(144)).contains("does not fit"));
    assert!(error("indirect.scale", &[1, LANES], floats(vec![0.1; 16])).contains("1 blocks instead of 2"));
    assert!(error("indirect.scale", &[2, LANES], floats(vec![-0.1; 32])).contains("value 0 is negative"));
    assert!(error("indirect.part", &[5], floats(vec![-0.1; 5])).contains("value 0 is negative"));
    assert!(error("indirect.part", &[4], floats(vec![0.1; 4])).contains("4 nodes instead of 5"));
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
