//! How the actor moves: a clip, made smooth, brought into the volume.
//!
//! Keys of 30 Hz joined by straight lines would jerk at each key, and flesh and filters would
//! answer to the jerks. So the clip is sampled at its own period and joined by cubic splines,
//! which have continuous accelerations.

use glam::{DAffine3, DQuat, DVec3};

use super::StudioError;
use super::error::within;
use crate::fit::{Humanoid, Which};
use crate::model::{Avatar, Clip, Skeleton, Transform};
use crate::reference::pose::sample;

/// Seconds between spline keys where the clip is not sampled evenly.
const DEFAULT_PERIOD: f64 = 1.0 / 60.0;
/// Most keys of a clip: nine hours at 30 Hz.
const MOST_KEYS: f64 = (1 << 20) as f64;
/// How far from its mean place the hips may go before the floor moves under the actor, metres.
const AREA: f64 = 0.8;
/// Components of a transform: rotation, translation, scale.
const WIDTH: usize = 10;

/// How a clip is performed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// Seconds at the start in the body's rest pose, in which most of the skin is in sight.
    pub hold: f64,
    /// Seconds from there into the clip.
    pub blend: f64,
    /// 2 is twice as fast as the clip.
    pub speed: f64,
    /// Take the mean horizontal velocity away where the actor would leave the volume. Only the
    /// frame of reference changes: accelerations stay.
    pub treadmill: bool,
    /// Stop after this many seconds, if the clip lasts longer.
    pub seconds: Option<f64>,
}

impl Default for Direction {
    fn default() -> Self {
        Self {
            hold: 0.4,
            blend: 0.8,
            speed: 1.0,
            treadmill: true,
            seconds: None,
        }
    }
}

/// A motion that can be asked for any time.
#[derive(Clone, Debug)]
pub struct Performance<'a> {
    skeleton: &'a Skeleton,
    direction: Direction,
    /// Joints that the clip moves, each with its spline.
    splines: Vec<(usize, Spline)>,
    rest: Vec<Transform>,
    /// Where the actor stands before the clip begins.
    start: Vec<Transform>,
    clip_duration: f64,
    /// Taken from every position, at clip time 0 and per second of it.
    place: DVec3,
    drift: DVec3,
    /// How far the hips go from the middle of the volume, metres.
    reach: f64,
}

impl<'a> Performance<'a> {
    /// A clip on the skeleton of a body.
    ///
    /// # Errors
    /// A clip for another skeleton or of more than 2^20 keys, a setting out of its range.
    pub fn new(avatar: &'a Avatar, clip: &Clip, direction: Direction) -> Result<Self, StudioError> {
        within("hold", direction.hold, 0.0, 60.0, "between 0 and 60 s")?;
        within("blend", direction.blend, 0.0, 60.0, "between 0 and 60 s")?;
        within("speed", direction.speed, 0.05, 20.0, "between 0.05 and 20")?;
        if let Some(seconds) = direction.seconds {
            within("seconds", seconds, 0.0, 1e6, "between 0 and 1e6 s")?;
        }
        let skeleton = &avatar.skeleton;
        let joint_count = skeleton.joints.len();
        if let Some(track) = clip.tracks.iter().find(|track| track.joint >= joint_count) {
            return Err(StudioError::ForeignClip {
                clip: clip.name.clone(),
                joint: track.joint,
                joint_count,
            });
        }
        let period = clip.sample_period.filter(|period| *period > 0.0);
        let period = period.unwrap_or(DEFAULT_PERIOD);
        within(
            "clip duration over its sample period",
            clip.duration / period,
            0.0,
            MOST_KEYS,
            "at most 2^20 keys",
        )?;
        let key_count = (clip.duration / period - 1e-6).ceil() as usize + 1;
        let keys: Vec<Vec<Transform>> = (0..key_count)
            .map(|key| sample(skeleton, clip, key as f64 * period))
            .collect();
        let mut moved: Vec<usize> = clip.tracks.iter().map(|track| track.joint).collect();
        moved.dedup();
        let spline = |joint: usize| Spline::new(period, keys.iter().map(|pose| pose[joint]));
        let splines = moved.iter().map(|&joint| (joint, spline(joint))).collect();

        let root = Humanoid::new(skeleton, Which::Target).map_or(0, |human| human.hips);
        let mut performance = Self {
            skeleton,
            direction,
            splines,
            rest: skeleton.rest(),
            start: Vec::new(),
            clip_duration: direction.seconds.map_or(clip.duration, |seconds| {
                let filmed = (seconds - direction.hold).max(0.0) * direction.speed;
                filmed.min(clip.duration)
            }),
            place: DVec3::ZERO,
            drift: DVec3::ZERO,
            reach: 0.0,
        };
        performance.settle(root, period);
        performance.start = performance.standing(root);
        Ok(performance)
    }

