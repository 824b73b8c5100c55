//! The one pass that proves an asset's contents sound: one file a group of sections.

mod blocks;
mod bounds;
mod clips;
#[cfg(feature = "correctives")]
mod correctives;
#[cfg(feature = "laplacian")]
mod laplacian;
mod levels;
#[cfg(feature = "marker-skin")]
mod marker_skin;
mod markers;
mod mesh;
mod morphs;
mod packed;
mod shapes;
mod skeleton;

use super::bounds::RestBounds;
use super::laplacian::LaplacianView;
use super::levels::Levels;
use super::packed::Packed;
use super::sections::{Sections, check_header, check_sum};
use super::shapes::Shapes;
use super::{Asset, AssetError, MarkerTables, SectionKind, Triangles};

/// Header, then section table, then contents; nothing is read before what it depends on is proved.
pub(super) fn check(bytes: &[u8]) -> Result<Asset<'_>, AssetError> {
    let asset = contents(bytes)?;
    levels::table(&asset)?;
    for (row, place) in asset.levels.table.iter().enumerate() {
        let level = contents(asset.levels.bytes_of(place))?;
        levels::fits(&asset, &level, row)?;
    }
    Ok(asset)
}

/// All but coarser levels.
fn contents(bytes: &[u8]) -> Result<Asset<'_>, AssetError> {
    check_header(bytes)?;
    check_sum(bytes)?;
    let sections = Sections::find(bytes)?;
    let mut asset = all_views(&sections)?;
    skeleton::check(&asset)?;
    mesh::check(&asset)?;
    blocks::check(&asset)?;
    shapes::check(&asset)?;
    morphs::check(&asset)?;
    bounds::check(&asset)?;
    clips::check(&asset)?;
    markers::check(&asset)?;
    packed::check(&asset)?;
    deformers(&mut asset, &sections)?;
    Ok(asset)
}

/// Groups that a build may leave out.
fn deformers<'a>(asset: &mut Asset<'a>, sections: &Sections<'a>) -> Result<(), AssetError> {
    #[cfg(feature = "laplacian")]
    laplacian::check(asset)?;
    #[cfg(not(feature = "laplacian"))]
    if asset.dims.laplacian.is_some() {
        let feature = "laplacian";
        return Err(AssetError::NotBuilt { feature });
    }
    #[cfg(feature = "marker-skin")]
    {
        asset.marker_skin = marker_skin::check(asset, sections)?;
    }
    #[cfg(not(feature = "marker-skin"))]
    if sections.dims.marker_skin.marker_count > 0 {
        let feature = "marker-skin";
        return Err(AssetError::NotBuilt { feature });
    }
    #[cfg(feature = "correctives")]
    {
        asset.corrective = correctives::check(asset, sections)?;
    }
    #[cfg(not(feature = "correctives"))]
    if sections.dims.correctives.part_count > 0 {
        let feature = "correctives";
        return Err(AssetError::NotBuilt { feature });
    }
    Ok(())
}

/// Views into bytes whose header and checksum are sound; contents are not looked at.
pub(super) fn views(bytes: &[u8]) -> Result<Asset<'_>, AssetError> {
    all_views(&Sections::find(bytes)?)
}

