//! What the tables of an exact deformer must fulfil.

use super::error::{below, length, numbers, starts};
use super::exact::ExactParts;
use super::{LaplacianError, Table};
use crate::asset::LANES;
use crate::solve::sparse::{Factor, FactorParts};

/// The checked factors.
pub(super) fn check<'a>(
    parts: &ExactParts<'a>,
) -> Result<(Factor<'a>, Factor<'a>), LaplacianError> {
    let (rows, vertices) = (parts.rest.len(), parts.order.len());
    length(Table::Order, parts.lane_rows.len(), vertices)?;
    if !parts.rest_normals.is_empty() {
        let blocks = vertices.div_ceil(LANES);
        length(Table::Normals, parts.rest_normals.len(), blocks)?;
        let normals = parts.rest_normals.as_flattened().as_flattened();
        numbers(Table::Normals, normals)?;
    }
    length(Table::Differential, parts.differential.len(), rows)?;
    length(Table::Guide, parts.guide_markers.len(), rows)?;
    length(Table::Guide, parts.guide_weights.len(), rows)?;
    length(Table::Weights, parts.weights.len(), parts.neighbours.len())?;
    starts(parts.starts, rows, parts.neighbours.len())?;
    let markers = parts.marker_rows.len();
    let index = |&index: &u32| index as usize;
    below(Table::Order, parts.order.iter().map(index), vertices)?;
    below(Table::Order, parts.lane_rows.iter().map(index), rows)?;
    below(Table::Neighbours, parts.neighbours.iter().map(index), rows)?;
    below(Table::Markers, parts.marker_rows.iter().map(index), rows)?;
    if markers == 0 || markers > usize::from(u16::MAX) {
        return Err(LaplacianError::Length {
            table: Table::Markers,
            needed: 1,
            found: markers,
        });
    }
    let edges = parts.marker_edges.as_flattened().iter();
    below(Table::Edges, edges.map(|&at| usize::from(at)), markers)?;
    let guides = parts.guide_markers.as_flattened().iter();
    below(Table::Guide, guides.map(|&at| usize::from(at)), markers)?;
    numbers(Table::Rest, parts.rest.as_flattened())?;
    numbers(Table::Differential, parts.differential.as_flattened())?;
    numbers(Table::Weights, parts.weights)?;
    numbers(Table::Guide, parts.guide_weights.as_flattened())?;
    numbers(Table::Markers, &[parts.stiffness])?;
    if let Some(at) = parts
        .rest
        .iter()
        .position(|&[_, _, _, inverse]| inverse <= 0.0)
    {
        let table = Table::Rest;
        return Err(LaplacianError::Number { table, at });
    }
    if parts.stiffness <= 0.0 {
        let table = Table::Markers;
        return Err(LaplacianError::Number { table, at: 0 });
    }
    Ok((
        factor(Table::Harmonic, parts.harmonic, rows)?,
        factor(Table::Bilaplacian, parts.bilaplacian, rows)?,
    ))
}

fn factor(table: Table, parts: FactorParts<'_>, rows: usize) -> Result<Factor<'_>, LaplacianError> {
    length(table, parts.size, rows)?;
    Factor::new_checked(parts).map_err(|error| LaplacianError::Factor { table, error })
}
