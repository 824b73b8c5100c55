//! Blocks through a blend to the output.
//!
//! Everything here is inlined into one function for each instruction set, which is where vector
//! instructions exist. Closures and `array::map` may stay outside of it, hence plain loops.

use core::ops::Range;

use super::Level;
use super::lanes::Lanes;
use super::linear::Linear;
use super::output::Output;
use super::store::{Packed, Scattered, Store, Strided};
use crate::asset::{Asset, LANES, Lanes3};
use crate::math::Affine12;

/// Skins a range of blocks: `v = (sum_i w_i M_i D_i^-1) v_d`, normals by the same matrix without
/// its translation, then to unit length (exact for rotation and uniform scale).
///
/// `palette: [binds]` from [`crate::pose::palette`]; `blocks` is cut to those that exist. Vertices
/// outside the range are not touched. O(slots + vertices)
pub fn skin_blocks(
    asset: &Asset<'_>,
    palette: &[Affine12],
    blocks: Range<usize>,
    level: Level,
    output: &mut Output<'_>,
) {
    let end = blocks.end.min(asset.dims().block_count);
    let job = Job {
        asset,
        blend: Linear { palette },
        blocks: blocks.start.min(end)..end,
    };
    match level {
        Level::Scalar => scalar(&job, output),
        #[cfg(feature = "simd")]
        Level::Simd(level) => {
            // A short last block is not worth a vector kernel that can leave lanes out.
            let full = asset.dims().vertex_count / LANES;
            let middle = job.blocks.end.min(full.max(job.blocks.start));
            let (first, last) = (job.blocks.start..middle, middle..job.blocks.end);
            let job = Job {
                blocks: first,
                ..job
            };
            fearless_simd::dispatch!(level, simd => by_width(simd, &job, output));
            scalar(
                &Job {
                    blocks: last,
                    ..job
                },
                output,
            );
        }
    }
}

/// Blocks that exist, and how they are moved.
pub(super) struct Job<'j, 'a, B> {
    pub asset: &'j Asset<'a>,
    pub blend: B,
    pub blocks: Range<usize>,
}

/// Finds a matrix for each lane of a block.
pub(super) trait Blend {
    /// Rows of 3 x 4 for lanes `first..first + L::WIDTH` of a block with these slots.
    fn matrix<L: Lanes>(&self, token: L::Token, slots: Slots<'_>, first: usize) -> [L; 12];
}

/// (bind, weights) of a block's slots, as two slices of one length.
#[derive(Clone, Copy)]
pub(super) struct Slots<'a> {
    pub binds: &'a [u16],
    pub weights: &'a [[u16; LANES]],
}

fn scalar<B: Blend>(job: &Job<'_, '_, B>, output: &mut Output<'_>) {
    blocks_by::<f32, _, _>((), job, &mut Strided::new(job.asset, output));
}

#[cfg(feature = "simd")]
#[inline(always)]
fn by_width<S: fearless_simd::Simd, B: Blend>(
    simd: S,
    job: &Job<'_, '_, B>,
    output: &mut Output<'_>,
) {
    use fearless_simd::SimdBase;
    // Twelve sums must stay in registers: eight lanes only where one register holds them.
    if S::f32s::LEN >= LANES {
        by_layout::<fearless_simd::f32x8<S>, B>(simd, job, output);
    } else {
        by_layout::<fearless_simd::f32x4<S>, B>(simd, job, output);
    }
}

#[cfg(feature = "simd")]
#[inline(always)]
fn by_layout<L: Lanes, B: Blend>(token: L::Token, job: &Job<'_, '_, B>, output: &mut Output<'_>) {
    if let Some(mut store) = Packed::new(output) {
        blocks_by::<L, _, _>(token, job, &mut store);
    } else if let Some(mut store) = Scattered::new(job.asset, output) {
        blocks_by::<L, _, _>(token, job, &mut store);
    } else {
        blocks_by::<L, _, _>(token, job, &mut Strided::new(job.asset, output));
    }
}

#[inline(always)]
fn blocks_by<L: Lanes, B: Blend, S: Store>(token: L::Token, job: &Job<'_, '_, B>, store: &mut S) {
    let asset = job.asset;
    let blocks = job.blocks.clone();
    let starts = asset.block_slots.get(blocks.clone()).unwrap_or_default();
    let ends = asset
        .block_slots
        .get(blocks.start + 1..)
        .unwrap_or_default();
    let positions = asset.positions.get(blocks.clone()).unwrap_or_default();
    let normals = asset.normals.get(blocks.clone()).unwrap_or_default();
    let wants_normals = store.wants_normals();
    let rows = starts.iter().zip(ends).zip(positions).zip(normals);
    for (block, (((&start, &end), positions), normals)) in blocks.zip(rows) {
        let range = start as usize..end as usize;
        let slots = Slots {
            binds: asset.slot_binds.get(range.clone()).unwrap_or_default(),
            weights: asset.slot_weights.get(range).unwrap_or_default(),
        };
        for first in (0..LANES).step_by(L::WIDTH) {
            let matrix = job.blend.matrix::<L>(token, slots, first);
            store.positions(block, first, move_points(token, &matrix, positions, first));
            if wants_normals {
                store.normals(block, first, turn(token, &matrix, normals, first));
            }
        }
    }
}

#[inline(always)]
fn load<L: Lanes>(token: L::Token, from: &Lanes3, first: usize) -> [L; 3] {
    [
        L::load(token, &from[0], first),
        L::load(token, &from[1], first),
        L::load(token, &from[2], first),
    ]
}

#[inline(always)]
fn move_points<L: Lanes>(token: L::Token, m: &[L; 12], points: &Lanes3, first: usize) -> [L; 3] {
    let [x, y, z] = load::<L>(token, points, first);
    [
        m[0].mul(x).add(m[1].mul(y)).add(m[2].mul(z)).add(m[3]),
        m[4].mul(x).add(m[5].mul(y)).add(m[6].mul(z)).add(m[7]),
        m[8].mul(x).add(m[9].mul(y)).add(m[10].mul(z)).add(m[11]),
    ]
}

/// Directions at unit length.
#[inline(always)]
fn turn<L: Lanes>(token: L::Token, m: &[L; 12], directions: &Lanes3, first: usize) -> [L; 3] {
    let [x, y, z] = load::<L>(token, directions, first);
    let turned = [
        m[0].mul(x).add(m[1].mul(y)).add(m[2].mul(z)),
        m[4].mul(x).add(m[5].mul(y)).add(m[6].mul(z)),
        m[8].mul(x).add(m[9].mul(y)).add(m[10].mul(z)),
    ];
    let [x, y, z] = turned;
    let length2 = x.mul(x).add(y.mul(y)).add(z.mul(z));
    // A normal blended to nothing stays nothing instead of becoming infinite.
    let factor = length2
        .add(L::splat(token, SMALLEST_LENGTH2))
        .inverse_sqrt(token);
    [x.mul(factor), y.mul(factor), z.mul(factor)]
}

/// Added to squared lengths: far below one, far above where a reciprocal would overflow.
pub(super) const SMALLEST_LENGTH2: f32 = 1e-20;
