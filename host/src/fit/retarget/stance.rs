//! What a pose of a human body shows: where it faces, how long its legs are, where they begin.

use glam::{DQuat, DVec3};

use crate::fit::humanoid::{Humanoid, Part, Role, SIDES};
use crate::fit::{FitError, Which};
use crate::model::{Skeleton, Transform};

/// Beyond this angle from the vertical a spine does not stand.
const UPRIGHT_LIMIT: f64 = 45.0;

/// Model-space rotations and positions of all joints.
pub(super) struct Pose {
    pub(super) rotations: Vec<DQuat>,
    pub(super) positions: Vec<DVec3>,
}

impl Pose {
    /// From local transforms.
    pub(super) fn new(skeleton: &Skeleton, local: &[Transform]) -> Self {
        let mut rotations: Vec<DQuat> = Vec::with_capacity(local.len());
        for (joint, local) in skeleton.joints.iter().zip(local) {
            let above = joint
                .parent
                .map_or(DQuat::IDENTITY, |parent| rotations[parent]);
            rotations.push((above * local.rotation).normalize());
        }
        let affine = skeleton.model(local);
        Self {
            rotations,
            positions: affine.iter().map(|affine| affine.translation).collect(),
        }
    }

    /// Turns everything about the origin.
    pub(super) fn turn(&mut self, by: DQuat) {
        self.rotations
            .iter_mut()
            .for_each(|rotation| *rotation = by * *rotation);
        self.positions
            .iter_mut()
            .for_each(|position| *position = by * *position);
    }
}

/// Angle of a direction about the vertical, from +Z.
pub(super) fn heading(direction: DVec3) -> f64 {
    direction.x.atan2(direction.z)
}

/// Horizontal direction in which an upright body looks.
pub(in crate::fit) fn facing(
    human: &Humanoid,
    positions: &[DVec3],
    which: Which,
) -> Result<DVec3, FitError> {
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
pub(super) fn sockets(human: &Humanoid, positions: &[DVec3]) -> DVec3 {
    let legs = SIDES.map(|side| human.limb(side, Part::UpperLeg));
    let [left, right] = legs.map(|leg| positions[leg.unwrap_or(human.hips)]);
    (left + right) / 2.0
}

/// Hip to knee to ankle, mean of both sides, metres.
pub(super) fn leg_length(
    human: &Humanoid,
    positions: &[DVec3],
    which: Which,
) -> Result<f64, FitError> {
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

/// The smallest rotation that takes one unit vector to another; as exact near zero as elsewhere.
pub(in crate::fit) fn swing(from: DVec3, to: DVec3) -> DQuat {
    let w = 1.0 + from.dot(to);
    if w < 1e-9 {
        return DQuat::from_rotation_arc(from.normalize(), to.normalize()); // half a turn
    }
    DQuat::from_vec4(from.cross(to).extend(w)).normalize()
}
