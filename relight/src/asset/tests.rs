use super::*;

mod interior;

fn sample() -> Asset<'static> {
    let mut asset = Asset::new(Metadata::new("triangle"));
    let triples = |v: [[f32; 3]; 3]| Data::F32(Cow::Owned(v.concat()));
    asset.insert("mesh.position", &[3, 3], triples([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]));
    asset.insert("mesh.normal", &[3, 3], triples([[0.0, 1.0, 0.0]; 3]));
    asset.insert("mesh.albedo", &[3, 3], triples([[0.5; 3]; 3]));
    asset.insert("mesh.index", &[1, 3], Data::U32(Cow::Owned(vec![0, 1, 2])));
    asset.insert_scaled("sky.direct.sh", &[3, 4], &[1e-6; 12]);
    asset
}

#[test]
fn asset_survives_a_round_trip_and_repeats_its_bytes() {
    let bytes = sample().to_bytes().unwrap();
    let back = Asset::from_bytes(&bytes).unwrap();
    assert_eq!(back.positions()[1], [1.0, 0.0, 0.0]);
    assert_eq!(back.triangles(), [[0, 1, 2]]);
    assert_eq!(back.order("sky.direct.sh"), Some(2));
    assert_eq!(back.to_bytes().unwrap(), bytes);
}

#[test]
fn small_values_keep_their_bits_through_the_scale() {
    let asset = sample();
    let (values, scale) = asset.half("sky.direct.sh").unwrap();
    // f16 alone would round 1e-6 to a multiple of 6e-8, 3 % off; scaled it has eleven bits.
    assert!((values[0].to_f32() * scale / 1e-6 - 1.0).abs() < 1.0 / 2048.0);
}

#[test]
fn every_truncation_is_an_error() {
    let bytes = sample().to_bytes().unwrap();
    for length in 0..bytes.len() {
        assert!(Asset::from_bytes(&bytes[..length]).is_err(), "cut at {length}");
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(Asset::from_bytes(&longer).is_err());
}

#[test]
fn every_flipped_byte_is_an_error() {
    let bytes = sample().to_bytes().unwrap();
    for at in 0..bytes.len() {
        for mask in [0x01, 0x20, 0x80] {
            let mut harmed = bytes.clone();
            harmed[at] ^= mask;
            match Asset::from_bytes(&harmed) {
                Err(error) => assert!(!error.to_string().contains('\n')),
                Ok(_) => panic!("byte {at} ^ {mask:#x} ({:?}) went unnoticed", bytes[at] as char),
            }
        }
    }
}

#[test]
fn other_programs_and_future_versions_are_told_apart() {
    let empty: [(&str, &Tensor); 0] = [];
    let foreign = safetensors::serialize(empty, None).unwrap();
    assert_eq!(Asset::from_bytes(&foreign).unwrap_err(), Error::OtherProgram);
    let document = HashMap::from([(DOCUMENT.to_string(), r#"{"version":7,"novelty":[]}"#.to_string())]);
    let future = safetensors::serialize(empty, Some(document)).unwrap();
    assert_eq!(Asset::from_bytes(&future).unwrap_err(), Error::Version(7));
}

#[test]
fn wrong_content_cannot_be_written() {
    let mut asset = sample();
    asset.insert("mesh.index", &[1, 3], Data::U32(Cow::Owned(vec![0, 1, 3])));
    assert!(asset.to_bytes().unwrap_err().to_string().contains("triangle 0 points past vertex 3"));
    let mut asset = sample();
    asset.insert_scaled("sky.ao", &[3], &[0.0, f32::NAN, 1.0]);
    assert!(asset.to_bytes().unwrap_err().to_string().contains("value 1 is not a finite number"));
    let mut asset = sample();
    asset.insert_scaled("sky.direct.sh", &[3, 5], &[0.0; 15]);
    assert!(asset.to_bytes().unwrap_err().to_string().contains("shape [3, 5] does not fit 3 vertices"));
}

#[test]
fn misaligned_bytes_are_copied_not_refused() {
    let bytes = sample().to_bytes().unwrap();
    let shifted = [&[0u8][..], &bytes].concat();
    assert_eq!(Asset::from_bytes(&shifted[1..]).unwrap().positions()[2], [0.0, 0.0, -1.0]);
}
