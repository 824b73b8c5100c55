//! Boxes at rest.

use super::{below, numbers};
use crate::asset::{Asset, AssetError, LARGEST, SectionKind};

pub(super) fn check(asset: &Asset<'_>) -> Result<(), AssetError> {
    let bounds = &asset.rest_bounds;
    for (section, boxes) in [
        (SectionKind::BindBoxes, bounds.boxes),
        (SectionKind::PairBoxes, bounds.pair_boxes),
    ] {
        numbers(section, boxes.as_flattened().iter().copied(), LARGEST)?;
    }
    for (row, pair) in bounds.pairs.iter().enumerate() {
        for &bind in pair {
            let (bind, limit) = (usize::from(bind), asset.dims.bind_count);
            below(SectionKind::BindPairs, row, bind, limit)?;
        }
    }
    Ok(())
}
