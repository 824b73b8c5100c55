//! Why a body cannot be filmed.

use crate::fit::FitError;

/// A capture that cannot be made.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StudioError {
    /// A setting that is not finite or out of its range.
    #[error("{name} is {value}; it must be {range}")]
    OutOfRange {
        /// Setting.
        name: &'static str,
        /// What it holds.
        value: f64,
        /// What it may hold.
        range: &'static str,
    },
    /// A clip that names joints that the body does not have.
    #[error(
        "clip {clip:?} moves joint {joint}, but the body has {joint_count}; retarget it to the body"
    )]
    ForeignClip {
        /// The clip's name.
        clip: String,
        /// The joint.
        joint: usize,
        /// How many the body has.
        joint_count: usize,
    },
    /// A mesh without a surface.
    #[error("mesh {name:?} has no triangle with an area; give a body with a surface")]
    NoSurface {
        /// The mesh's name.
        name: String,
    },
    /// More markers than the surface has room for.
    #[error(
        "{wanted} markers do not fit: {room} vertices of the body may carry one; ask for fewer"
    )]
    TooManyMarkers {
        /// Asked for.
        wanted: usize,
        /// Room.
        room: usize,
    },
    /// A named marker set on a body whose joints are not understood.
    #[error("a named marker set needs a human body: {0}; ask for a number of markers instead")]
    NotHuman(#[from] FitError),
    /// A marker of a named set that has no place on the body.
    #[error("marker {marker} finds no skin: {why}; ask for a number of markers instead")]
    NoPlace {
        /// The marker.
        marker: String,
        /// What is missing.
        why: String,
    },
}

/// Refuses a value outside `low..=high` or one that is no number.
pub(super) fn within(
    name: &'static str,
    value: f64,
    low: f64,
    high: f64,
    range: &'static str,
) -> Result<(), StudioError> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(StudioError::OutOfRange { name, value, range })
    }
}