    /// Finds what brings the actor into the middle of the volume.
    fn settle(&mut self, root: usize, period: f64) {
        let count = (self.clip_duration / period - 1e-6).ceil() as usize + 1;
        let flat = |key: usize| {
            let pose = self.clip_pose((key as f64 * period).min(self.clip_duration));
            let at = self.skeleton.model(&pose)[root].translation;
            DVec3::new(at.x, 0.0, at.z)
        };
        let path: Vec<DVec3> = (0..count).map(flat).collect();
        let furthest = |place: DVec3, drift: DVec3| {
            let away = |(key, at): (usize, &DVec3)| {
                at.distance(place + drift * (key as f64 * period).min(self.clip_duration))
            };
            path.iter().enumerate().map(away).fold(0.0, f64::max)
        };
        let low = path.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = path.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let (mut place, mut drift) = ((low + high) / 2.0, DVec3::ZERO);
        let mut reach = furthest(place, drift);
        if self.direction.treadmill && reach > AREA && self.clip_duration > 0.0 {
            let walked = (path[count - 1] - path[0]) / self.clip_duration;
            let start =
                path.iter().sum::<DVec3>() / count as f64 - walked * (self.clip_duration / 2.0);
            let on_it = furthest(start, walked);
            if on_it < reach {
                (place, drift, reach) = (start, walked, on_it);
            }
        }
        (self.place, self.drift, self.reach) = (place, drift, reach);
    }

    /// The rest pose, turned and moved to where the clip begins.
    fn standing(&self, root: usize) -> Vec<Transform> {
        let rest = self.skeleton.model(&self.rest)[root];
        let first = self.skeleton.model(&self.clip_pose(0.0))[root];
        let turn = rotation(&first) * rotation(&rest).inverse();
        let yaw = DQuat::from_xyzw(0.0, turn.y, 0.0, turn.w);
        let yaw = if yaw.length_squared() > 1e-9 {
            yaw.normalize()
        } else {
            DQuat::IDENTITY
        };
        let shift = first.translation - yaw * rest.translation;
        let shift = DVec3::new(shift.x, 0.0, shift.z);
        let mut start = self.rest.clone();
        for (local, joint) in start.iter_mut().zip(&self.skeleton.joints) {
            if joint.parent.is_none() {
                local.rotation = yaw * local.rotation;
                local.translation = yaw * local.translation + shift;
            }
        }
        start
    }

    /// Seconds from start to end.
    #[must_use]
    pub fn duration(&self) -> f64 {
        let whole = self.direction.hold + self.clip_duration / self.direction.speed;
        whole.min(self.direction.seconds.unwrap_or(whole))
    }

    /// How far the hips go from the middle of the volume, metres.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Whether the floor moves under the actor.
    #[must_use]
    pub fn is_on_treadmill(&self) -> bool {
        self.drift != DVec3::ZERO
    }

    /// The skeleton that moves.
    #[must_use]
    pub fn skeleton(&self) -> &Skeleton {
        self.skeleton
    }

