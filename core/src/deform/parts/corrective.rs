//! What flesh does when no marker is seen: residuals predicted from a skeleton in motion.
//!
//! Each part gives a fixed number of features: how it is bent against its parent, how gravity lies
//! in it, and two damped springs that its acceleration shakes. A residual is a fixed linear sum of
//! features, learnt from a dense capture (the future work of Park & Hodgins 2006, section 7). The
//! springs are integrated implicitly, so they are stable for any input and any frame rate.

use core::borrow::BorrowMut;

use super::error::{below, length, numbers, starts};
use super::slots::row;
use super::{PartsError, PartsTable};
use crate::asset::NO_PARENT;
use crate::deform::SizeError;
use crate::math::{Affine12, IDENTITY, inverse_sqrt, transform_point, transform_vector};

/// Features of a part: three of its bend, its square, gravity, two springs.
pub const PART_FEATURES: usize = 13;
const SPRINGS: usize = 2;
/// Steps of a spring in a frame.
const STEPS: usize = 4;
/// Accelerations beyond this are jumps, metres a second squared.
const LARGEST_ACCELERATION: f32 = 80.0;
/// Springs do not stretch further, metres.
const LONGEST_SPRING: f32 = 0.1;
const GRAVITY: f32 = 9.81;
/// Springs of a part that does not exist.
const STIFF: [[f32; 2]; SPRINGS] = [[60.0, 0.5]; SPRINGS];
/// Numbers remembered of a part: two places, and place and speed of each spring.
const PART_STATE: usize = 6 + 6 * SPRINGS;

/// Tables that predict residuals.
#[derive(Clone, Copy, Debug, Default)]
pub struct CorrectiveTables<'a> {
    /// `[parts]`: parent, before the part itself, or [`NO_PARENT`].
    pub parents: &'a [u16],
    /// `[parts]`: the place in the rest pose whose acceleration shakes the springs, metres.
    pub pivots: &'a [[f32; 3]],
    /// `[parts]`: angular frequency (radians a second) and damping ratio of the two springs.
    pub springs: &'a [[[f32; 2]; SPRINGS]],
    /// `[handles + 1]`: first term of each handle.
    pub starts: &'a [u32],
    /// `[terms]`: feature, `PART_FEATURES` for each part and then a constant one.
    pub features: &'a [u16],
    /// `[terms]`: what the feature adds to the residual, metres.
    pub coefficients: &'a [[f32; 3]],
    /// Longest residual, metres.
    pub limit: f32,
}

/// A checked predictor of residuals.
#[derive(Clone, Copy, Debug)]
pub struct Corrective<'a> {
    tables: CorrectiveTables<'a>,
}

/// What a predictor remembers, in the caller's memory: [`Corrective::state_len`] numbers.
#[derive(Clone, Debug)]
pub struct CorrectiveState<B> {
    numbers: B,
    frames: u32,
}

impl<B> CorrectiveState<B> {
    /// A state in the caller's memory; old contents do not matter.
    #[must_use]
    pub const fn with(numbers: B) -> Self {
        Self { numbers, frames: 0 }
    }

    /// Forgets everything: the next frame starts anew, as after a cut.
    pub const fn reset(&mut self) {
        self.frames = 0;
    }
}

impl<'a> Corrective<'a> {
    /// Checks every table once; a step cannot fail after that. O(tables)
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn new_checked(tables: CorrectiveTables<'a>) -> Result<Self, PartsError> {
        let parts = tables.parents.len();
        length(PartsTable::Parents, tables.pivots.len(), parts)?;
        for (at, &parent) in tables.parents.iter().enumerate() {
            if parent != NO_PARENT && usize::from(parent) >= at {
                let table = PartsTable::Parents;
                return Err(PartsError::Index { table, at });
            }
        }
        let table = PartsTable::Modes;
        numbers(table, tables.pivots.as_flattened(), 1e6)?;
        length(table, tables.springs.len(), parts)?;
        let springs = tables.springs.as_flattened().as_flattened();
        numbers(table, springs, 1e3)?;
        if let Some(at) = springs.iter().position(|&x| x <= 0.0) {
            return Err(PartsError::Number { table, at });
        }
        let terms = tables.features.len();
        length(table, tables.coefficients.len(), terms)?;
        starts(tables.starts, tables.starts.len().saturating_sub(1), terms)?;
        let features = tables.features.iter().map(|&feature| usize::from(feature));
        below(table, features, parts * PART_FEATURES + 1)?;
        numbers(table, tables.coefficients.as_flattened(), 1e6)?;
        numbers(table, &[tables.limit], 10.0)?;
        Ok(Self { tables })
    }

