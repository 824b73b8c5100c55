//! Runs the core over an asset on the host.

use sinew_core::asset::Asset;
use sinew_core::deform::{Level, NormalMode, Output, SkinMode};
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, FrameReport, Input, ModeError, State, Workspace,
    any_mode_workspace_len, state_len,
};
use sinew_core::pose;

use crate::fit::parts::MarkerPlayer;
use crate::model::{Clip, Skeleton};
use crate::reference;

/// One avatar with its memory and its output, in the source mesh's vertex order.
#[derive(Debug)]
pub struct Player<'a> {
    asset: Asset<'a>,
    level: Level,
    mode: SkinMode,
    normal_mode: NormalMode,
    state: State<Vec<f32>>,
    workspace: Workspace<Vec<f32>>,
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    /// Seconds since the frame before; the core's guess where nobody says.
    elapsed: Option<f32>,
    /// The time shown last.
    shown: Option<f64>,
    weights: Vec<f32>,
    /// Empty where the asset has none.
    tangents: Vec<[f32; 4]>,
    /// Made when the first frame of markers comes.
    markers: Option<MarkerPlayer<'a>>,
}

impl<'a> Player<'a> {
    /// Memory for one avatar. The kernels use the best instructions there are.
    #[must_use]
    pub fn new(asset: Asset<'a>) -> Self {
        let dims = *asset.dims();
        let has_tangents = dims.shapes.tangent_block_count > 0;
        let tangent_count = if has_tangents { dims.vertex_count } else { 0 };
        Self {
            asset,
            level: Level::best(),
            mode: SkinMode::Linear,
            normal_mode: NormalMode::Fast,
            state: State::with(vec![0.0; state_len(&dims)]),
            workspace: Workspace::with(vec![0.0; any_mode_workspace_len(&dims)]),
            positions: vec![[0.0; 3]; dims.vertex_count],
            normals: vec![[0.0; 3]; dims.vertex_count],
            tangents: vec![[0.0; 4]; tangent_count],
            markers: None,
            elapsed: None,
            shown: None,
            weights: vec![0.0; dims.morph_count],
        }
    }

    /// Another that plays the same in the same way, from the start.
    #[must_use]
    pub fn fresh(&self) -> Self {
        Self {
            level: self.level,
            mode: self.mode,
            normal_mode: self.normal_mode,
            ..Self::new(self.asset)
        }
    }

    /// What it plays.
    #[must_use]
    pub fn asset(&self) -> &Asset<'a> {
        &self.asset
    }

    /// The same with other instructions.
    #[must_use]
    pub fn with_level(mut self, level: Level) -> Self {
        self.level = level;
        self
    }

    /// The same with transforms blended in another way, and normals moved in another.
    ///
    /// # Errors
    /// A mode whose data the asset does not hold.
    pub fn with_modes(mut self, mode: SkinMode, normals: NormalMode) -> Result<Self, ModeError> {
        Avatar::new(&self.asset, &mut self.state, &mut self.workspace)
            .expect("the memory has the asset's size")
            .with_mode(mode)?;
        (self.mode, self.normal_mode) = (mode, normals);
        Ok(self)
    }

    /// Steps to an input; the vertices are in [`Self::positions`] and [`Self::normals`] then.
    ///
    /// # Panics
    /// Never: the buffers were made for the asset.
    pub fn step(&mut self, input: &Input<'_>) -> FrameReport {
        let mut output = Output::separate(
            self.asset.dims(),
            self.positions.as_flattened_mut(),
            Some(self.normals.as_flattened_mut()),
        )
        .expect("the buffers have the asset's size");
        if !self.tangents.is_empty() {
            output = output
                .with_tangents(self.tangents.as_flattened_mut())
                .expect("the buffers have the asset's size");
        }
        let mut avatar = Avatar::new(&self.asset, &mut self.state, &mut self.workspace)
            .expect("the memory has the asset's size")
            .with_mode(self.mode)
            .expect("the mode was tried before")
            .with_normals(self.normal_mode)
            .with_level(self.level);
        if let Some(seconds) = self.elapsed {
            avatar = avatar.with_elapsed(seconds);
        }
        let report = avatar.step(input, Budget::UNLIMITED, &mut output);
        self.weights.copy_from_slice(avatar.morph_weights());
        report
    }

    /// Says how many seconds pass from frame to frame, for what swings in time.
    pub fn set_elapsed(&mut self, seconds: f64) {
        self.elapsed = Some(seconds as f32);
    }

    /// Weights of all morph targets after the last step, `[morphs]`.
    #[must_use]
    pub fn morph_weights(&self) -> &[f32] {
        &self.weights
    }

    /// Steps the skin that markers drive to a frame of them: `[markers]`, metres, NaN where
    /// missing. Nothing moves where the asset has no such skin.
    pub fn step_markers(&mut self, frame: &[[f32; 3]]) {
        if self.markers.is_none() {
            let skin = self.asset.marker_skin();
            self.markers = skin.map(|skin| MarkerPlayer::of(skin).with_level(self.level));
        }
        if let Some(skin) = &mut self.markers {
            skin.step(frame);
            self.positions.copy_from_slice(skin.positions());
            self.normals.copy_from_slice(skin.normals());
        }
    }

    /// Metres, `[vertices]`.
    #[must_use]
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Unit length and handedness, `[vertices]`; none where the asset has none.
    #[must_use]
    pub fn tangents(&self) -> &[[f32; 4]] {
        &self.tangents
    }

    /// Unit length, `[vertices]`.
    #[must_use]
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.normals
    }
}

