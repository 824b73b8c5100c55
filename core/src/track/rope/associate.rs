//! Which point is which marker: all points to all traces at once.
//!
//! Each trace proposes the nearest points within its gate. The proposals of neighbouring traces
//! must agree: their distance with the segment's length, and their surprises with each other, for
//! a jerk at the hand moves neighbours alike. Costs of whole chains are summed by min-sum message
//! passing along the rope, which is exact on a chain, and give every proposal the cost of the best
//! labelling that contains it. Where two traces still want one point, a shortest augmenting path
//! (Jonker & Volgenant 1987) settles it.

use glam::Vec3;

use super::others::Others;
use super::points::{NONE, Points};
use super::state::{LEAST_SPREAD, Measures};
use super::vector::dot;
use crate::row::Row;
use crate::solve::assignment::{Assignment, Choice, ColumnSlot, RowSlot};

/// Proposals a trace.
pub(super) const CANDIDATES: usize = 5;
/// The state after the last candidate: no point.
pub(super) const MISSING: usize = CANDIDATES;
/// Cost of no point.
pub(super) const COST_MISSING: f32 = 12.0;
/// The same at an end of a rope that is not [`SHORT`].
const END_MISSING: f32 = 6.0;
/// Ropes of fewer markers are short.
const SHORT: usize = 8;
/// Most that being far from the prediction can cost: less than a missing point, for a jerk is not
/// announced and a point whose neighbours agree is better than none.
pub(super) const COST_FAR: f32 = 8.0;
/// Most that being moved otherwise than a neighbour can cost.
const COST_APART: f32 = 8.0;
/// Most that a wrong distance to a neighbour can cost: more than a missing point, so that one
/// of two that contradict each other goes.
const COST_DISAGREE: f32 = 30.0;
/// Most that a short distance can cost: a rope does not stretch, but it folds.
const COST_FOLDED: f32 = 10.0;
/// Standard deviations of a segment beyond its learned spread, metres: longer, and shorter.
const STRETCH: f32 = 0.003;
const SLACK: f32 = 0.004;

/// Price of no point for trace `i` of `count`.
///
/// Inside, a wrong point contradicts two lengths; at an end it contradicts one, so it must be half
/// as doubtful. In a rope of a few markers every trace is near an end, and its point is the best
/// there is.
#[inline]
pub(super) fn missing_price(i: usize, count: usize) -> f32 {
    if count >= SHORT && (i == 0 || i + 1 == count) {
        END_MISSING
    } else {
        COST_MISSING
    }
}

/// What is known of a trace before its points are sought.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Goal {
    /// Not in this pass.
    #[default]
    Skip,
    /// Has this point already.
    Fixed(u16),
    /// Within `gate` of `centre`; `doubt` is the standard deviation there. Metres. `since` frames
    /// have passed since the trace surely had its own point.
    Seek {
        centre: Vec3,
        doubt: f32,
        gate: f32,
        since: u16,
        /// Most that being far from `centre` can cost.
        most: f32,
    },
}

#[derive(Clone, Copy, Debug, Default)]
struct Candidate {
    point: u16,
    position: Vec3,
    /// From where the trace was expected.
    surprise: Vec3,
    cost: f32,
}

const NOBODY: [Candidate; CANDIDATES] = [Candidate {
    point: NONE,
    position: Vec3::ZERO,
    surprise: Vec3::ZERO,
    cost: 0.0,
}; CANDIDATES];
const UNLINKED: [[f32; CANDIDATES]; CANDIDATES] = [[0.0; CANDIDATES]; CANDIDATES];

/// `x` up to `most`, hardly more beyond, so that the nearer of two far points still wins.
#[inline]
fn saturate(x: f32, most: f32) -> f32 {
    x.min(most + 0.01 * x.min(100.0))
}

/// Price of the distance `span` between marker `i` and the next.
#[inline]
pub(super) fn tension<const T: usize>(measures: &Measures<T>, i: usize, span: Vec3) -> f32 {
    let length = measures.length.at(i).max(1e-3);
    let spread = measures.spread.at(i).max(LEAST_SPREAD * LEAST_SPREAD);
    // (d^2 - l^2) / 2l is the error of the length to first order, without a root.
    let off = (dot(span, span) - length * length) / (2.0 * length);
    if off > 0.0 {
        (off * off / (spread + STRETCH * STRETCH)).min(COST_DISAGREE)
    } else {
        saturate(off * off / (spread + SLACK * SLACK), COST_FOLDED)
    }
}

