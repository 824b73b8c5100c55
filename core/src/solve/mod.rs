//! Linear systems that are prepared once and solved every frame, assignments, and small dense
//! problems.

pub mod assignment;
pub mod dense;
pub mod sparse;
