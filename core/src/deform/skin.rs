//! Blocks through a blend to the output.
//!
//! Everything here is inlined into one function for each instruction set, which is where vector
//! instructions exist. Closures and `array::map` may stay outside of it, hence plain loops.

use core::ops::Range;

use super::lanes::Lanes;
use super::morph::Morphs;
use super::output::Output;
use super::rigid::Rigid;
#[cfg(feature = "simd")]
use super::store::{Packed, Scattered};
use super::store::{Store, Strided};
use crate::asset::{Asset, LANES, Lanes3};
use crate::math::{Affine12, IDENTITY};

/// Blocks that exist, and how they are moved.
pub(super) struct Task<'j, 'a, B> {
    pub asset: &'j Asset<'a>,
    pub blend: &'j B,
    /// `None` where nothing is added to the rest shape.
    pub morphs: Option<Morphs<'j, 'a>>,
    pub exact_normals: bool,
    pub blocks: Range<usize>,
}

impl<B> Task<'_, '_, B> {
    /// Rest positions with what morph targets add.
    #[inline(always)]
    fn position<L: Lanes>(
        &self,
        token: L::Token,
        rest: &Lanes3,
        block: usize,
        first: usize,
    ) -> [L; 3] {
        let rest = load(token, rest, first);
        match &self.morphs {
            Some(morphs) => morphs.positions(token, block, first, rest),
            None => rest,
        }
    }

    /// Rest normals with what morph targets add, at unit length.
    #[inline(always)]
    fn normal<L: Lanes>(
        &self,
        token: L::Token,
        rest: &Lanes3,
        block: usize,
        first: usize,
    ) -> [L; 3] {
        let rest = load(token, rest, first);
        match &self.morphs {
            Some(morphs) => morphs.normals(token, block, first, rest),
            None => rest,
        }
    }
}

/// Finds a matrix for each lane of a block.
pub(super) trait Blend {
    /// The matrix of a block that hangs on one bind.
    fn rigid(&self, bind: u16) -> &Affine12;
    /// Rows of 3 x 4 for lanes `first..first + L::WIDTH` of a block with these slots, two or more.
    fn matrix<L: Lanes>(&self, token: L::Token, slots: &Slots<'_>, first: usize) -> [L; 12];
}

/// (bind, weights) of a block's slots, as two slices of one length, and its centres of rotation.
pub(super) struct Slots<'a> {
    pub binds: &'a [u16],
    pub weights: &'a [[u16; LANES]],
    pub centre: &'a Lanes3,
}

pub(super) fn scalar<B: Blend>(job: &Task<'_, '_, B>, output: &mut Output<'_>) {
    blocks_by::<[f32; 2], _, _>((), job, &mut Strided::new(job.asset.source_order(), output));
}