    fn clip_pose(&self, seconds: f64) -> Vec<Transform> {
        let mut pose = self.rest.clone();
        for (joint, spline) in &self.splines {
            pose[*joint] = spline.at(seconds);
        }
        pose
    }

    /// Model-space matrices `[joints]`, metres, at a time; before 0 and after the end the actor
    /// stands still. O(joints)
    #[must_use]
    pub fn pose(&self, seconds: f64) -> Vec<DAffine3> {
        let clip_seconds = (seconds - self.direction.hold).max(0.0) * self.direction.speed;
        let clip_seconds = clip_seconds.min(self.clip_duration);
        let mut pose = self.clip_pose(clip_seconds);
        let through = if self.direction.blend > 0.0 {
            (clip_seconds / self.direction.speed / self.direction.blend).min(1.0)
        } else {
            1.0
        };
        // The drift fades in with the clip: a floor that starts at once would kick the flesh.
        let weight = smooth_step(through);
        if weight < 1.0 {
            for (local, start) in pose.iter_mut().zip(&self.start) {
                local.translation = start.translation.lerp(local.translation, weight);
                local.rotation = start.rotation.slerp(local.rotation, weight);
                local.scale = start.scale.lerp(local.scale, weight);
            }
        }
        let drift = self.drift * (clip_seconds * weight);
        let shift = DAffine3::from_translation(-self.place - drift);
        let mut model = self.skeleton.model(&pose);
        for matrix in &mut model {
            *matrix = shift * *matrix;
        }
        model
    }
}

/// From 0 to 1 with two continuous derivatives.
pub(super) fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (x * (6.0 * x - 15.0) + 10.0)
}

/// The rotation of a matrix, by its normalised columns.
pub(super) fn rotation(matrix: &DAffine3) -> DQuat {
    let x = matrix.matrix3.x_axis.normalize_or(DVec3::X);
    let y = matrix
        .matrix3
        .y_axis
        .reject_from(x)
        .normalize_or(x.any_orthonormal_vector());
    DQuat::from_mat3(&glam::DMat3::from_cols(x, y, x.cross(y)))
}

/// Natural cubic splines through evenly spaced transforms, component by component.
#[derive(Clone, Debug)]
struct Spline {
    period: f64,
    /// `[keys]`: rotation (neighbours in one hemisphere), translation, scale.
    values: Vec<[f64; WIDTH]>,
    /// `[keys]`: a sixth of the second derivative by keys.
    bends: Vec<[f64; WIDTH]>,
}

impl Spline {
    fn new(period: f64, keys: impl Iterator<Item = Transform>) -> Self {
        let mut values: Vec<[f64; WIDTH]> = Vec::new();
        let mut last = DQuat::IDENTITY;
        for key in keys {
            let near = if last.dot(key.rotation) < 0.0 {
                -key.rotation
            } else {
                key.rotation
            };
            last = near;
            let (t, s) = (key.translation, key.scale);
            values.push([near.x, near.y, near.z, near.w, t.x, t.y, t.z, s.x, s.y, s.z]);
        }
        let bends = bends(&values);
        Self {
            period,
            values,
            bends,
        }
    }

    fn at(&self, seconds: f64) -> Transform {
        let last = self.values.len() - 1;
        let key = (seconds / self.period).clamp(0.0, last as f64);
        let from = (key as usize).min(last.saturating_sub(1));
        let to = (from + 1).min(last);
        let u = key - from as f64;
        let v = 1.0 - u;
        let c: [f64; WIDTH] = std::array::from_fn(|at| {
            v * self.values[from][at]
                + u * self.values[to][at]
                + (v * v * v - v) * self.bends[from][at]
                + (u * u * u - u) * self.bends[to][at]
        });
        let rotation = DQuat::from_xyzw(c[0], c[1], c[2], c[3]);
        Transform {
            rotation: if rotation.length_squared() > 1e-12 {
                rotation.normalize()
            } else {
                DQuat::from_slice(&self.values[from][..4])
            },
            translation: DVec3::from_slice(&c[4..7]),
            scale: DVec3::from_slice(&c[7..10]),
        }
    }
}

