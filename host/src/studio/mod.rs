//! Virtual captures: a known motion is filmed, disturbed and written down, and the truth is kept.
//!
//! | stage | takes | gives |
//! | --- | --- | --- |
//! | [`performance`] | a clip of a body | smooth motion inside the volume |
//! | [`flesh`] | body and motion | muscles, breath and jiggle as modes with amplitudes |
//! | [`body`] | both | the true surface in any frame |
//! | [`markers`] | the rest shape | markers glued to triangles |
//! | [`cameras`] | a ring's measures | pinhole cameras |
//! | [`visibility`] | surface, markers, cameras | who sees whom, by ray casting |
//! | [`capture`] | all of it | broken, unlabelled trajectories, and the truth |
//! | [`files`], [`pictures`] | a capture | marker takes, C3D, JSON, NPY, pictures |
//! | [`judge`] | a capture and what cleaning made of it | wrong labels, errors |
//!
//! [`rope`] is the same for a rope. One seed, one capture: on every machine, with any number of
//! threads.

mod anatomy;
pub mod body;
pub mod cameras;
pub mod capture;
mod error;
pub mod files;
pub mod flesh;
pub mod judge;
pub mod markers;
pub mod performance;
mod performed;
pub mod pictures;
pub(crate) mod random;
pub mod rope;
mod track;
pub mod visibility;

pub use body::{Body, Scene, Surface};
pub use cameras::{Camera, Ring};
pub use capture::{Capture, Sample, Shot, Statistics, Truth};
pub use error::StudioError;
pub use flesh::{Flesh, FleshOptions};
pub use markers::{Marker, MarkerLayout, MarkerSet};
pub use performance::{Direction, Performance};
pub use performed::performed;
pub use visibility::Sight;
