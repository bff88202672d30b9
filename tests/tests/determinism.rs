//! The same scene, options and seed give the same bytes.

use lunette_bake::Options;
use lunette_tests::baked::{baked, scene};

fn bytes(options: Options) -> Vec<u8> {
    // More vertices than one task takes, so that two threads share the work.
    let asset = baked(&scene("cylinder-on-plane:edge=0.5"), &options);
    asset.to_bytes().expect("an asset")
}

fn options() -> Options {
    Options { rays: 128, order: 3, indirect_order: 3, bounces: 2, ..Options::default() }
}

#[test]
fn bytes_do_not_depend_on_the_number_of_threads() {
    let one = bytes(Options { threads: 1, ..options() });
    for threads in [2, 3] {
        assert!(
            bytes(Options { threads, ..options() }) == one,
            "{threads} threads give other bytes than one"
        );
    }
}

#[test]
fn bytes_depend_on_the_seed() {
    assert!(bytes(Options { seed: 2, ..options() }) != bytes(options()));
}
