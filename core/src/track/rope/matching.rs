//! One point a trace and one trace a point, at the least total cost.
//!
//! Successive shortest augmenting paths on a sparse problem (Jonker & Volgenant 1987, *A Shortest
//! Augmenting Path Algorithm for Dense and Sparse Linear Assignment Problems*). A trace may stay
//! without a point at its own price, so a solution always exists.

use super::associate::CANDIDATES;
use super::points::{NONE, Points};
use super::row::Row;

/// What a trace got.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Choice {
    /// Takes no part.
    #[default]
    Idle,
    /// No point.
    Missing,
    /// This point, which is the trace's candidate number `slot`.
    Point { slot: usize, point: u16 },
}

#[derive(Clone, Copy, Debug, Default)]
struct Offer {
    point: u16,
    /// Above the trace's cheapest option.
    cost: f32,
}

#[derive(Clone, Debug)]
pub(super) struct Matching<const TRACES: usize, const POINTS: usize> {
    offers: Row<[Offer; CANDIDATES], TRACES>,
    counts: Row<u8, TRACES>,
    missing: Row<f32, TRACES>,
    active: Row<bool, TRACES>,
    choice: Row<Choice, TRACES>,
    /// Dual prices of traces and points.
    trace_price: Row<f32, TRACES>,
    point_price: Row<f32, POINTS>,
    owner: Row<u16, POINTS>,
    /// Shortest path to each point in the current search, and the trace before it.
    distance: Row<f32, POINTS>,
    from: Row<u16, POINTS>,
    settled: Row<bool, POINTS>,
    /// Points that the current search has reached.
    reached: heapless::Vec<u16, POINTS>,
}

impl<const TRACES: usize, const POINTS: usize> Matching<TRACES, POINTS> {
    pub(super) fn new() -> Self {
        Self {
            offers: Row::new(),
            counts: Row::new(),
            missing: Row::new(),
            active: Row::new(),
            choice: Row::new(),
            trace_price: Row::new(),
            point_price: Row::new(),
            owner: Row::new(),
            distance: Row::new(),
            from: Row::new(),
            settled: Row::new(),
            reached: heapless::Vec::new(),
        }
    }

    /// Takes a trace out.
    pub(super) fn clear(&mut self, trace: usize) {
        self.active.set(trace, false);
        self.counts.set(trace, 0);
        self.choice.set(trace, Choice::Idle);
    }

    /// Puts a trace in; `cost` is that of no point.
    pub(super) fn set_missing(&mut self, trace: usize, cost: f32) {
        self.active.set(trace, true);
        self.missing.set(trace, cost);
    }

    /// Offers the trace a point; slots in ascending order.
    pub(super) fn offer(&mut self, trace: usize, slot: usize, point: u16, cost: f32) {
        self.offers.edit(trace, |offers| {
            if let Some(offer) = offers.get_mut(slot) {
                *offer = Offer { point, cost };
            }
        });
        self.counts.edit(trace, |count| *count += 1);
    }

    pub(super) fn choice(&self, trace: usize) -> Choice {
        self.choice.at(trace)
    }

    /// Matches the first `count` traces.
    pub(super) fn solve(&mut self, count: usize, points: &mut Points<POINTS>) {
        self.owner.fill(NONE);
        self.point_price.fill(0.0);
        // Every trace that can have its cheapest option takes it; prices of zero support that.
        for trace in (0..count).filter(|&t| self.active.at(t)) {
            let offers = self.offers.at(trace);
            let listed = usize::from(self.counts.at(trace));
            let missing = self.missing.at(trace);
            let mut best = (missing, None);
            for (slot, offer) in offers.iter().take(listed).enumerate() {
                if offer.cost < best.0 {
                    best = (offer.cost, Some((slot, offer.point)));
                }
            }
            self.offers.edit(trace, |offers| {
                for offer in offers.iter_mut() {
                    offer.cost -= best.0;
                }
            });
            self.missing.set(trace, missing - best.0);
            self.trace_price.set(trace, 0.0);
            let choice = match best.1 {
                None => Choice::Missing,
                Some((slot, point)) if self.owner.at(usize::from(point)) == NONE => {
                    self.owner.set(usize::from(point), trace as u16);
                    Choice::Point { slot, point }
                }
                Some(_) => Choice::Idle,
            };
            self.choice.set(trace, choice);
        }
        for trace in 0..count {
            if self.active.at(trace) && self.choice.at(trace) == Choice::Idle {
                self.augment(trace, points);
            }
        }
    }

