//! A frame in two ranges of blocks, as two cores, or a core and a DMA channel, would share it: the
//! pose once, then each half on its own into the back one of two buffers.

use core::hint::black_box;

use sinew_core::asset::{Asset, LANES};
use sinew_core::deform::{Level, Output, SkinJob, VertexOrder};
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, Input, State, Workspace, state_len, workspace_len,
};

use crate::{Fault, Memory, Probe};

/// Plays the first clip.
///
/// # Errors
/// [`Fault`] where the asset is unsound, has no clip, the memory is too small, or the halves are
/// not the whole.
pub fn run<P: Probe>(
    bytes: &[u8],
    level: Level,
    memory: &mut [f32],
    probe: &mut P,
) -> Result<u64, Fault> {
    let asset = Asset::new_checked(bytes)?;
    let (dims, clip) = (asset.dims(), asset.clip(0).ok_or(Fault::Nothing)?);
    let mut memory = Memory::new(memory);
    let mut state = State::with(memory.take(state_len(dims))?);
    let mut workspace = Workspace::with(memory.take(workspace_len(dims))?);
    let mut front = memory.take(3 * dims.vertex_count)?;
    let mut back = memory.take(3 * dims.vertex_count)?;
    let whole = memory.take(3 * dims.vertex_count)?;

    // A half is a range of blocks; in block order its vertices are a range of the buffer too.
    let middle = dims.block_count.div_ceil(2);
    let mut hash = Fingerprint::new();
    for seconds in clip.sample_times() {
        let input = black_box(Input::Clip {
            index: 0,
            seconds,
            looped: false,
        });
        let mut avatar = Avatar::new(&asset, &mut state, &mut workspace)?.with_level(level);
        let mut output = Output::separate(dims, whole, None)?.in_order(VertexOrder::Block);
        avatar.step(&input, Budget::UNLIMITED, &mut output);
        let job: SkinJob<'_> = avatar.job();
        let (low, high) = back.split_at_mut((3 * LANES * middle).min(3 * dims.vertex_count));
        let blocks = middle..dims.block_count;
        for (name, blocks, half) in [("first", 0..middle, low), ("second", blocks, high)] {
            let mut output = Output::of_blocks(dims, blocks.clone(), half, None)?;
            probe.count(name, || job.run(&asset, blocks, &mut output));
        }
        if back != whole {
            return Err(Fault::Nothing);
        }
        // What was drawn is shown; the next frame goes where the last one was.
        core::mem::swap(&mut front, &mut back);
        hash.update(front);
    }
    probe.number("bytes_asset", bytes.len() as u64);
    Ok(hash.value())
}
