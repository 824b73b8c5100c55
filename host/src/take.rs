//! A validated marker capture: metres, Y up, one trajectory a marker.
//!
//! Enters: a [`RawTake`](crate::import::take::RawTake). Leaves: a [`Take`] whose counts agree and whose samples are finite or
//! missing; it remembers the space of its source, so that [`Take::to_raw`] gives source
//! coordinates back.

use std::ops::Range;

use glam::{DMat3, DVec3};

use crate::import::take::{LengthUnit, PointKind, RawEvent, UpAxis};

mod convert;

/// Units and axes of a capture's source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SourceSpace {
    /// Length of one source unit.
    pub unit: LengthUnit,
    /// Source axis that points up.
    pub up: UpAxis,
}

impl SourceSpace {
    /// Metres, Y up: the space of a [`Take`] itself.
    pub const METRES_Y_UP: Self = Self {
        unit: LengthUnit::Metre,
        up: UpAxis::PlusY,
    };

    /// The matrix from source coordinates to metres with Y up; a rotation times the unit.
    #[must_use]
    pub fn to_metres(self) -> DMat3 {
        self.up.to_y_up() * self.unit.metres()
    }
}

/// Marker trajectories in metres, Y up, evenly sampled.
///
/// Trajectories lie one after another, so that a marker's samples are one slice.
#[derive(Clone, Debug, PartialEq)]
pub struct Take {
    labels: Vec<String>,
    kinds: Vec<PointKind>,
    rate: f64,
    first_frame: u64,
    frame_count: usize,
    /// `[markers x frames]`; NaN where missing.
    positions: Vec<DVec3>,
    source: SourceSpace,
    events: Vec<RawEvent>,
}

/// Why values are not a take.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TakeError {
    /// Lengths that contradict each other.
    #[error("{what}: {found} given, {expected} expected")]
    Mismatch {
        /// Which list.
        what: &'static str,
        /// Its length.
        found: usize,
        /// What the others ask for.
        expected: usize,
    },
    /// A frame rate that is not above zero.
    #[error("the frame rate is {0} Hz; state one above 0")]
    Rate(f64),
    /// An infinite coordinate.
    #[error("marker {marker}, frame {frame} is not finite; remove it or mark it as missing")]
    NotFinite {
        /// Index of the marker.
        marker: usize,
        /// Index of the frame.
        frame: usize,
    },
}

fn expect_len(what: &'static str, found: usize, expected: usize) -> Result<(), TakeError> {
    if found == expected {
        Ok(())
    } else {
        Err(TakeError::Mismatch {
            what,
            found,
            expected,
        })
    }
}

impl Take {
    /// A take of named markers; `trajectories` is `[markers x frames]`, metres, Y up, NaN in any
    /// coordinate where missing.
    ///
    /// # Errors
    /// The lengths disagree, the rate is not above 0, or a coordinate is infinite.
    pub fn new(
        labels: Vec<String>,
        rate: f64,
        frame_count: usize,
        trajectories: Vec<DVec3>,
    ) -> Result<Self, TakeError> {
        let expected = labels.len().saturating_mul(frame_count);
        expect_len("samples", trajectories.len(), expected)?;
        if !(rate.is_finite() && rate > 0.0) {
            return Err(TakeError::Rate(rate));
        }
        let mut positions = trajectories;
        for (index, position) in positions.iter_mut().enumerate() {
            if position.is_nan() {
                *position = DVec3::NAN;
            } else if !position.is_finite() {
                let (marker, frame) = (index / frame_count, index % frame_count);
                return Err(TakeError::NotFinite { marker, frame });
            }
        }
        let kinds = labels
            .iter()
            .map(|label| PointKind::of_label(label))
            .collect();
        let source = SourceSpace::METRES_Y_UP;
        Ok(Self {
            labels,
            kinds,
            rate,
            first_frame: 1,
            frame_count,
            positions,
            source,
            events: Vec::new(),
        })
    }

    /// Other trajectories in the same frames, rate and source space: what merging or splitting
    /// markers gives. `trajectories` is `[markers x frames]`, metres, NaN where missing.
    ///
    /// # Errors
    /// As [`Take::new`].
    pub fn with_trajectories(
        &self,
        labels: Vec<String>,
        trajectories: Vec<DVec3>,
    ) -> Result<Self, TakeError> {
        let mut take = Self::new(labels, self.rate, self.frame_count, trajectories)?;
        take.first_frame = self.first_frame;
        take.source = self.source;
        take.events.clone_from(&self.events);
        Ok(take)
    }

