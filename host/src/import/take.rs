//! A marker capture as its file states it: source units, source axes, nothing filled in.
//!
//! Coordinates stay exactly what the file's numbers give, so that writing a take back loses
//! nothing; [`RawTake::unit`] and [`RawTake::up`] say how they become metres with Y up, and
//! [`crate::take::Take`] is where that happens.

use glam::{DQuat, DVec3};

use super::{ImportError, ImportErrorKind, Notice, Place};

mod axes;
mod read;
mod space;

pub use axes::{LengthUnit, UpAxis};
pub use read::{TakeFormat, read_take};
pub(crate) use space::{Stated, median_extent, settle};

/// A missing sample: all three coordinates are NaN.
pub const MISSING: [f64; 3] = [f64::NAN; 3];

/// Points over time as their file states them.
#[derive(Clone, Debug, PartialEq)]
pub struct RawTake {
    /// `[points]`: name of each point, without padding; may repeat, with or without a subject prefix.
    pub labels: Vec<String>,
    /// `[points]`: what each point's three numbers are.
    pub kinds: Vec<PointKind>,
    /// Frames a second.
    pub rate: f64,
    /// Number that the file gives its first frame.
    pub first_frame: u64,
    /// How many frames there are; all counts below follow it.
    pub frame_count: usize,
    /// Length of one unit of `positions`.
    pub unit: LengthUnit,
    /// Which source axis points up.
    pub up: UpAxis,
    /// `[frames x points]`, frame after frame, source units and axes; [`MISSING`] where the file
    /// says that the point was not seen.
    pub positions: Vec<[f64; 3]>,
    /// `[frames x points]`, source units: mean distance of the camera rays from the point, 0 where
    /// the value was computed or edited, -1 where missing. Empty where the format holds none.
    pub residuals: Vec<f32>,
    /// `[frames x points]`: bit `n` is set if camera `n` saw the point. Empty where the format
    /// holds none.
    pub cameras: Vec<u8>,
    /// The scale that a C3D file stores, negative for real data: one step of an integer
    /// coordinate, or one step of a residual.
    pub scale: Option<f32>,
    /// Bodies that the capture system solved itself.
    pub rigid_bodies: Vec<RawRigidBody>,
    /// Analog channels that the file also holds; their samples are not read.
    pub analog: Option<Analog>,
    /// Named instants.
    pub events: Vec<RawEvent>,
    /// What was odd, and what was done about it.
    pub notices: Vec<Notice>,
}

/// What a point's three numbers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PointKind {
    /// Position of a named marker.
    Marker,
    /// Position of a marker that the capture system did not name.
    Unlabelled,
    /// Position that a body model computed, not the cameras.
    Model,
    /// Joint angles.
    Angle,
    /// A force.
    Force,
    /// A moment of force.
    Moment,
    /// A power.
    Power,
    /// Anything else that is not a position.
    Scalar,
}

impl PointKind {
    /// True for what cameras measured: named and unnamed markers.
    #[must_use]
    pub fn is_measured(self) -> bool {
        matches!(self, Self::Marker | Self::Unlabelled)
    }

    /// [`PointKind::Unlabelled`] for the names that capture systems give to unnamed markers.
    #[must_use]
    pub fn of_label(label: &str) -> Self {
        let (_, name) = split_subject(label);
        let unlabelled = label.is_empty()
            || name.starts_with('*')
            || [name, label].iter().any(|text| {
                text.get(..7)
                    .is_some_and(|start| start.eq_ignore_ascii_case("unlabel"))
            });
        if unlabelled {
            Self::Unlabelled
        } else {
            Self::Marker
        }
    }
}

/// A body that the capture system solved: one pose a frame, source units and axes.
#[derive(Clone, Debug, PartialEq)]
pub struct RawRigidBody {
    /// Name.
    pub name: String,
    /// `[frames]`: rotation and origin; `None` where the body was not tracked.
    pub poses: Vec<Option<(DQuat, DVec3)>>,
    /// `[frames]`, source units: mean distance of the markers from where the body expects them;
    /// NaN where unknown, empty where the file holds none.
    pub errors: Vec<f64>,
}

/// Analog channels sampled along with the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Analog {
    /// How many channels.
    pub channel_count: u32,
    /// Samples of each channel in one point frame.
    pub samples_per_frame: u32,
}

