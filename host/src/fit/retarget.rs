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
//!    rotation. Between two joints of a spine or neck, `S` is interpolated by slerp.
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

use super::humanoid::{Humanoid, Part, Role, SIDES};
use super::{Correspondence, Drive, FitError, Which};
use crate::model::{Channel, Clip, Interpolation, Motion, Skeleton, Track};
use crate::reference::pose::sample;

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

/// Beyond this angle from the vertical a spine does not stand.
const UPRIGHT_LIMIT: f64 = 45.0;

/// A foot whose direction has less than this share in the horizontal has no heading.
const HEADING_LIMIT: f64 = 0.2;

/// Local rotations that differ by less from the rest pose need no track.
const STILL: f64 = 1e-12;

/// Carries a motion over to another skeleton. O(frames x joints)
///
/// # Errors
/// A reference pose that is not upright or faces nowhere, legs without length, a reference frame
/// that does not exist, a lift that is not finite.
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
    let times = frame_times(&motion.clip)?;
    let of_source = &correspondence.source;
    let of_target = &correspondence.target;
    let rest = pose(target, &target.rest());
    let local = match options.reference {
        Reference::Rest => motion.skeleton.rest(),
        Reference::Frame(frame) => {
            let count = times.len();
            let time = times
                .get(frame)
                .ok_or(FitError::NoSuchFrame { frame, count })?;
            sample(&motion.skeleton, &motion.clip, *time)
        }
    };
    let mut reference = pose(&motion.skeleton, &local);
    let faces = facing(of_source, &reference.positions, Which::Source)?;
    let wanted = facing(of_target, &rest.positions, Which::Target)?;
    let yaw = heading(wanted) - heading(faces);
    let turn = DQuat::from_rotation_y(yaw);
    reference.turn(turn);
    let scale = leg_length(of_target, &rest.positions, Which::Target)?
        / leg_length(of_source, &reference.positions, Which::Source)?;
    let align = reconcile(motion, target, correspondence, &rest, &reference);

    let hips = of_target.hips;
    let mut tracks: Vec<Track> = Vec::new();
    let mut track_of = vec![None; target.joints.len()];
    for joint in (0..target.joints.len()).filter(|&joint| correspondence.drives[joint].is_some()) {
        let mut add = |channel| {
            tracks.push(Track {
                joint,
                channel,
                interpolation: Interpolation::Linear,
                times: times.clone(),
                values: Vec::with_capacity(times.len()),
            })
        };
        if joint == hips {
            add(Channel::Translation);
        }
        add(Channel::Rotation);
        track_of[joint] = Some(tracks.len() - 1);
    }

    let mut start = None;
    for &time in &times {
        let mut now = pose(
            &motion.skeleton,
            &sample(&motion.skeleton, &motion.clip, time),
        );
        now.turn(turn);
        let since = |joint: usize| now.rotations[joint] * reference.rotations[joint].inverse();
        let mut local = target.rest();
        let mut model: Vec<DQuat> = Vec::with_capacity(target.joints.len());
        for (joint, drive) in correspondence.drives.iter().enumerate() {
            let above = target.joints[joint]
                .parent
                .map_or(DQuat::IDENTITY, |p| model[p]);
            let moved = match *drive {
                None => above * local[joint].rotation,
                Some(Drive::Joint(from)) => since(from) * align[joint] * rest.rotations[joint],
                Some(Drive::Between(first, second, fraction)) => {
                    let between = since(first).slerp(since(second), fraction);
                    between * align[joint] * rest.rotations[joint]
                }
            };
            model.push(moved.normalize());
            if let Some(track) = track_of[joint] {
                local[joint].rotation = (above.inverse() * model[joint]).normalize();
                push_rotation(&mut tracks[track], local[joint].rotation);
            }
        }
        // The sockets are where the legs put them; the hips are moved until they fit.
        let affine = target.model(&local);
        let positions: Vec<DVec3> = affine.iter().map(|affine| affine.translation).collect();
        let mut wanted = scale * sockets(of_source, &now.positions);
        let begin = *start.get_or_insert(DVec3::new(wanted.x, 0.0, wanted.z));
        if !options.keep_origin {
            wanted -= begin;
        }
        wanted.y += options.lift;
        let place = positions[hips] + wanted - sockets(of_target, &positions);
        let place = match target.joints[hips].parent {
            Some(parent) => affine[parent].inverse().transform_point3(place),
            None => place,
        };
        if let Some(rotation) = track_of[hips] {
            tracks[rotation - 1]
                .values
                .push([place.x, place.y, place.z, 0.0]);
        }
    }
    tracks.retain(|track| track.channel == Channel::Translation || moves(track, target));
    let clip = Clip {
        name: motion.clip.name.clone(),
        tracks,
        morph_track: None,
        duration: times.last().copied().unwrap_or(0.0),
        sample_period: motion.clip.sample_period,
    };
    Ok(Retargeted { clip, scale, yaw })
}

