//! A firmware that only runs the stage. It links only while nothing in it can panic.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use sinew_core::deform::Level;
use sinew_cortex_m::{ASSET, MEMORY, stage};
use sinew_stages::Unmeasured;

#[entry]
fn main() -> ! {
    static mut NUMBERS: [f32; MEMORY] = [0.0; MEMORY];

    // The compiler must know neither the bytes nor a length: the proof is for every asset.
    let numbers = black_box(NUMBERS.as_mut_slice());
    loop {
        let hash = stage::run(black_box(ASSET), Level::Scalar, numbers, &mut Unmeasured);
        let _ = black_box(hash);
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