/// A named instant.
#[derive(Clone, Debug, PartialEq)]
pub struct RawEvent {
    /// What happened, such as `Foot Strike`.
    pub label: String,
    /// Where, such as `Left`; may be empty.
    pub context: String,
    /// Seconds, as the file counts them.
    pub seconds: f64,
}

/// What the caller states about a take, over what its file says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TakeOptions {
    /// Length of one unit.
    pub unit: Option<LengthUnit>,
    /// Axis that points up.
    pub up: Option<UpAxis>,
    /// Frames a second.
    pub rate: Option<f64>,
}

impl RawTake {
    /// A take of `labels` with every sample missing.
    pub(crate) fn empty(labels: Vec<String>, rate: f64, frame_count: usize) -> Self {
        let kinds = labels
            .iter()
            .map(|label| PointKind::of_label(label))
            .collect();
        Self {
            positions: vec![MISSING; labels.len() * frame_count],
            labels,
            kinds,
            rate,
            first_frame: 1,
            frame_count,
            unit: LengthUnit::Metre,
            up: UpAxis::PlusY,
            residuals: Vec::new(),
            cameras: Vec::new(),
            scale: None,
            rigid_bodies: Vec::new(),
            analog: None,
            events: Vec::new(),
            notices: Vec::new(),
        }
    }

    /// How many points a frame holds, of all kinds.
    #[must_use]
    pub fn point_count(&self) -> usize {
        self.labels.len()
    }

    /// Where one sample stands in `positions`, `residuals` and `cameras`.
    #[must_use]
    pub fn index(&self, frame: usize, point: usize) -> usize {
        frame * self.labels.len() + point
    }

    /// Source coordinates of one sample, `None` where missing.
    ///
    /// # Panics
    /// If `frame` or `point` does not exist.
    #[must_use]
    pub fn position(&self, frame: usize, point: usize) -> Option<[f64; 3]> {
        assert!(point < self.labels.len(), "point {point} does not exist");
        let position = self.positions[self.index(frame, point)];
        is_present(position).then_some(position)
    }

    /// How many samples of all points are missing.
    #[must_use]
    pub fn missing_count(&self) -> usize {
        self.positions
            .iter()
            .filter(|position| !is_present(**position))
            .count()
    }

    pub(crate) fn notice(&mut self, place: Place, text: impl Into<String>) {
        self.notices.push(Notice::new(place, text));
    }
}

/// True unless the sample is [`MISSING`].
#[must_use]
pub fn is_present(position: [f64; 3]) -> bool {
    position.iter().all(|value| value.is_finite())
}

/// `("Subject", "marker")` of a label such as `Subject:marker`; the subject is absent without a colon.
#[must_use]
pub fn split_subject(label: &str) -> (Option<&str>, &str) {
    match label.rsplit_once(':') {
        Some((subject, name)) if !subject.is_empty() && !name.is_empty() => (Some(subject), name),
        _ => (None, label),
    }
}

/// Checks a frame rate that a file or the caller states.
pub(crate) fn usable_rate(rate: f64) -> bool {
    rate.is_finite() && rate > 1e-3 && rate < 1e6
}

/// The rate to use: the caller's, else the file's, else a refusal.
pub(crate) fn settle_rate(
    stated: Option<f64>,
    options: &TakeOptions,
    file: &str,
    what: &str,
) -> Result<f64, ImportError> {
    if let Some(rate) = options.rate {
        if usable_rate(rate) {
            return Ok(rate);
        }
        let kind = ImportErrorKind::OutOfRange {
            what: "the given frame rate".into(),
            value: rate.to_string(),
            expected: "more than 0 Hz and less than 1 MHz".into(),
        };
        return Err(kind.at(file, Place::File));
    }
    stated.ok_or_else(|| ImportErrorKind::Missing { what: what.into() }.at(file, Place::File))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unnamed_markers_are_recognised() {
        for label in [
            "*12",
            "Unlabeled:108",
            "unlabeled 7",
            "Unlabelled_3",
            "",
            "Matt:*3",
        ] {
            assert_eq!(PointKind::of_label(label), PointKind::Unlabelled, "{label}");
        }
        for label in ["LASI", "Matt:LASI", "unl", "Ünlabel"] {
            assert_eq!(PointKind::of_label(label), PointKind::Marker, "{label}");
        }
        assert_eq!(split_subject("Matt:LASI"), (Some("Matt"), "LASI"));
        assert_eq!(split_subject("LASI:"), (None, "LASI:"));
    }
}