/// Solves `b[i-1] + 4 b[i] + b[i+1] = y[i-1] - 2 y[i] + y[i+1]`, 0 at both ends, by elimination
/// (de Boor 1978, chapter 4).
fn bends(values: &[[f64; WIDTH]]) -> Vec<[f64; WIDTH]> {
    let count = values.len();
    let mut bends = vec![[0.0; WIDTH]; count];
    let mut factors = vec![0.0; count];
    for key in 1..count.saturating_sub(1) {
        let pivot = 1.0 / (4.0 - factors[key - 1]);
        factors[key] = pivot;
        for at in 0..WIDTH {
            let second = values[key - 1][at] - 2.0 * values[key][at] + values[key + 1][at];
            bends[key][at] = (second - bends[key - 1][at]) * pivot;
        }
    }
    for key in (1..count.saturating_sub(1)).rev() {
        let after = bends[key + 1];
        for (bend, after) in bends[key].iter_mut().zip(after) {
            *bend -= factors[key] * after;
        }
    }
    bends
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving(positions: &[f64]) -> Spline {
        let key = |&x: &f64| Transform {
            translation: DVec3::X * x,
            ..Transform::IDENTITY
        };
        Spline::new(0.5, positions.iter().map(key))
    }

    #[test]
    fn a_spline_meets_its_keys_and_bends_as_by_hand() {
        // Three keys 0, 1, 0: 4 b = -2, so b = -1/2; halfway: 1/2 + (1/8 - 1/2) (-1/2) = 11/16.
        let spline = moving(&[0.0, 1.0, 0.0]);
        let x = |seconds| spline.at(seconds).translation.x;
        assert_eq!([x(0.0), x(0.5), x(1.0)], [0.0, 1.0, 0.0]);
        assert!((x(0.25) - 11.0 / 16.0).abs() < 1e-15);
        assert_eq!([x(-1.0), x(9.0)], [0.0, 0.0], "still outside");
        assert_eq!(moving(&[3.0]).at(0.2).translation.x, 3.0);
        let line = moving(&[0.0, 1.0, 2.0, 3.0]);
        assert!((line.at(0.6).translation.x - 1.2).abs() < 1e-12);
    }

    #[test]
    fn velocity_and_acceleration_have_no_jump_at_a_key() {
        let spline = moving(&[0.0, 1.0, -2.0, 0.5, 0.7, 3.0]);
        let x = |seconds| spline.at(seconds).translation.x;
        let acceleration = |at: f64| (x(at - 1e-4) - 2.0 * x(at) + x(at + 1e-4)) / 1e-8;
        for key in 1..5 {
            let at = 0.5 * f64::from(key);
            let jump = acceleration(at + 2e-4) - acceleration(at - 2e-4);
            assert!(jump.abs() < 0.1, "{jump}");
        }
    }

    #[test]
    fn quaternions_of_either_sign_are_one_rotation() {
        let turn = |angle: f64, sign: f64| Transform {
            rotation: DQuat::from_rotation_y(angle) * sign,
            ..Transform::IDENTITY
        };
        let spline = Spline::new(
            1.0,
            [turn(0.0, 1.0), turn(0.2, -1.0), turn(0.4, 1.0)].into_iter(),
        );
        let angle = spline
            .at(0.5)
            .rotation
            .angle_between(DQuat::from_rotation_y(0.1));
        assert!(angle < 1e-3, "{angle}");
    }

    #[test]
    fn the_step_is_smooth() {
        assert_eq!(
            [smooth_step(-1.0), smooth_step(0.5), smooth_step(2.0)],
            [0.0, 0.5, 1.0]
        );
        assert!(smooth_step(1e-3) < 1.1e-8);
    }
}
