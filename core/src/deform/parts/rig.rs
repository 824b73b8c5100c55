//! From markers to part frames: what every mode does first.
//!
//! Each part's frame is fitted to its markers in closed form. A marker's *residual* is where it is,
//! carried back to the rest pose by the frames around it, less where it was there. A marker that
//! is missing keeps its last residual and so moves with its parts; a part with too few markers in
//! sight moves with its parent.

use core::borrow::BorrowMut;

use super::PartsError;
use super::motion::{
    carried_back, from_dual, less, pack, rigid, shortened, to_dual, unpack, usable,
};
use super::rig_check::{MarkerRigTables, check};
use super::slots::row;
use crate::asset::NO_PARENT;
use crate::deform::SizeError;
use crate::math::{
    Affine12, IDENTITY, Quat4, affine, conjugate, dot4, normalise, quaternion_product,
    transform_point,
};
use crate::pose::Dual17;
use crate::solve::dense::{Pair, Rigid, absolute_orientation};

/// Points this far from a pivot, metres, turn as the parent does, and count for this part of it:
/// enough to decide what one marker leaves open, too little to hold back what several say.
const TURN_REACH: f32 = 0.1;
const TURN_WEIGHT: f32 = 0.01;

/// Fits after the first where markers are out of place.
pub(crate) const REFITS: usize = 2;

/// Pairs that hold a part besides its markers.
pub(crate) const HELD: usize = 4;

/// Checked tables from markers to part frames.
#[derive(Clone, Copy, Debug)]
pub struct MarkerRig<'a> {
    tables: MarkerRigTables<'a>,
    linear: bool,
}

/// What following the markers found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FollowReport {
    /// Markers that were missing or not a number; they move with their parts.
    pub held_markers: usize,
    /// Markers that were further from their parts than any of the motion that was learnt.
    pub limited_markers: usize,
    /// Parts with too few markers in sight; they move with their parents.
    pub held_parts: usize,
}

/// What a marker-driven skin remembers between frames, in the caller's memory:
/// [`rig_state_len`] numbers.
#[derive(Clone, Debug)]
pub struct RigState<B> {
    numbers: B,
    started: bool,
}

/// Numbers of a [`RigState`].
#[must_use]
pub const fn rig_state_len(markers: usize, parts: usize) -> usize {
    3 * markers + 7 * parts
}

/// Numbers of the workspace of [`MarkerRig::follow`].
#[must_use]
pub const fn rig_workspace_len(markers: usize, parts: usize) -> usize {
    6 * markers + (12 + 17) * parts
}

impl<const N: usize> RigState<[f32; N]> {
    /// A state with memory of its own, for a `static` too.
    #[must_use]
    pub const fn new() -> Self {
        Self::with([0.0; N])
    }
}

impl<const N: usize> Default for RigState<[f32; N]> {
    fn default() -> Self {
        Self::new()
    }
}

impl<B> RigState<B> {
    /// A state in the caller's memory; old contents do not matter.
    #[must_use]
    pub const fn with(numbers: B) -> Self {
        Self {
            numbers,
            started: false,
        }
    }

    /// Forgets everything: the next frame starts anew, as after a cut.
    pub const fn reset(&mut self) {
        self.started = false;
    }
}

/// Markers and part frames of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Followed<'w> {
    /// `[markers]`: metres, complete.
    pub positions: &'w [[f32; 3]],
    /// `[markers]`: residuals in the rest pose, metres.
    pub residuals: &'w [[f32; 3]],
    /// `[parts]`: from the rest pose to this frame.
    pub palette: &'w [Affine12],
    /// `[parts]`: the same as dual quaternions; empty where frames are blended linearly.
    pub duals: &'w [Dual17],
    /// What was missing.
    pub report: FollowReport,
}

impl<'a> MarkerRig<'a> {
    /// Checks every table once; a step cannot fail after that. O(tables)
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn new_checked(tables: MarkerRigTables<'a>) -> Result<Self, PartsError> {
        check(&tables)?;
        Ok(Self {
            tables,
            linear: false,
        })
    }

