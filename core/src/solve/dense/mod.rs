//! Small dense problems of a frame, each with a fixed number of operations.
//!
//! - [`symmetric_eigen`]: eigenvalues and eigenvectors of symmetric matrices.
//! - [`absolute_orientation`]: the rotation and translation that bring points onto others.
//! - [`ldlt`]: symmetric positive definite systems in the caller's memory.

mod eigen;
pub mod ldlt;
mod orientation;

pub(crate) use eigen::JACOBI_ROTATIONS;
pub use eigen::symmetric_eigen;
pub use orientation::{Pair, Rigid, absolute_orientation};
