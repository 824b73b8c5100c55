//! Turns meshes and motion captures into the asset that `sinew-core` reads.
//!
//! Data flows one way; a module uses only the ones above it:
//!
//! | module | takes | gives |
//! | --- | --- | --- |
//! | [`import`] | files | `Raw…` values, as the file states them |
//! | [`model`] | `Raw…` values | validated meshes, skeletons, skins and clips |
//! | [`bake`] | a validated body | the asset |
//! | [`reference`] | a body or an asset | what the core should compute, in `f64` |
//! | [`fit`] | a motion and a body | a clip that moves the body |
//! | [`studio`] | a seed | virtual captures with the truth beside them |
//! | [`export`] | validated values | files that other programs read |
//!
//! Lengths are metres, angles radians, times seconds, Y is up. Host arithmetic is `f64`.
#![forbid(unsafe_code)]

pub mod bake;
pub mod export;
pub mod fit;
pub mod import;
pub mod model;
pub mod play;
pub mod reference;
pub mod studio;
pub mod verify;
