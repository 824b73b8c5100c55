//! Packed shapes and tangents.

use super::numbers;
use crate::asset::{Asset, AssetError, LANES, LARGEST, SectionKind};

pub(super) fn check(asset: &Asset<'_>) -> Result<(), AssetError> {
    let packed = &asset.shapes;
    let section = SectionKind::PackedBoxes;
    let corners = packed.boxes.as_flattened().iter().copied();
    numbers(section, corners, LARGEST)?;
    for (block, &[ox, oy, oz, sx, sy, sz]) in packed.boxes.iter().enumerate() {
        for (axis, (origin, step)) in [(ox, sx), (oy, sy), (oz, sz)].into_iter().enumerate() {
            let far = origin + step * f32::from(u16::MAX);
            if step < 0.0 || !(-LARGEST..=LARGEST).contains(&far) {
                let at = 6 * block + 3 + axis;
                return Err(AssetError::Number { section, at });
            }
        }
    }
    directions(SectionKind::PackedNormals, packed.normals)?;
    directions(SectionKind::Tangents, packed.tangents)
}

/// The most negative number has no opposite.
fn directions(section: SectionKind, blocks: &[[[i16; LANES]; 2]]) -> Result<(), AssetError> {
    let numbers = blocks.as_flattened().as_flattened();
    match numbers.iter().position(|&number| number == i16::MIN) {
        Some(at) => Err(AssetError::Number { section, at }),
        None => Ok(()),
    }
}
