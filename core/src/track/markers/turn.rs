//! Rotations from points: Gauss-Newton steps (absolute orientation, Horn 1987) from one that three
//! points give.

use glam::{Mat3, Vec3, Vec3Swizzles};

use crate::math::{Quat4, affine, inverse_sqrt, quaternion_product};

/// Steps from a rotation that three points give.
pub(super) const COLD: usize = 6;

/// Symmetric 3 x 3: xx, yy, zz and xy, yz, zx.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scatter {
    pub squares: Vec3,
    pub mixed: Vec3,
}

pub(super) fn matrix(turn: Quat4) -> Mat3 {
    let m = affine(turn, [0.0; 3], [1.0; 3]);
    Mat3::from_cols(
        Vec3::new(m[0], m[4], m[8]),
        Vec3::new(m[1], m[5], m[9]),
        Vec3::new(m[2], m[6], m[10]),
    )
}

/// Gauss-Newton steps on the rotation: cubic on rigid points, and bounded on any.
pub(super) fn refine(mut turn: Quat4, cross: &Mat3, scatter: &Scatter, steps: usize) -> Quat4 {
    let Scatter { squares, mixed } = scatter;
    let trace = squares.x + squares.y + squares.z;
    // A grain of stiffness keeps what the points leave open where it was.
    let stiff = 1e-3 * trace + 1e-12;
    let (a, b, c) = (
        trace - squares.x + stiff,
        trace - squares.y + stiff,
        trace - squares.z + stiff,
    );
    let (xy, yz, zx) = (-mixed.x, -mixed.y, -mixed.z);
    let (c00, c01, c02) = (b * c - yz * yz, zx * yz - xy * c, xy * yz - b * zx);
    let (c11, c12, c22) = (a * c - zx * zx, xy * zx - a * yz, a * b - xy * xy);
    let determinant = a * c00 + xy * c01 + zx * c02;
    let inverse = if determinant > 1e-30 {
        1.0 / determinant
    } else {
        0.0
    };
    for _ in 0..steps {
        let turned = matrix(turn).transpose() * *cross;
        // Torque: sum of local x (world turned back).
        let torque = Vec3::new(
            turned.y_axis.z - turned.z_axis.y,
            turned.z_axis.x - turned.x_axis.z,
            turned.x_axis.y - turned.y_axis.x,
        );
        let step = Vec3::new(
            c00 * torque.x + c01 * torque.y + c02 * torque.z,
            c01 * torque.x + c11 * torque.y + c12 * torque.z,
            c02 * torque.x + c12 * torque.y + c22 * torque.z,
        ) * (0.5 * inverse);
        let length2 = 1.0 + step.length_squared();
        if length2.is_nan() || length2 > 1e6 {
            break;
        }
        let scale = inverse_sqrt(length2);
        let small = [step.x * scale, step.y * scale, step.z * scale, scale];
        turn = quaternion_product(turn, small);
        let length2 = crate::math::dot4(turn, turn);
        // One Newton step towards unit length is enough each time.
        let scale = 1.5 - 0.5 * length2;
        turn = turn.map(|x| x * scale);
    }
    turn
}

/// The rigid motion of pairs (from, to): rotation, and the middles that it carries to each other.
/// `None` for fewer than three or where all lie on a line.
pub(super) fn align(
    pairs: impl Iterator<Item = (Vec3, Vec3)> + Clone,
) -> Option<(Mat3, Vec3, Vec3)> {
    let (mut from, mut to, mut count) = (Vec3::ZERO, Vec3::ZERO, 0.0);
    for (a, b) in pairs.clone() {
        from += a;
        to += b;
        count += 1.0;
    }
    if count < 3.0 {
        return None;
    }
    from *= 1.0 / count;
    to *= 1.0 / count;
    let mut cross = Mat3::ZERO;
    let (mut squares, mut mixed) = (Vec3::ZERO, Vec3::ZERO);
    for (a, b) in pairs.clone() {
        let (local, world) = (a - from, b - to);
        cross += Mat3::from_cols(world * local.x, world * local.y, world * local.z);
        squares += local * local;
        mixed += local.yzx() * local;
    }
    let turn = triangle(pairs.map(|(a, b)| (b, a)))?;
    let turn = refine(turn, &cross, &Scatter { squares, mixed }, COLD);
    Some((matrix(turn), from, to))
}

