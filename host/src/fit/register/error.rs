//! Why a mesh cannot be registered.

use glam::DVec3;

use crate::fit::laplace::LaplaceError;

/// Why a mesh cannot be fitted to markers. Each carries the facts and ends with what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RegisterError {
    /// Nothing to fit.
    #[error("the mesh has no triangle with an area; give a triangle mesh")]
    NoSurface,
    /// Too few points to say how a body stands.
    #[error(
        "{count} markers in the reference frame, where at least {needed} are needed; choose a frame that shows more, or clean the take first"
    )]
    FewMarkers {
        /// Markers seen.
        count: usize,
        /// Fewest that do.
        needed: usize,
    },
    /// Markers in one place or on a line.
    #[error(
        "the markers of the reference frame lie within {extent:.4} m; check the unit of the take"
    )]
    NoExtent {
        /// Largest side of the box around them.
        extent: f64,
    },
    /// No pose brings mesh and markers together.
    #[error(
        "the mesh stays {millimetres:.0} mm from the markers on average, which is too far; choose a frame in a pose like the mesh's, check units, or give landmarks"
    )]
    NoFit {
        /// Mean distance of the markers from the aligned mesh.
        millimetres: f64,
    },
    /// A landmark without a marker or a vertex.
    #[error("landmark {landmark}: {what} {index} does not exist: there are {count}; correct it")]
    BadLandmark {
        /// Which landmark, from 0.
        landmark: usize,
        /// Marker or vertex.
        what: &'static str,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// Marker positions that are no places.
    #[error("marker {marker} is at {position}, which is not a place; correct or remove it")]
    BadMarker {
        /// Which marker.
        marker: usize,
        /// Its coordinates.
        position: DVec3,
    },
    /// An option out of its range.
    #[error("{name} is {value} and must be {range}")]
    BadOption {
        /// Which option.
        name: &'static str,
        /// What was given.
        value: f64,
        /// What may be given.
        range: &'static str,
    },
    /// Triangles that stay inside out whatever is done.
    #[error(
        "{count} triangles stay turned inside out, the first around ({x:.3}, {y:.3}, {z:.3}) m of the mesh; remove markers that contradict each other there",
        x = .place.x, y = .place.y, z = .place.z
    )]
    Folded {
        /// How many.
        count: usize,
        /// A corner of the first, in the mesh's space.
        place: DVec3,
    },
    /// The systems cannot be solved.
    #[error(transparent)]
    Solve(#[from] LaplaceError),
}
