//! A rig that follows its mesh into another shape.

use glam::{DAffine3, DQuat, DVec3};

use super::Registration;
use super::field::Field;
use super::figure::{Figure, Placed};
use crate::fit::laplace::LaplaceError;
use crate::model::{Avatar, Bind, Joint, Skeleton, Transform, nearest_rotation};

/// `[joints]`: joint to the markers' space: turned with the posed rig, moved with the skin around
/// the joint. O(influences)
pub(super) fn joints(
    avatar: &Avatar,
    figure: &Figure,
    placed: &Placed,
    field: &Field,
    node_of: &[usize],
) -> Vec<DAffine3> {
    let joints = &avatar.skeleton.joints;
    let posed: Vec<DVec3> = (0..joints.len())
        .map(|joint| {
            let node = figure.node_of[joint];
            let arm = figure.bind[joint].translation - figure.origins[node];
            placed.origins[node] + placed.turns[node] * arm * placed.sizes[node]
        })
        .collect();
    // What moves with a joint and with the one above surrounds it.
    let mut sums = vec![(DVec3::ZERO, 0.0); joints.len()];
    for (vertex, list) in avatar.skin.influences.iter().enumerate() {
        let of = |wanted: usize| -> f64 {
            let on = |&&(bind, _): &&(u32, f64)| avatar.skin.binds[bind as usize].joint == wanted;
            list.iter().filter(on).map(|(_, weight)| weight).sum()
        };
        for &(bind, weight) in list {
            let joint = avatar.skin.binds[bind as usize].joint;
            let above = joints[joint].parent.map_or(weight, of);
            let share = weight.min(above) + 1e-6 * weight;
            let carried = field.carry(node_of[vertex], posed[joint]);
            sums[joint].0 += carried * share;
            sums[joint].1 += share;
        }
    }
    let mut shift = vec![DVec3::ZERO; joints.len()];
    let mut out = Vec::with_capacity(joints.len());
    for (joint, (sum, weight)) in sums.into_iter().enumerate() {
        shift[joint] = if weight > 0.0 {
            sum / weight - posed[joint]
        } else {
            joints[joint]
                .parent
                .map_or(DVec3::ZERO, |above| shift[above])
        };
        let turn = placed.turns[figure.node_of[joint]];
        let bound = nearest_rotation(&figure.bind[joint].matrix3);
        let turn: DQuat = turn * bound;
        out.push(DAffine3::from_rotation_translation(
            turn.normalize(),
            posed[joint] + shift[joint],
        ));
    }
    out
}

/// The body in its registered shape and pose: the mesh, and a rig whose rest pose is that pose. Its
/// morph targets and tangents are dropped: they belong to the old shape. Clips keep their turns.
///
/// # Errors
/// A registration of another body.
pub fn rerig(avatar: &Avatar, registration: &Registration) -> Result<Avatar, LaplaceError> {
    let (found, needed) = (registration.positions.len(), avatar.mesh.positions.len());
    let joint_count = avatar.skeleton.joints.len();
    if found != needed || registration.joints.len() != joint_count {
        return Err(LaplaceError::PoseLength {
            pose: 0,
            found,
            needed,
        });
    }
    let model = &registration.joints;
    let joint = |(at, joint): (usize, &Joint)| {
        let local = match joint.parent {
            Some(above) => model[above].inverse() * model[at],
            None => model[at],
        };
        let (scale, rotation, translation) = local.to_scale_rotation_translation();
        Joint {
            rest: Transform {
                translation,
                rotation,
                scale,
            },
            ..joint.clone()
        }
    };
    let joints = avatar.skeleton.joints.iter().enumerate().map(joint);
    let mut out = avatar.clone();
    out.skeleton = Skeleton {
        joints: joints.collect(),
    };
    let bind = |bind: &Bind| Bind {
        joint: bind.joint,
        inverse_bind: model[bind.joint].inverse(),
    };
    out.skin.binds = avatar.skin.binds.iter().map(bind).collect();
    out.mesh = super::reshaped(&avatar.mesh, &registration.positions);
    for clip in &mut out.clips {
        clip.morph_track = None;
    }
    Ok(out)
}
