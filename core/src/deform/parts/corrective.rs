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
mod tests {
    use super::*;
    use crate::math::affine;

    const TABLES: CorrectiveTables<'_> = CorrectiveTables {
        parents: &[NO_PARENT, 0],
        binds: &[1, 0],
        pivots: &[[0.0; 3], [0.0, 0.3, 0.0]],
        springs: &[[[20.0, 0.3], [40.0, 0.3]]; 2],
        starts: &[0, 2],
        features: &[PART_FEATURES as u16, 2 * PART_FEATURES as u16],
        coefficients: &[1.0, 0.2],
        ranges: &[[-0.5, 0.6]],
    };
    const STATE: usize = corrective_state_len(2);
    const FEATURES: usize = corrective_feature_count(2);
    /// First spring of the first part.
    const SPRING: usize = BEND_FEATURES + 3;

    fn bent(angle: f32, scale: f32) -> Affine12 {
        let half = 0.5 * angle;
        let turn = [libm::sinf(half), 0.0, 0.0, libm::cosf(half)];
        affine(turn, [0.0; 3], [scale; 3])
    }

    struct Driven {
        state: CorrectiveState<[f32; STATE]>,
        features: [f32; FEATURES],
    }

    impl Driven {
        fn new() -> Self {
            Self {
                state: CorrectiveState::with([7.0; STATE]),
                features: [0.0; FEATURES],
            }
        }

        /// Frames of the second bind and the first: the parts stand the other way round.
        fn step(&mut self, child: Affine12, root: Affine12, seconds: f32) -> f32 {
            let corrective = Corrective::new_checked(TABLES, 2).unwrap();
            let palette = [child, root];
            corrective
                .features(&palette, seconds, &mut self.state, &mut self.features)
                .unwrap();
            let mut weights = [9.0];
            corrective.weights(&self.features, &mut weights);
            weights[0]
        }
    }

    #[test]
    fn a_bend_is_the_sine_of_its_half_whatever_the_scale_and_moves_its_mode() {
        for scale in [1.0, 2.5] {
            let mut driven = Driven::new();
            let weight = driven.step(bent(0.6, scale), bent(0.0, scale), 0.01);
            let sine = libm::sinf(0.3);
            assert!((driven.features[PART_FEATURES] - sine).abs() < 1e-6);
            assert!((driven.features[PART_FEATURES + 3] - sine * sine).abs() < 1e-6);
            assert!((weight - (sine + 0.2)).abs() < 1e-6);
        }
        let far = Driven::new().step(bent(2.0, 1.0), IDENTITY, 0.01);
        assert_eq!(far, 0.6, "within its range");
    }

    #[test]
    fn steady_acceleration_stretches_springs_by_their_law_at_any_rate() {
        for rate in [24.0_f32, 60.0, 240.0] {
            let mut driven = Driven::new();
            for frame in 0..(6.0 * rate) as u32 {
                let time = frame as f32 / rate;
                let mut moving = IDENTITY;
                moving[3] = 0.5 * 0.8 * time * time;
                driven.step(moving, moving, 1.0 / rate);
            }
            // 0.8 m/s2 over 20^2 is 2 mm, backwards.
            let stretch = driven.features[SPRING];
            assert!((stretch + 0.002).abs() < 1e-4, "{rate}: {stretch}");
        }
    }

    #[test]
    fn it_begins_at_rest_and_a_moment_shown_again_is_the_same() {
        let mut driven = Driven::new();
        let over = bent(core::f32::consts::PI, 1.0);
        driven.step(over, over, 0.01);
        let hanging = driven.features[SPRING + 1];
        // Turned over it hangs by twice its weight: 2 x 9.81 / 20^2.
        assert!((hanging - 2.0 * 9.81 / 400.0).abs() < 1e-4, "{hanging}");
        let before = driven.features;
        for seconds in [0.0, f32::NAN, -1.0] {
            driven.step(over, over, seconds);
            assert_eq!(driven.features, before);
        }
        driven.step(IDENTITY, IDENTITY, 9.0);
        assert!(driven.features[SPRING + 1].abs() < 1e-6, "a cut");
    }

    #[test]
    fn a_teleport_does_not_kick() {
        let mut driven = Driven::new();
        let at = |x: f32| {
            let mut frame = IDENTITY;
            frame[3] = x;
            frame
        };
        for frame in 0..60 {
            let x = 0.01 * frame as f32 + if frame > 30 { 5.0 } else { 0.0 };
            driven.step(at(x), at(x), 0.01);
            assert!(driven.features[SPRING].abs() < 4e-3, "{frame}");
        }
    }

    #[test]
    fn hostile_motion_keeps_weights_bounded_and_is_forgotten() {
        let mut driven = Driven::new();
        for frame in 0..2000_u32 {
            let mut far = bent(frame as f32 * 2.5, 1.0);
            far[3] = if frame % 2 == 0 { 1e6 } else { -1e6 };
            let seconds = [0.01, f32::NAN, 0.0, 1e9][frame as usize % 4];
            if frame % 5 == 0 {
                far[7] = f32::NAN;
            }
            let weight = driven.step(bent(3.1, 1.0), far, seconds);
            assert!((-0.5..=0.6).contains(&weight), "{weight}");
            assert!(driven.features.iter().all(|x| x.abs() <= 1.1));
        }
        for _ in 0..400 {
            driven.step(IDENTITY, IDENTITY, 0.01);
        }
        let springs = &driven.features[SPRING..PART_FEATURES];
        assert!(springs.iter().all(|x| x.abs() < 1e-4), "{springs:?}");
    }

    #[test]
    fn tables_that_contradict_are_refused() {
        let refused = |tables| Corrective::new_checked(tables, 2).is_err();
        assert!(!refused(TABLES));
        assert!(Corrective::new_checked(TABLES, 1).is_err());
        assert!(refused(CorrectiveTables {
            parents: &[1, NO_PARENT],
            ..TABLES
        }));
        assert!(refused(CorrectiveTables {
            features: &[0, FEATURES as u16],
            ..TABLES
        }));
        assert!(refused(CorrectiveTables {
            ranges: &[[0.5, -0.5]],
            ..TABLES
        }));
        assert!(refused(CorrectiveTables {
            coefficients: &[1.0, f32::NAN],
            ..TABLES
        }));
        assert!(refused(CorrectiveTables {
            springs: &[[[0.0, 0.3]; 2]; 2],
            ..TABLES
        }));
    }
}
