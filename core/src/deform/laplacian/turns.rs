//! Rotations of markers over time: signs of quaternions, turns beyond half a revolution.
//!
//! A rotation has two quaternions, and blending them needs the right one. The first frame chooses
//! signs along the marker tree; after that each marker stays with the sign that is nearer to its
//! last one, so turns of the whole body may go on for ever. A frame in which most markers jump is
//! taken for a cut, and starts anew.
//!
//! Where two neighbouring markers turn against each other by more than [`LIMIT`], blends of their
//! quaternions come near zero. The paper then takes the pose before as the new reference; here the
//! *rotations* reached so far become the base, for markers and rows alike, and from then on only
//! what is added to the base is blended. The field itself does not change at that moment, so there
//! is no jump, in either direction, however often.

use core::borrow::BorrowMut;

use super::super::output::SizeError;
use crate::math::{Quat4, conjugate, dot4, normalise, quaternion_product};

/// Cosine of half the angle between neighbours at which the base moves: 200 degrees. Joints of a
/// body do not reach it, so ordinary motion never depends on its history.
const LIMIT: f32 = -0.173_648_18;

/// Cosine of half the turn of a marker between two frames beyond which nobody can say which way it
/// went: 90 degrees. Where most markers do that, signs are chosen anew, as after a cut.
const CUT: f32 = 0.707_106_77;

/// Positions beyond this are damage, metres.
const FAR: f32 = 1e6;

const NO_TURN: Quat4 = [0.0, 0.0, 0.0, 1.0];

/// Where a marker is and how it has turned since the rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MarkerPose {
    /// Metres.
    pub position: [f32; 3],
    /// Quaternion x y z w; any length that is not zero.
    pub rotation: Quat4,
}

/// What following the markers found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TurnReport {
    /// Markers whose input was missing or not a number; they keep their last good pose.
    pub held_markers: usize,
    /// Whether neighbouring markers turned so far that the base moved.
    pub rebased: bool,
}

/// What a Laplacian deformer remembers between frames, in the caller's memory:
/// [`turn_state_len`] numbers.
#[derive(Clone, Debug)]
pub struct TurnState<B> {
    numbers: B,
    stage: TurnStage,
}

/// What a [`TurnState`]'s numbers hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(crate) struct TurnStage {
    /// Poses of markers.
    started: bool,
    /// A base.
    based: bool,
}

impl TurnStage {
    pub const NEW: Self = Self {
        started: false,
        based: false,
    };
}

/// Numbers of a [`TurnState`] for `markers` markers and `rows` rows.
#[must_use]
pub const fn turn_state_len(markers: usize, rows: usize) -> usize {
    markers * 12 + rows * 4
}

impl<const N: usize> TurnState<[f32; N]> {
    /// A state with memory of its own, for a `static` too.
    #[must_use]
    pub const fn new() -> Self {
        Self::with([0.0; N])
    }
}

impl<const N: usize> Default for TurnState<[f32; N]> {
    fn default() -> Self {
        Self::new()
    }
}

impl<B> TurnState<B> {
    /// A state in the caller's memory; old contents do not matter.
    #[must_use]
    pub const fn with(numbers: B) -> Self {
        Self::resumed(numbers, TurnStage::NEW)
    }

    /// A state whose numbers and stage were kept apart.
    pub(crate) const fn resumed(numbers: B, stage: TurnStage) -> Self {
        Self { numbers, stage }
    }

    pub(crate) const fn stage(&self) -> TurnStage {
        self.stage
    }

    /// Forgets everything: the next frame starts anew, as after a cut.
    pub const fn reset(&mut self) {
        self.stage = TurnStage::NEW;
    }
}

/// The state of a frame, split up.
pub(super) struct Turns<'s> {
    /// Last good position and rotation of each marker.
    pub markers: &'s mut [[f32; 8]],
    base: &'s mut [Quat4],
    rows: &'s mut [Quat4],
    stage: &'s mut TurnStage,
}

impl<B: BorrowMut<[f32]>> TurnState<B> {
    pub(super) fn parts(&mut self, markers: usize, rows: usize) -> Result<Turns<'_>, SizeError> {
        let needed = turn_state_len(markers, rows);
        let numbers = self.numbers.borrow_mut();
        let found = numbers.len();
        let short = SizeError::TooSmall {
            buffer: "turn state",
            needed,
            found,
        };
        let numbers = numbers.get_mut(..needed).ok_or(short)?;
        let (held, rest) = numbers.split_at_mut_checked(8 * markers).ok_or(short)?;
        let (base, rows) = rest.split_at_mut_checked(4 * markers).ok_or(short)?;
        Ok(Turns {
            markers: held.as_chunks_mut().0,
            base: base.as_chunks_mut().0,
            rows: rows.as_chunks_mut().0,
            stage: &mut self.stage,
        })
    }
}

