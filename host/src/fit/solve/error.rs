//! Why no skeleton can be solved.

/// Why no skeleton can be solved from a take. Each carries the facts and ends with what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// Markers or frames are missing altogether.
    #[error("there are no marker samples in it; nothing to solve")]
    Empty,
    /// A standard set was asked for, and its labels are not there.
    #[error(
        "{found} of {count} labels are known landmarks, and {needed}; rename the markers, or solve without labels (--set groups)"
    )]
    UnknownLabels {
        /// Known labels.
        found: usize,
        /// All labels.
        count: usize,
        /// What is missing.
        needed: &'static str,
    },
    /// The markers do not form rigid groups.
    #[error(
        "no {needed} markers keep their distances to {millimetres:.0} mm over the take; clean it first (sinew clean), or name the markers by a standard set"
    )]
    NoGroups {
        /// Markers that a group needs.
        needed: usize,
        /// Largest deviation accepted.
        millimetres: f64,
    },
    /// No frame shows enough markers to start from.
    #[error(
        "no frame shows the markers from which the body's place follows ({needed}); cut the take to where they are seen, or clean it first (sinew clean)"
    )]
    NoStart {
        /// What is needed.
        needed: String,
    },
}
