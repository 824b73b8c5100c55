//! Surfaces driven by a handful of markers, without a skeleton (de Aguiar et al. 2007).
//!
//! In: a triangle mesh and the vertices that carry markers. [`Surface`] factors the systems;
//! [`Surface::exact`] gives the core's tables for solving them each frame, [`collapse()`] those for
//! streaming instead. [`rotations`] finds how markers turn, [`suggest`](mod@suggest) where to put
//! them, and [`repair`](mod@repair) makes a scan fit for all this.

pub mod align;
pub mod cholesky;
pub mod collapse;
pub mod drive;
mod error;
pub(super) mod nearest;
pub mod operator;
pub mod pairs;
pub mod picture;
pub mod repair;
pub mod rig;
pub mod rotations;
pub(crate) mod shares;
pub mod suggest;
mod surface;
pub mod template;
pub mod volume;

pub use crate::model::graph;
pub use collapse::{CollapseOptions, CollapseReport, CollapsedTables, collapse, collapse_within};
pub use drive::{DriveOptions, Driven, drive};
pub use error::{Component, LaplaceError};
pub use pairs::{Pair, Pairs};
pub use rotations::MarkerTarget;
pub use surface::{ExactTables, Surface, SurfaceOptions};
pub use template::Template;
