//! Skinning other than linear: the choice, and what it needs besides the palette.

use super::buffers::{dual_len, dual_parts};
use super::{Avatar, any_mode_workspace_len};
use crate::deform::SkinMode;
use crate::pose;

impl Avatar<'_, '_> {
    /// Blends transforms in another way than linearly.
    ///
    /// # Errors
    /// [`ModeError`] where the workspace is smaller than [`any_mode_workspace_len`], or where the
    /// asset was baked without the data.
    pub fn with_mode(mut self, mode: SkinMode) -> Result<Self, ModeError> {
        let dims = self.asset.dims();
        if mode != SkinMode::Linear && self.spare.len() < dual_len(dims) {
            return Err(ModeError::Workspace {
                needed: any_mode_workspace_len(dims),
            });
        }
        let blended = dims.block_count - dims.rigid_block_count.min(dims.block_count);
        if mode == SkinMode::CentresOfRotation && dims.centre_block_count != blended {
            return Err(ModeError::NoCentres);
        }
        self.mode = mode;
        Ok(self)
    }

    /// Dual quaternions of the binds, where the mode needs them.
    pub(super) fn find_duals(&mut self) {
        if self.mode != SkinMode::Linear
            && let Some((rotations, duals)) = dual_parts(self.asset.dims(), self.spare)
        {
            pose::rotations(self.asset, self.local, rotations);
            self.stretched = pose::duals(self.asset, self.palette, rotations, duals);
        }
    }
}

/// A mode that cannot be had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ModeError {
    /// The workspace is too small.
    Workspace {
        /// Numbers needed.
        needed: usize,
    },
    /// The asset holds no centres of rotation.
    NoCentres,
}

impl core::fmt::Display for ModeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Workspace { needed } => write!(
                f,
                "this mode needs a workspace of {needed} numbers; size it by any_mode_workspace_len"
            ),
            Self::NoCentres => write!(
                f,
                "the asset holds no centres of rotation; bake it with them"
            ),
        }
    }
}

impl core::error::Error for ModeError {}