/// Model-space rotations and positions of all joints.
struct Pose {
    rotations: Vec<DQuat>,
    positions: Vec<DVec3>,
}

impl Pose {
    /// Turns everything about the origin.
    fn turn(&mut self, by: DQuat) {
        self.rotations
            .iter_mut()
            .for_each(|rotation| *rotation = by * *rotation);
        self.positions
            .iter_mut()
            .for_each(|position| *position = by * *position);
    }
}

fn pose(skeleton: &Skeleton, local: &[crate::model::Transform]) -> Pose {
    let mut rotations: Vec<DQuat> = Vec::with_capacity(local.len());
    for (joint, local) in skeleton.joints.iter().zip(local) {
        let above = joint
            .parent
            .map_or(DQuat::IDENTITY, |parent| rotations[parent]);
        rotations.push((above * local.rotation).normalize());
    }
    let affine = skeleton.model(local);
    Pose {
        rotations,
        positions: affine.iter().map(|affine| affine.translation).collect(),
    }
}

/// `A_j` for every target joint (step 4).
fn reconcile(
    motion: &Motion,
    target: &Skeleton,
    correspondence: &Correspondence,
    rest: &Pose,
    reference: &Pose,
) -> Vec<DQuat> {
    let role_of = |joint: usize| {
        let mut roles = correspondence.target.roles.iter();
        roles
            .find(|&(_, &other)| other == joint)
            .map(|(&role, _)| role)
    };
    let mut align: Vec<DQuat> = Vec::with_capacity(target.joints.len());
    for joint in 0..target.joints.len() {
        let above = target.joints[joint]
            .parent
            .map_or(DQuat::IDENTITY, |p| align[p]);
        let follows = match correspondence.drives[joint] {
            Some(Drive::Joint(from)) => Some(from),
            _ => None,
        };
        let (Some(from), Some(Role::Limb(side, part))) = (follows, role_of(joint)) else {
            align.push(above);
            continue;
        };
        let next = |human: &Humanoid| next_part(part).and_then(|next| human.limb(side, next));
        let bone = direction(target, &[], joint, next(&correspondence.target), rest);
        let ends = &motion.end_sites;
        let other = next(&correspondence.source);
        let other = direction(&motion.skeleton, ends, from, other, reference);
        let (Some(bone), Some(other)) = (bone, other) else {
            align.push(above);
            continue;
        };
        align.push(match part {
            Part::UpperArm | Part::LowerArm | Part::UpperLeg | Part::LowerLeg => {
                DQuat::from_rotation_arc((above * bone).normalize(), other) * above
            }
            Part::Foot if level(bone) && level(other) => {
                DQuat::from_rotation_y(heading(other) - heading(bone))
            }
            // A foot that points at the floor says nothing; it is level all the same.
            Part::Foot => DQuat::IDENTITY,
            Part::Shoulder | Part::Hand | Part::Toes => above,
        });
    }
    align
}

fn next_part(part: Part) -> Option<Part> {
    match part {
        Part::UpperArm => Some(Part::LowerArm),
        Part::LowerArm => Some(Part::Hand),
        Part::UpperLeg => Some(Part::LowerLeg),
        Part::LowerLeg => Some(Part::Foot),
        Part::Foot => Some(Part::Toes),
        Part::Shoulder | Part::Hand | Part::Toes => None,
    }
}

