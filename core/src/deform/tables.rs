//! Checks that the tables of all deformers need; each deformer names the table in its own error.

/// What is wrong with a table.
pub(super) enum Fault {
    /// Another number of entries.
    Length {
        /// Entries it should have.
        needed: usize,
        /// Entries it has.
        found: usize,
    },
    /// An entry points at nothing, or is out of order.
    Index {
        /// Which.
        at: usize,
    },
    /// An entry is no usable number.
    Number {
        /// Which.
        at: usize,
    },
}

/// Checks that a table has `needed` entries.
pub(super) fn length(found: usize, needed: usize) -> Result<(), Fault> {
    if found == needed {
        Ok(())
    } else {
        Err(Fault::Length { needed, found })
    }
}

/// Checks `[rows + 1]` starts that ascend from 0 to `total`.
pub(super) fn starts(starts: &[u32], rows: usize, total: usize) -> Result<(), Fault> {
    length(starts.len(), rows.saturating_add(1))?;
    if starts.first() != Some(&0) {
        return Err(Fault::Index { at: 0 });
    }
    if starts.last().map(|&end| end as usize) != Some(total) {
        return Err(Fault::Index { at: rows });
    }
    let descends = |pair: &[u32]| matches!(pair, [a, b] if a > b);
    match starts.windows(2).position(descends) {
        Some(at) => Err(Fault::Index { at }),
        None => Ok(()),
    }
}

/// Checks that all numbers are at most `limit` in magnitude.
pub(super) fn numbers(numbers: &[f32], limit: f32) -> Result<(), Fault> {
    match numbers.iter().position(|x| !(-limit..=limit).contains(x)) {
        Some(at) => Err(Fault::Number { at }),
        None => Ok(()),
    }
}

/// Checks that all indices are below `limit`.
pub(super) fn below(mut indices: impl Iterator<Item = usize>, limit: usize) -> Result<(), Fault> {
    match indices.position(|index| index >= limit) {
        Some(at) => Err(Fault::Index { at }),
        None => Ok(()),
    }
}
