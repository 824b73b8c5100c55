//! Why no skeleton can be fitted into a mesh.

use crate::fit::FitError;

/// Why no skeleton can be fitted into a mesh. Each carries the facts and ends with what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RigError {
    /// Nothing to stand in.
    #[error("the mesh has no triangle with an area; give a triangle mesh, not a point cloud")]
    NoSurface,
    /// No inside to stand in.
    #[error(
        "the surface encloses nothing: its triangles do not hang together, or lie in a plane; weld its vertices and close it"
    )]
    Hollow,
    /// A skeleton that is no human's.
    #[error(transparent)]
    NoHuman(#[from] FitError),
    /// Left and right, or up and down, do not show in the skeleton.
    #[error(
        "the skeleton's rest pose does not show which way is left and up; check the joints that play its hips, legs and head"
    )]
    NoDirections,
    /// A limb that cannot be found.
    #[error(
        "no {limb} can be found in the mesh: {why}; the body must stand upright (Y up) in a T- or A-pose, apart from what is not its own"
    )]
    NoLimb {
        /// Which.
        limb: &'static str,
        /// What was seen instead.
        why: String,
    },
}
