//! Coefficients of vertices over a set of handles.
//!
//! Unknown are changes to blended rigid motion, `v = sum_k w_k (p_k + R_k (v0 - p0_k))`. Changes
//! that would break rigid motion of the whole body, or move the rest pose, are priced out.

use glam::{DMat3, DVec3};

/// Rotation and position of a handle in a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Since the rest pose.
    pub rotation: DMat3,
    /// Metres.
    pub position: DVec3,
}

impl Frame {
    /// `R b + n p`.
    #[must_use]
    pub fn apply(&self, [x, y, z, n]: [f64; 4]) -> DVec3 {
        self.rotation * DVec3::new(x, y, z) + self.position * n
    }
}

/// Price of breaking rigid motion, against a pose.
const RIGID: f64 = 1e4;

/// The normal equations of a set of handles, factored.
pub(super) struct Fit<'f> {
    handles: &'f [usize],
    frames: &'f [Vec<Frame>],
    handle_rest: Vec<DVec3>,
    positions: &'f [DVec3],
    /// `[poses]`: middle of the handles, taken off positions to keep the equations well scaled.
    middles: Vec<DVec3>,
    /// Lower triangle of the Cholesky factor, row-major, `[unknowns x unknowns]`.
    factor: Vec<f64>,
}

impl<'f> Fit<'f> {
    /// `handles`: indices into `vertices` (vertex of each handle) and `frames[pose]`.
    pub fn new(
        handles: &'f [usize],
        vertices: &[u32],
        frames: &'f [Vec<Frame>],
        positions: &'f [DVec3],
        ridge: f64,
    ) -> Self {
        let handle_rest: Vec<DVec3> = handles
            .iter()
            .map(|&handle| positions[vertices[handle] as usize])
            .collect();
        let count = handles.len().max(1) as f64;
        let middle = |frames: &Vec<Frame>| {
            handles.iter().map(|&h| frames[h].position).sum::<DVec3>() / count
        };
        let mut fit = Self {
            handles,
            frames,
            handle_rest,
            positions,
            middles: frames.iter().map(middle).collect(),
            factor: Vec::new(),
        };
        let unknowns = 4 * handles.len();
        let mut matrix = vec![0.0; unknowns * unknowns];
        let mut row = vec![0.0; unknowns];
        for pose in 0..frames.len() {
            for axis in 0..3 {
                fit.row(pose, axis, &mut row);
                add_outer(&mut matrix, &row, 1.0);
            }
        }
        let squares: f64 = (0..unknowns).map(|at| matrix[at * unknowns + at]).sum();
        let mean = squares / unknowns.max(1) as f64;
        for at in 0..unknowns {
            matrix[at * unknowns + at] += ridge * mean;
        }
        let rest_middle = fit.handle_rest.iter().sum::<DVec3>() / count;
        for constraint in 0..4 {
            row.fill(0.0);
            for (terms, rest) in row.chunks_mut(4).zip(&fit.handle_rest) {
                if constraint < 3 {
                    terms[constraint] = 1.0;
                    terms[3] = (rest - rest_middle)[constraint];
                } else {
                    terms[3] = 1.0;
                }
            }
            add_outer(&mut matrix, &row, RIGID * frames.len() as f64);
        }
        factor(&mut matrix, unknowns);
        fit.factor = matrix;
        fit
    }

    /// Coefficients `[handles]` of a vertex. `weights`: of blended rigid motion; `exact`:
    /// `[poses][vertices]`.
    pub fn solve(&self, vertex: usize, weights: &[f64], exact: &[Vec<DVec3>]) -> Vec<[f64; 4]> {
        let rest = self.positions[vertex];
        let start: Vec<[f64; 4]> = weights
            .iter()
            .zip(&self.handle_rest)
            .map(|(&weight, &handle)| {
                let [x, y, z] = (weight * (rest - handle)).to_array();
                [x, y, z, weight]
            })
            .collect();
        let unknowns = 4 * self.handles.len();
        let (mut right, mut row) = (vec![0.0; unknowns], vec![0.0; unknowns]);
        for (pose, exact) in exact.iter().enumerate() {
            let frames = self
                .handles
                .iter()
                .map(|&handle| &self.frames[pose][handle]);
            let blended: DVec3 = frames.zip(&start).map(|(frame, &c)| frame.apply(c)).sum();
            let missing = exact[vertex] - blended;
            for axis in 0..3 {
                self.row(pose, axis, &mut row);
                for (sum, term) in right.iter_mut().zip(&row) {
                    *sum += term * missing[axis];
                }
            }
        }
        substitute(&self.factor, &mut right);
        let changes = right.chunks(4);
        start
            .iter()
            .zip(changes)
            .map(|(start, change)| std::array::from_fn(|at| start[at] + change[at]))
            .collect()
    }

