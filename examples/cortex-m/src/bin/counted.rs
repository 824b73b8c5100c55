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

/// Frames of each name that are marked; all others run unmarked.
const FRAMES: u32 = 6;
/// Names that are told apart.
const NAMES: usize = 8;

#[entry]
fn main() -> ! {
    static mut NUMBERS: [f32; MEMORY] = [0.0; MEMORY];

    let done = stage::run(
        black_box(ASSET),
        Level::Scalar,
        NUMBERS,
        &mut Marks::default(),
    );
    debug::exit(if done.is_ok() {
        debug::EXIT_SUCCESS
    } else {
        debug::EXIT_FAILURE
    });
    loop {
        cortex_m::asm::wfi();
    }
}

/// How many frames have been marked, in all and by name.
#[derive(Default)]
struct Marks {
    all: u32,
    names: [(&'static str, u32); NAMES],
}

impl Probe for Marks {
    fn count<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        let mut rows = self.names.iter_mut();
        let row = rows.find(|(known, _)| known.is_empty() || *known == name);
        let Some((known, marked)) = row.filter(|(_, marked)| *marked < FRAMES) else {
            return work();
        };
        *known = name;
        *marked += 1;
        self.all += 1;
        print("frame_", self.all, name);
        frame_begins(self.all);
        let result = work();
        frame_ends(self.all);
        result
    }

    fn number(&mut self, name: &'static str, value: u64) {
        if name.starts_with("bound_") {
            print(name, "", value);
        }
    }

    fn per(&mut self, _: &'static str, _: &'static str, _: &'static str, _: u64) {}
}

fn print(name: &str, more: impl core::fmt::Display, value: impl core::fmt::Display) {
    if let Ok(mut out) = hio::hstdout() {
        let _ = writeln!(out, "{name}{more} = {value}");
    }
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
