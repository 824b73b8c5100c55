//! Local transforms: rest pose, clip sampling, and what is accepted from a caller.

use glam::{Quat, Vec3};

use super::blend::set_rotation;
use crate::asset::{
    Asset, Channel, Clip, Interpolation, LARGEST, LARGEST_WEIGHT, PackedTrack, Track,
};
use crate::math::{Quat4, normalise, slerp};

/// A joint relative to its parent: rotation x y z w, translation (metres), scale.
pub type Local = [f32; 10];

/// A joint relative to its parent, as callers state it. Scale acts first, translation last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Unit quaternion; other lengths are normalised.
    pub rotation: Quat,
    /// Metres.
    pub translation: Vec3,
    /// Factor along each axis.
    pub scale: Vec3,
}

impl Transform {
    /// No change.
    pub const IDENTITY: Self = Self {
        rotation: Quat::IDENTITY,
        translation: Vec3::ZERO,
        scale: Vec3::ONE,
    };
}

impl From<&Local> for Transform {
    fn from(&[rx, ry, rz, rw, tx, ty, tz, sx, sy, sz]: &Local) -> Self {
        Self {
            rotation: Quat::from_xyzw(rx, ry, rz, rw),
            translation: Vec3::new(tx, ty, tz),
            scale: Vec3::new(sx, sy, sz),
        }
    }
}

/// Writes the rest pose. `local: [joints]`, old contents do not matter. O(joints)
pub fn rest(asset: &Asset<'_>, local: &mut [Local]) {
    for (local, rest) in local.iter_mut().zip(asset.rest) {
        *local = *rest;
    }
}

/// Takes over a caller's pose and returns how many joints were not usable.
///
/// A joint whose numbers are not finite, whose rotation has no direction, whose translation
/// exceeds 1e6 m or whose scale exceeds 1e3 keeps its old transform; joints beyond the end of
/// `pose` keep theirs too. `local: [joints]`, old contents matter. O(joints)
pub fn accept(pose: &[Transform], local: &mut [Local]) -> usize {
    let mut refused = 0;
    for (local, pose) in local.iter_mut().zip(pose) {
        let rotation = normalise(pose.rotation.to_array());
        let [tx, ty, tz] = pose.translation.to_array();
        let [sx, sy, sz] = pose.scale.to_array();
        let within = |value: f32, limit: f32| (-limit..=limit).contains(&value);
        let sound = [tx, ty, tz].iter().all(|&value| within(value, LARGEST))
            && [sx, sy, sz]
                .iter()
                .all(|&value| within(value, LARGEST_SCALE));
        match rotation {
            Some([rx, ry, rz, rw]) if sound => {
                *local = [rx, ry, rz, rw, tx, ty, tz, sx, sy, sz];
            }
            _ => refused += 1,
        }
    }
    refused
}

/// Larger factors would leave the range in which no product of a frame overflows.
const LARGEST_SCALE: f32 = 1e3;

/// Writes what `clip` states at `seconds` over `local`, leaving joints and channels it does not
/// animate alone.
///
/// Times before the first key give the first value, times after the last the last.
/// `local: [joints]`, old contents stay where the clip is silent. O(tracks log keys)
pub fn sample(clip: &Clip<'_>, seconds: f32, local: &mut [Local]) {
    for track in clip.tracks() {
        let Some(local) = local.get_mut(track.target) else {
            continue;
        };
        let [rx, ry, rz, rw, tx, ty, tz, sx, sy, sz] = local;
        match track.channel {
            Channel::Rotation => {
                if let Some(value) = sample_rotation(&track, seconds) {
                    [*rx, *ry, *rz, *rw] = value;
                }
            }
            Channel::Translation => {
                if let Some(value) = sample_numbers(&track, seconds) {
                    [*tx, *ty, *tz] = value;
                }
            }
            Channel::Scale => {
                if let Some(value) = sample_numbers(&track, seconds) {
                    [*sx, *sy, *sz] = value;
                }
            }
            Channel::MorphWeight => {}
        }
    }
    sample_packed(clip, seconds, local);
}

/// The compressed tracks of a clip, linear between keys. O(tracks log keys)
fn sample_packed(clip: &Clip<'_>, seconds: f32, local: &mut [Local]) {
    for track in clip.packed_tracks() {
        let Some(local) = local.get_mut(track.joint) else {
            continue;
        };
        let (key, fraction) = find_frame(&track, clip.sample_period, seconds);
        if track.channel == Channel::Rotation {
            let between = track
                .rotation(key)
                .and_then(|from| match track.rotation(key + 1) {
                    Some(to) if fraction > 0.0 => normalise(slerp(from, to, fraction)),
                    _ => normalise(from),
                });
            if let Some(turn) = between {
                set_rotation(local, turn);
            }
        } else if let Some(mut value) = track.vector(key) {
            if fraction > 0.0
                && let Some(next) = track.vector(key + 1)
            {
                for (value, next) in value.iter_mut().zip(next) {
                    *value += (next - *value) * fraction;
                }
            }
            let [_, _, _, _, tx, ty, tz, sx, sy, sz] = local;
            if track.channel == Channel::Translation {
                [*tx, *ty, *tz] = value;
            } else {
                [*sx, *sy, *sz] = value;
            }
        }
    }
}

