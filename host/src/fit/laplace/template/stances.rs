//! Poses in which people are scanned, for skeletons whose motion never shows them.

use glam::{DQuat, DVec3};

use crate::fit::{Humanoid, Part, Role, Side, Which};
use crate::model::{Skeleton, Transform, nearest_rotation};

/// Angles of arms and of legs from straight down, degrees.
const ARMS: [f64; 6] = [10.0, 25.0, 40.0, 55.0, 70.0, 90.0];
const LEGS: [f64; 3] = [2.0, 10.0, 20.0];

/// Local poses with arms and legs straight out at various angles, soles as at rest; none where
/// limbs are not recognised. `[poses][joints]`. O(joints)
pub(super) fn of(skeleton: &Skeleton) -> Vec<Vec<Transform>> {
    let Ok(body) = Humanoid::new(skeleton, Which::Source) else {
        return Vec::new();
    };
    let joint = |side, part| body.roles.get(&Role::Limb(side, part)).copied();
    let mut stances = Vec::new();
    for legs in LEGS {
        for arms in ARMS {
            let mut local = skeleton.rest();
            for side in [Side::Left, Side::Right] {
                let limbs = [
                    (Part::UpperArm, Part::Hand, arms),
                    (Part::UpperLeg, Part::Foot, legs),
                ];
                for (from, to, degrees) in limbs {
                    let other = if side == Side::Left {
                        Side::Right
                    } else {
                        Side::Left
                    };
                    if let (Some(start), Some(end), Some(opposite)) =
                        (joint(side, from), joint(side, to), joint(other, from))
                    {
                        swing(skeleton, &mut local, [start, end, opposite], degrees);
                    }
                }
            }
            stances.push(local);
        }
    }
    stances
}

/// Turns a limb about its first joint until its last one is so many degrees from straight down,
/// away from the same joint of the other side; the last joint keeps its own rotation.
fn swing(
    skeleton: &Skeleton,
    local: &mut [Transform],
    [start, end, opposite]: [usize; 3],
    degrees: f64,
) {
    let model = skeleton.model(local);
    let place = |joint: usize| model[joint].translation;
    let rotation = |joint: usize| nearest_rotation(&model[joint].matrix3);
    let outward = (place(start) - place(opposite)) * DVec3::new(1.0, 0.0, 1.0);
    let (Some(outward), Some(now)) = (
        outward.try_normalize(),
        (place(end) - place(start)).try_normalize(),
    ) else {
        return;
    };
    let (sin, cos) = degrees.to_radians().sin_cos();
    let turn = DQuat::from_rotation_arc(now, sin * outward - cos * DVec3::Y);
    let kept = rotation(end);
    // Turns the joint in the model's space by a turn of what it hangs on.
    let mut rotate = |joint: usize, to: DQuat, parent: DQuat| {
        local[joint].rotation = (parent.inverse() * to).normalize();
    };
    let above = skeleton.joints[start].parent;
    rotate(
        start,
        turn * rotation(start),
        above.map_or(DQuat::IDENTITY, rotation),
    );
    if let Some(parent) = skeleton.joints[end].parent {
        rotate(end, kept, turn * rotation(parent));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Joint;

    #[test]
    fn arms_of_a_t_pose_come_down_and_feet_stay_level() {
        let joint = |name: &str, parent, x, y| Joint {
            name: name.into(),
            parent,
            rest: Transform {
                translation: DVec3::new(x, y, 0.0),
                ..Transform::IDENTITY
            },
        };
        let mut joints = vec![
            joint("Hips", None, 0.0, 1.0),
            joint("Spine", Some(0), 0.0, 0.4),
            joint("Head", Some(1), 0.0, 0.2),
        ];
        for (side, x) in [("Left", 1.0), ("Right", -1.0)] {
            let first = joints.len();
            joints.push(joint(&format!("{side}Arm"), Some(1), 0.2 * x, 0.0));
            joints.push(joint(&format!("{side}ForeArm"), Some(first), 0.3 * x, 0.0));
            joints.push(joint(&format!("{side}Hand"), Some(first + 1), 0.3 * x, 0.0));
            joints.push(joint(&format!("{side}UpLeg"), Some(0), 0.1 * x, 0.0));
            joints.push(joint(&format!("{side}Leg"), Some(first + 3), 0.0, -0.5));
            joints.push(joint(&format!("{side}Foot"), Some(first + 4), 0.0, -0.5));
        }
        let skeleton = Skeleton { joints };
        let stances = of(&skeleton);
        assert_eq!(stances.len(), 18);
        let model = skeleton.model(&stances[7]);
        // Legs 10 degrees out, arms 25.
        let hand = model[5].translation - model[3].translation;
        let angle = 25.0_f64.to_radians();
        let want = 0.6 * DVec3::new(angle.sin(), -angle.cos(), 0.0);
        assert!(hand.distance(want) < 1e-9, "{hand}");
        let foot = nearest_rotation(&model[14].matrix3);
        assert!(foot.angle_between(DQuat::IDENTITY) < 1e-6);
        let leg = model[14].translation - model[12].translation;
        assert!((leg.x + 10.0_f64.to_radians().sin()).abs() < 1e-9, "{leg}");
    }
}
