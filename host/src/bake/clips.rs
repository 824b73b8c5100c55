//! Clips into sparse keys.
//!
//! A key stays only where leaving it out would change the motion by more than a tolerance; a
//! channel that never leaves the rest pose is left out altogether.

use glam::DQuat;

use super::compress::{CompressionReport, PackedTrack, compress};
use crate::model::{Avatar, Channel, Clip, Interpolation, Skeleton, Track};

/// How far the kept keys may stray from those left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyTolerance {
    /// Radians.
    pub rotation: f64,
    /// Metres.
    pub translation: f64,
    /// Factor.
    pub scale: f64,
}

impl Default for KeyTolerance {
    /// A thousandth of a millimetre at the end of a metre: below what 32-bit skinning itself loses.
    fn default() -> Self {
        Self {
            rotation: 1e-6,
            translation: 1e-6,
            scale: 1e-6,
        }
    }
}

/// Clips with the keys that remain.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseClips {
    /// In the order of the body, without what is compressed.
    pub clips: Vec<Clip>,
    /// Compressed tracks of each clip; may be empty.
    pub packed: Vec<Vec<PackedTrack>>,
    /// What compression did, clip by clip; clips that stay as they are have no row.
    pub compression: Vec<CompressionReport>,
    /// Keys before.
    pub source_keys: usize,
}

impl SparseClips {
    /// Keys that remain.
    #[must_use]
    pub fn kept_keys(&self) -> usize {
        let tracks = self.clips.iter().flat_map(|clip| &clip.tracks);
        let packed = self.packed.iter().flatten();
        tracks.map(|track| track.times.len()).sum::<usize>()
            + packed.map(|track| track.frames.len()).sum::<usize>()
    }
}

/// Leaves out what the tolerance allows; with `compression`, a distance in metres, clips are
/// compressed first. O(keys log keys) for smooth motion.
#[must_use]
pub fn reduce(avatar: &Avatar, tolerance: KeyTolerance, compression: Option<f64>) -> SparseClips {
    let tracks = avatar.clips.iter().flat_map(|clip| &clip.tracks);
    let mut out = SparseClips {
        source_keys: tracks.map(|track| track.times.len()).sum(),
        clips: Vec::with_capacity(avatar.clips.len()),
        packed: Vec::with_capacity(avatar.clips.len()),
        compression: Vec::new(),
    };
    for clip in &avatar.clips {
        let mut clip = clip.clone();
        let compressed =
            compression.and_then(|distance| compress(&mut clip, &avatar.skeleton, distance));
        let (packed, report) = compressed.unzip();
        out.packed.push(packed.unwrap_or_default());
        out.compression.extend(report);
        out.clips
            .push(reduce_clip(&clip, &avatar.skeleton, tolerance));
    }
    out
}

fn reduce_clip(clip: &Clip, skeleton: &Skeleton, tolerance: KeyTolerance) -> Clip {
    let tracks = clip.tracks.iter().filter_map(|track| {
        let limit = match track.channel {
            Channel::Rotation => tolerance.rotation,
            Channel::Translation => tolerance.translation,
            Channel::Scale => tolerance.scale,
        };
        let track = match track.interpolation {
            Interpolation::Linear => thin(track, limit),
            Interpolation::Step => thin_steps(track),
            Interpolation::CubicSpline => track.clone(),
        };
        let at_rest = track.times.len() == 1
            && track.interpolation != Interpolation::CubicSpline
            && distance(track.channel, rest_value(skeleton, &track), track.values[0]) <= limit;
        (!at_rest).then_some(track)
    });
    Clip {
        name: clip.name.clone(),
        tracks: tracks.collect(),
        ..clip.clone()
    }
}

fn rest_value(skeleton: &Skeleton, track: &Track) -> [f64; 4] {
    let rest = &skeleton.joints[track.joint].rest;
    match track.channel {
        Channel::Rotation => rest.rotation.to_array(),
        Channel::Translation => rest.translation.extend(0.0).to_array(),
        Channel::Scale => rest.scale.extend(0.0).to_array(),
    }
}

