//! Poses mixed with poses: crossfade, additive layers, masks of joints.

use super::Local;
use crate::asset::{Asset, NO_PARENT};
use crate::math::{Quat4, conjugate, normalise, quaternion_product, slerp};

const UPRIGHT: Quat4 = [0.0, 0.0, 0.0, 1.0];

/// Moves a pose toward another one: weight 0 leaves it, 1 takes the other over.
///
/// Rotations along the shorter great arc, translations and scales along a straight line. `local`,
/// `target`: `[joints]`; `mask: [joints]`, factors of the weight from 0 to 1, a joint beyond its end
/// keeps its pose. Weights are clamped to 0 to 1; one that is no number counts as 0. O(joints)
pub fn crossfade(local: &mut [Local], target: &[Local], weight: f32, mask: Option<&[f32]>) {
    for (joint, (local, target)) in local.iter_mut().zip(target).enumerate() {
        let weight = weight_of(joint, weight, mask);
        if weight > 0.0 {
            mix(local, target, weight);
        }
    }
}

pub(super) fn rotation_of(&[x, y, z, w, ..]: &Local) -> Quat4 {
    [x, y, z, w]
}

pub(super) fn set_rotation(local: &mut Local, turn: Quat4) {
    let [x, y, z, w, ..] = local;
    [*x, *y, *z, *w] = turn;
}

/// One joint of [`crossfade`]; `weight` lies between 0 and 1.
pub(super) fn mix(local: &mut Local, target: &Local, weight: f32) {
    let (own, other) = (rotation_of(local), rotation_of(target));
    set_rotation(local, normalise(slerp(own, other, weight)).unwrap_or(own));
    for (value, target) in local.iter_mut().zip(target).skip(4) {
        *value += (target - *value) * weight;
    }
}

/// Writes what a pose adds to a reference pose, for [`add`].
///
/// Rotation: after the reference's. Translation: the difference. Scale: the quotient, 1 where the
/// reference has none. `pose`, `reference`, `delta`: `[joints]`, `delta`'s old contents do not
/// matter. O(joints)
pub fn difference(pose: &[Local], reference: &[Local], delta: &mut [Local]) {
    for ((delta, pose), reference) in delta.iter_mut().zip(pose).zip(reference) {
        let &[px, py, pz, pw, ptx, pty, ptz, psx, psy, psz] = pose;
        let &[rx, ry, rz, rw, rtx, rty, rtz, rsx, rsy, rsz] = reference;
        let turn = quaternion_product(conjugate([rx, ry, rz, rw]), [px, py, pz, pw]);
        let [x, y, z, w] = normalise(turn).unwrap_or(UPRIGHT);
        let quotient = |pose: f32, reference: f32| {
            let quotient = pose / reference;
            if (-1e3..=1e3).contains(&quotient) {
                quotient
            } else {
                1.0
            }
        };
        *delta = [
            x,
            y,
            z,
            w,
            ptx - rtx,
            pty - rty,
            ptz - rtz,
            quotient(psx, rsx),
            quotient(psy, rsy),
            quotient(psz, rsz),
        ];
    }
}

/// Adds a layer that [`difference`] made: weight 1 adds all of it, 0 nothing, a negative one takes
/// it away.
///
/// `local`, `delta`: `[joints]`; `mask` as in [`crossfade`]. Weights are clamped to -1 to 1; one
/// that is no number counts as 0. O(joints)
pub fn add(local: &mut [Local], delta: &[Local], weight: f32, mask: Option<&[f32]>) {
    let against = weight < 0.0;
    let weight = if against { -weight } else { weight };
    for (joint, (local, delta)) in local.iter_mut().zip(delta).enumerate() {
        let weight = weight_of(joint, weight, mask);
        if weight <= 0.0 {
            continue;
        }
        let turn = rotation_of(delta);
        let turn = if against { conjugate(turn) } else { turn };
        let part = slerp(UPRIGHT, turn, weight);
        if let Some(sum) = normalise(quaternion_product(rotation_of(local), part)) {
            set_rotation(local, sum);
        }
        let signed = if against { -weight } else { weight };
        let rest = local.iter_mut().zip(delta).enumerate().skip(4);
        for (at, (value, delta)) in rest {
            if at < 7 {
                *value += signed * delta;
            } else {
                let factor = 1.0 + weight * (delta - 1.0);
                let scaled = if against {
                    *value / factor
                } else {
                    *value * factor
                };
                if (-1e3..=1e3).contains(&scaled) {
                    *value = scaled;
                }
            }
        }
    }
}

