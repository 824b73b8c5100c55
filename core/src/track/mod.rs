//! Labelled, complete trajectories from what a capture system measures.

pub mod markers;
pub mod rope;
