//! What a frame may cost, and what it costs.

use core::ops::Range;

use crate::asset::{Asset, Dims, LANES};
use crate::deform::SkinMode;
use crate::deform::parts::corrective_multiply_adds;

/// How much work a frame may do. Counts, never time, so that every machine does the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Budget {
    /// Blocks of eight vertices. What is left over is done first in the next frame.
    pub blocks: usize,
    /// Solves of an exact Laplacian surface: one a frame at most, none to show the last one again.
    pub solves: usize,
    /// First of the blocks that come before all others, and the one after the last.
    urgent: [usize; 2],
}

impl Budget {
    /// All of the work in every frame.
    pub const UNLIMITED: Self = Self {
        blocks: usize::MAX,
        solves: usize::MAX,
        urgent: [0; 2],
    };

    /// At most this many blocks of eight vertices a frame.
    #[must_use]
    pub const fn blocks(blocks: usize) -> Self {
        Self {
            blocks,
            ..Self::UNLIMITED
        }
    }

    /// At most this many solves a frame.
    #[must_use]
    pub const fn with_solves(mut self, solves: usize) -> Self {
        self.solves = solves;
        self
    }
}

impl Budget {
    /// Brings these blocks up to date in every frame, before others get their turn: what is near,
    /// or looked at. [`Asset::slots`] says which joints move a block. Others keep one block of every
    /// frame at least.
    #[must_use]
    pub const fn with_urgent(mut self, blocks: Range<usize>) -> Self {
        self.urgent = [blocks.start, blocks.end];
        self
    }

    /// How many of `all` blocks a frame brings up to date at most.
    pub(super) const fn blocks_of(&self, all: u64) -> u64 {
        if (self.blocks as u64) < all {
            self.blocks as u64
        } else {
            all
        }
    }

    /// The urgent ones of so many blocks, cut so that others are left.
    pub(super) const fn urgent_of(&self, blocks: usize) -> Range<usize> {
        let [start, end] = self.urgent;
        let end = least(end, blocks);
        let start = least(start, end);
        let allowed = least(self.blocks, blocks);
        let room = if allowed < blocks {
            allowed.saturating_sub(1)
        } else {
            allowed
        };
        start..start + least(end - start, room)
    }

    /// Frames after which every one of `blocks` has been brought up to date: how old a vertex may
    /// be under a steady budget. `usize::MAX` where the budget has none.
    #[must_use]
    pub const fn frames_to_all(&self, blocks: usize) -> usize {
        let urgent = self.urgent_of(blocks);
        let urgent = urgent.end - urgent.start;
        let others = least(self.blocks, blocks) - urgent;
        if blocks == 0 {
            0
        } else if others == 0 {
            usize::MAX
        } else {
            (blocks - urgent).div_ceil(others)
        }
    }

    /// The most blocks a frame whose [`cost`] stays within so many multiply-adds; none where the
    /// pose alone costs more. So a caller hands out a frame's work to its stages in the order of
    /// their worth: each takes what it needs of what is left. O(log blocks); usable in a `const`.
    ///
    /// ```
    /// use sinew_core::{asset::Dims, frame::{Budget, cost}};
    /// # const BYTES: &[u8] = sinew_core::include_asset!("../../../tests/golden/arm.sinew");
    /// const DIMS: Dims = Dims::of(BYTES);
    /// const LEFT: u64 = 3_000;
    /// const BUDGET: Budget = Budget::within(&DIMS, LEFT);
    /// const _: () = assert!(BUDGET.blocks > 0 && cost(&DIMS, BUDGET).mul_adds <= LEFT);
    /// ```
    #[must_use]
    pub const fn within(dims: &Dims, mul_adds: u64) -> Self {
        let (mut least, mut most) = (0, dims.block_count);
        while least < most {
            let middle = most - (most - least) / 2;
            if cost(dims, Self::blocks(middle)).mul_adds <= mul_adds {
                least = middle;
            } else {
                most = middle - 1;
            }
        }
        Self::blocks(least)
    }

    /// The finest level of detail that is brought up to date whole in every frame; the coarsest
    /// where none is. O(levels)
    #[must_use]
    pub fn level<'a>(self, asset: &Asset<'a>) -> Asset<'a> {
        let level = asset.level(asset.level_within(self.blocks));
        level.unwrap_or(*asset)
    }
}

const fn least(a: usize, b: usize) -> usize {
    if a < b { a } else { b }
}

impl Default for Budget {
    fn default() -> Self {
        Self::UNLIMITED
    }
}

