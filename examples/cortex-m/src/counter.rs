//! Instructions executed, by the system timer.
//!
//! QEMU with `-icount shift=0` lets virtual time advance by a nanosecond an instruction, so the
//! timer ticks every so many instructions; on a board it counts clock cycles.

use core::arch::asm;

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;

const LAST: u32 = 0x00FF_FFFF;

/// A running timer that knows how many instructions a tick stands for.
pub struct Counter {
    calibration: u64,
}

impl Counter {
    /// Starts the timer and finds its rate by a loop of known length.
    pub fn start(mut timer: SYST) -> Self {
        timer.set_clock_source(SystClkSource::Core);
        timer.set_reload(LAST);
        timer.clear_current();
        timer.enable_counter();
        let start = SYST::get_current();
        spin();
        Self {
            calibration: u64::from(ticks_since(start)).max(1),
        }
    }

    /// Instructions of one call. At most 2^24 ticks, to a tick.
    pub fn count<T>(&self, work: impl FnOnce() -> T) -> (T, u64) {
        let start = SYST::get_current();
        let result = work();
        let ticks = ticks_since(start);
        (result, u64::from(ticks) * SPIN / self.calibration)
    }

    /// Instructions a tick, times 1000.
    pub fn milli_rate(&self) -> u64 {
        SPIN * 1000 / self.calibration
    }
}

fn ticks_since(start: u32) -> u32 {
    // It counts down.
    start.wrapping_sub(SYST::get_current()) & LAST
}

/// Instructions of [`spin`].
const SPIN: u64 = 2 * SPIN_ROUNDS as u64;
const SPIN_ROUNDS: u32 = 2_000_000;

fn spin() {
    // SAFETY: touches one register and the flags.
    unsafe {
        asm!(
            "2: subs {rounds}, #1",
            "bne 2b",
            rounds = inout(reg) SPIN_ROUNDS => _,
            options(nomem, nostack)
        );
    }
}
