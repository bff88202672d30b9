//! The file: frozen bytes decode for ever, everything else is an error and never a panic.

use glam::vec3;
use lunette_relight::aperture::Intersection;
use lunette_relight::asset::{Asset, Error, VERSION};
use lunette_relight::frame::Method;
use lunette_tests::baked::{irradiance, light, row};
use proptest::prelude::*;

/// Written by the first version: `lunette bake sphere-on-plane:edge=10,albedo=0.04 --order 3 --indirect-order 2 --rays
/// 16 --bounces 1`. Never to be written anew: files out there look like this.
const V1: &[u8] = include_bytes!("../data/sphere-v1.safetensors");

#[test]
fn frozen_bytes_of_version_1_decode() {
    let asset = Asset::from_bytes(V1).expect("version 1");
    assert_eq!((asset.metadata.version, asset.metadata.seed), (1, 1));
    assert_eq!(asset.metadata.shells[0].name, "sky");
    assert_eq!(asset.metadata.options["rays"], 16);
    assert_eq!((asset.n_vertices(), asset.triangles().len()), (30, 50));
    assert_eq!(asset.triangles()[49], [28, 29, 21]);
    assert_eq!((asset.positions()[0], asset.normals()[0]), ([-4.0, 0.0, -4.0], [0.0, 1.0, 0.0]));
    assert_eq!(asset.albedo()[29], [0.04; 3]);
    assert_eq!((asset.order("sky.direct.sh"), asset.order("sky.indirect.sh")), (Some(3), Some(2)));
    // Stored as f16, the last of them over a scale of 1/64.
    assert_eq!(row(&asset, "sky.ao", 12), [0.158_813_48]);
    assert_eq!(row(&asset, "sky.aperture", 12), [0.722_656_25]);
    assert_eq!(
        row(&asset, "sky.indirect.sh", 12)[..4],
        [0.021_606_445, 0.021_606_445, 0.021_606_445, -0.018_203_735]
    );
}

#[test]
fn frozen_bytes_of_version_1_give_the_light_they_always_gave() {
    let asset = Asset::from_bytes(V1).expect("version 1");
    let light = light("cap:1,2,0.5,0.6,2 + uniform:0.1,0.2,0.3");
    for (method, expected) in [
        (Method::Bent, vec3(0.222_408, 0.279_960, 0.337_512)),
        (Method::Aperture(Intersection::Exact), vec3(0.091_819, 0.151_086, 0.210_354)),
        (Method::default(), vec3(0.170_293, 0.227_845, 0.285_398)),
    ] {
        // The arithmetic may be reordered, not changed: single precision over some 40 terms.
        let e = irradiance(&asset, &light, method)[12];
        assert!((e - expected).abs().max_element() < 2e-6, "{method:?}: {e}");
    }
}

#[test]
fn written_version_has_frozen_bytes() {
    assert_eq!(VERSION, 1, "freeze a file of the new version beside the old one, and test both");
}

#[test]
fn future_version_is_told_from_damage() {
    // The version stands in the header as text.
    let at = V1.windows(10).position(|w| w == b"version\\\":").expect("the version in the header") + 10;
    let mut future = V1.to_vec();
    future[at] = b'7';
    assert_eq!(Asset::from_bytes(&future).err(), Some(Error::Version(7)));
}

/// One thing that happens to files.
#[derive(Clone, Debug)]
enum Harm {
    Overwrite(usize, Vec<u8>),
    Insert(usize, Vec<u8>),
    Remove(usize, usize),
    Swap(usize, usize, usize),
}

fn harm() -> impl Strategy<Value = Harm> {
    let at = 0..V1.len();
    // Half of all places in the header, where the structure is.
    let at = prop_oneof![0..400usize, at];
    let bytes = prop::collection::vec(any::<u8>(), 1..16);
    prop_oneof![
        (at.clone(), bytes.clone()).prop_map(|(at, bytes)| Harm::Overwrite(at, bytes)),
        (at.clone(), bytes).prop_map(|(at, bytes)| Harm::Insert(at, bytes)),
        (at.clone(), 1..64usize).prop_map(|(at, n)| Harm::Remove(at, n)),
        (at.clone(), at, 1..32usize).prop_map(|(a, b, n)| Harm::Swap(a, b, n)),
    ]
}

fn apply(bytes: &mut Vec<u8>, harm: &Harm) {
    let end = bytes.len();
    match harm {
        Harm::Overwrite(at, new) => {
            let at = *at.min(&end);
            let n = new.len().min(end - at);
            bytes[at..at + n].copy_from_slice(&new[..n]);
        }
        Harm::Insert(at, new) => {
            bytes.splice(at.min(&end)..at.min(&end), new.iter().copied());
        }
        Harm::Remove(at, n) => {
            bytes.drain(*at.min(&end)..(at + n).min(end));
        }
        Harm::Swap(a, b, n) => {
            (0..*n).filter(|i| a + i < end && b + i < end).for_each(|i| bytes.swap(a + i, b + i))
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) })]

    #[test]
    fn harmed_assets_are_errors_in_one_line(harms in prop::collection::vec(harm(), 1..4)) {
        let mut bytes = V1.to_vec();
        harms.iter().for_each(|h| apply(&mut bytes, h));
        match Asset::from_bytes(&bytes) {
            Err(error) => prop_assert!(!error.to_string().contains('\n'), "{}", error),
            Ok(_) => prop_assert!(bytes == V1, "harm went unnoticed"),
        }
    }

    #[test]
    fn random_bytes_are_errors(bytes in prop::collection::vec(any::<u8>(), 0..512)) {
        prop_assert!(Asset::from_bytes(&bytes).is_err());
    }

    #[test]
    fn lengths_are_not_trusted(length: u64, rest in prop::collection::vec(any::<u8>(), 0..64)) {
        let bytes = [&length.to_le_bytes()[..], b"{\"__metadata__\":{", &rest].concat();
        prop_assert!(Asset::from_bytes(&bytes).is_err());
    }
}
