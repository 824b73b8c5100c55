//! Validated values out, as files that other programs read.
//!
//! Every file is written beside its final name first and renamed when complete ([`atomic`]), so a
//! failed export leaves an older file as it was.

pub mod atomic;
mod body;
pub mod bvh;
pub mod c3d;
mod error;
pub mod gif;
pub mod glb;
pub mod marker_csv;
pub mod npy;
pub mod obj;
pub mod plot;
pub mod png;
pub mod render;
pub mod sheet;
pub mod trc;

pub use atomic::write_atomic;
pub use body::write_glb_of;
pub use error::{ExportError, ExportErrorKind};
pub use npy::NpyWriter;

#[cfg(test)]
mod test_folder;