/// Costs of a trace's candidates, then of having none.
type Costs = [f32; CANDIDATES + 1];

/// Working memory of one association.
#[derive(Clone, Debug)]
pub(super) struct Association<const TRACES: usize, const POINTS: usize> {
    candidates: Row<[Candidate; CANDIDATES], TRACES>,
    counts: Row<u8, TRACES>,
    /// Traces.
    count: usize,
    missing: Row<f32, TRACES>,
    links: Row<[[f32; CANDIDATES]; CANDIDATES], TRACES>,
    forward: Row<Costs, TRACES>,
    /// Cost of the best labelling with each candidate.
    total: Row<Costs, TRACES>,
    matching: Assignment<[RowSlot<CANDIDATES>; TRACES], [ColumnSlot; POINTS], CANDIDATES>,
}

/// A trace's point and how much worse the next best labelling would be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    pub(super) trace: usize,
    pub(super) point: u16,
    pub(super) margin: f32,
    /// Squared distance from where the trace was expected.
    pub(super) off: f32,
}

impl<const TRACES: usize, const POINTS: usize> Association<TRACES, POINTS> {
    pub(super) fn new() -> Self {
        Self {
            candidates: Row::new(),
            counts: Row::new(),
            count: 0,
            missing: Row::new(),
            links: Row::new(),
            forward: Row::new(),
            total: Row::new(),
            matching: Assignment::new([RowSlot::EMPTY; TRACES], [ColumnSlot::EMPTY; POINTS]),
        }
    }

    /// Finds the points of all traces that seek one and calls `found` for each success.
    ///
    /// `drift`: one over the variance between the surprises of a trace and the one before it.
    pub(super) fn solve(
        &mut self,
        measures: &Measures<TRACES>,
        goals: &Row<Goal, TRACES>,
        drift: &Row<f32, TRACES>,
        others: &Others<POINTS>,
        points: &mut Points<POINTS>,
        mut found: impl FnMut(Found),
    ) {
        let count = measures.count;
        self.count = count;
        self.matching.clear();
        for i in 0..count {
            self.propose(i, goals.at(i), others, points);
        }
        self.pass_forward(measures, drift, points);
        self.pass_backward(count, points);
        for i in 0..count {
            if let Goal::Seek { .. } = goals.at(i) {
                self.offer(i);
            }
        }
        points.work = points.work.wrapping_add(self.matching.solve(u32::MAX));
        for i in 0..count {
            let Choice::Column {
                slot,
                column: point,
            } = self.matching.choice(i)
            else {
                continue;
            };
            let costs = self.total.at(i);
            let own = costs.get(slot).copied().unwrap_or_default();
            let others = costs.iter().enumerate().filter(|&(k, _)| k != slot);
            let next = others.fold(f32::MAX, |best, (_, &cost)| best.min(cost));
            let margin = next - own;
            let candidates = self.candidates.as_slice(count).get(i);
            let candidate = candidates.and_then(|list| list.get(slot));
            let surprise = candidate.map_or(Vec3::ZERO, |c| c.surprise);
            let off = dot(surprise, surprise);
            found(Found {
                trace: i,
                point,
                margin,
                off,
            });
        }
    }

    /// Fills a trace's candidates, nearest first.
    fn propose(
        &mut self,
        i: usize,
        goal: Goal,
        others: &Others<POINTS>,
        points: &mut Points<POINTS>,
    ) {
        let mut count = 0;
        self.missing.set(i, 0.0);
        let trace_missing = missing_price(i, self.count);
        match goal {
            Goal::Skip => {}
            Goal::Fixed(point) => {
                let position = points.at(usize::from(point));
                self.candidates.edit(i, |[first, ..]| {
                    *first = Candidate {
                        point,
                        position,
                        ..Candidate::default()
                    };
                });
                count = 1;
                self.missing.set(i, f32::MAX);
            }
            Goal::Seek {
                centre,
                doubt,
                gate,
                since,
                most,
            } => {
                self.missing.set(i, trace_missing);
                let scale = 1.0 / (doubt * doubt);
                self.candidates.edit(i, |list| {
                    points.near(centre, gate, |point, surprise, square| {
                        let stranger = others.price(point, i, since, square);
                        let cost = saturate(square * scale, most) + stranger;
                        let place = list
                            .iter()
                            .take(count)
                            .position(|c| c.cost > cost)
                            .unwrap_or(count);
                        if place >= CANDIDATES {
                            return;
                        }
                        count = (count + 1).min(CANDIDATES);
                        let position = centre + surprise;
                        let mut carried = Candidate {
                            point,
                            position,
                            surprise,
                            cost,
                        };
                        for slot in list.iter_mut().take(count).skip(place) {
                            core::mem::swap(slot, &mut carried);
                        }
                    });
                });
            }
        }
        self.counts.set(i, count as u8);
    }

