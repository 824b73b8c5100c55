//! What the tracker remembers about the rope between frames.

use glam::Vec3;

use super::points::NONE;
use super::trial::Trials;
use super::vector::{dot, length};
use crate::math::inverse_sqrt;
use crate::row::Row;

/// Places beyond this are damage, metres.
const FAR: f32 = 4e6;

/// Memories below are in seconds and become shares a frame through [`Pace`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    /// Gravity in metres a frame squared.
    pub(super) fall: Vec3,
    /// Gains of the fading-memory filter on position, velocity, acceleration.
    pub(super) gains: [f32; 3],
    /// Share of a new value in the slow position (0.2 s).
    pub(super) slow: f32,
    /// Share of a new value in segment statistics (0.5 s).
    pub(super) statistic: f32,
    /// Frames of a trial gap (0.16 s).
    pub(super) trial: u16,
    /// Frames in a second.
    pub(super) rate: f32,
}

impl Pace {
    pub(super) fn new(rate: f32, gravity: [f32; 3]) -> Self {
        // Morrison's fading memory of second degree: at low rates the motion between two frames
        // outweighs the noise, so the memory shortens.
        let theta = (0.1 + 0.004 * rate).min(0.5);
        let fresh = 1.0 - theta;
        Self {
            fall: Vec3::from_array(gravity) * (1.0 / (rate * rate)),
            gains: [
                1.0 - theta * theta * theta,
                1.5 * (1.0 - theta * theta) * fresh,
                fresh * fresh * fresh,
            ],
            slow: (5.0 / rate).min(1.0),
            statistic: (2.0 / rate).min(0.5),
            trial: ((0.16 * rate) as u16).clamp(4, 200),
            rate,
        }
    }
}

/// Positions that a fill reads and writes; a trial gap works on a copy.
#[derive(Clone, Debug)]
pub(super) struct Pose<const TRACES: usize> {
    /// Measured, or filled in.
    pub(super) now: Row<Vec3, TRACES>,
    pub(super) before: Row<Vec3, TRACES>,
    /// Metres a frame.
    pub(super) velocity: Row<Vec3, TRACES>,
    /// Moving average, the memory of a marker's place beside the smooth curve.
    pub(super) slow: Row<Vec3, TRACES>,
    /// Measured in this frame.
    pub(super) known: Row<bool, TRACES>,
}

/// The rope's own measures.
#[derive(Clone, Debug)]
pub(super) struct Measures<const TRACES: usize> {
    pub(super) count: usize,
    /// Metres along the rope from the first marker.
    pub(super) arc: Row<f32, TRACES>,
    /// Distance from each marker to the next, and its variance.
    pub(super) length: Row<f32, TRACES>,
    pub(super) spread: Row<f32, TRACES>,
    /// Mean of `length`.
    pub(super) spacing: f32,
}

/// Everything about a rope that has been found.
#[derive(Clone, Debug)]
pub(super) struct Track<const TRACES: usize> {
    pub(super) pace: Pace,
    pub(super) measures: Measures<TRACES>,
    pub(super) pose: Pose<TRACES>,
    /// Filtered state of measured markers; of others, the fill.
    pub(super) smooth: Row<Vec3, TRACES>,
    pub(super) acceleration: Row<Vec3, TRACES>,
    /// Frames since the last measurement.
    pub(super) gap: Row<u16, TRACES>,
    /// Frames since the trace surely had its own point, and frames in a row in which it fitted.
    pub(super) since: Row<u16, TRACES>,
    pub(super) streak: Row<u16, TRACES>,
    /// Point of this frame, or `NONE`.
    pub(super) point: Row<u16, TRACES>,
    /// Standard deviation to be expected of `pose.now`, metres.
    pub(super) doubt: Row<f32, TRACES>,
    pub(super) confidence: Row<f32, TRACES>,
    /// Mean square of each marker's recent prediction errors, square metres.
    surprise: Row<f32, TRACES>,
    pub(super) trials: Trials<TRACES>,
    /// Where the next search for a lost rope begins.
    pub(super) seed: u16,
    /// Frames in which nearly nothing was measured.
    pub(super) blind: u16,
    /// How much better another labelling has been, added up.
    pub(super) unease: f32,
}

/// Seconds without certainty after which a trace is unsure of itself.
const UNSURE: f32 = 0.05;
/// What a prediction errs by before it is known, metres.
const FIRST_SURPRISE: f32 = 0.004;
/// Smallest standard deviation of a segment's length, metres: what noise alone gives.
pub(super) const LEAST_SPREAD: f32 = 0.0003;

impl<const TRACES: usize> Track<TRACES> {
    /// At rest at `positions`, in order along the rope.
    pub(super) fn new(pace: Pace, positions: impl Iterator<Item = Vec3>) -> Self {
        let mut pose = Pose {
            now: Row::new(),
            before: Row::new(),
            velocity: Row::new(),
            slow: Row::new(),
            known: Row::new(),
        };
        let mut measures = Measures {
            count: 0,
            arc: Row::new(),
            length: Row::new(),
            spread: Row::new(),
            spacing: 0.0,
        };
        let mut smooth = Row::new();
        let mut arc = 0.0;
        for (i, position) in positions.take(TRACES).enumerate() {
            if i > 0 {
                let link = length(position - pose.now.at(i - 1));
                arc += link;
                measures.length.set(i - 1, link);
                measures.spread.set(i - 1, 1e-6);
            }
            measures.arc.set(i, arc);
            measures.count = i + 1;
            smooth.set(i, position);
            for row in [&mut pose.now, &mut pose.before, &mut pose.slow] {
                row.set(i, position);
            }
        }
        measures.spacing = arc / (measures.count.saturating_sub(1).max(1) as f32);
        let mut point = Row::new();
        point.fill(NONE);
        let mut surprise = Row::new();
        surprise.fill(FIRST_SURPRISE * FIRST_SURPRISE);
        Self {
            pace,
            trials: Trials::new(measures.spacing),
            measures,
            pose,
            smooth,
            acceleration: Row::new(),
            gap: Row::new(),
            since: Row::new(),
            streak: Row::new(),
            point,
            doubt: Row::new(),
            confidence: Row::new(),
            surprise,
            seed: 0,
            blind: 0,
            unease: 0.0,
        }
    }