fn all_views<'a>(sections: &Sections<'a>) -> Result<Asset<'a>, AssetError> {
    let dims = sections.dims;
    Ok(Asset {
        dims,
        parents: sections.view(SectionKind::Parents)?,
        rest: sections.view(SectionKind::Rest)?,
        bind_joints: sections.view(SectionKind::BindJoints)?,
        inverse_bind: sections.view(SectionKind::InverseBind)?,
        bind_rotations: sections.view(SectionKind::BindRotations)?,
        runs: sections.view(SectionKind::Runs)?,
        slot_binds: sections.view(SectionKind::SlotBinds)?,
        slot_weights: sections.view(SectionKind::SlotWeights)?,
        positions: sections.view(SectionKind::Positions)?,
        normals: sections.view(SectionKind::Normals)?,
        centres: sections.view(SectionKind::Centres)?,
        morphs: sections.view(SectionKind::Morphs)?,
        morph_starts: sections.view(SectionKind::MorphStarts)?,
        morph_ids: sections.view(SectionKind::MorphIds)?,
        morph_offsets: sections.view(SectionKind::MorphOffsets)?,
        morph_normals: sections.view(SectionKind::MorphNormals)?,
        order: sections.view(SectionKind::Order)?,
        triangles: match dims.index_bytes {
            2 => Triangles::U16(sections.view(SectionKind::Triangles)?),
            _ => Triangles::U32(sections.view(SectionKind::Triangles)?),
        },
        parts: sections.view(SectionKind::Parts)?,
        clips: sections.view(SectionKind::Clips)?,
        tracks: sections.view(SectionKind::Tracks)?,
        key_times: sections.view(SectionKind::KeyTimes)?,
        key_values: sections.view(SectionKind::KeyValues)?,
        packed: Packed {
            tracks: sections.view(SectionKind::PackedTracks)?,
            frames: sections.view(SectionKind::PackedFrames)?,
            values: sections.view(SectionKind::PackedValues)?,
        },
        joint_names: sections.view(SectionKind::JointNames)?,
        markers: MarkerTables {
            markers: sections.view(SectionKind::LiveMarkers)?,
            neighbours: sections.view(SectionKind::LiveNeighbours)?,
            links: sections.view(SectionKind::LiveLinks)?,
            seed_markers: sections.view(SectionKind::LiveSeeds)?,
            seeds: sections.view(SectionKind::LiveSeedShapes)?,
        },
        live_names: sections.view(SectionKind::LiveNames)?,
        live_rate: sections.view(SectionKind::LiveRate)?,
        names: sections.view(SectionKind::Names)?,
        shapes: Shapes {
            boxes: sections.view(SectionKind::PackedBoxes)?,
            positions: sections.view(SectionKind::PackedPositions)?,
            normals: sections.view(SectionKind::PackedNormals)?,
            tangents: sections.view(SectionKind::Tangents)?,
            tangent_signs: sections.view(SectionKind::TangentSigns)?,
        },
        rest_bounds: RestBounds {
            boxes: sections.view(SectionKind::BindBoxes)?,
            pairs: sections.view(SectionKind::BindPairs)?,
            pair_boxes: sections.view(SectionKind::PairBoxes)?,
        },
        levels: Levels {
            table: sections.view(SectionKind::Levels)?,
            data: sections.view(SectionKind::LevelData)?,
            sources: sections.view(SectionKind::LevelSources)?,
        },
        #[cfg(feature = "laplacian")]
        laplacian: LaplacianView::find(sections)?,
        #[cfg(not(feature = "laplacian"))]
        laplacian: LaplacianView::default(),
        marker_skin: None,
        corrective: None,
        marker_names: sections.view(SectionKind::MarkerNames)?,
    })
}

fn below(section: SectionKind, row: usize, value: usize, limit: usize) -> Result<(), AssetError> {
    if value < limit {
        Ok(())
    } else {
        Err(AssetError::Index {
            section,
            row,
            value,
            limit,
        })
    }
}

/// Every number finite and at most `largest` in magnitude.
fn numbers(
    section: SectionKind,
    values: impl IntoIterator<Item = f32>,
    largest: f32,
) -> Result<(), AssetError> {
    // A NaN fails the comparison.
    match values
        .into_iter()
        .position(|value| !(-largest..=largest).contains(&value))
    {
        Some(at) => Err(AssetError::Number { section, at }),
        None => Ok(()),
    }
}

fn unit_length(section: SectionKind, at: usize, quaternion: &[f32]) -> Result<(), AssetError> {
    let length2: f32 = quaternion.iter().map(|x| x * x).sum();
    if (0.999..=1.001).contains(&length2) {
        Ok(())
    } else {
        Err(AssetError::Number { section, at })
    }
}

fn name(
    asset: &Asset<'_>,
    section: SectionKind,
    row: usize,
    place: (u32, u32),
) -> Result<(), AssetError> {
    let (offset, length) = (place.0 as usize, place.1 as usize);
    let end = offset.saturating_add(length);
    let limit = asset.names.len();
    let Some(text) = asset.names.get(offset..end) else {
        return Err(AssetError::Index {
            section,
            row,
            value: end,
            limit,
        });
    };
    core::str::from_utf8(text)
        .map(|_| ())
        .map_err(|_| AssetError::Name { section, row })
}
