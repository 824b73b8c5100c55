//! Dual quaternion skinning and centres of rotation.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::model::{Mesh, Skeleton, Skin, Transform, nearest_rotation};

/// A bind's matrix as a rotation, a translation, and the stretch before both.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    rotation: DQuat,
    translation: DVec3,
    stretch: DMat3,
    matrix: DAffine3,
}

/// `[binds]`: rotations are chained without scales; what remains of a bind's matrix is stretch.
#[must_use]
pub fn motions(skeleton: &Skeleton, skin: &Skin, local: &[Transform]) -> Vec<Motion> {
    let model = skeleton.model(local);
    let mut rotations: Vec<DQuat> = Vec::with_capacity(model.len());
    for (joint, local) in skeleton.joints.iter().zip(local) {
        let own = local.rotation.normalize();
        rotations.push(joint.parent.map_or(own, |parent| rotations[parent] * own));
    }
    let motion = |bind: &crate::model::Bind| {
        let matrix = model[bind.joint] * bind.inverse_bind;
        let rotation = rotations[bind.joint] * nearest_rotation(&bind.inverse_bind.matrix3);
        Motion {
            rotation,
            translation: matrix.translation,
            stretch: DMat3::from_quat(rotation).transpose() * matrix.matrix3,
            matrix,
        }
    };
    skin.binds.iter().map(motion).collect()
}

/// Skinned positions and unit normals, `[vertices]` each: stretches blended linearly, then dual
/// quaternions (Kavan et al. 2008, section 3), of two opposite ones the one nearer to the sum of
/// the binds before; normals by the same matrix.
#[must_use]
pub fn dual_quaternion(mesh: &Mesh, skin: &Skin, motions: &[Motion]) -> (Vec<DVec3>, Vec<DVec3>) {
    each(mesh, skin, motions, |_, influences| {
        let (mut real, mut dual) = (DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), [0.0; 4]);
        let mut stretch = DMat3::ZERO;
        for &(bind, weight) in influences {
            let motion = &motions[bind as usize];
            let q = motion.rotation;
            let t = motion.translation;
            let half = (DQuat::from_xyzw(t.x, t.y, t.z, 0.0) * q) * 0.5;
            let signed = if real.dot(q) < 0.0 { -weight } else { weight };
            real += q * signed;
            for (sum, value) in dual.iter_mut().zip(half.to_array()) {
                *sum += signed * value;
            }
            stretch += motion.stretch * weight;
        }
        let length = real.length();
        let (real, dual) = (
            real * (1.0 / length),
            DQuat::from_array(dual) * (1.0 / length),
        );
        let t = (dual * real.conjugate()) * 2.0;
        DAffine3 {
            matrix3: DMat3::from_quat(real) * stretch,
            translation: t.xyz(),
        }
    })
}

/// The same about centres of rotation `[vertices]` (Le and Hodgins 2016, algorithm 2).
#[must_use]
pub fn about_centres(
    mesh: &Mesh,
    skin: &Skin,
    motions: &[Motion],
    centres: &[DVec3],
) -> (Vec<DVec3>, Vec<DVec3>) {
    each(mesh, skin, motions, |vertex, influences| {
        let mut real = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
        let (mut stretch, mut moved) = (DMat3::ZERO, DVec3::ZERO);
        for &(bind, weight) in influences {
            let motion = &motions[bind as usize];
            let q = motion.rotation;
            let signed = if real.dot(q) < 0.0 { -weight } else { weight };
            real += q * signed;
            stretch += motion.stretch * weight;
            moved += weight * motion.matrix.transform_point3(centres[vertex]);
        }
        let matrix3 = DMat3::from_quat(real.normalize()) * stretch;
        DAffine3 {
            matrix3,
            translation: moved - matrix3 * centres[vertex],
        }
    })
}

/// One matrix a vertex, except where one bind has all of the weight.
fn each(
    mesh: &Mesh,
    skin: &Skin,
    motions: &[Motion],
    matrix: impl Fn(usize, &[(u32, f64)]) -> DAffine3,
) -> (Vec<DVec3>, Vec<DVec3>) {
    let vertices = mesh.positions.iter().zip(&mesh.normals).enumerate();
    vertices
        .map(|(vertex, (&position, &normal))| {
            let mut influences = skin.influences[vertex].clone();
            influences.sort_by_key(|&(bind, _)| bind);
            let matrix = match influences[..] {
                [(bind, _)] => motions[bind as usize].matrix,
                _ => matrix(vertex, &influences),
            };
            let point = matrix.transform_point3(position);
            (point, matrix.transform_vector3(normal).normalize_or_zero())
        })
        .unzip()
}
