//! Why parts cannot be joined.

use crate::fit::weights::WeightsError;

/// Why parts cannot be joined. Each carries the facts and ends with what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum JoinError {
    /// Nothing to join.
    #[error(
        "the mesh has {count} part; give one whose parts are groups of their own (\"g NAME\" in an OBJ), or use `sinew rig` for a body in one piece"
    )]
    TooFewParts {
        /// Parts with a triangle.
        count: usize,
    },
    /// Joints are named after parts.
    #[error("two parts are called {name:?}; name each after its joint")]
    SameName {
        /// The name.
        name: String,
    },
    /// Parts that are closed, or too far apart.
    #[error(
        "no part has an open border that faces another part ({open} borders are open); leave the parts open where they were cut, in the pose in which they were cut, or allow wider gaps with --gap"
    )]
    NothingFaces {
        /// Open borders in the mesh.
        open: usize,
    },
    /// What the weights need.
    #[error(transparent)]
    Weights(#[from] WeightsError),
}
