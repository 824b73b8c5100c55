//! Skin from dense markers (Park & Hodgins 2006, section 5.3), in three modes.
//!
//! [`MarkerRig::follow`] fits a frame to each near-rigid part and completes the markers. Then
//! vertices stream by in blocks of eight:
//!
//! - [`Collapsed`]: a fixed sum over markers, `v = sum_k c_k p_k`.
//! - [`Hybrid`]: skinning on the part frames, over a rest shape that marker residuals displace.
//! - [`Exact`]: the paper's quadratic transformation and radial-basis residual of each part, solved
//!   each frame.
//!
//! Where there are no markers, [`Corrective`] predicts weights of morph targets from the skeleton.
//!
//! In every mode the normal of a vertex follows from two tangents that move with it; no mode looks
//! at triangles.

mod collapsed;
mod corrective;
mod error;
mod exact;
mod exact_frame;
mod hybrid;
mod motion;
mod rig;
mod rig_check;
mod slots;
mod springs;

use super::lanes::Lanes;

pub use collapsed::Collapsed;
pub use corrective::{
    BEND_FEATURES, Corrective, CorrectiveState, CorrectiveTables, PART_FEATURES,
    corrective_feature_count, corrective_multiply_adds, corrective_state_len,
};
pub use error::{PartsError, PartsTable};
pub use exact::{Exact, ExactTables};
pub use exact_frame::{
    ExactBudget, ExactHandles, ExactReport, ExactState, exact_state_len, exact_workspace_len,
};
pub use hybrid::{Hybrid, PartFrames};
pub use rig::{FollowReport, Followed, MarkerRig, RigState, rig_state_len, rig_workspace_len};
pub(crate) use rig::{HELD, REFITS};
pub use rig_check::MarkerRigTables;
pub(crate) use slots::row;
pub use slots::{MarkerRows, MarkerSlots, PartBlocks};

/// Two unit tangents of a unit normal, right-handed with it (Duff et al., *Building an Orthonormal
/// Basis, Revisited*, 2017): what the coefficients of [`MarkerSlots`] refer to.
#[must_use]
pub fn tangents_of(normal: [f32; 3]) -> [[f32; 3]; 2] {
    tangents((), normal)
}

#[inline(always)]
fn tangents<L: Lanes>(token: L::Token, [x, y, z]: [L; 3]) -> [[L; 3]; 2] {
    let (zero, one) = (L::splat(token, 0.0), L::splat(token, 1.0));
    let sign = one.with_sign(z);
    let a = zero.sub(one.div(sign.add(z)));
    let b = x.mul(y).mul(a);
    let along = [
        one.add(sign.mul(x.mul(x).mul(a))),
        sign.mul(b),
        zero.sub(sign.mul(x)),
    ];
    let across = [b, sign.add(y.mul(y).mul(a)), zero.sub(y)];
    [along, across]
}

/// x, y and z of a lane.
#[inline(always)]
fn lane_of<const N: usize>(lanes: &[[f32; N]; 3], lane: usize) -> [f32; 3] {
    lanes.map(|axis| axis.get(lane).copied().unwrap_or(0.0))
}

#[inline(always)]
fn cross<L: Lanes>([a, b, c]: [L; 3], [x, y, z]: [L; 3]) -> [L; 3] {
    [
        b.mul(z).sub(c.mul(y)),
        c.mul(x).sub(a.mul(z)),
        a.mul(y).sub(b.mul(x)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tangents_stand_upright_and_right_handed_for_every_normal() {
        for k in 0..200 {
            let (u, h) = (k as f32 * 2.4, -1.0 + k as f32 / 99.5);
            let r = libm::sqrtf((1.0 - h * h).max(0.0));
            let normal = [r * libm::cosf(u), r * libm::sinf(u), h];
            let [along, across] = tangents_of(normal);
            let found = cross(along, across);
            for (found, normal) in found.iter().zip(normal) {
                assert!((found - normal).abs() < 1e-5, "{normal} {found}");
            }
        }
    }
}
