//! Rows to columns, one to one, at the least total cost.
//!
//! Successive shortest augmenting paths on a sparse problem (Jonker & Volgenant 1987, *A Shortest
//! Augmenting Path Algorithm for Dense and Sparse Linear Assignment Problems*). A row may stay
//! without a column at its own price, so a solution always exists.

use core::borrow::BorrowMut;

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

/// Memory of one row with at most `OFFERS` offers.
#[derive(Clone, Copy, Debug)]
pub struct RowSlot<const OFFERS: usize> {
    offers: [Offer; OFFERS],
    count: u16,
    is_active: bool,
    choice: Choice,
    without: f32,
    price: f32,
}

impl<const OFFERS: usize> RowSlot<OFFERS> {
    /// A row that takes no part.
    pub const EMPTY: Self = Self {
        offers: [Offer {
            column: 0,
            cost: 0.0,
        }; OFFERS],
        count: 0,
        is_active: false,
        choice: Choice::Idle,
        without: 0.0,
        price: 0.0,
    };

    fn offers(&self) -> &[Offer] {
        self.offers
            .get(..usize::from(self.count))
            .unwrap_or_default()
    }

    /// Takes the cheapest option off all options and gives it.
    fn reduce(&mut self) -> Option<(usize, u16)> {
        let mut best = (self.without, None);
        for (slot, offer) in self.offers().iter().enumerate() {
            if offer.cost < best.0 {
                best = (offer.cost, Some((slot, offer.column)));
            }
        }
        for offer in &mut self.offers {
            offer.cost -= best.0;
        }
        self.without -= best.0;
        self.price = 0.0;
        best.1
    }
}

/// Memory of one column.
#[derive(Clone, Copy, Debug)]
pub struct ColumnSlot {
    price: f32,
    owner: u16,
    /// Shortest path to it in the current search, and the row before it.
    distance: f32,
    from: u16,
    is_settled: bool,
    is_reached: bool,
    /// Entry number of this index in the list of columns that the current search has reached.
    reached: u16,
}

impl ColumnSlot {
    /// A column without a row.
    pub const EMPTY: Self = Self {
        price: 0.0,
        owner: NONE,
        distance: 0.0,
        from: NONE,
        is_settled: false,
        is_reached: false,
        reached: 0,
    };
}

/// A problem in the caller's memory: `R` holds `[RowSlot<OFFERS>]`, one a row, `C` holds
/// `[ColumnSlot]`, one a column; old contents do not matter. At most 65,534 of each.
///
/// ```
/// use sinew_core::solve::assignment::{Assignment, Choice, ColumnSlot, RowSlot};
/// let rows = [RowSlot::<2>::EMPTY; 2];
/// let mut problem = Assignment::new(rows, [ColumnSlot::EMPTY; 3]);
/// problem.add(0, 9.0);
/// problem.offer(0, 2, 1.0);
/// problem.offer(0, 1, 2.0);
/// problem.add(1, 9.0);
/// problem.offer(1, 2, 4.0);
/// problem.solve(u32::MAX);
/// assert_eq!(problem.choice(0), Choice::Column { slot: 1, column: 1 });
/// assert_eq!(problem.choice(1), Choice::Column { slot: 0, column: 2 });
/// ```
#[derive(Clone, Debug)]
pub struct Assignment<R, C, const OFFERS: usize> {
    rows: R,
    columns: C,
    reached_count: usize,
    work: u32,
}

