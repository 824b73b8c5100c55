//! A motion carried over to a body of other proportions, by rotation alone.
//!
//! In: a motion, a skeleton, their [`Correspondence`]. Out: a clip for that skeleton.
//! After Mažrimas & Beinaravičius, section 4 (only rotations are taken over), with rest poses that
//! may differ.
//!
//! 1. *Reference.* The source's reference pose is its rest pose, or a frame in which the actor
//!    stands straight. The target's is its rest pose. Both stand upright.
//! 2. *Facing.* One turn about the vertical makes both references face the same way (left to right
//!    hip plus left to right shoulder, in the horizontal plane). From here on the source is turned.
//! 3. *Rotation.* `S_s(t)` is the rotation in model space of source joint `s` since the reference.
//!    A target joint `j` that follows `s` gets, in model space, `S_s(t) A_j G_j`; `G_j` is its rest
//!    rotation. Between two joints of a spine or neck, `S` is interpolated by slerp. Where a rig
//!    has further joints inside a limb bone (MakeHuman), the smallest rotation that brings the bone
//!    to its true direction comes on top.
//! 4. *Reconciliation.* `A_j` turns the target's rest pose into the source's reference pose (T, A or
//!    arms hanging). It is the identity for hips, spine, neck, head and clavicles. For upper arm,
//!    forearm, thigh and shin it is the smallest rotation that brings the bone, as turned by the
//!    joint above, into the source's direction: `A_j = swing(A_p b_j -> d_s) A_p`, so that no twist
//!    comes in. Feet stand level in both references and only turn about the vertical. Every other
//!    joint takes the `A` of the nearest joint above it that follows something: hands that of the
//!    forearm, clavicles that of the chest, so that neither twists nor lifts them.
//! 5. *Rest.* A joint that follows nothing keeps its rest pose relative to its parent.
//! 6. *Root.* The middle of the target's hip sockets moves as the source's does, scaled by the ratio
//!    of leg lengths (hip to knee to ankle, mean of both sides), raised by [`Options::lift`].

use glam::{DQuat, DVec3};

use super::{Correspondence, Drive, FitError, Which};
use crate::model::{Channel, Clip, Interpolation, Motion, Skeleton, Track, Transform};
use crate::reference::pose::sample;
use reconcile::{reconcile, split_bones};
use stance::{Pose, heading, leg_length, sockets};
pub(super) use stance::{facing, swing};

mod reconcile;
mod stance;
#[cfg(test)]
mod tests;

/// The pose of the source that corresponds to the target's rest pose but for its limbs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reference {
    /// Its rest pose.
    #[default]
    Rest,
    /// A frame of the clip, from 0, for files whose rest pose is lying or crooked.
    Frame(usize),
}

/// How to carry a motion over.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Where rotations are counted from.
    pub reference: Reference,
    /// Start where the source starts, scaled, instead of above the origin.
    pub keep_origin: bool,
    /// Metres added to the height; [`floor::lift`](super::floor::lift) knows it.
    pub lift: f64,
}

/// A motion carried over.
#[derive(Clone, Debug, PartialEq)]
pub struct Retargeted {
    /// For the target skeleton: a rotation track for each joint that moves, a translation for the
    /// hips; linear, one key a frame.
    pub clip: Clip,
    /// Length of the target's legs over the source's.
    pub scale: f64,
    /// Turn about the vertical that made both face the same way, radians.
    pub yaw: f64,
}

/// Frames a second where the source is not sampled evenly.
const DEFAULT_RATE: f64 = 60.0;

/// More frames than this are taken for a fault in the file: nine hours at 30 a second.
const MAX_FRAMES: usize = 1 << 20;

/// Local rotations that differ by less from the rest pose need no track.
const STILL: f64 = 1e-12;

