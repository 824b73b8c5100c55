//! The arithmetic that reaches the output, written out in one fixed order.
//!
//! Every function uses only additions, subtractions, multiplications, divisions and moves of bits,
//! each rounded once, so that all targets give the same bits. There is no fused multiply-add and
//! no transcendental function.
//!
//! The feature `micromath` stops series and Newton steps earlier, for cores without a fast
//! floating-point unit. Its bits are others, the same on all targets that have it on.

/// Quaternion `[x, y, z, w]`.
pub type Quat4 = [f32; 4];

/// Rows of a 3 x 4 affine matrix, one after another: `[m00, m01, m02, tx, m10, ...]`.
pub type Affine12 = [f32; 12];

/// No change.
pub const IDENTITY: Affine12 = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// `1 / sqrt(x)` for positive normal `x`, relative error below 2e-7: a guess by the exponent's
/// bits, then three Newton steps. With `micromath` two that are adjusted: 8e-7.
#[inline]
#[must_use]
pub fn inverse_sqrt(x: f32) -> f32 {
    if cfg!(feature = "micromath") {
        return adjusted_inverse_sqrt(x, FACTORS);
    }
    let half = 0.5 * x;
    let mut y = f32::from_bits(0x5f37_5a86_u32.wrapping_sub(x.to_bits() >> 1));
    y *= 1.5 - half * y * y;
    y *= 1.5 - half * y * y;
    y *= 1.5 - half * y * y;
    y
}

/// `1 / sqrt(x)` for positive normal `x`, relative error below 8e-7: enough for a direction. With
/// `micromath` 9e-4, a twentieth of a degree.
///
/// Two Newton steps from a guess, with constants that halve the error of each (after Walczyk,
/// Moroz and Cieslinski, *Improving the Accuracy of the Fast Inverse Square Root by Modifying
/// Newton-Raphson Corrections*, 2021), written for the shortest chain of operations.
#[inline]
#[must_use]
pub fn rough_inverse_sqrt(x: f32) -> f32 {
    adjusted_inverse_sqrt(x, ROUGH_FACTORS)
}

#[inline]
fn adjusted_inverse_sqrt<const STEPS: usize>(x: f32, factors: [f32; STEPS]) -> f32 {
    let half = 0.5 * x;
    let mut y = f32::from_bits(ROUGH_GUESS.wrapping_sub(x.to_bits() >> 1));
    for factor in factors {
        y = factor * y - (half * y) * (y * y);
    }
    y
}

pub(crate) const ROUGH_GUESS: u32 = 0x5f37_7180;
const FACTORS: [f32; 2] = [1.500_89, 1.500_000_6];
#[cfg(not(feature = "micromath"))]
pub(crate) const ROUGH_FACTORS: [f32; 2] = FACTORS;
#[cfg(feature = "micromath")]
pub(crate) const ROUGH_FACTORS: [f32; 1] = [FACTORS[0]];

/// Sum of products.
#[inline]
#[must_use]
pub fn dot4(a: Quat4, b: Quat4) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
}

/// The quaternion at unit length, or `None` where its length is not a usable number.
#[inline]
#[must_use]
pub fn normalise(q: Quat4) -> Option<Quat4> {
    let length2 = dot4(q, q);
    // NaN fails both comparisons.
    if length2 > 1e-12 && length2 < 1e12 {
        let factor = inverse_sqrt(length2);
        Some(q.map(|x| x * factor))
    } else {
        None
    }
}

