//! Tests across crates, cheapest first: closed forms, invariants, a brute-force oracle, the path-traced reference.

mod architecture;
mod closed_forms;
mod determinism;
mod file_format;
mod furnace;
mod glossy;
mod leaks;
mod oracle;
mod portals;
mod real_terrain;
mod reference;
