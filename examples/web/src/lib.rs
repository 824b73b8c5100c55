//! The core as a WebAssembly module with a plain interface, for any JavaScript or wasm host.
//!
//! A page writes an asset to the bytes that [`asset_buffer`] gives, calls [`load`], then [`step`]
//! once a frame, and reads positions and normals in place: see `run.mjs`.

use std::cell::RefCell;

use sinew_core::asset::{ALIGNMENT, Asset};
use sinew_core::deform::{Level, Output};
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, Input, State, Workspace, state_len, workspace_len,
};
use sinew_stages::Unmeasured;

thread_local! {
    static BYTES: RefCell<&'static mut [u8]> = const { RefCell::new(&mut []) };
    static PLAYER: RefCell<Option<Player>> = const { RefCell::new(None) };
}

/// Memory of one avatar.
struct Player {
    bytes: &'static [u8],
    asset: Asset<'static>,
    state: State<Vec<f32>>,
    workspace: Workspace<Vec<f32>>,
    positions: Vec<f32>,
    normals: Vec<f32>,
}

impl Player {
    fn new(bytes: &'static [u8], asset: Asset<'static>) -> Self {
        let dims = asset.dims();
        Self {
            bytes,
            asset,
            state: State::with(vec![0.0; state_len(dims)]),
            workspace: Workspace::with(vec![0.0; workspace_len(dims)]),
            positions: vec![0.0; 3 * dims.vertex_count],
            normals: vec![0.0; 3 * dims.vertex_count],
        }
    }

    /// The report's flags, or -1 where buffers do not fit, which cannot happen.
    fn step(&mut self, index: usize, seconds: f32, level: Level) -> i32 {
        let dims = self.asset.dims();
        let output = Output::separate(dims, &mut self.positions, Some(&mut self.normals));
        let avatar = Avatar::new(&self.asset, &mut self.state, &mut self.workspace);
        let (Ok(mut output), Ok(avatar)) = (output, avatar) else {
            return -1;
        };
        let input = Input::Clip {
            index,
            seconds,
            looped: false,
        };
        let report = avatar
            .with_level(level)
            .step(&input, Budget::UNLIMITED, &mut output);
        i32::from(report.flags.bits())
    }
}

fn with_player<T>(none: T, then: impl FnOnce(&mut Player) -> T) -> T {
    PLAYER.with_borrow_mut(|player| player.as_mut().map_or(none, then))
}

/// Room for an asset of `length` bytes. The memory of an asset loaded before is not used again.
#[unsafe(no_mangle)]
pub extern "C" fn asset_buffer(length: usize) -> *mut u8 {
    let memory = vec![0_u8; length + ALIGNMENT].leak();
    let start = memory.as_ptr().align_offset(ALIGNMENT);
    let bytes = &mut memory[start..start + length];
    let pointer = bytes.as_mut_ptr();
    BYTES.replace(bytes);
    pointer
}

/// Takes over what was written to [`asset_buffer`]: 1 if it is a sound asset, else 0.
#[unsafe(no_mangle)]
pub extern "C" fn load() -> u32 {
    let bytes: &'static [u8] = BYTES.take();
    let player = Asset::new_checked(bytes)
        .ok()
        .map(|asset| Player::new(bytes, asset));
    let sound = player.is_some();
    PLAYER.set(player);
    sound.into()
}

/// Vertices of the asset; 0 without one.
#[unsafe(no_mangle)]
pub extern "C" fn vertex_count() -> usize {
    with_player(0, |player| player.asset.dims().vertex_count)
}

/// Plays a clip to a time; positions and normals are up to date then. The report's flags, or -1
/// without an asset.
#[unsafe(no_mangle)]
pub extern "C" fn step(clip: usize, seconds: f32) -> i32 {
    with_player(-1, |player| player.step(clip, seconds, Level::best()))
}

/// `[vertices x 3]` numbers, metres, in the source mesh's order; null without an asset.
#[unsafe(no_mangle)]
pub extern "C" fn positions() -> *const f32 {
    with_player(std::ptr::null(), |player| player.positions.as_ptr())
}

/// `[vertices x 3]` numbers, unit length; null without an asset.
#[unsafe(no_mangle)]
pub extern "C" fn normals() -> *const f32 {
    with_player(std::ptr::null(), |player| player.normals.as_ptr())
}

/// Hash of all frames of a clip, one vertex at a time or with the best instructions; the number
/// that `sinew verify` prints for clip 0. 0 without an asset or such a clip.
#[unsafe(no_mangle)]
pub extern "C" fn fingerprint(clip: usize, scalar: u32) -> u64 {
    let level = if scalar == 0 {
        Level::best()
    } else {
        Level::Scalar
    };
    with_player(0, |player| {
        let Some(times) = player.asset.clip(clip).map(|clip| clip.sample_times()) else {
            return 0;
        };
        let mut hash = Fingerprint::new();
        for seconds in times {
            player.step(clip, seconds, level);
            hash.update(&player.positions);
            hash.update(&player.normals);
        }
        hash.value()
    })
}

/// Hash of what a stage of `tests/stages` puts out over the asset, by its place in the list of all;
/// 0 where it does not run.
#[unsafe(no_mangle)]
pub extern "C" fn stage(index: usize, scalar: u32) -> u64 {
    let level = if scalar == 0 {
        Level::best()
    } else {
        Level::Scalar
    };
    with_player(0, |player| {
        let mut memory = vec![0.0; MEMORY];
        let run = sinew_stages::ALL.get(index).map(|&(_, run)| run);
        let hash = run.map(|run| run(player.bytes, level, &mut memory, &mut Unmeasured));
        hash.and_then(Result::ok).unwrap_or(0)
    })
}

/// Place of a stage in the list of all by its name, which was written to [`asset_buffer`]; -1 for
/// none.
#[unsafe(no_mangle)]
pub extern "C" fn stage_named() -> i32 {
    let name: &[u8] = BYTES.take();
    let place = sinew_stages::ALL
        .iter()
        .position(|(known, _)| known.as_bytes() == name);
    place.map_or(-1, |place| place as i32)
}

/// Numbers of memory for a stage.
const MEMORY: usize = 4 << 20;
