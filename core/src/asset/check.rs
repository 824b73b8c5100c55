//! The one pass that proves an asset sound.

use bytemuck::{Pod, try_cast_slice};

use super::header::{
    AT_CHECKED, AT_CHECKSUM, AT_DIMS, AT_RESERVED, AT_SECTION_COUNT, AT_TOTAL_BYTES, AT_VERSION,
    DIMS_USED, word,
};
use super::{
    ALIGNMENT, Asset, AssetError, Channel, Dims, HEADER_BYTES, LANES, LARGEST, LARGEST_WEIGHT,
    MAGIC, NO_PARENT, SECTION_ROW_BYTES, SectionKind, Track, Triangles, VERSION, WEIGHT_ONE, crc32,
    decode_track,
};

const SECTIONS: usize = SectionKind::ALL.len();

/// Header, then section table, then contents; nothing is read before what it depends on is proved.
pub(super) fn check(bytes: &[u8]) -> Result<Asset<'_>, AssetError> {
    let sections = Sections::find(bytes)?;
    let dims = sections.dims;
    let asset = Asset {
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
        joint_names: sections.view(SectionKind::JointNames)?,
        names: sections.view(SectionKind::Names)?,
    };
    check_skeleton(&asset)?;
    check_mesh(&asset)?;
    check_blocks(&asset)?;
    check_morphs(&asset)?;
    check_clips(&asset)?;
    Ok(asset)
}

/// The bytes with the place of every section.
struct Sections<'a> {
    bytes: &'a [u8],
    dims: Dims,
    places: [(usize, usize); SECTIONS],
}

impl<'a> Sections<'a> {
    fn find(bytes: &'a [u8]) -> Result<Self, AssetError> {
        let table_end = HEADER_BYTES + SECTIONS * SECTION_ROW_BYTES;
        if bytes.get(..MAGIC.len().min(bytes.len())) != MAGIC.get(..MAGIC.len().min(bytes.len())) {
            return Err(AssetError::NotAnAsset);
        }
        if bytes.len() < table_end {
            return Err(AssetError::TooShort {
                needed: table_end,
                found: bytes.len(),
            });
        }
        let version = word(bytes, AT_VERSION) as u32;
        if version != VERSION {
            return Err(AssetError::Version { found: version });
        }
        let stated = word(bytes, AT_TOTAL_BYTES);
        if stated != bytes.len() {
            return Err(AssetError::Length {
                stated,
                found: bytes.len(),
            });
        }
        let (stated, found) = (
            word(bytes, AT_CHECKSUM) as u32,
            crc32(bytes.get(AT_CHECKED..).unwrap_or_default()),
        );
        if stated != found {
            return Err(AssetError::Checksum { stated, found });
        }
        if !(bytes.as_ptr() as usize).is_multiple_of(ALIGNMENT) {
            return Err(AssetError::Misaligned);
        }
        all_zero(bytes, AT_RESERVED, AT_RESERVED + 8)?;
        let dims = Dims::read(bytes);
        all_zero(bytes, AT_DIMS + 4 * DIMS_USED, HEADER_BYTES)?;
        check_counts(&dims)?;
        if word(bytes, AT_SECTION_COUNT) != SECTIONS {
            return Err(AssetError::SectionOrder {
                row: SECTIONS,
                found: 0,
            });
        }
        let mut places = [(0, 0); SECTIONS];
        let mut end = table_end;
        for (row, (&section, place)) in SectionKind::ALL.iter().zip(&mut places).enumerate() {
            let at = HEADER_BYTES + row * SECTION_ROW_BYTES;
            let found = word(bytes, at) as u32;
            if found != section as u32 {
                return Err(AssetError::SectionOrder { row, found });
            }
            let (offset, length) = (word(bytes, at + 4), word(bytes, at + 8));
            all_zero(bytes, at + 12, at + 16)?;
            let expected = section.bytes(&dims);
            if expected != Some(length) {
                let expected = expected.unwrap_or(usize::MAX);
                return Err(AssetError::SectionLength {
                    section,
                    expected,
                    found: length,
                });
            }
            let after = offset
                .checked_add(length)
                .filter(|&after| after <= bytes.len());
            match after {
                Some(after) if offset == end.next_multiple_of(ALIGNMENT) => {
                    all_zero(bytes, end, offset)?;
                    *place = (offset, after);
                    end = after;
                }
                _ => return Err(AssetError::SectionPlace { section, offset }),
            }
        }
        if end.next_multiple_of(ALIGNMENT) != bytes.len() {
            return Err(AssetError::Length {
                stated: end,
                found: bytes.len(),
            });
        }
        all_zero(bytes, end, bytes.len())?;
        Ok(Self {
            bytes,
            dims,
            places,
        })
    }

