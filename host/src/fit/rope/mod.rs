//! Ropes in a marker capture: found among a person's markers, followed, repaired.
//!
//! | stage | takes | gives |
//! | --- | --- | --- |
//! | [`points`] | a take | the unlabelled points of every frame |
//! | [`follow`](mod@follow) | points, a selection | a [`Trace`]: the rope's markers in order, frame by frame |
//! | [`both`] | a trace | the same, with what a pass backwards in time knows better |
//! | [`repair`](mod@repair) | measured samples | the gaps, from the frames before and after them |
//! | [`separate`](mod@separate) | a take, traces | the rope's markers and everybody else's |
//! | [`tube`](mod@tube) | a trace | a skinned tube in motion, alone or beside a body |
//!
//! The following itself is [`sinew_core::track::rope`]: what the host adds is the future.

pub mod both;
pub mod follow;
pub mod points;
pub mod repair;
pub mod separate;
#[cfg(test)]
mod tests;
mod tracklets;
pub mod tube;

use glam::DVec3;

pub use both::both_ways;
pub use follow::{FollowOptions, Selection, follow, follow_all};
pub use points::PointFrames;
pub use repair::{RepairOptions, repair};
pub use separate::{Separated, separate};
pub use tube::{TubeOptions, beside, tube};

/// Where a sample comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The point at this place of its frame.
    Measured(usize),
    /// Filled in.
    Filled,
    /// Filled in, and a guess.
    Lost,
}

/// One marker in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RopeSample {
    /// Metres.
    pub position: DVec3,
    /// Measured, filled or lost.
    pub origin: Origin,
    /// Frames since the marker was measured; 0 if it is.
    pub gap: u32,
    /// 0 to 1; a half where an error of 30 mm is expected.
    pub confidence: f64,
}

impl RopeSample {
    /// The point of the frame, if the sample is measured.
    #[must_use]
    pub fn point(&self) -> Option<usize> {
        match self.origin {
            Origin::Measured(point) => Some(point),
            _ => None,
        }
    }
}

/// A rope in every frame of a capture.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Frames a second.
    pub rate: f64,
    /// The frame in which the rope was found.
    pub start: usize,
    /// `[frames][markers]`, in order along the rope.
    pub frames: Vec<Vec<RopeSample>>,
}

impl Trace {
    /// Markers of the rope.
    #[must_use]
    pub fn marker_count(&self) -> usize {
        self.frames.first().map_or(0, Vec::len)
    }

    /// `[markers - 1]`: the median distance in metres from each marker to the next where both are
    /// measured; NaN where they never are. O(frames x markers)
    #[must_use]
    pub fn segment_lengths(&self) -> Vec<f64> {
        let segment = |i: usize| {
            let links = self.frames.iter().filter_map(|frame| {
                let both = frame[i].point().is_some() && frame[i + 1].point().is_some();
                both.then(|| frame[i].position.distance(frame[i + 1].position))
            });
            median(links.collect())
        };
        (1..self.marker_count()).map(|i| segment(i - 1)).collect()
    }
}

/// The middle value, NaN without any.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Why no rope was followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RopeError {
    /// No chain of points was found.
    #[error(
        "no evenly spaced chain of at least {wanted} markers in {frames} frames; select the rope's \
         markers by a box or by name, or state its marker count and spacing"
    )]
    NotFound {
        /// The fewest markers of a rope.
        wanted: usize,
        /// Frames that were searched.
        frames: usize,
    },
    /// A selected column is not in the capture.
    #[error("there is no marker {0:?}")]
    NoSuchMarker(String),
    /// Listed markers that no frame shows together.
    #[error(
        "no frame shows all {markers} listed markers; list markers that are seen at the same time, \
         or select them by a box"
    )]
    NeverTogether {
        /// How many are listed.
        markers: usize,
    },
    /// More points in a frame than are followed.
    #[error("frame {frame} holds {points} points; at most {most} are followed")]
    TooManyPoints {
        /// The frame.
        frame: usize,
        /// Its points.
        points: usize,
        /// The limit.
        most: usize,
    },
    /// The tracker refuses its settings.
    #[error("{0}")]
    Settings(#[from] sinew_core::track::rope::ConfigError),
}
