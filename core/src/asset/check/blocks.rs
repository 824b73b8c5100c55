//! Blocks of eight vertices: runs, slots and weight sums.

use super::below;
use crate::asset::{Asset, AssetError, LANES, SectionKind, WEIGHT_ONE};

pub(super) fn check(asset: &Asset<'_>) -> Result<(), AssetError> {
    let (mut rigid, mut block, mut slot) = (0, 0, 0);
    for (row, &[first, count, slots, first_slot]) in asset.runs.iter().enumerate() {
        let index = |value: u32, limit| {
            Err(AssetError::Index {
                section: SectionKind::Runs,
                row,
                value: value as usize,
                limit,
            })
        };
        let (first, first_slot) = (first as usize, first_slot as usize);
        if first != block || first_slot != slot {
            return index(first as u32, block);
        }
        let (count, slots) = (count as usize, slots as usize);
        if count == 0 || slots == 0 {
            return index(0, 1);
        }
        rigid += if slots == 1 { count } else { 0 };
        block = block.saturating_add(count);
        slot = slot.saturating_add(count.saturating_mul(slots));
    }
    if block != asset.dims.block_count || slot != asset.dims.slot_count {
        let (value, limit) = if block == asset.dims.block_count {
            (slot, asset.dims.slot_count)
        } else {
            (block, asset.dims.block_count)
        };
        return Err(AssetError::Index {
            section: SectionKind::Runs,
            row: asset.dims.run_count,
            value,
            limit,
        });
    }
    if rigid != asset.dims.rigid_block_count {
        return Err(AssetError::Counts {
            index: 5,
            value: asset.dims.rigid_block_count,
        });
    }
    let blended = asset.dims.block_count.saturating_sub(rigid);
    if asset.dims.centre_block_count != 0 && asset.dims.centre_block_count != blended {
        return Err(AssetError::Counts {
            index: 17,
            value: asset.dims.centre_block_count,
        });
    }
    for (slot, &bind) in asset.slot_binds.iter().enumerate() {
        below(
            SectionKind::SlotBinds,
            slot,
            usize::from(bind),
            asset.dims.bind_count,
        )?;
    }
    for block in 0..asset.dims.block_count {
        let mut sums = [0_u32; LANES];
        for (_, weights) in asset.slots(block) {
            for (sum, &weight) in sums.iter_mut().zip(weights) {
                *sum = sum.saturating_add(u32::from(weight));
            }
        }
        let wrong = sums.iter().position(|&sum| sum != u32::from(WEIGHT_ONE));
        if let Some(lane) = wrong {
            let sum = sums.get(lane).copied().unwrap_or(0);
            return Err(AssetError::Weights { block, lane, sum });
        }
    }
    Ok(())
}
