//! Linear blend skinning.

use glam::{DAffine3, DVec3};

use crate::model::{Mesh, Skin};

/// Skinned positions and unit normals, `[vertices]` each:
/// `v = sum_i w_i M_i D_i^-1 v_d` (Mažrimas & Beinaravičius, section 2); normals by the same
/// matrix without its translation.
#[must_use]
pub fn linear_blend(mesh: &Mesh, skin: &Skin, model: &[DAffine3]) -> (Vec<DVec3>, Vec<DVec3>) {
    let palette: Vec<DAffine3> = skin
        .binds
        .iter()
        .map(|bind| model[bind.joint] * bind.inverse_bind)
        .collect();
    let vertices = mesh
        .positions
        .iter()
        .zip(&mesh.normals)
        .zip(&skin.influences);
    vertices
        .map(|((&position, &normal), influences)| {
            let (mut point, mut direction) = (DVec3::ZERO, DVec3::ZERO);
            for &(bind, weight) in influences {
                let matrix = &palette[bind as usize];
                point += weight * matrix.transform_point3(position);
                direction += weight * matrix.transform_vector3(normal);
            }
            (point, direction.normalize_or_zero())
        })
        .unzip()
}