    /// Carries markers by linear blends of part frames instead of dual quaternions.
    #[must_use]
    pub const fn with_linear_blend(mut self, linear: bool) -> Self {
        self.linear = linear;
        self
    }

    /// The tables.
    #[must_use]
    pub fn tables(&self) -> &MarkerRigTables<'a> {
        &self.tables
    }

    /// Number of markers.
    #[must_use]
    pub fn marker_count(&self) -> usize {
        self.tables.rest.len()
    }

    /// Number of parts.
    #[must_use]
    pub fn part_count(&self) -> usize {
        self.tables.parents.len()
    }

    /// Fits all part frames and completes the markers. First half of a frame in every mode.
    ///
    /// `positions`: `[markers]` in metres; those that are missing, NaN or infinite are held.
    /// `state`: [`rig_state_len`]; `workspace`: [`rig_workspace_len`] numbers, old contents do not
    /// matter. O(members + markers)
    ///
    /// # Errors
    /// [`SizeError`] where state or workspace is too small.
    pub fn follow<'w, B: BorrowMut<[f32]>>(
        &self,
        positions: &[[f32; 3]],
        state: &mut RigState<B>,
        workspace: &'w mut [f32],
    ) -> Result<Followed<'w>, SizeError> {
        let (markers, parts) = (self.marker_count(), self.part_count());
        let Handles {
            positions: complete,
            residuals,
            palette,
            duals,
        } = handles(workspace, markers, parts)?;
        let found = state.numbers.borrow().len();
        let short = SizeError::TooSmall {
            buffer: "rig state",
            needed: rig_state_len(markers, parts),
            found,
        };
        let numbers = state.numbers.borrow_mut();
        let (held, frames) = numbers.split_at_mut_checked(3 * markers).ok_or(short)?;
        let frames = frames.get_mut(..7 * parts).ok_or(short)?;
        let (held, frames) = (held.as_chunks_mut::<3>().0, frames.as_chunks_mut::<7>().0);
        if !state.started {
            state.started = true;
            held.fill([0.0; 3]);
            frames.fill([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        }
        let mut report = FollowReport::default();
        for part in 0..parts {
            let before = frames.get(part).map_or(Rigid::REST, unpack);
            let above = self.above(part, duals);
            let now = self
                .fit(part, positions, above, residuals)
                .unwrap_or_else(|| {
                    report.held_parts +=
                        usize::from(!row(self.tables.member_starts, part).is_empty());
                    self.with_parent(part, &before, frames, duals)
                });
            if let Some(dual) = duals.get_mut(part) {
                *dual = to_dual(&now);
            }
            if let Some(matrix) = palette.get_mut(part) {
                *matrix = affine(now.rotation, now.translation, [1.0; 3]);
            }
        }
        for (frame, dual) in frames.iter_mut().zip(&*duals) {
            *frame = pack(&from_dual(dual));
        }
        let out = complete.iter_mut().zip(residuals.iter_mut()).zip(held);
        for (marker, ((complete, residual), held)) in out.enumerate() {
            let frame = self.carried(marker, palette, duals);
            let rest = self.tables.rest.get(marker).copied().unwrap_or_default();
            let seen = positions.get(marker).filter(|position| usable(position));
            let (limited, keep) = match seen {
                None => {
                    report.held_markers += 1;
                    (*held, false)
                }
                Some(position) => {
                    let found = less(carried_back(&frame, *position), rest);
                    let short = shortened(found, self.tables.residual_limit);
                    report.limited_markers += usize::from(short.is_some());
                    (short.unwrap_or(found), short.is_none())
                }
            };
            *held = limited;
            *residual = limited;
            *complete = match seen {
                Some(position) if keep => *position,
                _ => {
                    let [x, y, z] = rest;
                    let [a, b, c] = limited;
                    transform_point(&frame, [x + a, y + b, z + c])
                }
            };
        }
        Ok(Followed {
            positions: complete,
            residuals,
            palette,
            duals: if self.linear { &[] } else { duals },
            report,
        })
    }

    /// This frame's matrix of a part's parent.
    fn above(&self, part: usize, duals: &[Dual17]) -> Option<Affine12> {
        let parent = self.tables.parents.get(part).copied()?;
        let frame = from_dual(duals.get(usize::from(parent))?);
        Some(affine(frame.rotation, frame.translation, [1.0; 3]))
    }

    /// The frame of a part from its markers in sight, held by its pivot, and as its parent turns
    /// where both leave a turn open.
    ///
    /// `scratch`: `[markers]`, old contents do not matter.
    fn fit(
        &self,
        part: usize,
        positions: &[[f32; 3]],
        above: Option<Affine12>,
        scratch: &mut [[f32; 3]],
    ) -> Option<Rigid> {
        let range = row(self.tables.member_starts, part);
        let markers = self.tables.member_markers.get(range.clone())?;
        let weights = self.tables.member_weights.get(range)?;
        let seen = markers
            .iter()
            .zip(weights)
            .filter_map(|(&marker, &weight)| {
                let marker = usize::from(marker);
                let &from = self.tables.rest.get(marker)?;
                let &to = positions.get(marker).filter(|at| usable(at))?;
                Some((marker, Pair { from, to, weight }))
            });
        // Without any marker the last frame is the better guess.
        seen.clone().next()?;
        let held = above.map(|above| self.held(part, &above));
        let held = held.as_ref().map_or(&[][..], |held| held);
        let pairs = seen
            .clone()
            .map(|(_, pair)| pair)
            .chain(held.iter().copied());
        let mut frame = absolute_orientation(pairs.clone())?;
        // A marker far from where its part takes it is one that was taken for another: those count
        // the less the further they are (Cauchy's weights), in two more fits at most.
        let limit2 = self.tables.residual_limit * self.tables.residual_limit;
        for _ in 0..REFITS {
            let matrix = affine(frame.rotation, frame.translation, [1.0; 3]);
            let mut is_near = true;
            let mut weigh = |pair: Pair| {
                let [x, y, z] = less(transform_point(&matrix, pair.from), pair.to);
                let off2 = x * x + y * y + z * z;
                is_near &= off2 <= limit2;
                pair.weight * limit2 / (limit2 + off2 + 1e-12)
            };
            for (marker, pair) in seen.clone() {
                if let Some([weight, ..]) = scratch.get_mut(marker) {
                    *weight = weigh(pair);
                }
            }
            let mut weighed_held = [0.0; HELD];
            for (weight, pair) in weighed_held.iter_mut().zip(held) {
                *weight = weigh(*pair);
            }
            if is_near {
                break;
            }
            let seen = seen.clone().map(|(marker, pair)| Pair {
                weight: scratch.get(marker).map_or(0.0, |[weight, ..]| *weight),
                ..pair
            });
            let held = held.iter().zip(weighed_held);
            let held = held.map(|(&pair, weight)| Pair { weight, ..pair });
            frame = absolute_orientation(seen.chain(held))?;
        }
        Some(frame)
    }

    /// What holds a part besides its markers: its pivot, and three points around it that go as the
    /// parent does.
    fn held(&self, part: usize, above: &Affine12) -> [Pair; HELD] {
        let &[x, y, z, weight] = self.tables.pivots.get(part).unwrap_or(&[0.0; 4]);
        let (far, open) = (TURN_REACH, TURN_WEIGHT * weight);
        let points = [
            ([x, y, z], weight),
            ([x + far, y, z], open),
            ([x, y + far, z], open),
            ([x, y, z + far], open),
        ];
        points.map(|(from, weight)| Pair {
            from,
            to: transform_point(above, from),
            weight,
        })
    }

    /// A part's last frame, moved as its parent has moved since.
    fn with_parent(
        &self,
        part: usize,
        before: &Rigid,
        frames: &[[f32; 7]],
        duals: &[Dual17],
    ) -> Rigid {
        let parent = self.tables.parents.get(part).copied().unwrap_or(NO_PARENT);
        let parent = usize::from(parent);
        let (Some(old), Some(new)) = (frames.get(parent).map(unpack), duals.get(parent)) else {
            return *before;
        };
        let new = from_dual(new);
        let turn = quaternion_product(new.rotation, conjugate(old.rotation));
        let Some(turn) = normalise(turn) else {
            return *before;
        };
        let matrix = affine(turn, new.translation, [1.0; 3]);
        Rigid {
            rotation: normalise(quaternion_product(turn, before.rotation)).unwrap_or(turn),
            translation: transform_point(&matrix, less(before.translation, old.translation)),
        }
    }

    /// The blended motion at a marker.
    fn carried(&self, marker: usize, palette: &[Affine12], duals: &[Dual17]) -> Affine12 {
        let range = row(self.tables.carrier_starts, marker);
        let parts = self.tables.carrier_parts.get(range.clone());
        let weights = self.tables.carrier_weights.get(range);
        // What one part carries alone moves as it does.
        if let Some(&[part]) = parts {
            let frame = palette.get(usize::from(part));
            return frame.copied().unwrap_or(IDENTITY);
        }
        let parts = parts.unwrap_or_default().iter().map(|&p| usize::from(p));
        let carriers = parts.zip(weights.unwrap_or_default());
        if self.linear {
            let mut sum = [0.0_f32; 12];
            for (part, weight) in carriers {
                let matrix = palette.get(part).unwrap_or(&IDENTITY);
                for (sum, value) in sum.iter_mut().zip(matrix) {
                    *sum += weight * value;
                }
            }
            return sum;
        }
        let carriers = carriers.filter_map(|(part, weight)| Some((duals.get(part)?, *weight)));
        let Rigid {
            rotation,
            translation,
        } = blended(carriers);
        affine(rotation, translation, [1.0; 3])
    }
}

