//! What flesh does when no marker is seen: weights of morph targets predicted from a skeleton in
//! motion.
//!
//! Each part gives a fixed number of features: how it is bent against its parent, how gravity lies
//! in it, and two damped springs that its acceleration shakes. A weight is a fixed linear sum of
//! features within a fixed range, learnt from a dense capture (the future work of Park & Hodgins
//! 2006, section 7).

use core::borrow::BorrowMut;

use super::error::{below, length, numbers, starts};
use super::slots::row;
use super::springs::{PART_STATE, SPRINGS, shake};
use super::{PartsError, PartsTable};
use crate::asset::NO_PARENT;
use crate::deform::SizeError;
use crate::math::{Affine12, IDENTITY, inverse_sqrt, transform_point, transform_vector};

/// Features of a part: three of its bend, their six products, three of gravity, three of each
/// spring.
pub const PART_FEATURES: usize = BEND_FEATURES + 3 + 3 * SPRINGS;
/// Those of a bend come first.
pub const BEND_FEATURES: usize = 9;
/// A frame this long after the one before, seconds, starts anew, as after a cut.
const CUT: f32 = 0.25;
/// Shorter ones show the same moment again.
const SAME: f32 = 1e-4;
/// Springs of a part that does not exist.
const STIFF: [[f32; 2]; SPRINGS] = [[60.0, 0.5]; SPRINGS];

/// Tables that predict weights.
#[derive(Clone, Copy, Debug, Default)]
pub struct CorrectiveTables<'a> {
    /// `[parts]`: parent, before the part itself, or [`NO_PARENT`].
    pub parents: &'a [u16],
    /// `[parts]`: the bind whose matrix takes the part from the rest pose.
    pub binds: &'a [u16],
    /// `[parts]`: the place in the rest pose whose acceleration shakes the springs, metres.
    pub pivots: &'a [[f32; 3]],
    /// `[parts]`: angular frequency (radians a second) and damping ratio of the two springs.
    pub springs: &'a [[[f32; 2]; SPRINGS]],
    /// `[modes + 1]`: first term of each mode.
    pub starts: &'a [u32],
    /// `[terms]`: feature, `PART_FEATURES` for each part and then a constant one.
    pub features: &'a [u16],
    /// `[terms]`: what the feature adds to the mode's weight.
    pub coefficients: &'a [f32],
    /// `[modes]`: least and largest weight.
    pub ranges: &'a [[f32; 2]],
}

/// A checked predictor of weights.
#[derive(Clone, Copy, Debug)]
pub struct Corrective<'a> {
    tables: CorrectiveTables<'a>,
}

/// What a predictor remembers, in the caller's memory: [`corrective_state_len`] numbers.
#[derive(Clone, Debug)]
pub struct CorrectiveState<B> {
    numbers: B,
    started: bool,
}

/// Numbers of a [`CorrectiveState`].
#[must_use]
pub const fn corrective_state_len(parts: usize) -> usize {
    parts * PART_STATE
}

/// Number of features.
#[must_use]
pub const fn corrective_feature_count(parts: usize) -> usize {
    if parts == 0 {
        0
    } else {
        parts * PART_FEATURES + 1
    }
}

/// Multiplications of a frame; an upper bound for any input.
#[must_use]
pub const fn corrective_multiply_adds(parts: usize, terms: usize) -> usize {
    190 * parts + terms
}

impl<B> CorrectiveState<B> {
    /// A state in the caller's memory; old contents do not matter.
    #[must_use]
    pub const fn with(numbers: B) -> Self {
        Self::resumed(numbers, false)
    }

    /// A state whose memory holds what an earlier frame left, if it was `started`.
    #[must_use]
    pub const fn resumed(numbers: B, started: bool) -> Self {
        Self { numbers, started }
    }

    /// Whether some frame was seen.
    #[must_use]
    pub const fn is_started(&self) -> bool {
        self.started
    }

    /// Forgets everything: the next frame starts anew, as after a cut.
    pub const fn reset(&mut self) {
        self.started = false;
    }
}

