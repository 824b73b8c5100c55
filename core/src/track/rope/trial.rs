//! The tracker tests itself: it pretends that markers are missing, and remembers how well each
//! way of filling would have done.
//!
//! Whether a free end falls or a held end turns with its neighbours, and how far a fill can be
//! trusted, depends on the rope and on what is done to it. So a short run of measured markers at
//! one end, at the other, or in between is filled in parallel by both ways from a copy, compared
//! with the measurement after 0.16 s, and the mean square error is kept.

use glam::Vec3;

use super::fill::{Run, fill, keep_velocity};
use super::state::{Measures, Pace, Pose};
use super::vector::dot;
use crate::math::inverse_sqrt;
use crate::row::Row;

/// Markers in a trial run at an end, and inside.
const END_RUN: usize = 3;
const INNER_RUN: usize = 4;
/// Runs inside that are no longer than this always follow the curve: it never lost there.
const SHORT_RUN: usize = 3;
/// Share of the shape when free motion has done better: enough to bound its drift.
const FREE: f32 = 0.02;
/// Share of a trial in the score.
const NEWS: f32 = 0.4;

/// Where a run lies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Place {
    #[default]
    First,
    Last,
    Inside,
}

/// Mean square errors, square metres.
#[derive(Clone, Copy, Debug)]
struct Score {
    shape: f32,
    free: f32,
}

/// One way of filling while its trial runs.
#[derive(Clone, Debug)]
struct Model {
    now: Row<Vec3, INNER_RUN>,
    velocity: Row<Vec3, INNER_RUN>,
    slow: Row<Vec3, INNER_RUN>,
}

#[derive(Clone, Debug)]
pub(super) struct Trials<const TRACES: usize> {
    scores: [Score; 3],
    place: Place,
    run: Option<Run>,
    frame: u16,
    /// Picks the inner runs; any odd step visits all of them.
    turn: usize,
    models: [Model; 2],
}

impl<const TRACES: usize> Trials<TRACES> {
    pub(super) fn new(spacing: f32) -> Self {
        let model = || Model {
            now: Row::new(),
            velocity: Row::new(),
            slow: Row::new(),
        };
        // Before the first trials: an error of 0.15 spacings inside, 0.4 at an end.
        let square = |share: f32| share * share * spacing * spacing;
        let end = Score {
            shape: square(0.4),
            free: square(0.6),
        };
        let inside = Score {
            shape: square(0.15),
            free: square(0.2),
        };
        Self {
            scores: [end, end, inside],
            place: Place::First,
            run: None,
            frame: 0,
            turn: 0,
            models: [model(), model()],
        }
    }

    fn score(&self, place: Place) -> Score {
        let [first, last, inside] = self.scores;
        match place {
            Place::First => first,
            Place::Last => last,
            Place::Inside => inside,
        }
    }

    fn place_of(run: Run, count: usize) -> Place {
        if run.is_interior(count) {
            Place::Inside
        } else if run.begin == 0 {
            Place::First
        } else {
            Place::Last
        }
    }

    /// Share of the shape in filling `run`.
    pub(super) fn shape_share(&self, run: Run, count: usize) -> f32 {
        let place = Self::place_of(run, count);
        let score = self.score(place);
        let short = place == Place::Inside && run.len() <= SHORT_RUN;
        if short || score.free > score.shape {
            1.0
        } else {
            FREE
        }
    }

    /// Standard deviation to expect in `run` after `gap` frames, metres.
    pub(super) fn doubt(&self, run: Run, count: usize, gap: u16, window: u16) -> f32 {
        let place = Self::place_of(run, count);
        let score = self.score(place);
        let square = score.shape.min(score.free);
        let error = square * inverse_sqrt(square.max(1e-12));
        let n = run.len() as f32;
        if place == Place::Inside {
            let share = n / INNER_RUN as f32;
            0.003 + error * share * share
        } else {
            let age = f32::from(gap) / f32::from(window);
            0.003 + error * (n / END_RUN as f32) * (0.3 + age)
        }
    }

    /// Runs one frame of the current trial; call when the frame's markers are known, before the
    /// averages move on.
    pub(super) fn advance(
        &mut self,
        measures: &Measures<TRACES>,
        pose: &Pose<TRACES>,
        pace: &Pace,
    ) {
        let window = pace.trial;
        let Some(run) = self.run else {
            return;
        };
        self.frame += 1;
        let supported = |i: usize| i >= measures.count || pose.known.at(i);
        let around = [
            run.begin.wrapping_sub(1),
            run.begin.wrapping_sub(2),
            run.end,
            run.end + 1,
        ];
        if !around.into_iter().all(supported) {
            self.run = None;
            return;
        }
        for (model, shape) in self.models.iter_mut().zip([1.0, FREE]) {
            let mut copy = pose.clone();
            for (k, i) in (run.begin..run.end).enumerate() {
                copy.known.set(i, false);
                copy.before.set(i, model.now.at(k));
                copy.velocity.set(i, model.velocity.at(k));
                copy.slow.set(i, model.slow.at(k));
            }
            fill(measures, &mut copy, run, shape, pace.fall);
            keep_velocity(&mut copy, run);
            for (k, i) in (run.begin..run.end).enumerate() {
                model.now.set(k, copy.now.at(i));
                model.velocity.set(k, copy.velocity.at(i));
                let now = model.now.at(k);
                model
                    .slow
                    .edit(k, |slow| *slow = *slow + (now - *slow) * pace.slow);
            }
        }
        if self.frame >= window {
            self.judge(run, pose);
            self.run = None;
        }
    }

