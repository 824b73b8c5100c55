//! Blocks through a blend to the output.
//!
//! Everything here is inlined into one function for each instruction set, which is where vector
//! instructions exist. Closures and `array::map` may stay outside of it, hence plain loops.

use core::ops::Range;

use super::lanes::Lanes;
use super::output::Output;
use super::rest::{ORIGIN, Rest, RestShape, Room};
use super::rigid::Rigid;
#[cfg(feature = "simd")]
use super::store::{Packed, Scattered};
use super::store::{Rows, Store, Strided};
use crate::asset::{LANES, Lanes3};
use crate::math::{Affine12, IDENTITY};

/// Blocks that exist, and how they are moved.
pub(super) struct Task<'j, 'a, B, N = Either> {
    pub shape: RestShape<'j, 'a>,
    pub blend: B,
    pub normals: N,
    pub blocks: Range<usize>,
}

/// What moves normals, known to the compiler or not.
pub(super) trait Normals: Copy {
    /// Whether the inverse transpose does.
    fn are_exact(self) -> bool;
}

/// Known when the program runs.
#[derive(Clone, Copy)]
pub(super) struct Either {
    pub exact: bool,
}

/// Known beforehand. Without vectors both ways together would leave no register free.
#[derive(Clone, Copy)]
struct Always<const EXACT: bool>;

impl Normals for Either {
    #[inline(always)]
    fn are_exact(self) -> bool {
        self.exact
    }
}

impl<const EXACT: bool> Normals for Always<EXACT> {
    #[inline(always)]
    fn are_exact(self) -> bool {
        EXACT
    }
}

/// Finds a matrix for each lane of a block.
pub(super) trait Blend: Copy {
    /// Whether the kernel is worth a second copy for packed outputs, where code is scarce.
    const IS_COMMON: bool = false;
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
    #[cfg(feature = "modes")]
    if job.normals.exact {
        return scalar_by(job, Always::<true>, output);
    }
    scalar_by(job, Always::<false>, output);
}

/// A function of its own for every blend: together they would fight for registers.
#[inline(never)]
fn scalar_by<B: Blend, N: Normals>(job: &Task<'_, '_, B>, normals: N, output: &mut Output<'_>) {
    let job = Task {
        shape: job.shape,
        blend: job.blend,
        normals,
        blocks: job.blocks.clone(),
    };
    let order = job.shape.asset.source_order();
    // What is asked for most gets the fastest store, the rest less code.
    if B::IS_COMMON
        && !normals.are_exact()
        && let Some(mut store) = Rows::new(order, output)
    {
        blocks_by::<[f32; 2], _, _, _>((), &job, &mut store);
    } else {
        blocks_by::<[f32; 2], _, _, _>((), &job, &mut Strided::new(order, output));
    }
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
        blocks_by::<L, _, _, _>(token, job, &mut store);
    } else if let Some(mut store) = Scattered::new(job.shape.asset.source_order(), output) {
        blocks_by::<L, _, _, _>(token, job, &mut store);
    } else {
        blocks_by::<L, _, _, _>(
            token,
            job,
            &mut Strided::new(job.shape.asset.source_order(), output),
        );
    }
}

#[inline(always)]
fn blocks_by<L: Lanes, B: Blend, N: Normals, S: Store>(
    token: L::Token,
    job: &Task<'_, '_, B, N>,
    store: &mut S,
) {
    let asset = job.shape.asset;
    let mut blended = 0;
    for run in asset.runs() {
        let first = run.blocks.start.max(job.blocks.start);
        let end = run.blocks.end.min(job.blocks.end);
        let skipped = first.saturating_sub(run.blocks.start);
        let part = Part {
            blocks: first..end,
            slots: run.slots,
            binds: run.binds.get(skipped * run.slots..).unwrap_or_default(),
            weights: run.weights.get(skipped * run.slots..).unwrap_or_default(),
            centres: asset.centres.get(blended + skipped..).unwrap_or_default(),
        };
        if run.slots == 1 {
            rigid_blocks::<L::Part, B, N, S>(token, job, part, store);
        } else {
            blended_blocks::<L, B, N, S>(token, job, part, store);
            blended += run.blocks.len();
        }
    }
}

/// Blocks of one run.
struct Part<'a> {
    blocks: Range<usize>,
    slots: usize,
    binds: &'a [u16],
    weights: &'a [[u16; LANES]],
    centres: &'a [Lanes3],
}

