//! Whatever the bytes, loading ends in a valid scene or in one line.

use lunette_scenes::LoadOptions;
use proptest::prelude::*;

use crate::{assert_valid, load_files};

const OBJ: &[u8] =
    b"mtllib a.mtl\nv 0 0 0\nv 0 0 1\nv 1 0.5 1\nv 1 0 0\nv -1 0 1e-3\nvn 0 1 0\nvn 0.6 0.8 0\no one\n\
    usemtl m\nf 1//1 2//1 3//2 4//1\ng two\nusemtl n\nf 1 2 5\nf -1 -2 \\\n -3\nl 1 2\nf 5/1/1 2/2/2 1/3/1\n";

const MTL: &[u8] =
    b"newmtl m\n\tKd 0.5 0.25 1 # red\n\tKs .1 .1 .1\nNs 10\nd 0.5\nTf 1 .5 1\nillum 4\nnewmtl n\n\
    Ke 1 2 3\nTr 1\nmap_Kd -s 1 1 1 a.png\n";

const PLY: &[u8] =
    b"ply\nformat ascii 1.0\ncomment by hand\nelement vertex 5\nproperty float x\nproperty double y\n\
    property float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n\
    property uchar green\nproperty uchar blue\nelement face 2\nproperty list uchar int vertex_indices\n\
    element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
    0 0 0 0 1 0 255 0 0\n0 0 1 0 2 0 0 255 0\n1 0 1 0 0 0 0 0 9\n1 0 0 0 1 0 1 2 3\n-1 0 0 0 1 0 4 5 6\n\
    4 0 1 2 3\n3 0 4 1\n5 0 1 2 -1 4\n";

fn binary_ply() -> Vec<u8> {
    let mut bytes =
        b"ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
        property float z\nelement face 2\nproperty list uint int vertex_indices\nend_header\n"
            .to_vec();
    let place = [[0.0_f32, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
    bytes.extend(place.iter().flatten().flat_map(|x| x.to_le_bytes()));
    for face in [[3_u32, 0, 1, 2], [3, 0, 2, 3]] {
        bytes.extend(face.iter().flat_map(|i| i.to_le_bytes()));
    }
    bytes
}

/// A change to some bytes: place, what to do there, and a byte for it.
type Change = (prop::sample::Index, u8, u8);

fn change(bytes: &[u8], changes: &[Change]) -> Vec<u8> {
    /// Pieces that have meant trouble to readers.
    const PIECES: [&[u8]; 8] = [b"nan", b"1e39", b"-1", b"99999999999", b"\\\n", b"\r", b" # ", b"\0"];
    let mut bytes = bytes.to_vec();
    for (place, what, byte) in changes {
        if bytes.is_empty() {
            break;
        }
        let i = place.index(bytes.len());
        match what % 6 {
            0 => bytes[i] = *byte,
            1 => bytes[i] ^= 1 << (byte % 8),
            2 => bytes.truncate(i),
            3 => drop(bytes.remove(i)),
            4 => drop(bytes.splice(i..i, PIECES[*byte as usize % PIECES.len()].iter().copied())),
            _ => bytes.extend_from_within(i..(i + *byte as usize).min(bytes.len())),
        }
    }
    bytes
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    prop::collection::vec(any::<Change>(), 0..6)
}

fn check(files: &[(&str, &[u8])]) {
    match load_files(files, &LoadOptions::default()) {
        Ok(scene) => assert_valid(&scene),
        Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn changed_obj_loads_valid_or_not_at_all(mesh in changes(), library in changes()) {
        check(&[("a.obj", &change(OBJ, &mesh)), ("a.mtl", &change(MTL, &library))]);
    }

    #[test]
    fn changed_ply_loads_valid_or_not_at_all(ascii in changes(), binary in changes()) {
        check(&[("a.ply", &change(PLY, &ascii))]);
        check(&[("a.ply", &change(&binary_ply(), &binary))]);
    }

    #[test]
    fn random_bytes_load_valid_or_not_at_all(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        check(&[("a.obj", &bytes)]);
        check(&[("a.ply", &bytes)]);
        check(&[("a.ply", &[b"ply\nformat binary_big_endian 1.0\n", &bytes[..]].concat())]);
    }
}

#[test]
fn every_truncation_is_valid_or_an_error() {
    for (name, bytes) in [("a.obj", OBJ), ("a.ply", PLY), ("a.ply", &binary_ply())] {
        assert!(
            load_files(&[(name, bytes)], &LoadOptions::default()).is_ok(),
            "{name} is right before it is cut"
        );
        (0..bytes.len()).for_each(|n| check(&[(name, &bytes[..n])]));
    }
}
