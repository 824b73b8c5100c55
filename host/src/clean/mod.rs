//! Broken marker trajectories to complete, smooth, labelled motion.
//!
//! Enters: a [`Take`](crate::take::Take) with gaps. Leaves: the same markers without them, and how
//! sure each filled sample is. Park & Hodgins 2006, section 4.

mod despike;
pub mod fill;
mod linear;
pub mod merge;
mod neighbours;
mod rigid;
pub mod smooth;

pub use despike::{Spike, despike};
