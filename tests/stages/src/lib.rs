//! Stages of the core as they are measured and hashed: the same functions on a desktop, in wasm
//! and on a Cortex-M.
//!
//! A stage takes an asset and memory, runs a whole clip or take, and returns the hash of what it
//! put out. One file a stage: `pub fn run` with the signature of [`Run`] but for the probe, and a
//! row in [`ALL`]. The firmware links only the stage that it measures.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "parts")]
pub mod actor;
pub mod crowd;
pub mod halves;
#[cfg(feature = "laplacian")]
pub mod laplacian;
pub mod markers;
mod memory;
#[cfg(feature = "modes")]
pub mod modes;
#[cfg(feature = "parts")]
pub mod parts;
pub mod rope;
pub mod skin;
mod worst;

use core::fmt;

use sinew_core::asset::AssetError;
use sinew_core::deform::{Level, SizeError};
use sinew_core::frame::FrameReport;

pub use memory::Memory;

/// Where a stage tells what it does.
pub trait Probe {
    /// Runs the work of one frame; whoever measures counts it under `name`.
    fn count<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T;

    /// A size or a count: `bytes_…` has a budget.
    fn number(&mut self, name: &'static str, value: u64);

    /// Asks for `icount_<name>`: the mean of `whole`, less that of `part`, each divided by
    /// `divisor`.
    fn per(&mut self, name: &'static str, whole: &'static str, part: &'static str, divisor: u64);
}

/// Measures nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unmeasured;

impl Probe for Unmeasured {
    #[inline]
    fn count<T>(&mut self, _: &'static str, work: impl FnOnce() -> T) -> T {
        work()
    }

    fn number(&mut self, _: &'static str, _: u64) {}

    fn per(&mut self, _: &'static str, _: &'static str, _: &'static str, _: u64) {}
}

/// A stage: asset, instructions to use, memory, probe; the hash of all output.
pub type Run = fn(&[u8], Level, &mut [f32], &mut Unmeasured) -> Result<u64, Fault>;

/// All stages by name.
pub const ALL: &[(&str, Run)] = &[
    #[cfg(feature = "parts")]
    ("actor", actor::run::<Unmeasured>),
    ("crowd", crowd::run::<Unmeasured>),
    ("halves", halves::run::<Unmeasured>),
    #[cfg(feature = "laplacian")]
    ("laplacian", laplacian::run::<Unmeasured>),
    ("markers", markers::run::<Unmeasured>),
    #[cfg(feature = "modes")]
    ("modes", modes::run::<Unmeasured>),
    #[cfg(feature = "parts")]
    ("parts", parts::run::<Unmeasured>),
    ("rope", rope::run::<Unmeasured>),
    ("skin", skin::run::<Unmeasured>),
];

/// Why a stage did not run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// The asset is not sound.
    Asset(AssetError),
    /// A buffer does not fit.
    Size(SizeError),
    /// The memory given is too small.
    Memory {
        /// Numbers needed.
        needed: usize,
        /// Numbers left.
        left: usize,
    },
    /// The asset does not hold what the stage plays.
    Nothing,
    /// A frame that was not whole.
    Frame(FrameReport),
}

impl From<AssetError> for Fault {
    fn from(error: AssetError) -> Self {
        Self::Asset(error)
    }
}

impl From<SizeError> for Fault {
    fn from(error: SizeError) -> Self {
        Self::Size(error)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Asset(error) => write!(f, "the asset: {error}"),
            Self::Size(error) => write!(f, "a buffer: {error}"),
            Self::Memory { needed, left } => {
                write!(f, "{needed} numbers of memory needed, {left} left")
            }
            Self::Nothing => write!(f, "the asset does not hold what this stage plays"),
            Self::Frame(report) => write!(f, "a frame was not whole: {report:?}"),
        }
    }
}

impl core::error::Error for Fault {}
