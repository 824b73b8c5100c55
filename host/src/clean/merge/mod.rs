//! Partial trajectories to markers (Park & Hodgins 2006, section 4.2, without the handwork).
//!
//! Enters: a take whose columns break at every occlusion. Leaves: one trajectory a marker, and the
//! evidence for each merge. A marker that is out of sight is carried along by the absolute
//! orientation of its neighbours (`carry`); a fragment that follows the carried position all its
//! life belongs to it. The surest merges come first, and each helps the next.

use crate::import::take::PointKind;
use crate::take::{Take, TakeError};

mod carry;
mod choose;
mod fragments;
mod rounds;

pub use fragments::Fragment;

/// What [`merge`] is asked to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergeOptions {
    /// Largest mean distance of a fragment from where its marker is expected, over the marker's
    /// mean distance to its neighbours (the paper's alpha 1).
    pub mean: f64,
    /// The same for every frame of the fragment (alpha 2).
    pub every: f64,
    /// The frame whose points become the markers where none are named; by default the frame that
    /// shows most.
    pub reference_frame: Option<usize>,
}

impl Default for MergeOptions {
    fn default() -> Self {
        Self {
            mean: 0.5,
            every: 0.6,
            reference_frame: None,
        }
    }
}

/// A decision about one fragment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// Which fragment, of [`Merged::fragments`].
    pub fragment: usize,
    /// Which marker of the result.
    pub marker: usize,
    /// Mean distance from where the marker was expected, over its neighbour distance.
    pub mean: f64,
    /// Largest such distance.
    pub worst: f64,
    /// Least number of neighbours that carried the marker.
    pub support: usize,
    /// Mean distance, over neighbour distance, of the best other marker that was missing.
    pub other: f64,
    /// Whether the thresholds were passed only after they were widened, or another marker was
    /// nearly as near.
    pub doubtful: bool,
}

/// What became of a take.
#[derive(Clone, Debug, PartialEq)]
pub struct Merged {
    /// One trajectory a marker.
    pub take: Take,
    /// The partial trajectories of the source, split where they jump.
    pub fragments: Vec<Fragment>,
    /// `[fragments]`: the marker that each belongs to; `None` for ghosts.
    pub owners: Vec<Option<usize>>,
    /// Merges, in the order in which they were made.
    pub decisions: Vec<Decision>,
    /// Frames in which a trajectory of the source jumped (swaps): (column, frame).
    pub jumps: Vec<(usize, usize)>,
    /// The frame that named the markers, where none had names.
    pub reference_frame: Option<usize>,
}

/// Merges the partial trajectories of a take.
///
/// Named columns are markers already; unnamed ones ([`PointKind::Unlabelled`]) are taken apart
/// into fragments at every gap and merged into them. Without any name, the points of the reference
/// frame become the markers `M1`, `M2` and so on, and a long fragment that no marker explains
/// becomes one more. A take without unnamed columns comes back as it is. About fragments times
/// missing markers nearby, in each of a few rounds.
///
/// # Errors
/// The result is no take; it cannot happen for a valid take.
///
/// # Panics
/// If the reference frame does not exist.
pub fn merge(take: &Take, options: &MergeOptions) -> Result<Merged, TakeError> {
    let named: Vec<usize> = (0..take.marker_count())
        .filter(|&column| take.kinds()[column] != PointKind::Unlabelled)
        .collect();
    let unnamed = named.len() < take.marker_count();
    let (fragments, jumps) = if unnamed {
        fragments::split(take)
    } else {
        (Vec::new(), Vec::new())
    };
    let mut work = rounds::Work::new(take, &named, fragments);
    let mut reference_frame = None;
    if named.is_empty() && unnamed {
        let frame = options.reference_frame.or_else(|| work.fullest_frame());
        if let Some(frame) = frame {
            work.name_markers_of(frame);
        }
        reference_frame = frame;
    }
    work.run(options);
    let mut merged = Merged {
        take: take.clone(),
        owners: work.owners,
        decisions: work.decisions,
        fragments: work.fragments,
        jumps,
        reference_frame,
    };
    if unnamed {
        merged.take = take.with_trajectories(work.labels, work.positions)?;
    }
    Ok(merged)
}

impl Merged {
    /// Fragments that belong to no marker.
    #[must_use]
    pub fn ghosts(&self) -> Vec<usize> {
        let all = 0..self.fragments.len();
        all.filter(|&at| self.owners[at].is_none()).collect()
    }

    /// Merges that a person may want to look at.
    pub fn doubtful(&self) -> impl Iterator<Item = &Decision> {
        self.decisions.iter().filter(|decision| decision.doubtful)
    }
}

#[cfg(test)]
mod tests;