/// Hash over the positions and normals of the first clip at all its sample times, in the source
/// mesh's vertex order: what the examples for firmware and browsers print, to compare machines with.
/// An asset without clips gives that of its rest pose. O(frames x vertices).
#[must_use]
pub fn fingerprint(asset: &Asset<'_>, level: Level) -> u64 {
    let mut player = Player::new(*asset).with_level(level);
    let mut hash = Fingerprint::new();
    let mut add = |input: &Input<'_>| {
        player.step(input);
        hash.update(player.positions().as_flattened());
        hash.update(player.normals().as_flattened());
    };
    match asset.clip(0) {
        None => add(&Input::Rest),
        Some(clip) => clip.sample_times().for_each(|seconds| {
            add(&Input::Clip {
                index: 0,
                seconds,
                looped: false,
            });
        }),
    }
    hash.value()
}

/// Motion for a player, with the times at which it is to be shown.
#[derive(Clone, Debug)]
pub enum Motion {
    /// A clip of the asset.
    Own {
        /// Which.
        index: usize,
        /// Seconds.
        duration: f64,
    },
    /// A clip from elsewhere, already on the asset's skeleton.
    Foreign(Clip, Skeleton),
    /// Frames of markers for the skin that they drive.
    Markers {
        /// Frames a second.
        rate: f64,
        /// `[frames][markers]`, metres, NaN where missing.
        frames: Vec<Vec<[f32; 3]>>,
    },
}

impl Motion {
    /// Seconds from start to end.
    #[must_use]
    pub fn duration(&self) -> f64 {
        match self {
            Self::Own { duration, .. } => *duration,
            Self::Foreign(clip, _) => clip.duration,
            Self::Markers { rate, frames } => frames.len().saturating_sub(1) as f64 / rate,
        }
    }

    /// Steps a player to a time; of markers, to the nearest frame.
    pub fn step(&self, player: &mut Player<'_>, seconds: f64) {
        if let Some(shown) = player.shown.replace(seconds) {
            // Backwards is a cut.
            let passed = seconds - shown;
            player.set_elapsed(if passed < 0.0 { 1.0 } else { passed });
        }
        match self {
            Self::Markers { rate, frames } => {
                let last = frames.len().saturating_sub(1);
                let frame = ((seconds * rate).round() as usize).min(last);
                if let Some(frame) = frames.get(frame) {
                    player.step_markers(frame);
                }
            }
            Self::Own { index, .. } => {
                player.step(&Input::Clip {
                    index: *index,
                    seconds: seconds as f32,
                    looped: false,
                });
            }
            Self::Foreign(clip, skeleton) => {
                let local = reference::pose::sample(skeleton, clip, seconds);
                let local: Vec<_> = local.iter().map(core_transform).collect();
                player.step(&Input::Pose(&local));
            }
        }
    }
}

/// A local transform as the core takes it.
pub(crate) fn core_transform(local: &crate::model::Transform) -> pose::Transform {
    pose::Transform {
        rotation: local.rotation.as_quat(),
        translation: local.translation.as_vec3(),
        scale: local.scale.as_vec3(),
    }
}

/// Times from 0 to `duration`, both included, `rate` a second. Never fewer than one.
#[must_use]
pub fn frame_times(duration: f64, rate: f64) -> Vec<f64> {
    // Half a thousandth of a frame: enough for a duration that is a whole number of frames.
    let count = (duration * rate + 5e-4).floor() as usize + 1;
    (0..count).map(|frame| frame as f64 / rate).collect()
}

#[cfg(test)]
mod tests {
    use super::frame_times;

    #[test]
    fn a_duration_of_whole_frames_includes_its_end() {
        assert_eq!(frame_times(454.0 * 0.033_333, 1.0 / 0.033_333).len(), 455);
        assert_eq!(frame_times(0.0, 30.0), [0.0]);
        assert_eq!(frame_times(1.0, 4.0), [0.0, 0.25, 0.5, 0.75, 1.0]);
    }
}