/// Unit direction of the bone that begins at `joint`: to the next joint of the limb, else to the
/// middle of the children, else to the end site.
fn direction(
    skeleton: &Skeleton,
    end_sites: &[(usize, DVec3)],
    joint: usize,
    next: Option<usize>,
    pose: &Pose,
) -> Option<DVec3> {
    let from = pose.positions[joint];
    let middle = |points: Vec<DVec3>| {
        #[allow(clippy::cast_precision_loss, reason = "a few points")]
        let count = points.len() as f64;
        (!points.is_empty()).then(|| points.iter().sum::<DVec3>() / count - from)
    };
    let children = || {
        let child = |&at: &usize| skeleton.joints[at].parent == Some(joint);
        let children = (joint + 1..skeleton.joints.len()).filter(child);
        middle(children.map(|at| pose.positions[at]).collect())
    };
    let ends = || {
        let own = end_sites.iter().filter(|&&(at, _)| at == joint);
        middle(
            own.map(|&(_, offset)| from + pose.rotations[joint] * offset)
                .collect(),
        )
    };
    let bone = next
        .map(|next| pose.positions[next] - from)
        .or_else(children)
        .or_else(ends)?;
    bone.try_normalize()
}

/// Angle of a direction about the vertical, from +Z.
fn heading(direction: DVec3) -> f64 {
    direction.x.atan2(direction.z)
}

fn level(direction: DVec3) -> bool {
    direction.x.hypot(direction.z) > HEADING_LIMIT
}

/// Horizontal direction in which an upright body looks.
fn facing(human: &Humanoid, positions: &[DVec3], which: Which) -> Result<DVec3, FitError> {
    let spine = positions[human.roles[&Role::Head]] - positions[human.hips];
    let degrees = spine.angle_between(DVec3::Y).to_degrees();
    if spine.length_squared() > 0.0 && degrees > UPRIGHT_LIMIT {
        return Err(FitError::NotUpright { which, degrees });
    }
    let across = |part| {
        let [left, right] = SIDES.map(|side| human.limb(side, part));
        Some(positions[left?] - positions[right?])
    };
    let hips = across(Part::UpperLeg).unwrap_or_default();
    let all = hips + across(Part::UpperArm).unwrap_or_default();
    let forward = all.cross(DVec3::Y);
    if forward.length() <= 1e-3 * all.length() {
        return Err(FitError::NoFacing { which });
    }
    Ok(forward)
}

/// Middle of the hip sockets.
fn sockets(human: &Humanoid, positions: &[DVec3]) -> DVec3 {
    let legs = SIDES.map(|side| human.limb(side, Part::UpperLeg));
    let [left, right] = legs.map(|leg| positions[leg.unwrap_or(human.hips)]);
    (left + right) / 2.0
}

/// Hip to knee to ankle, mean of both sides, metres.
fn leg_length(human: &Humanoid, positions: &[DVec3], which: Which) -> Result<f64, FitError> {
    let mut length = 0.0;
    for side in SIDES {
        let parts = [Part::UpperLeg, Part::LowerLeg, Part::Foot];
        let [hip, knee, ankle] =
            parts.map(|part| positions[human.limb(side, part).unwrap_or(human.hips)]);
        length += (hip.distance(knee) + knee.distance(ankle)) / 2.0;
    }
    if length.is_normal() {
        Ok(length)
    } else {
        Err(FitError::NoLegs { which })
    }
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
    if !(frames <= MAX_FRAMES as f64) {
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

/// Adds a key on the side of the last one, so that interpolation takes the shorter arc.
fn push_rotation(track: &mut Track, rotation: DQuat) {
    let flip = track
        .values
        .last()
        .is_some_and(|&last| DQuat::from_array(last).dot(rotation) < 0.0);
    track
        .values
        .push(if flip { -rotation } else { rotation }.to_array());
}

fn moves(track: &Track, skeleton: &Skeleton) -> bool {
    let rest = skeleton.joints[track.joint].rest.rotation;
    let away = |&value: &[f64; 4]| {
        let turn = rest.inverse() * DQuat::from_array(value);
        turn.xyz().length() > STILL
    };
    track.values.iter().any(away)
}

#[cfg(test)]
mod tests;
