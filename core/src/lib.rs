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
//! - `simd`: vector instructions through `fearless_simd`.
//! - `std`: detects them at run time.
//! - `defmt`: `defmt::Format` for errors and reports.
#![no_std]
#![forbid(unsafe_code)]

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