    /// How many markers.
    #[must_use]
    pub fn marker_count(&self) -> usize {
        self.labels.len()
    }

    /// How many frames.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.frame_count
    }

    /// Frames a second.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.rate
    }

    /// Number that the source gives its first frame.
    #[must_use]
    pub fn first_frame(&self) -> u64 {
        self.first_frame
    }

    /// Seconds from the first frame to frame `frame`.
    #[must_use]
    pub fn seconds(&self, frame: usize) -> f64 {
        frame as f64 / self.rate
    }

    /// `[markers]`: names, no two alike.
    #[must_use]
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// `[markers]`: [`PointKind::Marker`] or [`PointKind::Unlabelled`].
    #[must_use]
    pub fn kinds(&self) -> &[PointKind] {
        &self.kinds
    }

    /// Units and axes of the source.
    #[must_use]
    pub fn source(&self) -> SourceSpace {
        self.source
    }

    /// Named instants, seconds as the source counts them.
    #[must_use]
    pub fn events(&self) -> &[RawEvent] {
        &self.events
    }

    /// `[frames]`: a marker's samples, metres, all three coordinates NaN where missing.
    ///
    /// # Panics
    /// If the marker does not exist.
    #[must_use]
    pub fn trajectory(&self, marker: usize) -> &[DVec3] {
        assert!(marker < self.labels.len(), "marker {marker} does not exist");
        &self.positions[marker * self.frame_count..][..self.frame_count]
    }

    /// One sample in metres, `None` where missing.
    ///
    /// # Panics
    /// If the marker or the frame does not exist.
    #[must_use]
    pub fn position(&self, marker: usize, frame: usize) -> Option<DVec3> {
        let position = self.trajectory(marker)[frame];
        (!position.is_nan()).then_some(position)
    }

    /// Sets or, with `None` or a value that is not finite, removes one sample.
    ///
    /// # Panics
    /// If the marker or the frame does not exist.
    pub fn set_position(&mut self, marker: usize, frame: usize, position: Option<DVec3>) {
        assert!(
            marker < self.labels.len() && frame < self.frame_count,
            "no such sample"
        );
        let position = position.filter(|position| position.is_finite());
        self.positions[marker * self.frame_count + frame] = position.unwrap_or(DVec3::NAN);
    }

    /// The markers seen in one frame: (marker, metres).
    ///
    /// # Panics
    /// If the frame does not exist.
    pub fn seen(&self, frame: usize) -> impl Iterator<Item = (usize, DVec3)> + '_ {
        (0..self.marker_count())
            .filter_map(move |marker| Some((marker, self.position(marker, frame)?)))
    }

    /// Runs of frames in which a marker is missing, in order; they may touch either end.
    ///
    /// # Panics
    /// If the marker does not exist.
    pub fn gaps(&self, marker: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        runs(self.trajectory(marker), true)
    }

    /// Runs of frames in which a marker is seen: its partial trajectories.
    ///
    /// # Panics
    /// If the marker does not exist.
    pub fn traces(&self, marker: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        runs(self.trajectory(marker), false)
    }

    /// How many samples of a marker are missing.
    ///
    /// # Panics
    /// If the marker does not exist.
    #[must_use]
    pub fn missing_count(&self, marker: usize) -> usize {
        self.trajectory(marker)
            .iter()
            .filter(|position| position.is_nan())
            .count()
    }

    /// Missing samples over all samples, 0 to 1; 0 without samples.
    #[must_use]
    pub fn missing_fraction(&self) -> f64 {
        let missing = self
            .positions
            .iter()
            .filter(|position| position.is_nan())
            .count();
        missing as f64 / self.positions.len().max(1) as f64
    }

    /// How many frames show every marker.
    #[must_use]
    pub fn complete_frame_count(&self) -> usize {
        let complete = |frame: &usize| {
            (0..self.marker_count()).all(|marker| self.position(marker, *frame).is_some())
        };
        (0..self.frame_count).filter(complete).count()
    }

    /// Lowest and highest corner of all samples, `None` without any.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let seen = || self.positions.iter().filter(|position| !position.is_nan());
        let first = *seen().next()?;
        Some(seen().fold((first, first), |(low, high), position| {
            (low.min(*position), high.max(*position))
        }))
    }

    /// Mean distance in metres from each marker seen in a frame to the nearest other one, `None`
    /// with fewer than two.
    ///
    /// Quadratic in the markers. The measure of marker density of Park & Hodgins 2006, Table 2.
    ///
    /// # Panics
    /// If the frame does not exist.
    #[must_use]
    pub fn mean_neighbour_distance(&self, frame: usize) -> Option<f64> {
        let seen: Vec<DVec3> = self.seen(frame).map(|(_, position)| position).collect();
        if seen.len() < 2 {
            return None;
        }
        let nearest = |(index, position): (usize, &DVec3)| {
            let others = seen.iter().enumerate().filter(|(other, _)| *other != index);
            others
                .map(|(_, other)| position.distance_squared(*other))
                .fold(f64::INFINITY, f64::min)
                .sqrt()
        };
        let sum: f64 = seen.iter().enumerate().map(nearest).sum();
        Some(sum / seen.len() as f64)
    }
}