/// A rotation from the first three of (world, local) that are not on a line: both triangles get a
/// frame (first edge, normal), and one is carried to the other.
pub(super) fn triangle(mut placed: impl Iterator<Item = (Vec3, Vec3)>) -> Option<Quat4> {
    let (p0, s0) = placed.next()?;
    let (p1, s1) = placed.next()?;
    let (from, to) = (s1 - s0, p1 - p0);
    for (p2, s2) in placed {
        let (Some(local), Some(world)) = (triad(from, s2 - s0), triad(to, p2 - p0)) else {
            continue;
        };
        return quaternion(&(world * local.transpose()));
    }
    None
}

/// An orthonormal frame from two edges of a triangle; `None` where it is too thin.
fn triad(edge: Vec3, other: Vec3) -> Option<Mat3> {
    let normal = edge.cross(other);
    let (edge2, normal2) = (edge.length_squared(), normal.length_squared());
    // The height over the edge is at least a twentieth of it.
    if edge2 < 1e-8 || normal2 < 0.0025 * edge2 * edge2 {
        return None;
    }
    let x = edge * inverse_sqrt(edge2);
    let z = normal * inverse_sqrt(normal2);
    Some(Mat3::from_cols(x, z.cross(x), z))
}

/// The unit quaternion of a rotation matrix (Shepperd 1978).
fn quaternion(m: &Mat3) -> Option<Quat4> {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let trace = x.x + y.y + z.z;
    let q = if trace > 0.0 {
        [y.z - z.y, z.x - x.z, x.y - y.x, 1.0 + trace]
    } else if x.x >= y.y && x.x >= z.z {
        [1.0 + x.x - y.y - z.z, x.y + y.x, x.z + z.x, y.z - z.y]
    } else if y.y >= z.z {
        [x.y + y.x, 1.0 - x.x + y.y - z.z, y.z + z.y, z.x - x.z]
    } else {
        [x.z + z.x, y.z + z.y, 1.0 - x.x - y.y + z.z, x.y - y.x]
    };
    crate::math::normalise(q)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u32) -> f32 {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*state >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    #[test]
    fn quaternions_and_matrices_agree() {
        let mut state = 7;
        for _ in 0..200 {
            let q = core::array::from_fn(|_| random(&mut state));
            let q = crate::math::normalise(q).unwrap();
            let back = quaternion(&matrix(q)).unwrap();
            assert!(
                crate::math::dot4(q, back).abs() > 1.0 - 1e-6,
                "{q:?} {back:?}"
            );
        }
    }

    #[test]
    fn steps_find_the_rotation() {
        let mut state = 3;
        for _ in 0..200 {
            let points: [Vec3; 5] =
                core::array::from_fn(|_| Vec3::from_array([(); 3].map(|()| random(&mut state))));
            let mean = points.iter().sum::<Vec3>() / 5.0;
            let axis = Vec3::new(random(&mut state), random(&mut state), random(&mut state));
            // Up to a third of a turn away from the start.
            let q = [axis.x * 0.5, axis.y * 0.5, axis.z * 0.5, 1.0];
            let q = crate::math::normalise(q).unwrap();
            let rotation = matrix(q);
            let mut cross = Mat3::ZERO;
            let mut scatter = Scatter {
                squares: Vec3::ZERO,
                mixed: Vec3::ZERO,
            };
            for point in points {
                let local = point - mean;
                let world = rotation * local;
                cross += Mat3::from_cols(world * local.x, world * local.y, world * local.z);
                scatter.squares += local * local;
                scatter.mixed += local.yzx() * local;
            }
            let found = refine([0.0, 0.0, 0.0, 1.0], &cross, &scatter, 8);
            let cosine = crate::math::dot4(found, q).abs();
            assert!(cosine > 1.0 - 1e-5, "{cosine}");
        }
    }
}
