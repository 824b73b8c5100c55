//! Poses over which errors are summed.

use glam::{DAffine3, DQuat, DVec3};

use crate::model::Avatar;

/// Radians by which every joint is turned.
const TURN: f64 = 0.6;

/// `[poses][vertices]`, metres: at rest; with every joint turned about each of its axes, some one
/// way and some the other; with every other morph target in full.
///
/// Nobody knows which motion will come, so joints are treated alike. O(poses x vertices)
pub(super) fn positions(avatar: &Avatar) -> Vec<Vec<DVec3>> {
    let mesh = &avatar.mesh;
    let mut poses = vec![mesh.positions.clone()];
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        let mut local = avatar.skeleton.rest();
        for (joint, local) in local.iter_mut().enumerate() {
            let turn = if joint % 2 == 0 { TURN } else { -TURN };
            local.rotation *= DQuat::from_axis_angle(axis, turn);
        }
        let model = avatar.skeleton.model(&local);
        poses.push(skinned(avatar, &model));
    }
    for odd in 0..mesh.morphs.len().min(2) {
        let mut positions = mesh.positions.clone();
        for morph in mesh.morphs.iter().skip(odd).step_by(2) {
            for (position, offset) in positions.iter_mut().zip(&morph.positions) {
                *position += *offset;
            }
        }
        poses.push(positions);
    }
    poses
}

fn skinned(avatar: &Avatar, model: &[DAffine3]) -> Vec<DVec3> {
    let binds = avatar.skin.binds.iter();
    let palette: Vec<DAffine3> = binds
        .map(|bind| model[bind.joint] * bind.inverse_bind)
        .collect();
    let vertices = avatar.mesh.positions.iter().zip(&avatar.skin.influences);
    let blend = |(position, influences): (&DVec3, &Vec<(u32, f64)>)| {
        let parts = influences.iter();
        parts
            .map(|&(bind, weight)| weight * palette[bind as usize].transform_point3(*position))
            .sum()
    };
    vertices.map(blend).collect()
}