    /// Finds `start` an option by the cheapest chain of exchanges.
    fn augment(&mut self, start: usize, points: &mut Points<POINTS>) {
        self.reached.clear();
        let (mut trace, mut base) = (start, 0.0);
        // The cheapest way to end: some trace on the way goes without a point.
        let mut give_up = (f32::MAX, start);
        let mut end_point = None;
        // Each round settles the point of one trace, so there are at most as many as traces.
        for _ in 0..TRACES {
            let without = base + self.missing.at(trace) - self.trace_price.at(trace);
            if without < give_up.0 {
                give_up = (without, trace);
            }
            self.scan(trace, base);
            let open = self.reached.iter().filter(|&&p| !self.settled.at(usize::from(p)));
            let mut nearest = (f32::MAX, NONE);
            for &point in open {
                let distance = self.distance.at(usize::from(point));
                if distance < nearest.0 {
                    nearest = (distance, point);
                }
            }
            points.work = points.work.wrapping_add((CANDIDATES + self.reached.len()) as u32);
            let (distance, point) = nearest;
            if point == NONE || distance >= give_up.0 {
                break;
            }
            base = distance;
            let owner = self.owner.at(usize::from(point));
            if owner == NONE {
                end_point = Some(point);
                break;
            }
            self.settled.set(usize::from(point), true);
            trace = usize::from(owner);
        }
        let end = if end_point.is_some() { base } else { give_up.0 };
        self.raise_prices(start, end);
        self.exchange(start, end_point, give_up.1);
        for &point in &self.reached {
            self.settled.set(usize::from(point), false);
            self.distance.set(usize::from(point), 0.0);
        }
    }

    /// Relaxes the offers of `trace`, which the search has reached at `base`.
    fn scan(&mut self, trace: usize, base: f32) {
        let offers = self.offers.at(trace);
        let listed = usize::from(self.counts.at(trace));
        for offer in offers.iter().take(listed) {
            let point = usize::from(offer.point);
            if self.settled.at(point) {
                continue;
            }
            let price = self.trace_price.at(trace) + self.point_price.at(point);
            let distance = base + offer.cost - price;
            let known = self.reached.contains(&offer.point);
            if !known && self.reached.push(offer.point).is_err() {
                continue;
            }
            if !known || distance < self.distance.at(point) {
                self.distance.set(point, distance);
                self.from.set(point, trace as u16);
            }
        }
    }

    /// Keeps every reduced cost non-negative after a search that ended at distance `end`.
    fn raise_prices(&mut self, start: usize, end: f32) {
        self.trace_price.edit(start, |price| *price += end);
        for &point in &self.reached {
            let point = usize::from(point);
            if self.settled.at(point) {
                let slack = end - self.distance.at(point);
                self.point_price.edit(point, |price| *price -= slack);
                let owner = usize::from(self.owner.at(point));
                self.trace_price.edit(owner, |price| *price += slack);
            }
        }
    }

    /// Walks back from the end of the path, handing points on.
    fn exchange(&mut self, start: usize, end_point: Option<u16>, loser: usize) {
        let mut point = match end_point {
            Some(point) => point,
            None => {
                let freed = self.choice.at(loser);
                self.choice.set(loser, Choice::Missing);
                match freed {
                    Choice::Point { point, .. } if loser != start => point,
                    _ => return,
                }
            }
        };
        for _ in 0..=TRACES {
            let taker = usize::from(self.from.at(usize::from(point)));
            let given = self.choice.at(taker);
            let listed = usize::from(self.counts.at(taker));
            let offers = self.offers.at(taker);
            let slot = offers.iter().take(listed).position(|o| o.point == point);
            self.owner.set(usize::from(point), taker as u16);
            let slot = slot.unwrap_or_default();
            self.choice.set(taker, Choice::Point { slot, point });
            match given {
                Choice::Point { point: next, .. } if taker != start => point = next,
                _ => return,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cheapest total by trying everything.
    fn brute(costs: &[[Option<f32>; 4]], missing: f32, used: u32) -> f32 {
        let Some((row, rest)) = costs.split_first() else {
            return 0.0;
        };
        let mut best = missing + brute(rest, missing, used);
        for (k, cost) in row.iter().enumerate() {
            if let Some(cost) = cost
                && used & (1 << k) == 0
            {
                best = best.min(cost + brute(rest, missing, used | (1 << k)));
            }
        }
        best
    }

    #[test]
    fn total_cost_is_the_least_of_all() {
        let mut state = 12345_u32;
        let mut draw = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut points = Points::<4>::new();
        for _ in 0..500 {
            let costs: [[Option<f32>; 4]; 5] = core::array::from_fn(|_| {
                core::array::from_fn(|_| (draw() < 0.7).then(|| 10.0 * draw()))
            });
            let missing = 6.0;
            let mut matching = Matching::<5, 4>::new();
            for (i, row) in costs.iter().enumerate() {
                matching.clear(i);
                matching.set_missing(i, missing);
                let listed = row.iter().enumerate().filter_map(|(k, c)| Some((k, (*c)?)));
                for (slot, (point, cost)) in listed.enumerate() {
                    matching.offer(i, slot, point as u16, cost);
                }
            }
            matching.solve(5, &mut points);
            let mut used = 0;
            let mut total = 0.0;
            for (i, row) in costs.iter().enumerate() {
                match matching.choice(i) {
                    Choice::Point { point, .. } => {
                        assert_eq!(used & (1 << point), 0, "a point is given twice");
                        used |= 1 << point;
                        total += row[usize::from(point)].unwrap();
                    }
                    Choice::Missing => total += missing,
                    Choice::Idle => panic!("a trace was forgotten"),
                }
            }
            let best = brute(&costs, missing, 0);
            assert!((total - best).abs() < 1e-4, "{total} {best}");
        }
    }
}