/// Carries a motion over to another skeleton, by a correspondence of the two. O(frames x joints)
///
/// # Errors
/// A correspondence of other skeletons, a reference pose that is not upright or faces nowhere, legs
/// without length, a reference frame that does not exist, a lift that is not finite.
pub fn retarget(
    motion: &Motion,
    target: &Skeleton,
    correspondence: &Correspondence,
    options: &Options,
) -> Result<Retargeted, FitError> {
    if !options.lift.is_finite() {
        return Err(FitError::NotFinite {
            what: "the lift".into(),
        });
    }
    if !correspondence.is_of(&motion.skeleton, target) {
        return Err(FitError::OtherSkeletons);
    }
    let times = frame_times(&motion.clip)?;
    let transfer = Transfer::new(motion, target, correspondence, options.reference, &times)?;
    let mut offset = options.lift * DVec3::Y;
    if !options.keep_origin {
        let start = transfer.sockets(&transfer.source_pose(times[0]));
        offset -= DVec3::new(start.x, 0.0, start.z);
    }

    let mut tracks = empty_tracks(correspondence, &times);
    for &time in &times {
        let local = transfer.target_pose(&transfer.source_pose(time), offset);
        for track in &mut tracks {
            let joint = &local[track.joint];
            match track.channel {
                Channel::Rotation => track.push_rotation(joint.rotation),
                _ => track.values.push(joint.translation.extend(0.0).to_array()),
            }
        }
    }
    tracks.retain(|track| track.channel == Channel::Translation || moves(track, target));
    let clip = Clip {
        name: motion.clip.name.clone(),
        tracks,
        morph_track: None,
        duration: times[times.len() - 1],
        sample_period: motion.clip.sample_period,
    };
    Ok(Retargeted {
        clip,
        scale: transfer.scale,
        yaw: transfer.yaw,
    })
}

/// Carries one pose over, as [`retarget`] does a clip: for motion that arrives frame by frame.
///
/// `motion` gives the source's skeleton, its rest pose being the reference; `pose` is local,
/// `[source joints]`. Gives the local pose of `target`. O(joints)
///
/// # Errors
/// As [`retarget`].
pub fn retarget_pose(
    motion: &Motion,
    pose: &[Transform],
    target: &Skeleton,
    correspondence: &Correspondence,
    options: &Options,
) -> Result<Vec<Transform>, FitError> {
    if !correspondence.is_of(&motion.skeleton, target) {
        return Err(FitError::OtherSkeletons);
    }
    let reference = options.reference;
    let transfer = Transfer::new(motion, target, correspondence, reference, &[0.0])?;
    let mut source = Pose::new(&motion.skeleton, pose);
    source.turn(DQuat::from_rotation_y(transfer.yaw));
    Ok(transfer.target_pose(&source, options.lift * DVec3::Y))
}

/// What stays the same from frame to frame.
struct Transfer<'a> {
    motion: &'a Motion,
    target: &'a Skeleton,
    correspondence: &'a Correspondence,
    rest: Pose,
    /// Turned to face as the target does.
    reference: Pose,
    yaw: f64,
    scale: f64,
    align: Vec<DQuat>,
    split: Vec<Option<usize>>,
}

impl<'a> Transfer<'a> {
    fn new(
        motion: &'a Motion,
        target: &'a Skeleton,
        correspondence: &'a Correspondence,
        reference: Reference,
        times: &[f64],
    ) -> Result<Self, FitError> {
        let rest = Pose::new(target, &target.rest());
        let local = match reference {
            Reference::Rest => motion.skeleton.rest(),
            Reference::Frame(frame) => {
                let count = times.len();
                let time = times
                    .get(frame)
                    .ok_or(FitError::NoSuchFrame { frame, count })?;
                sample(&motion.skeleton, &motion.clip, *time)
            }
        };
        let mut reference = Pose::new(&motion.skeleton, &local);
        let (source_roles, target_roles) = (&correspondence.source, &correspondence.target);
        let faces = facing(source_roles, &reference.positions, Which::Source)?;
        let wanted = facing(target_roles, &rest.positions, Which::Target)?;
        let yaw = heading(wanted) - heading(faces);
        reference.turn(DQuat::from_rotation_y(yaw));
        let scale = leg_length(target_roles, &rest.positions, Which::Target)?
            / leg_length(source_roles, &reference.positions, Which::Source)?;
        Ok(Self {
            motion,
            target,
            correspondence,
            yaw,
            scale,
            align: reconcile(motion, target, correspondence, &rest, &reference),
            split: split_bones(&motion.skeleton, source_roles),
            rest,
            reference,
        })
    }

    /// The source at a time, facing as the target does.
    fn source_pose(&self, time: f64) -> Pose {
        let local = sample(&self.motion.skeleton, &self.motion.clip, time);
        let mut pose = Pose::new(&self.motion.skeleton, &local);
        pose.turn(DQuat::from_rotation_y(self.yaw));
        pose
    }

    /// Where the middle of the target's hip sockets goes.
    fn sockets(&self, source: &Pose) -> DVec3 {
        self.scale * sockets(&self.correspondence.source, &source.positions)
    }

