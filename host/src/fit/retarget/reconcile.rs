//! How rest poses that differ (T, A, hanging arms) are brought together: step 4 of the module.

use glam::{DQuat, DVec3};

use super::stance::{Pose, heading, swing};
use crate::fit::humanoid::{Humanoid, Part, Role};
use crate::fit::{Correspondence, Drive};
use crate::model::{Motion, Skeleton};

/// A foot whose direction has less than this share in the horizontal has no heading.
const HEADING_LIMIT: f64 = 0.2;

/// `A_j` for every target joint (step 4).
pub(super) fn reconcile(
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
        let bones = bone.zip(other);
        align.push(match part {
            Part::UpperArm | Part::LowerArm | Part::UpperLeg | Part::LowerLeg => {
                bones.map_or(above, |(bone, other)| swing(above * bone, other) * above)
            }
            // A foot that points at the floor has no heading; it is level all the same.
            Part::Foot => match bones {
                Some((bone, other)) if level(bone) && level(other) => {
                    DQuat::from_rotation_y(heading(other) - heading(bone))
                }
                _ => DQuat::IDENTITY,
            },
            Part::Shoulder | Part::Hand | Part::Toes => above,
        });
    }
    align
}

/// For each source joint that begins a limb bone with further joints inside: where the bone ends.
pub(super) fn split_bones(skeleton: &Skeleton, human: &Humanoid) -> Vec<Option<usize>> {
    let mut split = vec![None; skeleton.joints.len()];
    for (&role, &joint) in &human.roles {
        let Role::Limb(
            side,
            part @ (Part::UpperArm | Part::LowerArm | Part::UpperLeg | Part::LowerLeg),
        ) = role
        else {
            continue;
        };
        let end = next_part(part).and_then(|next| human.limb(side, next));
        split[joint] = end.filter(|&end| skeleton.joints[end].parent != Some(joint));
    }
    split
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

fn level(direction: DVec3) -> bool {
    direction.x.hypot(direction.z) > HEADING_LIMIT
}