/// Maximal runs of missing (or seen) samples.
fn runs(trajectory: &[DVec3], missing: bool) -> impl Iterator<Item = Range<usize>> + '_ {
    let wanted = move |position: &DVec3| position.is_nan() == missing;
    let mut from = 0;
    std::iter::from_fn(move || {
        let start = from + trajectory[from..].iter().position(wanted)?;
        let len = trajectory[start..]
            .iter()
            .position(|position| !wanted(position));
        from = len.map_or(trajectory.len(), |len| start + len);
        Some(start..from)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two markers, five frames: A misses 1, 2 and 4; B stands still.
    fn take() -> Take {
        let nan = DVec3::NAN;
        let a = [DVec3::X, nan, nan, DVec3::Y, nan];
        let b = [DVec3::Z; 5];
        let labels = vec!["A".into(), "B".into()];
        Take::new(labels, 100.0, 5, [a, b].concat()).unwrap()
    }

    #[test]
    fn gaps_traces_and_counts() {
        let take = take();
        assert_eq!(take.gaps(0).collect::<Vec<_>>(), [1..3, 4..5]);
        assert_eq!(take.traces(0).collect::<Vec<_>>(), [0..1, 3..4]);
        assert_eq!(take.gaps(1).count(), 0);
        assert_eq!((take.missing_count(0), take.complete_frame_count()), (3, 2));
        assert_eq!(take.missing_fraction(), 0.3);
        assert_eq!(take.seconds(4), 0.04);
        assert_eq!(take.bounds(), Some((DVec3::ZERO, DVec3::ONE)));
        assert_eq!(take.mean_neighbour_distance(0), Some(2f64.sqrt()));
        assert_eq!(take.mean_neighbour_distance(1), None);
        assert_eq!(take.seen(1).collect::<Vec<_>>(), [(1, DVec3::Z)]);
    }

    #[test]
    fn samples_are_set_and_removed() {
        let mut take = take();
        take.set_position(0, 1, Some(DVec3::ONE));
        take.set_position(1, 0, None);
        take.set_position(1, 2, Some(DVec3::new(f64::INFINITY, 0.0, 0.0)));
        assert_eq!(take.position(0, 1), Some(DVec3::ONE));
        assert_eq!(take.gaps(1).collect::<Vec<_>>(), [0..1, 2..3]);
    }

    #[test]
    fn contradictions_are_refused() {
        let label = || vec!["A".to_owned()];
        let few = Take::new(label(), 100.0, 2, vec![DVec3::X]).unwrap_err();
        assert_eq!(
            few,
            TakeError::Mismatch {
                what: "samples",
                found: 1,
                expected: 2
            }
        );
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                Take::new(label(), rate, 1, vec![DVec3::X]),
                Err(TakeError::Rate(_))
            ));
        }
        let infinite = vec![DVec3::X, DVec3::new(0.0, f64::INFINITY, 0.0)];
        let error = Take::new(label(), 100.0, 2, infinite).unwrap_err();
        assert_eq!(
            error,
            TakeError::NotFinite {
                marker: 0,
                frame: 1
            }
        );
        assert!(
            Take::new(vec![], 100.0, 7, vec![]).is_ok(),
            "no markers are a take"
        );
    }
}