    fn view<T: Pod>(&self, section: SectionKind) -> Result<&'a [T], AssetError> {
        let row = SectionKind::ALL
            .iter()
            .position(|&kind| kind as u32 == section as u32);
        let &(start, end) = row.and_then(|row| self.places.get(row)).unwrap_or(&(0, 0));
        // Lengths and alignment are proved; a failure here could only be an unaligned base.
        try_cast_slice(self.bytes.get(start..end).unwrap_or_default())
            .map_err(|_| AssetError::Misaligned)
    }
}

fn all_zero(bytes: &[u8], start: usize, end: usize) -> Result<(), AssetError> {
    let gap = bytes.get(start..end).unwrap_or_default();
    match gap.iter().position(|&byte| byte != 0) {
        Some(at) => Err(AssetError::NotZero { at: start + at }),
        None => Ok(()),
    }
}

fn check_counts(dims: &Dims) -> Result<(), AssetError> {
    let words = dims.to_words();
    let fault = |index: usize| {
        Err(AssetError::Counts {
            index,
            value: words.get(index).copied().unwrap_or(0),
        })
    };
    if dims.joint_count == 0 || dims.joint_count >= usize::from(NO_PARENT) {
        return fault(0);
    }
    if dims.bind_count == 0 || dims.bind_count >= usize::from(NO_PARENT) {
        return fault(1);
    }
    if dims.vertex_count == 0 {
        return fault(2);
    }
    if dims.block_count != dims.vertex_count.div_ceil(LANES) {
        return fault(3);
    }
    let short_indices = dims.index_bytes == 2 && dims.vertex_count <= 1 << 16;
    if !(short_indices || dims.index_bytes == 4) {
        return fault(7);
    }
    if dims.morph_count >= usize::from(NO_PARENT) {
        return fault(18);
    }
    if dims.morph_count == 0 && dims.morph_row_count != 0 {
        return fault(19);
    }
    if dims.morph_normal_count != 0 && dims.morph_normal_count != dims.morph_row_count {
        return fault(20);
    }
    if dims.max_clip_tracks > dims.track_count {
        return fault(11);
    }
    if dims.max_track_keys > dims.key_time_count {
        return fault(12);
    }
    Ok(())
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

fn check_skeleton(asset: &Asset<'_>) -> Result<(), AssetError> {
    for (joint, &parent) in asset.parents.iter().enumerate() {
        if parent != NO_PARENT {
            // A parent that comes first cannot close a cycle.
            below(SectionKind::Parents, joint, usize::from(parent), joint)?;
        }
    }
    numbers(
        SectionKind::Rest,
        asset.rest.as_flattened().iter().copied(),
        LARGEST,
    )?;
    for (joint, rest) in asset.rest.iter().enumerate() {
        unit_length(
            SectionKind::Rest,
            joint * rest.len(),
            rest.get(..4).unwrap_or_default(),
        )?;
    }
    for (bind, &joint) in asset.bind_joints.iter().enumerate() {
        below(
            SectionKind::BindJoints,
            bind,
            usize::from(joint),
            asset.dims.joint_count,
        )?;
    }
    numbers(
        SectionKind::InverseBind,
        asset.inverse_bind.as_flattened().iter().copied(),
        LARGEST,
    )?;
    for (bind, rotation) in asset.bind_rotations.iter().enumerate() {
        unit_length(SectionKind::BindRotations, 4 * bind, rotation)?;
    }
    for (joint, &[offset, length]) in asset.joint_names.iter().enumerate() {
        name(asset, SectionKind::JointNames, joint, (offset, length))?;
    }
    Ok(())
}

fn check_mesh(asset: &Asset<'_>) -> Result<(), AssetError> {
    let flat = |values: &'_ [super::Lanes3], section, largest| {
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

fn check_blocks(asset: &Asset<'_>) -> Result<(), AssetError> {
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

fn check_morphs(asset: &Asset<'_>) -> Result<(), AssetError> {
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
    let flat = |rows: &'_ [super::Lanes3], section, largest| {
        let all = rows.as_flattened().as_flattened();
        numbers(section, all.iter().copied(), largest)
    };
    flat(asset.morph_offsets, SectionKind::MorphOffsets, LARGEST)?;
    flat(asset.morph_normals, SectionKind::MorphNormals, 4.0)
}

fn check_clips(asset: &Asset<'_>) -> Result<(), AssetError> {
    let (mut first_track, mut most_tracks, mut most_keys) = (0, 0, 0);
    for (
        row,
        &[
            offset,
            length,
            first,
            count,
            duration,
            period,
            zero,
            also_zero,
        ],
    ) in asset.clips.iter().enumerate()
    {
        let section = SectionKind::Clips;
        name(asset, section, row, (offset, length))?;
        numbers(
            section,
            [f32::from_bits(duration), f32::from_bits(period)],
            LARGEST,
        )?;
        let sound = f32::from_bits(duration) >= 0.0
            && f32::from_bits(period) >= 0.0
            && zero == 0
            && also_zero == 0;
        if !sound {
            return Err(AssetError::Number { section, at: row });
        }
        if first as usize != first_track {
            return Err(AssetError::Index {
                section,
                row,
                value: first as usize,
                limit: first_track,
            });
        }
        first_track = first_track.saturating_add(count as usize);
        most_tracks = most_tracks.max(count as usize);
    }
    if first_track != asset.dims.track_count {
        let limit = asset.dims.track_count;
        return Err(AssetError::Index {
            section: SectionKind::Clips,
            row: asset.dims.clip_count,
            value: first_track,
            limit,
        });
    }
    numbers(
        SectionKind::KeyTimes,
        asset.key_times.iter().copied(),
        LARGEST,
    )?;
    numbers(
        SectionKind::KeyValues,
        asset.key_values.iter().copied(),
        LARGEST,
    )?;
    for (row, words) in asset.tracks.iter().enumerate() {
        let section = SectionKind::Tracks;
        let track = decode_track(words, asset.key_times, asset.key_values)
            .filter(|track| !track.times.is_empty());
        let Some(track) = track else {
            let limit = asset.dims.key_time_count;
            return Err(AssetError::Index {
                section,
                row,
                value: words[1] as usize,
                limit,
            });
        };
        let targets = if track.channel == Channel::MorphWeight {
            asset.dims.morph_count
        } else {
            asset.dims.joint_count
        };
        below(section, row, track.target, targets)?;
        check_keys(&track, row)?;
        most_keys = most_keys.max(track.times.len());
    }
    if most_tracks != asset.dims.max_clip_tracks {
        return Err(AssetError::Counts {
            index: 11,
            value: asset.dims.max_clip_tracks,
        });
    }
    if most_keys != asset.dims.max_track_keys {
        return Err(AssetError::Counts {
            index: 12,
            value: asset.dims.max_track_keys,
        });
    }
    Ok(())
}

fn check_keys(track: &Track<'_>, row: usize) -> Result<(), AssetError> {
    let mut before = -1.0;
    for &time in track.times {
        if time < 0.0 || time <= before {
            return Err(AssetError::Number {
                section: SectionKind::KeyTimes,
                at: row,
            });
        }
        before = time;
    }
    if track.channel == Channel::Rotation && track.interpolation.values_a_key() == 1 {
        for value in track.values.as_chunks::<4>().0 {
            unit_length(SectionKind::KeyValues, row, value)?;
        }
    }
    Ok(())
}
