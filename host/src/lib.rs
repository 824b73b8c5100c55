//! Turns meshes and motion captures into the asset that `sinew-core` reads.
//!
//! Data flows one way; a module uses only the ones above it:
//!
//! | module | takes | gives |
//! | --- | --- | --- |
//! | [`import`] | files | `Raw…` values, as the file states them |
//! | [`model`] | `Raw…` values | validated meshes, skeletons, skins and clips |
//! | [`export`] | validated values | files that other programs read |
//!
//! Lengths are metres, angles radians, times seconds, Y is up. Host arithmetic is `f64`.
#![forbid(unsafe_code)]

pub mod export;
pub mod import;
pub mod model;
pub mod studio;