    /// `S_s(t)`: how a source joint has turned since the reference, in model space.
    fn since(&self, joint: usize, now: &Pose) -> DQuat {
        let turned = now.rotations[joint] * self.reference.rotations[joint].inverse();
        let Some(end) = self.split[joint] else {
            return turned;
        };
        let bone = |pose: &Pose| (pose.positions[end] - pose.positions[joint]).try_normalize();
        match (bone(&self.reference), bone(now)) {
            (Some(then), Some(now)) => swing(turned * then, now) * turned,
            _ => turned,
        }
    }

    /// Local transforms of the target for a pose of the source.
    fn target_pose(&self, source: &Pose, offset: DVec3) -> Vec<Transform> {
        let mut local = self.target.rest();
        let mut model: Vec<DQuat> = Vec::with_capacity(local.len());
        for (joint, drive) in self.correspondence.drives.iter().enumerate() {
            let parent = self.target.joints[joint].parent;
            let above = parent.map_or(DQuat::IDENTITY, |parent| model[parent]);
            let turned = match *drive {
                None => {
                    model.push((above * local[joint].rotation).normalize());
                    continue;
                }
                Some(Drive::Joint(from)) => self.since(from, source),
                Some(Drive::Between(first, second, fraction)) => {
                    let second = self.since(second, source);
                    self.since(first, source).slerp(second, fraction)
                }
            };
            let own = (turned * self.align[joint] * self.rest.rotations[joint]).normalize();
            local[joint].rotation = (above.inverse() * own).normalize();
            model.push(own);
        }
        // The hips go where they bring the sockets, which hang below them as the pose wants it.
        let affine = self.target.model(&local);
        let positions: Vec<DVec3> = affine.iter().map(|affine| affine.translation).collect();
        let human = &self.correspondence.target;
        let sockets = sockets(human, &positions);
        let hips = self.sockets(source) + offset + positions[human.hips] - sockets;
        local[human.hips].translation = match self.target.joints[human.hips].parent {
            Some(parent) => affine[parent].inverse().transform_point3(hips),
            None => hips,
        };
        local
    }
}

/// A rotation track for every joint that follows something, and the translation of the hips.
fn empty_tracks(correspondence: &Correspondence, times: &[f64]) -> Vec<Track> {
    let mut tracks = Vec::new();
    for (joint, drive) in correspondence.drives.iter().enumerate() {
        let translation = (joint == correspondence.target.hips).then_some(Channel::Translation);
        let rotation = drive.map(|_| Channel::Rotation);
        for channel in translation.into_iter().chain(rotation) {
            let values = Vec::with_capacity(times.len());
            tracks.push(Track::linear(joint, channel, times, values));
        }
    }
    tracks
}

/// Key times of the result: the source's where all its tracks share them, else an even grid.
fn frame_times(clip: &Clip) -> Result<Vec<f64>, FitError> {
    let Some(first) = clip.tracks.iter().max_by_key(|track| track.times.len()) else {
        return Ok(vec![0.0]);
    };
    let linear = |track: &Track| track.interpolation == Interpolation::Linear;
    let shared = |track: &Track| track.times == first.times || track.times.len() == 1;
    let period = clip.sample_period.filter(|&period| period > 0.0);
    if period.is_some() && clip.tracks.iter().all(|t| linear(t) && shared(t)) {
        return Ok(first.times.clone());
    }
    let period = period.unwrap_or(1.0 / DEFAULT_RATE);
    let frames = (clip.duration / period).floor() + 1.0;
    #[allow(clippy::cast_precision_loss, reason = "far below 2^52 frames")]
    if frames.is_nan() || frames > MAX_FRAMES as f64 {
        return Err(FitError::TooLong {
            seconds: clip.duration,
            period,
            limit: MAX_FRAMES,
        });
    }
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "1 to the limit"
    )]
    let count = frames as u32;
    let mut times: Vec<f64> = (0..count).map(|frame| f64::from(frame) * period).collect();
    if clip.duration - f64::from(count - 1) * period > 1e-6 * period {
        times.push(clip.duration);
    }
    Ok(times)
}

fn moves(track: &Track, skeleton: &Skeleton) -> bool {
    let rest = skeleton.joints[track.joint].rest.rotation;
    let away = |&value: &[f64; 4]| {
        let turn = rest.inverse() * DQuat::from_array(value);
        turn.xyz().length() > STILL
    };
    track.values.iter().any(away)
}
