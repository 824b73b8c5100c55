//! Compressed tracks.

use super::{below, numbers};
use crate::asset::packed::decode;
use crate::asset::{Asset, AssetError, Channel, LARGEST, SectionKind, unpack_rotation};

pub(super) fn check(asset: &Asset<'_>) -> Result<(), AssetError> {
    let section = SectionKind::PackedTracks;
    let mut first_track = 0;
    for (row, &[.., period, first, count]) in asset.clips.iter().enumerate() {
        if first as usize != first_track || count > 0 && f32::from_bits(period) <= 0.0 {
            return Err(AssetError::Index {
                section: SectionKind::Clips,
                row,
                value: first as usize,
                limit: first_track,
            });
        }
        first_track = first_track.saturating_add(count as usize);
    }
    if first_track != asset.dims.packed.track_count {
        return Err(AssetError::Index {
            section: SectionKind::Clips,
            row: asset.dims.clip_count,
            value: first_track,
            limit: asset.dims.packed.track_count,
        });
    }
    // Frames and values are used up in order, so that no byte is left unaccounted for.
    let (mut next_frame, mut next_value) = (0, 0);
    for (row, words) in asset.packed.tracks.iter().enumerate() {
        let outside = |value: u32, limit: usize| AssetError::Index {
            section,
            row,
            value: value as usize,
            limit,
        };
        let Some(track) = decode(words, &asset.packed).filter(|t| !t.frames.is_empty()) else {
            return Err(outside(words[1], asset.dims.packed.frame_count));
        };
        below(section, row, track.joint, asset.dims.joint_count)?;
        if words[1] as usize != next_frame {
            return Err(outside(words[1], next_frame));
        }
        if words[3] as usize != next_value {
            return Err(outside(words[3], next_value));
        }
        next_frame += track.frames.len();
        next_value += 3 * track.values.len();
        let ascending = track.frames.windows(2).all(|pair| pair[0] < pair[1]);
        if !ascending {
            return Err(AssetError::Number {
                section: SectionKind::PackedFrames,
                at: row,
            });
        }
        let values = SectionKind::PackedValues;
        if track.channel == Channel::Rotation {
            // Three components of a unit quaternion; the third word has a bit to spare.
            let sound = track.values.iter().all(|&words| {
                let [x, y, z, w] = unpack_rotation(words);
                words[2] < 0x8000 && x * x + y * y + z * z + w * w < 1.001
            });
            if !sound {
                return Err(AssetError::Number {
                    section: values,
                    at: row,
                });
            }
        } else {
            next_value += 12;
            numbers(values, track.range, LARGEST / 2.0)?;
        }
    }
    if next_frame != asset.dims.packed.frame_count || next_value != asset.dims.packed.value_count {
        return Err(AssetError::Index {
            section,
            row: asset.dims.packed.track_count,
            value: next_value,
            limit: asset.dims.packed.value_count,
        });
    }
    Ok(())
}
