//! Markers that their neighbours contradict change places or lose their point.

use glam::Vec3;

use super::Frame;
use super::associate::{contradiction, departure, deviation};
use super::fill::{self, Expectation, expect, placed};
use super::pace::square;
use super::state::NONE;
use crate::math::rough_inverse_sqrt;

/// A distance this many square deviations off is wrong.
const WRONG: f32 = 16.0;
/// A marker is weak unless so many distances that vary by less than so many metres are within so
/// many square deviations.
const FIRM: u8 = 3;
const TIGHT: f32 = 0.01;
const RIGHT: f32 = 9.0;
/// Frames, more or less in a row, with wrong distances before a marker is lost.
const PATIENCE: u8 = 3;
/// Neighbours whose word counts: share of their weight.
const SHARE: f32 = 0.5;
/// Metres by which a marker may sit elsewhere than learned.
const MISPLACED: f32 = 0.015;
/// How much more an exchange of two points must explain, in square deviations; the share of what
/// spoke against the labels that may still do, and distances that must be asked.
const CLEARLY: f32 = 10.0;
const LEFT: f32 = 0.4;
const ASKED: usize = 4;
/// Markers farther apart do not take each other's point, metres.
const NEAR: f32 = 0.15;
/// How far from its fill a marker's point may be worn by another, metres.
const WITHIN: f32 = 0.05;
/// Within so many metres and two deviations of where it is expected a marker is not questioned.
const CLOSE: f32 = 0.005;

impl Frame<'_, '_> {
    /// Compares all markers with their distances and loses the worst; compares some in turn with
    /// what the fill expects.
    pub(super) fn audit(&mut self) {
        for _ in 0..self.pace.reviews {
            let marker = self.course.next;
            self.course.next = if marker + 1 < self.traces.len() {
                marker + 1
            } else {
                0
            };
            self.review(marker);
        }
        // The worst first: without it the others may be right.
        let mut worst = (0.0, 0);
        for marker in 0..self.traces.len() {
            let share = self.wrong_share(marker);
            let Some(trace) = self.traces.get_mut(marker) else {
                continue;
            };
            if share > 0.0 {
                trace.doubt = trace.doubt.saturating_add(1);
                if trace.doubt >= PATIENCE && share > worst.0 {
                    worst = (share, marker);
                }
            } else {
                trace.doubt = trace.doubt.saturating_sub(1);
            }
        }
        if worst.0 > 0.0 {
            self.lose(worst.1);
        }
    }

    /// Share of a measured marker's distances that are wrong; 0 where they are few.
    fn wrong_share(&mut self, marker: usize) -> f32 {
        let trace = self.trace(marker);
        if !trace.is_measured() || trace.is_firm {
            return 0.0;
        }
        self.points.work += 1;
        let (mut wrong, mut count, mut firm) = (0.0, 0.0, 0);
        for (index, link) in self.model.links(marker) {
            let Some(other) = self.traces.get(index) else {
                continue;
            };
            if other.is_measured() {
                count += 1.0;
                let off = deviation(&link, trace.position, other.position);
                wrong += f32::from(u8::from(off > WRONG));
                firm += u8::from(off < RIGHT && link.spread() < TIGHT);
            }
        }
        if let Some(trace) = self.traces.get_mut(marker) {
            trace.is_weak = firm < FIRM;
            trace.is_firm = wrong == 0.0 && trace.doubt == 0 && trace.streak > self.pace.old;
        }
        if wrong >= 2.0 && 3.0 * wrong > count {
            wrong / count
        } else {
            0.0
        }
    }

    pub(super) fn lose(&mut self, marker: usize) {
        self.drop_point(marker);
        if let Some(trace) = self.traces.get_mut(marker) {
            trace.is_placed = false;
            trace.is_turned = false;
            trace.doubt = 0;
        }
        self.corrected += 1;
    }

    /// Compares a measured marker with what its neighbours expect: learns its bias, or exchanges
    /// it.
    fn review(&mut self, marker: usize) {
        let trace = self.trace(marker);
        if !trace.is_measured() {
            self.evict(marker);
            return;
        }
        if self.exchange(marker) {
            return;
        }
        let Some(found) = self.expectation(marker) else {
            return;
        };
        let own = self.model.marker(marker);
        let miss = found.to_local(trace.position) - found.local - trace.bias;
        let miss2 = miss.length_squared();
        if miss2 > square(2.0 * own.sigma + CLOSE) && self.correct(marker, &found) {
            return;
        }
        if let Some(trace) = self.traces.get_mut(marker) {
            (trace.turn, trace.is_turned) = (found.turn, true);
            if trace.doubt == 0 && miss2 < square(5.0 * own.sigma + MISPLACED) {
                trace.bias += miss * self.pace.bias.min(1.0);
                let bias2 = trace.bias.length_squared();
                if bias2 > MISPLACED * MISPLACED {
                    trace.bias *= MISPLACED * rough_inverse_sqrt(bias2);
                }
            }
        }
    }

