//! The actor behind a stream: a skeleton from its first poses, then poses of a body.

use glam::{DQuat, DVec3};

use super::LiveError;
use super::vmc::{BONES, Packet, Placed};
use crate::fit::{Correspondence, Options, retarget_pose};
use crate::model::{Channel, Clip, Joint, Motion, Skeleton, Track, Transform};

/// Bones without which a body cannot be followed.
const NEEDED: [&str; 9] = [
    "Hips",
    "Spine",
    "Head",
    "LeftUpperLeg",
    "LeftLowerLeg",
    "LeftFoot",
    "RightUpperLeg",
    "RightLowerLeg",
    "RightFoot",
];

/// Name of the joint that the model's root moves.
const ROOT: &str = "root";

/// What is known of the actor.
#[derive(Clone, Debug)]
pub struct Actor {
    root: Option<Placed>,
    bones: [Option<Placed>; BONES.len()],
    bound: Option<Bound>,
}

/// The actor's skeleton once it stands.
#[derive(Clone, Debug)]
struct Bound {
    motion: Motion,
    /// `[joints]`: the bone of each joint; `None` for the root.
    bones: Vec<Option<usize>>,
}

impl Default for Actor {
    fn default() -> Self {
        Self {
            root: None,
            bones: [None; BONES.len()],
            bound: None,
        }
    }
}

impl Actor {
    /// Takes over what a datagram says.
    pub fn take(&mut self, packet: &Packet) {
        self.root = packet.root.or(self.root);
        for &(bone, placed) in &packet.bones {
            self.bones[bone] = Some(placed);
        }
    }

    /// Needed bones that were not heard of yet.
    #[must_use]
    pub fn missing(&self) -> Vec<&'static str> {
        let seen = |name: &&str| {
            let bone = BONES.iter().position(|(bone, _)| bone == name);
            bone.is_some_and(|bone| self.bones[bone].is_some())
        };
        NEEDED.into_iter().filter(|name| !seen(name)).collect()
    }

    /// Makes the skeleton out of the bones heard of so far: call it when a whole frame is in.
    pub fn bind(&mut self) {
        let at_rest = |position| Transform {
            translation: position,
            ..Transform::IDENTITY
        };
        let mut joints = vec![Joint {
            name: ROOT.into(),
            parent: None,
            rest: Transform::IDENTITY,
        }];
        let mut bones = vec![None];
        let mut places = [None; BONES.len()];
        for (bone, (name, parent)) in BONES.iter().enumerate() {
            let Some(placed) = self.bones[bone] else {
                continue;
            };
            // Bones that the model does not have are left out of the chain.
            let mut above = *parent;
            while let Some(missing) = above.filter(|&bone| places[bone].is_none()) {
                above = BONES[missing].1;
            }
            places[bone] = Some(joints.len());
            bones.push(Some(bone));
            joints.push(Joint {
                name: (*name).into(),
                parent: Some(above.and_then(|above| places[above]).unwrap_or(0)),
                rest: at_rest(placed.position),
            });
        }
        self.bound = Some(Bound {
            motion: Motion {
                skeleton: Skeleton { joints },
                end_sites: Vec::new(),
                clip: Clip::default(),
            },
            bones,
        });
    }

    /// The skeleton in the T-pose, bound; its clip is empty.
    #[must_use]
    pub fn motion(&self) -> Option<&Motion> {
        self.bound.as_ref().map(|bound| &bound.motion)
    }

    /// The last pose of the skeleton, local.
    #[must_use]
    pub fn pose(&self) -> Vec<Transform> {
        let bones = self.bound.iter().flat_map(|bound| &bound.bones);
        let placed = bones.map(|bone| match bone {
            None => self.root,
            Some(bone) => self.bones[*bone],
        });
        let transform = |placed: Option<Placed>| Transform {
            translation: placed.map_or(DVec3::ZERO, |placed| placed.position),
            rotation: placed.map_or(DQuat::IDENTITY, |placed| placed.rotation),
            scale: DVec3::ONE,
        };
        placed.map(transform).collect()
    }
}

/// A body that follows an actor.
#[derive(Clone, Debug)]
pub struct Follower {
    target: Skeleton,
    joints: Correspondence,
    options: Options,
}

impl Follower {
    /// Joins the joints of both.
    ///
    /// # Errors
    /// [`LiveError::Fit`] where the two skeletons cannot be matched.
    pub fn new(
        actor: &Motion,
        target: &Skeleton,
        pairs: &[(String, String)],
    ) -> Result<Self, LiveError> {
        let joints = Correspondence::new(&actor.skeleton, target, pairs)?;
        // In a stream nobody knows where the motion will have begun.
        let options = Options {
            keep_origin: true,
            ..Options::default()
        };
        Ok(Self {
            target: target.clone(),
            joints,
            options,
        })
    }

    /// The body's pose, local. O(joints)
    ///
    /// # Errors
    /// [`LiveError::Fit`] where the actor's T-pose is none.
    pub fn pose(&self, actor: &Motion, pose: &[Transform]) -> Result<Vec<Transform>, LiveError> {
        let local = retarget_pose(actor, pose, &self.target, &self.joints, &self.options)?;
        Ok(local)
    }
}

/// Poses with their times, to be kept.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    times: Vec<f64>,
    poses: Vec<Vec<Transform>>,
}

impl Recording {
    /// Adds a pose later than all before.
    pub fn push(&mut self, time: f64, pose: Vec<Transform>) {
        if self.times.last().is_none_or(|&last| time > last) {
            self.times.push(time);
            self.poses.push(pose);
        }
    }

    /// Poses so far.
    #[must_use]
    pub fn len(&self) -> usize {
        self.times.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }

    /// The motion, its time from 0 on; sampled evenly at the stream's usual rate where it is
    /// written. `None` without a pose.
    #[must_use]
    pub fn motion(&self, actor: &Motion) -> Option<Motion> {
        let first = *self.times.first()?;
        let times: Vec<f64> = self.times.iter().map(|time| time - first).collect();
        let mut gaps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        gaps.sort_by(f64::total_cmp);
        let usual = gaps.get(gaps.len() / 2).copied();
        let joints = &actor.skeleton.joints;
        let mut tracks = Vec::new();
        for joint in 0..joints.len() {
            let placed = joints[joint].parent.is_none() || joints[joint].name == "Hips";
            let translation = placed.then_some(Channel::Translation);
            for channel in translation.into_iter().chain([Channel::Rotation]) {
                let values = Vec::with_capacity(times.len());
                let mut track = Track::linear(joint, channel, &times, values);
                for pose in &self.poses {
                    let Transform {
                        translation,
                        rotation,
                        ..
                    } = pose[joint];
                    match channel {
                        Channel::Rotation => track.push_rotation(rotation),
                        _ => track.values.push(translation.extend(0.0).to_array()),
                    }
                }
                tracks.push(track);
            }
        }
        Some(Motion {
            clip: Clip {
                name: "live".into(),
                tracks,
                morph_track: None,
                duration: times.last().copied().unwrap_or(0.0),
                sample_period: usual.map(|usual| (usual * 1e6).round() / 1e6),
            },
            ..actor.clone()
        })
    }
}
