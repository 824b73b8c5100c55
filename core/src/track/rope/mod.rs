//! A thin, non-rigid body among a person's markers: rope, cable, whip, ribbon, ponytail.
//!
//! Unlabelled points in; the rope's markers out, in order along it, every frame and without a
//! gap. After B. Z. Porter, *Motion Capture of Character Interactions with a Rope* (2012): his
//! method is [`Method::Published`]; [`Method::Joint`] adds what the thesis names as missing.
//!
//! | stage | takes | gives |
//! | --- | --- | --- |
//! | points | a frame | usable points, sorted |
//! | start, chain | the first frames | the rope's markers in order |
//! | associate | predictions, points | one point a trace, all traces at once |
//! | others | points of no rope | which points are known to be something else |
//! | fill, trial | measured markers | the others, and how far to trust them |
//! | joint or published | all of these | a frame |
//! | spline | markers | joints of a tube |

mod associate;
mod chain;
mod config;
mod cost;
mod fill;
mod joint;
mod others;
mod points;
mod published;
mod review;
mod spline;
mod start;
mod state;
#[cfg(test)]
mod tests;
mod trial;
mod vector;

use glam::Vec3;

pub use config::{Config, ConfigError, Method, Order, Selection};
pub use cost::{start_work_bound, work_bound};
pub use spline::TubeJoints;

use associate::Association;
use others::Others;
use points::{NONE, Points};
use start::Start;
use state::{Pace, Track};

/// Beyond this standard deviation, metres, a trace counts as lost: half of the half metre at which
/// the thesis does.
const LOST_DOUBT: f32 = 0.25;

/// Where a sample comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Source {
    /// The point at this place of the frame's slice.
    Measured(u16),
    /// No point; filled in.
    Predicted,
    /// No point, and the position is a guess. Found again without the caller's doing.
    #[default]
    Lost,
}

/// One marker in one frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sample {
    /// Metres.
    pub position: [f32; 3],
    /// Measured, predicted or lost.
    pub source: Source,
    /// Frames since the marker was measured; 0 if it is.
    pub gap: u16,
    /// 0 to 1. Measured: how clearly the point is this marker's. Predicted: falls to a half at an
    /// expected error of 30 mm.
    pub confidence: f32,
}

/// What the tracker is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Phase {
    /// Collecting the first frames.
    Starting,
    /// The first frames held no rope; collecting again.
    NotFound,
    /// Following the rope.
    Tracking,
}

/// What happened in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct FrameReport {
    /// What the tracker is doing.
    pub phase: Phase,
    /// Traces with a point.
    pub measured: u16,
    /// Traces that are filled in.
    pub predicted: u16,
    /// Traces whose position is a guess.
    pub lost: u16,
    /// Points ignored because a coordinate is not a number below 1000 km.
    pub unusable: u16,
    /// Points ignored because there are more than the tracker holds.
    pub surplus: u16,
    /// Inner steps done; at most [`work_bound`], or [`start_work_bound`] when the start ends.
    pub work: u32,
}

/// Follows one rope of up to `TRACES` markers among up to `POINTS` points.
///
/// All storage is inside; a frame allocates nothing, cannot panic, and does at most
/// [`work_bound`] inner steps. The same points give the same bits on every machine.
///
/// ```
/// use sinew_core::track::rope::{Config, RopeTracker, Source};
/// let rope = [[0.0, 1.0, 0.0], [0.0, 0.9, 0.0], [0.0, 0.8, 0.0], [0.0, 0.7, 0.0]];
/// let mut tracker = RopeTracker::<8, 32>::starting_at(Config::new(100.0), &rope)?;
/// // The third marker is hidden, and something else is there.
/// let points = [[0.0, 0.7, 0.0], [3.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.9, 0.0]];
/// let report = tracker.step(&points);
/// assert_eq!((report.measured, report.predicted), (3, 1));
/// let hidden = tracker.samples().nth(2).unwrap();
/// assert_eq!(hidden.source, Source::Predicted);
/// assert!((hidden.position[1] - 0.8).abs() < 0.01);
/// # Ok::<(), sinew_core::track::rope::ConfigError>(())
/// ```
#[derive(Clone, Debug)]
pub struct RopeTracker<const TRACES: usize, const POINTS: usize> {
    config: Config,
    stage: Stage<TRACES, POINTS>,
    points: Points<POINTS>,
    association: Association<TRACES, POINTS>,
    others: Others<POINTS>,
}

#[derive(Clone, Debug)]
// No heap: the larger variant is there in any case.
#[allow(clippy::large_enum_variant)]
enum Stage<const TRACES: usize, const POINTS: usize> {
    Starting(Start<POINTS>),
    Tracking(Track<TRACES>),
}

impl<const TRACES: usize, const POINTS: usize> RopeTracker<TRACES, POINTS> {
    const SIZES: () = assert!(
        TRACES >= 3 && TRACES < 256 && POINTS >= 3 && POINTS < 65_535,
        "3 to 255 traces, 3 to 65,534 points"
    );

