//! Stack used by a call: the memory below is painted, then searched for the lowest change.

use cortex_m::register::msp;

unsafe extern "C" {
    /// Lowest address that the stack may reach, from the linker script.
    static _stack_end: u32;
}

const PAINT: u32 = 0xC5C5_C5C5;
/// Far more than a frame uses, so that painting stays quick.
const DEPTH: usize = 16 << 10;

/// Bytes of stack that a call uses, its return address included.
#[inline(never)]
pub fn depth<T>(work: impl FnOnce() -> T) -> (T, usize) {
    let top = msp::read() as usize;
    let bottom = (top - DEPTH).max(&raw const _stack_end as usize);
    for address in (bottom..top).step_by(4) {
        // SAFETY: below the stack pointer and above everything else in memory; nothing lives
        // there. This loop calls nothing.
        unsafe { (address as *mut u32).write_volatile(PAINT) }
    }
    let result = apart(work);
    let untouched = (bottom..top)
        .step_by(4)
        // SAFETY: as above; reading.
        .take_while(|&address| unsafe { (address as *const u32).read_volatile() } == PAINT)
        .count();
    (result, top - bottom - 4 * untouched)
}

/// A call with a frame of its own, below the paint's upper end.
#[inline(never)]
fn apart<T>(work: impl FnOnce() -> T) -> T {
    work()
}