fn weight_of(joint: usize, weight: f32, mask: Option<&[f32]>) -> f32 {
    let share = match mask {
        None => 1.0,
        Some(mask) => mask.get(joint).copied().unwrap_or(0.0),
    };
    let weight = weight * share;
    // A NaN fails both comparisons.
    if weight >= 1.0 {
        1.0
    } else if weight > 0.0 {
        weight
    } else {
        0.0
    }
}

/// Writes a mask: `inside` for a joint and all below it, `outside` elsewhere.
///
/// `mask: [joints]`, old contents do not matter. A joint that does not exist leaves all outside.
/// O(joints)
pub fn mask_below(asset: &Asset<'_>, joint: usize, inside: f32, outside: f32, mask: &mut [f32]) {
    // Parents come first, so one pass hands the mark down; weights replace it then.
    for at in 0..mask.len() {
        let parent = asset.parents.get(at).copied().unwrap_or(NO_PARENT);
        let above = if parent == NO_PARENT {
            0.0
        } else {
            mask.get(usize::from(parent)).copied().unwrap_or(0.0)
        };
        if let Some(slot) = mask.get_mut(at) {
            *slot = if at == joint || above > 0.5 { 1.0 } else { 0.0 };
        }
    }
    for slot in mask {
        *slot = if *slot > 0.5 { inside } else { outside };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: f32 = core::f32::consts::FRAC_1_SQRT_2;
    const REST: Local = [0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0, 1.0, 1.0, 1.0];
    /// A quarter turn about x, elsewhere, twice as large.
    const TURNED: Local = [S, 0.0, 0.0, S, 3.0, 2.0, 1.0, 2.0, 2.0, 2.0];

    fn near(a: &Local, b: &Local) {
        let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f32::max) < 1e-6, "{a:?} {b:?}");
    }

    #[test]
    fn the_ends_of_a_crossfade_are_the_poses() {
        for (weight, expected) in [
            (0.0, REST),
            (1.0, TURNED),
            (7.0, TURNED),
            (-1.0, REST),
            (f32::NAN, REST),
        ] {
            let mut pose = [REST];
            crossfade(&mut pose, &[TURNED], weight, None);
            near(&pose[0], &expected);
        }
        let mut pose = [REST; 3];
        crossfade(&mut pose, &[TURNED; 3], 1.0, Some(&[0.0, 1.0]));
        near(&pose[0], &REST);
        near(&pose[1], &TURNED);
        near(&pose[2], &REST);
    }

    #[test]
    fn a_difference_added_gives_the_pose_and_taken_away_the_reference() {
        let mut delta = [Local::default()];
        difference(&[TURNED], &[REST], &mut delta);
        let mut pose = [REST];
        add(&mut pose, &delta, 1.0, None);
        near(&pose[0], &TURNED);
        add(&mut pose, &delta, -1.0, None);
        near(&pose[0], &REST);
        add(&mut pose, &delta, f32::NAN, None);
        near(&pose[0], &REST);
        add(&mut pose, &delta, 0.5, None);
        let eighth = core::f32::consts::FRAC_PI_8;
        let (sine, cosine) = (libm::sinf(eighth), libm::cosf(eighth));
        near(
            &pose[0],
            &[sine, 0.0, 0.0, cosine, 2.0, 2.0, 2.0, 1.5, 1.5, 1.5],
        );
    }
}
