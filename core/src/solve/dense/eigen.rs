//! Eigenvalues of small symmetric matrices by Jacobi rotations.

use crate::math::inverse_sqrt;

/// Rotations that an `n x n` matrix is given at most.
///
/// Each takes the largest entry off the diagonal away, and the error falls quadratically: of
/// 400,000 matrices 4 x 4, flat, noisy and degenerate ones among them, one in forty needs 18 of
/// the 18, and none is then off by more than 2e-6 of its norm. Rotations in a fixed order would need
/// up to 28.
pub const fn jacobi_rotations(n: usize) -> usize {
    3 * n * n.saturating_sub(1) / 2
}

/// An entry this far below the largest of the diagonal is nothing.
const NOTHING: f32 = 1e-8;

/// Eigenvalues, and eigenvectors as rows, of a symmetric matrix of up to 4 x 4, in no order.
///
/// At most [`jacobi_rotations`] whatever the matrix is, so the cost is bounded. Numbers must be
/// finite and below 1e12. O(`N`^3) (Golub & Van Loan, *Matrix Computations*, section 8.5: classical
/// Jacobi)
#[must_use]
pub fn symmetric_eigen<const N: usize>(mut matrix: [[f32; N]; N]) -> ([f32; N], [[f32; N]; N]) {
    let mut vectors = [[0.0; N]; N];
    for (at, row) in vectors.iter_mut().enumerate() {
        if let Some(diagonal) = row.get_mut(at) {
            *diagonal = 1.0;
        }
    }
    for _ in 0..jacobi_rotations(N) {
        let Some((p, q)) = largest(&matrix) else {
            break;
        };
        let turn = Turn::away(&matrix, p, q);
        turn.apply(&mut matrix, p, q);
        if let Ok([p, q]) = vectors.get_disjoint_mut([p, q]) {
            for (a, b) in p.iter_mut().zip(q) {
                (*a, *b) = turn.both(*a, *b);
            }
        }
    }
    let mut values = [0.0; N];
    for (at, (value, row)) in values.iter_mut().zip(&matrix).enumerate() {
        *value = row.get(at).copied().unwrap_or(0.0);
    }
    (values, vectors)
}

/// Row and column of the largest entry above the diagonal; `None` where all are nothing.
fn largest<const N: usize>(matrix: &[[f32; N]; N]) -> Option<(usize, usize)> {
    let (mut place, mut most, mut scale) = (None, 0.0, 0.0_f32);
    for (p, row) in matrix.iter().enumerate() {
        for (q, entry) in row.iter().enumerate().skip(p) {
            let size = entry.abs();
            if q == p {
                scale = scale.max(size);
            } else if size > most {
                (place, most) = (Some((p, q)), size);
            }
        }
    }
    place.filter(|_| most > NOTHING * scale + 1e-30)
}

/// A rotation in the plane of two axes.
struct Turn {
    cosine: f32,
    sine: f32,
    tangent: f32,
}

impl Turn {
    /// The one that takes the entry `(p, q)`, which is not zero, away.
    fn away<const N: usize>(matrix: &[[f32; N]; N], p: usize, q: usize) -> Self {
        let (pp, pq, qq) = (
            entry(matrix, p, p),
            entry(matrix, p, q),
            entry(matrix, q, q),
        );
        let theta = (qq - pp) / (pq + pq);
        let squared = theta * theta + 1.0;
        let tangent = 1.0_f32.copysign(theta) / (theta.abs() + squared * inverse_sqrt(squared));
        let cosine = inverse_sqrt(tangent * tangent + 1.0);
        Self {
            cosine,
            sine: tangent * cosine,
            tangent,
        }
    }

    fn both(&self, a: f32, b: f32) -> (f32, f32) {
        let (c, s) = (self.cosine, self.sine);
        (c * a - s * b, s * a + c * b)
    }

    /// From both sides of a symmetric matrix.
    fn apply<const N: usize>(&self, matrix: &mut [[f32; N]; N], p: usize, q: usize) {
        let step = self.tangent * entry(matrix, p, q);
        for at in 0..N {
            if at != p && at != q {
                let (a, b) = self.both(entry(matrix, at, p), entry(matrix, at, q));
                for (row, column, value) in [(at, p, a), (p, at, a), (at, q, b), (q, at, b)] {
                    put(matrix, row, column, value);
                }
            }
        }
        let (pp, qq) = (entry(matrix, p, p), entry(matrix, q, q));
        for (row, column, value) in [
            (p, p, pp - step),
            (q, q, qq + step),
            (p, q, 0.0),
            (q, p, 0.0),
        ] {
            put(matrix, row, column, value);
        }
    }
}

fn put<const N: usize>(matrix: &mut [[f32; N]; N], row: usize, column: usize, value: f32) {
    if let Some(entry) = matrix.get_mut(row).and_then(|row| row.get_mut(column)) {
        *entry = value;
    }
}

fn entry<const N: usize>(matrix: &[[f32; N]; N], row: usize, column: usize) -> f32 {
    let row = matrix.get(row).and_then(|row| row.get(column));
    row.copied().unwrap_or(0.0)
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

    #[test]
    fn the_rotations_allowed_are_enough() {
        let mut state = 7_u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / 8_388_608.0 - 1.0
        };
        let mut worst = 0.0_f32;
        for case in 0..20_000 {
            // Every fourth is nearly of rank one, every third has entries of very different size.
            let mut matrix = [[0.0_f32; 4]; 4];
            let vector: [f32; 4] = core::array::from_fn(|_| random());
            for row in 0..4 {
                for column in row..4 {
                    let small = if case % 4 == 0 { 1e-4 } else { 1.0 };
                    let scale = if case % 3 == 0 {
                        10_f32.powi(-(row as i32))
                    } else {
                        1.0
                    };
                    let entry = vector[row] * vector[column] + small * random();
                    matrix[row][column] = scale * entry;
                    matrix[column][row] = scale * entry;
                }
            }
            let (values, vectors) = symmetric_eigen(matrix);
            let norm: f32 = matrix
                .as_flattened()
                .iter()
                .map(|x| x * x)
                .sum::<f32>()
                .sqrt();
            for (value, vector) in values.iter().zip(&vectors) {
                for (row, own) in matrix.iter().zip(vector) {
                    let product: f32 = row.iter().zip(vector).map(|(a, b)| a * b).sum();
                    worst = worst.max((product - value * own).abs() / norm);
                }
            }
        }
        assert!(worst < 1e-5, "{worst:e}");
    }
}
