//! Correctives. Their tables prove themselves, as they do without an asset.

use crate::asset::sections::Sections;
use crate::asset::{Asset, AssetError, CorrectiveDims, SectionKind as K};
use crate::deform::parts::{Corrective, CorrectiveTables};

pub(super) fn check<'a>(
    asset: &Asset<'a>,
    sections: &Sections<'a>,
) -> Result<Option<Corrective<'a>>, AssetError> {
    let dims = &asset.dims.correctives;
    if *dims == CorrectiveDims::default() {
        return Ok(None);
    }
    let fault = |at: usize, value| {
        Err(AssetError::Counts {
            index: CorrectiveDims::WORD + at,
            value,
        })
    };
    if dims.part_count == 0 || dims.part_count > usize::from(u16::MAX) {
        return fault(0, dims.part_count);
    }
    if dims.mode_count == 0 || dims.mode_count > asset.dims.morph_count {
        return fault(1, dims.mode_count);
    }
    let tables = view(sections)?;
    Corrective::new_checked(tables, asset.dims.bind_count)
        .map(Some)
        .map_err(AssetError::Correctives)
}

fn view<'a>(sections: &Sections<'a>) -> Result<CorrectiveTables<'a>, AssetError> {
    Ok(CorrectiveTables {
        parents: sections.view(K::CorrectiveParents)?,
        binds: sections.view(K::CorrectiveBinds)?,
        pivots: sections.view(K::CorrectivePivots)?,
        springs: sections.view(K::CorrectiveSprings)?,
        starts: sections.view(K::CorrectiveStarts)?,
        features: sections.view(K::CorrectiveFeatures)?,
        coefficients: sections.view(K::CorrectiveCoefficients)?,
        ranges: sections.view(K::CorrectiveRanges)?,
    })
}
