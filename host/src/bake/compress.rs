//! Clips into compressed tracks: 16-bit keys, as few as a tolerance in joint space allows.
//!
//! Keys of linear tracks are left out (Ramer, Douglas and Peucker, in time) and the rest rounded to
//! 48 bits. How far each joint's track may stray follows from how far it reaches: an angle counts
//! times the distance to the farthest joint below, plus [`SHELL`]. One common factor of these
//! bounds is then raised as far as the measured error of all joints in all frames allows.

use glam::{DAffine3, DQuat, DVec3};
use sinew_core::asset::unpack_rotation;

use super::clips::thin;
use crate::model::{Channel, Clip, Interpolation, Skeleton, Track};
use crate::reference::pose::sample;

/// Skin lies up to so far from its joint, metres; the error is measured there too.
pub const SHELL: f64 = 0.1;
/// Frames that a key's number can name.
const MOST_FRAMES: usize = 1 << 16;
/// Halvings when the factor is sought.
const HALVINGS: usize = 9;

/// One compressed track, as `core/SPEC.md` describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedTrack {
    /// Joint.
    pub joint: usize,
    /// What it moves.
    pub channel: Channel,
    /// `[keys]`
    pub frames: Vec<u16>,
    /// Lowest value and extent; zero for rotations.
    pub range: [f32; 6],
    /// `[keys]`
    pub values: Vec<[u16; 3]>,
}

/// What compression did to a clip.
#[derive(Clone, Debug, PartialEq)]
pub struct CompressionReport {
    /// The clip.
    pub name: String,
    /// Largest distance between joints, or points [`SHELL`] around them, before and after, metres.
    pub error: f64,
    /// Bytes of its compressed tracks, table rows included.
    pub bytes: usize,
    /// Bytes of the same channels with 16 bits a number and a value in every frame.
    pub raw_bytes: usize,
    /// Keys that stayed.
    pub keys: usize,
}

/// Moves the linear tracks of a clip, where they allow it, into compressed ones; `None` where the
/// clip has none, is not sampled evenly, is too long, or the tolerance (metres) is below what 16
/// bits hold. Then the clip stays as it is. O(frames x joints + keys log keys), ten times
pub fn compress(
    clip: &mut Clip,
    skeleton: &Skeleton,
    tolerance: f64,
) -> Option<(Vec<PackedTrack>, CompressionReport)> {
    // The core knows the period as 32 bits.
    let period = f64::from(clip.sample_period? as f32);
    let frame_count = (clip.duration / period + 0.5).floor() as usize + 1;
    if !(period > 0.0 && (2..=MOST_FRAMES).contains(&frame_count) && tolerance > 0.0) {
        return None;
    }
    let on_grid = |track: &Track| {
        let whole = |time: &f64| {
            let frame = time / period;
            (frame - frame.round()).abs() < 0.01
        };
        track.interpolation == Interpolation::Linear && track.times.iter().all(whole)
    };
    let whole = clip.tracks.clone();
    let (tracks, kept): (Vec<Track>, Vec<Track>) = clip.tracks.drain(..).partition(on_grid);
    clip.tracks = kept;
    if tracks.is_empty() {
        return None;
    }
    let work = Work::new(clip, tracks, skeleton, period, frame_count);
    let (mut low, mut high) = (0.0, 2.0);
    let mut best = None;
    for step in 0..HALVINGS {
        let factor = if step == 0 { 0.05 } else { (low + high) / 2.0 };
        let packed = work.pack(factor * tolerance);
        let error = work.error(&packed);
        if error <= tolerance {
            low = factor;
            best = Some((packed, error));
        } else if step == 0 {
            break;
        } else {
            high = factor;
        }
    }
    let Some((packed, error)) = best else {
        clip.tracks = whole;
        return None;
    };
    let report = CompressionReport {
        name: clip.name.clone(),
        error,
        bytes: packed.iter().map(bytes).sum(),
        raw_bytes: work.tracks.iter().map(|t| frame_count * raw_bytes(t)).sum(),
        keys: packed.iter().map(|track| track.frames.len()).sum(),
    };
    Some((packed, report))
}

fn bytes(track: &PackedTrack) -> usize {
    let range = if track.channel == Channel::Rotation {
        0
    } else {
        24
    };
    16 + range + 8 * track.frames.len()
}

fn raw_bytes(track: &Track) -> usize {
    if track.channel == Channel::Rotation {
        8
    } else {
        6
    }
}

struct Work<'a> {
    /// The clip without what is compressed.
    rest: &'a Clip,
    tracks: Vec<Track>,
    skeleton: &'a Skeleton,
    period: f64,
    frame_count: usize,
    /// `[joints]`: farthest that something below lies, metres.
    reach: Vec<f64>,
    /// `[frames][joints]`
    truth: Vec<Vec<DAffine3>>,
}

