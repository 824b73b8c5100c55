//! Clips, tracks and keys.

use std::collections::HashMap;

use sinew_core::asset::{PackedDims, SectionKind};

use super::{BakeError, SparseClips, Writer, fits, limit};
use crate::bake::compress::PackedTrack;
use crate::model::{Channel, Interpolation, Morph, MorphTrack, Track};

/// Sections under construction.
#[derive(Default)]
struct Tables {
    clips: Vec<[u32; 8]>,
    tracks: Vec<[u32; 4]>,
    times: Vec<f32>,
    values: Vec<f32>,
    /// Where key times stand that tracks share.
    shared: HashMap<Vec<u32>, usize>,
    most_keys: usize,
}

impl Writer {
    /// Joint tracks, then morph weights, of each clip.
    pub(super) fn clips(&mut self, clips: &SparseClips, morphs: &[Morph]) -> Result<(), BakeError> {
        let mut tables = Tables::default();
        let mut packed = Packed::default();
        for (index, clip) in clips.clips.iter().enumerate() {
            let [name, name_bytes] = self.name(&clip.name);
            let what = || format!("duration of clip {:?}", clip.name);
            let duration = fits(clip.duration, what)?.to_bits();
            let period = (clip.sample_period.unwrap_or(0.0) as f32).to_bits();
            let first = tables.tracks.len();
            let what = || format!("a key of clip {:?}", clip.name);
            for track in &clip.tracks {
                tables.joint_track(track, what)?;
            }
            if let Some(track) = &clip.morph_track {
                for (index, morph) in morphs.iter().enumerate() {
                    tables.morph_track(track, index, morphs.len(), morph.rest_weight, what)?;
                }
            }
            let count = tables.tracks.len() - first;
            let first_packed = packed.tracks.len();
            for track in clips.packed.get(index).into_iter().flatten() {
                packed.track(track)?;
                tables.most_keys = tables.most_keys.max(track.frames.len());
            }
            let packed_count = packed.tracks.len() - first_packed;
            self.dims.max_clip_tracks = self.dims.max_clip_tracks.max(count + packed_count);
            let (first, count) = (first as u32, count as u32);
            let (first_packed, packed_count) = (first_packed as u32, packed_count as u32);
            let row = [
                name,
                name_bytes,
                first,
                count,
                duration,
                period,
                first_packed,
                packed_count,
            ];
            tables.clips.push(row);
        }
        self.dims.clip_count = tables.clips.len();
        self.dims.track_count = tables.tracks.len();
        self.dims.max_track_keys = tables.most_keys;
        self.dims.key_time_count = tables.times.len();
        let values = limit("key values", tables.values.len(), u32::MAX as usize / 4)?;
        self.dims.key_value_count = values;
        self.put(SectionKind::Clips, tables.clips.as_flattened());
        self.put(SectionKind::Tracks, tables.tracks.as_flattened());
        self.put(SectionKind::KeyTimes, &tables.times);
        self.put(SectionKind::KeyValues, &tables.values);
        self.dims.packed = PackedDims {
            track_count: packed.tracks.len(),
            frame_count: packed.frames.len(),
            value_count: limit("key values", packed.values.len(), u32::MAX as usize / 2)?,
        };
        self.put(SectionKind::PackedTracks, packed.tracks.as_flattened());
        self.put(SectionKind::PackedFrames, &packed.frames);
        self.put(SectionKind::PackedValues, &packed.values);
        Ok(())
    }
}

/// Sections of compressed tracks under construction.
#[derive(Default)]
struct Packed {
    tracks: Vec<[u32; 4]>,
    frames: Vec<u16>,
    values: Vec<u16>,
}

impl Packed {
    fn track(&mut self, track: &PackedTrack) -> Result<(), BakeError> {
        let channel = match track.channel {
            Channel::Translation => 0,
            Channel::Rotation => 1,
            Channel::Scale => 2,
        };
        self.tracks.push([
            track.joint as u32 | channel << 16,
            self.frames.len() as u32,
            track.frames.len() as u32,
            self.values.len() as u32,
        ]);
        self.frames.extend(&track.frames);
        if track.channel != Channel::Rotation {
            for value in track.range {
                let bits = fits(value.into(), || "a compressed key".into())?.to_bits();
                self.values.extend([bits as u16, (bits >> 16) as u16]);
            }
        }
        self.values.extend(track.values.as_flattened());
        Ok(())
    }
}

impl Tables {
    fn joint_track(
        &mut self,
        track: &Track,
        what: impl Fn() -> String + Copy,
    ) -> Result<(), BakeError> {
        let channel = match track.channel {
            Channel::Translation => 0,
            Channel::Rotation => 1,
            Channel::Scale => 2,
        };
        let width = if track.channel == Channel::Rotation {
            4
        } else {
            3
        };
        let group = group(track.interpolation);
        let keys = self.start(
            track.joint,
            channel,
            track.interpolation,
            &track.times,
            what,
        )?;
        for key in keys {
            for value in &track.values[key * group..][..group] {
                for &number in &value[..width] {
                    self.values.push(fits(number, what)?);
                }
            }
        }
        Ok(())
    }

    /// One of `count` weights, unless it never leaves its weight at rest.
    fn morph_track(
        &mut self,
        track: &MorphTrack,
        morph: usize,
        count: usize,
        rest: f64,
        what: impl Fn() -> String + Copy,
    ) -> Result<(), BakeError> {
        let group = group(track.interpolation);
        let numbers = || track.values.iter().skip(morph).step_by(count);
        let still = |&number: &f64| number as f32 == rest as f32;
        if group == 1 && numbers().all(still) {
            return Ok(());
        }
        let keys = self.start(morph, 3, track.interpolation, &track.times, what)?;
        for key in keys {
            for &number in numbers().skip(key * group).take(group) {
                self.values.push(fits(number, what)?);
            }
        }
        Ok(())
    }

    /// Begins a track and returns which keys it has.
    fn start(
        &mut self,
        target: usize,
        channel: u32,
        interpolation: Interpolation,
        times: &[f64],
        what: impl Fn() -> String,
    ) -> Result<Vec<usize>, BakeError> {
        let keys = distinct_times(times, what)?;
        let bits = keys.iter().map(|&key| (times[key] as f32).to_bits());
        let bits: Vec<u32> = bits.collect();
        let all = &mut self.times;
        let first_time = *self.shared.entry(bits).or_insert_with_key(|bits| {
            all.extend(bits.iter().map(|&bits| f32::from_bits(bits)));
            all.len() - bits.len()
        });
        let interpolation = match interpolation {
            Interpolation::Step => 0,
            Interpolation::Linear => 1,
            Interpolation::CubicSpline => 2,
        };
        self.tracks.push([
            target as u32 | channel << 16 | interpolation << 24,
            first_time as u32,
            keys.len() as u32,
            self.values.len() as u32,
        ]);
        self.most_keys = self.most_keys.max(keys.len());
        Ok(keys)
    }
}

/// Values in a key.
fn group(interpolation: Interpolation) -> usize {
    if interpolation == Interpolation::CubicSpline {
        3
    } else {
        1
    }
}

/// Keys whose times stay apart when rounded to `f32`; of those that fall together the last.
fn distinct_times(times: &[f64], what: impl Fn() -> String) -> Result<Vec<usize>, BakeError> {
    let mut keys: Vec<usize> = Vec::with_capacity(times.len());
    for (key, &time) in times.iter().enumerate() {
        let time = fits(time, &what)?;
        match keys.last_mut() {
            Some(before) if times[*before] as f32 >= time => *before = key,
            _ => keys.push(key),
        }
    }
    Ok(keys)
}
