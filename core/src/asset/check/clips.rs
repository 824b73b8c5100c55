//! Clips, tracks and keys.

use super::{below, name, numbers, unit_length};
use crate::asset::clips::decode_track;
use crate::asset::{Asset, AssetError, Channel, LARGEST, SectionKind, Track};

pub(super) fn check(asset: &Asset<'_>) -> Result<(), AssetError> {
    let (mut first_track, mut most_tracks, mut most_keys) = (0, 0, 0);
    for (row, &[offset, length, first, count, duration, period, _, packed]) in
        asset.clips.iter().enumerate()
    {
        let section = SectionKind::Clips;
        name(asset, section, row, (offset, length))?;
        numbers(
            section,
            [f32::from_bits(duration), f32::from_bits(period)],
            LARGEST,
        )?;
        let sound = f32::from_bits(duration) >= 0.0 && f32::from_bits(period) >= 0.0;
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
        most_tracks = most_tracks.max((count as usize).saturating_add(packed as usize));
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
    for track in asset.packed.tracks {
        most_keys = most_keys.max(track[2] as usize);
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