    /// Gives two neighbours each other's point where the distances to all others say so clearly;
    /// whether it did.
    fn exchange(&mut self, marker: usize) -> bool {
        let own = self.trace(marker);
        let links = self.model.links(marker);
        let (against, _) = self.against(marker, own.position, NONE);
        self.points.work += 1;
        if against < CLEARLY {
            return false;
        }
        let mut best = (0.0, None);
        for (other, link) in links {
            let theirs = self.trace(other);
            if !theirs.is_measured() || link.distance() > NEAR {
                continue;
            }
            self.points.work += 4 * self.model.dims().neighbour_count as u32;
            let sum = |a: Vec3, b: Vec3| {
                let (first, asked) = self.against(marker, a, other as u16);
                let (second, more) = self.against(other, b, marker as u16);
                (first + second, asked + more)
            };
            let (now, _) = sum(own.position, theirs.position);
            let (then, asked) = sum(theirs.position, own.position);
            let gain = now - then - CLEARLY;
            if asked >= ASKED && then < LEFT * now && gain > best.0 {
                best = (gain, Some(other));
            }
        }
        let Some(other) = best.1 else {
            return false;
        };
        let (here, there) = (usize::from(own.point), usize::from(self.trace(other).point));
        self.drop_point(marker);
        self.drop_point(other);
        self.begin(marker, there);
        self.begin(other, here);
        self.corrected += 2;
        true
    }

    /// Gives a filled marker the point near its place that another marker wears, where the distances
    /// to all others say so clearly: the end of a row of markers that each took the next one's.
    fn evict(&mut self, marker: usize) {
        let trace = self.trace(marker);
        if !trace.is_placed || trace.sigma > self.config.limit {
            return;
        }
        let mut best = (CLEARLY, None);
        for at in self.points.window(trace.position, WITHIN) {
            self.points.work += 1;
            let point = self.points.at(at);
            let owner = usize::from(point.owner);
            if point.owner == NONE
                || point.position.distance_squared(trace.position) > square(WITHIN)
            {
                continue;
            }
            self.points.work += 2 * self.model.dims().neighbour_count as u32;
            let (then, asked) = self.against(marker, point.position, owner as u16);
            let (now, _) = self.against(owner, point.position, NONE);
            if asked >= ASKED && then < LEFT * now && now - then > best.0 {
                best = (now - then, Some((at, owner)));
            }
        }
        if let Some((point, owner)) = best.1 {
            self.lose(owner);
            self.begin(marker, point);
        }
    }

    fn against(&self, marker: usize, place: Vec3, except: u16) -> (f32, usize) {
        departure(self.model, self.traces, marker, place, except, 0.0)
    }

    fn expectation(&mut self, marker: usize) -> Option<Expectation> {
        let trace = self.trace(marker);
        self.points.work += fill::work(self.model.dims().neighbour_count);
        let found = expect(self.model, placed(self.traces), marker, trace.turn());
        found.filter(|found| found.share > SHARE)
    }

    /// A marker that is not where it is expected: takes the point that is there, if that explains
    /// more, for the point's owner too. Whether it did.
    fn correct(&mut self, marker: usize, found: &Expectation) -> bool {
        let trace = self.trace(marker);
        let own = self.model.marker(marker);
        let expected = found.to_world(found.local + trace.bias);
        let reach = 4.0 * own.sigma + MISPLACED;
        let here = usize::from(trace.point);
        let Some((there, miss2)) = self.points.nearest(expected, reach, |_| true) else {
            return false;
        };
        let owner = self.points.at(there).owner;
        let other = usize::from(owner);
        if there == here || 4.0 * miss2 > trace.position.distance_squared(expected) {
            return false;
        }
        let against = |frame: &Self, marker: usize, point: usize, except: usize| {
            let position = frame.points.at(point).position;
            contradiction(frame.model, frame.traces, marker, position, except as u16).0
        };
        let now = against(self, marker, here, other);
        let then = against(self, marker, there, other);
        if owner == NONE {
            let is_better = then <= now;
            if is_better {
                self.drop_point(marker);
                self.begin(marker, there);
                self.corrected += 1;
            }
            return is_better;
        }
        let Some(others) = self.expectation(other) else {
            return false;
        };
        let bias = self.trace(other).bias;
        let elsewhere = others.to_world(others.local + bias);
        let (from, to) = (
            self.points.at(there).position,
            self.points.at(here).position,
        );
        let is_nearer = 4.0 * elsewhere.distance_squared(to) < elsewhere.distance_squared(from);
        let now = now + against(self, other, there, marker);
        let then = then + against(self, other, here, marker);
        let is_better = is_nearer && then <= now;
        if is_better {
            self.drop_point(marker);
            self.drop_point(other);
            self.begin(marker, there);
            self.begin(other, here);
            self.corrected += 2;
        }
        is_better
    }
}
