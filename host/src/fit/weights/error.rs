//! Why a mesh gets no weights.

/// Why a mesh gets no weights. Each carries the facts and ends with what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// Nothing to weigh.
    #[error("the mesh has no triangle with an area; give a triangle mesh, not a point cloud")]
    NoSurface,
    /// Nothing to hang the mesh on.
    #[error("the skeleton has no joint; give one that has")]
    NoJoints,
    /// A count that no vertex can have.
    #[error(
        "{found} influences a vertex are not possible; give 1 to {}",
        super::MOST_INFLUENCES
    )]
    Influences {
        /// As asked for.
        found: usize,
    },
    /// No inside to go through.
    #[error(
        "the surface encloses nothing: its triangles do not hang together, or lie in a plane; weld its vertices and close it, or choose simple weights"
    )]
    Hollow,
    /// Bones elsewhere than the mesh.
    #[error(
        "no bone of the skeleton lies inside the mesh; check that both have one unit and one place, or let the skeleton be fitted into the mesh"
    )]
    Beside,
    /// A system without a solution.
    #[error("the weights cannot be solved for: {0}")]
    Solve(String),
}