/// Radians, metres or factor between two values.
pub(super) fn distance(channel: Channel, a: [f64; 4], b: [f64; 4]) -> f64 {
    let dot: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
    let sign = if channel == Channel::Rotation && dot < 0.0 {
        -1.0
    } else {
        1.0
    };
    let chord2: f64 = a.iter().zip(&b).map(|(a, b)| (a - sign * b).powi(2)).sum();
    let chord = chord2.sqrt();
    match channel {
        Channel::Rotation => 4.0 * (chord / 2.0).min(1.0).asin(),
        Channel::Translation | Channel::Scale => chord,
    }
}

/// The value on the straight way between two keys.
fn between(channel: Channel, from: [f64; 4], to: [f64; 4], t: f64) -> [f64; 4] {
    match channel {
        Channel::Rotation => DQuat::from_array(from)
            .slerp(DQuat::from_array(to), t)
            .to_array(),
        Channel::Translation | Channel::Scale => {
            std::array::from_fn(|at| from[at] + (to[at] - from[at]) * t)
        }
    }
}

/// Keeps the ends, then of every stretch the key that strays most, until none strays too far
/// (Ramer, Douglas and Peucker, in time).
pub(super) fn thin(track: &Track, limit: f64) -> Track {
    let (times, values) = (&track.times, &track.values);
    let last = times.len() - 1;
    let mut keep = vec![false; times.len()];
    keep[0] = true;
    let constant = values
        .iter()
        .all(|&value| distance(track.channel, values[0], value) <= limit);
    if !constant {
        keep[last] = true;
        let mut stretches = vec![(0, last)];
        while let Some((first, end)) = stretches.pop() {
            let stray = |key: usize| {
                let t = (times[key] - times[first]) / (times[end] - times[first]);
                let straight = between(track.channel, values[first], values[end], t);
                distance(track.channel, straight, values[key])
            };
            let worst = (first + 1..end)
                .map(|key| (stray(key), key))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((error, key)) = worst else {
                continue;
            };
            // Near half a turn rounding could send the shorter arc the other way.
            let long = track.channel == Channel::Rotation
                && distance(track.channel, values[first], values[end]) > LONGEST_ARC;
            if error > limit || long {
                let key = if error > limit {
                    key
                } else {
                    (first + end) / 2
                };
                keep[key] = true;
                stretches.extend([(first, key), (key, end)]);
            }
        }
    }
    select(track, &keep)
}

/// Radians that a rotation may turn from one kept key to the next.
const LONGEST_ARC: f64 = 2.5;

fn thin_steps(track: &Track) -> Track {
    let changes = track.values.windows(2).map(|pair| pair[0] != pair[1]);
    let keep: Vec<bool> = std::iter::once(true).chain(changes).collect();
    select(track, &keep)
}

fn select(track: &Track, keep: &[bool]) -> Track {
    let kept = || (0..keep.len()).filter(|&key| keep[key]);
    Track {
        times: kept().map(|key| track.times[key]).collect(),
        values: kept().map(|key| track.values[key]).collect(),
        ..track.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(channel: Channel, values: Vec<[f64; 4]>) -> Track {
        Track {
            joint: 0,
            channel,
            interpolation: Interpolation::Linear,
            times: (0..values.len()).map(|key| key as f64).collect(),
            values,
        }
    }

    #[test]
    fn a_straight_line_keeps_its_ends_and_a_corner_stays() {
        let line = |x: f64| [x, 0.0, 0.0, 0.0];
        let values = vec![line(0.0), line(1.0), line(2.0), line(1.0), line(0.0)];
        let thinned = thin(&track(Channel::Translation, values), 1e-6);
        assert_eq!(thinned.times, [0.0, 2.0, 4.0]);
        let constant = thin(&track(Channel::Translation, vec![line(3.0); 9]), 1e-6);
        assert_eq!(constant.times, [0.0]);
    }

    #[test]
    fn a_steady_turn_of_several_rounds_is_not_shortened() {
        let turn = |angle: f64| DQuat::from_rotation_y(angle).to_array();
        let source = track(
            Channel::Rotation,
            (0..41).map(|k| turn(0.3 * f64::from(k))).collect(),
        );
        let thinned = thin(&source, 1e-6);
        assert!(thinned.times.len() < 20, "{}", thinned.times.len());
        for pair in thinned.values.windows(2) {
            assert!(distance(Channel::Rotation, pair[0], pair[1]) < 3.0);
        }
        let steps = thinned.times.windows(2);
        let turned: f64 = steps.map(|pair| 0.3 * (pair[1] - pair[0])).sum();
        assert!((turned - 12.0).abs() < 1e-9);
    }
}
