//! Tables that lead from markers to part frames, and what they must fulfil.

use super::error::{below, length, numbers, starts};
use super::slots::row;
use super::{PartsError, PartsTable};
use crate::asset::NO_PARENT;

/// Positions beyond this are damage, metres.
pub(super) const FAR: f32 = 1e6;

/// Tables that lead from markers to part frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct MarkerRigTables<'a> {
    /// `[markers]`: rest position, metres.
    pub rest: &'a [[f32; 3]],
    /// `[parts]`: parent, before the part itself, or [`NO_PARENT`].
    pub parents: &'a [u16],
    /// `[parts]`: the joint that holds a part to its parent, in the rest pose, metres; then how much
    /// it counts. It lets one or two markers turn a hand.
    pub pivots: &'a [[f32; 4]],
    /// `[parts + 1]`: first member of each part.
    pub member_starts: &'a [u32],
    /// Markers that fix a part's frame.
    pub member_markers: &'a [u16],
    /// How much each counts; at most 1.
    pub member_weights: &'a [f32],
    /// `[markers + 1]`: first carrier of each marker.
    pub carrier_starts: &'a [u32],
    /// Parts that carry a marker; at least one each.
    pub carrier_parts: &'a [u16],
    /// Their weights, which sum to one.
    pub carrier_weights: &'a [f32],
    /// Longest residual, metres; longer ones are shortened to it.
    pub residual_limit: f32,
}

/// The first fault, with its place. O(tables)
pub(super) fn check(tables: &MarkerRigTables<'_>) -> Result<(), PartsError> {
    let (markers, parts) = (tables.rest.len(), tables.parents.len());
    for (table, found) in [(PartsTable::Markers, markers), (PartsTable::Parents, parts)] {
        if !(1..=usize::from(u16::MAX)).contains(&found) {
            let needed = 1;
            return Err(PartsError::Length {
                table,
                needed,
                found,
            });
        }
    }
    for (at, &parent) in tables.parents.iter().enumerate() {
        if parent != NO_PARENT && usize::from(parent) >= at {
            let table = PartsTable::Parents;
            return Err(PartsError::Index { table, at });
        }
    }
    numbers(PartsTable::Markers, tables.rest.as_flattened(), FAR)?;
    length(PartsTable::Parents, tables.pivots.len(), parts)?;
    numbers(PartsTable::Parents, tables.pivots.as_flattened(), FAR)?;
    if let Some(at) = tables.pivots.iter().position(|pivot| pivot[3] < 0.0) {
        let table = PartsTable::Parents;
        return Err(PartsError::Number { table, at });
    }
    let wide = |&at: &u16| usize::from(at);
    let count = tables.member_markers.len();
    length(PartsTable::Members, tables.member_weights.len(), count)?;
    starts(tables.member_starts, parts, count)?;
    below(
        PartsTable::Members,
        tables.member_markers.iter().map(wide),
        markers,
    )?;
    share(PartsTable::Members, tables.member_weights)?;
    let count = tables.carrier_parts.len();
    length(PartsTable::Carriers, tables.carrier_weights.len(), count)?;
    starts(tables.carrier_starts, markers, count)?;
    below(
        PartsTable::Carriers,
        tables.carrier_parts.iter().map(wide),
        parts,
    )?;
    share(PartsTable::Carriers, tables.carrier_weights)?;
    for at in 0..markers {
        let weights = tables.carrier_weights.get(row(tables.carrier_starts, at));
        let sum: f32 = weights.unwrap_or_default().iter().sum();
        if !(0.999..=1.001).contains(&sum) {
            let table = PartsTable::Carriers;
            return Err(PartsError::Number { table, at });
        }
    }
    if !(0.0..=FAR).contains(&tables.residual_limit) {
        let table = PartsTable::Markers;
        return Err(PartsError::Number { table, at: markers });
    }
    Ok(())
}

/// Checks weights between 0 and 1.
fn share(table: PartsTable, weights: &[f32]) -> Result<(), PartsError> {
    match weights.iter().position(|x| !(0.0..=1.0).contains(x)) {
        Some(at) => Err(PartsError::Number { table, at }),
        None => Ok(()),
    }
}