    /// The tables.
    #[must_use]
    pub fn tables(&self) -> &CorrectiveTables<'a> {
        &self.tables
    }

    /// Number of residuals.
    #[must_use]
    pub fn handle_count(&self) -> usize {
        self.tables.starts.len().saturating_sub(1)
    }

    /// Number of features.
    #[must_use]
    pub fn feature_count(&self) -> usize {
        self.tables.parents.len() * PART_FEATURES + 1
    }

    /// Numbers of a [`CorrectiveState`].
    #[must_use]
    pub fn state_len(&self) -> usize {
        self.tables.parents.len() * PART_STATE
    }

    /// Multiplications of a frame; an upper bound for any input.
    #[must_use]
    pub fn multiply_adds(&self) -> usize {
        (120 + 40 * STEPS * SPRINGS) * self.tables.parents.len() + 3 * self.tables.features.len()
    }

    /// Features of a frame: what the coefficients were learnt against.
    ///
    /// `frames`: `[parts]`, rigid, from the rest pose; `seconds`: since the frame before.
    /// `features`: [`Self::feature_count`] numbers, old contents do not matter. O(parts)
    ///
    /// # Errors
    /// [`SizeError`] where the state or `features` is too small.
    pub fn features<B: BorrowMut<[f32]>>(
        &self,
        frames: &[Affine12],
        seconds: f32,
        state: &mut CorrectiveState<B>,
        features: &mut [f32],
    ) -> Result<(), SizeError> {
        let (needed, found) = (self.feature_count(), features.len());
        let features = features.get_mut(..needed).ok_or(SizeError::TooSmall {
            buffer: "features",
            needed,
            found,
        })?;
        let (needed, found) = (self.state_len(), state.numbers.borrow().len());
        let kept = state.numbers.borrow_mut();
        let kept = kept.get_mut(..needed).ok_or(SizeError::TooSmall {
            buffer: "corrective state",
            needed,
            found,
        })?;
        if state.frames == 0 {
            kept.fill(0.0);
        }
        // NaN and nonsense count as a sixtieth.
        let seconds = if (1e-4..=0.1).contains(&seconds) {
            seconds
        } else {
            1.0 / 60.0
        };
        let rows = features.as_chunks_mut::<PART_FEATURES>().0.iter_mut();
        let kept = kept.as_chunks_mut::<PART_STATE>().0.iter_mut();
        for (part, (out, kept)) in rows.zip(kept).enumerate() {
            let frame = frames.get(part).filter(|frame| usable(frame));
            let frame = frame.unwrap_or(&IDENTITY);
            let parent = self.tables.parents.get(part).copied().unwrap_or(NO_PARENT);
            let above = frames
                .get(usize::from(parent))
                .filter(|frame| usable(frame));
            let above = above.unwrap_or(&IDENTITY);
            let [x, y, z] = if parent == NO_PARENT {
                [0.0; 3]
            } else {
                bend(above, frame)
            };
            let down = turned_back(frame, [0.0, -1.0, 0.0]);
            let pivot = self.tables.pivots.get(part).copied().unwrap_or_default();
            let now = transform_point(frame, pivot);
            let springs = self.tables.springs.get(part).unwrap_or(&STIFF);
            shake(springs, frame, now, seconds, state.frames, kept);
            let springs = kept.as_chunks::<6>().0;
            let [a, b] = [springs.get(1), springs.get(2)].map(|spring| spring.copied());
            let ([ax, ay, az, ..], [bx, by, bz, ..]) =
                (a.unwrap_or_default(), b.unwrap_or_default());
            *out = [
                x,
                y,
                z,
                x * x + y * y + z * z,
                down[0],
                down[1],
                down[2],
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
        state.frames = state.frames.saturating_add(1);
        Ok(())
    }

    /// Residuals `[handles]` of a frame from its features; old contents do not matter. O(terms)
    pub fn residuals(&self, features: &[f32], residuals: &mut [[f32; 3]]) {
        let limit = self.tables.limit;
        for (handle, residual) in residuals.iter_mut().enumerate() {
            let range = row(self.tables.starts, handle);
            let terms = self.tables.features.get(range.clone()).unwrap_or_default();
            let coefficients = self.tables.coefficients.get(range).unwrap_or_default();
            let mut sum = [0.0_f32; 3];
            for (&feature, coefficients) in terms.iter().zip(coefficients) {
                let value = features.get(usize::from(feature)).copied().unwrap_or(0.0);
                for (sum, coefficient) in sum.iter_mut().zip(coefficients) {
                    *sum += value * coefficient;
                }
            }
            let length2 = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
            *residual = if length2 <= limit * limit {
                sum
            } else if length2 < f32::INFINITY {
                let factor = limit * inverse_sqrt(length2);
                sum.map(|x| x * factor)
            } else {
                [0.0; 3]
            };
        }
    }
}

/// Moves the springs of a part, which live in its rest space.
fn shake(
    springs: &[[f32; 2]; SPRINGS],
    frame: &Affine12,
    now: [f32; 3],
    seconds: f32,
    frames: u32,
    kept: &mut [f32; PART_STATE],
) {
    let (places, stretched) = kept.split_at_mut(6);
    let mut acceleration = [0.0; 3];
    if let Some((last, before)) = places.split_first_chunk_mut::<3>() {
        let inverse = 1.0 / (seconds * seconds);
        for (axis, (last, before)) in last.iter_mut().zip(before).enumerate() {
            let now = now.get(axis).copied().unwrap_or(0.0);
            let second = (now - *last - (*last - *before)) * inverse;
            if frames >= 2
                && let Some(to) = acceleration.get_mut(axis)
            {
                *to = second.clamp(-LARGEST_ACCELERATION, LARGEST_ACCELERATION);
            }
            *before = *last;
            *last = now;
        }
    }
    // In the part, flesh feels the opposite of what the bone does, and its weight.
    let [x, y, z] = acceleration;
    let pull = turned_back(frame, [-x, -y - GRAVITY, -z]);
    let pull = [pull[0], pull[1] + GRAVITY, pull[2]];
    let step = seconds / STEPS as f32;
    let all = stretched.as_chunks_mut::<6>().0.iter_mut().zip(springs);
    for (spring, &[frequency, damping]) in all {
        let stiffness = frequency * frequency;
        let friction = 2.0 * damping * frequency;
        let share = 1.0 / (1.0 + step * friction + step * step * stiffness);
        let (place, speed) = spring.split_at_mut(3);
        for ((place, speed), pull) in place.iter_mut().zip(speed).zip(pull) {
            for _ in 0..STEPS {
                *speed = (*speed + step * (pull - stiffness * *place)) * share;
                *place += step * *speed;
            }
            *place = place.clamp(-LONGEST_SPRING, LONGEST_SPRING);
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
        let rows = m.as_chunks::<4>().0;
        let mut out = [0.0; 3];
        for (out, row) in out.iter_mut().zip(rows) {
            *out = row.get(at).copied().unwrap_or(0.0);
        }
        out
    };
    let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (ax, ay, az) = (column(above, 0), column(above, 1), column(above, 2));
    let (bx, by, bz) = (column(frame, 0), column(frame, 1), column(frame, 2));
    let trace = dot(ax, bx) + dot(ay, by) + dot(az, bz);
    let axis = [
        dot(az, by) - dot(ay, bz),
        dot(ax, bz) - dot(az, bx),
        dot(ay, bx) - dot(ax, by),
    ];
    // Twice the sine by the axis over four times the cosine of half the angle; near half a turn
    // the cosine is kept from nothing, so the feature stays bounded.
    let four_cosine2 = (1.0 + trace).max(0.04);
    axis.map(|x| 0.5 * x * inverse_sqrt(four_cosine2))
}

/// A direction of the room in a part's rest space.
fn turned_back(&[a, b, c, _, d, e, f, _, g, h, i, _]: &Affine12, v: [f32; 3]) -> [f32; 3] {
    transform_vector(&[a, d, g, 0.0, b, e, h, 0.0, c, f, i, 0.0], v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::affine;

    const TABLES: CorrectiveTables<'_> = CorrectiveTables {
        parents: &[NO_PARENT, 0],
        pivots: &[[0.0; 3], [0.0, 0.3, 0.0]],
        springs: &[[[20.0, 0.3], [40.0, 0.3]]; 2],
        starts: &[0, 2],
        features: &[13, 26],
        coefficients: &[[0.01, 0.0, 0.0], [0.0, 0.002, 0.0]],
        limit: 0.05,
    };

    fn bent(angle: f32) -> Affine12 {
        let half = 0.5 * angle;
        affine(
            [libm::sinf(half), 0.0, 0.0, libm::cosf(half)],
            [0.0; 3],
            [1.0; 3],
        )
    }

    #[test]
    fn a_bend_is_the_sine_of_its_half_and_moves_its_handle() {
        let corrective = Corrective::new_checked(TABLES).unwrap();
        let mut state = CorrectiveState::with([0.0; 2 * PART_STATE]);
        let mut features = [0.0; 2 * PART_FEATURES + 1];
        let frames = [IDENTITY, bent(1.0)];
        corrective
            .features(&frames, 0.01, &mut state, &mut features)
            .unwrap();
        assert!(
            (features[13] - libm::sinf(0.5)).abs() < 1e-6,
            "{features:?}"
        );
        let mut residuals = [[9.0; 3]];
        corrective.residuals(&features, &mut residuals);
        assert!((residuals[0][0] - 0.01 * libm::sinf(0.5)).abs() < 1e-7);
        assert!((residuals[0][1] - 0.002).abs() < 1e-8);
    }

    #[test]
    fn steady_acceleration_stretches_springs_by_their_law() {
        let corrective = Corrective::new_checked(TABLES).unwrap();
        let mut state = CorrectiveState::with([0.0; 2 * PART_STATE]);
        let mut features = [0.0; 2 * PART_FEATURES + 1];
        for frame in 0..600 {
            let time = frame as f32 / 100.0;
            let mut moving = IDENTITY;
            moving[3] = 0.5 * 0.8 * time * time;
            corrective
                .features(&[moving, moving], 0.01, &mut state, &mut features)
                .unwrap();
        }
        // 0.8 m/s2 over 20^2 is 2 mm, backwards.
        assert!((features[7] + 0.002).abs() < 1e-4, "{features:?}");
    }

    #[test]
    fn hostile_motion_keeps_residuals_bounded_and_is_forgotten() {
        let corrective = Corrective::new_checked(TABLES).unwrap();
        let mut state = CorrectiveState::with([0.0; 2 * PART_STATE]);
        let mut features = [0.0; 2 * PART_FEATURES + 1];
        let mut residuals = [[0.0; 3]];
        for frame in 0..2000_u32 {
            let mut far = bent(frame as f32 * 2.5);
            far[3] = if frame % 2 == 0 { 1e6 } else { -1e6 };
            let seconds = [0.01, f32::NAN, 0.0, 1e9][frame as usize % 4];
            if frame % 5 == 0 {
                far[7] = f32::NAN;
            }
            corrective
                .features(&[far, bent(3.1)], seconds, &mut state, &mut features)
                .unwrap();
            corrective.residuals(&features, &mut residuals);
            let length2: f32 = residuals[0].iter().map(|x| x * x).sum();
            assert!(length2 <= 0.0026, "{residuals:?}");
        }
        for _ in 0..400 {
            corrective
                .features(&[IDENTITY, IDENTITY], 0.01, &mut state, &mut features)
                .unwrap();
        }
        assert!(
            features[7..13].iter().all(|x| x.abs() < 1e-4),
            "{features:?}"
        );
    }
}