    /// What each unknown adds to one axis in a pose.
    fn row(&self, pose: usize, axis: usize, row: &mut [f64]) {
        for (terms, &handle) in row.chunks_mut(4).zip(self.handles) {
            let frame = &self.frames[pose][handle];
            let turn = frame.rotation.row(axis);
            let position = (frame.position - self.middles[pose])[axis];
            terms.copy_from_slice(&[turn.x, turn.y, turn.z, position]);
        }
    }
}

/// `matrix += weight row row'`, lower triangle.
fn add_outer(matrix: &mut [f64], row: &[f64], weight: f64) {
    for (line, &a) in matrix.chunks_mut(row.len().max(1)).zip(row) {
        let factor = weight * a;
        for (sum, &b) in line.iter_mut().zip(row) {
            *sum += factor * b;
        }
    }
}

/// Cholesky of the lower triangle in place, row-major.
pub(in crate::fit::laplace) fn factor(matrix: &mut [f64], size: usize) {
    for row in 0..size {
        for column in 0..=row {
            let products: f64 = (0..column)
                .map(|k| matrix[row * size + k] * matrix[column * size + k])
                .sum();
            let rest = matrix[row * size + column] - products;
            matrix[row * size + column] = if row == column {
                // Rounding may leave less than nothing where terms repeat each other.
                rest.max(1e-12).sqrt()
            } else {
                rest / matrix[column * size + column]
            };
        }
    }
}

/// Solves with what [`factor`] left.
pub(in crate::fit::laplace) fn substitute(factor: &[f64], x: &mut [f64]) {
    let size = x.len();
    for row in 0..size {
        let products: f64 = (0..row).map(|k| factor[row * size + k] * x[k]).sum();
        x[row] = (x[row] - products) / factor[row * size + row];
    }
    for row in (0..size).rev() {
        let products: f64 = (row + 1..size).map(|k| factor[k * size + row] * x[k]).sum();
        x[row] = (x[row] - products) / factor[row * size + row];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// Two handles; the truth is a plain sum that blended rigid motion does not give.
    #[test]
    fn a_sum_over_handles_is_found_again() {
        let positions = [DVec3::ZERO, DVec3::X, DVec3::new(0.4, 0.3, 0.0)];
        let frame = |seed: f64| Frame {
            rotation: DMat3::from_quat(DQuat::from_euler(
                glam::EulerRot::XYZ,
                seed.sin(),
                (2.0 * seed).cos() - 1.0,
                seed / 7.0,
            )),
            position: DVec3::new(seed.sin(), seed.cos() - 1.0, 0.1 * seed),
        };
        let rest = |handle: usize| Frame {
            rotation: DMat3::IDENTITY,
            position: positions[handle],
        };
        let mut frames = vec![vec![rest(0), rest(1)]];
        frames.extend((1..40).map(|k| vec![frame(f64::from(k)), frame(f64::from(k) * 1.3)]));
        // b sums to v0 - n p0: rigid motion is kept.
        let truth = [[0.3, 0.1, 0.05, 0.75], [-0.15, 0.2, -0.05, 0.25]];
        let place = |frames: &Vec<Frame>| frames[0].apply(truth[0]) + frames[1].apply(truth[1]);
        let exact: Vec<Vec<DVec3>> = frames
            .iter()
            .map(|frames| vec![DVec3::ZERO, DVec3::ZERO, place(frames)])
            .collect();
        let fit = Fit::new(&[0, 1], &[0, 1], &frames, &positions, 1e-9);
        let found = fit.solve(2, &[0.5, 0.5], &exact);
        for (found, truth) in found.iter().flatten().zip(truth.as_flattened()) {
            assert!((found - truth).abs() < 1e-4, "{found} {truth}");
        }
    }
}
