//! Sparse Cholesky factors: computed in `f64`, packed into the core's `f32` panels.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky, supernodal::SupernodalLltRef,
};
use faer::sparse::linalg::{SupernodalThreshold, SymbolicSupernodalParams};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, MatMut, Par, Side, perm::PermRef};
use sinew_core::solve::sparse::{Factor, FactorError, FactorParts, PADDING};

use super::LaplaceError;

/// Neighbouring supernodes are joined while at most this part of the result is zeros: (columns up
/// to, part). Wider ones waste reading, narrower ones waste registers.
const RELAXATION: [(usize, f64); 4] = [(4, 0.6), (16, 0.25), (48, 0.08), (usize::MAX, 0.03)];

/// `P A P' = L L'` of a symmetric positive definite matrix, in `f64`.
#[derive(Debug)]
pub struct Cholesky {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

impl Cholesky {
    /// Factors a matrix given by its lower triangle (row, column, value), each pair once.
    ///
    /// `order` fixes the order of elimination (`order[new] = old`); without it, approximate
    /// minimum degree. O(fill), memory too.
    ///
    /// # Errors
    /// [`LaplaceError::NotPositiveDefinite`], [`LaplaceError::TooLarge`].
    ///
    /// # Panics
    /// Never, for indices below `size` and an `order` that is a permutation.
    pub fn new(
        size: usize,
        lower: &[(u32, u32, f64)],
        order: Option<&[u32]>,
    ) -> Result<Self, LaplaceError> {
        let too_large = || LaplaceError::TooLarge { vertices: size };
        let triplets: Vec<_> = lower
            .iter()
            .map(|&(row, column, value)| Triplet::new(row as usize, column as usize, value))
            .collect();
        let matrix =
            SparseColMat::try_new_from_triplets(size, size, &triplets).map_err(|_| too_large())?;
        let forward: Vec<usize> = order
            .unwrap_or_default()
            .iter()
            .map(|&v| v as usize)
            .collect();
        let mut inverse = vec![0; forward.len()];
        for (new, &old) in forward.iter().enumerate() {
            inverse[old] = new;
        }
        let ordering = match order {
            None => SymmetricOrdering::Amd,
            Some(_) => SymmetricOrdering::Custom(PermRef::new_checked(&forward, &inverse, size)),
        };
        let params = CholeskySymbolicParams {
            // Below every ratio, so that the smallest systems have supernodes too.
            supernodal_flop_ratio_threshold: SupernodalThreshold(-1.0),
            supernodal_params: SymbolicSupernodalParams {
                relax: Some(&RELAXATION),
            },
            ..Default::default()
        };
        let symbolic =
            factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, ordering, params)
                .map_err(|_| too_large())?;
        let mut values = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| too_large())?;
        symbolic
            .factorize_numeric_llt(
                &mut values,
                matrix.as_ref(),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|_| LaplaceError::NotPositiveDefinite)?;
        if values.iter().any(|value| !value.is_finite()) {
            return Err(LaplaceError::NotPositiveDefinite);
        }
        Ok(Self { symbolic, values })
    }

    /// Rows and columns.
    #[must_use]
    pub fn size(&self) -> usize {
        self.symbolic.nrows()
    }

    /// Solves `A x = b` in place: `x` `[columns x size]`, one right-hand side after another.
    ///
    /// # Panics
    /// Where the length is no multiple of the size.
    pub fn solve(&self, x: &mut [f64]) {
        let size = self.size();
        if size == 0 {
            return;
        }
        let columns = x.len() / size;
        let matrix = MatMut::from_column_major_slice_mut(x, size, columns);
        let scratch = self
            .symbolic
            .solve_in_place_scratch::<f64>(columns, Par::Seq);
        let mut memory = MemBuffer::new(scratch);
        LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            matrix,
            Par::Seq,
            MemStack::new(&mut memory),
        );
    }

    /// The same for vectors: `x` `[size]`.
    pub fn solve_vectors<const N: usize>(&self, x: &mut [[f64; N]]) {
        let mut columns: Vec<f64> = Vec::with_capacity(N * x.len());
        for axis in 0..N {
            columns.extend(x.iter().map(|v| v[axis]));
        }
        self.solve(&mut columns);
        for (axis, column) in columns.chunks(x.len().max(1)).enumerate() {
            for (v, &value) in x.iter_mut().zip(column) {
                v[axis] = value;
            }
        }
    }

    /// Order of elimination: `order[new] = old`.
    #[must_use]
    pub fn order(&self) -> Vec<u32> {
        match self.symbolic.perm() {
            Some(perm) => perm.arrays().0.iter().map(|&old| old as u32).collect(),
            None => (0..self.size() as u32).collect(),
        }
    }

    /// The factor in the core's layout, rounded to `f32`. O(fill)
    ///
    /// # Errors
    /// [`LaplaceError::TooLarge`] beyond the layout's indices.
    ///
    /// # Panics
    /// Never: the factorisation was asked to be supernodal.
    pub fn pack(&self) -> Result<PackedFactor, LaplaceError> {
        let SymbolicCholeskyRaw::Supernodal(symbolic) = self.symbolic.raw() else {
            unreachable!("the threshold forces supernodes");
        };
        let factor = SupernodalLltRef::new(symbolic, &self.values);
        let mut packed = PackedFactor {
            size: self.size(),
            columns: vec![0],
            panels: vec![0],
            ..PackedFactor::default()
        };
        for supernode in 0..symbolic.n_supernodes() {
            let supernode = factor.supernode(supernode);
            let value = |row: usize, column: usize| supernode.val()[(row, column)];
            let width = supernode.val().ncols();
            for group in (0..width).step_by(4) {
                for column in 0..group + 4 {
                    packed.values.push([0, 1, 2, 3].map(|lane| {
                        let row = group + lane;
                        match row {
                            _ if row >= width || column > row => 0.0,
                            _ if row == column => (1.0 / value(row, row)) as f32,
                            _ => value(row, column) as f32,
                        }
                    }));
                }
            }
            // (row, place in the supernode), by row.
            let mut below: Vec<(u32, usize)> = supernode
                .pattern()
                .iter()
                .zip(width..)
                .map(|(&row, place)| (row as u32, place))
                .collect();
            below.sort_unstable();
            for rows in below.chunks(4) {
                for column in 0..width {
                    packed.values.push([0, 1, 2, 3].map(|lane| {
                        rows.get(lane)
                            .map_or(0.0, |&(_, place)| value(place, column) as f32)
                    }));
                }
                let padded = [0, 1, 2, 3].map(|lane| rows.get(lane).map_or(PADDING, |row| row.0));
                packed.rows.push(padded);
            }
            packed.columns.push((supernode.start() + width) as u32);
            packed.panels.push(packed.rows.len() as u32);
        }
        packed.factor().map_err(|_| LaplaceError::TooLarge {
            vertices: self.size(),
        })?;
        Ok(packed)
    }
}

