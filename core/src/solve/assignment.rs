//! Rows to columns, one to one, at the least total cost.
//!
//! Successive shortest augmenting paths on a sparse problem (Jonker & Volgenant 1987, *A Shortest
//! Augmenting Path Algorithm for Dense and Sparse Linear Assignment Problems*). A row may stay
//! without a column at its own price, so a solution always exists.

use crate::row::Row;

const NONE: u16 = u16::MAX;

/// What a row got.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// The row takes no part.
    #[default]
    Idle,
    /// No column.
    Without,
    /// This column, which is the row's offer number `slot`.
    Column {
        /// In the order in which the row's offers were made.
        slot: usize,
        /// The column.
        column: u16,
    },
}

#[derive(Clone, Copy, Debug, Default)]
struct Offer {
    column: u16,
    /// Above the row's cheapest option.
    cost: f32,
}

/// A problem of at most `ROWS` rows with at most `OFFERS` of `COLUMNS` columns each, and its
/// working memory.
///
/// ```
/// use sinew_core::solve::assignment::{Assignment, Choice};
/// let mut problem = Assignment::<2, 3, 2>::new();
/// problem.add(0, 9.0);
/// problem.offer(0, 2, 1.0);
/// problem.offer(0, 1, 2.0);
/// problem.add(1, 9.0);
/// problem.offer(1, 2, 4.0);
/// problem.solve();
/// assert_eq!(problem.choice(0), Choice::Column { slot: 1, column: 1 });
/// assert_eq!(problem.choice(1), Choice::Column { slot: 0, column: 2 });
/// ```
#[derive(Clone, Debug)]
pub struct Assignment<const ROWS: usize, const COLUMNS: usize, const OFFERS: usize> {
    offers: Row<Row<Offer, OFFERS>, ROWS>,
    counts: Row<u16, ROWS>,
    without: Row<f32, ROWS>,
    active: Row<bool, ROWS>,
    choice: Row<Choice, ROWS>,
    /// Dual prices of rows and columns.
    row_price: Row<f32, ROWS>,
    column_price: Row<f32, COLUMNS>,
    owner: Row<u16, COLUMNS>,
    /// Shortest path to each column in the current search, and the row before it.
    distance: Row<f32, COLUMNS>,
    from: Row<u16, COLUMNS>,
    settled: Row<bool, COLUMNS>,
    is_reached: Row<bool, COLUMNS>,
    /// Columns that the current search has reached.
    reached: Row<u16, COLUMNS>,
    reached_count: usize,
    work: u32,
}

impl<const ROWS: usize, const COLUMNS: usize, const OFFERS: usize> Default
    for Assignment<ROWS, COLUMNS, OFFERS>
{
    fn default() -> Self {
        Self::new()
    }
}

