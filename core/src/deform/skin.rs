//! Blocks through a blend to the output.
//!
//! Everything here is inlined into one function for each instruction set, which is where vector
//! instructions exist. Closures and `array::map` may stay outside of it, hence plain loops.

use core::ops::Range;

use super::Level;
use super::lanes::Lanes;
use super::linear::Linear;
use super::output::Output;
#[cfg(feature = "simd")]
use super::store::{Packed, Scattered};
use super::store::{Store, Strided};
use crate::asset::{Asset, LANES, Lanes3};
use crate::math::{Affine12, IDENTITY, inverse_sqrt};

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
    /// The matrix of a block that hangs on one bind.
    fn rigid(&self, bind: u16) -> &Affine12;
    /// Rows of 3 x 4 for lanes `first..first + L::WIDTH` of a block with these slots, two or more.
    fn matrix<L: Lanes>(&self, token: L::Token, slots: Slots<'_>, first: usize) -> [L; 12];
}

/// (bind, weights) of a block's slots, as two slices of one length.
#[derive(Clone, Copy)]
pub(super) struct Slots<'a> {
    pub binds: &'a [u16],
    pub weights: &'a [[u16; LANES]],
}

fn scalar<B: Blend>(job: &Job<'_, '_, B>, output: &mut Output<'_>) {
    blocks_by::<[f32; 2], _, _>((), job, &mut Strided::new(job.asset.source_order(), output));
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
    } else if let Some(mut store) = Scattered::new(job.asset.source_order(), output) {
        blocks_by::<L, _, _>(token, job, &mut store);
    } else {
        blocks_by::<L, _, _>(
            token,
            job,
            &mut Strided::new(job.asset.source_order(), output),
        );
    }
}

#[inline(always)]
fn blocks_by<L: Lanes, B: Blend, S: Store>(token: L::Token, job: &Job<'_, '_, B>, store: &mut S) {
    for run in job.asset.runs() {
        let first = run.blocks.start.max(job.blocks.start);
        let end = run.blocks.end.min(job.blocks.end);
        let skipped = first.saturating_sub(run.blocks.start) * run.slots;
        let part = Part {
            first,
            slots: run.slots,
            binds: run.binds.get(skipped..).unwrap_or_default(),
            weights: run.weights.get(skipped..).unwrap_or_default(),
            positions: job.asset.positions.get(first..end).unwrap_or_default(),
            normals: job.asset.normals.get(first..end).unwrap_or_default(),
        };
        if run.slots == 1 {
            rigid_blocks::<L::Part, B, S>(token, &job.blend, &part, store);
        } else {
            blended_blocks::<L, B, S>(token, &job.blend, &part, store);
        }
    }
}

/// Blocks of one run.
struct Part<'a> {
    first: usize,
    slots: usize,
    binds: &'a [u16],
    weights: &'a [[u16; LANES]],
    positions: &'a [Lanes3],
    normals: &'a [Lanes3],
}

#[inline(always)]
fn blended_blocks<L: Lanes, B: Blend, S: Store>(
    token: L::Token,
    blend: &B,
    part: &Part<'_>,
    store: &mut S,
) {
    let slots = part.slots.max(1);
    let wants_normals = store.wants_normals();
    let slots = part
        .binds
        .chunks_exact(slots)
        .zip(part.weights.chunks_exact(slots));
    let rest = part.positions.iter().zip(part.normals);
    // The square root of a block waits for long chains of operations. Among vectors it comes
    // after the sums of the next block, by which time its input is ready and it delays nothing.
    let mut waiting = None;
    for (block, ((positions, normals), (binds, weights))) in (part.first..).zip(rest.zip(slots)) {
        for first in (0..LANES).step_by(L::WIDTH) {
            let sums = blend.matrix::<L>(token, Slots { binds, weights }, first);
            for part in (0..L::WIDTH).step_by(L::Part::WIDTH) {
                let matrix = some_lanes(token, &sums, part);
                let first = first + part;
                let position = load(token, positions, first);
                store.positions(block, first, move_point(&matrix, position));
                if !wants_normals {
                    continue;
                }
                let normal = (block, first, turn(&matrix, load(token, normals, first)));
                let normal = if L::Part::WIDTH > 1 {
                    waiting.replace(normal)
                } else {
                    Some(normal)
                };
                if let Some((block, first, normal)) = normal {
                    store.normals(block, first, to_unit_length(token, normal));
                }
            }
        }
    }
    if let Some((block, first, normal)) = waiting {
        store.normals(block, first, to_unit_length(token, normal));
    }
}

#[inline(always)]
fn some_lanes<L: Lanes>(token: L::Token, sums: &[L; 12], first: usize) -> [L::Part; 12] {
    let mut lanes = [L::Part::splat(token, 0.0); 12];
    for (lanes, sum) in lanes.iter_mut().zip(sums) {
        *lanes = sum.part(first);
    }
    lanes
}

