//! Motion: clips of tracks of keys.

use super::packed::Packed;
use super::{Asset, slice};

/// A piece of motion.
#[derive(Clone, Copy, Debug)]
pub struct Clip<'a> {
    /// Name in the source.
    pub name: &'a str,
    /// Seconds from 0 to the last key.
    pub duration: f32,
    /// Seconds between samples where the source was sampled evenly, else 0.
    pub sample_period: f32,
    tracks: &'a [[u32; 4]],
    key_times: &'a [f32],
    key_values: &'a [f32],
    pub(super) packed: Packed<'a>,
}

/// What part of a joint a track moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Metres, three numbers.
    Translation,
    /// Unit quaternion, four numbers.
    Rotation,
    /// Factors, three numbers.
    Scale,
    /// Weight of a morph target, one number.
    MorphWeight,
}

/// How values between two keys are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The earlier key holds.
    Step,
    /// Straight line; the shorter great arc for rotations.
    Linear,
    /// Hermite spline (glTF 2.0, appendix C); every key holds in-tangent, value, out-tangent.
    CubicSpline,
}

/// One animated channel of one joint, or the weight of a morph target.
#[derive(Clone, Copy, Debug)]
pub struct Track<'a> {
    /// The joint; the morph target where the channel is [`Channel::MorphWeight`].
    pub target: usize,
    /// What it moves.
    pub channel: Channel,
    /// Between keys.
    pub interpolation: Interpolation,
    /// `[keys]`, seconds, strictly ascending, never empty.
    pub times: &'a [f32],
    /// `[keys x numbers]`, or `[keys x 3 x numbers]` for splines.
    pub values: &'a [f32],
}

impl Channel {
    /// Numbers in a value.
    #[must_use]
    pub const fn width(self) -> usize {
        match self {
            Self::Rotation => 4,
            Self::Translation | Self::Scale => 3,
            Self::MorphWeight => 1,
        }
    }

    /// The channel with this number in a file.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            0 => Some(Self::Translation),
            1 => Some(Self::Rotation),
            2 => Some(Self::Scale),
            3 => Some(Self::MorphWeight),
            _ => None,
        }
    }
}

impl Interpolation {
    /// Values stored for one key.
    #[must_use]
    pub const fn values_a_key(self) -> usize {
        match self {
            Self::CubicSpline => 3,
            Self::Step | Self::Linear => 1,
        }
    }

    /// The interpolation with this number in a file.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            0 => Some(Self::Step),
            1 => Some(Self::Linear),
            2 => Some(Self::CubicSpline),
            _ => None,
        }
    }
}

impl<'a> Asset<'a> {
    /// A clip; `None` for one that does not exist.
    #[must_use]
    pub fn clip(&self, index: usize) -> Option<Clip<'a>> {
        let &[
            name,
            name_bytes,
            first,
            count,
            duration,
            period,
            packed_first,
            packed_count,
        ] = self.clips.get(index)?;
        Some(Clip {
            name: self.name(name, name_bytes),
            duration: f32::from_bits(duration),
            sample_period: f32::from_bits(period),
            tracks: slice(self.tracks, first, count),
            key_times: self.key_times,
            key_values: self.key_values,
            packed: self.packed_of(packed_first, packed_count),
        })
    }
}

impl<'a> Clip<'a> {
    /// Times in seconds at which the source was sampled, from 0 to the last; where it was not
    /// sampled evenly, 30 a second.
    #[inline]
    pub fn sample_times(&self) -> impl ExactSizeIterator<Item = f32> + use<> {
        let period = if self.sample_period > 0.0 {
            self.sample_period
        } else {
            1.0 / 30.0
        };
        // A duration is seldom exactly so many periods.
        let steps = (self.duration / period + 0.01) as u32;
        (0..steps.saturating_add(1)).map(move |step| step as f32 * period)
    }

    /// Its tracks, sorted by joint.
    #[inline]
    pub fn tracks(&self) -> impl Iterator<Item = Track<'a>> + use<'a> {
        let (times, values) = (self.key_times, self.key_values);
        self.tracks
            .iter()
            .filter_map(move |row| decode_track(row, times, values))
    }
}

/// The track that a row of the section describes; `None` where it points outside.
#[inline]
pub(super) fn decode_track<'a>(
    row: &[u32; 4],
    times: &'a [f32],
    values: &'a [f32],
) -> Option<Track<'a>> {
    let &[what, first_time, keys, first_value] = row;
    let channel = Channel::from_code((what >> 16) & 0xFF)?;
    let interpolation = Interpolation::from_code(what >> 24)?;
    let (first_time, keys, first_value) =
        (first_time as usize, keys as usize, first_value as usize);
    let width = channel.width() * interpolation.values_a_key();
    let numbers = keys.checked_mul(width)?;
    Some(Track {
        target: (what & 0xFFFF) as usize,
        channel,
        interpolation,
        times: times.get(first_time..first_time.checked_add(keys)?)?,
        values: values.get(first_value..first_value.checked_add(numbers)?)?,
    })
}
