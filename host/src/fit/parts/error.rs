//! Why a skin cannot be learnt from markers.

use sinew_core::deform::parts::PartsError;

use crate::fit::laplace::LaplaceError;

/// Why a skin cannot be learnt. Each carries the facts and ends with what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PartsFitError {
    /// Too little to learn from.
    #[error("{found} {what}, where at least {needed} are needed; {remedy}")]
    TooFew {
        /// Of what.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many are needed.
        needed: usize,
        /// What to do.
        remedy: &'static str,
    },
    /// A marker glued to vertices that do not exist.
    #[error("marker {marker} is glued to vertex {vertex} of {count}; glue it to the mesh")]
    Glue {
        /// Which marker.
        marker: usize,
        /// The vertex.
        vertex: u32,
        /// Vertices of the mesh.
        count: usize,
    },
    /// A frame that does not fit the markers, or misses one.
    #[error("frame {frame}, marker {marker} is missing; fill gaps first (sinew clean)")]
    Missing {
        /// Which frame.
        frame: usize,
        /// Which marker.
        marker: usize,
    },
    /// A frame in which the subject does not stand as the mesh does.
    #[error(
        "the markers are {mean_mm:.0} mm from the skin on average (marker {marker}: {worst_mm:.0} mm): \
         choose a frame in which the subject stands in the mesh's rest pose (--rest-frame), or \
         register the mesh to the markers first"
    )]
    OtherPose {
        /// Mean distance, millimetres.
        mean_mm: f64,
        /// The furthest marker.
        marker: usize,
        /// Its distance, millimetres.
        worst_mm: f64,
    },
    /// A surface that cannot be prepared.
    #[error(transparent)]
    Surface(#[from] LaplaceError),
    /// Tables that the core refuses.
    #[error("the learnt tables are refused: {0}")]
    Tables(#[from] PartsError),
}