/// Blocks that hang on one bind, whose weight is one: the same in every mode.
#[inline(always)]
fn rigid_blocks<L: Lanes, B: Blend, S: Store>(
    token: L::Token,
    blend: &B,
    part: &Part<'_>,
    store: &mut S,
) {
    let wants_normals = store.wants_normals();
    let rest = part.positions.iter().zip(part.normals);
    let mut held = None;
    let mut rigid = Rigid::of(&IDENTITY);
    for (block, (&bind, (positions, normals))) in (part.first..).zip(part.binds.iter().zip(rest)) {
        if held != Some(bind) {
            held = Some(bind);
            rigid = Rigid::of(blend.rigid(bind));
        }
        let mut matrix = [L::splat(token, 0.0); 12];
        for first in (0..LANES).step_by(L::WIDTH) {
            for (lanes, &value) in matrix.iter_mut().zip(&rigid.matrix) {
                *lanes = L::splat(token, value);
            }
            let position = load::<L>(token, positions, first);
            store.positions(block, first, move_point(&matrix, position));
            if wants_normals {
                for (lanes, &value) in matrix.iter_mut().zip(&rigid.normals) {
                    *lanes = L::splat(token, value);
                }
                let mut normal = turn(&matrix, load::<L>(token, normals, first));
                if !rigid.keeps_length {
                    normal = to_unit_length(token, normal);
                }
                store.normals(block, first, normal);
            }
        }
    }
}

/// The matrix of a bind, and what it does to normals.
struct Rigid {
    matrix: Affine12,
    normals: Affine12,
    /// Whether `normals` leaves unit vectors at unit length.
    keeps_length: bool,
}

impl Rigid {
    /// A rotation with a uniform scale, divided by that, keeps the length of normals, which saves
    /// a square root for each.
    #[inline]
    fn of(matrix: &Affine12) -> Self {
        let &[ax, bx, cx, _, ay, by, cy, _, az, bz, cz, _] = matrix;
        let [aa, bb, cc] = [
            ax * ax + ay * ay + az * az,
            bx * bx + by * by + bz * bz,
            cx * cx + cy * cy + cz * cz,
        ];
        let odd = [
            aa - bb,
            aa - cc,
            ax * bx + ay * by + az * bz,
            ax * cx + ay * cy + az * cz,
            bx * cx + by * cy + bz * cz,
        ];
        let limit = UNIFORM * aa;
        let mut keeps_length = (1e-12..=1e12).contains(&aa);
        for value in odd {
            keeps_length &= (-limit..=limit).contains(&value);
        }
        let mut normals = *matrix;
        if keeps_length {
            let factor = inverse_sqrt(aa);
            for value in &mut normals {
                *value *= factor;
            }
        }
        Self {
            matrix: *matrix,
            normals,
            keeps_length,
        }
    }
}

/// How far columns of a matrix, relative to their squared length, may be from equally long and
/// perpendicular: a hundred times the rounding of a chain of joints.
const UNIFORM: f32 = 1e-5;

#[inline(always)]
fn load<L: Lanes>(token: L::Token, from: &Lanes3, first: usize) -> [L; 3] {
    [
        L::load(token, &from[0], first),
        L::load(token, &from[1], first),
        L::load(token, &from[2], first),
    ]
}

/// Column by column from the translation on: so few registers hold numbers at once that none
/// goes to memory.
#[inline(always)]
fn move_point<L: Lanes>(m: &[L; 12], [x, y, z]: [L; 3]) -> [L; 3] {
    let mut moved = [m[3], m[7], m[11]];
    for (column, coordinate) in [x, y, z].into_iter().enumerate() {
        for (sum, row) in moved.iter_mut().zip(m.as_chunks::<4>().0) {
            *sum = sum.add(row[column].mul(coordinate));
        }
    }
    moved
}

#[inline(always)]
fn turn<L: Lanes>(m: &[L; 12], [x, y, z]: [L; 3]) -> [L; 3] {
    let mut turned = [m[0].mul(x), m[4].mul(x), m[8].mul(x)];
    for (column, coordinate) in [(1, y), (2, z)] {
        for (sum, row) in turned.iter_mut().zip(m.as_chunks::<4>().0) {
            *sum = sum.add(row[column].mul(coordinate));
        }
    }
    turned
}

#[inline(always)]
pub(super) fn to_unit_length<L: Lanes>(token: L::Token, [x, y, z]: [L; 3]) -> [L; 3] {
    let length2 = x.mul(x).add(y.mul(y)).add(z.mul(z));
    // A normal blended to nothing stays nothing instead of becoming infinite.
    let factor = length2
        .add(L::splat(token, SMALLEST_LENGTH2))
        .rough_inverse_sqrt(token);
    [x.mul(factor), y.mul(factor), z.mul(factor)]
}

/// Added to squared lengths: far below one, far above where a reciprocal would overflow.
pub(super) const SMALLEST_LENGTH2: f32 = 1e-20;