/// The core's arrays of a factor, owned.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PackedFactor {
    /// Rows and columns.
    pub size: usize,
    /// See [`FactorParts::columns`].
    pub columns: Vec<u32>,
    /// See [`FactorParts::panels`].
    pub panels: Vec<u32>,
    /// See [`FactorParts::rows`].
    pub rows: Vec<[u32; 4]>,
    /// See [`FactorParts::values`].
    pub values: Vec<[f32; 4]>,
}

impl PackedFactor {
    /// The core's view, checked.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn factor(&self) -> Result<Factor<'_>, FactorError> {
        Factor::new_checked(self.parts())
    }

    /// The arrays.
    #[must_use]
    pub fn parts(&self) -> FactorParts<'_> {
        FactorParts {
            size: self.size,
            columns: &self.columns,
            panels: &self.panels,
            rows: &self.rows,
            values: &self.values,
        }
    }

    /// Bytes that a solve reads once in each direction.
    #[must_use]
    pub fn bytes(&self) -> usize {
        16 * (self.values.len() + self.rows.len()) + 4 * (self.columns.len() + self.panels.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sinew_core::Level;

    /// Laplacian of a grid plus the identity: well conditioned, fills in.
    fn grid(side: usize) -> Vec<(u32, u32, f64)> {
        let mut entries = Vec::new();
        for at in 0..side * side {
            entries.push((at as u32, at as u32, 5.0));
            if at % side > 0 {
                entries.push((at as u32, at as u32 - 1, -1.0));
            }
            if at >= side {
                entries.push((at as u32, (at - side) as u32, -1.0));
            }
        }
        entries
    }

    fn multiply(lower: &[(u32, u32, f64)], x: &[[f64; 4]]) -> Vec<[f64; 4]> {
        let mut product = vec![[0.0; 4]; x.len()];
        for &(row, column, value) in lower {
            let (row, column) = (row as usize, column as usize);
            for lane in 0..4 {
                product[row][lane] += value * x[column][lane];
                if row != column {
                    product[column][lane] += value * x[row][lane];
                }
            }
        }
        product
    }

    #[test]
    fn both_solves_return_what_was_multiplied() {
        for side in [1, 2, 3, 7, 23] {
            let lower = grid(side);
            let size = side * side;
            let truth: Vec<[f64; 4]> = (0..size)
                .map(|row| [0, 1, 2, 3].map(|lane| ((row * 13 + lane * 5) % 17) as f64 / 8.0))
                .collect();
            let right = multiply(&lower, &truth);
            let cholesky = Cholesky::new(size, &lower, None).expect("positive definite");
            let mut x = right.clone();
            cholesky.solve_vectors(&mut x);
            let order = cholesky.order();
            let packed = cholesky.pack().expect("fits");
            let mut y: Vec<[f32; 4]> = order
                .iter()
                .map(|&old| right[old as usize].map(|value| value as f32))
                .collect();
            packed.factor().expect("sound").solve(&mut y, Level::best());
            for (new, &old) in order.iter().enumerate() {
                for lane in 0..4 {
                    let want = truth[old as usize][lane];
                    assert!((x[old as usize][lane] - want).abs() < 1e-12);
                    assert!((f64::from(y[new][lane]) - want).abs() < 2e-6);
                }
            }
        }
    }

    #[test]
    fn a_given_order_is_kept() {
        let lower = grid(5);
        let order: Vec<u32> = (0..25).map(|at| (at * 7) % 25).collect();
        let cholesky = Cholesky::new(25, &lower, Some(&order)).expect("positive definite");
        assert_eq!(cholesky.order(), order);
        let mut x = vec![[1.0, 2.0, 3.0, 4.0]; 25];
        let right = multiply(&lower, &x);
        x.copy_from_slice(&right);
        cholesky.solve_vectors(&mut x);
        assert!(x.iter().all(|x| (x[2] - 3.0).abs() < 1e-12));
    }

    #[test]
    fn an_indefinite_matrix_is_refused() {
        let lower = [(0, 0, 1.0), (1, 0, 2.0), (1, 1, 1.0)];
        assert!(matches!(
            Cholesky::new(2, &lower, None),
            Err(LaplaceError::NotPositiveDefinite)
        ));
    }
}
