//! Coarser levels: whole assets that fit the one they are in.

use super::below;
use crate::asset::{ALIGNMENT, Asset, AssetError, CorrectiveDims, SectionKind};

/// The table; the levels themselves are checked as assets, then by [`fits`].
pub(super) fn table(asset: &Asset<'_>) -> Result<(), AssetError> {
    let (mut end, mut vertices) = (0, asset.dims.vertex_count);
    for (row, &[offset, length, count, _]) in asset.levels.table.iter().enumerate() {
        let fault = |value: u32, limit| AssetError::Index {
            section: SectionKind::Levels,
            row,
            value: value as usize,
            limit,
        };
        if offset as usize != end || !end.is_multiple_of(ALIGNMENT) {
            return Err(fault(offset, end));
        }
        end = end.saturating_add(length as usize);
        if end > asset.levels.data.len() {
            return Err(fault(length, asset.levels.data.len()));
        }
        // Each coarser than the one before.
        if count as usize >= vertices {
            return Err(fault(count, vertices));
        }
        vertices = count as usize;
    }
    if end != asset.levels.data.len() {
        return Err(AssetError::Counts {
            index: 26,
            value: asset.levels.data.len(),
        });
    }
    Ok(())
}

/// A level hangs on the same skeleton, has the same morph targets and names, and nothing of its
/// own besides a mesh.
pub(super) fn fits(asset: &Asset<'_>, level: &Asset<'_>, row: usize) -> Result<(), AssetError> {
    let same = asset.parents == level.parents
        && asset.rest == level.rest
        && asset.bind_joints == level.bind_joints
        && asset.inverse_bind == level.inverse_bind
        && asset.bind_rotations == level.bind_rotations
        && asset.joint_names == level.joint_names
        && asset.names == level.names
        && asset.morphs == level.morphs;
    let (dims, section) = (level.dims, SectionKind::Levels);
    let [_, _, vertices, blocks] = asset.levels.table.get(row).copied().unwrap_or_default();
    let counted = dims.vertex_count == vertices as usize && dims.block_count == blocks as usize;
    let bare = dims.level.count == 0
        && dims.clip_count == 0
        && dims.packed.track_count == 0
        && dims.correctives == CorrectiveDims::default();
    if !(same && counted && bare && dims.level.source_count == dims.vertex_count) {
        return Err(AssetError::Level { row });
    }
    for (vertex, &source) in level.levels.sources.iter().enumerate() {
        below(section, vertex, source as usize, asset.dims.vertex_count)?;
    }
    Ok(())
}