impl<'a> Work<'a> {
    fn new(
        rest: &'a Clip,
        tracks: Vec<Track>,
        skeleton: &'a Skeleton,
        period: f64,
        frame_count: usize,
    ) -> Self {
        let joints = &skeleton.joints;
        let mut reach = vec![SHELL; joints.len()];
        for (at, joint) in joints.iter().enumerate().rev() {
            if let Some(parent) = joint.parent {
                let length = joint.rest.translation.length();
                reach[parent] = reach[parent].max(length + reach[at]);
            }
        }
        let mut work = Self {
            rest,
            tracks: Vec::new(),
            skeleton,
            period,
            frame_count,
            reach,
            truth: Vec::new(),
        };
        work.truth = work.poses(&tracks);
        work.tracks = tracks
            .into_iter()
            .map(|track| work.every_frame(track))
            .collect();
        work
    }

    /// The track with a key in each frame, rotations on one side, as far as its keys go.
    fn every_frame(&self, track: Track) -> Track {
        let alone = Clip {
            tracks: vec![track.clone()],
            ..Clip::default()
        };
        let mut last = DQuat::IDENTITY;
        let value = |frame: usize| {
            let pose = sample(self.skeleton, &alone, frame as f64 * self.period);
            let local = &pose[track.joint];
            match track.channel {
                Channel::Translation => local.translation.extend(0.0).to_array(),
                Channel::Scale => local.scale.extend(0.0).to_array(),
                Channel::Rotation => {
                    let turn = local.rotation;
                    last = if last.dot(turn) < 0.0 { -turn } else { turn };
                    last.to_array()
                }
            }
        };
        Track {
            times: (0..self.frame_count).map(|frame| frame as f64).collect(),
            values: (0..self.frame_count).map(value).collect(),
            ..track
        }
    }

    /// Model-space matrices of every frame, with the rest of the clip.
    fn poses(&self, tracks: &[Track]) -> Vec<Vec<DAffine3>> {
        let mut clip = self.rest.clone();
        clip.tracks.extend_from_slice(tracks);
        let pose = |frame: usize| {
            let local = sample(self.skeleton, &clip, frame as f64 * self.period);
            self.skeleton.model(&local)
        };
        (0..self.frame_count).map(pose).collect()
    }

    /// Tracks whose joints stray by about `bound` metres.
    fn pack(&self, bound: f64) -> Vec<PackedTrack> {
        let of = |track: &Track| {
            let rest = &self.skeleton.joints[track.joint].rest;
            let (limit, rest) = match track.channel {
                Channel::Rotation => (bound / self.reach[track.joint], rest.rotation.to_array()),
                Channel::Translation => (bound, rest.translation.extend(0.0).to_array()),
                Channel::Scale => (
                    bound / self.reach[track.joint],
                    rest.scale.extend(0.0).to_array(),
                ),
            };
            let thinned = thin(track, limit);
            let still = thinned.times.len() == 1
                && super::clips::distance(track.channel, rest, thinned.values[0]) <= limit;
            (!still).then(|| quantise(&thinned))
        };
        self.tracks.iter().filter_map(of).collect()
    }

    /// Largest distance over all frames and joints, metres.
    fn error(&self, packed: &[PackedTrack]) -> f64 {
        let tracks: Vec<Track> = packed.iter().map(|track| self.unpack(track)).collect();
        let poses = self.poses(&tracks);
        let mut worst: f64 = 0.0;
        for (truth, pose) in self.truth.iter().zip(&poses) {
            for (a, b) in truth.iter().zip(pose) {
                for arm in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
                    let at = SHELL * arm;
                    worst = worst.max(a.transform_point3(at).distance(b.transform_point3(at)));
                }
            }
        }
        worst
    }

    fn unpack(&self, track: &PackedTrack) -> Track {
        Track {
            joint: track.joint,
            channel: track.channel,
            interpolation: Interpolation::Linear,
            times: track
                .frames
                .iter()
                .map(|&frame| f64::from(frame) * self.period)
                .collect(),
            values: track.values.iter().map(|&key| track.value(key)).collect(),
        }
    }
}

impl PackedTrack {
    fn value(&self, key: [u16; 3]) -> [f64; 4] {
        if self.channel == Channel::Rotation {
            let turn = DQuat::from_array(unpack_rotation(key).map(f64::from));
            return turn.normalize().to_array();
        }
        let axis = |at: usize| {
            let (low, size) = (f64::from(self.range[at]), f64::from(self.range[at + 3]));
            low + size * f64::from(key[at]) / 65535.0
        };
        [axis(0), axis(1), axis(2), 0.0]
    }
}

