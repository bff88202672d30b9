//! The frame's loops compiled for AVX2: the same arithmetic on eight lanes at once.
//!
//! No intrinsics: [`chunk::run`] is inlined into a function with the feature. Nothing is contracted or reordered,
//! so that results are bit for bit those of the portable loops.
#![allow(unsafe_code, reason = "about 1.7 times the speed of the portable loops, see benches")]

use super::chunk::{self, Job};
use super::frame::{Probe, Scratch, Target};

/// Whether the work was done: false leaves it to the portable loops.
pub fn run(job: &Job<'_>, scratch: &mut Scratch, target: &mut Target<'_>, probe: &mut impl Probe) -> bool {
    if !is_x86_feature_detected!("avx2") {
        return false;
    }
    // SAFETY: the processor has just been seen to have AVX2, the one feature that the function is compiled for.
    unsafe { with_avx2(job, scratch, target, probe) };
    true
}

#[target_feature(enable = "avx2")]
fn with_avx2(job: &Job<'_>, scratch: &mut Scratch, target: &mut Target<'_>, probe: &mut impl Probe) {
    chunk::run(job, scratch, target, probe);
}
