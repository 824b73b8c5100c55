//! From a joint palette to vertices.
//!
//! Vertices stand in blocks of eight; a block holds (bind, eight weights) slots. A lane of a
//! vector register is a vertex, so no sum ever crosses lanes and every register width gives the
//! same bits.

mod blocks;
mod dual;
mod job;
mod lanes;
pub mod laplacian;
mod linear;
mod morph;
mod output;
pub mod parts;
mod plain;
mod rigid;
mod skin;
mod store;
#[cfg(feature = "simd")]
mod transpose;

pub use crate::Level;
pub use job::{NormalMode, SkinJob, SkinMode, skin_blocks};
pub use output::{Attribute, Output, SizeError, VertexOrder};
pub use plain::{PlainMesh, skin_plain};
