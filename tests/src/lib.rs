//! The harness of the tests across crates: small scenes, a brute-force oracle that shares no code with the baker,
//! and short ways to bake and relight.

pub mod baked;
pub mod brute;
pub mod closed_form;
pub mod interior;
pub mod measure;
pub mod sheets;
