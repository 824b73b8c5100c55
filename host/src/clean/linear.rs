//! Small dense linear algebra: symmetric positive definite solves and symmetric eigenvectors.

/// Cholesky factor of a symmetric positive definite matrix, `[n x n]`, row-major, lower.
pub(crate) struct Cholesky {
    n: usize,
    lower: Vec<f64>,
}

impl Cholesky {
    /// Factors `matrix` (`[n x n]`, only the lower half is read); `None` unless it is positive
    /// definite. Cubic.
    pub fn new(n: usize, mut matrix: Vec<f64>) -> Option<Self> {
        for row in 0..n {
            for column in 0..=row {
                let (above, below) = matrix.split_at_mut(row * n);
                let mut sum = below[column];
                if column < row {
                    let other = &above[column * n..column * n + column];
                    for (a, b) in below[..column].iter().zip(other) {
                        sum -= a * b;
                    }
                    below[column] = sum / above[column * n + column];
                } else {
                    for a in &below[..column] {
                        sum -= a * a;
                    }
                    if sum.is_nan() || sum <= 0.0 {
                        return None;
                    }
                    below[column] = sum.sqrt();
                }
            }
        }
        Some(Self { n, lower: matrix })
    }

    /// Solves in place for `right`: `[n x width]`, row-major.
    pub fn solve(&self, right: &mut [f64], width: usize) {
        let (n, lower) = (self.n, &self.lower);
        for row in 0..n {
            for column in 0..row {
                let factor = lower[row * n + column];
                for at in 0..width {
                    right[row * width + at] -= factor * right[column * width + at];
                }
            }
            for at in 0..width {
                right[row * width + at] /= lower[row * n + row];
            }
        }
        for row in (0..n).rev() {
            for below in row + 1..n {
                let factor = lower[below * n + row];
                for at in 0..width {
                    right[row * width + at] -= factor * right[below * width + at];
                }
            }
            for at in 0..width {
                right[row * width + at] /= lower[row * n + row];
            }
        }
    }
}

/// Eigenvalues, largest first, and their unit eigenvectors (as rows) of a symmetric `[n x n]`
/// matrix, by Jacobi's rotations (Golub & Van Loan, section 8.5).
pub(crate) fn symmetric_eigen(n: usize, mut matrix: Vec<f64>) -> (Vec<f64>, Vec<f64>) {
    const SWEEPS: usize = 30;
    let mut vectors = vec![0.0; n * n];
    for at in 0..n {
        vectors[at * n + at] = 1.0;
    }
    let scale: f64 = matrix.iter().map(|value| value * value).sum();
    for _ in 0..SWEEPS {
        let off: f64 = (0..n)
            .flat_map(|row| (0..row).map(move |column| (row, column)))
            .map(|(row, column)| matrix[row * n + column].powi(2))
            .sum();
        if off <= 1e-26 * scale {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                let apq = matrix[p * n + q];
                if apq == 0.0 {
                    continue;
                }
                let theta = (matrix[q * n + q] - matrix[p * n + p]) / (2.0 * apq);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..n {
                    let (a, b) = (matrix[k * n + p], matrix[k * n + q]);
                    matrix[k * n + p] = c * a - s * b;
                    matrix[k * n + q] = s * a + c * b;
                }
                for k in 0..n {
                    let (a, b) = (matrix[p * n + k], matrix[q * n + k]);
                    matrix[p * n + k] = c * a - s * b;
                    matrix[q * n + k] = s * a + c * b;
                    let (a, b) = (vectors[p * n + k], vectors[q * n + k]);
                    vectors[p * n + k] = c * a - s * b;
                    vectors[q * n + k] = s * a + c * b;
                }
            }
        }
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| matrix[b * n + b].total_cmp(&matrix[a * n + a]));
    let values = order.iter().map(|at| matrix[at * n + at]).collect();
    let rows = order
        .iter()
        .flat_map(|at| vectors[at * n..(at + 1) * n].to_vec());
    (values, rows.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_of_two() {
        let factor = Cholesky::new(2, vec![4.0, 0.0, 2.0, 3.0]).unwrap();
        // [4 2; 2 3] [1; 2] = [8; 8], and twice that beside it.
        let mut right = [8.0, 16.0, 8.0, 16.0];
        factor.solve(&mut right, 2);
        for (found, expected) in right.iter().zip([1.0, 2.0, 2.0, 4.0]) {
            assert!((found - expected).abs() < 1e-12);
        }
        assert!(Cholesky::new(2, vec![1.0, 0.0, 2.0, 1.0]).is_none());
        assert!(Cholesky::new(1, vec![f64::NAN]).is_none());
    }

    #[test]
    fn eigenvectors_of_two() {
        let (values, vectors) = symmetric_eigen(2, vec![2.0, 1.0, 1.0, 2.0]);
        assert!((values[0] - 3.0).abs() < 1e-12 && (values[1] - 1.0).abs() < 1e-12);
        assert!((vectors[0] - vectors[1]).abs() < 1e-12);
        assert!((vectors[2] + vectors[3]).abs() < 1e-12);
        let (values, _) = symmetric_eigen(3, vec![0.0; 9]);
        assert_eq!(values, [0.0; 3]);
    }
}
