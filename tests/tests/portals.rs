//! Interiors lit through portals: closed forms and limits, a brute-force oracle, the path-traced reference.

mod bounced;
mod glass;
mod limits;
mod naive;
mod truth;
