//! Markers that their neighbours contradict change places or lose their point.

use super::Frame;
use super::associate::{contradiction, deviation};
use super::fill::{self, Expectation, expect};
use super::gap::crate_sqrt;
use super::pace::square;
use super::state::NONE;

/// A distance this many square deviations off is wrong.
const WRONG: f32 = 16.0;
/// Frames in a row with mostly wrong distances before something is done.
const PATIENCE: u8 = 2;
/// Neighbours whose word counts: share of their weight.
const SHARE: f32 = 0.5;
/// An exchange must explain this much more.
const GAIN: f32 = 12.0;
/// Metres by which a marker may sit elsewhere than learned; the first figure before its bias is
/// known.
const MISPLACED: [f32; 2] = [0.03, 0.012];

impl Frame<'_, '_> {
    /// Compares all markers with their distances, and some in turn with what the fill expects.
    pub(super) fn audit(&mut self) {
        for marker in 0..self.traces.len() {
            let doubt = self.doubt(marker);
            if let Some(trace) = self.traces.get_mut(marker) {
                trace.doubt = doubt;
            }
            if doubt >= PATIENCE {
                self.review(marker, true);
            }
        }
        for _ in 0..self.pace.reviews {
            let marker = self.course.next;
            self.course.next = if marker + 1 < self.traces.len() { marker + 1 } else { 0 };
            self.review(marker, false);
        }
    }

    /// Frames in a row in which most distances were wrong.
    fn doubt(&mut self, marker: usize) -> u8 {
        let trace = self.trace(marker);
        if !trace.is_measured() {
            return 0;
        }
        self.points.work += 1;
        let (mut wrong, mut count) = (0, 0);
        for (index, link) in self.model.links(marker) {
            let Some(other) = self.traces.get(index) else {
                continue;
            };
            if other.is_measured() {
                count += 1;
                wrong += usize::from(deviation(&link, trace.position, other.position) > WRONG);
            }
        }
        if count >= 3 && 2 * wrong > count {
            trace.doubt.saturating_add(1)
        } else {
            0
        }
    }

    /// Compares a measured marker with what its neighbours expect: learns its bias, or corrects it.
    fn review(&mut self, marker: usize, is_doubted: bool) {
        let trace = self.trace(marker);
        if !trace.is_measured() {
            return;
        }
        self.points.work += fill::work(self.model.dims().neighbour_count);
        let found = expect(self.model, self.traces, marker, trace.turn, trace.is_turned);
        let Some(found) = found.filter(|found| found.share > SHARE) else {
            return;
        };
        let own = self.model.marker(marker);
        let miss = found.to_local(trace.position) - found.local - trace.bias;
        let misplaced = MISPLACED[usize::from(trace.is_biased)];
        let limit = square(5.0 * own.sigma + misplaced);
        if miss.length_squared() > limit {
            self.correct(marker, &found, is_doubted);
            return;
        }
        let share = if trace.is_biased { self.pace.bias.min(1.0) } else { 0.5 };
        if let Some(trace) = self.traces.get_mut(marker) {
            (trace.turn, trace.is_turned) = (found.turn, true);
            if trace.doubt == 0 {
                trace.bias += miss * share;
                trace.is_biased = true;
            }
        }
    }

    /// A marker that is not where it is expected.
    fn correct(&mut self, marker: usize, found: &Expectation, is_doubted: bool) {
        let trace = self.trace(marker);
        let own = self.model.marker(marker);
        let expected = found.to_world(found.local + trace.bias);
        let reach = 4.0 * own.sigma + MISPLACED[usize::from(trace.is_biased)];
        let nearest = self.points.nearest(expected, reach, |_| true);
        let against = |frame: &Self, marker: usize, point: usize, except: usize| {
            let position = frame.points.at(point).position;
            contradiction(frame.model, frame.traces, marker, position, except as u16).0
        };
        let here = usize::from(trace.point);
        if let Some((there, _)) = nearest
            && there != here
        {
            let owner = self.points.at(there).owner;
            let other = usize::from(owner);
            if owner == NONE {
                self.drop_point(marker);
                self.begin(marker, there);
                self.corrected += 1;
                return;
            }
            let now = against(self, marker, here, other) + against(self, other, there, marker);
            let then = against(self, marker, there, other) + against(self, other, here, marker);
            if then + GAIN < now {
                self.drop_point(marker);
                self.drop_point(other);
                self.begin(marker, there);
                self.begin(other, here);
                self.corrected += 2;
                return;
            }
        }
        if is_doubted {
            self.drop_point(marker);
            let sigma = crate_sqrt(square(own.sigma) / found.share + square(self.config.noise));
            if let Some(trace) = self.traces.get_mut(marker) {
                trace.position = expected;
                trace.predicted = expected;
                trace.sigma = sigma;
                trace.kept = 0.0;
                trace.gap = 2;
                trace.doubt = 0;
                trace.velocity = glam::Vec3::ZERO;
                trace.acceleration = glam::Vec3::ZERO;
            }
            self.corrected += 1;
        }
    }
}
