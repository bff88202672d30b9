use std::borrow::Cow;

use proptest::prelude::*;

use super::*;
use crate::asset::{Asset, Data, Metadata};

fn noise(count: usize, seed: u32) -> Vec<f32> {
    let mut state = seed;
    let step = |_| {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    (0..count).map(step).collect()
}

/// A window's row: a box of texels on one face, smooth inside and partly covered at its edges.
fn window(n: usize, face: usize, from: usize, to: usize) -> Vec<f32> {
    let mut row = vec![0.0; cubemap::n_texels(n)];
    for r in from..to {
        for c in from..to {
            let at = face * n * n + r * n + c;
            let edge = if r == from || c + 1 == to { 0.37 } else { 1.0 };
            row[at] = edge * cubemap::solid_angle(n, at) * (0.5 + 0.4 * (r as f32 * 0.1).cos());
        }
    }
    row
}

fn shell(n: usize) -> Vec<[f32; 3]> {
    noise(3 * cubemap::n_texels(n), 5).chunks_exact(3).map(|c| [c[0], 2.0 * c[1], c[2] * c[2]]).collect()
}

fn encode(n: usize, row: &[f32], choice: Choice) -> Row {
    Encoder::new(n, Encoding { choice, ..Encoding::default() }).encode(row)
}

fn relative_error(a: &[f32], b: &[f32]) -> f32 {
    let difference: f32 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (difference / b.iter().map(|b| b * b).sum::<f32>()).sqrt()
}

/// An asset of as many vertices as there are rows.
fn asset(n: usize, rows: &[Row]) -> Asset<'static> {
    let v = rows.len();
    let mut asset = Asset::new(Metadata::new("rows"));
    for name in ["mesh.position", "mesh.normal", "mesh.albedo"] {
        asset.insert(name, &[v, 3], Data::F32(Cow::Owned(vec![0.5; 3 * v])));
    }
    asset.insert("mesh.index", &[0, 3], Data::U32(Cow::Owned(Vec::new())));
    let mut store = RowStore::default();
    rows.iter().for_each(|row| store.push(row));
    store.insert_into(&mut asset, "portal.0.direct", n).unwrap();
    asset
}

#[test]
fn rows_decode_to_what_was_encoded() {
    for n in [8, 24, 32, 64] {
        for row in [window(n, 0, 1, n - 1), window(n, 5, n / 2, n / 2 + 1), window(n, 2, 0, n)] {
            for basis in [Basis::Pulse, Basis::Columns, Basis::Haar] {
                let encoded = encode(n, &row, Choice::Only(basis));
                let error = relative_error(&decode(n, &encoded), &row);
                // The tolerance of 0.01, and 8 bits on top.
                assert!(error < 0.015, "{basis:?} at {n}: {error}");
                assert!((error - encoded.error).abs() < 1e-3, "reported {} found {error}", encoded.error);
            }
        }
    }
}

#[test]
fn rows_keep_their_sum() {
    // Random rows of every magnitude, with a long dim tail beside a bright texel.
    for (seed, scale) in [(1, 1.0), (2, 1e-9), (3, 1e6)] {
        let mut row: Vec<f32> = noise(cubemap::n_texels(16), seed).iter().map(|x| x * 1e-3 * scale).collect();
        row[700] = scale;
        for basis in [Basis::Pulse, Basis::Columns, Basis::Haar] {
            let decoded = decode(16, &encode(16, &row, Choice::Only(basis)));
            let sum = |row: &[f32]| row.iter().map(|x| f64::from(*x)).sum::<f64>();
            // Rounding of f32 in the decoder.
            assert!((sum(&decoded) / sum(&row) - 1.0).abs() < 1e-5, "{basis:?} {seed}");
        }
    }
}

#[test]
fn dark_row_has_no_bytes_and_gives_no_light() {
    let dark = encode(8, &vec![0.0; cubemap::n_texels(8)], Choice::Smaller);
    assert_eq!((dark.values.len(), dark.runs.len(), dark.error), (0, 0, 0.0));
    let asset = asset(8, &[dark]);
    let rows = Rows::open(&asset, "portal.0.direct").unwrap().unwrap();
    let (mut light, mut out) = (SparseLight::new(8), [[0.0; 3]]);
    light.set(&shell(8));
    rows.add(0, &light, &mut out);
    assert_eq!(out, [[0.0; 3]], "exactly");
}

