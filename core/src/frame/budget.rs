//! What a frame may cost, and what it costs.

use crate::asset::{Dims, LANES};

/// How much work a frame may do. Counts, never time, so that every machine does the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Budget {
    /// Blocks of eight vertices. What is left over is done first in the next frame.
    pub blocks: usize,
}

impl Budget {
    /// All of the work in every frame.
    pub const UNLIMITED: Self = Self { blocks: usize::MAX };

    /// At most this many blocks of eight vertices a frame.
    #[must_use]
    pub const fn blocks(blocks: usize) -> Self {
        Self { blocks }
    }
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
/// A weight to parts of one, then twelve numbers of a matrix by it.
const SLOT_VERTEX: u64 = 1 + 12;

/// Bounds the work of [`Avatar::step`](super::Avatar::step) with positions and normals, for any
/// input. O(1); usable in a `const`.
///
/// ```
/// use sinew_core::{asset::Dims, frame::{Budget, cost}};
/// # const BYTES: &[u8] = sinew_core::include_asset!("../../../tests/golden/arm.sinew");
/// const DIMS: Dims = Dims::of(BYTES);
/// const _: () = assert!(cost(&DIMS, Budget::UNLIMITED).mul_adds < 100_000);
/// ```
#[must_use]
pub const fn cost(dims: &Dims, budget: Budget) -> Cost {
    pose_cost(dims).plus(skin_cost(dims, budget))
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

const fn skin_cost(dims: &Dims, budget: Budget) -> Cost {
    let all = dims.block_count as u64;
    let blocks = if (budget.blocks as u64) < all {
        budget.blocks as u64
    } else {
        all
    };
    let lanes = LANES as u64;
    // Under a limit nobody knows which blocks come: the most slots that so many can have are
    // those left when every other block has just one.
    let slots = dims.slot_count as u64 - (all - blocks);
    // All rows could lie in the blocks that come; each block's normals are then made unit again.
    let (rows, normals) = (dims.morph_row_count as u64, dims.morph_normal_count as u64);
    Cost {
        mul_adds: blocks * lanes * VERTEX
            + slots * lanes * SLOT_VERTEX
            + lanes * (3 * rows + (3 + UNIT_LENGTH) * normals),
        divisions: 0,
        bytes_read: 16 * dims.run_count as u64
            + blocks * (2 * 96 + 4 * lanes)
            + slots * (2 + 2 * lanes)
            + rows * (2 + 96)
            + normals * 96
            + if rows > 0 { 8 * blocks } else { 0 },
        bytes_written: blocks * lanes * 24,
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
        assert_eq!(none.mul_adds, 2 * 54 + 2 * 36 + 2 * 8 * 13);
        assert_eq!(none.bytes_written, 0);
    }

    #[test]
    fn a_limit_lowers_the_cost_and_a_larger_one_than_needed_does_not_raise_it() {
        let all = cost(&dims(), Budget::UNLIMITED);
        assert_eq!(all.mul_adds, 180 + 3 * 8 * 33 + 5 * 8 * 13);
        assert_eq!(all, cost(&dims(), Budget::blocks(3)));
        assert!(cost(&dims(), Budget::blocks(2)).mul_adds < all.mul_adds);
    }
}
