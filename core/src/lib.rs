//! Real-time avatar runtime: `no_std`, no allocation, no panic, the same bits on every machine.
//!
//! | layer | takes | gives |
//! | --- | --- | --- |
//! | [`asset`] | bytes | typed views, checked once |
//! | [`pose`] | a clip and a time, or a caller's pose | joint matrices |
//! | [`solve`] | a factored sparse system; an assignment | its solution |
//! | [`track`] | unlabelled points | a body's or a rope's markers, without gaps |
//! | [`deform`] | joint matrices | vertices, in blocks of eight |
//! | [`frame`] | input and budget | a whole frame and a report |
//!
//! A module uses only the ones above it. [`math`] holds all arithmetic that reaches the output.
//! Lengths are metres, times seconds; Y is up; quaternions are x, y, z, w; matrices are rows of
//! 3 x 4. `SPEC.md` describes every byte of an asset, `DESIGN.md` says why.
//!
//! # Features
//! On by default, so that a firmware can leave out the code of what its asset does not hold:
//! - `laplacian`: surfaces that follow their joints as markers.
//! - `marker-skin`: skins that dense markers drive.
//! - `modes`: skinning other than linear, normals by the inverse transpose.
//!
//! Off by default:
//! - `simd`: vector instructions through `fearless_simd`.
//! - `std`: detects them at run time.
//! - `defmt`: `defmt::Format` for errors and reports.
//! - `micromath`: less exact arithmetic for cores without a fast floating-point unit. Its bits are
//!   not those of other builds: [`math`] states the errors.
#![no_std]
#![forbid(unsafe_code)]
// A feature that is left out leaves code that nothing calls, and the linker drops.
#![cfg_attr(
    not(all(feature = "laplacian", feature = "marker-skin", feature = "modes")),
    allow(dead_code)
)]

pub mod asset;
pub mod deform;
pub mod frame;
mod level;
pub mod math;
pub mod pose;
mod row;
pub mod solve;
pub mod track;

pub use level::Level;
