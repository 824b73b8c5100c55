//! Missing markers: filled by their neighbours, and by their own past for the first frames.

use super::fill::{self, expect, placed};
use super::pace::square;
use super::state::Trace;
use super::{Frame, NONE};

/// Weight of a fill's own variance where few neighbours stand behind it: at most 1 over this.
const LEAST_SHARE: f32 = 0.02;

/// Most by which neighbours that bend widen what a fill says of itself.
const BENT: f32 = 9.0;
/// How fast a fill may go astray while its neighbours are filled too, metres a second.
const ASTRAY: f32 = 0.2;

impl Frame<'_, '_> {
    /// Fills every placed marker without a point; those with most measured neighbours first, so
    /// that the others can rest on them.
    pub(super) fn fill_missing(&mut self) {
        if !self.traces.iter().any(Trace::is_measured) {
            for marker in 0..self.traces.len() {
                self.coast(marker);
            }
            return;
        }
        for round in [true, false] {
            for marker in 0..self.traces.len() {
                if self.trace(marker).is_measured() {
                    continue;
                }
                let links = self.model.links(marker);
                let measured = |(index, _): &(usize, _)| self.trace(*index).is_measured();
                let well = links.filter(measured).count() >= 3;
                if well == round {
                    self.fill(marker, well);
                }
            }
        }
    }

    /// Goes on by inertia.
    fn coast(&mut self, marker: usize) {
        let swerve = self.pace.swerve;
        if let Some(trace) = self.traces.get_mut(marker)
            && trace.is_placed
        {
            let frames = f32::from(trace.gap) + 1.0;
            trace.sigma = trace.sigma.max(swerve * square(frames) + self.config.noise);
            trace.predicted = trace.position;
        }
    }

    fn fill(&mut self, marker: usize, well: bool) {
        let trace = self.trace(marker);
        if !trace.is_placed && !well {
            return;
        }
        self.points.work += fill::work(self.model.dims().neighbour_count);
        let found = expect(self.model, placed(self.traces), marker, trace.turn());
        let Some(found) = found else {
            self.coast(marker);
            return;
        };
        let own = self.model.marker(marker);
        // Before it was first seen, a narrow gate keeps it from taking another's point.
        let loose = if trace.streak.max(trace.streak_before) > 0 {
            found.loose.max(0.0)
        } else {
            0.0
        };
        let spread =
            square(own.sigma) * found.bent.min(BENT) / found.share.max(LEAST_SHARE) + loose;
        let astray = if well {
            0.0
        } else {
            ASTRAY * self.pace.step * f32::from(trace.gap)
        };
        let floor = found.inherited + square(self.config.noise) + square(astray);
        let Some(trace) = self.traces.get_mut(marker) else {
            return;
        };
        (trace.turn, trace.is_turned) = (found.turn, true);
        let expected = found.local + trace.bias;
        if !trace.is_placed {
            trace.is_placed = true;
            trace.position = found.to_world(expected);
            trace.before = trace.position;
            trace.sigma = crate_sqrt(2.0 * spread + floor);
            trace.kept = 0.0;
            trace.predicted = trace.position;
            return;
        }
        // The first two frames follow inertia, and tell the fill's error and how it changes.
        let streak = if trace.gap == 0 {
            trace.streak
        } else {
            trace.streak_before
        };
        if trace.gap < 2 && streak > 2 {
            let error = found.to_local(trace.position) - expected;
            trace.slope = if trace.gap == 0 {
                glam::Vec3::ZERO
            } else {
                (error - trace.error) * 0.7
            };
            trace.error = error;
            trace.kept = 1.0;
            let frames = f32::from(trace.gap) + 1.0;
            trace.sigma = self.pace.swerve * square(frames) + 2.0 * self.config.noise;
        } else {
            if trace.gap == 0 {
                trace.error = found.to_local(trace.before) - expected;
                trace.slope = glam::Vec3::ZERO;
                trace.kept = 1.0;
            }
            let keep = own.memory / (own.memory + self.pace.step);
            trace.error = (trace.error + trace.slope) * keep;
            trace.slope *= self.pace.slope;
            trace.kept *= keep;
            trace.position = found.to_world(expected + trace.error);
            let lost = 1.0 - square(trace.kept);
            trace.sigma = crate_sqrt(spread * lost + floor);
        }
        trace.predicted = trace.position;
        debug_assert!(trace.point == NONE);
    }
}

/// Square root of a positive normal number.
pub(super) fn crate_sqrt(x: f32) -> f32 {
    x * crate::math::inverse_sqrt(x)
}
