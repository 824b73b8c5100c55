//! A point for each marker where it is expected, at the least total cost.
//!
//! A pair costs the squared distance over its variance, and the logarithm of the variance, so that
//! an unsure marker does not take a sure one's point: minus twice a Gaussian log-likelihood.

use glam::Vec3;

use super::pace::square;
use super::state::{NONE, Trace};
use super::{Frame, Model, OFFERS};
use crate::solve::assignment::{Assignment, Choice};

/// Cost of staying without a point: a sure marker's point lies within 5.5 standard deviations.
const PRICE: f32 = 30.0;
/// Distances are compared in square deviations, capped at this.
pub(super) const CAP: f32 = 25.0;
/// Most by which a fill is off beyond its own deviation, metres, and the seconds to half of it.
const UNKNOWN: f32 = 0.02;
const HALF: f32 = 0.15;
/// And at most this share of the distance to the nearest neighbour.
const WITHIN: f32 = 0.3;
/// Weight of what the distances say against a place after a long gap: the pose is then perhaps new.
const STALE: f32 = 0.15;
/// Distances that vary by more than this many metres say little, and much the same.
pub(super) const LOOSE: f32 = 0.015;
/// Steps that a frame's assignment may take, a marker.
pub(super) const SEARCH: u32 = 16;

/// Which markers look for a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Who {
    /// Measured in the frame before: around where their motion takes them.
    Seen,
    /// Filled well: around where their neighbours expect them.
    Filled,
}

impl Frame<'_, '_> {
    pub(super) fn associate_seen(&mut self) {
        self.associate(Who::Seen);
    }

    pub(super) fn associate_filled(&mut self) {
        self.associate(Who::Filled);
    }

    /// Variance of a coordinate of a marker that takes part, square metres.
    fn variance(&self, who: Who, marker: usize, trace: &Trace) -> Option<f32> {
        let jerk = self.pace.jerk;
        if !trace.is_placed || trace.is_measured() {
            return None;
        }
        if who == Who::Seen {
            return (trace.gap == 0).then_some(2.0 * trace.surprise + jerk);
        }
        // In poses that were not learned a fill is off by more than it knows.
        let seconds = f32::from(trace.gap) * self.pace.step;
        let unknown = if trace.streak_before > 0 || trace.gap > self.pace.old {
            // Never so far that a neighbour's place is within reach.
            let spacing = self.model.links(marker).map(|(_, link)| link.distance());
            let spacing = spacing.fold(f32::MAX, f32::min);
            let unknown = UNKNOWN * seconds / (seconds + HALF) * (1.0 + seconds.min(0.5));
            unknown.min(WITHIN * spacing)
        } else {
            0.0
        };
        let variance = square(trace.sigma) + square(unknown) + jerk;
        let is_asked = trace.sigma <= self.config.limit;
        is_asked.then_some(variance)
    }

    fn associate(&mut self, who: Who) {
        let unit = 1.0 / self.pace.jerk;
        Assignment::<_, _, OFFERS>::new(&mut *self.rows, &mut *self.columns);
        let mut any = false;
        for marker in 0..self.traces.len() {
            let trace = self.trace(marker);
            let Some(variance) = self.variance(who, marker, &trace) else {
                continue;
            };
            let unsure = 3.0 * rough_ln((variance * unit).max(1.0));
            let precision = 1.0 / variance;
            let limit = (PRICE - unsure) * variance;
            if limit.is_nan() || limit <= 0.0 {
                continue;
            }
            let mut offers = Nearest::EMPTY;
            let radius = limit * crate::math::rough_inverse_sqrt(limit);
            for (at, point) in self.points.near(trace.position, radius) {
                let distance2 = point.position.distance_squared(trace.position);
                if distance2 < limit && point.owner == NONE {
                    offers.insert(at as u16, distance2);
                }
            }
            if offers.0[0].0 == NONE {
                continue;
            }
            let mut problem = Assignment::<_, _, OFFERS>::of(&mut *self.rows, &mut *self.columns);
            problem.add(marker, PRICE);
            any = true;
            for (at, distance2) in offers.0 {
                if at == NONE {
                    break;
                }
                let mut cost = distance2 * precision + unsure;
                if trace.gap > 0 || offers.0[1].0 != NONE {
                    // What is doubtful asks the neighbours.
                    let position = self.points.at(usize::from(at)).position;
                    let (against, _) =
                        contradiction(self.model, self.traces, marker, position, NONE);
                    let weight = if trace.gap > self.pace.old {
                        STALE
                    } else {
                        0.5
                    };
                    cost += weight * against;
                }
                problem.offer(marker, at, cost);
            }
        }
        if !any {
            return;
        }
        let steps = SEARCH * self.traces.len() as u32;
        let mut problem = Assignment::<_, _, OFFERS>::of(&mut *self.rows, &mut *self.columns);
        self.points.work += problem.solve(steps);
        for marker in 0..self.traces.len() {
            let choice =
                Assignment::<_, _, OFFERS>::of(&mut *self.rows, &mut *self.columns).choice(marker);
            if let Choice::Column { column, .. } = choice {
                self.take(marker, usize::from(column));
            }
        }
    }
}