    /// Whether a trace has not surely had its own point for a while.
    #[inline]
    pub(super) fn is_unsure(&self, i: usize) -> bool {
        f32::from(self.since.at(i)) > UNSURE * self.pace.rate
    }

    /// Where a marker should be now by its own motion.
    #[inline]
    pub(super) fn predicted(&self, i: usize) -> Vec3 {
        self.smooth.at(i) + self.pose.velocity.at(i) + self.acceleration.at(i) * 0.5
    }

    /// Root mean square of the recent prediction errors of a marker and its neighbours, metres.
    pub(super) fn surprise(&self, i: usize) -> f32 {
        let mean = self.surprise_square(i);
        mean * inverse_sqrt(mean)
    }

    /// Mean square of the same, square metres.
    pub(super) fn surprise_square(&self, i: usize) -> f32 {
        let last = self.measures.count.saturating_sub(1);
        let around = [i.saturating_sub(1), i, (i + 1).min(last)];
        around.iter().map(|&k| self.surprise.at(k)).sum::<f32>() * (1.0 / 3.0)
    }

    /// Starts a frame: nothing is measured yet.
    pub(super) fn open(&mut self) {
        for i in 0..self.measures.count {
            self.pose.before.set(i, self.pose.now.at(i));
        }
        self.pose.known.fill(false);
        self.point.fill(NONE);
    }

    /// A fill that ran away, as wild points can make it, goes back to the last good place.
    fn hold(&mut self, i: usize) {
        let is_near = |place: Vec3| place.to_array().iter().all(|x| (-FAR..=FAR).contains(x));
        if is_near(self.pose.now.at(i)) {
            return;
        }
        let last = Some(self.smooth.at(i)).filter(|&place| is_near(place));
        self.pose.now.set(i, last.unwrap_or(Vec3::ZERO));
        self.pose.velocity.set(i, Vec3::ZERO);
        self.acceleration.set(i, Vec3::ZERO);
    }

    /// Ends a frame: filters, statistics, ages.
    pub(super) fn close(&mut self) {
        let [on_position, on_velocity, on_acceleration] = self.pace.gains;
        for i in 0..self.measures.count {
            self.hold(i);
            let now = self.pose.now.at(i);
            if !self.pose.known.at(i) {
                self.gap.edit(i, |gap| *gap = gap.saturating_add(1));
                self.smooth.set(i, now);
                self.acceleration.edit(i, |a| *a *= 0.7);
            } else if self.gap.at(i) > 0 {
                // Found again: the fill has a better velocity than the jump onto the point.
                self.gap.set(i, 0);
                self.smooth.set(i, now);
                self.acceleration.set(i, Vec3::ZERO);
            } else {
                let (position, acceleration) = (self.predicted(i), self.acceleration.at(i));
                let surprise = now - position;
                self.smooth.set(i, position + surprise * on_position);
                self.pose
                    .velocity
                    .edit(i, |v| *v = *v + acceleration + surprise * on_velocity);
                self.acceleration
                    .set(i, acceleration + surprise * on_acceleration);
                let square = dot(surprise, surprise);
                self.surprise.edit(i, |mean| {
                    // Quick to grow wary, slow to calm down.
                    let share = if square > *mean { 0.3 } else { 0.05 };
                    *mean += (square - *mean) * share;
                });
            }
            self.pose
                .slow
                .edit(i, |slow| *slow = *slow + (now - *slow) * self.pace.slow);
        }
        self.learn_lengths();
    }

    /// Running mean and variance of the segments whose both ends are measured.
    fn learn_lengths(&mut self) {
        for i in 1..self.measures.count {
            if !(self.pose.known.at(i - 1) && self.pose.known.at(i)) {
                continue;
            }
            let link = length(self.pose.now.at(i) - self.pose.now.at(i - 1));
            let off = link - self.measures.length.at(i - 1);
            // A wrong point must not teach: 3 cm is more than any real link varies in a frame.
            if off * off < 0.0009 {
                let share = self.pace.statistic;
                self.measures.length.edit(i - 1, |l| *l += off * share);
                self.measures
                    .spread
                    .edit(i - 1, |s| *s += (off * off - *s) * share);
            }
        }
    }

    /// Puts a measured trace somewhere else, as if it had always been there.
    pub(super) fn jump(&mut self, i: usize, position: Vec3) {
        let moved = position - self.pose.now.at(i);
        for row in [&mut self.pose.before, &mut self.pose.slow] {
            row.edit(i, |p| *p += moved);
        }
        self.pose.now.set(i, position);
        self.smooth.set(i, position);
        self.acceleration.set(i, Vec3::ZERO);
        self.gap.set(i, 0);
        self.doubt.set(i, 0.0);
    }

    #[inline]
    pub(super) fn measured_count(&self) -> usize {
        let known = self.pose.known.as_slice(self.measures.count);
        known.iter().filter(|&&known| known).count()
    }
}