/// An upper bound on the work of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Cost {
    /// Multiplications, each with the addition or subtraction that follows it where there is one.
    pub mul_adds: u64,
    /// Divisions.
    pub divisions: u64,
    /// Bytes of the asset read.
    pub bytes_read: u64,
    /// Bytes of the output written.
    pub bytes_written: u64,
}

impl Cost {
    /// No work.
    pub const NONE: Self = Self {
        mul_adds: 0,
        divisions: 0,
        bytes_read: 0,
        bytes_written: 0,
    };

    /// Both together.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self {
            mul_adds: self.mul_adds + other.mul_adds,
            divisions: self.divisions + other.divisions,
            bytes_read: self.bytes_read + other.bytes_read,
            bytes_written: self.bytes_written + other.bytes_written,
        }
    }
}

/// Work of interpolating a rotation: dot product, halved arc, two series, blend, normalisation.
const SLERP: u64 = 4 + (4 + 9 + 4 + 4) + 2 * (2 + 9 * 3) + 8 + (4 + 9 + 4);
/// A spline of four numbers: the Hermite weights, the blend, the normalisation.
const SPLINE: u64 = 14 + 16 + (4 + 9 + 4);
/// Two compressed keys: three components each, the fourth by a square root; their unit length.
const PACKED: u64 = 2 * (6 + 3 + 10) + (4 + 9 + 4);
/// A local transform to a matrix: products of components, then scales.
const LOCAL_TO_MATRIX: u64 = 9 + 9;
/// Three rows of four columns, three products each.
const COMPOSE: u64 = 36;
/// A vector's square, its inverse square root, the product of both.
const UNIT_LENGTH: u64 = 3 + 9 + 3;
/// Position; normal; its length.
const VERTEX: u64 = 9 + 9 + UNIT_LENGTH;
/// Of a block that hangs on one bind: whether that scales evenly, and what it does to normals.
const RIGID_BLOCK: u64 = 9 + 9 + 1 + 9 + 12;
/// A weight to parts of one, then twelve numbers of a matrix by it.
const SLOT_VERTEX: u64 = 1 + 12;

/// Bounds the work of [`Avatar::step`](super::Avatar::step) for any input, with all that the asset
/// has for a vertex: position, normal, tangent. Normals are moved fast. O(1); usable in a `const`.
///
/// ```
/// use sinew_core::{asset::Dims, frame::{Budget, cost}};
/// # const BYTES: &[u8] = sinew_core::include_asset!("../../../tests/golden/arm.sinew");
/// const DIMS: Dims = Dims::of(BYTES);
/// const _: () = assert!(cost(&DIMS, Budget::UNLIMITED).mul_adds < 100_000);
/// ```
#[must_use]
pub const fn cost(dims: &Dims, budget: Budget) -> Cost {
    let surface = if dims.laplacian.is_collapsed() {
        collapsed_cost(dims, budget)
    } else if dims.laplacian.is_exact() {
        exact_cost(dims, budget)
    } else {
        skin_cost(dims, budget)
    };
    pose_cost(dims).plus(corrective_cost(dims)).plus(surface)
}

/// Bounds as [`cost`] does, for input that scales no joint unevenly: normals of blocks that hang on
/// one joint then keep their length. O(1); usable in a `const`.
#[must_use]
pub const fn even_cost(dims: &Dims, budget: Budget) -> Cost {
    let all = cost(dims, budget);
    let has_unit_normals = dims.shapes.block_count == 0 && dims.morph_normal_count == 0;
    if dims.laplacian.is_some() || !has_unit_normals {
        return all;
    }
    // Under a limit those may come that are not rigid.
    let left_out = dims.block_count.saturating_sub(budget.blocks);
    let rigid = dims.rigid_block_count.saturating_sub(left_out);
    Cost {
        mul_adds: all.mul_adds - (rigid * LANES) as u64 * UNIT_LENGTH,
        ..all
    }
}

/// Clip sampling, model space, palette.
const fn pose_cost(dims: &Dims) -> Cost {
    let (joints, binds) = (dims.joint_count as u64, dims.bind_count as u64);
    let tracks = dims.max_clip_tracks as u64;
    let interpolation = if SLERP > SPLINE { SLERP } else { SPLINE };
    let interpolation = if dims.packed.track_count > 0 {
        interpolation + PACKED
    } else {
        interpolation
    };
    // A search among n keys looks at no more than the bits of n, and then at two keys' values.
    let search = usize::BITS - dims.max_track_keys.leading_zeros();
    Cost {
        mul_adds: tracks * interpolation + joints * (LOCAL_TO_MATRIX + COMPOSE) + binds * COMPOSE,
        divisions: tracks,
        bytes_read: tracks * (16 + 4 * (search as u64 + 2) + 2 * 3 * 16)
            + joints * (40 + 2)
            + binds * (48 + 2),
        bytes_written: 0,
    }
}