/// In how many places a marker might be by its distances to found neighbours, inversely: the
/// product of the three best ratios of distance to spread.
pub(super) fn evidence(model: &Model<'_>, traces: &[Trace], marker: usize) -> f32 {
    let mut best = [1.0_f32; 3];
    for (index, link) in model.links(marker) {
        if traces.get(index).is_some_and(Trace::is_measured) {
            let mut carried = link.distance() / link.spread();
            if link.spread() > LOOSE {
                carried = carried.min(4.0);
            }
            for slot in &mut best {
                if carried > *slot {
                    core::mem::swap(slot, &mut carried);
                }
            }
        }
    }
    best[0] * best[1] * best[2]
}

/// How far a place contradicts the distances to a marker's measured neighbours: the sum of what
/// their square deviations have over 4, and how many were asked. Neighbour `except` is not.
pub(super) fn contradiction(
    model: &Model<'_>,
    traces: &[Trace],
    marker: usize,
    position: Vec3,
    except: u16,
) -> (f32, usize) {
    departure(model, traces, marker, position, except, 4.0)
}

/// [`contradiction`], with what is `usual` of a square deviation instead of 4.
pub(super) fn departure(
    model: &Model<'_>,
    traces: &[Trace],
    marker: usize,
    position: Vec3,
    except: u16,
    usual: f32,
) -> (f32, usize) {
    let (mut sum, mut count) = (0.0, 0);
    for (index, link) in model.links(marker) {
        let Some(trace) = traces.get(index) else {
            continue;
        };
        // Neighbours of this frame where there are any, else where they were a frame ago.
        if trace.is_measured() && index != usize::from(except) {
            sum += (deviation(&link, position, trace.position) - usual).max(0.0);
            count += 1;
        }
    }
    (sum, count)
}

/// Squared deviation of a distance, at most [`CAP`].
#[inline]
pub(super) fn deviation(link: &super::model::Link<'_>, a: Vec3, b: Vec3) -> f32 {
    let distance = link.distance();
    // (d^2 - D^2) / 2 D is d - D near D, without a root.
    let off = a.distance_squared(b) - distance * distance;
    let unit = 2.0 * distance * link.spread();
    let square = off * off;
    let limit = CAP * unit * unit;
    if square >= limit {
        CAP
    } else {
        square / (unit * unit)
    }
}

/// The nearest few points, ascending: (point, squared distance).
struct Nearest([(u16, f32); OFFERS]);

impl Nearest {
    const EMPTY: Self = Self([(NONE, f32::MAX); OFFERS]);

    #[inline]
    fn insert(&mut self, point: u16, distance2: f32) {
        let mut carried = (point, distance2);
        for slot in &mut self.0 {
            if carried.1 < slot.1 {
                core::mem::swap(slot, &mut carried);
            }
        }
    }
}

/// Natural logarithm of a positive normal number to 0.06: the exponent, then a straight line.
fn rough_ln(x: f32) -> f32 {
    let bits = x.to_bits() as i32 - 0x3F80_0000;
    bits as f32 * (core::f32::consts::LN_2 / 8_388_608.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_rough() {
        for x in [0.001_f32, 0.7, 1.0, 1.5, 2.0, 300.0] {
            assert!((rough_ln(x) - libm::logf(x)).abs() < 0.061, "{x}");
        }
    }

    #[test]
    fn the_nearest_stay() {
        let mut nearest = Nearest::EMPTY;
        for (at, distance) in [5.0, 1.0, 4.0, 2.0, 3.0, 0.5].into_iter().enumerate() {
            nearest.insert(at as u16, distance);
        }
        assert_eq!(nearest.0, [(5, 0.5), (1, 1.0), (3, 2.0), (4, 3.0)]);
    }
}
