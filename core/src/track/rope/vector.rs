//! The little vector arithmetic that the stages share.

use glam::Vec3;

use crate::math::inverse_sqrt;

/// In the order x, y, z.
#[inline]
pub(super) fn dot(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

#[inline]
pub(super) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    Vec3::new(
        a.y * b.z - a.z * b.y,
        a.z * b.x - a.x * b.z,
        a.x * b.y - a.y * b.x,
    )
}

/// Relative error below 3e-7, 0 for 0; a third of the price of a square root in software.
#[inline]
pub(super) fn length(v: Vec3) -> f32 {
    let square = dot(v, v);
    square * inverse_sqrt(square)
}

/// At unit length, or zero where it has none.
#[inline]
pub(super) fn unit(v: Vec3) -> Vec3 {
    let square = dot(v, v);
    if square > 1e-20 {
        v * inverse_sqrt(square)
    } else {
        Vec3::ZERO
    }
}

/// Turns `v` by the smallest rotation that takes the direction `from` to `to`.
///
/// Rodrigues' formula without an angle: `c v + w x v + w (w . v) / (1 + c)` with
/// `w = from x to`, `c = from . to`. Near a half turn the axis is unknown; `v` then stays.
#[inline]
pub(super) fn turn(v: Vec3, from: Vec3, to: Vec3) -> Vec3 {
    let (from, to) = (unit(from), unit(to));
    let cosine = dot(from, to);
    if cosine < -0.9 {
        return v;
    }
    let axis = cross(from, to);
    v * cosine + cross(axis, v) + axis * (dot(axis, v) / (1.0 + cosine))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarter_turn() {
        let turned = turn(Vec3::new(0.0, 2.0, 1.0), Vec3::X * 3.0, Vec3::Y);
        // X to Y takes Y to -X and leaves Z.
        assert!((turned - Vec3::new(-2.0, 0.0, 1.0)).length() < 1e-6);
        assert_eq!(turn(Vec3::Z, Vec3::X, Vec3::NEG_X), Vec3::Z);
    }

    #[test]
    fn lengths() {
        assert_eq!(length(Vec3::ZERO), 0.0);
        assert!((length(Vec3::new(3.0, 4.0, 12.0)) - 13.0).abs() < 1e-5);
        assert_eq!(unit(Vec3::ZERO), Vec3::ZERO);
    }
}
