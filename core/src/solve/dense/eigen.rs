//! Eigenvalues of small symmetric matrices by cyclic Jacobi rotations.

use crate::math::inverse_sqrt;

/// Rounds over all pairs; the error falls quadratically, so 4 x 4 matrices need no more.
const SWEEPS: usize = 6;

/// Eigenvalues, and eigenvectors as rows, of a symmetric matrix of up to 4 x 4, in no order.
///
/// Six sweeps whatever the matrix is, so the cost is fixed. Numbers must be finite and below 1e12.
/// O(`N`^3) (Golub & Van Loan, *Matrix Computations*, section 8.5)
#[must_use]
pub fn symmetric_eigen<const N: usize>(mut matrix: [[f32; N]; N]) -> ([f32; N], [[f32; N]; N]) {
    let mut vectors = [[0.0; N]; N];
    for (at, row) in vectors.iter_mut().enumerate() {
        if let Some(diagonal) = row.get_mut(at) {
            *diagonal = 1.0;
        }
    }
    for _ in 0..SWEEPS {
        for p in 0..N {
            for q in p + 1..N {
                if let Some((cosine, sine)) = rotation(&matrix, p, q) {
                    turn_rows(&mut matrix, p, q, cosine, sine);
                    for row in &mut matrix {
                        if let Ok([a, b]) = row.get_disjoint_mut([p, q]) {
                            (*a, *b) = (cosine * *a - sine * *b, sine * *a + cosine * *b);
                        }
                    }
                    turn_rows(&mut vectors, p, q, cosine, sine);
                }
            }
        }
    }
    let mut values = [0.0; N];
    for (at, (value, row)) in values.iter_mut().zip(&matrix).enumerate() {
        *value = row.get(at).copied().unwrap_or(0.0);
    }
    (values, vectors)
}

/// Cosine and sine that take the entry `(p, q)` away; `None` where it is nothing already.
fn rotation<const N: usize>(matrix: &[[f32; N]; N], p: usize, q: usize) -> Option<(f32, f32)> {
    let row = matrix.get(p)?;
    let (&pp, &pq) = (row.get(p)?, row.get(q)?);
    let &qq = matrix.get(q)?.get(q)?;
    if pq.abs() <= 1e-9 * (pp.abs() + qq.abs()) + 1e-30 {
        return None;
    }
    let theta = (qq - pp) / (2.0 * pq);
    let squared = theta * theta + 1.0;
    let tangent = 1.0_f32.copysign(theta) / (theta.abs() + squared * inverse_sqrt(squared));
    let cosine = inverse_sqrt(tangent * tangent + 1.0);
    Some((cosine, tangent * cosine))
}

fn turn_rows<const N: usize>(rows: &mut [[f32; N]; N], p: usize, q: usize, c: f32, s: f32) {
    if let Ok([p, q]) = rows.get_disjoint_mut([p, q]) {
        for (a, b) in p.iter_mut().zip(q) {
            (*a, *b) = (c * *a - s * *b, s * *a + c * *b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values_of_a_coupled_pair() {
        let (values, vectors) =
            symmetric_eigen([[2.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 7.0]]);
        let mut sorted = values;
        sorted.sort_by(f32::total_cmp);
        for (found, known) in sorted.iter().zip([1.0, 3.0, 7.0]) {
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
