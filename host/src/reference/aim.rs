//! Inverse kinematics: what [`sinew_core::pose::aim`] should compute.

use glam::{DQuat, DVec3};

/// Rotations in model space that bring the end of a two-bone limb to a target: of the upper bone,
/// of the lower bone.
///
/// `joints`: upper, middle and end joint, metres. The middle joint stays a hinge: both bones turn
/// with the plane of the limb, which `pole` (a direction) sets, if given. `None` where a bone has no
/// length or the target lies on the upper joint. Law of cosines.
#[must_use]
pub fn two_bone(joints: [DVec3; 3], target: DVec3, pole: Option<DVec3>) -> Option<[DQuat; 2]> {
    let [a, b, c] = joints;
    let (first, second) = (b - a, c - b);
    let (long, short) = (first.length(), second.length());
    let first = first.try_normalize()?;
    let second = second.try_normalize()?;
    let along = (target - a).try_normalize()?;
    let line = (c - a).try_normalize().unwrap_or(first);
    let wanted = pole.unwrap_or(first).try_normalize()?;
    let bend = Some(first.reject_from_normalized(line)).filter(|bend| bend.length() > 1e-3);
    let bend = bend.unwrap_or(wanted.reject_from_normalized(line));
    let bend = bend
        .try_normalize()
        .unwrap_or(line.any_orthonormal_vector());
    let side = pole.map_or(arc(line, along) * bend, |_| wanted);
    let side = side.reject_from_normalized(along).try_normalize();
    let side = side.unwrap_or(along.any_orthonormal_vector());
    let reached = (target - a).length();
    let reached = reached.clamp(
        (long - short).abs().max(1e-6 * (long + short)),
        long + short,
    );
    let cosine = (long * long + reached * reached - short * short) / (2.0 * long * reached);
    let angle = cosine.clamp(-1.0, 1.0).acos();
    let upper_wanted = along * angle.cos() + side * angle.sin();
    let lower_wanted = (along * reached - upper_wanted * long).try_normalize()?;
    let upper = frame(upper_wanted, along.cross(side)) * frame(first, line.cross(bend)).inverse();
    let lower = arc(upper * second, lower_wanted) * upper;
    Some([upper, lower])
}

/// The smallest rotation from one unit vector to another.
fn arc(from: DVec3, to: DVec3) -> DQuat {
    DQuat::from_rotation_arc(from, to)
}

/// The rotation from x and y to a direction and one across it.
fn frame(x: DVec3, across: DVec3) -> DQuat {
    let y = across
        .reject_from_normalized(x)
        .normalize_or(x.any_orthonormal_vector());
    DQuat::from_mat3(&glam::DMat3::from_cols(x, y, x.cross(y)))
}
