//! The joint palette as rotation, translation and stretch.

use super::{Joint12, Local};
use crate::asset::{Asset, NO_PARENT};
use crate::math::{Quat4, affine, normalise, quaternion_product};

/// A bind's matrix taken apart: rotation x y z w; half the product of its translation, as a
/// quaternion, with the rotation; the stretch that acts before, rows of 3 x 3.
pub type Dual17 = [f32; 17];

const UPRIGHT: Quat4 = [0.0, 0.0, 0.0, 1.0];

/// Chains the rotations of local transforms down the hierarchy, scales left out.
///
/// `local: [joints]`; `rotations: [joints]`, old contents do not matter. O(joints)
pub fn rotations(asset: &Asset<'_>, local: &[Local], rotations: &mut [Quat4]) {
    for (joint, (&parent, local)) in asset.parents.iter().zip(local).enumerate() {
        let &[x, y, z, w, ..] = local;
        let above = if parent == NO_PARENT {
            None
        } else {
            rotations.get(usize::from(parent))
        };
        let own = match above {
            Some(&above) => quaternion_product(above, [x, y, z, w]),
            None => [x, y, z, w],
        };
        if let Some(slot) = rotations.get_mut(joint) {
            *slot = normalise(own).unwrap_or(UPRIGHT);
        }
    }
}

/// Takes the palette apart and returns whether some bind has a stretch.
///
/// `palette: [binds]`, `rotations: [joints]`; `duals: [binds]`, old contents do not matter.
/// Whatever the rotation is, rotation after stretch is the palette's matrix again. O(binds)
pub fn duals(
    asset: &Asset<'_>,
    palette: &[Joint12],
    rotations: &[Quat4],
    duals: &mut [Dual17],
) -> bool {
    let mut stretched = false;
    let binds = asset.bind_joints.iter().zip(asset.bind_rotations);
    for (slot, ((&joint, &bind), matrix)) in duals.iter_mut().zip(binds.zip(palette)) {
        let turn = rotations.get(usize::from(joint)).copied();
        let turn = normalise(quaternion_product(turn.unwrap_or(UPRIGHT), bind));
        let turn = turn.unwrap_or(UPRIGHT);
        let &[_, _, _, tx, _, _, _, ty, _, _, _, tz] = matrix;
        let half = quaternion_product([0.5 * tx, 0.5 * ty, 0.5 * tz, 0.0], turn);
        let rotation = affine(turn, [0.0; 3], [1.0; 3]);
        let mut dual = [0.0; 17];
        for (to, value) in dual.iter_mut().zip(turn.into_iter().chain(half)) {
            *to = value;
        }
        for (at, to) in dual.iter_mut().skip(8).enumerate() {
            let (row, column) = (at / 3, at % 3);
            let mut sum = 0.0;
            for (turn, matrix) in rotation
                .as_chunks::<4>()
                .0
                .iter()
                .zip(matrix.as_chunks::<4>().0)
            {
                sum += turn[row] * matrix[column];
            }
            let straight = if row == column { 1.0 } else { 0.0 };
            stretched |= !(-ROUNDING..=ROUNDING).contains(&(sum - straight));
            *to = sum;
        }
        *slot = dual;
    }
    stretched
}

/// What a chain of joints loses by rounding.
const ROUNDING: f32 = 4e-6;
