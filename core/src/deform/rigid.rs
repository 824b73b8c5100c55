//! Blocks that hang on one bind.

use crate::math::{Affine12, inverse_sqrt};

/// The matrix of a bind, and what it does to normals.
pub(super) struct Rigid {
    pub matrix: Affine12,
    pub normals: Affine12,
    /// Whether `normals` leaves unit vectors at unit length.
    pub keeps_length: bool,
}

impl Rigid {
    /// A rotation with a uniform scale, divided by that, keeps the length of normals, which saves
    /// a square root for each. It also is its own inverse transpose, up to scale.
    #[inline]
    pub fn of(matrix: &Affine12, exact_normals: bool) -> Self {
        let &[ax, bx, cx, _, ay, by, cy, _, az, bz, cz, _] = matrix;
        let [aa, bb, cc] = [
            ax * ax + ay * ay + az * az,
            bx * bx + by * by + bz * bz,
            cx * cx + cy * cy + cz * cz,
        ];
        let odd = [
            aa - bb,
            aa - cc,
            ax * bx + ay * by + az * bz,
            ax * cx + ay * cy + az * cz,
            bx * cx + by * cy + bz * cz,
        ];
        let limit = UNIFORM * aa;
        let mut keeps_length = (1e-12..=1e12).contains(&aa);
        for value in odd {
            keeps_length &= (-limit..=limit).contains(&value);
        }
        let mut normals = *matrix;
        if keeps_length {
            let factor = inverse_sqrt(aa);
            for value in &mut normals {
                *value *= factor;
            }
        } else if exact_normals {
            normals = cofactors(matrix);
        }
        Self {
            matrix: *matrix,
            normals,
            keeps_length,
        }
    }
}

/// How far columns of a matrix, relative to their squared length, may be from equally long and
/// perpendicular: a hundred times the rounding of a chain of joints.
const UNIFORM: f32 = 1e-5;

/// The inverse transpose of a matrix without its translation, times its determinant's magnitude.
fn cofactors(&[a, b, c, _, d, e, f, _, g, h, i, _]: &Affine12) -> Affine12 {
    let rows = [
        [e * i - f * h, f * g - d * i, d * h - e * g],
        [c * h - b * i, a * i - c * g, b * g - a * h],
        [b * f - c * e, c * d - a * f, a * e - b * d],
    ];
    let [first, ..] = rows;
    let sign = if a * first[0] + b * first[1] + c * first[2] < 0.0 {
        -1.0
    } else {
        1.0
    };
    let mut out = [0.0; 12];
    for (out, row) in out.as_chunks_mut::<4>().0.iter_mut().zip(rows) {
        for (out, value) in out.iter_mut().zip(row) {
            *out = sign * value;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::affine;

    #[test]
    fn a_scaled_rotation_keeps_length_and_a_stretch_does_not() {
        let half = core::f32::consts::FRAC_1_SQRT_2;
        let turn = [0.0, half, 0.0, half];
        let rigid = Rigid::of(&affine(turn, [1.0, 2.0, 3.0], [3.0; 3]), true);
        assert!(rigid.keeps_length);
        assert!((rigid.normals[2] - 1.0).abs() < 1e-6, "{:?}", rigid.normals);
        let stretch = Rigid::of(&affine(turn, [0.0; 3], [2.0, 1.0, 1.0]), true);
        assert!(!stretch.keeps_length);
        // Half along x, times the determinant 2, turned to -z.
        assert!((stretch.normals[8] + 1.0).abs() < 1e-6);
        assert!((stretch.normals[5] - 2.0).abs() < 1e-6);
    }

    #[test]
    fn a_mirror_leaves_normals_outside() {
        let mirror = affine([0.0, 0.0, 0.0, 1.0], [0.0; 3], [-2.0, 1.0, 1.0]);
        let normals = Rigid::of(&mirror, true).normals;
        assert_eq!([normals[0], normals[5], normals[10]], [-1.0, 2.0, 2.0]);
    }
}
