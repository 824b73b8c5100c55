//! What a factor must fulfil before it is used.

use core::fmt;

use super::{FactorParts, PADDING, triangle_quads};

/// Arrays that are not a usable factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum FactorError {
    /// More rows than an index holds.
    Size {
        /// Rows.
        size: usize,
    },
    /// Columns do not ascend from 0 to the size.
    Columns {
        /// The supernode at fault.
        supernode: usize,
    },
    /// Panels do not ascend from 0 to their number, or there is not one entry a supernode.
    Panels {
        /// The supernode at fault.
        supernode: usize,
    },
    /// A row that does not exist, or is not below the one before it.
    Row {
        /// The panel.
        panel: usize,
        /// The row.
        row: u32,
    },
    /// The number of quads contradicts the supernodes.
    Values {
        /// Quads needed.
        needed: usize,
        /// Quads given.
        found: usize,
    },
    /// A number that is not finite.
    Number {
        /// The quad.
        quad: usize,
    },
}

impl fmt::Display for FactorError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Size { size } => write!(f, "{size} rows are more than the factor can index"),
            Self::Columns { supernode } => {
                write!(f, "columns of supernode {supernode} are not in order")
            }
            Self::Panels { supernode } => {
                write!(f, "panels of supernode {supernode} are not in order")
            }
            Self::Row { panel, row } => write!(f, "row {row} does not belong into panel {panel}"),
            Self::Values { needed, found } => {
                write!(f, "{found} quads, where the supernodes need {needed}")
            }
            Self::Number { quad } => write!(f, "quad {quad} is not finite"),
        }?;
        write!(f, "; factor the matrix again")
    }
}

impl core::error::Error for FactorError {}

pub(super) fn check(parts: &FactorParts<'_>) -> Result<(), FactorError> {
    let size = parts.size;
    // Rows of padding must lie beyond every slice.
    let Some(size_u32) = u32::try_from(size).ok().filter(|&size| size < PADDING / 2) else {
        return Err(FactorError::Size { size });
    };
    let supernodes = parts.columns.len().saturating_sub(1);
    if parts.columns.first() != Some(&0) || parts.columns.last() != Some(&size_u32) {
        return Err(FactorError::Columns { supernode: 0 });
    }
    let panel_count = u32::try_from(parts.rows.len()).ok();
    if parts.panels.len() != parts.columns.len()
        || parts.panels.first() != Some(&0)
        || parts.panels.last().copied() != panel_count
    {
        return Err(FactorError::Panels {
            supernode: supernodes,
        });
    }
    let mut needed = 0_usize;
    for (supernode, (columns, panels)) in parts
        .columns
        .windows(2)
        .zip(parts.panels.windows(2))
        .enumerate()
    {
        let (&[first, end], &[panel, panel_end]) = (columns, panels) else {
            continue;
        };
        if end <= first || end > size_u32 {
            return Err(FactorError::Columns { supernode });
        }
        let Some(rows) = parts.rows.get(panel as usize..panel_end as usize) else {
            return Err(FactorError::Panels { supernode });
        };
        check_rows(rows, panel as usize, end, size_u32)?;
        let width = (end - first) as usize;
        let panel_quads = width.saturating_mul(rows.len());
        // A width below 2^31 may still overflow where an address has 32 bits.
        let groups = width.div_ceil(4);
        if groups > 1 << 14 {
            return Err(FactorError::Columns { supernode });
        }
        needed = needed
            .saturating_add(triangle_quads(width))
            .saturating_add(panel_quads);
    }
    let found = parts.values.len();
    if needed != found {
        return Err(FactorError::Values { needed, found });
    }
    match parts
        .values
        .iter()
        .position(|quad| !quad.iter().all(|x| x.is_finite()))
    {
        Some(quad) => Err(FactorError::Number { quad }),
        None => Ok(()),
    }
}

/// Ascending rows in `end..size`, then padding in the last panel only.
fn check_rows(rows: &[[u32; 4]], panel: usize, end: u32, size: u32) -> Result<(), FactorError> {
    let mut next = end;
    for (at, panel_rows) in rows.iter().enumerate() {
        let last = at + 1 == rows.len();
        for (place, &row) in panel_rows.iter().enumerate() {
            if row == PADDING && last && place > 0 {
                next = PADDING;
            } else if row < next || row >= size {
                let panel = panel + at;
                return Err(FactorError::Row { panel, row });
            } else {
                next = row + 1;
            }
        }
    }
    Ok(())
}
