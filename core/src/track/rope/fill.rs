//! Where the markers are that no camera sees.
//!
//! A run of missing markers between measured ones follows the smooth curve through up to three
//! measured markers on either side (Lagrange's polynomial over the arc length), plus the missing
//! marker's own offset from that curve as it was before the gap. A run at an end turns rigidly
//! with the last measured segment. Either is mixed with free fall of the markers themselves, and
//! then the segments' lengths are restored (position-based dynamics: Müller et al. 2007).

use glam::Vec3;

use super::state::{LEAST_SPREAD, Measures, Pose};
use super::vector::{length, turn};
use crate::row::Row;

/// Measured markers on each side that a fill leans on.
const SUPPORTS: usize = 3;
/// Passes over the segments.
const SWEEPS: usize = 4;
/// Standard deviation of the curve for one missing marker, metres; grows as the run's length
/// to the power 1.5.
const CURVE_DOUBT: f32 = 0.002;

/// Neighbouring markers that are missing: `begin..end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    pub(super) begin: usize,
    pub(super) end: usize,
}

impl Run {
    pub(super) fn len(self) -> usize {
        self.end - self.begin
    }

    /// Whether a measured marker lies on both sides.
    pub(super) fn is_interior(self, count: usize) -> bool {
        self.begin > 0 && self.end < count
    }

    /// The first run at or after `from`.
    pub(super) fn next<const T: usize>(
        known: &Row<bool, T>,
        count: usize,
        from: usize,
    ) -> Option<Self> {
        let begin = (from..count).find(|&i| !known.at(i))?;
        let end = (begin..count).find(|&i| known.at(i)).unwrap_or(count);
        Some(Self { begin, end })
    }
}

/// Markers with their weights in the curve at one place.
struct Curve {
    markers: [(usize, f32); 2 * SUPPORTS],
    count: usize,
}

impl Curve {
    fn new<const T: usize>(measures: &Measures<T>, known: &Row<bool, T>, run: Run) -> Self {
        let mut markers = [(0, 0.0); 2 * SUPPORTS];
        let mut count = 0;
        // One side must not outweigh the other: a curve through one marker here and three there
        // swings between them.
        let most = |other: usize| SUPPORTS.min(other + 1);
        let left = || (0..run.begin).rev().filter(|&i| known.at(i));
        let right = || (run.end..measures.count).filter(|&i| known.at(i));
        let (on_left, on_right) = (
            left().take(SUPPORTS).count(),
            right().take(SUPPORTS).count(),
        );
        let (left, right) = (left().take(most(on_right)), right().take(most(on_left)));
        for (slot, marker) in markers.iter_mut().zip(left.chain(right)) {
            *slot = (marker, 0.0);
            count += 1;
        }
        Self { markers, count }
    }

    /// Lagrange's basis at `place` metres along the rope.
    fn aim<const T: usize>(&mut self, arc: &Row<f32, T>, place: f32) {
        let markers = self.markers;
        for (k, slot) in self.markers.iter_mut().take(self.count).enumerate() {
            let own = arc.at(slot.0);
            let (mut above, mut below) = (1.0, 1.0);
            for (other, &(marker, _)) in markers.iter().take(self.count).enumerate() {
                if other != k {
                    let at = arc.at(marker);
                    above *= place - at;
                    below *= own - at;
                }
            }
            slot.1 = above / below;
        }
    }

    fn blend<const T: usize>(&self, of: &Row<Vec3, T>) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for &(marker, weight) in self.markers.iter().take(self.count) {
            sum += of.at(marker) * weight;
        }
        sum
    }
}

/// Fills one run of `pose`; [`keep_velocity`] then concludes the frame.
///
/// `shape` is the share of the curve (or of the rigid end); the rest is free motion.
pub(super) fn fill<const T: usize>(
    measures: &Measures<T>,
    pose: &mut Pose<T>,
    run: Run,
    shape: f32,
    fall: Vec3,
) {
    let count = measures.count;
    if run.is_interior(count) {
        let mut curve = Curve::new(measures, &pose.known, run);
        for i in run.begin..run.end {
            curve.aim(&measures.arc, measures.arc.at(i));
            let target = curve.blend(&pose.now) + pose.slow.at(i) - curve.blend(&pose.slow);
            place(pose, i, target, shape, fall);
        }
    } else if run.begin > 0 {
        follow(
            pose,
            run,
            run.begin - 1,
            run.begin.checked_sub(2),
            shape,
            fall,
        );
    } else if run.end < count {
        let second = Some(run.end + 1).filter(|&i| i < count);
        follow(pose, run, run.end, second, shape, fall);
    } else {
        // Nothing is measured: every marker keeps its own motion.
        for i in run.begin..run.end {
            pose.now.edit(i, |p| *p += pose.velocity.at(i));
        }
    }
    restore_lengths(measures, pose, run);
}

/// Gives the markers of a filled run the velocity that follows from it.
pub(super) fn keep_velocity<const T: usize>(pose: &mut Pose<T>, run: Run) {
    for i in run.begin..run.end {
        pose.velocity.set(i, pose.now.at(i) - pose.before.at(i));
    }
}

