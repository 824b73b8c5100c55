//! A kernel over blocks of eight vertices, on every instruction set and into every layout.

use core::ops::Range;

use super::Level;
use super::lanes::Lanes;
use super::output::Output;
#[cfg(feature = "simd")]
use super::store::{Packed, Scattered};
use super::store::{Rows, Store, Strided};
use crate::asset::LANES;

/// Computes the vertices of blocks that exist.
pub(super) trait Kernel {
    /// Whether the kernel is worth a second copy for packed outputs, where code is scarce.
    const IS_COMMON: bool = false;
    /// `[vertices]`: the source's number of each lane, block after block.
    fn order(&self) -> &[u32];
    /// Works `L::WIDTH` lanes at a time.
    fn blocks<L: Lanes, S: Store>(&self, token: L::Token, blocks: Range<usize>, store: &mut S);
    /// The same bits without vector instructions.
    #[inline(always)]
    fn scalar_blocks<S: Store>(&self, blocks: Range<usize>, store: &mut S) {
        self.blocks::<[f32; 2], S>((), blocks, store);
    }
}

/// Runs a kernel over a range of blocks, which is cut to those that exist.
pub(super) fn run<K: Kernel>(
    kernel: &K,
    blocks: Range<usize>,
    level: Level,
    output: &mut Output<'_>,
) {
    let end = blocks.end.min(kernel.order().len().div_ceil(LANES));
    let blocks = blocks.start.min(end)..end;
    match level {
        Level::Scalar => scalar(kernel, blocks, output),
        #[cfg(feature = "simd")]
        Level::Simd(level) => {
            // Vector kernels write whole blocks; the last one may be short.
            let middle = (kernel.order().len() / LANES).clamp(blocks.start, blocks.end);
            let (whole, short) = (blocks.start..middle, middle..blocks.end);
            fearless_simd::dispatch!(level, simd => by_width(simd, kernel, whole, output));
            scalar(kernel, short, output);
        }
    }
}

fn scalar<K: Kernel>(kernel: &K, blocks: Range<usize>, output: &mut Output<'_>) {
    // What is asked for most gets the fastest store.
    if K::IS_COMMON
        && let Some(mut store) = Rows::new(kernel.order(), output)
    {
        kernel.scalar_blocks(blocks, &mut store);
    } else {
        kernel.scalar_blocks(blocks, &mut Strided::new(kernel.order(), output));
    }
}

#[cfg(feature = "simd")]
#[inline(always)]
fn by_width<S: fearless_simd::Simd, K: Kernel>(
    simd: S,
    kernel: &K,
    blocks: Range<usize>,
    output: &mut Output<'_>,
) {
    use fearless_simd::SimdBase;
    // The sums must stay in registers: eight lanes only where one register holds them.
    if S::f32s::LEN >= LANES {
        by_layout::<fearless_simd::f32x8<S>, K>(simd, kernel, blocks, output);
    } else {
        by_layout::<fearless_simd::f32x4<S>, K>(simd, kernel, blocks, output);
    }
}

#[cfg(feature = "simd")]
#[inline(always)]
fn by_layout<L: Lanes, K: Kernel>(
    token: L::Token,
    kernel: &K,
    blocks: Range<usize>,
    output: &mut Output<'_>,
) {
    if let Some(mut store) = Packed::new(output) {
        kernel.blocks::<L, _>(token, blocks, &mut store);
    } else if let Some(mut store) = Scattered::new(kernel.order(), output) {
        kernel.blocks::<L, _>(token, blocks, &mut store);
    } else {
        kernel.blocks::<L, _>(token, blocks, &mut Strided::new(kernel.order(), output));
    }
}