impl<'a> Corrective<'a> {
    /// Checks every table once; a step cannot fail after that. O(tables)
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn new_checked(
        tables: CorrectiveTables<'a>,
        bind_count: usize,
    ) -> Result<Self, PartsError> {
        let parts = tables.parents.len();
        for (at, &parent) in tables.parents.iter().enumerate() {
            if parent != NO_PARENT && usize::from(parent) >= at {
                let table = PartsTable::Parents;
                return Err(PartsError::Index { table, at });
            }
        }
        length(PartsTable::Parents, tables.binds.len(), parts)?;
        let binds = tables.binds.iter().map(|&bind| usize::from(bind));
        below(PartsTable::Parents, binds, bind_count)?;
        let table = PartsTable::Modes;
        length(table, tables.pivots.len(), parts)?;
        numbers(table, tables.pivots.as_flattened(), 1e6)?;
        length(table, tables.springs.len(), parts)?;
        let springs = tables.springs.as_flattened().as_flattened();
        numbers(table, springs, 1e3)?;
        if let Some(at) = springs.iter().position(|&x| x <= 1e-3) {
            return Err(PartsError::Number { table, at });
        }
        let terms = tables.features.len();
        length(table, tables.coefficients.len(), terms)?;
        starts(tables.starts, tables.ranges.len(), terms)?;
        let features = tables.features.iter().map(|&feature| usize::from(feature));
        below(table, features, corrective_feature_count(parts))?;
        numbers(table, tables.coefficients, 1e6)?;
        numbers(table, tables.ranges.as_flattened(), 1e3)?;
        if let Some(at) = tables.ranges.iter().position(|[low, high]| low > high) {
            return Err(PartsError::Number { table, at });
        }
        Ok(Self { tables })
    }

    /// The tables.
    #[must_use]
    pub fn tables(&self) -> &CorrectiveTables<'a> {
        &self.tables
    }

    /// Number of weights.
    #[must_use]
    pub fn mode_count(&self) -> usize {
        self.tables.ranges.len()
    }

    /// Number of near-rigid parts.
    #[must_use]
    pub fn part_count(&self) -> usize {
        self.tables.parents.len()
    }

    /// Features of a frame: what the coefficients were learnt against.
    ///
    /// `palette`: `[binds]`, from the rest pose; one that is not finite counts as the rest pose.
    /// `seconds`: since the frame before; 0 shows the same moment again, and so does NaN.
    /// `features`: [`corrective_feature_count`] numbers, old contents do not matter. O(parts)
    ///
    /// # Errors
    /// [`SizeError`] where the state or `features` is too small.
    pub fn features<B: BorrowMut<[f32]>>(
        &self,
        palette: &[Affine12],
        seconds: f32,
        state: &mut CorrectiveState<B>,
        features: &mut [f32],
    ) -> Result<(), SizeError> {
        let parts = self.part_count();
        let (needed, found) = (corrective_feature_count(parts), features.len());
        let features = features.get_mut(..needed).ok_or(SizeError::TooSmall {
            buffer: "features",
            needed,
            found,
        })?;
        let (needed, found) = (corrective_state_len(parts), state.numbers.borrow().len());
        let kept = state.numbers.borrow_mut();
        let kept = kept.get_mut(..needed).ok_or(SizeError::TooSmall {
            buffer: "corrective state",
            needed,
            found,
        })?;
        let starts = !state.started || seconds > CUT;
        let seconds = if seconds > SAME { seconds } else { 0.0 };
        let frame_of = |part: usize| {
            let bind = self.tables.binds.get(part).copied().unwrap_or(NO_PARENT);
            let frame = palette.get(usize::from(bind));
            frame.filter(|frame| usable(frame)).unwrap_or(&IDENTITY)
        };
        let rows = features.as_chunks_mut::<PART_FEATURES>().0.iter_mut();
        let kept = kept.as_chunks_mut::<PART_STATE>().0.iter_mut();
        for (part, (out, kept)) in rows.zip(kept).enumerate() {
            let frame = frame_of(part);
            let parent = self.tables.parents.get(part).copied().unwrap_or(NO_PARENT);
            let [x, y, z] = if parent == NO_PARENT {
                [0.0; 3]
            } else {
                bend(frame_of(usize::from(parent)), frame)
            };
            let [dx, dy, dz] = turned_back(frame, [0.0, -1.0, 0.0]);
            let pivot = self.tables.pivots.get(part).copied().unwrap_or_default();
            let now = transform_point(frame, pivot);
            let springs = self.tables.springs.get(part).unwrap_or(&STIFF);
            let turn = |pull| turned_back(frame, pull);
            let [[ax, ay, az], [bx, by, bz]] = shake(springs, turn, now, (seconds, starts), kept);
            *out = [
                x,
                y,
                z,
                x * x,
                y * y,
                z * z,
                x * y,
                y * z,
                z * x,
                dx,
                dy,
                dz,
                ax,
                ay,
                az,
                bx,
                by,
                bz,
            ];
        }
        if let Some(constant) = features.last_mut() {
            *constant = 1.0;
        }
        state.started = true;
        Ok(())
    }

    /// Weights `[modes]` of a frame from its features; old contents do not matter. O(terms)
    pub fn weights(&self, features: &[f32], weights: &mut [f32]) {
        for (mode, (weight, &[low, high])) in weights.iter_mut().zip(self.tables.ranges).enumerate()
        {
            let range = row(self.tables.starts, mode);
            let terms = self.tables.features.get(range.clone()).unwrap_or_default();
            let coefficients = self.tables.coefficients.get(range).unwrap_or_default();
            let mut sum = 0.0_f32;
            for (&feature, coefficient) in terms.iter().zip(coefficients) {
                let value = features.get(usize::from(feature)).copied().unwrap_or(0.0);
                sum += value * coefficient;
            }
            *weight = sum.max(low).min(high);
        }
    }
}

