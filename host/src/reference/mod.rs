//! Plain `f64` versions of every stage of the core, straight from the equations.
//!
//! Slow and simple on purpose: what the core computes is judged against these.

pub mod aim;
pub mod correctives;
pub mod dual;
pub mod laplacian;
pub mod marked;
pub mod markers;
pub mod morph;
pub mod parts;
pub mod pose;
pub mod rope;
pub mod skin;
mod unpack;

pub use unpack::{unpack, unpack_centres};