/// The key at or before a time, and how far that lies toward the next one, in [0, 1).
fn find_frame(track: &PackedTrack<'_>, period: f32, seconds: f32) -> (usize, f32) {
    let time = |frame: u16| f32::from(frame) * period;
    let after = track
        .frames
        .partition_point(|&frame| time(frame) <= seconds);
    let key = after.saturating_sub(1);
    match (track.frames.get(key), track.frames.get(after)) {
        (Some(&start), Some(&end)) if after > 0 => {
            let (start, end) = (time(start), time(end));
            (key, (seconds - start) / (end - start))
        }
        _ => (key, 0.0),
    }
}

/// Writes the morph weights at rest. `weights: [morphs]`, old contents do not matter. O(morphs)
pub fn rest_morphs(asset: &Asset<'_>, weights: &mut [f32]) {
    for (weight, &[_, _, rest, _]) in weights.iter_mut().zip(asset.morphs) {
        *weight = f32::from_bits(rest);
    }
}

/// Takes over a caller's morph weights and returns how many were not usable.
///
/// A weight that is not finite or exceeds 1e3 keeps its old value, as do those beyond the end.
/// `weights: [morphs]`, old contents matter. O(morphs)
pub fn accept_morphs(morphs: &[f32], weights: &mut [f32]) -> usize {
    let mut refused = 0;
    for (weight, &morph) in weights.iter_mut().zip(morphs) {
        if (-LARGEST_WEIGHT..=LARGEST_WEIGHT).contains(&morph) {
            *weight = morph;
        } else {
            refused += 1;
        }
    }
    refused
}

/// Writes the morph weights that `clip` states at `seconds` over `weights`, leaving others alone.
/// `weights: [morphs]`. O(tracks log keys)
pub fn sample_morphs(clip: &Clip<'_>, seconds: f32, weights: &mut [f32]) {
    for track in clip.tracks() {
        if track.channel == Channel::MorphWeight
            && let Some(weight) = weights.get_mut(track.target)
            && let Some([value]) = sample_numbers(&track, seconds)
        {
            // A spline may overshoot its keys.
            *weight = value.clamp(-LARGEST_WEIGHT, LARGEST_WEIGHT);
        }
    }
}

/// Where a time lies among a track's keys.
struct Span {
    key: usize,
    /// Position between `key` and the one after, in [0, 1).
    fraction: f32,
    /// Seconds from `key` to the one after.
    seconds: f32,
}

fn find(times: &[f32], seconds: f32) -> Span {
    let after = times.partition_point(|&time| time <= seconds);
    let key = after.saturating_sub(1);
    match (times.get(key), times.get(after)) {
        (Some(&start), Some(&end)) if after > 0 => {
            let length = end - start;
            Span {
                key,
                fraction: (seconds - start) / length,
                seconds: length,
            }
        }
        _ => Span {
            key,
            fraction: 0.0,
            seconds: 0.0,
        },
    }
}

fn sample_rotation(track: &Track<'_>, seconds: f32) -> Option<Quat4> {
    let span = find(track.times, seconds);
    if track.interpolation == Interpolation::CubicSpline {
        let blended = spline::<4>(track.values.as_chunks().0, &span)?;
        // A spline through opposite quaternions can pass through zero; its key then serves.
        return normalise(blended).or_else(|| normalise(key_value(track.values, span.key)?));
    }
    let keys = track.values.as_chunks::<4>().0;
    let from = *keys.get(span.key)?;
    match keys.get(span.key + 1) {
        Some(&to) if span.fraction > 0.0 && track.interpolation == Interpolation::Linear => {
            normalise(slerp(from, to, span.fraction))
        }
        _ => Some(from),
    }
}

fn sample_numbers<const N: usize>(track: &Track<'_>, seconds: f32) -> Option<[f32; N]> {
    let span = find(track.times, seconds);
    if track.interpolation == Interpolation::CubicSpline {
        return spline::<N>(track.values.as_chunks().0, &span);
    }
    let keys = track.values.as_chunks::<N>().0;
    let from = *keys.get(span.key)?;
    match keys.get(span.key + 1) {
        Some(to) if span.fraction > 0.0 && track.interpolation == Interpolation::Linear => {
            let mut value = from;
            for (value, to) in value.iter_mut().zip(to) {
                *value += (to - *value) * span.fraction;
            }
            Some(value)
        }
        _ => Some(from),
    }
}

/// The value of a spline's key: the middle one of three.
fn key_value(values: &[f32], key: usize) -> Option<Quat4> {
    values.as_chunks::<4>().0.get(key * 3 + 1).copied()
}

