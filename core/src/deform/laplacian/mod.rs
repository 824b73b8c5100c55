//! Surfaces driven by markers alone: Laplacian deformation (de Aguiar et al. 2007, section 3.3).
//!
//! A marker gives a position and a rotation; the rotations spread over the surface as harmonic
//! fields of quaternions, turn the differential coordinates, and the surface is what fits both.
//!
//! - [`Exact`] solves that system each frame: two pairs of sparse substitutions.
//! - [`Collapsed`] streams over blocks instead: `v = sum_k (R_k b_k + n_k p_k)`, with coefficients
//!   fitted beforehand to exact solutions.
//!
//! Both borrow checked arrays, follow turns of any number of revolutions ([`TurnState`]) and keep
//! the last good pose of a marker whose input is not a number.

mod collapsed;
mod collapsed_check;
mod error;
mod exact;
mod exact_check;
mod turns;

pub use collapsed::{Collapsed, CollapsedParts};
pub use error::{LaplacianError, Table};
pub use exact::{Exact, ExactParts, LEAST_CONDUCTION, exact_workspace_len};
pub(crate) use turns::TurnStage;
pub use turns::{MarkerPose, TurnReport, TurnState, turn_state_len};
