//! Clip sampling and forward kinematics.

use glam::{DAffine3, DQuat, DVec3};

use crate::model::{Channel, Clip, Interpolation, Skeleton, Track, Transform};

/// Local transforms `[joints]` of a clip at a time (glTF 2.0, appendix C); the rest pose where the
/// clip is silent.
#[must_use]
pub fn sample(skeleton: &Skeleton, clip: &Clip, seconds: f64) -> Vec<Transform> {
    let mut local = skeleton.rest();
    for track in &clip.tracks {
        let value = sample_track(track, seconds);
        let local = &mut local[track.joint];
        match track.channel {
            Channel::Rotation => local.rotation = DQuat::from_array(value).normalize(),
            Channel::Translation => local.translation = DVec3::from_slice(&value),
            Channel::Scale => local.scale = DVec3::from_slice(&value),
        }
    }
    local
}

fn sample_track(track: &Track, seconds: f64) -> [f64; 4] {
    let times = &track.times;
    let spline = track.interpolation == Interpolation::CubicSpline;
    let value = |key: usize| track.values[if spline { 3 * key + 1 } else { key }];
    let after = times.partition_point(|&time| time <= seconds);
    if after == 0 {
        return value(0);
    }
    if after == times.len() {
        return value(times.len() - 1);
    }
    let (key, length) = (after - 1, times[after] - times[after - 1]);
    let t = (seconds - times[key]) / length;
    let (from, to) = (value(key), value(after));
    match track.interpolation {
        Interpolation::Step => from,
        Interpolation::Linear if track.channel == Channel::Rotation => DQuat::from_array(from)
            .slerp(DQuat::from_array(to), t)
            .to_array(),
        Interpolation::Linear => std::array::from_fn(|at| from[at] + (to[at] - from[at]) * t),
        Interpolation::CubicSpline => {
            let (out, next_in) = (track.values[3 * key + 2], track.values[3 * after]);
            let (t2, t3) = (t * t, t * t * t);
            std::array::from_fn(|at| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * from[at]
                    + length * (t3 - 2.0 * t2 + t) * out[at]
                    + (3.0 * t2 - 2.0 * t3) * to[at]
                    + length * (t3 - t2) * next_in[at]
            })
        }
    }
}

/// Model-space matrices `[joints]` (Mažrimas & Beinaravičius, section 2: `M_i`).
#[must_use]
pub fn model(skeleton: &Skeleton, local: &[Transform]) -> Vec<DAffine3> {
    skeleton.model(local)
}
