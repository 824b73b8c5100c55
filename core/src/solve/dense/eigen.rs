//! Eigenvalues of a symmetric matrix of 4 x 4 by cyclic Jacobi rotations.

use crate::math::inverse_sqrt;

/// Most rounds over all pairs; the error falls quadratically, so no more are needed.
const SWEEPS: usize = 6;

/// An entry this small beside its diagonal is nothing in 32-bit numbers.
const NOTHING: f32 = 3e-8;

/// Eigenvalues, and eigenvectors as rows, of a symmetric matrix, of which the upper triangle is
/// read, in no order.
///
/// At most six sweeps, and none after one that finds nothing to turn. Numbers must be finite and
/// below 1e12. (Golub & Van Loan, *Matrix Computations*, section 8.5)
#[must_use]
pub fn symmetric_eigen(matrix: [[f32; 4]; 4]) -> ([f32; 4], [[f32; 4]; 4]) {
    let [
        [mut aa, mut ab, mut ac, mut ad],
        [_, mut bb, mut bc, mut bd],
        [_, _, mut cc, mut cd],
        [_, _, _, mut dd],
    ] = matrix;
    let mut a = [1.0, 0.0, 0.0, 0.0];
    let mut b = [0.0, 1.0, 0.0, 0.0];
    let mut c = [0.0, 0.0, 1.0, 0.0];
    let mut d = [0.0, 0.0, 0.0, 1.0];
    for _ in 0..SWEEPS {
        let mut turned = turn(
            [&mut aa, &mut bb, &mut ab],
            [(&mut ac, &mut bc), (&mut ad, &mut bd)],
            (&mut a, &mut b),
        );
        turned |= turn(
            [&mut aa, &mut cc, &mut ac],
            [(&mut ab, &mut bc), (&mut ad, &mut cd)],
            (&mut a, &mut c),
        );
        turned |= turn(
            [&mut aa, &mut dd, &mut ad],
            [(&mut ab, &mut bd), (&mut ac, &mut cd)],
            (&mut a, &mut d),
        );
        turned |= turn(
            [&mut bb, &mut cc, &mut bc],
            [(&mut ab, &mut ac), (&mut bd, &mut cd)],
            (&mut b, &mut c),
        );
        turned |= turn(
            [&mut bb, &mut dd, &mut bd],
            [(&mut ab, &mut ad), (&mut bc, &mut cd)],
            (&mut b, &mut d),
        );
        turned |= turn(
            [&mut cc, &mut dd, &mut cd],
            [(&mut ac, &mut ad), (&mut bc, &mut bd)],
            (&mut c, &mut d),
        );
        if !turned {
            break;
        }
    }
    ([aa, bb, cc, dd], [a, b, c, d])
}

/// Takes the entry `pq` away; false where it is nothing already. `others`: what rows p and q have
/// in the other columns.
#[inline(always)]
fn turn(
    [pp, qq, pq]: [&mut f32; 3],
    [(rp, rq), (sp, sq)]: [(&mut f32, &mut f32); 2],
    ([pa, pb, pc, pd], [qa, qb, qc, qd]): (&mut [f32; 4], &mut [f32; 4]),
) -> bool {
    let Some((tangent, cosine, sine)) = rotation(*pp, *qq, *pq) else {
        return false;
    };
    let step = tangent * *pq;
    (*pp, *qq, *pq) = (*pp - step, *qq + step, 0.0);
    let spin = |p: &mut f32, q: &mut f32| {
        (*p, *q) = (cosine * *p - sine * *q, sine * *p + cosine * *q);
    };
    // Written out: a loop would keep all of it in memory.
    spin(rp, rq);
    spin(sp, sq);
    spin(pa, qa);
    spin(pb, qb);
    spin(pc, qc);
    spin(pd, qd);
    true
}

/// Tangent, cosine and sine of the rotation.
#[inline(always)]
fn rotation(pp: f32, qq: f32, pq: f32) -> Option<(f32, f32, f32)> {
    if pq.abs() <= NOTHING * (pp.abs() + qq.abs()) + 1e-30 {
        return None;
    }
    let theta = (qq - pp) / (2.0 * pq);
    let squared = theta * theta + 1.0;
    let tangent = 1.0_f32.copysign(theta) / (theta.abs() + squared * inverse_sqrt(squared));
    let cosine = inverse_sqrt(tangent * tangent + 1.0);
    Some((tangent, cosine, tangent * cosine))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values_of_a_coupled_pair() {
        let (values, vectors) = symmetric_eigen([
            [2.0, 1.0, 0.0, 0.0],
            [1.0, 2.0, 0.0, 0.0],
            [0.0, 0.0, 7.0, 0.0],
            [0.0, 0.0, 0.0, 5.0],
        ]);
        let mut sorted = values;
        sorted.sort_by(f32::total_cmp);
        for (found, known) in sorted.iter().zip([1.0, 3.0, 5.0, 7.0]) {
            assert!((found - known).abs() < 1e-6, "{values:?}");
        }
        let at = values.iter().position(|x| (x - 3.0).abs() < 1e-5).unwrap();
        assert!((vectors[at][0] - vectors[at][1]).abs() < 1e-6);
    }

    #[test]
    fn vectors_rebuild_the_matrix() {
        let matrix = [
            [4.0, -1.0, 0.5, 2.0],
            [-1.0, 3.0, 0.25, 0.1],
            [0.5, 0.25, -5.0, 1.0],
            [2.0, 0.1, 1.0, 0.0],
        ];
        let (values, vectors) = symmetric_eigen(matrix);
        for row in 0..4 {
            for column in 0..4 {
                let sum: f32 = (0..4)
                    .map(|k| values[k] * vectors[k][row] * vectors[k][column])
                    .sum();
                assert!((sum - matrix[row][column]).abs() < 1e-5);
            }
        }
    }
}
