//! The skin as one fixed sparse matrix from markers to vertices: no frame, no fit, no solve.
//!
//! `v = sum_k c_k p_k`, and each vertex's two tangents are such sums too, whose cross product is
//! its normal. A block has as many markers as it needs; coefficients of a position sum to one.

use core::ops::Range;

use super::slots::{MarkerSlots, check_order};
use super::{PartsError, PartsTable, cross, lane_of};
use crate::Level;
use crate::asset::LANES;
use crate::deform::blocks::{Kernel, run};
use crate::deform::lanes::Lanes;
use crate::deform::output::Output;
use crate::deform::skin::to_unit_length;
use crate::deform::store::Store;

/// A checked matrix from markers to vertices.
#[derive(Clone, Copy, Debug)]
pub struct Collapsed<'a> {
    order: &'a [u32],
    slots: MarkerSlots<'a>,
}

impl<'a> Collapsed<'a> {
    /// Checks every table once; a step cannot fail after that. O(tables)
    ///
    /// `order`: `[vertices]`, vertex of each lane, block after block.
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn new_checked(
        order: &'a [u32],
        slots: MarkerSlots<'a>,
        marker_count: usize,
    ) -> Result<Self, PartsError> {
        check_order(order)?;
        let blocks = order.len().div_ceil(LANES);
        slots.check(blocks, marker_count)?;
        let table = PartsTable::MarkerSlots;
        for block in 0..blocks {
            let mut sums = [0.0_f32; LANES];
            for (_, shares) in slots.positions.entries(block) {
                for (sum, share) in sums.iter_mut().zip(shares) {
                    *sum += share;
                }
            }
            if !sums.iter().all(|sum| (0.99..=1.01).contains(sum)) {
                return Err(PartsError::Number { table, at: block });
            }
        }
        Ok(Self { order, slots })
    }

    /// Vertex of each lane, block after block.
    #[must_use]
    pub fn order(&self) -> &'a [u32] {
        self.order
    }

    /// The markers that move each block.
    #[must_use]
    pub fn slots(&self) -> &MarkerSlots<'a> {
        &self.slots
    }

    /// Number of blocks of eight vertices.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.order.len().div_ceil(LANES)
    }

    /// Multiplications of all blocks with normals; an upper bound.
    #[must_use]
    pub fn multiply_adds(&self) -> usize {
        self.slots.multiply_adds() + LANES * 24 * self.block_count()
    }

    /// Vertices of a range of blocks, which is cut to those that exist. Ranges may go to different
    /// threads with outputs of their own.
    ///
    /// `positions`: `[markers]`, metres, complete, as
    /// [`MarkerRig::follow`](super::MarkerRig::follow) gives them. The bits do not depend on
    /// `level`. O(slots)
    pub fn blocks(
        &self,
        positions: &[[f32; 3]],
        blocks: Range<usize>,
        level: Level,
        output: &mut Output<'_>,
    ) {
        run(
            &Stream {
                skin: self,
                positions,
            },
            blocks,
            level,
            output,
        );
    }
}

struct Stream<'s, 'a> {
    skin: &'s Collapsed<'a>,
    positions: &'s [[f32; 3]],
}

impl Kernel for Stream<'_, '_> {
    const IS_COMMON: bool = true;

    fn order(&self) -> &[u32] {
        self.skin.order
    }

    #[inline(always)]
    fn blocks<L: Lanes, S: Store>(&self, token: L::Token, blocks: Range<usize>, store: &mut S) {
        let zero = L::splat(token, 0.0);
        let wants_normals = store.wants_normals();
        for block in blocks {
            for first in (0..LANES).step_by(L::WIDTH) {
                let (slots, at) = (&self.skin.slots, (block, first));
                let mut position = [zero; 3];
                slots.add_positions(token, self.positions, at, &mut position);
                store.positions(block, first, position);
                if wants_normals {
                    let mut tangents = [[zero; 3]; 2];
                    slots.add_tangents(token, self.positions, at, &mut tangents);
                    let [along, across] = tangents;
                    let normal = cross(along, across);
                    store.normals(block, first, to_unit_length(token, normal));
                }
            }
        }
    }

    /// Eight sums of positions at a time, then four of tangents.
    #[inline(always)]
    fn scalar_blocks<S: Store>(&self, blocks: Range<usize>, store: &mut S) {
        let wants_normals = store.wants_normals();
        let slots = &self.skin.slots;
        for block in blocks {
            let mut sums = [[0.0; LANES]; 3];
            slots.scalar_positions(self.positions, block, &mut sums);
            let [xs, ys, zs] = sums;
            for (lane, ((x, y), z)) in xs.into_iter().zip(ys).zip(zs).enumerate() {
                store.positions(block, lane, [x, y, z]);
            }
            if !wants_normals {
                continue;
            }
            for half in 0..2 {
                let mut tangents = [[[0.0; LANES / 2]; 3]; 2];
                slots.scalar_tangents(self.positions, (block, half), &mut tangents);
                for lane in 0..LANES / 2 {
                    let [along, across] = tangents.map(|sums| lane_of(&sums, lane));
                    let normal = to_unit_length((), cross(along, across));
                    store.normals(block, half * (LANES / 2) + lane, normal);
                }
            }
        }
    }
}
