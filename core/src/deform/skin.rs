//! Linear blend skinning over blocks (Mažrimas & Beinaravičius, section 2).

use core::ops::Range;

use super::Level;
use super::lanes::Lanes;
use super::output::{Output, VertexOrder, Writer};
use crate::asset::{Asset, LANES, Lanes3};
use crate::math::{Affine12, IDENTITY};

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
    match level {
        Level::Scalar => blocks_by::<[f32; 2]>((), asset, palette, blocks, output),
        #[cfg(feature = "simd")]
        Level::Simd(level) => {
            fearless_simd::dispatch!(level, simd => by_width(simd, asset, palette, blocks, output));
        }
    }
}

#[cfg(feature = "simd")]
#[inline(always)]
fn by_width<S: fearless_simd::Simd>(
    simd: S,
    asset: &Asset<'_>,
    palette: &[Affine12],
    blocks: Range<usize>,
    output: &mut Output<'_>,
) {
    use fearless_simd::SimdBase;
    // Twelve sums must stay in registers: eight lanes only where one register holds them.
    if S::f32s::LEN >= LANES {
        blocks_by::<fearless_simd::f32x8<S>>(simd, asset, palette, blocks, output);
    } else {
        blocks_by::<fearless_simd::f32x4<S>>(simd, asset, palette, blocks, output);
    }
}

#[inline(always)]
fn blocks_by<L: Lanes>(
    token: L::Token,
    asset: &Asset<'_>,
    palette: &[Affine12],
    blocks: Range<usize>,
    output: &mut Output<'_>,
) {
    let order = match output.order {
        VertexOrder::Source => Some(asset.order),
        VertexOrder::Block => None,
    };
    let mut output = output.writer();
    let matrix = |bind: u16| palette.get(usize::from(bind)).unwrap_or(&IDENTITY);
    for block in blocks.start..blocks.end.min(asset.dims().block_count) {
        let mut slots = asset.slots(block);
        let (Some(positions), Some(normals), Some((bind, weights))) = (
            asset.rest_positions().get(block),
            asset.rest_normals().get(block),
            slots.next(),
        ) else {
            return;
        };
        let rest = Rest {
            positions,
            normals,
            order,
            first_vertex: block * LANES,
            vertex_count: asset.dims().vertex_count,
        };
        if slots.len() == 0 {
            // One bind: its weight is one in every lane.
            let mut sums = [L::Part::splat(token, 0.0); 12];
            for (sum, &value) in sums.iter_mut().zip(matrix(bind)) {
                *sum = L::Part::splat(token, value);
            }
            for first in (0..LANES).step_by(L::Part::WIDTH) {
                rest.finish(token, &sums, first, &mut output);
            }
            continue;
        }
        for first in (0..LANES).step_by(L::WIDTH) {
            let mut sums = [L::splat(token, 0.0); 12];
            let weight = L::load_weights(token, weights, first);
            for (sum, &value) in sums.iter_mut().zip(matrix(bind)) {
                *sum = L::splat(token, value).mul(weight);
            }
            for (bind, weights) in slots.clone() {
                let weight = L::load_weights(token, weights, first);
                for (sum, &value) in sums.iter_mut().zip(matrix(bind)) {
                    *sum = sum.add(L::splat(token, value).mul(weight));
                }
            }
            for part in (0..L::WIDTH).step_by(L::Part::WIDTH) {
                let mut matrix = [L::Part::splat(token, 0.0); 12];
                for (to, sum) in matrix.iter_mut().zip(sums) {
                    *to = sum.part(part);
                }
                rest.finish(token, &matrix, first + part, &mut output);
            }
        }
    }
}

/// A block at rest and where its vertices go.
struct Rest<'b> {
    positions: &'b Lanes3,
    normals: &'b Lanes3,
    /// `None` where vertices keep the order of the blocks.
    order: Option<&'b [u32]>,
    first_vertex: usize,
    vertex_count: usize,
}

impl Rest<'_> {
    /// Moves some lanes by their matrices and writes them.
    #[inline(always)]
    fn finish<L: Lanes>(
        &self,
        token: L::Token,
        matrix: &[L; 12],
        first: usize,
        output: &mut Writer<'_>,
    ) {
        let mut vertices = [None; LANES];
        for (lane, vertex) in vertices.iter_mut().enumerate().take(L::WIDTH) {
            *vertex = self.vertex(first + lane);
        }
        let [r0, r1, r2] = rows(matrix);
        let rest = load(token, self.positions, first);
        let mut lanes = Lanes3::default();
        for (to, row) in lanes.iter_mut().zip([r0, r1, r2]) {
            let [.., shift] = row;
            turn(row, rest).add(shift).store(to, 0);
        }
        for (lane, &vertex) in vertices.iter().enumerate().take(L::WIDTH) {
            if let Some(vertex) = vertex {
                output.put_position(vertex, pick(&lanes, lane));
            }
        }
        if output.wants_normals() {
            let rest = load(token, self.normals, first);
            let normal = [turn(r0, rest), turn(r1, rest), turn(r2, rest)];
            let [x, y, z] = normal;
            let length2 = x.mul(x).add(y.mul(y)).add(z.mul(z));
            // A normal blended to nothing stays nothing instead of becoming infinite.
            let length2 = length2.add(L::splat(token, SMALLEST_LENGTH2));
            let factor = length2.inverse_sqrt(token);
            for (to, value) in lanes.iter_mut().zip(normal) {
                value.mul(factor).store(to, 0);
            }
            for (lane, &vertex) in vertices.iter().enumerate().take(L::WIDTH) {
                if let Some(vertex) = vertex {
                    output.put_normal(vertex, pick(&lanes, lane));
                }
            }
        }
    }

    /// Where a lane's vertex goes; `None` for lanes that only fill the last block.
    #[inline(always)]
    fn vertex(&self, lane: usize) -> Option<usize> {
        let at = self.first_vertex + lane;
        match self.order {
            Some(order) => order.get(at).map(|&source| source as usize),
            None => (at < self.vertex_count).then_some(at),
        }
    }
}

/// Added to squared lengths: far below one, far above where a reciprocal would overflow.
pub(super) const SMALLEST_LENGTH2: f32 = 1e-20;

#[inline(always)]
fn rows<L: Copy>(&[a, b, c, d, e, f, g, h, i, j, k, l]: &[L; 12]) -> [[L; 4]; 3] {
    [[a, b, c, d], [e, f, g, h], [i, j, k, l]]
}

#[inline(always)]
fn load<L: Lanes>(token: L::Token, [x, y, z]: &Lanes3, first: usize) -> [L; 3] {
    [
        L::load(token, x, first),
        L::load(token, y, first),
        L::load(token, z, first),
    ]
}

/// A row of a matrix, without its translation, times a vector.
#[inline(always)]
fn turn<L: Lanes>([a, b, c, _]: [L; 4], [x, y, z]: [L; 3]) -> L {
    a.mul(x).add(b.mul(y)).add(c.mul(z))
}

/// The numbers of one lane.
#[inline(always)]
fn pick([x, y, z]: &Lanes3, lane: usize) -> [f32; 3] {
    [x, y, z].map(|axis| axis.get(lane).copied().unwrap_or(0.0))
}
