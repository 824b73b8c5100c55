//! Skinning on part frames, over a rest shape that marker residuals displace.
//!
//! `v = M (v_0 + sum_k b_k r_k)`: `M` blends the frames of parts as any skin does, `r_k` is the
//! residual of a marker in the rest pose, `b_k` its biharmonic weight. The rest normal becomes the
//! cross product of the displaced tangents before `M` turns it.

use core::ops::Range;

use super::slots::{MarkerSlots, ORIGIN, PartBlocks};
use super::{PartsError, cross, lane_of, tangents};
use crate::Level;
use crate::asset::{LANES, Lanes3};
use crate::deform::blocks::{Kernel, run};
use crate::deform::dual::DualQuaternion;
use crate::deform::lanes::Lanes;
use crate::deform::linear::Linear;
use crate::deform::output::Output;
use crate::deform::skin::{Blend, Slots, move_point, to_unit_length, turn};
use crate::deform::store::Store;
use crate::math::Affine12;
use crate::pose::Dual17;

/// Frames of parts in a frame of motion.
#[derive(Clone, Copy, Debug)]
pub struct PartFrames<'f> {
    /// `[parts]`: from the rest pose.
    pub palette: &'f [Affine12],
    /// `[parts]`: the same as dual quaternions; empty for a linear blend.
    pub duals: &'f [Dual17],
}

/// A checked skin with residuals.
#[derive(Clone, Copy, Debug)]
pub struct Hybrid<'a> {
    blocks: PartBlocks<'a>,
    slots: MarkerSlots<'a>,
}

impl<'a> Hybrid<'a> {
    /// Checks every table once; a step cannot fail after that. O(tables)
    ///
    /// # Errors
    /// The first fault, with its place.
    pub fn new_checked(
        blocks: PartBlocks<'a>,
        slots: MarkerSlots<'a>,
        (parts, markers): (usize, usize),
    ) -> Result<Self, PartsError> {
        blocks.check(parts)?;
        slots.check(blocks.block_count(), markers)?;
        Ok(Self { blocks, slots })
    }

    /// The parts that move each block.
    #[must_use]
    pub fn part_blocks(&self) -> &PartBlocks<'a> {
        &self.blocks
    }

    /// The markers whose residuals move each block.
    #[must_use]
    pub fn slots(&self) -> &MarkerSlots<'a> {
        &self.slots
    }

    /// Number of blocks of eight vertices.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.blocks.block_count()
    }

    /// Multiplications of all blocks with normals; an upper bound.
    #[must_use]
    pub fn multiply_adds(&self) -> usize {
        let parts = self.blocks.parts.len();
        self.slots.multiply_adds() + LANES * (13 * parts + 100 * self.block_count())
    }

    /// Vertices of a range of blocks, which is cut to those that exist. Ranges may go to different
    /// threads with outputs of their own.
    ///
    /// `residuals`: `[markers]`, metres, in the rest pose. The bits do not depend on `level`.
    /// O(slots)
    pub fn blocks(
        &self,
        frames: &PartFrames<'_>,
        residuals: &[[f32; 3]],
        blocks: Range<usize>,
        level: Level,
        output: &mut Output<'_>,
    ) {
        let palette = frames.palette;
        if frames.duals.is_empty() {
            let blend = Linear { palette };
            self.by_blend(&blend, residuals, blocks, level, output);
        } else {
            let blend = DualQuaternion {
                palette,
                duals: frames.duals,
                stretched: false,
            };
            self.by_blend(&blend, residuals, blocks, level, output);
        }
    }

    fn by_blend<B: Blend>(
        &self,
        blend: &B,
        residuals: &[[f32; 3]],
        blocks: Range<usize>,
        level: Level,
        output: &mut Output<'_>,
    ) {
        let skin = self;
        let stream = Stream {
            skin,
            blend,
            residuals,
        };
        run(&stream, blocks, level, output);
    }
}

struct Stream<'s, 'a, B> {
    skin: &'s Hybrid<'a>,
    blend: &'s B,
    residuals: &'s [[f32; 3]],
}