/// A blend of dual quaternions (Kavan et al. 2008, section 3).
fn blended<'d>(carriers: impl Iterator<Item = (&'d Dual17, f32)>) -> Rigid {
    let mut sum = [0.0_f32; 8];
    for (dual, weight) in carriers {
        let near: f32 = sum
            .iter()
            .zip(dual)
            .take(4)
            .map(|(sum, value)| sum * value)
            .sum();
        let signed = if near < 0.0 { -weight } else { weight };
        for (sum, value) in sum.iter_mut().zip(dual) {
            *sum += signed * value;
        }
    }
    let [x, y, z, w, a, b, c, d] = sum;
    let length2 = dot4([x, y, z, w], [x, y, z, w]);
    if !(1e-12..=1e12).contains(&length2) {
        return Rigid::REST;
    }
    let factor = crate::math::inverse_sqrt(length2);
    let unit = |q: Quat4| q.map(|value| value * factor);
    rigid(unit([x, y, z, w]), unit([a, b, c, d]))
}

struct Handles<'w> {
    positions: &'w mut [[f32; 3]],
    residuals: &'w mut [[f32; 3]],
    palette: &'w mut [Affine12],
    duals: &'w mut [Dual17],
}

fn handles(workspace: &mut [f32], markers: usize, parts: usize) -> Result<Handles<'_>, SizeError> {
    let short = SizeError::TooSmall {
        buffer: "rig workspace",
        needed: rig_workspace_len(markers, parts),
        found: workspace.len(),
    };
    let (positions, rest) = workspace.split_at_mut_checked(3 * markers).ok_or(short)?;
    let (residuals, rest) = rest.split_at_mut_checked(3 * markers).ok_or(short)?;
    let (palette, rest) = rest.split_at_mut_checked(12 * parts).ok_or(short)?;
    let duals = rest.get_mut(..17 * parts).ok_or(short)?;
    Ok(Handles {
        positions: positions.as_chunks_mut().0,
        residuals: residuals.as_chunks_mut().0,
        palette: palette.as_chunks_mut().0,
        duals: duals.as_chunks_mut().0,
    })
}
