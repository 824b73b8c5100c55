//! A marker set: the tables' own check, with the section named.

use super::{name, numbers};
use crate::asset::{Asset, AssetError, MAX_RATE, MarkerError, SectionKind};

pub(super) fn check(asset: &Asset<'_>) -> Result<(), AssetError> {
    for (row, &[offset, length]) in asset.live_names.iter().enumerate() {
        name(asset, SectionKind::LiveNames, row, (offset, length))?;
    }
    for (row, &[rate, ..]) in asset.live_rate.iter().enumerate() {
        numbers(SectionKind::LiveRate, [rate], MAX_RATE)?;
        if rate < 1.0 {
            let section = SectionKind::LiveRate;
            return Err(AssetError::Number { section, at: row });
        }
    }
    let Some(tables) = asset.live_markers() else {
        return Ok(());
    };
    let limit = asset.dims.markers.marker_count;
    let section = |table: &str| match table {
        "markers" => SectionKind::LiveMarkers,
        "neighbours" => SectionKind::LiveNeighbours,
        "links" => SectionKind::LiveLinks,
        "seed markers" => SectionKind::LiveSeeds,
        _ => SectionKind::LiveSeedShapes,
    };
    match tables.check() {
        Ok(_) => Ok(()),
        Err(MarkerError::Index { table, row, index }) => Err(AssetError::Index {
            section: section(table),
            row,
            value: index,
            limit,
        }),
        Err(MarkerError::Number { table, row }) => Err(AssetError::Number {
            section: section(table),
            at: row,
        }),
        // The lengths follow from the counts.
        Err(MarkerError::Count { count, .. }) => Err(AssetError::Counts {
            index: 32,
            value: count,
        }),
        Err(MarkerError::Length { found, .. }) => Err(AssetError::Counts {
            index: 32,
            value: found,
        }),
    }
}