#[test]
fn smaller_basis_is_chosen() {
    let choose = |row: &[f32]| encode(32, row, Choice::Smaller);
    assert_ne!(choose(&window(32, 0, 10, 14)).basis, Basis::Haar, "a small window");
    assert_eq!(choose(&window(32, 0, 1, 32)).basis, Basis::Haar, "a wide one");
    for row in [window(32, 0, 10, 14), window(32, 0, 1, 32)] {
        let both = [Basis::Pulse, Basis::Haar].map(|b| encode(32, &row, Choice::Only(b)).bytes());
        assert_eq!(choose(&row).bytes(), both[0].min(both[1]));
    }
}

#[test]
fn tall_windows_are_stored_down_columns() {
    let strip = |step: usize| -> Vec<f32> {
        let lit = |t: usize| (0..20).any(|i| t == 33 * 5 + i * step);
        (0..cubemap::n_texels(32)).map(|t| if lit(t) { 1.0 } else { 0.0 }).collect()
    };
    assert_eq!(encode(32, &strip(1), Choice::Smaller).basis, Basis::Pulse);
    let tall = encode(32, &strip(32), Choice::Smaller);
    // Twenty values in two runs, and nine bytes besides.
    assert_eq!((tall.basis, tall.bytes()), (Basis::Columns, 20 + 4 + 9));
}

#[test]
fn tolerance_trades_bytes_for_error() {
    let row = window(32, 3, 2, 30);
    let at =
        |tolerance| Encoder::new(32, Encoding { tolerance, choice: Choice::Only(Basis::Haar) }).encode(&row);
    let (tight, loose) = (at(0.002), at(0.05));
    assert!(loose.bytes() < tight.bytes() && loose.error > tight.error);
    // Rounding to 8 bits adds to what is dropped.
    assert!(loose.error < 0.052);
}

#[test]
fn dot_product_is_the_sum_over_texels() {
    for n in [8, 24, 32] {
        let given: Vec<Vec<f32>> = vec![
            window(n, 1, 0, n),
            window(n, 4, n / 4, n / 2),
            vec![0.0; cubemap::n_texels(n)],
            noise(cubemap::n_texels(n), 3),
            window(n, 5, n - 1, n),
        ];
        let choices = [Basis::Pulse, Basis::Columns, Basis::Haar].map(Choice::Only);
        let encoded: Vec<Row> = given.iter().flat_map(|row| choices.map(|c| encode(n, row, c))).collect();
        let (asset, shell) = (asset(n, &encoded), shell(n));
        let rows = Rows::open(&asset, "portal.0.direct").unwrap().unwrap();
        let mut light = SparseLight::new(n);
        light.set(&shell);
        let mut out = vec![[1.0; 3]; encoded.len()];
        rows.add(0, &light, &mut out);
        for (row, out) in encoded.iter().zip(&out) {
            for c in 0..3 {
                let naive: f64 =
                    decode(n, row).iter().zip(&shell).map(|(t, l)| f64::from(*t) * f64::from(l[c])).sum();
                // f32 sums of up to 6 n² terms; Haar's means are a hundred times the result.
                let tolerance = 2e-5 * decode(n, row).iter().sum::<f32>() + 1e-6;
                assert!((out[c] - 1.0 - naive as f32).abs() < tolerance, "{} {naive} at {n}", out[c] - 1.0);
            }
        }
        let mut part = vec![[1.0; 3]; 3];
        rows.add(4, &light, &mut part);
        assert_eq!(part, out[4..7], "any slice of the vertices gives the same");
    }
}

#[test]
fn dot_product_agrees_with_the_portable_one() {
    let n = 32;
    let encoded: Vec<Row> = (0..40)
        .map(|i| {
            encode(
                n,
                &window(n, i % 6, i % 9, 12 + i / 2),
                Choice::Only(if i % 3 == 0 { Basis::Haar } else { Basis::Pulse }),
            )
        })
        .collect();
    let asset = asset(n, &encoded);
    let rows = Rows::open(&asset, "portal.0.direct").unwrap().unwrap();
    let mut light = SparseLight::new(n);
    light.set(&shell(n));
    let (mut fast, mut plain) = (vec![[0.0; 3]; 40], vec![[0.0; 3]; 40]);
    rows.add(0, &light, &mut fast);
    rows.add_portable(0, &light, &mut plain);
    for (a, b) in fast.iter().flatten().zip(plain.iter().flatten()) {
        // Fused against separate rounding over a few hundred terms.
        assert!((a - b).abs() < 1e-4 * b.abs().max(0.01), "{a} {b}");
    }
}

