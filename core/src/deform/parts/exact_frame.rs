//! First half of a frame in the exact mode: transformations of parts, weights of residuals.

use core::borrow::BorrowMut;

use super::exact::{COLUMNS, Exact};
use super::rig::Followed;
use super::slots::row;
use crate::deform::SizeError;
use crate::math::{Affine12, IDENTITY, compose, inverse_sqrt, transform_point, transform_vector};
use crate::solve::dense::ldlt;

/// Smallest pivot of a radial-basis system; the basis at its own centre is 2/3.
const PIVOT_FLOOR: f32 = 0.02;

/// What a frame in the exact mode shall do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ExactBudget {
    /// Deform parts quadratically instead of moving them rigidly.
    pub quadratic: bool,
    /// Parts whose residuals are solved in this frame, in turn; the others keep the weights they
    /// have, in their own frames.
    pub residual_parts: usize,
}

impl ExactBudget {
    /// All of the work in every frame.
    pub const UNLIMITED: Self = Self {
        quadratic: true,
        residual_parts: usize::MAX,
    };
}

impl Default for ExactBudget {
    fn default() -> Self {
        Self::UNLIMITED
    }
}

/// What a frame in the exact mode did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ExactReport {
    /// Parts whose residuals were solved.
    pub solved_parts: usize,
    /// Parts that must wait for a later frame.
    pub skipped_parts: usize,
    /// Parts whose system was near singular: markers in one place. Their weights stay bounded.
    pub unsound_parts: usize,
}

/// What the exact mode remembers between frames: [`exact_state_len`] numbers.
#[derive(Clone, Debug)]
pub struct ExactState<B> {
    numbers: B,
    started: bool,
    next_part: usize,
}

/// Numbers of an [`ExactState`].
#[must_use]
pub const fn exact_state_len(members: usize) -> usize {
    3 * members
}

/// Numbers of the workspace of [`Exact::handles`]; `most_members`: of a part.
#[must_use]
pub const fn exact_workspace_len(
    (markers, parts): (usize, usize),
    members: usize,
    most_members: usize,
) -> usize {
    let solve = most_members * most_members + 3 * most_members;
    3 * COLUMNS * parts + 6 * members + 3 * markers + solve
}

impl<B> ExactState<B> {
    /// A state in the caller's memory; old contents do not matter.
    #[must_use]
    pub const fn with(numbers: B) -> Self {
        Self {
            numbers,
            started: false,
            next_part: 0,
        }
    }

    /// Forgets everything: the next frame starts anew, as after a cut.
    pub const fn reset(&mut self) {
        self.started = false;
    }
}

/// What moves vertices in a frame.
#[derive(Clone, Copy, Debug)]
pub struct ExactHandles<'w> {
    /// `[parts]`: three rows of columns, from terms of the reference frame to world space.
    pub(super) maps: &'w [[f32; 3 * COLUMNS]],
    /// `[members]`: centre, then weight, in world space.
    pub(super) members: &'w [[f32; 6]],
    /// What was done.
    pub report: ExactReport,
}

