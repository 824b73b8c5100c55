//! Validated values out, as files that other programs read.
//!
//! Every file is written beside its final name first and renamed when complete ([`atomic`]), so a
//! failed export leaves an older file as it was.

pub mod atomic;
mod error;
pub mod gif;
pub mod npy;
pub mod plot;
pub mod png;
pub mod render;

pub use error::{ExportError, ExportErrorKind};

#[cfg(test)]
mod test_folder;