/// `a * b`: first `b`, then `a`.
#[inline]
#[must_use]
pub fn quaternion_product(a: Quat4, b: Quat4) -> Quat4 {
    let ([ax, ay, az, aw], [bx, by, bz, bw]) = (a, b);
    [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
}

/// The opposite rotation of a unit quaternion.
#[inline]
#[must_use]
pub fn conjugate([x, y, z, w]: Quat4) -> Quat4 {
    [-x, -y, -z, w]
}

/// Interpolates unit quaternions along the shorter great arc at constant speed.
///
/// `sin(t a) / sin(a)` is a power series in `1 - cos(a)` (Eberly, *A Fast and Accurate Algorithm
/// for Computing SLERP*, 2011), so no trigonometric function is needed. Arcs over 60 degrees are
/// first halved, which keeps nine terms within 2e-7 of the exact value; `micromath` takes four.
#[inline]
#[must_use]
pub fn slerp(from: Quat4, to: Quat4, t: f32) -> Quat4 {
    let mut cosine = dot4(from, to);
    let mut to = to;
    if cosine < 0.0 {
        cosine = -cosine;
        to = to.map(|x| -x);
    }
    let (mut from, mut t) = (from, t);
    if cosine < 0.5 {
        let sum = [
            from[0] + to[0],
            from[1] + to[1],
            from[2] + to[2],
            from[3] + to[3],
        ];
        // The two are at most 90 degrees apart, so their sum is at least sqrt(2) long.
        let factor = inverse_sqrt(dot4(sum, sum));
        let middle = sum.map(|x| x * factor);
        if t < 0.5 {
            to = middle;
            t *= 2.0;
        } else {
            from = middle;
            t = 2.0 * t - 1.0;
        }
        cosine = dot4(from, to);
    }
    let versine = 1.0 - cosine;
    let (a, b) = (arc_weight(1.0 - t, versine), arc_weight(t, versine));
    [
        a * from[0] + b * to[0],
        a * from[1] + b * to[1],
        a * from[2] + b * to[2],
        a * from[3] + b * to[3],
    ]
}

/// `sin(t a) / sin(a)` with `versine = 1 - cos(a)`, for `a` up to 60 degrees.
#[inline]
fn arc_weight(t: f32, versine: f32) -> f32 {
    let t2 = t * t;
    let mut series = 1.0;
    for [u, v] in ARC_SERIES {
        series = 1.0 + (v - u * t2) * versine * series;
    }
    t * series
}

const ARC_TERMS: usize = if cfg!(feature = "micromath") { 4 } else { 9 };

/// `[1 / (i (2i + 1)), i / (2i + 1)]` for i from the number of terms down to 1.
const ARC_SERIES: [[f32; 2]; ARC_TERMS] = {
    let mut table = [[0.0; 2]; ARC_TERMS];
    let mut row = 0;
    while row < ARC_TERMS {
        let i = (ARC_TERMS - row) as f32;
        table[row] = [1.0 / (i * (2.0 * i + 1.0)), i / (2.0 * i + 1.0)];
        row += 1;
    }
    table
};

/// Rotation and scale as a matrix (Mažrimas & Beinaravičius, section 3), with a translation.
#[inline]
#[must_use]
pub fn affine(rotation: Quat4, translation: [f32; 3], scale: [f32; 3]) -> Affine12 {
    let [x, y, z, w] = rotation;
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (xx, yy, zz) = (x * x2, y * y2, z * z2);
    let (xy, xz, yz) = (x * y2, x * z2, y * z2);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    let [sx, sy, sz] = scale;
    [
        (1.0 - (yy + zz)) * sx,
        (xy - wz) * sy,
        (xz + wy) * sz,
        translation[0],
        (xy + wz) * sx,
        (1.0 - (xx + zz)) * sy,
        (yz - wx) * sz,
        translation[1],
        (xz - wy) * sx,
        (yz + wx) * sy,
        (1.0 - (xx + yy)) * sz,
        translation[2],
    ]
}

/// `a * b`: first `b`, then `a`.
#[inline]
#[must_use]
pub fn compose(a: &Affine12, b: &Affine12) -> Affine12 {
    let mut out = [0.0; 12];
    for (out, a) in out
        .as_chunks_mut::<4>()
        .0
        .iter_mut()
        .zip(a.as_chunks::<4>().0)
    {
        for column in 0..4 {
            out[column] = a[0] * b[column] + a[1] * b[column + 4] + a[2] * b[column + 8];
        }
        out[3] += a[3];
    }
    out
}

/// The matrix applied to a point.
#[inline]
#[must_use]
pub fn transform_point(m: &Affine12, p: [f32; 3]) -> [f32; 3] {
    [
        m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3],
        m[4] * p[0] + m[5] * p[1] + m[6] * p[2] + m[7],
        m[8] * p[0] + m[9] * p[1] + m[10] * p[2] + m[11],
    ]
}

/// The matrix applied to a direction: without its translation.
#[inline]
#[must_use]
pub fn transform_vector(m: &Affine12, v: [f32; 3]) -> [f32; 3] {
    [
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[4] * v[0] + m[5] * v[1] + m[6] * v[2],
        m[8] * v[0] + m[9] * v[1] + m[10] * v[2],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quarter_turn_about_y_takes_z_to_x() {
        let s = core::f32::consts::FRAC_1_SQRT_2;
        let m = affine([0.0, s, 0.0, s], [1.0, 2.0, 3.0], [1.0, 1.0, 2.0]);
        let p = transform_point(&m, [0.0, 0.0, 1.0]);
        for (got, want) in p.iter().zip([3.0, 2.0, 3.0]) {
            assert!((got - want).abs() < 1e-6, "{p:?}");
        }
        let twice = compose(&m, &m);
        let q = transform_point(&m, p);
        for (a, b) in transform_point(&twice, [0.0, 0.0, 1.0]).iter().zip(q) {
            assert!((a - b).abs() < 1e-5);
        }
    }

    #[test]
    fn quaternion_products_turn_like_matrices() {
        let (s, no) = (core::f32::consts::FRAC_1_SQRT_2, [0.0; 3]);
        let (a, b) = ([0.0, s, 0.0, s], [s, 0.0, 0.0, s]);
        let one = affine(quaternion_product(a, b), no, [1.0; 3]);
        let two = compose(&affine(a, no, [1.0; 3]), &affine(b, no, [1.0; 3]));
        for (one, two) in one.iter().zip(two) {
            assert!((one - two).abs() < 1e-6);
        }
    }

    #[test]
    fn lengths_without_a_direction_are_refused() {
        assert_eq!(normalise([0.0; 4]), None);
        assert_eq!(normalise([f32::NAN, 0.0, 0.0, 1.0]), None);
        assert_eq!(normalise([f32::INFINITY, 0.0, 0.0, 1.0]), None);
        assert_eq!(normalise([1e30, 0.0, 0.0, 0.0]), None);
        let q = normalise([0.0, 0.0, 0.0, 3.0]).unwrap();
        assert!((q[3] - 1.0).abs() < 1e-6);
    }
}