/// Keys at whole frames, rounded.
fn quantise(track: &Track) -> PackedTrack {
    let frames = track.times.iter().map(|&frame| frame as u16).collect();
    let mut range = [0.0_f32; 6];
    let values = if track.channel == Channel::Rotation {
        let turns = track.values.iter();
        turns
            .map(|&turn| pack_rotation(DQuat::from_array(turn)))
            .collect()
    } else {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for value in &track.values {
            for axis in 0..3 {
                low[axis] = low[axis].min(value[axis]);
                high[axis] = high[axis].max(value[axis]);
            }
        }
        for axis in 0..3 {
            range[axis] = low[axis] as f32;
            range[axis + 3] = (high[axis] - low[axis]) as f32;
        }
        let code = |value: &[f64; 4]| {
            std::array::from_fn(|axis| {
                let (low, size) = (f64::from(range[axis]), f64::from(range[axis + 3]));
                let share = if size > 0.0 {
                    (value[axis] - low) / size
                } else {
                    0.0
                };
                (share.clamp(0.0, 1.0) * 65535.0).round() as u16
            })
        };
        track.values.iter().map(code).collect()
    };
    PackedTrack {
        joint: track.joint,
        channel: track.channel,
        frames,
        range,
        values,
    }
}

/// Three components of 15 bits, all but the largest, which is made positive.
fn pack_rotation(turn: DQuat) -> [u16; 3] {
    let all = turn.normalize().to_array();
    let largest = (0..4).max_by(|&a, &b| all[a].abs().total_cmp(&all[b].abs()));
    let largest = largest.unwrap_or(3);
    let sign = if all[largest] < 0.0 { -1.0 } else { 1.0 };
    let mut words = (0..4).filter(|&at| at != largest).map(|at| {
        let share = (sign * all[at] * std::f64::consts::SQRT_2 + 1.0) / 2.0;
        (share.clamp(0.0, 1.0) * 32767.0).round() as u16
    });
    let mut next = || words.next().unwrap_or(0);
    let (a, b, c) = (next(), next(), next());
    let largest = largest as u16;
    [a | (largest & 1) << 15, b | (largest >> 1) << 15, c]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Joint, Transform};

    #[test]
    fn rotations_survive_48_bits() {
        let mut worst: f64 = 0.0;
        for step in 0..5000 {
            let at = f64::from(step);
            let axis = DVec3::new((at * 0.7).sin(), (at * 1.3).cos(), (at * 0.31).sin());
            let turn = DQuat::from_scaled_axis(axis * 3.0);
            let back = unpack_rotation(pack_rotation(turn)).map(f64::from);
            let back = DQuat::from_array(back).normalize();
            worst = worst.max(2.0 * (1.0 - back.dot(turn).abs().min(1.0)).sqrt() * 2f64.sqrt());
        }
        assert!(worst < 1.5e-4, "{worst}");
    }

    /// An arm of three joints that swings.
    fn swinging() -> (Clip, Skeleton) {
        let joint = |parent| Joint {
            name: format!("{parent:?}"),
            parent,
            rest: Transform {
                translation: DVec3::X * 0.3,
                ..Transform::IDENTITY
            },
        };
        let skeleton = Skeleton {
            joints: vec![joint(None), joint(Some(0)), joint(Some(1))],
        };
        let times: Vec<f64> = (0..600).map(|frame| f64::from(frame) / 120.0).collect();
        let track = |joint: usize, channel, value: &dyn Fn(f64) -> [f64; 4]| Track {
            joint,
            channel,
            interpolation: Interpolation::Linear,
            times: times.clone(),
            values: times.iter().map(|&time| value(time)).collect(),
        };
        let swing = |phase: f64| {
            move |time: f64| {
                let angle = 1.2 * (3.0 * time + phase).sin() + 0.3 * (11.0 * time).cos();
                DQuat::from_rotation_z(angle).to_array()
            }
        };
        let clip = Clip {
            name: "swing".into(),
            tracks: vec![
                track(0, Channel::Translation, &|time| {
                    [time, time.sin(), 0.0, 0.0]
                }),
                track(0, Channel::Rotation, &swing(0.0)),
                track(1, Channel::Rotation, &swing(1.0)),
                track(2, Channel::Rotation, &|_| DQuat::IDENTITY.to_array()),
            ],
            duration: 599.0 / 120.0,
            sample_period: Some(1.0 / 120.0),
            ..Clip::default()
        };
        (clip, skeleton)
    }

    #[test]
    fn the_tolerance_is_kept_and_used() {
        let mut last = usize::MAX;
        for tolerance in [2e-4, 1e-3, 5e-3] {
            let (mut clip, skeleton) = swinging();
            let (packed, report) = compress(&mut clip, &skeleton, tolerance).unwrap();
            assert!(clip.tracks.is_empty());
            assert_eq!(packed.len(), 3, "the still joint needs no track");
            assert!(report.error <= tolerance && report.error > 0.3 * tolerance);
            assert!(report.bytes < last && report.bytes < report.raw_bytes);
            last = report.bytes;
        }
    }

    #[test]
    fn what_cannot_be_compressed_stays() {
        let (mut clip, skeleton) = swinging();
        let whole = clip.clone();
        assert!(compress(&mut clip, &skeleton, 1e-7).is_none());
        assert_eq!(clip, whole);
        clip.sample_period = None;
        assert!(compress(&mut clip, &skeleton, 1e-3).is_none());
        assert_eq!(clip.tracks, whole.tracks);
    }
}
