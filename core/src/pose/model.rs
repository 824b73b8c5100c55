//! Local to model space, and model space to the joint palette.

use super::Local;
use crate::asset::{Asset, NO_PARENT};
use crate::math::{Affine12, affine, compose};

/// A joint's matrix, rows of 3 x 4.
pub type Joint12 = Affine12;

/// Numbers in a model matrix beyond this are refused, so that skinning cannot overflow.
const LARGEST_MODEL: f32 = 1e9;

/// Chains local transforms down the hierarchy (Mažrimas & Beinaravičius, section 2: `M_i`).
///
/// Returns how many joints came out beyond range (only scales multiplied many times do that);
/// these take their parent's matrix instead.
/// `local: [joints]`; `model: [joints]`, old contents do not matter. O(joints)
pub fn to_model(asset: &Asset<'_>, local: &[Local], model: &mut [Joint12]) -> usize {
    let mut beyond = 0;
    for (joint, (&parent, local)) in asset.parents.iter().zip(local).enumerate() {
        let &[rx, ry, rz, rw, tx, ty, tz, sx, sy, sz] = local;
        let own = affine([rx, ry, rz, rw], [tx, ty, tz], [sx, sy, sz]);
        let above = if parent == NO_PARENT {
            None
        } else {
            model.get(usize::from(parent))
        };
        let mut matrix = match above {
            Some(above) => compose(above, &own),
            None => own,
        };
        if !matrix
            .iter()
            .all(|x| (-LARGEST_MODEL..=LARGEST_MODEL).contains(x))
        {
            beyond += 1;
            matrix = above.copied().unwrap_or(crate::math::IDENTITY);
        }
        if let Some(slot) = model.get_mut(joint) {
            *slot = matrix;
        }
    }
    beyond
}

/// Numbers below this become zero, and zeros positive: then a weight of zero changes no sum, not
/// even the sign of a zero, and kernels may leave it out.
const SMALLEST: f32 = 1e-30;

fn settled(value: f32) -> f32 {
    if (-SMALLEST..=SMALLEST).contains(&value) {
        0.0
    } else {
        value
    }
}

/// What skinning multiplies by: `M_i D_i^-1` for every bind (Mažrimas & Beinaravičius, section 2).
///
/// `model: [joints]`; `palette: [binds]`, old contents do not matter. O(binds)
pub fn palette(asset: &Asset<'_>, model: &[Joint12], palette: &mut [Joint12]) {
    let binds = asset.bind_joints.iter().zip(asset.inverse_bind);
    for (slot, (&joint, inverse)) in palette.iter_mut().zip(binds) {
        if let Some(model) = model.get(usize::from(joint)) {
            *slot = compose(model, inverse).map(settled);
        }
    }
}
