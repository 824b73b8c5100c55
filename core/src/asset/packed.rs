//! Compressed tracks: keys of 16 bits at frames of the clip.

use super::header::count;
use super::{Asset, Channel, Clip, slice};
use crate::math::{Quat4, inverse_sqrt};

/// Counts of the compressed tracks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PackedDims {
    /// Tracks of all clips.
    pub track_count: usize,
    /// Key frames of all tracks.
    pub frame_count: usize,
    /// 16-bit values of all tracks.
    pub value_count: usize,
}

impl PackedDims {
    /// Its first word in the header.
    pub(super) const WORD: usize = 60;

    pub(super) const fn read(bytes: &[u8]) -> Self {
        Self {
            track_count: count(bytes, Self::WORD),
            frame_count: count(bytes, Self::WORD + 1),
            value_count: count(bytes, Self::WORD + 2),
        }
    }

    pub(super) const fn to_words(self) -> [usize; 3] {
        [self.track_count, self.frame_count, self.value_count]
    }
}

/// The sections of compressed tracks.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Packed<'a> {
    pub tracks: &'a [[u32; 4]],
    pub frames: &'a [u16],
    pub values: &'a [u16],
}

/// One compressed channel of one joint; linear between keys, as an
/// [`Interpolation::Linear`](super::Interpolation::Linear) track.
#[derive(Clone, Copy, Debug)]
pub struct PackedTrack<'a> {
    /// The joint.
    pub joint: usize,
    /// Translation, rotation or scale.
    pub channel: Channel,
    /// `[keys]`: frame of each key, strictly ascending, never empty. A frame lasts the clip's
    /// sample period.
    pub frames: &'a [u16],
    /// Lowest value along each axis, then the extent; unused for rotations.
    pub(crate) range: [f32; 6],
    /// `[keys]`
    pub(crate) values: &'a [[u16; 3]],
}

/// Words before the keys of a translation or scale: its range, six `f32`.
const RANGE_WORDS: usize = 12;

impl PackedTrack<'_> {
    /// The translation or scale of a key. O(1)
    #[must_use]
    pub fn vector(&self, key: usize) -> Option<[f32; 3]> {
        let [x, y, z] = *self.values.get(key)?;
        let [low_x, low_y, low_z, size_x, size_y, size_z] = self.range;
        let value =
            |low: f32, size: f32, code: u16| low + size * (f32::from(code) * (1.0 / 65535.0));
        Some([
            value(low_x, size_x, x),
            value(low_y, size_y, y),
            value(low_z, size_z, z),
        ])
    }

    /// The rotation of a key, of unit length but for rounding. O(1)
    #[must_use]
    pub fn rotation(&self, key: usize) -> Option<Quat4> {
        self.values.get(key).map(|&words| unpack_rotation(words))
    }
}

/// A unit quaternion from three of its components, 15 bits each: the largest one, which is made
/// positive, follows from the others. The top bits of the first two words say which it is.
#[must_use]
pub fn unpack_rotation([a, b, c]: [u16; 3]) -> Quat4 {
    let largest = (a >> 15) | (b >> 15) << 1;
    let value = |word: u16| {
        let code = f32::from(word & 0x7FFF);
        (code * (2.0 / 32767.0) - 1.0) * core::f32::consts::FRAC_1_SQRT_2
    };
    let (a, b, c) = (value(a), value(b), value(c));
    let rest = 1.0 - (a * a + b * b + c * c);
    let last = if rest > 1e-12 {
        rest * inverse_sqrt(rest)
    } else {
        0.0
    };
    match largest {
        0 => [last, a, b, c],
        1 => [a, last, b, c],
        2 => [a, b, last, c],
        _ => [a, b, c, last],
    }
}

impl<'a> Clip<'a> {
    /// Its compressed tracks, sorted by joint.
    #[inline]
    pub fn packed_tracks(&self) -> impl Iterator<Item = PackedTrack<'a>> + use<'a> {
        let packed = self.packed;
        packed
            .tracks
            .iter()
            .filter_map(move |row| decode(row, &packed))
    }
}

impl<'a> Asset<'a> {
    /// The compressed tracks of a clip's row.
    pub(super) fn packed_of(&self, first: u32, count: u32) -> Packed<'a> {
        Packed {
            tracks: slice(self.packed.tracks, first, count),
            ..self.packed
        }
    }
}

/// The track that a row describes; `None` where it points outside or states no such channel.
#[inline]
pub(super) fn decode<'a>(row: &[u32; 4], packed: &Packed<'a>) -> Option<PackedTrack<'a>> {
    let &[what, first_frame, keys, first_value] = row;
    let channel = Channel::from_code(what >> 16)?;
    let (first_frame, keys, first_value) =
        (first_frame as usize, keys as usize, first_value as usize);
    let mut values = packed.values.get(first_value..)?;
    let mut range = [0.0; 6];
    match channel {
        Channel::Rotation => {}
        Channel::Translation | Channel::Scale => {
            let (words, rest) = values.split_at_checked(RANGE_WORDS)?;
            for (to, &[low, high]) in range.iter_mut().zip(words.as_chunks::<2>().0) {
                *to = f32::from_bits(u32::from(low) | u32::from(high) << 16);
            }
            values = rest;
        }
        Channel::MorphWeight => return None,
    }
    let values = values.get(..keys.checked_mul(3)?)?;
    Some(PackedTrack {
        joint: (what & 0xFFFF) as usize,
        channel,
        frames: packed
            .frames
            .get(first_frame..first_frame.checked_add(keys)?)?,
        range,
        values: values.as_chunks::<3>().0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_components_give_back_the_fourth() {
        // Codes of 0, 0, 0 are -1/sqrt(2) each: beyond a unit quaternion, so the last is 0.
        let low = unpack_rotation([0, 0, 0]);
        assert_eq!(low[0], 0.0);
        let half = 16384_u16; // nearest to 0
        for largest in 0..4_u16 {
            let words = [half | largest << 15, half | (largest >> 1) << 15, half];
            let turn = unpack_rotation(words);
            for (at, value) in turn.into_iter().enumerate() {
                let expected = if at == usize::from(largest) { 1.0 } else { 0.0 };
                assert!((value - expected).abs() < 1e-4, "{turn:?}");
            }
        }
    }
}
