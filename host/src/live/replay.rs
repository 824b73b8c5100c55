//! Datagrams from a recording, so that a receiver can be tried without a studio; and what a network
//! does to datagrams.

use glam::{DQuat, DVec3};

use super::LiveError;
use super::points::{Frame, Point};
use super::vmc::{BONES, Packet, Placed};
use crate::fit::{Correspondence, Options, retarget};
use crate::model::{Clip, Joint, Motion, Skeleton, Transform};
use crate::reference::pose::sample;
use crate::studio::Random;
use crate::take::Take;

/// Where the joints of a body 1.7 m tall are in the T-pose, metres; its left is +X, it faces +Z.
const T_POSE: [(&str, [f64; 3]); 22] = [
    ("Hips", [0.0, 0.92, 0.0]),
    ("Spine", [0.0, 1.0, 0.0]),
    ("Chest", [0.0, 1.12, -0.01]),
    ("UpperChest", [0.0, 1.25, -0.02]),
    ("Neck", [0.0, 1.44, -0.02]),
    ("Head", [0.0, 1.53, 0.0]),
    ("LeftShoulder", [0.03, 1.39, -0.02]),
    ("LeftUpperArm", [0.16, 1.39, -0.03]),
    ("LeftLowerArm", [0.43, 1.39, -0.03]),
    ("LeftHand", [0.67, 1.39, -0.03]),
    ("RightShoulder", [-0.03, 1.39, -0.02]),
    ("RightUpperArm", [-0.16, 1.39, -0.03]),
    ("RightLowerArm", [-0.43, 1.39, -0.03]),
    ("RightHand", [-0.67, 1.39, -0.03]),
    ("LeftUpperLeg", [0.09, 0.88, 0.0]),
    ("LeftLowerLeg", [0.09, 0.48, 0.01]),
    ("LeftFoot", [0.09, 0.08, -0.02]),
    ("LeftToes", [0.09, 0.02, 0.12]),
    ("RightUpperLeg", [-0.09, 0.88, 0.0]),
    ("RightLowerLeg", [-0.09, 0.48, 0.01]),
    ("RightFoot", [-0.09, 0.08, -0.02]),
    ("RightToes", [-0.09, 0.02, 0.12]),
];

/// A motion on a humanoid whose bones lie along the axes in the T-pose, as the protocol wants it.
#[derive(Clone, Debug)]
pub struct Performer {
    skeleton: Skeleton,
    clip: Clip,
    /// `[joints]`: bone of each.
    bones: Vec<usize>,
}

impl Performer {
    /// Carries a motion over to that humanoid.
    ///
    /// # Errors
    /// [`LiveError::Fit`] where the motion is not a human's.
    pub fn new(motion: &Motion) -> Result<Self, LiveError> {
        let mut bones = Vec::new();
        let mut joints: Vec<Joint> = Vec::new();
        let place = |name: &str| T_POSE.iter().find(|(bone, _)| *bone == name);
        for (bone, &(name, parent)) in BONES.iter().enumerate() {
            let Some((_, position)) = place(name) else {
                continue;
            };
            let above = parent.and_then(|parent| bones.iter().position(|&bone| bone == parent));
            let above_at = parent.and_then(|parent| place(BONES[parent].0));
            let above_at = above_at.map_or(DVec3::ZERO, |(_, at)| DVec3::from_array(*at));
            bones.push(bone);
            joints.push(Joint {
                name: name.into(),
                parent: above,
                rest: Transform {
                    translation: DVec3::from_array(*position) - above_at,
                    ..Transform::IDENTITY
                },
            });
        }
        let skeleton = Skeleton { joints };
        let matched = Correspondence::new(&motion.skeleton, &skeleton, &[])?;
        let options = Options::default();
        let clip = retarget(motion, &skeleton, &matched, &options)?.clip;
        Ok(Self {
            skeleton,
            clip,
            bones,
        })
    }

    /// Seconds of the motion.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.clip.duration
    }

    /// What to send at `sent` seconds of the sender's clock; the motion repeats.
    #[must_use]
    pub fn packet(&self, sent: f64) -> Packet {
        let rounds = self.clip.duration.max(1e-3);
        let local = sample(&self.skeleton, &self.clip, sent.rem_euclid(rounds));
        let placed = local.iter().map(|local| Placed {
            position: local.translation,
            rotation: local.rotation,
        });
        Packet {
            time: Some(sent),
            tracked: Some(true),
            root: Some(Placed {
                position: DVec3::ZERO,
                rotation: DQuat::IDENTITY,
            }),
            bones: self.bones.iter().copied().zip(placed).collect(),
        }
    }
}

/// The points of a frame of a take; it repeats. Without labels they come in another order each time.
#[must_use]
pub fn points(take: &Take, number: u32, microseconds: u64, labelled: bool) -> Frame {
    let frame = number as usize % take.frame_count().max(1);
    let seen = take.seen(frame);
    let mut points: Vec<Point> = seen
        .map(|(marker, position)| Point {
            marker: labelled.then_some(marker as u32),
            position: position.as_vec3().to_array(),
        })
        .collect();
    if !labelled {
        let mut random = Random::new(u64::from(number));
        for last in (1..points.len()).rev() {
            points.swap(last, random.index(last + 1));
        }
    }
    Frame {
        number,
        microseconds,
        points,
    }
}

/// What goes wrong on the way, each as a part of all datagrams.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// Never arrive.
    pub lost: f64,
    /// Arrive twice.
    pub doubled: f64,
    /// Arrive after the one that follows.
    pub swapped: f64,
}

/// A network with faults, the same for the same seed.
#[derive(Clone, Debug)]
pub struct Network {
    faults: Faults,
    random: Random,
    kept_back: Option<Vec<u8>>,
}

impl Network {
    /// A network in order.
    #[must_use]
    pub fn new(faults: Faults, seed: u64) -> Self {
        Self {
            faults,
            random: Random::new(seed),
            kept_back: None,
        }
    }

    /// What arrives when this is sent.
    pub fn send(&mut self, datagram: Vec<u8>) -> Vec<Vec<u8>> {
        let mut arrives = Vec::new();
        let before = self.kept_back.take();
        if self.random.unit() >= self.faults.lost {
            if self.random.unit() < self.faults.doubled {
                arrives.push(datagram.clone());
            }
            if before.is_none() && self.random.unit() < self.faults.swapped {
                self.kept_back = Some(datagram);
            } else {
                arrives.push(datagram);
            }
        }
        arrives.extend(before);
        arrives
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_as_frequent_as_asked() {
        let faults = Faults {
            lost: 0.05,
            doubled: 0.1,
            swapped: 0.2,
        };
        let mut network = Network::new(faults, 1);
        let (mut count, mut back, mut last) = (0, 0, 0);
        for number in 0_u32..10_000 {
            for datagram in network.send(number.to_le_bytes().to_vec()) {
                let number = u32::from_le_bytes(datagram.try_into().expect("four bytes"));
                count += 1;
                back += u32::from(number < last);
                last = number;
            }
        }
        assert!((10_300..10_600).contains(&count), "{count}");
        assert!((1_200..2_200).contains(&back), "{back}");
    }
}