/// Features of parts, two springs each, and the weights; what the modes move counts as morph rows.
const fn corrective_cost(dims: &Dims) -> Cost {
    let counts = &dims.correctives;
    let (parts, terms) = (counts.part_count as u64, counts.term_count as u64);
    Cost {
        mul_adds: corrective_multiply_adds(counts.part_count, counts.term_count) as u64,
        divisions: 5 * parts,
        bytes_read: parts * (2 + 2 + 12 + 16) + terms * 6 + counts.mode_count as u64 * 12,
        bytes_written: 0,
    }
}

const fn skin_cost(dims: &Dims, budget: Budget) -> Cost {
    let all = dims.block_count as u64;
    let blocks = budget.blocks_of(all);
    let lanes = LANES as u64;
    // Under a limit nobody knows which blocks come: the most slots that so many can have are
    // those left when every other block has just one.
    let slots = dims.slot_count as u64 - (all - blocks);
    // The slot of a rigid block is not weighed. The other blocks have two slots at least.
    let rigid = dims.rigid_block_count as u64;
    let left_out = all.saturating_sub(rigid).saturating_sub(blocks);
    let weighed = (dims.slot_count as u64).saturating_sub(rigid + 2 * left_out);
    let weighed = fewest(weighed, blocks * dims.bind_count as u64);
    // All rows could lie in the blocks that come; each block's normals are then made unit again.
    let (rows, normals) = (dims.morph_row_count as u64, dims.morph_normal_count as u64);
    let is_packed = dims.shapes.block_count > 0;
    // Packed numbers: a step each; normals are made unit before morphs are added to them.
    let unpack = match (is_packed, normals > 0) {
        (true, true) => 3 + UNIT_LENGTH,
        (true, false) => 3,
        (false, _) => 0,
    };
    let tangents = if dims.shapes.tangent_block_count > 0 {
        9 + UNIT_LENGTH
    } else {
        0
    };
    let rest_bytes = if is_packed { 24 + 48 + 32 } else { 2 * 96 };
    Cost {
        mul_adds: blocks * lanes * (VERTEX + unpack + tangents)
            + fewest(rigid, blocks) * RIGID_BLOCK
            + weighed * lanes * SLOT_VERTEX
            + lanes * (3 * rows + (3 + UNIT_LENGTH) * normals),
        divisions: 0,
        bytes_read: 16 * dims.run_count as u64
            + blocks * (rest_bytes + 4 * lanes)
            + slots * (2 + 2 * lanes)
            + rows * (2 + 96)
            + normals * 96
            + if rows > 0 { 8 * blocks } else { 0 }
            + if tangents > 0 { 33 * blocks } else { 0 },
        bytes_written: blocks * lanes * if tangents > 0 { 40 } else { 24 },
    }
}

/// The smaller one. A baked block has no bind twice, so no more slots than there are binds.
pub(super) const fn fewest(a: u64, b: u64) -> u64 {
    if a < b { a } else { b }
}

/// A joint's rotation chained and made unit.
const CHAINED: u64 = 16 + (4 + 9 + 4);
/// A bind's rotation, dual part, matrix, and stretch.
const DUAL: u64 = 16 + (4 + 9 + 4) + 3 + 16 + 9 + 9 + 27;
/// Squared length, rotation after stretch.
const TURNED: u64 = 4 + 3 + 9 + 27;

/// Bounds what dual quaternions or centres of rotation cost more than [`cost`]; nothing for linear
/// blending. O(1); usable in a `const`.
#[must_use]
pub const fn mode_cost(dims: &Dims, budget: Budget, mode: SkinMode) -> Cost {
    if matches!(mode, SkinMode::Linear) {
        return Cost::NONE;
    }
    let all = dims.block_count as u64;
    let blocks = budget.blocks_of(all);
    let lanes = LANES as u64;
    let (rigid, slots) = (dims.rigid_block_count as u64, dims.slot_count as u64);
    let blended = all.saturating_sub(rigid);
    let left_out = blended.saturating_sub(blocks);
    let blended = blended - left_out;
    let weighed = slots.saturating_sub(rigid + 2 * left_out);
    let weighed = fewest(weighed, blended * dims.bind_count as u64);
    // A slot's stretch, and its quaternion's side, which the first of a block does not need. Dual
    // quaternions sum eight numbers instead of a matrix, centres four besides.
    let (sums, vertex) = match mode {
        #[cfg(feature = "modes")]
        SkinMode::CentresOfRotation => (1 + 4 + 9 + 4, TURNED + 9),
        _ => (8 + 9 + 4 - 12, TURNED + 15),
    };
    let (joints, binds) = (dims.joint_count as u64, dims.bind_count as u64);
    Cost {
        mul_adds: joints * CHAINED
            + binds * DUAL
            + lanes * (weighed * sums + blended * (vertex - 4)),
        divisions: blended * lanes,
        bytes_read: binds * 16
            + if dims.centre_block_count > 0 {
                96 * blended
            } else {
                0
            },
        bytes_written: 0,
    }
}