impl Exact<'_> {
    /// Numbers that [`Self::handles`] needs as workspace.
    #[must_use]
    pub fn workspace_len(&self) -> usize {
        let members = self.tables.member_markers.len();
        let counts = (self.marker_count, self.part_count());
        exact_workspace_len(counts, members, self.most_members)
    }

    /// Finds the transformation of every part (equation 6) and the weights of its residual
    /// (equation 7).
    ///
    /// `followed`: markers and frames. `state`: [`exact_state_len`]; `workspace`:
    /// [`Self::workspace_len`] numbers, old contents do not matter. O(members^3 / parts^2)
    ///
    /// # Errors
    /// [`SizeError`] where state or workspace is too small.
    pub fn handles<'w, B: BorrowMut<[f32]>>(
        &self,
        followed: &Followed<'_>,
        budget: ExactBudget,
        state: &mut ExactState<B>,
        workspace: &'w mut [f32],
    ) -> Result<ExactHandles<'w>, SizeError> {
        let (parts, count) = (self.part_count(), self.tables.member_markers.len());
        let short = SizeError::TooSmall {
            buffer: "exact workspace",
            needed: self.workspace_len(),
            found: workspace.len(),
        };
        let (maps, rest) = workspace
            .split_at_mut_checked(3 * COLUMNS * parts)
            .ok_or(short)?;
        let (members, rest) = rest.split_at_mut_checked(6 * count).ok_or(short)?;
        let (left, rest) = rest
            .split_at_mut_checked(3 * self.marker_count)
            .ok_or(short)?;
        let left = left.as_chunks_mut::<3>().0;
        let square = self.most_members * self.most_members;
        let (matrix, right) = rest.split_at_mut_checked(square).ok_or(short)?;
        let right = right.get_mut(..3 * self.most_members).ok_or(short)?;
        let maps = maps.as_chunks_mut::<{ 3 * COLUMNS }>().0;
        let members = members.as_chunks_mut::<6>().0;
        let right = right.as_chunks_mut::<3>().0;
        let short = SizeError::TooSmall {
            buffer: "exact state",
            needed: exact_state_len(count),
            found: state.numbers.borrow().len(),
        };
        let weights = state.numbers.borrow_mut();
        let weights = weights.get_mut(..3 * count).ok_or(short)?;
        let weights = weights.as_chunks_mut::<3>().0;
        if !state.started {
            state.started = true;
            state.next_part = 0;
            weights.fill([0.0; 3]);
        }
        for part in 0..parts {
            let frame = followed.palette.get(part).unwrap_or(&IDENTITY);
            let range = row(self.tables.member_starts, part);
            if let (Some(map), Some(out)) = (maps.get_mut(part), members.get_mut(range)) {
                *map = self.map(part, frame, followed.positions, budget.quadratic);
                self.centres(part, map, out);
            }
        }
        self.residuals(members, followed.positions, left);
        let mut report = ExactReport::default();
        let first = if state.next_part < parts {
            state.next_part
        } else {
            0
        };
        for turn in 0..parts {
            // Parts whose turn it is come first, so the budget reaches everyone.
            let part = (first + turn) % parts.max(1);
            let frame = followed.palette.get(part).unwrap_or(&IDENTITY);
            let range = row(self.tables.member_starts, part);
            let (Some(out), Some(weights)) = (
                members.get_mut(range.clone()),
                weights.get_mut(range.clone()),
            ) else {
                continue;
            };
            if report.solved_parts < budget.residual_parts {
                report.solved_parts += 1;
                let n = out.len();
                let (Some(matrix), Some(right)) = (matrix.get_mut(..n * n), right.get_mut(..n))
                else {
                    continue;
                };
                let markers = self.tables.member_markers.get(range);
                for (right, &marker) in right.iter_mut().zip(markers.unwrap_or_default()) {
                    *right = left.get(usize::from(marker)).copied().unwrap_or_default();
                }
                report.unsound_parts += usize::from(!self.solve(part, out, matrix, right));
                let back = transposed(frame);
                for (weight, solved) in weights.iter_mut().zip(right) {
                    *weight = transform_vector(&back, *solved);
                }
            } else {
                report.skipped_parts += 1;
            }
            for ([_, _, _, x, y, z], weight) in out.iter_mut().zip(weights) {
                [*x, *y, *z] = transform_vector(frame, *weight);
            }
        }
        state.next_part = if report.skipped_parts > 0 {
            (first + report.solved_parts) % parts.max(1)
        } else {
            0
        };
        Ok(ExactHandles {
            maps,
            members,
            report,
        })
    }

    /// From the terms of a part's reference frame to world space.
    fn map(
        &self,
        part: usize,
        frame: &Affine12,
        positions: &[[f32; 3]],
        quadratic: bool,
    ) -> [f32; 3 * COLUMNS] {
        let mut local = [0.0; 3 * COLUMNS];
        for (axis, row) in local.as_chunks_mut::<COLUMNS>().0.iter_mut().enumerate() {
            if let Some(diagonal) = row.get_mut(axis) {
                *diagonal = 1.0;
            }
        }
        if quadratic {
            let back = inverted(frame);
            let to_local = self.tables.to_local.get(part).unwrap_or(&IDENTITY);
            let back = compose(to_local, &back);
            self.for_members(part, |marker, reference, inverse| {
                let Some(&position) = positions.get(marker) else {
                    return;
                };
                let now = transform_point(&back, position);
                let rows = local.as_chunks_mut::<COLUMNS>().0.iter_mut();
                for (row, (now, reference)) in rows.zip(now.iter().zip(reference)) {
                    let moved = now - reference;
                    for (sum, share) in row.iter_mut().zip(inverse) {
                        *sum += moved * share;
                    }
                }
            });
        }
        let from_local = self.tables.from_local.get(part).unwrap_or(&IDENTITY);
        let matrix = compose(frame, from_local);
        let mut map = [0.0; 3 * COLUMNS];
        let [x, y, z] = {
            let mut rows = local.as_chunks::<COLUMNS>().0.iter();
            let mut next = || rows.next().copied().unwrap_or([0.0; COLUMNS]);
            [next(), next(), next()]
        };
        let rows = map.as_chunks_mut::<COLUMNS>().0.iter_mut();
        for (row, &[a, b, c, t]) in rows.zip(matrix.as_chunks::<4>().0) {
            let columns = x.iter().zip(&y).zip(&z);
            for (to, ((x, y), z)) in row.iter_mut().zip(columns) {
                *to = a * x + b * y + c * z;
            }
            if let Some(constant) = row.last_mut() {
                *constant += t;
            }
        }
        map
    }

    fn for_members(&self, part: usize, mut each: impl FnMut(usize, &[f32; 4], &[f32; COLUMNS])) {
        let range = row(self.tables.member_starts, part);
        let markers = self.tables.member_markers.get(range.clone());
        let local = self.tables.member_local.get(range.clone());
        let inverse = self.tables.member_inverse.get(range);
        let members = markers.unwrap_or_default().iter();
        let members = members.zip(local.unwrap_or_default());
        for ((&marker, local), inverse) in members.zip(inverse.unwrap_or_default()) {
            each(usize::from(marker), local, inverse);
        }
    }

    /// Where the transformation takes the members.
    fn centres(&self, part: usize, map: &[f32; 3 * COLUMNS], out: &mut [[f32; 6]]) {
        let range = row(self.tables.member_starts, part);
        let local = self.tables.member_local.get(range).unwrap_or_default();
        for (out, &[x, y, z, _]) in out.iter_mut().zip(local) {
            let terms = [x, y, z, x * x, y * y, z * z, x * y, y * z, z * x, 1.0];
            for (to, map) in out.iter_mut().zip(map.as_chunks::<COLUMNS>().0) {
                *to = map.iter().zip(terms).map(|(a, b)| a * b).sum();
            }
        }
    }

    /// What is left between the markers and where the transformations of all parts together take
    /// them: `[markers]`.
    fn residuals(&self, members: &[[f32; 6]], positions: &[[f32; 3]], left: &mut [[f32; 3]]) {
        for (at, left) in left.iter_mut().enumerate() {
            *left = positions.get(at).copied().unwrap_or_default();
        }
        let shares = self.tables.member_local.iter().zip(members);
        let all = self.tables.member_markers.iter().zip(shares);
        for (&marker, (&[.., share], centre)) in all {
            if let Some(left) = left.get_mut(usize::from(marker)) {
                for (left, centre) in left.iter_mut().zip(centre) {
                    *left -= share * centre;
                }
            }
        }
    }

    /// Solves equation 7 in place; whether the system was sound.
    fn solve(
        &self,
        part: usize,
        centres: &[[f32; 6]],
        matrix: &mut [f32],
        right: &mut [[f32; 3]],
    ) -> bool {
        let n = centres.len();
        let dilation = self.tables.dilations.get(part).copied().unwrap_or(0.0);
        let rows = matrix.chunks_exact_mut(n.max(1)).enumerate();
        for ((at, row), &[x, y, z, ..]) in rows.zip(centres) {
            let row = row.get_mut(at..).unwrap_or_default();
            let others = centres.get(at..).unwrap_or_default();
            for (to, &[a, b, c, ..]) in row.iter_mut().zip(others) {
                let (dx, dy, dz) = (dilation * (x - a), dilation * (y - b), dilation * (z - c));
                *to = basis(dx * dx + dy * dy + dz * dz);
            }
            if let Some(diagonal) = row.first_mut() {
                *diagonal += self.tables.smoothing;
            }
        }
        let sound = ldlt::factor(matrix, n, PIVOT_FLOOR);
        ldlt::solve(matrix, n, right);
        sound
    }
}

/// The cubic B-spline of a distance in units of half its support.
fn basis(squared: f32) -> f32 {
    let distance = squared * inverse_sqrt(squared + 1e-20);
    let outer = (2.0 - distance).max(0.0);
    let inner = (1.0 - distance).max(0.0);
    (outer * outer * outer - 4.0 * (inner * inner * inner)) * (1.0 / 6.0)
}

/// The opposite rotation of a rigid matrix, without translation.
fn transposed(&[a, b, c, _, d, e, f, _, g, h, i, _]: &Affine12) -> Affine12 {
    [a, d, g, 0.0, b, e, h, 0.0, c, f, i, 0.0]
}

/// The opposite of a rigid matrix.
fn inverted(matrix: &Affine12) -> Affine12 {
    let &[_, _, _, x, _, _, _, y, _, _, _, z] = matrix;
    let mut back = transposed(matrix);
    let [x, y, z] = transform_vector(&back, [x, y, z]);
    for (to, value) in back.iter_mut().skip(3).step_by(4).zip([-x, -y, -z]) {
        *to = value;
    }
    back
}