impl<const ROWS: usize, const COLUMNS: usize, const OFFERS: usize>
    Assignment<ROWS, COLUMNS, OFFERS>
{
    const SIZES: () = assert!(
        ROWS < 65_535 && COLUMNS < 65_535 && OFFERS < 65_535,
        "at most 65,534 rows, columns and offers a row"
    );

    /// A problem without rows.
    #[must_use]
    pub fn new() -> Self {
        let () = Self::SIZES;
        Self {
            offers: Row::new(),
            counts: Row::new(),
            without: Row::new(),
            active: Row::new(),
            choice: Row::new(),
            row_price: Row::new(),
            column_price: Row::new(),
            owner: Row::new(),
            distance: Row::new(),
            from: Row::new(),
            settled: Row::new(),
            is_reached: Row::new(),
            reached: Row::new(),
            reached_count: 0,
            work: 0,
        }
    }

    /// Takes all rows out.
    pub fn clear(&mut self) {
        self.active.fill(false);
        self.choice.fill(Choice::Idle);
    }

    /// Puts a row in; `cost` is that of no column. A row beyond `ROWS` is ignored.
    pub fn add(&mut self, row: usize, cost: f32) {
        self.active.set(row, true);
        self.without.set(row, cost);
        self.counts.set(row, 0);
    }

    /// Offers the row a column. Costs are finite; offers beyond `OFFERS`, and of columns beyond
    /// `COLUMNS`, are ignored.
    pub fn offer(&mut self, row: usize, column: u16, cost: f32) {
        let slot = usize::from(self.counts.at(row));
        if slot < OFFERS && usize::from(column) < COLUMNS {
            self.offers
                .edit(row, |offers| offers.set(slot, Offer { column, cost }));
            self.counts.set(row, slot as u16 + 1);
        }
    }

    /// What [`Self::solve`] has found for a row.
    #[must_use]
    pub fn choice(&self, row: usize) -> Choice {
        self.choice.at(row)
    }

    fn offers(&self, row: usize) -> (Row<Offer, OFFERS>, usize) {
        (self.offers.at(row), usize::from(self.counts.at(row)))
    }

    /// Finds the choices of least total cost and returns the inner steps that took: at most
    /// `ROWS * (ROWS + 1) * (OFFERS + min(ROWS * OFFERS, COLUMNS))`.
    pub fn solve(&mut self) -> u32 {
        self.work = 0;
        self.owner.fill(NONE);
        self.column_price.fill(0.0);
        // Every row that can have its cheapest option takes it; prices of zero support that.
        for row in 0..ROWS {
            if self.active.at(row) {
                let choice = self.take_cheapest(row);
                self.choice.set(row, choice);
            }
        }
        for row in 0..ROWS {
            if self.active.at(row) && self.choice.at(row) == Choice::Idle {
                self.augment(row);
            }
        }
        self.work
    }

    /// Takes the cheapest option of a row off all of its options; gives it, if it is free.
    fn take_cheapest(&mut self, row: usize) -> Choice {
        let (mut offers, count) = self.offers(row);
        let without = self.without.at(row);
        let mut best = (without, None);
        for (slot, offer) in offers.as_slice(count).iter().enumerate() {
            if offer.cost < best.0 {
                best = (offer.cost, Some((slot, offer.column)));
            }
        }
        for slot in 0..count {
            offers.edit(slot, |offer| offer.cost -= best.0);
        }
        self.offers.set(row, offers);
        self.without.set(row, without - best.0);
        self.row_price.set(row, 0.0);
        match best.1 {
            None => Choice::Without,
            Some((slot, column)) if self.owner.at(usize::from(column)) == NONE => {
                self.owner.set(usize::from(column), row as u16);
                Choice::Column { slot, column }
            }
            Some(_) => Choice::Idle,
        }
    }

    /// Finds `start` an option by the cheapest chain of exchanges.
    fn augment(&mut self, start: usize) {
        self.reached_count = 0;
        let (mut row, mut base) = (start, 0.0);
        // The cheapest way to end: some row on the way goes without a column.
        let mut give_up = (f32::MAX, start);
        let mut end_column = None;
        // Each round settles the column of one row, so there are at most as many as rows.
        for _ in 0..=ROWS {
            let without = base + self.without.at(row) - self.row_price.at(row);
            if without < give_up.0 {
                give_up = (without, row);
            }
            self.scan(row, base);
            let mut nearest = (f32::MAX, NONE);
            for &column in self.reached.as_slice(self.reached_count) {
                let distance = self.distance.at(usize::from(column));
                if distance < nearest.0 && !self.settled.at(usize::from(column)) {
                    nearest = (distance, column);
                }
            }
            self.work = self.work.wrapping_add((OFFERS + self.reached_count) as u32);
            let (distance, column) = nearest;
            if column == NONE || distance >= give_up.0 {
                break;
            }
            base = distance;
            let owner = self.owner.at(usize::from(column));
            if owner == NONE {
                end_column = Some(column);
                break;
            }
            self.settled.set(usize::from(column), true);
            row = usize::from(owner);
        }
        let end = if end_column.is_some() {
            base
        } else {
            give_up.0
        };
        self.raise_prices(start, end);
        self.exchange(start, end_column, give_up.1);
        for &column in self.reached.as_slice(self.reached_count) {
            self.settled.set(usize::from(column), false);
            self.is_reached.set(usize::from(column), false);
        }
    }

    /// Relaxes the offers of `row`, which the search has reached at `base`.
    fn scan(&mut self, row: usize, base: f32) {
        let (offers, count) = self.offers(row);
        for offer in offers.as_slice(count) {
            let column = usize::from(offer.column);
            if self.settled.at(column) {
                continue;
            }
            let price = self.row_price.at(row) + self.column_price.at(column);
            let distance = base + offer.cost - price;
            let is_new = !self.is_reached.at(column);
            if is_new {
                self.is_reached.set(column, true);
                self.reached.set(self.reached_count, offer.column);
                self.reached_count += 1;
            }
            if is_new || distance < self.distance.at(column) {
                self.distance.set(column, distance);
                self.from.set(column, row as u16);
            }
        }
    }

    /// Keeps every reduced cost non-negative after a search that ended at distance `end`.
    fn raise_prices(&mut self, start: usize, end: f32) {
        self.row_price.edit(start, |price| *price += end);
        for &column in self.reached.as_slice(self.reached_count) {
            let column = usize::from(column);
            if self.settled.at(column) {
                let slack = end - self.distance.at(column);
                self.column_price.edit(column, |price| *price -= slack);
                let owner = usize::from(self.owner.at(column));
                self.row_price.edit(owner, |price| *price += slack);
            }
        }
    }

    /// Walks back from the end of the path, handing columns on.
    fn exchange(&mut self, start: usize, end_column: Option<u16>, loser: usize) {
        let mut column = match end_column {
            Some(column) => column,
            None => {
                let freed = self.choice.at(loser);
                self.choice.set(loser, Choice::Without);
                match freed {
                    Choice::Column { column, .. } if loser != start => column,
                    _ => return,
                }
            }
        };
        for _ in 0..=ROWS {
            let taker = usize::from(self.from.at(usize::from(column)));
            let given = self.choice.at(taker);
            let (offers, count) = self.offers(taker);
            let mut listed = offers.as_slice(count).iter();
            let slot = listed.position(|offer| offer.column == column);
            let slot = slot.unwrap_or_default();
            self.owner.set(usize::from(column), taker as u16);
            self.choice.set(taker, Choice::Column { slot, column });
            match given {
                Choice::Column { column: next, .. } if taker != start => column = next,
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
        let mut matching = Assignment::<5, 4, 4>::new();
        for _ in 0..500 {
            let costs: [[Option<f32>; 4]; 5] = core::array::from_fn(|_| {
                core::array::from_fn(|_| (draw() < 0.7).then(|| 10.0 * draw()))
            });
            let missing = 6.0;
            matching.clear();
            for (i, row) in costs.iter().enumerate() {
                matching.add(i, missing);
                for (column, cost) in row.iter().enumerate() {
                    if let Some(cost) = *cost {
                        matching.offer(i, column as u16, cost);
                    }
                }
            }
            matching.solve();
            let mut used = 0;
            let mut total = 0.0;
            for (i, row) in costs.iter().enumerate() {
                match matching.choice(i) {
                    Choice::Column { column, .. } => {
                        assert_eq!(used & (1 << column), 0, "a column is given twice");
                        used |= 1 << column;
                        total += row[usize::from(column)].unwrap();
                    }
                    Choice::Without => total += missing,
                    Choice::Idle => panic!("a row was forgotten"),
                }
            }
            let best = brute(&costs, missing, 0);
            assert!((total - best).abs() < 1e-4, "{total} {best}");
        }
    }
}
