//! Memory of an avatar: what persists, and scratch.

use core::borrow::BorrowMut;

use super::Rota;
use crate::asset::Dims;
use crate::deform::SizeError;
use crate::deform::laplacian::{TurnStage, exact_workspace_len, turn_state_len};
use crate::deform::parts::{corrective_feature_count, corrective_state_len};
use crate::math::Quat4;
use crate::pose::{Dual17, Joint12, Local};

const LOCAL: usize = 10;
const MATRIX: usize = 12;
const QUATERNION: usize = 4;
const DUAL: usize = 17;

/// Numbers that a [`State`] needs.
#[must_use]
pub const fn state_len(dims: &Dims) -> usize {
    dims.joint_count * LOCAL + dims.morph_count + springs_len(dims) + turns_len(dims)
}

/// Numbers in which correctives remember how flesh swings.
const fn springs_len(dims: &Dims) -> usize {
    corrective_state_len(dims.correctives.part_count)
}

/// Numbers in which a surface that follows markers remembers how they turned.
const fn turns_len(dims: &Dims) -> usize {
    let counts = &dims.laplacian;
    if counts.is_some() {
        turn_state_len(dims.joint_count, counts.virtual_count + counts.row_count)
    } else {
        0
    }
}

/// Numbers that a [`Workspace`] needs.
#[must_use]
pub const fn workspace_len(dims: &Dims) -> usize {
    (dims.joint_count + dims.bind_count) * MATRIX + features_len(dims) + surface_len(dims)
}

/// Numbers of what correctives see in a frame.
const fn features_len(dims: &Dims) -> usize {
    corrective_feature_count(dims.correctives.part_count)
}

/// Numbers of scratch that a surface needs besides: rotations of joints, then its handles or rows.
const fn surface_len(dims: &Dims) -> usize {
    let counts = &dims.laplacian;
    if counts.is_collapsed() {
        dims.joint_count * QUATERNION + (dims.joint_count + counts.virtual_count) * MATRIX
    } else if counts.is_exact() {
        dims.joint_count * QUATERNION + exact_workspace_len(counts.row_count)
    } else {
        0
    }
}

/// Numbers that a [`Workspace`] needs for every skinning mode.
#[must_use]
pub const fn any_mode_workspace_len(dims: &Dims) -> usize {
    workspace_len(dims) + dual_len(dims)
}

/// Numbers that the modes other than linear blending need besides.
pub(super) const fn dual_len(dims: &Dims) -> usize {
    dims.joint_count * QUATERNION + dims.bind_count * DUAL
}

/// What an avatar remembers from one frame to the next.
///
/// `B` is the memory: `[f32; state_len(&DIMS)]` on a device, `Vec<f32>` or `&mut [f32]` where the
/// asset is loaded at run time.
#[derive(Clone, Debug)]
pub struct State<B> {
    pub(super) progress: Progress,
    numbers: B,
}

/// Where the last frame left off.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Progress {
    /// Whether `local` holds a pose.
    pub posed: bool,
    /// Which blocks are next.
    pub rota: Rota,
    /// What the memory of a surface's turns holds.
    pub turns: TurnStage,
    /// Whether the memory of springs holds an earlier frame.
    pub springs: bool,
}

impl Progress {
    pub const NEW: Self = Self {
        posed: false,
        rota: Rota::new(),
        turns: TurnStage::NEW,
        springs: false,
    };
}

impl<const N: usize> State<[f32; N]> {
    /// A state with memory of its own, for a `static` too.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            progress: Progress::NEW,
            numbers: [0.0; N],
        }
    }
}

impl<const N: usize> Default for State<[f32; N]> {
    fn default() -> Self {
        Self::new()
    }
}

impl<B: BorrowMut<[f32]>> State<B> {
    /// A state in the caller's memory, at least [`state_len`] numbers; old contents do not matter.
    #[must_use]
    pub const fn with(numbers: B) -> Self {
        Self {
            progress: Progress::NEW,
            numbers,
        }
    }