/// Hermite spline (glTF 2.0, appendix C). `keys`: in-tangent, value, out-tangent of each key.
fn spline<const N: usize>(keys: &[[f32; N]], span: &Span) -> Option<[f32; N]> {
    let at = span.key * 3;
    let value = *keys.get(at + 1)?;
    let (Some(out), Some(next_in), Some(next)) =
        (keys.get(at + 2), keys.get(at + 3), keys.get(at + 4))
    else {
        return Some(value);
    };
    let t = span.fraction;
    let (t2, t3) = (t * t, t * t * t);
    let (h00, h01) = (2.0 * t3 - 3.0 * t2 + 1.0, 3.0 * t2 - 2.0 * t3);
    let (h10, h11) = ((t3 - 2.0 * t2 + t) * span.seconds, (t3 - t2) * span.seconds);
    let mut blended = value;
    let others = out.iter().zip(next_in).zip(next);
    for (value, ((out, next_in), next)) in blended.iter_mut().zip(others) {
        *value = h00 * *value + h10 * out + h01 * next + h11 * next_in;
    }
    Some(blended)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: &[f32], b: &[f32]) {
        assert_eq!(a.len(), b.len());
        assert!(
            a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6),
            "{a:?} {b:?}"
        );
    }

    fn track<'a>(
        channel: Channel,
        interpolation: Interpolation,
        times: &'a [f32],
        values: &'a [f32],
    ) -> Track<'a> {
        Track {
            target: 0,
            channel,
            interpolation,
            times,
            values,
        }
    }

    #[test]
    fn a_step_holds_and_a_line_does_not() {
        let values = [0.0, 0.0, 0.0, 2.0, 4.0, 6.0];
        let times = [1.0, 3.0];
        let step = track(Channel::Translation, Interpolation::Step, &times, &values);
        near(&sample_numbers::<3>(&step, 2.5).unwrap(), &[0.0; 3]);
        near(&sample_numbers::<3>(&step, 3.0).unwrap(), &[2.0, 4.0, 6.0]);
        let line = track(Channel::Translation, Interpolation::Linear, &times, &values);
        near(&sample_numbers::<3>(&line, 0.0).unwrap(), &[0.0; 3]);
        near(&sample_numbers::<3>(&line, 1.5).unwrap(), &[0.5, 1.0, 1.5]);
        near(&sample_numbers::<3>(&line, 9.0).unwrap(), &[2.0, 4.0, 6.0]);
        near(&sample_numbers::<3>(&line, f32::NAN).unwrap(), &[0.0; 3]);
    }

    #[test]
    fn rotations_take_the_shorter_arc() {
        let s = core::f32::consts::FRAC_1_SQRT_2;
        let values = [0.0, 0.0, 0.0, 1.0, -s, 0.0, 0.0, -s];
        let turn = track(
            Channel::Rotation,
            Interpolation::Linear,
            &[0.0, 1.0],
            &values,
        );
        let half = sample_rotation(&turn, 0.5).unwrap();
        let eighth = core::f32::consts::FRAC_PI_8;
        near(&half, &[libm::sinf(eighth), 0.0, 0.0, libm::cosf(eighth)]);
    }

    #[test]
    fn a_spline_passes_its_keys_with_their_tangents() {
        // One number in use: value 1 leaving at slope 2, value 5 arriving at slope 0, 2 s apart.
        let key = |a: f32| [a, 0.0, 0.0];
        let values = [key(9.0), key(1.0), key(2.0), key(0.0), key(5.0), key(9.0)];
        let spline = track(
            Channel::Translation,
            Interpolation::CubicSpline,
            &[0.0, 2.0],
            values.as_flattened(),
        );
        near(&sample_numbers::<3>(&spline, 0.0).unwrap(), &key(1.0));
        near(&sample_numbers::<3>(&spline, 2.0).unwrap(), &key(5.0));
        // h00 = h01 = 1/2, h10 = 1/8: 0.5 + 0.125 * 2 * 2 + 2.5.
        near(&sample_numbers::<3>(&spline, 1.0).unwrap(), &key(3.5));
    }

    #[test]
    fn unusable_transforms_leave_the_old_ones() {
        let old = [0.0, 0.0, 0.0, 1.0, 7.0, 0.0, 0.0, 1.0, 1.0, 1.0];
        let good = Transform {
            translation: Vec3::X,
            ..Transform::IDENTITY
        };
        let bad = [
            Transform {
                translation: Vec3::NAN,
                ..good
            },
            Transform {
                rotation: Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
                ..good
            },
            Transform {
                scale: Vec3::splat(f32::INFINITY),
                ..good
            },
            Transform {
                translation: Vec3::splat(1e30),
                ..good
            },
        ];
        let mut local = [old; 5];
        let pose = [bad[0], bad[1], good, bad[2], bad[3]];
        assert_eq!(accept(&pose, &mut local), 4);
        assert_eq!(local[0], old);
        near(
            &local[2],
            &[0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        );
    }
}
