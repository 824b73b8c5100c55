//! The whole of a frame.

use core::borrow::BorrowMut;

use super::buffers::{Kept, Progress, duals_of};
use super::rota::Due;
use super::{Budget, Flags, FrameReport, State, Workspace};
use crate::asset::Asset;
#[cfg(feature = "correctives")]
use crate::deform::parts::CorrectiveState;
use crate::deform::{Level, NormalMode, Output, SizeError, SkinJob, SkinMode};
use crate::pose::{self, Joint12, Local, Transform};

/// Seconds between frames where nobody says.
const FRAME: f32 = 1.0 / 60.0;

/// What moves an avatar in a frame.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum Input<'i> {
    /// The asset's rest pose.
    Rest,
    /// The pose of the frame before.
    Hold,
    /// A clip of the asset.
    Clip {
        /// Which.
        index: usize,
        /// Seconds from its start.
        seconds: f32,
        /// Start again at the end instead of staying there.
        looped: bool,
    },
    /// Local transforms, `[joints]`.
    Pose(&'i [Transform]),
    /// Local transforms and the weights of morph targets.
    Morphed {
        /// `[joints]`
        pose: &'i [Transform],
        /// `[morphs]`
        weights: &'i [f32],
    },
}

/// An asset, what it remembers, and scratch: everything a frame needs.
///
/// Making one costs nothing, so many avatars can share a workspace by taking turns.
///
/// ```
/// use sinew_core::{asset::{Asset, Dims}, deform::Output, frame::*};
/// # const BYTES: &[u8] = sinew_core::include_asset!("../../../tests/golden/arm.sinew");
/// const DIMS: Dims = Dims::of(BYTES);
/// let asset = Asset::new_checked(BYTES)?;
/// let mut state = State::<[f32; state_len(&DIMS)]>::new();
/// let mut workspace = Workspace::<[f32; workspace_len(&DIMS)]>::new();
/// let mut positions = [0.0; 3 * DIMS.vertex_count];
///
/// let mut output = Output::separate(&DIMS, &mut positions, None)?;
/// let mut avatar = Avatar::new(&asset, &mut state, &mut workspace)?;
/// let input = Input::Clip { index: 0, seconds: 0.5, looped: true };
/// let report = avatar.step(&input, Budget::UNLIMITED, &mut output);
/// assert!(report.flags.is_empty());
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Avatar<'r, 'a> {
    pub(super) asset: &'r Asset<'a>,
    pub(super) progress: &'r mut Progress,
    pub(super) local: &'r mut [Local],
    weights: &'r mut [f32],
    /// What correctives remember and see.
    springs: &'r mut [f32],
    features: &'r mut [f32],
    /// Seconds since the frame before.
    elapsed: f32,
    /// What a surface that follows markers remembers.
    pub(super) turns: &'r mut [f32],
    pub(super) model: &'r mut [Joint12],
    pub(super) palette: &'r mut [Joint12],
    /// What the workspace has besides.
    pub(super) spare: &'r mut [f32],
    /// Whether some bind has a stretch; only known in modes other than linear.
    pub(super) stretched: bool,
    pub(super) level: Level,
    pub(super) mode: SkinMode,
    normals: NormalMode,
}

impl<'r, 'a> Avatar<'r, 'a> {
    /// Brings the three together.
    ///
    /// # Errors
    /// [`SizeError`] where the state or the workspace is too small for the asset.
    pub fn new<S: BorrowMut<[f32]>, W: BorrowMut<[f32]>>(
        asset: &'r Asset<'a>,
        state: &'r mut State<S>,
        workspace: &'r mut Workspace<W>,
    ) -> Result<Self, SizeError> {
        let Kept {
            progress,
            local,
            weights,
            springs,
            turns,
        } = state.parts(asset.dims())?;
        let scratch = workspace.parts(asset.dims())?;
        if !progress.posed {
            pose::rest(asset, local);
            pose::rest_morphs(asset, weights);
            *progress = Progress {
                posed: true,
                ..Progress::NEW
            };
        }
        Ok(Self {
            asset,
            progress,
            local,
            weights,
            springs,
            features: scratch.features,
            elapsed: FRAME,
            turns,
            model: scratch.model,
            palette: scratch.palette,
            spare: scratch.rest,
            stretched: false,
            level: Level::best(),
            mode: SkinMode::Linear,
            normals: NormalMode::Fast,
        })
    }

    /// Moves normals in another way than by the position's matrix.
    #[must_use]
    pub fn with_normals(mut self, normals: NormalMode) -> Self {
        self.normals = normals;
        self
    }

    /// Says how many seconds have passed since the frame before, a sixtieth if nobody does: flesh
    /// that correctives move swings in time. 0 shows the same moment again; a quarter of a second
    /// or more is a cut.
    #[must_use]
    pub fn with_elapsed(mut self, seconds: f32) -> Self {
        self.elapsed = seconds;
        self
    }

