//! Several avatars of one asset: a state for each, one workspace for all.

use core::hint::black_box;

use sinew_core::asset::Asset;
use sinew_core::deform::{Level, Output};
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, Input, State, Workspace, state_len, workspace_len,
};

use crate::{Fault, Memory, Probe};

/// How many play at once, and what that is called.
const CROWDS: [(&str, usize); 3] = [("one", 1), ("four", 4), ("sixteen", 16)];

/// Frames of the clip that are played.
const FRAMES: usize = 4;

/// Plays the first clip, each avatar a little later than the one before.
///
/// # Errors
/// [`Fault`] where the asset is unsound, has no clip, or the memory is too small.
pub fn run<P: Probe>(
    bytes: &[u8],
    level: Level,
    memory: &mut [f32],
    probe: &mut P,
) -> Result<u64, Fault> {
    let asset = Asset::new_checked(bytes)?;
    let (dims, clip) = (asset.dims(), asset.clip(0).ok_or(Fault::Nothing)?);
    let mut memory = Memory::new(memory);
    let mut workspace = Workspace::with(memory.take(workspace_len(dims))?);
    let mut states = [const { None }; 16];
    for state in &mut states {
        *state = Some(State::with(memory.take(state_len(dims))?));
    }
    let size = 3 * dims.vertex_count;
    let positions = memory.take(states.len() * size)?;
    let normals = memory.take(states.len() * size)?;

    let mut hash = Fingerprint::new();
    let step = (clip.sample_times().len() / FRAMES).max(1);
    for (name, count) in CROWDS {
        for seconds in clip.sample_times().step_by(step).take(FRAMES) {
            let crowd = states.iter_mut().flatten().take(count);
            let outputs = positions.chunks_exact_mut(size.max(1));
            let outputs = outputs.zip(normals.chunks_exact_mut(size.max(1)));
            probe.count(name, || -> Result<(), Fault> {
                for (late, (state, (positions, normals))) in crowd.zip(outputs).enumerate() {
                    let input = black_box(Input::Clip {
                        index: 0,
                        seconds: seconds + 0.1 * late as f32,
                        looped: true,
                    });
                    let mut output = Output::separate(dims, positions, Some(normals))?;
                    let mut avatar = Avatar::new(&asset, state, &mut workspace)?.with_level(level);
                    let report = avatar.step(&input, Budget::UNLIMITED, &mut output);
                    if !report.flags.is_empty() {
                        return Err(Fault::Frame(report));
                    }
                }
                Ok(())
            })?;
            hash.update(positions.get(..count * size).unwrap_or_default());
            hash.update(normals.get(..count * size).unwrap_or_default());
        }
    }
    for (name, _) in CROWDS {
        probe.per(name, name, "", 1);
    }
    probe.number("bytes_asset", bytes.len() as u64);
    probe.number("bytes_state", 4 * state_len(dims) as u64);
    probe.number("bytes_workspace", 4 * workspace_len(dims) as u64);
    Ok(hash.value())
}