    fn pass_forward(
        &mut self,
        measures: &Measures<TRACES>,
        drift: &Row<f32, TRACES>,
        points: &mut Points<POINTS>,
    ) {
        let mut before: Costs = [0.0; CANDIDATES + 1];
        let mut work = 0;
        for i in 0..measures.count {
            let all = self.candidates.as_slice(measures.count);
            let count = usize::from(self.counts.at(i));
            let mut costs: Costs = [f32::MAX; CANDIDATES + 1];
            // The predecessor's best, where neither end has a point to compare.
            let free = before.iter().fold(f32::MAX, |best, &c| best.min(c));
            let previous_count = if i == 0 {
                0
            } else {
                usize::from(self.counts.at(i - 1))
            };
            let drift = drift.at(i);
            let previous_missing = before.get(MISSING).copied().unwrap_or_default();
            let own = all.get(i).unwrap_or(&NOBODY);
            let previous = all.get(i.wrapping_sub(1)).unwrap_or(&NOBODY);
            self.links.edit(i, |links| {
                for ((b, cost), row) in own.iter().zip(&mut costs).zip(links).take(count) {
                    let mut best = if i == 0 { 0.0 } else { previous_missing };
                    let pairs = previous.iter().zip(&before).zip(row).take(previous_count);
                    for ((a, &base), link) in pairs {
                        let apart = b.surprise - a.surprise;
                        *link = tension(measures, i.wrapping_sub(1), b.position - a.position)
                            + saturate(dot(apart, apart) * drift, COST_APART);
                        best = best.min(base + *link);
                        work += 1;
                    }
                    *cost = b.cost + best;
                }
            });
            if let Some(cost) = costs.get_mut(MISSING) {
                let missing = self.missing.at(i);
                *cost = if missing < f32::MAX {
                    missing + free
                } else {
                    f32::MAX
                };
            }
            self.forward.set(i, costs);
            before = costs;
        }
        points.work = points.work.wrapping_add(work);
    }

    fn pass_backward(&mut self, count: usize, points: &mut Points<POINTS>) {
        // Cost of everything after trace `i`, for each of its states.
        let mut after: Costs = [0.0; CANDIDATES + 1];
        let mut work = 0;
        for i in (0..count).rev() {
            let forward = self.forward.at(i);
            let mut total: Costs = [f32::MAX; CANDIDATES + 1];
            for ((total, &head), &tail) in total.iter_mut().zip(&forward).zip(&after) {
                if head < f32::MAX {
                    *total = head + tail;
                }
            }
            self.total.set(i, total);
            // What trace `i` and everything after it costs, for each state of trace `i - 1`.
            let own = self.candidates.as_slice(count).get(i).unwrap_or(&NOBODY);
            let mine = usize::from(self.counts.at(i));
            let links = self.links.as_slice(count).get(i).unwrap_or(&UNLINKED);
            let missing = self.missing.at(i);
            let [.., after_missing] = after;
            let alone = if missing < f32::MAX {
                missing + after_missing
            } else {
                f32::MAX
            };
            let unlinked = own
                .iter()
                .zip(&after)
                .take(mine)
                .fold(alone, |best, (c, &tail)| best.min(c.cost + tail));
            let mut next: Costs = [unlinked; CANDIDATES + 1];
            let before = usize::from(self.counts.at(i.wrapping_sub(1)));
            for (k, slot) in next.iter_mut().take(CANDIDATES.min(before)).enumerate() {
                let mut best = alone;
                for ((c, &tail), row) in own.iter().zip(&after).zip(links).take(mine) {
                    let link = row.get(k).copied().unwrap_or_default();
                    best = best.min(c.cost + tail + link);
                    work += 1;
                }
                *slot = best;
            }
            after = next;
        }
        points.work = points.work.wrapping_add(work);
    }

    /// Hands a trace's total costs to the matching.
    fn offer(&mut self, i: usize) {
        let total = self.total.at(i);
        let [.., missing] = total;
        self.matching.add(i, missing);
        let count = usize::from(self.counts.at(i));
        let list = self.candidates.as_slice(self.count).get(i);
        let list = list.unwrap_or(&NOBODY);
        for (candidate, &cost) in list.iter().zip(&total).take(count) {
            self.matching.offer(i, candidate.point, cost);
        }
    }
}
