//! Vertices, triangles and named ranges of them.

use super::{below, name, numbers};
use crate::asset::{Asset, AssetError, LARGEST, Lanes3, SectionKind};

pub(super) fn check(asset: &Asset<'_>) -> Result<(), AssetError> {
    let flat = |values: &'_ [Lanes3], section, largest| {
        numbers(
            section,
            values.as_flattened().as_flattened().iter().copied(),
            largest,
        )
    };
    flat(asset.positions, SectionKind::Positions, LARGEST)?;
    flat(asset.normals, SectionKind::Normals, 1.001)?;
    flat(asset.centres, SectionKind::Centres, LARGEST)?;
    let vertices = asset.dims.vertex_count;
    for (vertex, &source) in asset.order.iter().enumerate() {
        below(SectionKind::Order, vertex, source as usize, vertices)?;
    }
    for (triangle, corners) in asset.triangles.iter().enumerate() {
        for corner in corners {
            below(SectionKind::Triangles, triangle, corner as usize, vertices)?;
        }
    }
    let mut end = 0;
    for (row, &[offset, length, first, count]) in asset.parts.iter().enumerate() {
        name(asset, SectionKind::Parts, row, (offset, length))?;
        if first as usize != end {
            return Err(AssetError::Index {
                section: SectionKind::Parts,
                row,
                value: first as usize,
                limit: end,
            });
        }
        end = end.saturating_add(count as usize);
    }
    if !asset.parts.is_empty() && end != asset.triangles.len() {
        let limit = asset.triangles.len();
        return Err(AssetError::Index {
            section: SectionKind::Parts,
            row: asset.parts.len(),
            value: end,
            limit,
        });
    }
    Ok(())
}
