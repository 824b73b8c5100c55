//! The core behind plain WebAssembly exports: no generated glue, so any engine can call it.
//!
//! [`reserve`] memory for an asset's file, copy it there, [`load`] it; then [`step`] to a time and
//! read [`positions`] and [`normals`], or ask for the [`fingerprint`] of the first clip.

use std::cell::RefCell;

use sinew_core::asset::Asset;
use sinew_core::deform::Output;
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, Input, State, Workspace, state_len, workspace_len,
};

thread_local! {
    static FILE: RefCell<Vec<u128>> = const { RefCell::new(Vec::new()) };
    static PLAYER: RefCell<Option<Player>> = const { RefCell::new(None) };
}

/// An asset and the memory to play it.
struct Player {
    asset: Asset<'static>,
    state: State<Vec<f32>>,
    workspace: Workspace<Vec<f32>>,
    positions: Vec<f32>,
    normals: Vec<f32>,
}

impl Player {
    fn new(asset: Asset<'static>) -> Self {
        let dims = asset.dims();
        Self {
            state: State::with(vec![0.0; state_len(dims)]),
            workspace: Workspace::with(vec![0.0; workspace_len(dims)]),
            positions: vec![0.0; 3 * dims.vertex_count],
            normals: vec![0.0; 3 * dims.vertex_count],
            asset,
        }
    }

    /// Bits of the report's flags; the buffers have the asset's size, so there is no other fault.
    fn step(&mut self, seconds: f32) -> u32 {
        let input = Input::Clip {
            index: 0,
            seconds,
            looped: false,
        };
        let (positions, normals) = (&mut self.positions, &mut self.normals);
        let output = Output::separate(self.asset.dims(), positions, Some(normals));
        let avatar = Avatar::new(&self.asset, &mut self.state, &mut self.workspace);
        match (avatar, output) {
            (Ok(mut avatar), Ok(mut output)) => {
                let report = avatar.step(&input, Budget::UNLIMITED, &mut output);
                u32::from(report.flags.bits())
            }
            _ => u32::MAX,
        }
    }
}

/// Memory for a file of so many bytes. Null where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(bytes: usize) -> *mut u8 {
    FILE.with_borrow_mut(|file| {
        // Sixteen bytes at a time, since the file must start at a multiple of that.
        let length = bytes.div_ceil(16);
        *file = Vec::new();
        if file.try_reserve_exact(length).is_err() {
            return std::ptr::null_mut();
        }
        file.resize(length, 0);
        file.as_mut_ptr().cast()
    })
}

/// Checks the file in the reserved memory; returns its number of vertices, or 0 where it is not a
/// sound asset. A sound one stays in memory for good.
#[unsafe(no_mangle)]
pub extern "C" fn load(bytes: usize) -> usize {
    let file: &'static [u128] = FILE.take().leak();
    let asset = bytemuck::cast_slice(file)
        .get(..bytes)
        .map(Asset::new_checked);
    let player = asset.and_then(Result::ok).map(Player::new);
    let vertices = player
        .as_ref()
        .map_or(0, |player| player.asset.dims().vertex_count);
    PLAYER.set(player);
    vertices
}

/// Plays the first clip at a time in seconds. Returns the bits of the frame's flags, 0 when
/// nothing was odd, all bits when no asset is loaded.
#[unsafe(no_mangle)]
pub extern "C" fn step(seconds: f32) -> u32 {
    PLAYER.with_borrow_mut(|player| {
        player
            .as_mut()
            .map_or(u32::MAX, |player| player.step(seconds))
    })
}

/// Metres, `[vertices x 3]`. Null when no asset is loaded.
#[unsafe(no_mangle)]
pub extern "C" fn positions() -> *const f32 {
    PLAYER.with_borrow(|player| {
        player
            .as_ref()
            .map_or(std::ptr::null(), |p| p.positions.as_ptr())
    })
}

/// Unit length, `[vertices x 3]`. Null when no asset is loaded.
#[unsafe(no_mangle)]
pub extern "C" fn normals() -> *const f32 {
    PLAYER.with_borrow(|player| {
        player
            .as_ref()
            .map_or(std::ptr::null(), |p| p.normals.as_ptr())
    })
}

/// Seconds of the first clip; 0 where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn duration() -> f32 {
    PLAYER.with_borrow(|player| {
        let clip = player.as_ref().and_then(|player| player.asset.clip(0));
        clip.map_or(0.0, |clip| clip.duration)
    })
}

/// Hash over all frames of the first clip, as `sinew verify` prints it; 0 where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn fingerprint() -> u64 {
    PLAYER.with_borrow_mut(|player| {
        let Some(player) = player else { return 0 };
        let Some(clip) = player.asset.clip(0) else {
            return 0;
        };
        let mut hash = Fingerprint::new();
        for seconds in clip.sample_times() {
            player.step(seconds);
            hash.update(&player.positions);
            hash.update(&player.normals);
        }
        hash.value()
    })
}
