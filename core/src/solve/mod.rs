//! Linear systems that are prepared once and solved every frame, and small dense problems.

pub mod dense;
pub mod sparse;
