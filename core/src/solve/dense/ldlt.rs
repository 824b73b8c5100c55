//! Symmetric positive definite systems, in the caller's memory.
//!
//! The matrix is `[n x n]`, row-major; only its upper triangle is read and written. Rows are taken
//! from rows, so no sum is reordered by vector instructions.

/// Factors `matrix` in place into `L D L'` and returns whether every pivot was at least `floor`;
/// a smaller one is raised to it, so that a solution stays bounded whatever the matrix was.
///
/// `matrix: [n x n]`; nothing happens where it is shorter. O(n^3 / 6)
pub fn factor(matrix: &mut [f32], n: usize, floor: f32) -> bool {
    let mut sound = true;
    for k in 0..n {
        let Some((head, tail)) = matrix.split_at_mut_checked((k + 1) * n) else {
            return false;
        };
        let Some(row) = head.get_mut(k * n..) else {
            return false;
        };
        let Some((pivot, rest)) = row.get_mut(k..).and_then(<[f32]>::split_first_mut) else {
            return false;
        };
        if pivot.is_nan() || *pivot < floor {
            *pivot = floor;
            sound = false;
        }
        let inverse = 1.0 / *pivot;
        for (at, below) in tail.chunks_exact_mut(n).enumerate() {
            let from = rest.get(at..).unwrap_or_default();
            let to = below.get_mut(k + 1 + at..).unwrap_or_default();
            if let Some(&first) = from.first() {
                let share = first * inverse;
                for (to, from) in to.iter_mut().zip(from) {
                    *to -= share * from;
                }
            }
        }
        for value in rest {
            *value *= inverse;
        }
        // The reciprocal is what a solution needs.
        *pivot = inverse;
    }
    sound
}

/// Solves for three right-hand sides in place after [`factor`]. O(n^2)
pub fn solve(matrix: &[f32], n: usize, x: &mut [[f32; 3]]) {
    let row_of = |k: usize| matrix.get(k * n..(k + 1) * n).unwrap_or_default();
    for k in 0..n {
        let row = row_of(k);
        let Some((&mut known, rest)) = x.get_mut(k..).and_then(<[_]>::split_first_mut) else {
            return;
        };
        for (to, share) in rest.iter_mut().zip(row.get(k + 1..).unwrap_or_default()) {
            for (to, known) in to.iter_mut().zip(known) {
                *to -= share * known;
            }
        }
    }
    for k in (0..n).rev() {
        let row = row_of(k);
        let Some((to, rest)) = x.get_mut(k..).and_then(<[_]>::split_first_mut) else {
            return;
        };
        let inverse = row.get(k).copied().unwrap_or(0.0);
        for to in to.iter_mut() {
            *to *= inverse;
        }
        for (known, share) in rest.iter().zip(row.get(k + 1..).unwrap_or_default()) {
            for (to, known) in to.iter_mut().zip(known) {
                *to -= share * known;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_system_is_solved() {
        let mut matrix = [4.0, 2.0, 0.5, 0.0, 5.0, 1.0, 0.0, 0.0, 3.0];
        let full = [[4.0, 2.0, 0.5], [2.0, 5.0, 1.0], [0.5, 1.0, 3.0]];
        let truth = [[1.0, -2.0, 0.0], [3.0, 0.5, 1.0], [-1.0, 4.0, 2.0]];
        let mut x = [[0.0; 3]; 3];
        for (row, x) in full.iter().zip(&mut x) {
            for (a, truth) in row.iter().zip(truth) {
                for axis in 0..3 {
                    x[axis] += a * truth[axis];
                }
            }
        }
        assert!(factor(&mut matrix, 3, 1e-6));
        solve(&matrix, 3, &mut x);
        for (found, truth) in x.as_flattened().iter().zip(truth.as_flattened()) {
            assert!((found - truth).abs() < 1e-5, "{x:?}");
        }
    }

    #[test]
    fn an_indefinite_matrix_gives_bounded_numbers_and_says_so() {
        let mut matrix = [1.0, 2.0, 0.0, 1.0];
        assert!(!factor(&mut matrix, 2, 0.05));
        let mut x = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        solve(&matrix, 2, &mut x);
        assert!(x.as_flattened().iter().all(|x| x.abs() < 200.0), "{x:?}");
        let mut nan = [f32::NAN];
        assert!(!factor(&mut nan, 1, 0.05));
        assert!(factor(&mut [], 0, 0.05));
    }
}