/// Turns an end run with its last measured segment, `second` to `first`.
fn follow<const T: usize>(
    pose: &mut Pose<T>,
    run: Run,
    first: usize,
    second: Option<usize>,
    shape: f32,
    fall: Vec3,
) {
    let (root, old_root) = (pose.now.at(first), pose.before.at(first));
    let second = second.filter(|&i| pose.known.at(i));
    for i in run.begin..run.end {
        let arm = pose.before.at(i) - old_root;
        let arm = match second {
            Some(second) => {
                let (new, old) = (
                    root - pose.now.at(second),
                    old_root - pose.before.at(second),
                );
                turn(arm, old, new)
            }
            None => arm,
        };
        place(pose, i, root + arm, shape, fall);
    }
}

#[inline]
fn place<const T: usize>(pose: &mut Pose<T>, i: usize, target: Vec3, shape: f32, fall: Vec3) {
    let free = pose.before.at(i) + pose.velocity.at(i) + fall;
    pose.now.set(i, free + (target - free) * shape);
}

/// Moves missing markers so that their segments have the learned lengths.
///
/// Each correction is the update of a Kalman filter for one length: the curve's doubt against the
/// length's own spread, so a straight rope is not bent by a hair of stretch.
fn restore_lengths<const T: usize>(measures: &Measures<T>, pose: &mut Pose<T>, run: Run) {
    let n = run.len() as f32;
    let loose = CURVE_DOUBT * CURVE_DOUBT * n * n * n;
    let (begin, end) = (
        run.begin.max(1),
        run.end.min(measures.count.saturating_sub(1)),
    );
    for sweep in 0..SWEEPS {
        for step in begin..=end {
            // Alternate the direction, so that neither side of the run is favoured.
            let right = if sweep % 2 == 0 {
                step
            } else {
                begin + end - step
            };
            let left = right - 1;
            let give = |i: usize| {
                let inside = i >= run.begin && i < run.end;
                if inside { loose } else { 0.0 }
            };
            let (give_left, give_right) = (give(left), give(right));
            let link = pose.now.at(right) - pose.now.at(left);
            let now = length(link);
            let spread = measures.spread.at(left).max(LEAST_SPREAD * LEAST_SPREAD);
            let off = now - measures.length.at(left);
            let pull = link * (off / ((give_left + give_right + spread) * now.max(1e-6)));
            pose.now.edit(left, |p| *p += pull * give_left);
            pose.now.edit(right, |p| *p -= pull * give_right);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::state::{Pace, Track};
    use super::*;

    fn track(positions: &[Vec3]) -> Track<12> {
        let pace = Pace::new(100.0, [0.0, -9.81, 0.0]);
        Track::new(pace, positions.iter().copied())
    }

    fn hide(track: &mut Track<12>, hidden: core::ops::Range<usize>) {
        for i in 0..track.measures.count {
            track.pose.known.set(i, !hidden.contains(&i));
        }
    }

    #[test]
    fn curve_reproduces_a_polynomial_of_degree_five() {
        let arc: [f32; 7] = core::array::from_fn(|i| 0.1 * i as f32);
        let height = |s: f32| 3.0 * s * s * s * s * s - s * s * s + 0.5 * s;
        let mut track = track(&arc.map(|s| Vec3::new(s, 0.0, 0.0)));
        for (i, &s) in arc.iter().enumerate() {
            track.measures.arc.set(i, s);
            track.pose.now.set(i, Vec3::new(s, height(s), 0.0));
        }
        hide(&mut track, 3..4);
        let run = Run { begin: 3, end: 4 };
        let mut curve = Curve::new(&track.measures, &track.pose.known, run);
        assert_eq!(curve.count, 6);
        curve.aim(&track.measures.arc, 0.3);
        assert!((curve.blend(&track.pose.now).y - height(0.3)).abs() < 1e-6);
    }

    #[test]
    fn rigid_end_keeps_its_shape() {
        let line: [Vec3; 5] = core::array::from_fn(|i| Vec3::X * 0.1 * i as f32);
        let mut track = track(&line);
        track.open();
        hide(&mut track, 3..5);
        // The measured part turns by a quarter about Z.
        for (i, p) in line.iter().enumerate().take(3) {
            track.pose.now.set(i, Vec3::Y * p.x);
        }
        let run = Run { begin: 3, end: 5 };
        fill(&track.measures, &mut track.pose, run, 1.0, Vec3::ZERO);
        assert!((track.pose.now.at(4) - Vec3::Y * 0.4).length() < 1e-5);
    }

    #[test]
    fn free_end_falls_and_keeps_its_length() {
        let line: [Vec3; 4] = core::array::from_fn(|i| Vec3::X * 0.1 * i as f32);
        let mut track = track(&line);
        for _ in 0..10 {
            track.open();
            hide(&mut track, 3..4);
            let run = Run { begin: 3, end: 4 };
            let fall = track.pace.fall;
            fill(&track.measures, &mut track.pose, run, 0.0, fall);
            keep_velocity(&mut track.pose, run);
        }
        let end = track.pose.now.at(3);
        // A bob released level falls g t^2 / 2 at first: 54 mm after 10 steps of Verlet.
        assert!((end.y + 0.054).abs() < 0.012, "{end}");
        assert!(((end - track.pose.now.at(2)).length() - 0.1).abs() < 0.001);
    }

    #[test]
    fn runs_are_found() {
        let mut known = Row::<bool, 6>::new();
        for i in [1, 4] {
            known.set(i, true);
        }
        let next = |from| Run::next(&known, 6, from);
        assert_eq!(next(0), Some(Run { begin: 0, end: 1 }));
        assert_eq!(next(1), Some(Run { begin: 2, end: 4 }));
        assert_eq!(next(4), Some(Run { begin: 5, end: 6 }));
        assert_eq!(next(6), None);
    }
}
