//! Validated values out, as files that other programs read.

mod body;
pub mod glb;

pub use body::write_glb_of;
