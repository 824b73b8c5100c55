//! A body that skips: a clip made for a skeleton, so that the scene needs no recording.
//!
//! The hands follow the driver of [`Motion::Skipping`], the hips rise when the rope passes below,
//! and arms and legs follow by two-bone inverse kinematics.

use glam::{DAffine3, DQuat, DVec3};

use super::body::two_bones;
use super::{Motion, Scene, SceneError, jump};
use crate::fit::humanoid::{Part, Role, SIDES, Side};
use crate::fit::{Humanoid, Which};
use crate::model::{Avatar, Channel, Clip, Skeleton, Track, Transform};

/// Height for which the driver's hands are placed, metres.
const USUAL_HEIGHT: f64 = 1.72;
/// Keys a second.
const RATE: f64 = 60.0;
/// Distance of the feet, as a share of that at rest: a rope that hangs low enough to be jumped
/// over would catch on feet farther apart.
const TOGETHER: f64 = 0.45;
/// From wrist to palm, metres; the palm grips the rope.
pub(super) const PALM: f64 = 0.08;

/// A limb of two bones and what hangs on it.
struct Limb {
    upper: usize,
    lower: usize,
    end: usize,
}

/// Joints that skip, with their rest pose.
struct Skipper<'a> {
    skeleton: &'a Skeleton,
    rest: Vec<Transform>,
    model: Vec<DAffine3>,
    hips: usize,
    arms: [Limb; 2],
    legs: [Limb; 2],
}

impl<'a> Skipper<'a> {
    fn new(skeleton: &'a Skeleton) -> Result<Self, SceneError> {
        let human = Humanoid::new(skeleton, Which::Target).map_err(|_| SceneError::NoHuman)?;
        let joint = |side: Side, part: Part| {
            let role = Role::Limb(side, part);
            human.roles.get(&role).copied().ok_or(SceneError::NoHuman)
        };
        let limb = |side, upper, lower, end| {
            Ok(Limb {
                upper: joint(side, upper)?,
                lower: joint(side, lower)?,
                end: joint(side, end)?,
            })
        };
        let [left, right] = SIDES;
        let arm = |side| limb(side, Part::UpperArm, Part::LowerArm, Part::Hand);
        let leg = |side| limb(side, Part::UpperLeg, Part::LowerLeg, Part::Foot);
        let rest = skeleton.rest();
        Ok(Self {
            skeleton,
            model: skeleton.model(&rest),
            rest,
            hips: human.hips,
            arms: [arm(left)?, arm(right)?],
            legs: [leg(left)?, leg(right)?],
        })
    }

    fn at(&self, joint: usize) -> DVec3 {
        self.model[joint].translation
    }

    /// Local rotations that bring a limb's end to `goal`, the middle bent towards `pole`.
    fn reach(&self, local: &mut [Transform], limb: &Limb, goal: DVec3, pole: DVec3, flat: bool) {
        let model = self.skeleton.model(local);
        let (root, middle, end) = (self.at(limb.upper), self.at(limb.lower), self.at(limb.end));
        let (upper, lower) = (root.distance(middle), middle.distance(end));
        let start = model[limb.upper].translation;
        let (knee, goal) = two_bones(start, goal, upper, lower, pole);
        let turned = |joint: usize, from: DVec3, to: DVec3| {
            let own = super::super::performance::rotation(&self.model[joint]);
            DQuat::from_rotation_arc(from.normalize_or(to), to) * own
        };
        let above = turned(
            limb.upper,
            middle - root,
            (knee - start).normalize_or(DVec3::NEG_Y),
        );
        let below = turned(
            limb.lower,
            end - middle,
            (goal - knee).normalize_or(DVec3::NEG_Y),
        );
        self.turn_to(local, limb.upper, above);
        self.turn_to(local, limb.lower, below);
        if flat {
            let own = super::super::performance::rotation(&self.model[limb.end]);
            self.turn_to(local, limb.end, own);
        }
    }