impl<R, C, const OFFERS: usize> Assignment<R, C, OFFERS>
where
    R: BorrowMut<[RowSlot<OFFERS>]>,
    C: BorrowMut<[ColumnSlot]>,
{
    /// A problem without rows.
    pub fn new(mut rows: R, columns: C) -> Self {
        rows.borrow_mut().fill(RowSlot::EMPTY);
        Self {
            rows,
            columns,
            reached_count: 0,
            work: 0,
        }
    }

    /// The problem that the memory holds already: to read choices.
    pub fn of(rows: R, columns: C) -> Self {
        Self {
            rows,
            columns,
            reached_count: 0,
            work: 0,
        }
    }

    /// Takes all rows out.
    pub fn clear(&mut self) {
        for row in self.rows.borrow_mut() {
            (row.is_active, row.choice, row.count) = (false, Choice::Idle, 0);
        }
    }

    /// Puts a row in; `cost` is that of no column. A row beyond the memory is ignored.
    pub fn add(&mut self, row: usize, cost: f32) {
        if let Some(slot) = self.rows.borrow_mut().get_mut(row) {
            (slot.is_active, slot.without, slot.count) = (true, cost, 0);
        }
    }

    /// Offers the row a column. Costs are finite; offers beyond `OFFERS`, and of columns beyond
    /// the memory, are ignored.
    pub fn offer(&mut self, row: usize, column: u16, cost: f32) {
        if usize::from(column) < self.columns.borrow().len()
            && let Some(slot) = self.rows.borrow_mut().get_mut(row)
            && let Some(offer) = slot.offers.get_mut(usize::from(slot.count))
        {
            *offer = Offer { column, cost };
            slot.count += 1;
        }
    }

    /// What [`Self::solve`] has found for a row.
    #[must_use]
    pub fn choice(&self, row: usize) -> Choice {
        let row = self.rows.borrow().get(row);
        row.map_or(Choice::Idle, |row| row.choice)
    }

    /// Finds the choices of least total cost and returns the inner steps that took, at most
    /// `limit` and one search more. Rows not reached within the limit stay [`Choice::Idle`]; the
    /// others are at their least cost without them.
    ///
    /// A search takes at most `(rows + 1) * (OFFERS + min(rows * OFFERS, columns))` steps, and
    /// there is at most one a row: only rows whose cheapest column is taken need one.
    pub fn solve(&mut self, limit: u32) -> u32 {
        self.work = 0;
        for column in self.columns.borrow_mut() {
            *column = ColumnSlot::EMPTY;
        }
        let rows = self.rows.borrow().len();
        // Every row that can have its cheapest option takes it; prices of zero support that.
        for index in 0..rows {
            let Some(row) = self.rows.borrow_mut().get_mut(index) else {
                continue;
            };
            if !row.is_active {
                continue;
            }
            row.choice = match row.reduce() {
                None => Choice::Without,
                Some((slot, column)) => {
                    let taken = self.columns.borrow_mut().get_mut(usize::from(column));
                    match taken {
                        Some(taken) if taken.owner == NONE => {
                            taken.owner = index as u16;
                            Choice::Column { slot, column }
                        }
                        _ => Choice::Idle,
                    }
                }
            };
        }
        for index in 0..rows {
            if self.work >= limit {
                break;
            }
            let row = self.rows.borrow().get(index);
            if row.is_some_and(|row| row.is_active && row.choice == Choice::Idle) {
                self.augment(index);
            }
        }
        self.work
    }

    fn row(&self, row: usize) -> RowSlot<OFFERS> {
        let row = self.rows.borrow().get(row);
        row.copied().unwrap_or(RowSlot::EMPTY)
    }

    fn column(&self, column: usize) -> ColumnSlot {
        let column = self.columns.borrow().get(column);
        column.copied().unwrap_or(ColumnSlot::EMPTY)
    }

    fn edit(&mut self, column: usize, change: impl FnOnce(&mut ColumnSlot)) {
        if let Some(column) = self.columns.borrow_mut().get_mut(column) {
            change(column);
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
        for _ in 0..=self.rows.borrow().len() {
            let slot = self.row(row);
            let without = base + slot.without - slot.price;
            if without < give_up.0 {
                give_up = (without, row);
            }
            self.scan(row, &slot, base);
            let mut nearest = (f32::MAX, NONE);
            for entry in 0..self.reached_count {
                let index = self.column(entry).reached;
                let column = self.column(usize::from(index));
                if column.distance < nearest.0 && !column.is_settled {
                    nearest = (column.distance, index);
                }
            }
            self.work += (OFFERS + self.reached_count) as u32;
            let (distance, column) = nearest;
            if column == NONE || distance >= give_up.0 {
                break;
            }
            base = distance;
            let owner = self.column(usize::from(column)).owner;
            if owner == NONE {
                end_column = Some(column);
                break;
            }
            self.edit(usize::from(column), |column| column.is_settled = true);
            row = usize::from(owner);
        }
        let end = if end_column.is_some() {
            base
        } else {
            give_up.0
        };
        self.raise_prices(start, end);
        self.exchange(start, end_column, give_up.1);
        for entry in 0..self.reached_count {
            let index = usize::from(self.column(entry).reached);
            self.edit(index, |column| {
                column.is_settled = false;
                column.is_reached = false;
            });
        }
    }

    /// Relaxes the offers of `row`, which the search has reached at `base`.
    fn scan(&mut self, row: usize, slot: &RowSlot<OFFERS>, base: f32) {
        for offer in slot.offers() {
            let index = usize::from(offer.column);
            let column = self.column(index);
            if column.is_settled {
                continue;
            }
            let distance = base + offer.cost - (slot.price + column.price);
            if !column.is_reached {
                let entry = self.reached_count;
                self.edit(entry, |column| column.reached = offer.column);
                self.reached_count += 1;
            }
            if !column.is_reached || distance < column.distance {
                self.edit(index, |column| {
                    column.is_reached = true;
                    column.distance = distance;
                    column.from = row as u16;
                });
            }
        }
    }

    /// Keeps every reduced cost non-negative after a search that ended at distance `end`.
    fn raise_prices(&mut self, start: usize, end: f32) {
        if let Some(row) = self.rows.borrow_mut().get_mut(start) {
            row.price += end;
        }
        for entry in 0..self.reached_count {
            let index = usize::from(self.column(entry).reached);
            let column = self.column(index);
            if column.is_settled {
                let slack = end - column.distance;
                self.edit(index, |column| column.price -= slack);
                if let Some(row) = self.rows.borrow_mut().get_mut(usize::from(column.owner)) {
                    row.price += slack;
                }
            }
        }
    }

    /// Walks back from the end of the path, handing columns on.
    fn exchange(&mut self, start: usize, end_column: Option<u16>, loser: usize) {
        let mut column = match end_column {
            Some(column) => column,
            None => {
                let freed = self.choice(loser);
                self.set_choice(loser, Choice::Without);
                match freed {
                    Choice::Column { column, .. } if loser != start => column,
                    _ => return,
                }
            }
        };
        for _ in 0..=self.rows.borrow().len() {
            let taker = usize::from(self.column(usize::from(column)).from);
            let slot = self.row(taker);
            let position = slot.offers().iter().position(|o| o.column == column);
            self.edit(usize::from(column), |column| column.owner = taker as u16);
            let chosen = Choice::Column {
                slot: position.unwrap_or_default(),
                column,
            };
            self.set_choice(taker, chosen);
            match slot.choice {
                Choice::Column { column: next, .. } if taker != start => column = next,
                _ => return,
            }
        }
    }

    fn set_choice(&mut self, row: usize, choice: Choice) {
        if let Some(row) = self.rows.borrow_mut().get_mut(row) {
            row.choice = choice;
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
        let mut problem = Assignment::new([RowSlot::<4>::EMPTY; 5], [ColumnSlot::EMPTY; 4]);
        for _ in 0..500 {
            let costs: [[Option<f32>; 4]; 5] = core::array::from_fn(|_| {
                core::array::from_fn(|_| (draw() < 0.7).then(|| 10.0 * draw()))
            });
            let missing = 6.0;
            problem.clear();
            for (i, row) in costs.iter().enumerate() {
                problem.add(i, missing);
                for (column, cost) in row.iter().enumerate() {
                    if let Some(cost) = *cost {
                        problem.offer(i, column as u16, cost);
                    }
                }
            }
            problem.solve(u32::MAX);
            let mut used = 0;
            let mut total = 0.0;
            for (i, row) in costs.iter().enumerate() {
                match problem.choice(i) {
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

    #[test]
    fn a_limit_leaves_rows_idle_and_the_rest_sound() {
        let mut problem = Assignment::new([RowSlot::<1>::EMPTY; 3], [ColumnSlot::EMPTY; 1]);
        for row in 0..3 {
            problem.add(row, 5.0);
            problem.offer(row, 0, 1.0);
        }
        problem.solve(0);
        assert_eq!(problem.choice(0), Choice::Column { slot: 0, column: 0 });
        assert_eq!(problem.choice(1), Choice::Idle);
    }
}
