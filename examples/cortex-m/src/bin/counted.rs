//! Runs a stage and calls two marked functions around each frame, so that whoever logs the executed
//! instructions knows which belong to a frame. `tests/python/count_operations.py` does.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hio};
use sinew_core::deform::Level;
use sinew_cortex_m::{ASSET, MEMORY, stage};
use sinew_stages::Probe;

/// Frames that are marked; all others run unmarked.
const FRAMES: u32 = 3;

#[entry]
fn main() -> ! {
    static mut NUMBERS: [f32; MEMORY] = [0.0; MEMORY];

    let done = stage::run(black_box(ASSET), Level::Scalar, NUMBERS, &mut Marks(0));
    debug::exit(if done.is_ok() {
        debug::EXIT_SUCCESS
    } else {
        debug::EXIT_FAILURE
    });
    loop {
        cortex_m::asm::wfi();
    }
}

/// How many frames have been marked.
struct Marks(u32);

impl Probe for Marks {
    fn count<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        if name != "frame" {
            return work();
        }
        if self.0 == FRAMES {
            debug::exit(debug::EXIT_SUCCESS);
        }
        self.0 += 1;
        frame_begins(self.0);
        let result = work();
        frame_ends(self.0);
        result
    }

    fn number(&mut self, name: &'static str, value: u64) {
        if name.starts_with("bound_") {
            if let Ok(mut out) = hio::hstdout() {
                let _ = writeln!(out, "{name} = {value}");
            }
        }
    }

    fn per(&mut self, _: &'static str, _: &'static str, _: &'static str, _: u64) {}
}

#[unsafe(no_mangle)]
#[inline(never)]
fn frame_begins(frame: u32) {
    black_box(frame);
}

#[unsafe(no_mangle)]
#[inline(never)]
fn frame_ends(frame: u32) {
    black_box(!frame);
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}
