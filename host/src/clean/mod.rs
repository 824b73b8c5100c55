//! Broken marker trajectories to complete, smooth, labelled motion.
//!
//! Enters: a [`Take`](crate::take::Take) with gaps. Leaves: the same markers without them, and how
//! sure each filled sample is. Park & Hodgins 2006, section 4.
//!
//! | stage | does |
//! | --- | --- |
//! | [`exchange`] | named trajectories that carry each other's marker are found |
//! | [`surface`] | which markers are neighbours along the body |
//! | [`merge`] | unnamed partial trajectories become markers |
//! | [`despike`] | one or two samples that jump away are taken out |
//! | [`fill`] | missing samples are estimated |
//! | [`smooth`] | noise is filtered out in the local frame |

mod despike;
pub mod exchange;
pub mod fill;
pub(crate) mod linear;
pub mod merge;
pub(crate) mod neighbours;
pub(crate) mod rigid;
pub mod smooth;
pub mod surface;

pub use despike::{Spike, despike};
