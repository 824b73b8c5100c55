//! Clips, tracks and keys.

use std::collections::HashMap;

use sinew_core::asset::SectionKind;

use super::{BakeError, SparseClips, Writer, fits, limit};
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
        for clip in &clips.clips {
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
            self.dims.max_clip_tracks = self.dims.max_clip_tracks.max(count);
            let (first, count) = (first as u32, count as u32);
            let row = [name, name_bytes, first, count, duration, period, 0, 0];
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