#[inline(always)]
fn blended_blocks<L: Lanes, B: Blend, N: Normals, S: Store>(
    token: L::Token,
    job: &Task<'_, '_, B, N>,
    part: Part<'_>,
    store: &mut S,
) {
    let wants_normals = store.wants_normals();
    let slots = part.slots.max(1);
    let binds = part.binds.chunks_exact(slots);
    let slots = binds.zip(part.weights.chunks_exact(slots));
    let mut centres = part.centres.iter();
    let mut room = Room::new();
    // The square root of a block waits for long chains of operations. Among vectors it comes
    // after the sums of the next block, by which time its input is ready and it delays nothing.
    let mut waiting = None;
    for (block, (binds, weights)) in part.blocks.zip(slots) {
        let centre = centres.next().unwrap_or(&ORIGIN);
        let slots = Slots {
            binds,
            weights,
            centre,
        };
        let rest = job.shape.block::<L>(token, block, &mut room);
        for first in (0..LANES).step_by(L::WIDTH) {
            let sums = job.blend.matrix::<L>(token, &slots, first);
            let place = (block, first);
            if L::Part::WIDTH == 1 {
                // Written out, or the second would be chosen number by number.
                single::<L, B, N, S>(token, job, store, &sums, &rest, place, 0);
                single::<L, B, N, S>(token, job, store, &sums, &rest, place, 1);
                continue;
            }
            let matrix = some_lanes(token, &sums, 0);
            tangents(token, job, store, &matrix, place);
            let rest_position = L::Part::load3(token, rest.positions, first);
            store.positions(block, first, move_point(&matrix, rest_position));
            if wants_normals {
                let normal = turned(token, job, &matrix, &rest, first);
                if let Some(((block, first), normal)) = waiting.replace((place, normal)) {
                    store.normals(block, first, to_unit_length(token, normal));
                }
            }
        }
    }
    if let Some(((block, first), normal)) = waiting {
        store.normals(block, first, to_unit_length(token, normal));
    }
}

/// One vertex of those whose matrices were summed.
#[inline(always)]
fn single<L: Lanes, B: Blend, N: Normals, S: Store>(
    token: L::Token,
    job: &Task<'_, '_, B, N>,
    store: &mut S,
    sums: &[L; 12],
    rest: &Rest<'_>,
    (block, first): (usize, usize),
    at: usize,
) {
    let matrix = some_lanes(token, sums, at);
    let first = first + at;
    tangents(token, job, store, &matrix, (block, first));
    let position = move_point(&matrix, L::Part::load3(token, rest.positions, first));
    if store.wants_normals() {
        let normal = turned(token, job, &matrix, rest, first);
        store.vertices(block, first, position, to_unit_length(token, normal));
    } else {
        store.positions(block, first, position);
    }
}

/// Normals as the mode wants them, of any length.
#[inline(always)]
pub(super) fn turned<L: Lanes, B, N: Normals>(
    token: L::Token,
    job: &Task<'_, '_, B, N>,
    matrix: &[L; 12],
    rest: &Rest<'_>,
    first: usize,
) -> [L; 3] {
    let mut normal = L::load3(token, rest.normals, first);
    if job.normals.are_exact() {
        if !job.shape.has_unit_normals() {
            // A power of two: products of three numbers of a matrix stay in range.
            let small = L::splat(token, 1.0 / 32768.0);
            for axis in &mut normal {
                *axis = axis.mul(small);
            }
        }
        turn_exactly(token, matrix, normal)
    } else {
        turn(matrix, normal)
    }
}

/// Tangents lie in the surface, so the matrix of the position is right for them in every mode.
#[inline(always)]
fn tangents<L: Lanes, B, N, S: Store>(
    token: L::Token,
    job: &Task<'_, '_, B, N>,
    store: &mut S,
    matrix: &[L; 12],
    (block, first): (usize, usize),
) {
    if store.wants_tangents()
        && let Some((rest, signs)) = job.shape.tangents::<L>(token, block, first)
    {
        let tangent = to_unit_length(token, turn(matrix, rest));
        store.tangents(block, first, tangent, signs);
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
fn rigid_blocks<L: Lanes, B: Blend, N: Normals, S: Store>(
    token: L::Token,
    job: &Task<'_, '_, B, N>,
    part: Part<'_>,
    store: &mut S,
) {
    let wants_normals = store.wants_normals();
    let mut room = Room::new();
    let mut held = None;
    let mut rigid = Rigid::of(&IDENTITY, false);
    for (block, &bind) in part.blocks.zip(part.binds) {
        if held != Some(bind) {
            held = Some(bind);
            rigid = Rigid::of(job.blend.rigid(bind), job.normals.are_exact());
        }
        let keeps_length = rigid.keeps_length && job.shape.has_unit_normals();
        let rest = job.shape.block::<L>(token, block, &mut room);
        let mut matrix = [L::splat(token, 0.0); 12];
        for first in (0..LANES).step_by(L::WIDTH) {
            for (lanes, &value) in matrix.iter_mut().zip(&rigid.matrix) {
                *lanes = L::splat(token, value);
            }
            tangents(token, job, store, &matrix, (block, first));
            let position = move_point(&matrix, L::load3(token, rest.positions, first));
            if !wants_normals {
                store.positions(block, first, position);
                continue;
            }
            for (lanes, &value) in matrix.iter_mut().zip(&rigid.normals) {
                *lanes = L::splat(token, value);
            }
            let mut normal = turn(&matrix, L::load3(token, rest.normals, first));
            if !keeps_length {
                normal = to_unit_length(token, normal);
            }
            store.vertices(block, first, position, normal);
        }
    }
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
pub(super) fn turn_exactly<L: Lanes>(token: L::Token, m: &[L; 12], normal: [L; 3]) -> [L; 3] {
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
