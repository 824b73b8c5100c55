//! Why tables of a marker-driven skin are refused, and the checks that find out.

use core::fmt;

use crate::deform::tables::{self, Fault};

/// A table of a marker-driven skin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum PartsTable {
    /// Rest positions of markers.
    Markers,
    /// Parents of parts.
    Parents,
    /// First member, slot or share of each row.
    Starts,
    /// Markers that fix the frames of parts.
    Members,
    /// Parts that carry markers.
    Carriers,
    /// Vertex of each lane.
    Order,
    /// Rest positions and normals of blocks.
    Rest,
    /// Parts that move a block.
    PartSlots,
    /// Markers that move a block.
    MarkerSlots,
    /// Frames, pseudo-inverses and supports of parts.
    Modes,
}

/// Tables that are not a usable skin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum PartsError {
    /// A table whose length contradicts the others.
    Length {
        /// Which.
        table: PartsTable,
        /// Entries needed.
        needed: usize,
        /// Entries given.
        found: usize,
    },
    /// An index that points at nothing, twice at the same, or is out of order.
    Index {
        /// Which table.
        table: PartsTable,
        /// Which entry of it.
        at: usize,
    },
    /// A number that is not finite, out of range, or a set of weights that does not sum to one.
    Number {
        /// Which table.
        table: PartsTable,
        /// Which entry of it.
        at: usize,
    },
}

impl fmt::Display for PartsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length {
                table,
                needed,
                found,
            } => write!(f, "{table:?} has {found} entries and needs {needed}"),
            Self::Index { table, at } => {
                write!(f, "{table:?} {at} points at nothing or is out of order")
            }
            Self::Number { table, at } => write!(f, "{table:?} {at} is not a usable number"),
        }?;
        write!(f, "; bake it again with a current `sinew`")
    }
}

impl core::error::Error for PartsError {}

/// The fault of a table with the table's name.
fn named(table: PartsTable) -> impl Fn(Fault) -> PartsError {
    move |fault| match fault {
        Fault::Length { needed, found } => PartsError::Length {
            table,
            needed,
            found,
        },
        Fault::Index { at } => PartsError::Index { table, at },
        Fault::Number { at } => PartsError::Number { table, at },
    }
}

/// Checks that a table has `needed` entries.
pub(super) fn length(table: PartsTable, found: usize, needed: usize) -> Result<(), PartsError> {
    tables::length(found, needed).map_err(named(table))
}

/// Checks `[rows + 1]` starts that ascend from 0 to `total`.
pub(super) fn starts(starts: &[u32], rows: usize, total: usize) -> Result<(), PartsError> {
    tables::starts(starts, rows, total).map_err(named(PartsTable::Starts))
}

/// Checks that all numbers are at most `limit` in magnitude.
pub(super) fn numbers(table: PartsTable, numbers: &[f32], limit: f32) -> Result<(), PartsError> {
    tables::numbers(numbers, limit).map_err(named(table))
}

/// Checks that all indices are below `limit`.
pub(super) fn below(
    table: PartsTable,
    indices: impl Iterator<Item = usize>,
    limit: usize,
) -> Result<(), PartsError> {
    tables::below(indices, limit).map_err(named(table))
}
