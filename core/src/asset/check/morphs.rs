//! Morph targets and their rows.

use super::{below, name, numbers};
use crate::asset::{Asset, AssetError, LARGEST, LARGEST_WEIGHT, Lanes3, SectionKind};

pub(super) fn check(asset: &Asset<'_>) -> Result<(), AssetError> {
    for (row, &[offset, length, weight, zero]) in asset.morphs.iter().enumerate() {
        let section = SectionKind::Morphs;
        name(asset, section, row, (offset, length))?;
        numbers(section, [f32::from_bits(weight)], LARGEST_WEIGHT)?;
        if zero != 0 {
            return Err(AssetError::Number { section, at: row });
        }
    }
    let rows = asset.dims.morph_row_count;
    let mut before = 0;
    for (block, &start) in asset.morph_starts.iter().enumerate() {
        let start = start as usize;
        let sound = match block {
            0 => start == 0,
            _ if block == asset.dims.block_count => start == rows && start >= before,
            _ => start >= before && start <= rows,
        };
        if !sound {
            return Err(AssetError::Index {
                section: SectionKind::MorphStarts,
                row: block,
                value: start,
                limit: rows,
            });
        }
        before = start;
    }
    for (row, &morph) in asset.morph_ids.iter().enumerate() {
        let morph = usize::from(morph);
        below(SectionKind::MorphIds, row, morph, asset.dims.morph_count)?;
    }
    let flat = |rows: &'_ [Lanes3], section, largest| {
        let all = rows.as_flattened().as_flattened();
        numbers(section, all.iter().copied(), largest)
    };
    flat(asset.morph_offsets, SectionKind::MorphOffsets, LARGEST)?;
    flat(asset.morph_normals, SectionKind::MorphNormals, 4.0)
}
