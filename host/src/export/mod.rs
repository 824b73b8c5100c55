//! Validated values out, as files that other programs read.

pub mod c3d;
pub mod marker_csv;
pub mod trc;
