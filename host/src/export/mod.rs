//! Validated values out, as files that other programs read.

pub mod glb;
