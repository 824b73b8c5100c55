//! Linear blend skinning over blocks (Mažrimas & Beinaravičius, section 2).

use core::ops::Range;

use super::Level;
use super::lanes::Lanes;
use super::output::{Attribute, Output, VertexOrder};
use crate::asset::{Asset, LANES, Lanes3, WEIGHT_ONE};
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
        Level::Scalar => blocks_by::<f32>((), asset, palette, blocks, output),
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
    let vertex_count = asset.dims().vertex_count;
    let wants_normals = output.normals.is_some();
    for block in blocks.start..blocks.end.min(asset.dims().block_count) {
        let (Some(positions), Some(normals)) = (
            asset.rest_positions().get(block),
            asset.rest_normals().get(block),
        ) else {
            return;
        };
        let mut skinned = Skinned::default();
        for first in (0..LANES).step_by(L::WIDTH) {
            let matrix = blend::<L>(token, asset, palette, block, first);
            let rest = positions.each_ref().map(|axis| L::load(token, axis, first));
            for (axis, row) in skinned.positions.iter_mut().zip(matrix.as_chunks::<4>().0) {
                let sum = row[0]
                    .mul(rest[0])
                    .add(row[1].mul(rest[1]))
                    .add(row[2].mul(rest[2]));
                sum.add(row[3]).store(axis, first);
            }
            if wants_normals {
                let rest = normals.each_ref().map(|axis| L::load(token, axis, first));
                let turned = [0, 4, 8].map(|row| {
                    let [a, b, c] = [matrix[row], matrix[row + 1], matrix[row + 2]];
                    a.mul(rest[0]).add(b.mul(rest[1])).add(c.mul(rest[2]))
                });
                let [x, y, z] = turned;
                let length2 = x.mul(x).add(y.mul(y)).add(z.mul(z));
                // A normal blended to nothing stays nothing instead of becoming infinite.
                let length2 = length2.add(L::splat(token, SMALLEST_LENGTH2));
                let factor = length2.inverse_sqrt(token);
                for (axis, value) in skinned.normals.iter_mut().zip(turned) {
                    value.mul(factor).store(axis, first);
                }
            }
        }
        let first_vertex = block * LANES;
        let lanes = vertex_count.saturating_sub(first_vertex).min(LANES);
        let order = match output.order {
            VertexOrder::Source => asset.order.get(first_vertex..first_vertex + lanes),
            VertexOrder::Block => None,
        };
        let (attribute, buffer) = output.positions;
        if let Some(buffer) = output.buffers.get_mut(buffer) {
            scatter(
                &skinned.positions,
                lanes,
                first_vertex,
                order,
                attribute,
                buffer,
            );
        }
        if let Some((attribute, buffer)) = output.normals
            && let Some(buffer) = output.buffers.get_mut(buffer)
        {
            scatter(
                &skinned.normals,
                lanes,
                first_vertex,
                order,
                attribute,
                buffer,
            );
        }
    }
}

/// Added to squared lengths: far below one, far above where a reciprocal would overflow.
pub(super) const SMALLEST_LENGTH2: f32 = 1e-20;

#[derive(Default)]
struct Skinned {
    positions: Lanes3,
    normals: Lanes3,
}

/// The blended matrix of each lane.
#[inline(always)]
fn blend<L: Lanes>(
    token: L::Token,
    asset: &Asset<'_>,
    palette: &[Affine12],
    block: usize,
    first: usize,
) -> [L; 12] {
    let row = |bind: u16| palette.get(usize::from(bind)).unwrap_or(&IDENTITY);
    let mut slots = asset.slots(block);
    let Some((bind, weights)) = slots.next() else {
        return IDENTITY.map(|value| L::splat(token, value));
    };
    let Some((second, second_weights)) = slots.next() else {
        // One bind: its weight is one.
        return row(bind).map(|value| L::splat(token, value));
    };
    let weight = |weights: &[u16; LANES]| L::load_weights(token, weights, first);
    let (one, two) = (weight(weights), weight(second_weights));
    let (row_one, row_two) = (row(bind), row(second));
    let mut sum = row_one.map(|value| L::splat(token, value).mul(one));
    for (sum, &value) in sum.iter_mut().zip(row_two) {
        *sum = sum.add(L::splat(token, value).mul(two));
    }
    for (bind, weights) in slots {
        let weight = weight(weights);
        for (sum, &value) in sum.iter_mut().zip(row(bind)) {
            *sum = sum.add(L::splat(token, value).mul(weight));
        }
    }
    let unit = L::splat(token, 1.0 / WEIGHT_ONE as f32);
    sum.map(|value| value.mul(unit))
}

/// Writes the lanes of a block to their vertices.
#[inline(always)]
pub(super) fn scatter(
    lanes: &Lanes3,
    lane_count: usize,
    first_vertex: usize,
    order: Option<&[u32]>,
    attribute: Attribute,
    buffer: &mut [f32],
) {
    let [x, y, z] = lanes;
    let lanes = x.iter().zip(y).zip(z).take(lane_count);
    for (lane, ((&x, &y), &z)) in lanes.enumerate() {
        let vertex = match order {
            Some(order) => order.get(lane).map_or(0, |&source| source as usize),
            None => first_vertex + lane,
        };
        let at = vertex * attribute.stride + attribute.offset;
        if let Some([to_x, to_y, to_z]) = buffer.get_mut(at..).and_then(<[f32]>::first_chunk_mut) {
            (*to_x, *to_y, *to_z) = (x, y, z);
        }
    }
}