/// Whether a matrix is finite and of a size that cannot overflow.
fn usable(frame: &Affine12) -> bool {
    frame.iter().all(|x| (-1e7..=1e7).contains(x))
}

/// Sine of half the angle times the axis, of a part's turn against its parent.
fn bend(above: &Affine12, frame: &Affine12) -> [f32; 3] {
    // The relative rotation, columns of the parent against columns of the part.
    let column = |m: &Affine12, at: usize| {
        let mut out = [0.0; 3];
        for (out, row) in out.iter_mut().zip(m.as_chunks::<4>().0) {
            *out = row.get(at).copied().unwrap_or(0.0);
        }
        out
    };
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (ax, ay, az) = (column(above, 0), column(above, 1), column(above, 2));
    let (bx, by, bz) = (column(frame, 0), column(frame, 1), column(frame, 2));
    // Both may be scaled, evenly.
    let size = |x, y, z| (dot(x, x) + dot(y, y) + dot(z, z)) * (1.0 / 3.0);
    let scale = inverse_sqrt((size(ax, ay, az) * size(bx, by, bz)).clamp(1e-12, 1e12));
    let trace = scale * (dot(ax, bx) + dot(ay, by) + dot(az, bz));
    let axis = [
        dot(az, by) - dot(ay, bz),
        dot(ax, bz) - dot(az, bx),
        dot(ay, bx) - dot(ax, by),
    ];
    // Twice the sine by the axis over four times the cosine of half the angle; near half a turn
    // the cosine is kept from nothing, so the feature stays bounded.
    let factor = 0.5 * scale * inverse_sqrt((1.0 + trace).max(0.04));
    axis.map(|x| (x * factor).clamp(-1.0, 1.0))
}

/// A direction of the room in a part's rest space.
fn turned_back(&[a, b, c, _, d, e, f, _, g, h, i, _]: &Affine12, v: [f32; 3]) -> [f32; 3] {
    transform_vector(&[a, d, g, 0.0, b, e, h, 0.0, c, f, i, 0.0], v)
}

#[cfg(test)]
mod tests;