/// Rotations of joints; following one, its matrix, whether it is far from its neighbour.
const MARKER: u64 = 16 + 60 + 36 + 40;
/// A rotation made unit, composed with its base, and its matrix.
const TURN: u64 = 4 + 9 + 4 + 16 + 18;

const fn collapsed_cost(dims: &Dims, budget: Budget) -> Cost {
    let counts = &dims.laplacian;
    let all = dims.block_count as u64;
    let blocks = budget.blocks_of(all);
    let (lanes, joints) = (LANES as u64, dims.joint_count as u64);
    let (handles, entries) = (
        counts.virtual_count as u64,
        counts.virtual_entry_count as u64,
    );
    // Every other block has a slot at least.
    let slots = (counts.slot_count as u64).saturating_sub(all - blocks);
    Cost {
        // Where the base moves, rotations of virtual handles are blended once more.
        mul_adds: joints * MARKER
            + entries * (16 + 2 * 20)
            + handles * 2 * TURN
            + slots * lanes * (12 + 3 + 9)
            + blocks * lanes * UNIT_LENGTH,
        divisions: 0,
        bytes_read: joints * 16
            + entries * 22
            + handles * 4
            + slots * (2 + 128)
            + blocks * (96 + 4 * lanes + 8),
        bytes_written: blocks * lanes * 24,
    }
}

const fn exact_cost(dims: &Dims, budget: Budget) -> Cost {
    let counts = &dims.laplacian;
    let (joints, vertices) = (dims.joint_count as u64, dims.vertex_count as u64);
    let (rows, edges) = (counts.row_count as u64, counts.edge_count as u64);
    let (panels, quads) = (counts.panel_count as u64, counts.quad_count as u64);
    if budget.solves == 0 || budget.blocks == 0 {
        return Cost {
            mul_adds: joints * 16,
            divisions: 0,
            bytes_read: 0,
            bytes_written: 0,
        };
    }
    Cost {
        // Four numbers of a quad, four right-hand sides, forward and back; corners of a triangle
        // hold 10 of 16. A row's rotation, once more where the base moves; a guess from four
        // markers; what is missing. Edges are summed for rotations and, twice, for positions.
        mul_adds: joints * (MARKER + 8)
            + (quads * 4 - rows / 4 * 2 * 6) * 4 * 2
            + rows * ((18 + 16) + 18 + (4 * 8 + 18) + 22)
            + edges * 3 * 4
            + vertices * (18 + 9),
        divisions: 0,
        bytes_read: joints * 20
            + 2 * (quads * 16 + panels * 16 + 8 * counts.supernode_count as u64)
            + rows * (16 + 16 + 24 + 3 * 4)
            + edges * 3 * 8
            + vertices * (8 + 12),
        bytes_written: vertices * 24,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dims() -> Dims {
        Dims {
            joint_count: 2,
            bind_count: 2,
            vertex_count: 20,
            block_count: 3,
            slot_count: 5,
            rigid_block_count: 1,
            run_count: 2,
            index_bytes: 2,
            ..Dims::default()
        }
    }

    #[test]
    fn a_frame_without_blocks_costs_its_pose() {
        let none = cost(&dims(), Budget::blocks(0));
        assert_eq!(none.mul_adds, 2 * 54 + 2 * 36);
        assert_eq!(none.bytes_written, 0);
    }

    #[test]
    fn a_limit_lowers_the_cost_and_a_larger_one_than_needed_does_not_raise_it() {
        let all = cost(&dims(), Budget::UNLIMITED);
        assert_eq!(all.mul_adds, 180 + 3 * 8 * 33 + 40 + 4 * 8 * 13);
        let even = even_cost(&dims(), Budget::UNLIMITED);
        assert_eq!(all.mul_adds - even.mul_adds, 8 * 15);
        assert_eq!(all, cost(&dims(), Budget::blocks(3)));
        assert!(cost(&dims(), Budget::blocks(2)).mul_adds < all.mul_adds);
    }
}