impl<B: Blend> Kernel for Stream<'_, '_, B> {
    fn order(&self) -> &[u32] {
        self.skin.blocks.order
    }

    #[inline(always)]
    fn blocks<L: Lanes, S: Store>(&self, token: L::Token, blocks: Range<usize>, store: &mut S) {
        let wants_normals = store.wants_normals();
        let rest = &self.skin.blocks;
        for block in blocks {
            let (parts, _) = rest.slots(block);
            for first in (0..LANES).step_by(L::WIDTH) {
                let at = (block, first);
                let slots = &self.skin.slots;
                let mut position = rest.position::<L>(token, block, first);
                slots.add_positions(token, self.residuals, at, &mut position);
                let mut normal = [L::splat(token, 0.0); 3];
                if wants_normals {
                    normal = rest.normal(token, block, first);
                    let mut sums = tangents(token, normal);
                    slots.add_tangents(token, self.residuals, at, &mut sums);
                    let [along, across] = sums;
                    normal = cross(along, across);
                }
                self.put(token, &parts, at, (position, normal), store);
            }
        }
    }

    /// Displaces a block at once; what blends needs the registers for itself.
    #[inline(always)]
    fn scalar_blocks<S: Store>(&self, blocks: Range<usize>, store: &mut S) {
        let (rest, slots) = (&self.skin.blocks, &self.skin.slots);
        for block in blocks {
            let mut positions = *rest.positions.get(block).unwrap_or(&ORIGIN);
            slots.scalar_positions(self.residuals, block, &mut positions);
            let mut normals = ORIGIN;
            if store.wants_normals() {
                normals = self.scalar_normals(block);
            }
            let (parts, _) = rest.slots(block);
            for first in (0..LANES).step_by(2) {
                let position = <[f32; 2]>::load3((), &positions, first);
                let normal = <[f32; 2]>::load3((), &normals, first);
                self.put((), &parts, (block, first), (position, normal), store);
            }
        }
    }
}

impl<B: Blend> Stream<'_, '_, B> {
    /// Normals of the displaced rest shape, of any length.
    #[inline(always)]
    fn scalar_normals(&self, block: usize) -> Lanes3 {
        const HALF: usize = LANES / 2;
        let rest = self.skin.blocks.normals.get(block).unwrap_or(&ORIGIN);
        let mut normals = ORIGIN;
        for half in 0..2 {
            let mut sums = [[[0.0; HALF]; 3]; 2];
            for lane in 0..HALF {
                let of = tangents((), lane_of(rest, half * HALF + lane));
                for (sums, of) in sums.as_flattened_mut().iter_mut().zip(of.as_flattened()) {
                    if let Some(sum) = sums.get_mut(lane) {
                        *sum = *of;
                    }
                }
            }
            let slots = &self.skin.slots;
            slots.scalar_tangents(self.residuals, (block, half), &mut sums);
            for lane in 0..HALF {
                let [along, across] = sums.map(|sums| lane_of(&sums, lane));
                let normal = cross(along, across);
                for (lanes, value) in normals.iter_mut().zip(normal) {
                    value.put(lanes, half * HALF + lane);
                }
            }
        }
        normals
    }

    /// Blends the frames of parts and moves what was displaced.
    #[inline(always)]
    fn put<L: Lanes, S: Store>(
        &self,
        token: L::Token,
        parts: &Slots<'_>,
        (block, first): (usize, usize),
        (position, normal): ([L; 3], [L; 3]),
        store: &mut S,
    ) {
        let matrix = match *parts.binds {
            [part] => splat(token, self.blend.rigid(part)),
            _ => self.blend.matrix::<L>(token, parts, first),
        };
        store.positions(block, first, move_point(&matrix, position));
        if store.wants_normals() {
            let turned = turn(&matrix, normal);
            store.normals(block, first, to_unit_length(token, turned));
        }
    }
}

#[inline(always)]
fn splat<L: Lanes>(token: L::Token, matrix: &Affine12) -> [L; 12] {
    let mut lanes = [L::splat(token, 0.0); 12];
    for (lanes, &value) in lanes.iter_mut().zip(matrix) {
        *lanes = L::splat(token, value);
    }
    lanes
}
