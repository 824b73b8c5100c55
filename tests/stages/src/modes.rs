//! Every skinning mode, normals both ways, tangents, bounds and single vertices, over every level
//! of detail: the first clip of an asset with centres of rotation.

use core::hint::black_box;

use sinew_core::asset::Asset;
use sinew_core::deform::{Level, NormalMode, Output, SkinMode};
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, Input, State, Workspace, any_mode_workspace_len, cost, mode_cost,
    state_len,
};
use sinew_core::pose::Transform;

use crate::worst::{JOINTS, stretched};
use crate::{Fault, Memory, Probe};

const MODES: [(&str, SkinMode); 3] = [
    ("linear", SkinMode::Linear),
    ("dual", SkinMode::DualQuaternion),
    ("centres", SkinMode::CentresOfRotation),
];

/// What costs most: every joint scaled unevenly. Frames that are held against the bound.
const STRETCHED: [(&str, &str); 3] = [
    ("stretched_linear", "bound_stretched_linear_mul_adds"),
    ("stretched_dual", "bound_stretched_dual_mul_adds"),
    ("stretched_centres", "bound_stretched_centres_mul_adds"),
];

/// Frames of the clip that are played: modes and levels multiply.
const FRAMES: usize = 4;

/// Plays some of the first clip.
///
/// # Errors
/// [`Fault`] where the asset is unsound, has no centres or no clip, or the memory is too small.
pub fn run<P: Probe>(
    bytes: &[u8],
    level: Level,
    memory: &mut [f32],
    probe: &mut P,
) -> Result<u64, Fault> {
    let whole = Asset::new_checked(bytes)?;
    let dims = whole.dims();
    let clip = whole.clip(0).ok_or(Fault::Nothing)?;
    let mut memory = Memory::new(memory);
    let mut state = State::with(memory.take(state_len(dims))?);
    let mut workspace = Workspace::with(memory.take(any_mode_workspace_len(dims))?);
    let positions = memory.take(3 * dims.vertex_count)?;
    let normals = memory.take(3 * dims.vertex_count)?;
    let tangents = memory.take(4 * dims.vertex_count)?;

    let mut hash = Fingerprint::new();
    let step = (clip.sample_times().len() / FRAMES).max(1);
    for detail in 0..whole.level_count() {
        let asset = whole.level(detail).ok_or(Fault::Nothing)?;
        let dims = asset.dims();
        for (name, mode) in MODES {
            for normal_mode in [NormalMode::Fast, NormalMode::InverseTranspose] {
                for seconds in clip.sample_times().step_by(step).take(FRAMES) {
                    let input = black_box(Input::Clip {
                        index: 0,
                        seconds,
                        looped: false,
                    });
                    let mut output = Output::separate(dims, positions, Some(normals))?;
                    if dims.shapes.tangent_block_count > 0 {
                        output = output.with_tangents(tangents)?;
                    }
                    let avatar = Avatar::new(&asset, &mut state, &mut workspace)?;
                    let avatar = avatar.with_mode(mode).map_err(|_| Fault::Nothing)?;
                    let mut avatar = avatar.with_normals(normal_mode).with_level(level);
                    let mut step = || avatar.step(&input, Budget::UNLIMITED, &mut output);
                    let report = if detail == 0 && normal_mode == NormalMode::Fast {
                        probe.count(name, step)
                    } else {
                        step()
                    };
                    if !report.flags.is_empty() || report.blocks_left > 0 {
                        return Err(Fault::Frame(report));
                    }
                    let bounds = avatar.bounds().ok_or(Fault::Nothing)?;
                    hash.update(&bounds.low);
                    hash.update(&bounds.high);
                    let mut some = [[0.0; 3]; 4];
                    avatar.skin_vertices(&[0, 9, 77, 500], &mut some, None)?;
                    hash.update(some.as_flattened());
                    hash.update(positions.get(..3 * dims.vertex_count).unwrap_or_default());
                    hash.update(normals.get(..3 * dims.vertex_count).unwrap_or_default());
                    if dims.shapes.tangent_block_count > 0 {
                        hash.update(tangents.get(..4 * dims.vertex_count).unwrap_or_default());
                    }
                }
            }
        }
    }
    let mut pose = [Transform::IDENTITY; JOINTS];
    let pose = stretched(&whole, &mut pose).ok_or(Fault::Nothing)?;
    for ((_, mode), (name, bound)) in MODES.into_iter().zip(STRETCHED) {
        let more = mode_cost(dims, Budget::UNLIMITED, mode);
        let all = cost(dims, Budget::UNLIMITED).plus(more);
        probe.number(bound, all.mul_adds);
        let mut output = Output::separate(dims, positions, Some(normals))?;
        if dims.shapes.tangent_block_count > 0 {
            output = output.with_tangents(tangents)?;
        }
        let avatar = Avatar::new(&whole, &mut state, &mut workspace)?.with_level(level);
        let mut avatar = avatar.with_mode(mode).map_err(|_| Fault::Nothing)?;
        let input = black_box(Input::Pose(pose));
        probe.count(name, || avatar.step(&input, Budget::UNLIMITED, &mut output));
    }
    let vertices = dims.vertex_count as u64;
    probe.number("bytes_asset", bytes.len() as u64);
    probe.per("linear_vertex", "linear", "", vertices);
    probe.per("dual_vertex", "dual", "", vertices);
    probe.per("centres_vertex", "centres", "", vertices);
    Ok(hash.value())
}
