//! Linear systems that are prepared once and solved every frame, and assignments.

pub mod assignment;
pub mod sparse;
