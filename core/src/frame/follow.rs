//! A frame of a surface that follows its joints as markers.

use super::{Avatar, Budget, FrameReport};
use crate::asset::LaplacianSurface;
use crate::deform::Output;
use crate::deform::laplacian::{MarkerPose, TurnState};
use crate::pose;

impl Avatar<'_, '_> {
    /// Markers from the joints' matrices, then the surface, as much of it as the budget allows: a
    /// collapsed one block by block, an exact one whole or, with no solve or no block left, not at all.
    pub(super) fn follow(
        &mut self,
        surface: &LaplacianSurface<'_>,
        budget: Budget,
        output: &mut Output<'_>,
        report: &mut FrameReport,
    ) {
        let budget = match surface {
            LaplacianSurface::Exact(_) if budget.solves == 0 || budget.blocks == 0 => {
                Budget::blocks(0)
            }
            LaplacianSurface::Exact(_) => Budget::UNLIMITED,
            LaplacianSurface::Collapsed(_) => budget,
        };
        let Some(due) = self.due(budget, output, report) else {
            return;
        };
        let joints = self.local.len();
        let split = self.spare.split_at_mut_checked(4 * joints);
        let Some((rotations, scratch)) = split else {
            return;
        };
        let rotations = rotations.as_chunks_mut().0;
        pose::rotations(self.asset, self.local, rotations);
        let (model, rotations) = (&*self.model, &*rotations);
        let marker = |joint: usize| {
            let &[_, _, _, x, _, _, _, y, _, _, _, z] = model.get(joint)?;
            Some(MarkerPose {
                position: [x, y, z],
                rotation: rotations.get(joint).copied()?,
            })
        };
        let mut state = TurnState::resumed(&mut *self.turns, self.progress.turns);
        // Sizes were checked when the avatar was made, so nothing here can fail.
        match surface {
            LaplacianSurface::Collapsed(collapsed) => {
                let handles = scratch.as_chunks_mut().0;
                let _ = collapsed.handles_of(marker, &mut state, handles);
                for blocks in due {
                    collapsed.blocks(handles, blocks, self.level, output);
                }
            }
            LaplacianSurface::Exact(exact) if report.blocks_done > 0 => {
                let _ = exact.step_of(marker, 0, self.level, &mut state, scratch, output);
            }
            LaplacianSurface::Exact(_) => {}
        }
        self.progress.turns = state.stage();
    }
}
