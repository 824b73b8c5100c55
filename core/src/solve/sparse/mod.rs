//! Sparse symmetric positive definite systems, factored beforehand: `L L' x = b`, in place.
//!
//! A host factors the matrix once, in `f64`, and stores `L` in `f32`. A frame then costs one
//! forward and one backward substitution, which read `L` once each, and nothing else. Up to four
//! right-hand sides are solved together, one a lane (x, y, z and a spare one, or a quaternion).
//!
//! # Layout of the factor
//! Neighbouring columns whose entries stand in the same rows form a *supernode*. A supernode of
//! `w` columns stores, as quads of four `f32` (four rows of one column):
//!
//! 1. its triangle, four rows at a time: rows `4g..4g + 4` take `4g + 4` quads, one a column. In
//!    the last four, entries above the diagonal are zero and the diagonal holds *reciprocals*;
//!    rows and columns beyond `w` are zero;
//! 2. its panels: four rows below the triangle and `w` quads, one a column. The last panel of a
//!    supernode is filled up with rows [`PADDING`] and zeros.
//!
//! Four rows need the same `x`, and their four sums stay in registers while the quads stream by.
//! Quads stand in the order of use, so there are no offsets to store.
//!
//! # Use alone
//! ```
//! use sinew_core::{Level, solve::sparse::{Factor, FactorParts, PADDING}};
//!
//! // L = [2 . .]   one supernode of two columns (rows 0, 1) with row 2 below, then row 2.
//! //     [1 3 .]
//! //     [4 5 6]
//! let parts = FactorParts {
//!     size: 3,
//!     columns: &[0, 2, 3],
//!     panels: &[0, 1, 1],
//!     rows: &[[2, PADDING, PADDING, PADDING]],
//!     values: &[
//!         [1.0 / 2.0, 1.0, 0.0, 0.0], [0.0, 1.0 / 3.0, 0.0, 0.0], [0.0; 4], [0.0; 4],
//!         [4.0, 0.0, 0.0, 0.0], [5.0, 0.0, 0.0, 0.0],
//!         [1.0 / 6.0, 0.0, 0.0, 0.0], [0.0; 4], [0.0; 4], [0.0; 4],
//!     ],
//! };
//! let factor = Factor::new_checked(parts)?;
//! // Two systems at once: the solutions are (1, 1, 1) and (0, 0, 1).
//! let mut x = [[14.0, 8.0, 0.0, 0.0], [31.0, 19.0, 0.0, 0.0], [104.0, 77.0, 0.0, 0.0]];
//! factor.solve(&mut x, Level::best());
//! for row in [0, 1, 2] {
//!     assert!((x[row][0] - 1.0).abs() < 1e-5);
//! }
//! assert!(x[0][1].abs() < 1e-5 && (x[2][1] - 1.0).abs() < 1e-5);
//! # Ok::<(), sinew_core::solve::sparse::FactorError>(())
//! ```

mod check;
mod quad;
mod substitute;

pub use check::FactorError;

use crate::Level;

/// Stands for a row that does not exist, in the last panel of a supernode.
pub const PADDING: u32 = u32::MAX;

/// Four right-hand sides of one row.
pub type Row4 = [f32; 4];

/// The arrays of a factor, as the [module](self) describes them.
#[derive(Clone, Copy, Debug)]
pub struct FactorParts<'a> {
    /// Rows and columns of the matrix.
    pub size: usize,
    /// `[supernodes + 1]`: first column of each supernode, then `size`.
    pub columns: &'a [u32],
    /// `[supernodes + 1]`: first panel of each supernode, then the number of panels.
    pub panels: &'a [u32],
    /// `[panels]`: rows of each panel, ascending in a supernode.
    pub rows: &'a [[u32; 4]],
    /// `[quads]`: triangle, then panels, of each supernode.
    pub values: &'a [[f32; 4]],
}

/// A checked factor that borrows its arrays.
#[derive(Clone, Copy, Debug)]
pub struct Factor<'a> {
    parts: FactorParts<'a>,
}

impl<'a> Factor<'a> {
    /// Checks every index and number once; solving cannot fail after that. O(values).
    ///
    /// # Errors
    /// [`FactorError`] with the place of the first fault.
    pub fn new_checked(parts: FactorParts<'a>) -> Result<Self, FactorError> {
        check::check(&parts)?;
        Ok(Self { parts })
    }

    /// Arrays that were checked before.
    pub(crate) const fn proved(parts: FactorParts<'a>) -> Self {
        Self { parts }
    }

    /// Rows and columns of the matrix.
    #[must_use]
    pub fn size(&self) -> usize {
        self.parts.size
    }

    /// The arrays.
    #[must_use]
    pub fn parts(&self) -> &FactorParts<'a> {
        &self.parts
    }

    /// Multiplications (and as many additions) that [`Self::solve`] does for each right-hand side,
    /// filled up entries included.
    #[must_use]
    pub fn multiply_adds(&self) -> usize {
        self.parts.values.len().saturating_mul(8)
    }

    /// Solves `L L' x = b`: `x` holds `b` before and the solution after.
    ///
    /// `x`: `[size]`, four right-hand sides a row, in the factor's order of rows. A slice of
    /// another length is left alone. The bits do not depend on `level`. O(values)
    pub fn solve(&self, x: &mut [Row4], level: Level) {
        self.run(x, level, true, true);
    }

    /// Solves `L x = b` in place, otherwise as [`Self::solve`].
    pub fn solve_lower(&self, x: &mut [Row4], level: Level) {
        self.run(x, level, true, false);
    }

    /// Solves `L' x = b` in place, otherwise as [`Self::solve`].
    pub fn solve_upper(&self, x: &mut [Row4], level: Level) {
        self.run(x, level, false, true);
    }

    fn run(&self, x: &mut [Row4], level: Level, lower: bool, upper: bool) {
        if x.len() != self.parts.size {
            return;
        }
        match level {
            Level::Scalar => substitute::run::<[f32; 4]>((), &self.parts, x, lower, upper),
            #[cfg(feature = "simd")]
            Level::Simd(level) => fearless_simd::dispatch!(level, simd => {
                substitute::run_simd(simd, &self.parts, x, lower, upper);
            }),
        }
    }
}

/// Quads of the triangle of a supernode of `width` columns.
#[must_use]
pub const fn triangle_quads(width: usize) -> usize {
    let groups = width.div_ceil(4);
    2 * groups * (groups + 1)
}
