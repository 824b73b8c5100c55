//! Lost markers, from their distances to the markers that are found.
//!
//! In rounds: every lost marker names its best point, every point its best marker; pairs that name
//! each other, and by a clear margin, are made. Each find helps the next round. What stays
//! ambiguous waits.

use glam::Vec3;

use super::Frame;
use super::associate::{deviation, evidence};
use super::pace::square;
use super::state::{NONE, Proposal, Trace};

/// How far from its fill a believed marker may be beside what the fill says itself, metres.
const NEAR: f32 = 0.04;
/// Most frames between two searches for lost markers that find none.
const REST: u8 = 7;
/// Rounds in a frame.
const ROUNDS: usize = 32;
/// Square deviation that a distance may have on average.
const FIT: f32 = 4.0;
/// Evidence needed; the later figures are for when nothing surer is left.
const EVIDENCE: [f32; 3] = [20_000.0, 4000.0, 500.0];
/// A second choice must cost this much more.
const CLEAR: [f32; 3] = [9.0, 9.0, 4.0];

impl Frame<'_, '_> {
    /// Looks for lost markers; less and less often as long as nothing comes of it and nothing new
    /// is seen or lost.
    pub(super) fn seek_in_turn(&mut self) {
        let measured = self.measured();
        let free = self.points.len().saturating_sub(measured);
        let is_new =
            free > usize::from(self.course.free) || measured < usize::from(self.course.held);
        self.course.free = free as u16;
        if is_new {
            self.course.tries = 0;
        } else if self.course.rest > 0 {
            self.course.rest -= 1;
            self.course.held = measured as u16;
            return;
        }
        let before = self.points.work;
        self.seek(before.saturating_add(self.search), true, 0);
        self.spend(before);
        let held = self.measured();
        self.course.held = held as u16;
        self.course.tries = if held > measured {
            0
        } else {
            (self.course.tries + 1).min(REST)
        };
        self.course.rest = self.course.tries;
    }

    /// Whether a marker may be anywhere: its fill is bad, was never confirmed, or is old.
    pub(super) fn is_lost(&self, trace: &Trace) -> bool {
        let is_believed = trace.is_placed
            && trace.sigma <= self.config.limit
            && trace.streak_before > 0
            && trace.gap < self.pace.old;
        !trace.is_measured() && !is_believed
    }

    /// Looks for lost markers among the free points until a round finds none or the frame's work
    /// reaches `budget`. `anywhere`: also groups that nothing found leads to, else until `enough`
    /// markers are found.
    pub(super) fn seek(&mut self, budget: u32, anywhere: bool, enough: usize) {
        let open = |trace: &Trace| !trace.is_measured();
        if !self.traces.iter().any(open) || self.points.all_mut().iter().all(|p| p.owner != NONE) {
            return;
        }
        let mut step = 0;
        for _ in 0..ROUNDS {
            if self.points.work >= budget {
                return;
            }
            if !anywhere && self.measured() >= enough {
                return;
            }
            // The surest way first; back to it after every find.
            // Groups that nothing leads to cost most: they get half of what is left.
            let left = budget.saturating_sub(self.points.work);
            let half = self.points.work.saturating_add(left / 2);
            let found = match step {
                0 => self.complete(2, false, budget),
                1 => self.propose(budget, 0),
                2 => anywhere && self.complete(0, false, half),
                3 => self.propose(budget, 1),
                4 => self.propose(budget, 2),
                5 => anywhere && self.complete(0, true, half),
                _ => return,
            };
            step = if found { 0 } else { step + 1 };
        }
    }

    pub(super) fn measured(&self) -> usize {
        self.traces
            .iter()
            .filter(|trace| trace.is_measured())
            .count()
    }

    /// A marker found anew: where it was thought to be says nothing.
    pub(super) fn begin(&mut self, marker: usize, point: usize) {
        if let Some(trace) = self.traces.get_mut(marker) {
            trace.is_placed = false;
            trace.is_turned = false;
            trace.doubt = 0;
        }
        self.take(marker, point);
    }

    /// Every lost marker looks at the free points around its most rigid found neighbour; pairs that
    /// agree are made. Whether there was one. `late`: 0, or up to 2 with less evidence.
    fn propose(&mut self, budget: u32, late: usize) -> bool {
        for point in self.points.all_mut() {
            (point.best, point.cost, point.second) = (NONE, f32::MAX, f32::MAX);
        }
        self.proposals.fill(Proposal::EMPTY);
        for marker in 0..self.traces.len() {
            let trace = self.trace(marker);
            if trace.is_measured() {
                continue;
            }
            // What is filled well is not far from there.
            let (place, near2) = if self.is_lost(&trace) {
                (Vec3::ZERO, f32::MAX)
            } else {
                (trace.position, square(NEAR + 5.0 * trace.sigma))
            };
            if self.points.work >= budget {
                break;
            }
            if evidence(self.model, self.traces, marker) < EVIDENCE[late.min(2)] {
                continue;
            }
            let found = |(index, _): &(usize, _)| self.trace(*index).is_measured();
            let count = self.model.links(marker).filter(found).count();
            let Some((anchor, link)) = self.model.links(marker).find(found) else {
                continue;
            };
            let centre = self.trace(anchor).position;
            let radius = link.distance() + 4.0 * link.spread();
            let limit = FIT * count as f32 + 4.0;
            let mut proposal = Proposal::EMPTY;
            for at in self.points.window(centre, radius) {
                self.points.work += 1;
                let point = self.points.at(at);
                if point.owner != NONE || point.position.distance_squared(place) > near2 {
                    continue;
                }
                let mut cost = 0.0;
                for (index, link) in self.model.links(marker) {
                    let Some(trace) = self.traces.get(index) else {
                        continue;
                    };
                    if trace.is_measured() {
                        let off = deviation(&link, point.position, trace.position);
                        cost += off;
                        if cost > limit {
                            break;
                        }
                    }
                }
                if cost > limit {
                    continue;
                }
                self.points.work += count as u32;
                // Comparable between markers with more and with fewer neighbours.
                let cost = cost - count as f32;
                if cost < proposal.cost {
                    proposal.second = proposal.cost;
                    (proposal.point, proposal.cost) = (at as u16, cost);
                } else if cost < proposal.second {
                    proposal.second = cost;
                }
                self.points.edit(at, |point| {
                    if cost < point.cost {
                        point.second = point.cost;
                        (point.best, point.cost) = (marker as u16, cost);
                    } else if cost < point.second {
                        point.second = cost;
                    }
                });
            }
            if let Some(slot) = self.proposals.get_mut(marker) {
                *slot = proposal;
            }
        }
        self.agree(CLEAR[late.min(2)])
    }

    /// Makes the pairs that agree by a margin; whether there was one.
    fn agree(&mut self, clear: f32) -> bool {
        let mut found = false;
        for marker in 0..self.traces.len() {
            let Some(&proposal) = self.proposals.get(marker) else {
                continue;
            };
            let point = self.points.at(usize::from(proposal.point));
            let is_mutual = proposal.point != NONE && usize::from(point.best) == marker;
            let second = proposal.second.min(point.second);
            if is_mutual && point.owner == NONE && second > proposal.cost + clear {
                self.begin(marker, usize::from(proposal.point));
                found = true;
            }
        }
        found
    }
}