#[test]
fn rows_survive_the_file() {
    let encoded: Vec<Row> =
        (0..7).map(|i| encode(16, &window(16, i % 6, i, 9 + i), Choice::Smaller)).collect();
    let bytes = asset(16, &encoded).to_bytes().unwrap();
    let back = Asset::from_bytes(&bytes).unwrap();
    let rows = Rows::open(&back, "portal.0.direct").unwrap().unwrap();
    for (v, row) in encoded.iter().enumerate() {
        assert_eq!(rows.row(v), Row { error: 0.0, ..row.clone() });
    }
    let counted: usize = encoded.iter().map(Row::bytes).sum();
    assert_eq!(rows.bytes(), counted, "every byte is counted");
    assert!(Rows::open(&back, "portal.1.direct").unwrap().is_none());
}

#[test]
fn broken_rows_are_named() {
    let good = || asset(8, &[encode(8, &window(8, 0, 1, 5), Choice::Smaller)]);
    let cases: [(&str, &[usize], Data, &str); 8] = [
        ("start", &[2], Data::U32(Cow::Owned(vec![1, 0])), "rising"),
        ("start", &[1], Data::U32(Cow::Owned(vec![0])), "fit the vertices"),
        ("start", &[2], Data::F32(Cow::Owned(vec![0.0; 2])), "F32 instead of U32"),
        ("index", &[1, 2], Data::U8(Cow::Owned(vec![255, 255])), "runs of vertex 0"),
        ("index", &[3], Data::U8(Cow::Owned(vec![0, 1, 2])), "odd"),
        ("basis", &[1], Data::U8(Cow::Owned(vec![3])), "does not exist"),
        ("scale", &[1], Data::F32(Cow::Owned(vec![-1.0])), "not a positive number"),
        ("resolution", &[1], Data::U32(Cow::Owned(vec![3_000_000_000])), "8..=64"),
    ];
    for (part, shape, data, says) in cases {
        let mut asset = good();
        asset.insert(&format!("portal.0.direct.{part}"), shape, data);
        let error = Rows::open(&asset, "portal.0.direct").unwrap_err().to_string();
        assert!(error.contains(says) && error.contains(part), "{error}");
        assert!(asset.to_bytes().is_err(), "such an asset cannot be written either");
    }
}

proptest! {
    /// Whatever bytes stand in the tensors, opening them is an error or gives rows that can be used.
    #[test]
    fn any_bytes_are_rows_or_an_error(
        runs in prop::collection::vec((0u8..=255, 0u8..=17), 0..12),
        cuts in prop::collection::vec(0usize..200, 3),
        basis in prop::collection::vec(0u8..=2, 4),
        bytes in 0usize..200,
    ) {
        let mut asset = asset(8, &vec![Row::default(); 4]);
        let fitting: usize = runs.iter().map(|r| usize::from(r.1)).sum();
        // Half of the cases have as many values as the runs say, so that some get through.
        let bytes = if bytes % 2 == 0 { fitting } else { bytes };
        let mut start: Vec<u32> = cuts.iter().map(|&c| (c % (bytes + 1)) as u32).collect();
        start.extend([0, bytes as u32]);
        start.sort_unstable();
        let flat: Vec<u8> = runs.iter().flat_map(|r| [r.0, r.1]).collect();
        let mut insert = |part: &str, shape: &[usize], data| asset.insert(&format!("portal.0.direct.{part}"), shape, data);
        insert("start", &[5], Data::U32(Cow::Owned(start)));
        insert("index", &[runs.len(), 2], Data::U8(Cow::Owned(flat)));
        insert("value", &[bytes], Data::U8(Cow::Owned(vec![200; bytes])));
        insert("scale", &[4], Data::F32(Cow::Owned(vec![1.0; 4])));
        insert("basis", &[4], Data::U8(Cow::Owned(basis)));
        if let Ok(Some(rows)) = Rows::open(&asset, "portal.0.direct") {
            let mut out = [[0.0; 3]; 4];
            rows.add(0, &SparseLight::new(8), &mut out);
            prop_assert_eq!(out, [[0.0; 3]; 4], "a dark shell stays dark");
        }
    }
}
