//! Linear systems that are prepared once and solved every frame.

pub mod sparse;
