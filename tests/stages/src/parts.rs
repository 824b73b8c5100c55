//! Skin that dense markers drive, in the mode that the asset holds: the markers are vertices of the
//! body that the asset's first clip moves, a few of them hidden for a while.

use core::hint::black_box;

use sinew_core::asset::{Asset, Dims, LANES, MarkerMode, MarkerSkin};
use sinew_core::deform::parts::{
    ExactBudget, ExactState, Followed, PartFrames, RigState, exact_state_len, rig_state_len,
    rig_workspace_len,
};
use sinew_core::deform::{Level, Output};
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, Input, State, Workspace, follow_cost, parts_cost, state_len,
    workspace_len,
};

use crate::{Fault, Memory, Probe};

/// Most markers.
const MARKERS: usize = 128;

/// Follows the markers through the first clip.
///
/// # Errors
/// [`Fault`] where the asset is unsound, has no skin that markers drive or no clip, or the memory is
/// too small.
pub fn run<P: Probe>(
    bytes: &[u8],
    level: Level,
    memory: &mut [f32],
    probe: &mut P,
) -> Result<u64, Fault> {
    let asset = probe.count("load", || Asset::new_checked(bytes))?;
    let (dims, clip) = (asset.dims(), asset.clip(0).ok_or(Fault::Nothing)?);
    let skin = asset.marker_skin().ok_or(Fault::Nothing)?;
    let (markers, parts) = (skin.rig.marker_count(), skin.rig.part_count());
    let mut memory = Memory::new(memory);
    // The body that carries the markers costs nothing that is counted.
    let mut state = State::with(memory.take(state_len(dims))?);
    let mut workspace = Workspace::with(memory.take(workspace_len(dims))?);
    let seen = memory.take(3 * markers)?.as_chunks_mut::<3>().0;
    let left = memory.left();
    let mut rig_state = RigState::with(memory.take(rig_state_len(markers, parts))?);
    let mut rig_again = RigState::with(memory.take(rig_state_len(markers, parts))?);
    let handles = memory.take(rig_workspace_len(markers, parts))?;
    let (members, room) = match &skin.mode {
        MarkerMode::Exact(exact) => (dims.marker_skin.exact_member_count, exact.workspace_len()),
        _ => (0, 0),
    };
    let mut exact_state = ExactState::with(memory.take(exact_state_len(members))?);
    let exact_room = memory.take(room)?;
    let used = left - memory.left() - rig_state_len(markers, parts);
    let positions = memory.take(3 * dims.vertex_count)?;
    let normals = memory.take(3 * dims.vertex_count)?;

    let mut vertices = [0; MARKERS];
    let vertices = vertices.get_mut(..markers).ok_or(Fault::Nothing)?;
    find(&asset, &skin, vertices);
    let mut hash = Fingerprint::new();
    for (frame, seconds) in clip.sample_times().enumerate() {
        let input = Input::Clip {
            index: 0,
            seconds,
            looped: false,
        };
        let mut output = Output::separate(dims, positions, Some(normals))?;
        let mut avatar = Avatar::new(&asset, &mut state, &mut workspace)?.with_level(level);
        avatar.step(&input, Budget::blocks(0), &mut output);
        avatar.skin_vertices(vertices, seen, None)?;
        hide(frame, seen);
        let seen = black_box(&*seen);
        probe.count("frame", || -> Result<(), Fault> {
            let followed = skin.rig.follow(seen, &mut rig_state, handles)?;
            black_box(followed.positions);
            let exact = (&mut exact_state, &mut *exact_room);
            stream(&skin, &followed, exact, level, &mut output)
        })?;
        // Once more without vertices: what is left is the stream.
        probe.count("follow", || skin.rig.follow(seen, &mut rig_again, handles))?;
        hash.update(positions);
        hash.update(normals);
    }
    let bound = parts_cost(dims, Budget::UNLIMITED);
    probe.number("bound_frame_mul_adds", bound.mul_adds);
    probe.number("bound_frame_divisions", bound.divisions);
    probe.number("bound_follow_mul_adds", follow_cost(dims).mul_adds);
    probe.number("bound_follow_divisions", follow_cost(dims).divisions);
    numbers(bytes, dims, used, probe);
    Ok(hash.value())
}

fn stream(
    skin: &MarkerSkin<'_>,
    followed: &Followed<'_>,
    exact: (&mut ExactState<&mut [f32]>, &mut [f32]),
    level: Level,
    output: &mut Output<'_>,
) -> Result<(), Fault> {
    let all = 0..usize::MAX;
    match &skin.mode {
        MarkerMode::Collapsed(skin) => skin.blocks(followed.positions, all, level, output),
        MarkerMode::Hybrid(skin) => {
            let frames = PartFrames {
                palette: followed.palette,
                duals: followed.duals,
            };
            skin.blocks(&frames, followed.residuals, all, level, output);
        }
        MarkerMode::Exact(skin) => {
            let (state, room) = exact;
            let handles = skin.handles(followed, ExactBudget::UNLIMITED, state, room)?;
            skin.blocks(&handles, all, level, output);
        }
    }
    Ok(())
}

/// The vertex, in block order, on which each marker sits at rest.
pub(crate) fn find(asset: &Asset<'_>, skin: &MarkerSkin<'_>, vertices: &mut [u32]) {
    for (vertex, marker) in vertices.iter_mut().zip(skin.rig.tables().rest) {
        let mut nearest = f32::MAX;
        for (block, [x, y, z]) in asset.rest_positions().iter().enumerate() {
            for (lane, ((x, y), z)) in x.iter().zip(y).zip(z).enumerate() {
                let [a, b, c] = [x - marker[0], y - marker[1], z - marker[2]];
                let distance = a * a + b * b + c * c;
                if distance < nearest {
                    nearest = distance;
                    *vertex = (block * LANES + lane) as u32;
                }
            }
        }
    }
}

/// Every marker for a thirtieth of a second in every half; in one frame each is taken for another, so
/// that all parts are fitted as often as they can be.
fn hide(frame: usize, seen: &mut [[f32; 3]]) {
    if frame == 2 {
        for marker in 0..seen.len() {
            seen.swap(marker, (7 * marker + 3) % seen.len());
        }
        return;
    }
    for (marker, seen) in seen.iter_mut().enumerate() {
        if (frame + 13 * marker) % 64 < 4 {
            *seen = [f32::NAN; 3];
        }
    }
}

fn numbers<P: Probe>(bytes: &[u8], dims: &Dims, used: usize, probe: &mut P) {
    let number = 4;
    probe.per("stream_vertex", "frame", "follow", dims.vertex_count as u64);
    for (name, value) in [
        ("markers", dims.marker_skin.marker_count as u64),
        ("parts", dims.marker_skin.part_count as u64),
        ("vertices", dims.vertex_count as u64),
        ("bytes_asset", bytes.len() as u64),
        ("bytes_memory", (number * used) as u64),
    ] {
        probe.number(name, value);
    }
}
