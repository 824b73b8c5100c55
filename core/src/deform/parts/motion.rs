//! Rigid motions as they are kept, blended and undone.

use super::rig_check::FAR;
use crate::math::{Affine12, Quat4, conjugate, inverse_sqrt, quaternion_product};
use crate::pose::Dual17;
use crate::solve::dense::Rigid;

pub(super) fn usable(position: &[f32; 3]) -> bool {
    position.iter().all(|x| (-FAR..=FAR).contains(x))
}

pub(super) fn less([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> [f32; 3] {
    [a - x, b - y, c - z]
}

/// The vector at its longest allowed, `None` where it is shorter.
pub(super) fn shortened(vector: [f32; 3], limit: f32) -> Option<[f32; 3]> {
    let [x, y, z] = vector;
    let length2 = x * x + y * y + z * z;
    if length2 <= limit * limit {
        return None;
    }
    let factor = limit * inverse_sqrt(length2);
    Some(vector.map(|value| value * factor))
}

/// Blends that shrink space further than this are undone as if they were rotations.
const SHRUNK: f32 = 0.05;

/// A point of this frame in the rest pose: by Cramer's rule.
pub(super) fn carried_back(frame: &Affine12, [px, py, pz]: [f32; 3]) -> [f32; 3] {
    let &[a, b, c, x, d, e, f, y, g, h, i, z] = frame;
    let v = [px - x, py - y, pz - z];
    let adjugate = [
        [e * i - f * h, c * h - b * i, b * f - c * e],
        [f * g - d * i, a * i - c * g, c * d - a * f],
        [d * h - e * g, b * g - a * h, a * e - b * d],
    ];
    let [[p, q, r], ..] = adjugate;
    let determinant = a * p + d * q + g * r;
    let (rows, share) = if determinant > SHRUNK {
        (adjugate, 1.0 / determinant)
    } else {
        ([[a, d, g], [b, e, h], [c, f, i]], 1.0)
    };
    rows.map(|[p, q, r]| (p * v[0] + q * v[1] + r * v[2]) * share)
}

pub(super) fn to_dual(frame: &Rigid) -> Dual17 {
    let [x, y, z] = frame.translation;
    let half = quaternion_product([0.5 * x, 0.5 * y, 0.5 * z, 0.0], frame.rotation);
    let mut dual = [0.0; 17];
    let numbers = frame.rotation.into_iter().chain(half);
    for (to, value) in dual.iter_mut().zip(numbers) {
        *to = value;
    }
    for (to, value) in dual.iter_mut().skip(8).step_by(4).zip([1.0; 3]) {
        *to = value;
    }
    dual
}

pub(super) fn from_dual(&[x, y, z, w, a, b, c, d, ..]: &Dual17) -> Rigid {
    rigid([x, y, z, w], [a, b, c, d])
}

/// From a unit dual quaternion: the translation is twice the dual part times the conjugate.
pub(super) fn rigid(rotation: Quat4, half: Quat4) -> Rigid {
    let [x, y, z, _] = quaternion_product(half, conjugate(rotation));
    Rigid {
        rotation,
        translation: [x + x, y + y, z + z],
    }
}

pub(super) fn pack(frame: &Rigid) -> [f32; 7] {
    let ([x, y, z, w], [a, b, c]) = (frame.rotation, frame.translation);
    [x, y, z, w, a, b, c]
}

pub(super) fn unpack(&[x, y, z, w, a, b, c]: &[f32; 7]) -> Rigid {
    Rigid {
        rotation: [x, y, z, w],
        translation: [a, b, c],
    }
}
