//! Whose turn it is when a budget does not reach all blocks.

use core::ops::Range;

use super::Budget;

/// Blocks of one frame, in the order in which they are done; some may be empty.
pub type Due = [Range<usize>; 5];

/// Blocks take turns: each frame goes on where the last one stopped, after those that the caller
/// wants first. What [`Avatar`](super::Avatar) does by itself, for streams that a caller drives.
///
/// ```
/// use sinew_core::frame::{Budget, Rota};
/// let mut rota = Rota::new();
/// let budget = Budget::blocks(3).with_urgent(4..5);
/// let mut blocks = || rota.due(7, &budget).into_iter().flatten().collect::<Vec<_>>();
/// assert_eq!([blocks(), blocks(), blocks()], [[4, 0, 1], [4, 2, 3], [4, 5, 6]]);
/// assert_eq!(budget.frames_to_all(7), 3);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rota {
    /// Counted among the blocks that are not urgent.
    next: usize,
}

impl Rota {
    /// Starts with the first block.
    #[must_use]
    pub const fn new() -> Self {
        Self { next: 0 }
    }

    /// The blocks of this frame: no block twice, and as many of `blocks` as the budget allows.
    pub fn due(&mut self, blocks: usize, budget: &Budget) -> Due {
        let urgent = budget.urgent_of(blocks);
        let others = blocks - urgent.len();
        let count = budget.blocks.min(blocks) - urgent.len();
        let start = if count < others && self.next < others {
            self.next
        } else {
            0
        };
        let end = start + count;
        let wrapped = end.saturating_sub(others);
        let end = end.min(others);
        self.next = match (wrapped, end < others) {
            (0, true) => end,
            (wrapped, _) => wrapped,
        };
        let below = |part: &Range<usize>| part.start..part.end.min(urgent.start);
        let above = |part: &Range<usize>| {
            part.start.max(urgent.start) + urgent.len()..part.end + urgent.len()
        };
        let (now, then) = (start..end, 0..wrapped);
        [
            urgent.clone(),
            below(&now),
            above(&now),
            below(&then),
            above(&then),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everyone_is_served_within_the_frames_stated() {
        for blocks in 1..12 {
            for (start, end) in [(0, 0), (0, 2), (3, 5), (4, 40), (9, 9)] {
                for limit in [1, 2, 3, 7, usize::MAX] {
                    let budget = Budget::blocks(limit).with_urgent(start..end);
                    let mut rota = Rota::new();
                    let mut ages = [0; 12];
                    for _ in 0..40 {
                        ages.iter_mut().for_each(|age| *age += 1);
                        let mut done = 0;
                        for block in rota.due(blocks, &budget).into_iter().flatten() {
                            assert!(block < blocks && ages[block] > 0, "{block} twice");
                            ages[block] = 0;
                            done += 1;
                        }
                        assert_eq!(done, limit.min(blocks));
                        let most = budget.frames_to_all(blocks);
                        assert!(ages[..blocks].iter().all(|&age| age < most), "{budget:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn no_budget_no_turn() {
        let due = Rota::new().due(5, &Budget::blocks(0).with_urgent(1..3));
        assert_eq!(due.into_iter().flatten().count(), 0);
    }
}