    fn judge(&mut self, run: Run, pose: &Pose<TRACES>) {
        let mut errors = [0.0, 0.0];
        let mut seen = 0_u16;
        for (k, i) in (run.begin..run.end).enumerate() {
            if pose.known.at(i) {
                seen += 1;
                for (error, model) in errors.iter_mut().zip(&self.models) {
                    let off = model.now.at(k) - pose.now.at(i);
                    *error += dot(off, off);
                }
            }
        }
        if seen == 0 {
            return;
        }
        let [shape, free] = errors.map(|e| e / f32::from(seen));
        let [first, last, inside] = &mut self.scores;
        let score = match self.place {
            Place::First => first,
            Place::Last => last,
            Place::Inside => inside,
        };
        score.shape += (shape - score.shape) * NEWS;
        score.free += (free - score.free) * NEWS;
    }

    /// Begins a trial at the next place if none is under way, and if its run and what it leans on
    /// are measured; call at the end of a frame.
    pub(super) fn start(&mut self, count: usize, pose: &Pose<TRACES>) {
        if self.run.is_some() {
            return;
        }
        self.place = match self.place {
            Place::First => Place::Last,
            Place::Last => Place::Inside,
            Place::Inside => Place::First,
        };
        let run = match self.place {
            Place::First => Run {
                begin: 0,
                end: END_RUN,
            },
            Place::Last => Run {
                begin: count.saturating_sub(END_RUN),
                end: count,
            },
            Place::Inside => {
                let places = count.saturating_sub(INNER_RUN + 3);
                if places == 0 {
                    return;
                }
                self.turn = (self.turn + 5) % places;
                Run {
                    begin: 2 + self.turn,
                    end: 2 + self.turn + INNER_RUN,
                }
            }
        };
        // Two measured markers beyond the run, on each side that exists.
        let needed = run.begin.saturating_sub(2)..(run.end + 2).min(count);
        if count < END_RUN + 2 || !needed.into_iter().all(|i| pose.known.at(i)) {
            return;
        }
        for model in &mut self.models {
            for (k, i) in (run.begin..run.end).enumerate() {
                model.now.set(k, pose.now.at(i));
                model.velocity.set(k, pose.velocity.at(i));
                model.slow.set(k, pose.slow.at(i));
            }
        }
        self.frame = 0;
        self.run = Some(run);
    }
}

#[cfg(test)]
mod tests {
    use super::super::state::Track;
    use super::*;

    /// A rope of ten markers turning about its first one like a rod, or falling as a whole.
    fn watch(motion: impl Fn(f32, f32) -> Vec3) -> Trials<10> {
        let place = |frame: usize, i: usize| motion(frame as f32 * 0.01, 0.1 * i as f32);
        let pace = Pace::new(100.0, [0.0, -9.81, 0.0]);
        let mut track = Track::<10>::new(pace, (0..10).map(|i| place(0, i)));
        for frame in 1..600 {
            track.open();
            for i in 0..10 {
                track.pose.now.set(i, place(frame, i));
                track.pose.known.set(i, true);
            }
            let mut trials = track.trials.clone();
            trials.advance(&track.measures, &track.pose, &pace);
            track.close();
            trials.start(10, &track.pose);
            track.trials = trials;
        }
        track.trials
    }

    #[test]
    fn a_rod_is_followed_and_a_fall_is_free() {
        let rod = watch(|t, s| Vec3::new(s * libm::cosf(6.0 * t), s * libm::sinf(6.0 * t), 0.0));
        let end = Run { begin: 7, end: 10 };
        assert_eq!(rod.shape_share(end, 10), 1.0);
        assert!(rod.doubt(end, 10, 16, 16) < 0.01);
        // A pendulum chain in free fall that turns at the same time: each marker has its own way.
        let fall = watch(|t, s| Vec3::new(s, -4.905 * t * t + 3.0 * t * s * s, 0.0));
        assert!(fall.doubt(end, 10, 160, 16) > rod.doubt(end, 10, 16, 16));
        let inner = Run { begin: 4, end: 5 };
        assert_eq!(fall.shape_share(inner, 10), 1.0);
    }
}
