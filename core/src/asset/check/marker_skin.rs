//! The skin that markers drive. Its tables prove themselves, as they do without an asset.

use super::name;
use crate::asset::marker_skin::{
    COLLAPSED, EXACT, HYBRID, LINEAR_HYBRID, MARKER_SKIN_WORDS, MarkerSkinSections,
};
use crate::asset::sections::Sections;
use crate::asset::{Asset, AssetError, MarkerSkin, SectionKind as K};
use crate::deform::parts::{ExactTables, MarkerRigTables, MarkerRows, MarkerSlots, PartBlocks};

pub(super) fn check<'a>(
    asset: &Asset<'a>,
    sections: &Sections<'a>,
) -> Result<Option<MarkerSkin<'a>>, AssetError> {
    let dims = &asset.dims.marker_skin;
    let words = dims.words();
    let fault = |at: usize| {
        let value = words.get(at).copied().unwrap_or(0);
        let index = MARKER_SKIN_WORDS.get(at).copied().unwrap_or(0);
        Err(AssetError::Counts { index, value })
    };
    if dims.marker_count == 0 {
        // Nothing else may stand there then.
        return match words.iter().position(|&word| word != 0) {
            Some(at) => fault(at),
            None => Ok(None),
        };
    }
    if dims.part_count == 0 {
        return fault(1);
    }
    if !matches!(dims.mode, EXACT | COLLAPSED | HYBRID | LINEAR_HYBRID) {
        return fault(4);
    }
    if dims.mode == COLLAPSED && dims.part_slot_count != 0 {
        return fault(5);
    }
    if dims.mode == EXACT && dims.marker_slot_count != 0 {
        return fault(6);
    }
    if dims.mode != EXACT && dims.exact_member_count != 0 {
        return fault(7);
    }
    if dims.mode == EXACT && dims.tangent_slot_count != 0 {
        return fault(8);
    }
    for (row, &[offset, length]) in asset.marker_names.iter().enumerate() {
        name(asset, K::MarkerNames, row, (offset, length))?;
    }
    let (limit, smoothing) = match *sections.view(K::MarkerNumbers)? {
        [limit, smoothing] => (limit, smoothing),
        _ => (0.0, 0.0),
    };
    let blocks = PartBlocks {
        order: sections.view(K::MarkerSkinOrder)?,
        positions: sections.view(K::PartPositions)?,
        normals: sections.view(K::PartNormals)?,
        starts: sections.view(K::PartSlotStarts)?,
        parts: sections.view(K::PartSlotParts)?,
        weights: sections.view(K::PartSlotWeights)?,
    };
    let group = MarkerSkinSections {
        rig: MarkerRigTables {
            rest: sections.view(K::MarkerRest)?,
            parents: sections.view(K::PartParents)?,
            pivots: sections.view(K::PartPivots)?,
            member_starts: sections.view(K::MemberStarts)?,
            member_markers: sections.view(K::MemberMarkers)?,
            member_weights: sections.view(K::MemberWeights)?,
            carrier_starts: sections.view(K::CarrierStarts)?,
            carrier_parts: sections.view(K::CarrierParts)?,
            carrier_weights: sections.view(K::CarrierWeights)?,
            residual_limit: limit,
        },
        blocks,
        slots: MarkerSlots {
            positions: MarkerRows {
                starts: sections.view(K::MarkerSlotStarts)?,
                markers: sections.view(K::MarkerSlotMarkers)?,
                shares: sections.view(K::MarkerSlotShares)?,
            },
            tangents: MarkerRows {
                starts: sections.view(K::TangentSlotStarts)?,
                markers: sections.view(K::TangentSlotMarkers)?,
                shares: sections.view(K::TangentSlotShares)?,
            },
        },
        exact: ExactTables {
            blocks,
            gradients: sections.view(K::PartSlotGradients)?,
            to_local: sections.view(K::PartToLocal)?,
            from_local: sections.view(K::PartFromLocal)?,
            dilations: sections.view(K::PartDilations)?,
            member_starts: sections.view(K::ExactStarts)?,
            member_markers: sections.view(K::ExactMarkers)?,
            member_local: sections.view(K::ExactLocal)?,
            member_inverse: sections.view(K::ExactInverse)?,
            smoothing,
        },
    };
    let skin = group.check(dims).map_err(AssetError::MarkerSkin)?;
    let stated = [
        dims.rigid_block_count,
        dims.exact_pair_count,
        dims.exact_square_count,
        dims.exact_cube_count,
    ];
    let found = skin.spread().unwrap_or([usize::MAX; 4]);
    match found
        .iter()
        .zip(&stated)
        .position(|(found, stated)| found != stated)
    {
        Some(at) => fault(9 + at),
        None => Ok(Some(skin)),
    }
}