    /// A tracker that finds the rope in the first [`Config::init_frames`] frames.
    ///
    /// # Errors
    /// A number in `config` is out of its range.
    pub fn new(config: Config) -> Result<Self, ConfigError> {
        let () = Self::SIZES;
        config.check(TRACES)?;
        Ok(Self {
            config,
            stage: Stage::Starting(Start::new()),
            points: Points::new(),
            association: Association::new(),
            others: Others::new(config.rate),
        })
    }

    /// A tracker of a rope whose markers are at `positions`, `[markers x 3]` metres, in order along
    /// it, in the frame before the first one.
    ///
    /// # Errors
    /// A number in `config` is out of its range; fewer than 3 or more than `TRACES` positions; a
    /// position that is not a number; neighbours in one place.
    pub fn starting_at(config: Config, positions: &[[f32; 3]]) -> Result<Self, ConfigError> {
        let mut tracker = Self::new(config)?;
        config::check_rope(positions, TRACES)?;
        let pace = Pace::new(config.rate, config.gravity);
        let markers = positions.iter().map(|&p| Vec3::from_array(p));
        tracker.stage = Stage::Tracking(Track::new(pace, markers));
        Ok(tracker)
    }

    /// Takes one frame of unlabelled points, metres, in any order.
    ///
    /// Reads the first `POINTS` of `points`. See [`FrameReport::work`] for what it costs.
    pub fn step(&mut self, points: &[[f32; 3]]) -> FrameReport {
        let refused = self.points.load(points);
        let phase = match &mut self.stage {
            Stage::Starting(start) => {
                start.feed(&self.config, &mut self.points);
                let done = start.frames() >= self.config.init_frames;
                if done {
                    self.conclude_start()
                } else {
                    Phase::Starting
                }
            }
            Stage::Tracking(track) => {
                match self.config.method {
                    Method::Joint => joint::step(
                        track,
                        &mut self.association,
                        &mut self.others,
                        &mut self.points,
                    ),
                    Method::Published => published::step(&self.config, track, &mut self.points),
                }
                Phase::Tracking
            }
        };
        let mut report = FrameReport {
            phase,
            measured: 0,
            predicted: 0,
            lost: 0,
            unusable: refused.unusable,
            surplus: refused.surplus,
            work: self.points.work,
        };
        if phase == Phase::Tracking {
            for sample in self.samples() {
                match sample.source {
                    Source::Measured(_) => report.measured += 1,
                    Source::Predicted => report.predicted += 1,
                    Source::Lost => report.lost += 1,
                }
            }
        }
        report
    }

    /// Orders the rope, or begins again where there is none.
    fn conclude_start(&mut self) -> Phase {
        let Stage::Starting(start) = &self.stage else {
            return Phase::Tracking;
        };
        let markers = start.conclude::<TRACES>(&self.config, &mut self.points);
        if markers.len() < 3 {
            self.stage = Stage::Starting(Start::new());
            return Phase::NotFound;
        }
        let pace = Pace::new(self.config.rate, self.config.gravity);
        self.stage = Stage::Tracking(Track::new(pace, markers.iter().copied()));
        Phase::Starting
    }

    /// The rope's markers in order along it; none while starting.
    pub fn samples(&self) -> impl Iterator<Item = Sample> + '_ {
        let track = match &self.stage {
            Stage::Starting(_) => None,
            Stage::Tracking(track) => Some(track),
        };
        let count = track.map_or(0, |track| track.measures.count);
        let samples = (0..count).zip(core::iter::repeat(track));
        samples.filter_map(|(i, track)| Some(self.sample(track?, i)))
    }

    fn sample(&self, track: &Track<TRACES>, i: usize) -> Sample {
        let point = track.point.at(i);
        let source = if point != NONE {
            Source::Measured(self.points.source(point))
        } else if track.doubt.at(i) > LOST_DOUBT {
            Source::Lost
        } else {
            Source::Predicted
        };
        Sample {
            position: track.pose.now.at(i).to_array(),
            source,
            gap: track.gap.at(i),
            confidence: track.confidence.at(i),
        }
    }

    /// Markers of the rope; 0 while starting.
    #[must_use]
    pub fn trace_count(&self) -> usize {
        match &self.stage {
            Stage::Starting(_) => 0,
            Stage::Tracking(track) => track.measures.count,
        }
    }

    /// Learned distance in metres from each marker to the next, `[trace_count - 1]`.
    pub fn segment_lengths(&self) -> impl Iterator<Item = f32> + '_ {
        let lengths = match &self.stage {
            Stage::Starting(_) => &[],
            Stage::Tracking(track) => {
                let segments = track.measures.count.saturating_sub(1);
                track.measures.length.as_slice(segments)
            }
        };
        lengths.iter().copied()
    }
}