    /// Uses other instructions than the best ones. The output's bits stay the same.
    #[must_use]
    pub fn with_level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }

    /// Advances to the input's pose and writes vertices, as many as the budget allows.
    ///
    /// Unusable input keeps the last good pose and raises a flag; the output never holds a number
    /// that is not finite. Work is bounded by [`cost`](super::cost).
    pub fn step(
        &mut self,
        input: &Input<'_>,
        budget: Budget,
        output: &mut Output<'_>,
    ) -> FrameReport {
        let mut report = FrameReport::default();
        self.pose(input, &mut report);
        if pose::to_model(self.asset, self.local, self.model) > 0 {
            report.flags |= Flags::OVERFLOW;
        }
        #[cfg(feature = "laplacian")]
        if let Some(surface) = self.asset.laplacian() {
            self.follow(&surface, budget, output, &mut report);
            return report;
        }
        pose::palette(self.asset, self.model, self.palette);
        #[cfg(feature = "correctives")]
        self.correct();
        #[cfg(feature = "modes")]
        self.find_duals();
        self.skin(budget, output, &mut report);
        report
    }

    /// Weights of all morph targets after the last step.
    #[must_use]
    pub fn morph_weights(&self) -> &[f32] {
        self.weights
    }

    /// Model-space matrices of all joints after the last step, rows of 3 x 4: attachment points.
    #[must_use]
    pub fn model(&self) -> &[Joint12] {
        self.model
    }

    fn pose(&mut self, input: &Input<'_>, report: &mut FrameReport) {
        match *input {
            Input::Hold => {}
            Input::Rest => self.rest(),
            Input::Clip {
                index,
                seconds,
                looped,
            } => match self.asset.clip(index) {
                None => report.flags |= Flags::UNKNOWN_CLIP,
                Some(_) if !seconds.is_finite() => {
                    report.flags |= Flags::BAD_INPUT;
                    report.held_joints = self.local.len();
                }
                Some(clip) => {
                    let seconds = if looped {
                        wrap(seconds, clip.duration)
                    } else {
                        seconds
                    };
                    self.rest();
                    pose::sample(&clip, seconds, self.local);
                    pose::sample_morphs(&clip, seconds, self.weights);
                }
            },
            Input::Pose(pose) => self.accept(pose, report),
            Input::Morphed { pose, weights } => {
                self.accept(pose, report);
                report.held_morphs = pose::accept_morphs(weights, self.weights);
                if report.held_morphs > 0 {
                    report.flags |= Flags::BAD_INPUT;
                }
            }
        }
    }

    /// Weights of the last morph targets from how the skeleton moves.
    #[cfg(feature = "correctives")]
    fn correct(&mut self) {
        let Some(corrective) = self.asset.corrective() else {
            return;
        };
        let first = self.weights.len().checked_sub(corrective.mode_count());
        let Some(weights) = first.and_then(|first| self.weights.get_mut(first..)) else {
            return;
        };
        let mut state = CorrectiveState::resumed(&mut *self.springs, self.progress.springs);
        // Sizes were checked when the avatar was made, so this cannot fail.
        let (palette, seconds) = (&*self.palette, self.elapsed);
        let _ = corrective.features(palette, seconds, &mut state, self.features);
        self.progress.springs = state.is_started();
        corrective.weights(self.features, weights);
    }

    fn rest(&mut self) {
        pose::rest(self.asset, self.local);
        pose::rest_morphs(self.asset, self.weights);
    }

    fn accept(&mut self, pose: &[Transform], report: &mut FrameReport) {
        if pose.len() < self.local.len() {
            report.flags |= Flags::SHORT_POSE;
        }
        report.held_joints = pose::accept(pose, self.local);
        if report.held_joints > 0 {
            report.flags |= Flags::BAD_INPUT;
        }
    }

    /// What moves vertices after the last step: for ranges of blocks that the caller shares out among
    /// cores. A step with [`Budget::blocks`]`(0)` finds the pose alone.
    #[must_use]
    pub fn job(&self) -> SkinJob<'_> {
        SkinJob {
            palette: self.palette,
            duals: duals_of(self.asset.dims(), self.spare),
            stretched: self.stretched,
            mode: self.mode,
            normals: self.normals,
            morph_weights: self.weights,
            level: self.level,
        }
    }

    /// Continues at the block where the frame before stopped, so that under a steady budget every
    /// block is brought up to date in turn.
    fn skin(&mut self, budget: Budget, output: &mut Output<'_>, report: &mut FrameReport) {
        let Some(due) = self.due(budget, output, report) else {
            return;
        };
        let job = self.job();
        for blocks in due.into_iter().filter(|blocks| !blocks.is_empty()) {
            job.run(self.asset, blocks, output);
        }
    }

    /// The blocks whose turn it is. None for an output of another asset.
    pub(super) fn due(
        &mut self,
        budget: Budget,
        output: &Output<'_>,
        report: &mut FrameReport,
    ) -> Option<Due> {
        let blocks = self.asset.dims().block_count;
        if !output.fits(self.asset.dims()) {
            report.flags |= Flags::WRONG_OUTPUT;
            report.blocks_left = blocks;
            return None;
        }
        report.blocks_done = budget.blocks.min(blocks);
        report.blocks_left = blocks - report.blocks_done;
        Some(self.progress.rota.due(blocks, &budget))
    }
}

/// `seconds` into one round of `duration`.
fn wrap(seconds: f32, duration: f32) -> f32 {
    if duration <= 0.0 {
        return 0.0;
    }
    let rounds = libm::floorf(seconds / duration);
    let into = seconds - rounds * duration;
    // Rounding can leave it just outside.
    into.max(0.0).min(duration)
}

#[cfg(test)]
mod tests {
    use super::wrap;

    #[test]
    fn time_wraps_both_ways() {
        assert_eq!(wrap(2.5, 2.0), 0.5);
        assert_eq!(wrap(-0.5, 2.0), 1.5);
        assert_eq!(wrap(2.0, 2.0), 0.0);
        assert_eq!(wrap(7.0, 0.0), 0.0);
        assert!((0.0..=0.1).contains(&wrap(1e30, 0.1)));
    }
}