impl Turns<'_> {
    /// Takes a frame's poses. `rest`: position of a marker before the first frame. `edges`: (one,
    /// other) pairs of neighbouring markers, a tree from the first one's root on.
    pub fn follow(
        &mut self,
        poses: impl Fn(usize) -> Option<MarkerPose>,
        rest: impl Fn(usize) -> [f32; 3],
        edges: &[[u16; 2]],
    ) -> TurnReport {
        let mut report = TurnReport::default();
        let first = !self.stage.started;
        if first {
            self.stage.started = true;
            self.stage.based = false;
            for (marker, held) in self.markers.iter_mut().enumerate() {
                let [x, y, z] = rest(marker);
                *held = [x, y, z, 0.0, 0.0, 0.0, 0.0, 1.0];
            }
        }
        let mut jumps = 0;
        for (marker, held) in self.markers.iter_mut().enumerate() {
            let Some((position, rotation)) = poses(marker).as_ref().and_then(usable) else {
                report.held_markers += 1;
                continue;
            };
            let last = rotation_of(held);
            let along = dot4(rotation, last);
            jumps += usize::from(-CUT < along && along < CUT);
            let rotation = if !first && along < 0.0 {
                rotation.map(|x| -x)
            } else {
                rotation
            };
            let ([x, y, z], [a, b, c, d]) = (position, rotation);
            *held = [x, y, z, 0.0, a, b, c, d];
        }
        let cut = 2 * jumps > self.markers.len();
        if first || cut {
            self.stage.based = false;
            for &[one, other] in edges {
                let Some(one) = self.markers.get(usize::from(one)).map(rotation_of) else {
                    continue;
                };
                if let Some(other) = self.markers.get_mut(usize::from(other))
                    && dot4(one, rotation_of(other)) < 0.0
                {
                    let [x, y, z, w, a, b, c, d] = *other;
                    *other = [x, y, z, w, -a, -b, -c, -d];
                }
            }
        }
        report
    }

    /// How a marker has turned since the base.
    pub fn since_base(&self, marker: usize) -> Quat4 {
        let rotation = self.markers.get(marker).map_or(NO_TURN, rotation_of);
        match self.base.get(marker) {
            Some(&base) if self.stage.based => quaternion_product(rotation, conjugate(base)),
            _ => rotation,
        }
    }

    /// Rotation of a row from the blend of what its markers turned since the base.
    pub fn row(&self, row: usize, blend: Quat4) -> Quat4 {
        let base = self.rows.get(row).copied().filter(|_| self.stage.based);
        match (normalise(blend), base) {
            (Some(turn), Some(base)) => quaternion_product(turn, base),
            (Some(turn), None) => turn,
            (None, base) => base.unwrap_or(NO_TURN),
        }
    }

    /// Whether neighbours have turned so far against each other that the base must move.
    pub fn is_far(&self, edges: &[[u16; 2]]) -> bool {
        edges.iter().any(|&[one, other]| {
            let turn = |marker| self.since_base(usize::from(marker));
            dot4(turn(one), turn(other)) < LIMIT
        })
    }

    /// Moves the base to this frame. `rotation`: of each row, as [`Self::row`] gives it.
    pub fn rebase(&mut self, rotation: impl Fn(&Self, usize) -> Quat4) {
        for row in 0..self.rows.len() {
            let turned = normalise(rotation(self, row)).unwrap_or(NO_TURN);
            if let Some(base) = self.rows.get_mut(row) {
                // Rows are read with their own base only, so one after the other is safe.
                *base = turned;
            }
        }
        for (base, held) in self.base.iter_mut().zip(&*self.markers) {
            *base = rotation_of(held);
        }
        self.stage.based = true;
    }
}

/// Position of a held marker.
pub(super) const fn position_of(&[x, y, z, ..]: &[f32; 8]) -> [f32; 3] {
    [x, y, z]
}

const fn rotation_of(&[_, _, _, _, a, b, c, d]: &[f32; 8]) -> Quat4 {
    [a, b, c, d]
}

/// Matrix rows of a unit quaternion with a translation.
pub(super) fn frame(rotation: Quat4, position: [f32; 3]) -> crate::math::Affine12 {
    crate::math::affine(rotation, position, [1.0; 3])
}

/// The frame of a held marker.
pub(super) fn marker_frame(held: &[f32; 8]) -> crate::math::Affine12 {
    frame(rotation_of(held), position_of(held))
}

fn usable(pose: &MarkerPose) -> Option<([f32; 3], Quat4)> {
    let near = pose.position.iter().all(|x| (-FAR..=FAR).contains(x));
    Some((pose.position, normalise(pose.rotation)?)).filter(|_| near)
}
