//! Runs one stage over the asset in flash and prints what that costs, as TOML.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hio};
use sinew_core::asset::crc32;
use sinew_core::deform::Level;
use sinew_cortex_m::counter::Counter;
use sinew_cortex_m::report::Report;
use sinew_cortex_m::{ASSET, MEMORY, stage};

#[entry]
fn main() -> ! {
    static mut NUMBERS: [f32; MEMORY] = [0.0; MEMORY];

    let status = match measure(NUMBERS) {
        Ok(()) => debug::EXIT_SUCCESS,
        Err(()) => debug::EXIT_FAILURE,
    };
    loop {
        debug::exit(status);
    }
}

/// Says why where it fails.
fn measure(numbers: &mut [f32]) -> Result<(), ()> {
    let mut fault = hio::hstderr()?;
    let Some(peripherals) = cortex_m::Peripherals::take() else {
        let _ = writeln!(fault, "the system timer is taken");
        return Err(());
    };
    let mut report = Report::new(Counter::start(peripherals.SYST));
    // The compiler must not prepare anything from bytes that it knows.
    let hash = match stage::run(black_box(ASSET), Level::Scalar, numbers, &mut report) {
        Ok(hash) => hash,
        Err(error) => {
            let _ = writeln!(fault, "{error}");
            return Err(());
        }
    };
    let mut out = hio::hstdout()?;
    let mut print = || {
        report.print(&mut out)?;
        writeln!(out, "compiler = \"{}\"", env!("SINEW_COMPILER"))?;
        writeln!(out, "asset = \"{:08x}\"", crc32(ASSET))?;
        writeln!(out, "fingerprint = \"{hash:016x}\"")
    };
    print().map_err(|core::fmt::Error| {
        let _ = writeln!(fault, "more rows than the report holds, or no console");
    })
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    if let Ok(mut out) = hio::hstderr() {
        let _ = writeln!(out, "{info}");
    }
    loop {
        debug::exit(debug::EXIT_FAILURE);
    }
}
