//! Runs a marker-driven skin in the core, on the host.

use glam::DVec3;
use sinew_core::asset::{Dims, MarkerMode, MarkerSkin, MarkerSkinDims};
use sinew_core::deform::parts::{
    ExactBudget, ExactReport, ExactState, FollowReport, MarkerRig, PartFrames, PartsError,
    RigState, exact_state_len, rig_state_len, rig_workspace_len,
};
use sinew_core::deform::{Level, Output};
use sinew_core::frame::follow_cost;

use super::tables::{ModeData, RigTables};

/// A skin with its memory and its output, in the source mesh's vertex order.
#[derive(Debug)]
pub struct MarkerPlayer<'t> {
    rig: MarkerRig<'t>,
    mode: MarkerMode<'t>,
    budget: ExactBudget,
    level: Level,
    state: RigState<Vec<f32>>,
    workspace: Vec<f32>,
    exact_state: ExactState<Vec<f32>>,
    exact_workspace: Vec<f32>,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    report: (FollowReport, ExactReport),
}

impl<'t> MarkerPlayer<'t> {
    /// Memory for one skin. The kernels use the best instructions there are.
    ///
    /// # Errors
    /// Tables that the core refuses.
    pub fn new(rig: &'t RigTables, mode: &'t ModeData) -> Result<Self, PartsError> {
        let rig = rig.rig()?.with_linear_blend(mode.is_linear());
        let mode = mode.view((rig.part_count(), rig.marker_count()))?;
        Ok(Self::of(MarkerSkin { rig, mode }))
    }

    /// Memory for the skin of an asset.
    #[must_use]
    pub fn of(MarkerSkin { rig, mode }: MarkerSkin<'t>) -> Self {
        let (parts, markers) = (rig.part_count(), rig.marker_count());
        let vertices = match &mode {
            MarkerMode::Collapsed(skin) => skin.order().len(),
            MarkerMode::Hybrid(skin) => skin.part_blocks().order.len(),
            MarkerMode::Exact(skin) => skin.tables().blocks.order.len(),
        };
        let (members, scratch) = match &mode {
            MarkerMode::Exact(exact) => {
                (exact.tables().member_markers.len(), exact.workspace_len())
            }
            _ => (0, 0),
        };
        Self {
            rig,
            mode,
            budget: ExactBudget::UNLIMITED,
            level: Level::best(),
            state: RigState::with(vec![0.0; rig_state_len(markers, parts)]),
            workspace: vec![0.0; rig_workspace_len(markers, parts)],
            exact_state: ExactState::with(vec![0.0; exact_state_len(members)]),
            exact_workspace: vec![0.0; scratch],
            positions: vec![[0.0; 3]; vertices],
            normals: vec![[0.0; 3]; vertices],
            report: Default::default(),
        }
    }

    /// The same with another budget of the exact mode.
    #[must_use]
    pub fn with_budget(mut self, budget: ExactBudget) -> Self {
        self.budget = budget;
        self
    }

    /// The same with other instructions.
    #[must_use]
    pub fn with_level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }

    /// Steps to a frame of markers `[markers]`, metres, NaN where missing.
    ///
    /// # Panics
    /// Never: the buffers were made for the tables.
    pub fn step(&mut self, markers: &[[f32; 3]]) {
        let dims = Dims {
            vertex_count: self.positions.len(),
            ..Dims::default()
        };
        let normals = Some(self.normals.as_flattened_mut());
        let mut output = Output::separate(&dims, self.positions.as_flattened_mut(), normals)
            .expect("the buffers have the mesh's size");
        let followed = self
            .rig
            .follow(markers, &mut self.state, &mut self.workspace)
            .expect("the memory has the rig's size");
        let all = 0..usize::MAX;
        self.report.0 = followed.report;
        match &self.mode {
            MarkerMode::Collapsed(skin) => {
                skin.blocks(followed.positions, all, self.level, &mut output);
            }
            MarkerMode::Hybrid(skin) => {
                let frames = PartFrames {
                    palette: followed.palette,
                    duals: followed.duals,
                };
                skin.blocks(&frames, followed.residuals, all, self.level, &mut output);
            }
            MarkerMode::Exact(skin) => {
                let (state, workspace) = (&mut self.exact_state, &mut self.exact_workspace);
                let handles = skin
                    .handles(&followed, self.budget, state, workspace)
                    .expect("the memory has the skin's size");
                self.report.1 = handles.report;
                skin.blocks(&handles, all, self.level, &mut output);
            }
        }
    }

    /// Multiplications of a frame with normals; an upper bound for any input.
    #[must_use]
    pub fn multiply_adds(&self) -> usize {
        let blocks = match &self.mode {
            MarkerMode::Collapsed(skin) => skin.multiply_adds(),
            MarkerMode::Hybrid(skin) => skin.multiply_adds(),
            MarkerMode::Exact(skin) => skin.multiply_adds(),
        };
        let tables = self.rig.tables();
        let marker_skin = MarkerSkinDims {
            marker_count: self.rig.marker_count(),
            part_count: self.rig.part_count(),
            member_count: tables.member_markers.len(),
            carrier_count: tables.carrier_parts.len(),
            ..MarkerSkinDims::default()
        };
        let dims = Dims {
            marker_skin,
            ..Dims::default()
        };
        follow_cost(&dims).mul_adds as usize + blocks
    }

    /// Metres, `[vertices]`.
    #[must_use]
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Unit length, `[vertices]`.
    #[must_use]
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.normals
    }

    /// What the last frame found and did.
    #[must_use]
    pub fn report(&self) -> (FollowReport, ExactReport) {
        self.report
    }
}

/// Markers as the core takes them.
#[must_use]
pub fn marker_frame(frame: &[DVec3]) -> Vec<[f32; 3]> {
    frame.iter().map(|p| p.as_vec3().to_array()).collect()
}