    /// Sets a joint's local rotation so that its rotation in model space is `wanted`.
    fn turn_to(&self, local: &mut [Transform], joint: usize, wanted: DQuat) {
        let model = self.skeleton.model(local);
        let parent = self.skeleton.joints[joint].parent;
        let above = parent.map_or(DQuat::IDENTITY, |p| {
            super::super::performance::rotation(&model[p])
        });
        local[joint].rotation = (above.inverse() * wanted).normalize();
    }

    fn pose(&self, palms: [DVec3; 2], lift: f64) -> Vec<Transform> {
        let mut local = self.rest.clone();
        let up = DVec3::Y * lift;
        let parent = self.skeleton.joints[self.hips].parent;
        let above = parent.map_or(DAffine3::IDENTITY, |p| self.model[p]);
        let raised = above.inverse().transform_point3(self.at(self.hips) + up);
        local[self.hips].translation = raised;
        for (leg, side) in self.legs.iter().zip([1.0, -1.0]) {
            let foot = self.at(leg.end);
            let goal = DVec3::new(TOGETHER * foot.x, foot.y + lift.max(0.0), foot.z);
            self.reach(
                &mut local,
                leg,
                goal,
                DVec3::new(0.1 * side, 0.0, 1.0),
                true,
            );
        }
        for ((arm, palm), side) in self.arms.iter().zip(palms).zip([1.0, -1.0]) {
            // The wrist lies behind the palm, on the way from the shoulder.
            let from = (palm - self.at(arm.upper)).normalize_or(DVec3::NEG_Y);
            let goal = palm - from * PALM;
            let pole = DVec3::new(0.3 * side, -0.5, -1.0);
            self.reach(&mut local, arm, goal, pole, false);
        }
        local
    }
}

/// The scene's height over the body for which it was made.
pub(super) fn scale(avatar: &Avatar) -> f64 {
    crate::verify::height(&avatar.mesh.positions) / USUAL_HEIGHT
}

/// A skipping clip for `avatar`, and the scene with a rope of a length that fits.
///
/// # Errors
/// The skeleton is no human body, or a setting is out of its range.
pub fn skipping(avatar: &Avatar, scene: &Scene) -> Result<(Clip, Scene), SceneError> {
    let skipper = Skipper::new(&avatar.skeleton)?;
    let scale = scale(avatar);
    if !(0.3..=3.0).contains(&scale) {
        return Err(SceneError::OutOfRange {
            name: "height of the body",
            value: scale * USUAL_HEIGHT,
            range: "between 0.5 and 5 m",
        });
    }
    let mut scene = Scene {
        motion: Motion::Skipping,
        people: false,
        ..*scene
    };
    scene.model.markers = ((scene.model.markers - 1) as f64 * scale).round() as usize + 1;
    scene.check()?;
    let passes = scene.passes(scale)?;
    let driver = scene.driver();
    let count = (scene.seconds * RATE) as usize + 1;
    let times: Vec<f64> = (0..count).map(|key| key as f64 / RATE).collect();
    let poses: Vec<Vec<Transform>> = times
        .iter()
        .map(|&t| {
            skipper.pose(
                driver.palms(t).map(|palm| palm * scale),
                scale * jump(&passes, t),
            )
        })
        .collect();
    let mut tracks = Vec::new();
    let moved = [&skipper.arms, &skipper.legs].into_iter().flatten();
    let mut joints: Vec<usize> = moved.flat_map(|l| [l.upper, l.lower, l.end]).collect();
    joints.push(skipper.hips);
    joints.sort_unstable();
    joints.dedup();
    for joint in joints {
        let mut track = |channel, values| {
            tracks.push(Track::linear(joint, channel, &times, values));
        };
        if joint == skipper.hips {
            let places = poses
                .iter()
                .map(|pose| pose[joint].translation.extend(0.0).to_array());
            track(Channel::Translation, places.collect());
        }
        let turns = poses.iter().map(|pose| pose[joint].rotation.to_array());
        track(Channel::Rotation, turns.collect());
    }
    let clip = Clip {
        name: "skipping".into(),
        tracks,
        morph_track: None,
        duration: times[count - 1],
        sample_period: Some(1.0 / RATE),
    };
    Ok((clip, scene))
}
