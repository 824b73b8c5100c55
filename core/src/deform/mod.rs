//! From a joint palette to vertices.
//!
//! Vertices stand in blocks of eight; a block holds (bind, eight weights) slots. A lane of a
//! vector register is a vertex, so no sum ever crosses lanes and every register width gives the
//! same bits.

mod blocks;
mod bounds;
mod dual;
mod job;
mod lanes;
pub mod laplacian;
mod linear;
mod morph;
mod octahedral;
mod output;
pub mod parts;
mod plain;
mod rest;
mod rigid;
mod skin;
mod store;
mod tables;
#[cfg(feature = "simd")]
mod transpose;
mod vertices;

pub use crate::Level;
pub use bounds::{Bounds, posed_bounds};
pub use job::{NormalMode, SkinJob, SkinMode, skin_blocks};
pub use output::{Attribute, Output, SizeError, VertexOrder};
pub use plain::{PlainMesh, skin_plain};
pub use rest::{rest_shape, rest_tangents};