    pub(super) fn parts(&mut self, dims: &Dims) -> Result<Kept<'_>, SizeError> {
        let numbers = exactly(self.numbers.borrow_mut(), state_len(dims), "state")?;
        let joints = (dims.joint_count * LOCAL).min(numbers.len());
        let (local, rest) = numbers.split_at_mut(joints);
        let (weights, rest) = rest.split_at_mut(dims.morph_count.min(rest.len()));
        let (springs, turns) = rest.split_at_mut(springs_len(dims).min(rest.len()));
        Ok(Kept {
            progress: &mut self.progress,
            local: local.as_chunks_mut().0,
            weights,
            springs,
            turns,
        })
    }
}

/// A state, cut up.
pub(super) struct Kept<'b> {
    pub progress: &'b mut Progress,
    /// `[joints]`
    pub local: &'b mut [Local],
    /// `[morphs]`
    pub weights: &'b mut [f32],
    /// Of correctives.
    pub springs: &'b mut [f32],
    /// Of a surface that follows markers.
    pub turns: &'b mut [f32],
}

/// Scratch of a frame. Its contents do not matter between frames, so one serves many avatars.
#[derive(Clone, Debug)]
pub struct Workspace<B> {
    numbers: B,
}

impl<const N: usize> Workspace<[f32; N]> {
    /// A workspace with memory of its own, for a `static` too.
    #[must_use]
    pub const fn new() -> Self {
        Self { numbers: [0.0; N] }
    }
}

impl<const N: usize> Default for Workspace<[f32; N]> {
    fn default() -> Self {
        Self::new()
    }
}

impl<B: BorrowMut<[f32]>> Workspace<B> {
    /// A workspace in the caller's memory, at least [`workspace_len`] numbers.
    #[must_use]
    pub const fn with(numbers: B) -> Self {
        Self { numbers }
    }

    pub(super) fn parts(&mut self, dims: &Dims) -> Result<Scratch<'_>, SizeError> {
        let numbers = self.numbers.borrow_mut();
        let error = SizeError::TooSmall {
            buffer: "workspace",
            needed: workspace_len(dims),
            found: numbers.len(),
        };
        let (model, rest) = numbers
            .split_at_mut_checked(dims.joint_count * MATRIX)
            .ok_or(error)?;
        let (palette, rest) = rest
            .split_at_mut_checked(dims.bind_count * MATRIX)
            .ok_or(error)?;
        let (features, rest) = rest.split_at_mut_checked(features_len(dims)).ok_or(error)?;
        Ok(Scratch {
            features,
            model: model.as_chunks_mut().0,
            palette: palette.as_chunks_mut().0,
            rest,
        })
    }
}

/// A workspace, cut up.
pub(super) struct Scratch<'b> {
    /// `[joints]`
    pub model: &'b mut [Joint12],
    /// `[binds]`
    pub palette: &'b mut [Joint12],
    /// What correctives see.
    pub features: &'b mut [f32],
    /// What the workspace has besides.
    pub rest: &'b mut [f32],
}

/// Rotations `[joints]` and dual quaternions `[binds]` in a workspace's rest.
pub(super) fn dual_parts<'b>(
    dims: &Dims,
    rest: &'b mut [f32],
) -> Option<(&'b mut [Quat4], &'b mut [Dual17])> {
    let (rotations, rest) = rest.split_at_mut_checked(dims.joint_count * QUATERNION)?;
    let duals = rest.get_mut(..dims.bind_count * DUAL)?;
    Some((rotations.as_chunks_mut().0, duals.as_chunks_mut().0))
}

/// The dual quaternions that [`dual_parts`] filled; none in a workspace without room for them.
pub(super) fn duals_of<'b>(dims: &Dims, rest: &'b [f32]) -> &'b [Dual17] {
    let duals = rest.get(dims.joint_count * QUATERNION..);
    duals.unwrap_or_default().as_chunks().0
}

fn exactly<'b>(
    numbers: &'b mut [f32],
    needed: usize,
    buffer: &'static str,
) -> Result<&'b mut [f32], SizeError> {
    let found = numbers.len();
    numbers.get_mut(..needed).ok_or(SizeError::TooSmall {
        buffer,
        needed,
        found,
    })
}
