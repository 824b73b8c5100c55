//! Rigid motions as they are kept, blended and undone.

use super::rig_check::FAR;
use crate::math::{Quat4, affine, conjugate, inverse_sqrt, quaternion_product, transform_vector};
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

/// A point of this frame in the rest pose.
pub(super) fn carried_back(frame: &Rigid, position: [f32; 3]) -> [f32; 3] {
    let back = affine(conjugate(frame.rotation), [0.0; 3], [1.0; 3]);
    transform_vector(&back, less(position, frame.translation))
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