#[cfg(feature = "simd")]
#[inline(always)]
pub(super) fn by_width<S: fearless_simd::Simd, B: Blend>(
    simd: S,
    job: &Task<'_, '_, B>,
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
fn by_layout<L: Lanes, B: Blend>(token: L::Token, job: &Task<'_, '_, B>, output: &mut Output<'_>) {
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
fn blocks_by<L: Lanes, B: Blend, S: Store>(token: L::Token, job: &Task<'_, '_, B>, store: &mut S) {
    let mut blended = 0;
    for run in job.asset.runs() {
        let first = run.blocks.start.max(job.blocks.start);
        let end = run.blocks.end.min(job.blocks.end);
        let skipped = first.saturating_sub(run.blocks.start);
        let part = Part {
            first,
            slots: run.slots,
            binds: run.binds.get(skipped * run.slots..).unwrap_or_default(),
            weights: run.weights.get(skipped * run.slots..).unwrap_or_default(),
            positions: job.asset.positions.get(first..end).unwrap_or_default(),
            normals: job.asset.normals.get(first..end).unwrap_or_default(),
            centres: job
                .asset
                .centres
                .get(blended + skipped..)
                .unwrap_or_default(),
        };
        if run.slots == 1 {
            rigid_blocks::<L::Part, B, S>(token, job, &part, store);
        } else {
            blended_blocks::<L, B, S>(token, job, &part, store);
            blended += run.blocks.len();
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
    centres: &'a [Lanes3],
}

const ORIGIN: Lanes3 = [[0.0; LANES]; 3];

#[inline(always)]
fn blended_blocks<L: Lanes, B: Blend, S: Store>(
    token: L::Token,
    job: &Task<'_, '_, B>,
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
    for (at, ((positions, normals), (binds, weights))) in rest.zip(slots).enumerate() {
        let block = part.first + at;
        let slots = Slots {
            binds,
            weights,
            centre: part.centres.get(at).unwrap_or(&ORIGIN),
        };
        for first in (0..LANES).step_by(L::WIDTH) {
            let sums = job.blend.matrix::<L>(token, &slots, first);
            for part in (0..L::WIDTH).step_by(L::Part::WIDTH) {
                let matrix = some_lanes(token, &sums, part);
                let first = first + part;
                let position = job.position(token, positions, block, first);
                store.positions(block, first, move_point(&matrix, position));
                if !wants_normals {
                    continue;
                }
                let rest = job.normal(token, normals, block, first);
                let normal = if job.exact_normals {
                    turn_exactly(token, &matrix, rest)
                } else {
                    turn(&matrix, rest)
                };
                let normal = (block, first, normal);
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
    job: &Task<'_, '_, B>,
    part: &Part<'_>,
    store: &mut S,
) {
    let wants_normals = store.wants_normals();
    let rest = part.positions.iter().zip(part.normals);
    let mut held = None;
    let mut rigid = Rigid::of(&IDENTITY, false);
    for (block, (&bind, (positions, normals))) in (part.first..).zip(part.binds.iter().zip(rest)) {
        if held != Some(bind) {
            held = Some(bind);
            rigid = Rigid::of(job.blend.rigid(bind), job.exact_normals);
        }
        let mut matrix = [L::splat(token, 0.0); 12];
        for first in (0..LANES).step_by(L::WIDTH) {
            for (lanes, &value) in matrix.iter_mut().zip(&rigid.matrix) {
                *lanes = L::splat(token, value);
            }
            let position = job.position::<L>(token, positions, block, first);
            store.positions(block, first, move_point(&matrix, position));
            if wants_normals {
                for (lanes, &value) in matrix.iter_mut().zip(&rigid.normals) {
                    *lanes = L::splat(token, value);
                }
                let rest = job.normal::<L>(token, normals, block, first);
                let mut normal = turn(&matrix, rest);
                if !rigid.keeps_length {
                    normal = to_unit_length(token, normal);
                }
                store.normals(block, first, normal);
            }
        }
    }
}

#[inline(always)]
pub(super) fn load<L: Lanes>(token: L::Token, from: &Lanes3, first: usize) -> [L; 3] {
    [
        L::load(token, &from[0], first),
        L::load(token, &from[1], first),
        L::load(token, &from[2], first),
    ]
}

/// Column by column from the translation on: so few registers hold numbers at once that none
/// goes to memory.
#[inline(always)]
pub(super) fn move_point<L: Lanes>(m: &[L; 12], [x, y, z]: [L; 3]) -> [L; 3] {
    let mut moved = [m[3], m[7], m[11]];
    for (column, coordinate) in [x, y, z].into_iter().enumerate() {
        for (sum, row) in moved.iter_mut().zip(m.as_chunks::<4>().0) {
            *sum = sum.add(row[column].mul(coordinate));
        }
    }
    moved
}

#[inline(always)]
pub(super) fn turn<L: Lanes>(m: &[L; 12], [x, y, z]: [L; 3]) -> [L; 3] {
    let mut turned = [m[0].mul(x), m[4].mul(x), m[8].mul(x)];
    for (column, coordinate) in [(1, y), (2, z)] {
        for (sum, row) in turned.iter_mut().zip(m.as_chunks::<4>().0) {
            *sum = sum.add(row[column].mul(coordinate));
        }
    }
    turned
}

/// By the inverse transpose, times the determinant's magnitude: the matrix of cofactors.
#[inline(always)]
fn turn_exactly<L: Lanes>(token: L::Token, m: &[L; 12], normal: [L; 3]) -> [L; 3] {
    let &[a, b, c, _, d, e, f, _, g, h, i, _] = m;
    let rows = [
        [
            e.mul(i).sub(f.mul(h)),
            f.mul(g).sub(d.mul(i)),
            d.mul(h).sub(e.mul(g)),
        ],
        [
            c.mul(h).sub(b.mul(i)),
            a.mul(i).sub(c.mul(g)),
            b.mul(g).sub(a.mul(h)),
        ],
        [
            b.mul(f).sub(c.mul(e)),
            c.mul(d).sub(a.mul(f)),
            a.mul(e).sub(b.mul(d)),
        ],
    ];
    let [[x, y, z], ..] = rows;
    let determinant = a.mul(x).add(b.mul(y)).add(c.mul(z));
    let sign = L::splat(token, 1.0).with_sign(determinant);
    let mut turned = [sign; 3];
    for (to, [x, y, z]) in turned.iter_mut().zip(rows) {
        let [nx, ny, nz] = normal;
        *to = to.mul(x.mul(nx).add(y.mul(ny)).add(z.mul(nz)));
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
