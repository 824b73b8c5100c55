//! Turns meshes and motion captures into the asset that `sinew-core` reads.
//!
//! Data flows one way; a module uses only the ones above it:
//!
//! | module | takes | gives |
//! | --- | --- | --- |
//! | [`import`] | files | `Raw…` values, as the file states them |
//! | [`model`] | `Raw…` values | validated meshes, skeletons, skins and clips |
//! | [`take`] | `Raw…` values | validated marker captures |
//! | [`spatial`] | triangles | nearest points, first hits of rays |
//! | [`clean`] | a marker capture | the same, merged, filled and smoothed |
//! | [`fit`] | a motion and a body | a clip that moves the body |
//! | [`simplify`] | a body | the same with fewer vertices |
//! | [`bake`] | a validated body | the asset |
//! | [`mod@reference`] | a body or an asset | what the core should compute, in `f64` |
//! | [`studio`] | a body and a seed | virtual captures with the truth beside them |
//! | [`live`] | datagrams | motion as it arrives, poses of a body |
//! | [`label`] | unlabelled points and a marker model | what the core labels and fills |
//! | [`play`], [`verify`] | an asset and motion | what the core computes, and how far off it is |
//! | [`film`], [`export`] | validated values, frames | pictures, files that other programs read |
//! | [`cli`] | a command line | all of it |
//!
//! Lengths are metres, angles radians, times seconds, Y is up. Host arithmetic is `f64`.
#![forbid(unsafe_code)]

pub mod bake;
pub mod clean;
pub mod cli;
pub mod export;
pub mod film;
pub mod fit;
pub mod import;
pub mod label;
pub mod live;
pub mod model;
pub mod play;
pub mod reference;
pub mod simplify;
pub mod spatial;
pub mod studio;
pub mod take;
pub mod verify;
