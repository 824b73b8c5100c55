//! What the tables of a collapsed deformer must fulfil.

use super::collapsed::CollapsedParts;
use super::error::{below, length, numbers, starts};
use super::{LaplacianError, Table};
use crate::asset::LANES;

pub(super) fn check(parts: &CollapsedParts<'_>) -> Result<(), LaplacianError> {
    let markers = parts.marker_rest.len();
    let virtual_count = parts.virtual_starts.len().saturating_sub(1);
    let handles = markers.saturating_add(virtual_count);
    if markers == 0 || handles > usize::from(u16::MAX) {
        return Err(LaplacianError::Length {
            table: Table::Markers,
            needed: 1,
            found: handles,
        });
    }
    let entries = parts.virtual_markers.len();
    length(Table::VirtualHandles, parts.virtual_turns.len(), entries)?;
    let coefficients = parts.virtual_coefficients;
    length(Table::VirtualHandles, coefficients.len(), entries)?;
    starts(parts.virtual_starts, virtual_count, entries)?;
    let blocks = parts.order.len().div_ceil(LANES);
    let slots = parts.slot_handles.len();
    length(Table::Slots, parts.slot_coefficients.len(), slots)?;
    starts(parts.block_starts, blocks, slots)?;
    if !parts.rest_normals.is_empty() {
        length(Table::Normals, parts.rest_normals.len(), blocks)?;
    }
    let wide = |&at: &u16| usize::from(at);
    let edges = parts.marker_edges.as_flattened().iter();
    below(Table::Edges, edges.map(wide), markers)?;
    let of_virtual = parts.virtual_markers.iter();
    below(Table::VirtualHandles, of_virtual.map(wide), markers)?;
    below(Table::Slots, parts.slot_handles.iter().map(wide), handles)?;
    let vertices = parts.order.iter().map(|&vertex| vertex as usize);
    below(Table::Order, vertices, parts.order.len())?;
    numbers(Table::Rest, parts.marker_rest.as_flattened())?;
    numbers(Table::VirtualHandles, parts.virtual_turns)?;
    numbers(Table::VirtualHandles, coefficients.as_flattened())?;
    let slots = parts.slot_coefficients.as_flattened();
    numbers(Table::Weights, slots.as_flattened())?;
    let normals = parts.rest_normals.as_flattened();
    numbers(Table::Normals, normals.as_flattened())
}
