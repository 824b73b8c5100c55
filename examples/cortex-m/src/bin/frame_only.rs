//! A firmware that only loads an asset and steps frames. It links only while neither can panic.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use sinew_core::asset::Asset;
use sinew_core::deform::Output;
use sinew_core::frame::{Avatar, Budget, Input, State, Workspace, state_len, workspace_len};
use sinew_cortex_m::{ASSET, DIMS};

#[entry]
fn main() -> ! {
    static mut STATE: [f32; state_len(&DIMS)] = [0.0; state_len(&DIMS)];
    static mut WORKSPACE: [f32; workspace_len(&DIMS)] = [0.0; workspace_len(&DIMS)];
    static mut POSITIONS: [f32; 3 * DIMS.vertex_count] = [0.0; 3 * DIMS.vertex_count];
    static mut NORMALS: [f32; 3 * DIMS.vertex_count] = [0.0; 3 * DIMS.vertex_count];

    // The compiler must know neither the bytes nor a length: the proof is for every asset.
    let mut state = State::with(black_box(STATE.as_mut_slice()));
    let mut workspace = Workspace::with(black_box(WORKSPACE.as_mut_slice()));
    let (positions, normals) = black_box((POSITIONS.as_mut_slice(), NORMALS.as_mut_slice()));
    if let Ok(asset) = Asset::new_checked(black_box(ASSET))
        && let Ok(mut avatar) = Avatar::new(&asset, &mut state, &mut workspace)
        && let Ok(mut output) = Output::separate(asset.dims(), positions, Some(normals))
    {
        loop {
            let (input, budget) = black_box((Input::Rest, Budget::UNLIMITED));
            black_box(avatar.step(&input, budget, &mut output));
            black_box(&output);
        }
    }
    loop {
        cortex_m::asm::wfi();
    }
}

unsafe extern "C" {
    /// Defined nowhere: the linker names it when some code that can panic is left.
    fn a_panic_path_is_linked() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never linked, so never called.
    unsafe { a_panic_path_is_linked() }
}
