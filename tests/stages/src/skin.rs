//! Clip sampling, joint palette and skinning: the first clip of an asset.

use core::hint::black_box;

use sinew_core::asset::{Asset, AssetError, Clip, Dims};
use sinew_core::deform::{Level, Output};
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, FrameReport, Input, State, Workspace, cost, even_cost, state_len,
    workspace_len,
};
use sinew_core::pose::Transform;

use crate::worst::{JOINTS, stretched, twisted};
use crate::{Fault, Memory, Probe};

/// Plays the first clip.
///
/// # Errors
/// [`Fault`] where the asset is unsound or the memory too small.
pub fn run<P: Probe>(
    bytes: &[u8],
    level: Level,
    memory: &mut [f32],
    probe: &mut P,
) -> Result<u64, Fault> {
    let asset = probe.count("load", || Asset::new_checked(bytes))?;
    let dims = asset.dims();
    let clip = asset.clip(0).ok_or(Fault::Nothing)?;
    let mut memory = Memory::new(memory);
    let mut state = State::with(memory.take(state_len(dims))?);
    let mut workspace = Workspace::with(memory.take(workspace_len(dims))?);
    let positions = memory.take(3 * dims.vertex_count)?;
    let normals = memory.take(3 * dims.vertex_count)?;

    let (bound, even) = (
        cost(dims, Budget::UNLIMITED),
        even_cost(dims, Budget::UNLIMITED),
    );
    probe.number("bound_frame_mul_adds", even.mul_adds);
    probe.number("bound_frame_divisions", even.divisions);
    probe.number("bound_stretched_mul_adds", bound.mul_adds);
    probe.number("bound_twisted_mul_adds", bound.mul_adds);
    let mut hash = Fingerprint::new();
    for seconds in clip.sample_times() {
        let input = black_box(Input::Clip {
            index: 0,
            seconds,
            looped: false,
        });
        let mut output = Output::separate(dims, positions, Some(normals))?;
        let mut avatar = Avatar::new(&asset, &mut state, &mut workspace)?.with_level(level);
        let report = probe.count("frame", || {
            avatar.step(&input, Budget::UNLIMITED, &mut output)
        });
        if !report.flags.is_empty() || report.blocks_left > 0 {
            return Err(Fault::Frame(report));
        }
        // The same again without vertices: what is left is the pose.
        probe.count("pose", || {
            avatar.step(&input, Budget::blocks(0), &mut output)
        });
        hash.update(positions);
        hash.update(normals);
    }
    // What costs most: every joint scaled unevenly, or neighbours that turn against each other.
    let mut pose = [Transform::IDENTITY; JOINTS];
    let mut worst = |name, thirds| -> Result<(), Fault> {
        let pose = match thirds {
            None => stretched(&asset, &mut pose),
            Some(thirds) => twisted(&asset, thirds, &mut pose),
        };
        let input = black_box(Input::Pose(pose.ok_or(Fault::Nothing)?));
        let mut output = Output::separate(dims, positions, Some(normals))?;
        let mut avatar = Avatar::new(&asset, &mut state, &mut workspace)?.with_level(level);
        probe.count(name, || avatar.step(&input, Budget::UNLIMITED, &mut output));
        Ok(())
    };
    worst("stretched", None)?;
    if dims.laplacian.is_some() {
        for thirds in 1..6 {
            worst("twisted", Some(thirds))?;
        }
    }
    numbers(bytes, dims, probe);
    Ok(hash.value())
}

fn numbers<P: Probe>(bytes: &[u8], dims: &Dims, probe: &mut P) {
    let number = 4;
    probe.per("skin_vertex", "frame", "pose", dims.vertex_count as u64);
    for (name, value) in [
        ("joints", dims.joint_count),
        ("vertices", dims.vertex_count),
        ("blocks", dims.block_count),
        ("slots", dims.slot_count),
        ("bytes_asset", bytes.len()),
        ("bytes_state", number * state_len(dims)),
        ("bytes_workspace", number * workspace_len(dims)),
        ("bytes_output", number * 6 * dims.vertex_count),
        ("bytes_of_Asset", size_of::<Asset<'_>>()),
        ("bytes_of_AssetError", size_of::<AssetError>()),
        ("bytes_of_Avatar", size_of::<Avatar<'_, '_>>()),
        ("bytes_of_Clip", size_of::<Clip<'_>>()),
        ("bytes_of_Dims", size_of::<Dims>()),
        ("bytes_of_FrameReport", size_of::<FrameReport>()),
        ("bytes_of_Input", size_of::<Input<'_>>()),
        ("bytes_of_Output", size_of::<Output<'_>>()),
    ] {
        probe.number(name, value as u64);
    }
}
