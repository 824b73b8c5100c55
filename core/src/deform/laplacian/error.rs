//! Why tables of a Laplacian deformer are refused.

use core::fmt;

use crate::deform::tables::{self, Fault};
use crate::solve::sparse::FactorError;

/// A table of a Laplacian deformer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Table {
    /// Vertex of each row.
    Order,
    /// Rest positions.
    Rest,
    /// Rest normals.
    Normals,
    /// Differential coordinates.
    Differential,
    /// First neighbour, first marker or first slot of each row.
    Starts,
    /// Neighbours of each row.
    Neighbours,
    /// Weights of neighbours, markers or slots.
    Weights,
    /// Rows of markers.
    Markers,
    /// Pairs of markers.
    Edges,
    /// Markers and weights that guess a row's position.
    Guide,
    /// Markers that move virtual handles.
    VirtualHandles,
    /// Handles that move a block.
    Slots,
    /// Factor of the harmonic system.
    Harmonic,
    /// Factor of the bi-Laplacian system.
    Bilaplacian,
}

/// Tables that are not a usable deformer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LaplacianError {
    /// A table whose length contradicts the others.
    Length {
        /// Which.
        table: Table,
        /// Entries needed.
        needed: usize,
        /// Entries given.
        found: usize,
    },
    /// An index that points at nothing, twice at the same, or is out of order.
    Index {
        /// Which table.
        table: Table,
        /// Which entry of it.
        at: usize,
    },
    /// A number that is not finite, or a mass or stiffness that is not positive.
    Number {
        /// Which table.
        table: Table,
        /// Which entry of it.
        at: usize,
    },
    /// A factor that is not sound.
    Factor {
        /// Which.
        table: Table,
        /// What is wrong with it.
        error: FactorError,
    },
}

impl fmt::Display for LaplacianError {
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
            Self::Factor { table, error } => return write!(f, "{table:?}: {error}"),
        }?;
        write!(f, "; bake it again with a current `sinew`")
    }
}

impl core::error::Error for LaplacianError {}

/// The fault of a table with the table's name.
fn named(table: Table) -> impl Fn(Fault) -> LaplacianError {
    move |fault| match fault {
        Fault::Length { needed, found } => LaplacianError::Length {
            table,
            needed,
            found,
        },
        Fault::Index { at } => LaplacianError::Index { table, at },
        Fault::Number { at } => LaplacianError::Number { table, at },
    }
}

/// Checks that a table has `needed` entries.
pub(super) fn length(table: Table, found: usize, needed: usize) -> Result<(), LaplacianError> {
    tables::length(found, needed).map_err(named(table))
}

/// Checks `[rows + 1]` starts that ascend from 0 to `total`.
pub(super) fn starts(starts: &[u32], rows: usize, total: usize) -> Result<(), LaplacianError> {
    tables::starts(starts, rows, total).map_err(named(Table::Starts))
}

/// Checks that all numbers are finite and of a size that cannot overflow in sums.
pub(super) fn numbers(table: Table, numbers: &[f32]) -> Result<(), LaplacianError> {
    tables::numbers(numbers, 1e12).map_err(named(table))
}

/// Checks that all indices are below `limit`.
pub(super) fn below(
    table: Table,
    indices: impl Iterator<Item = usize>,
    limit: usize,
) -> Result<(), LaplacianError> {
    tables::below(indices, limit).map_err(named(table))
}
