//! What a frame of a skin that markers drive costs.

use super::budget::fewest;
use super::{Budget, Cost};
use crate::asset::marker_skin::{COLLAPSED, EXACT, LINEAR_HYBRID};
use crate::asset::{Dims, LANES};
use crate::deform::parts::{HELD, REFITS};
use crate::solve::dense::JACOBI_ROTATIONS;

/// Fits of a part's frame: the first, and those after markers that are out of place.
const FITS: u64 = 1 + REFITS as u64;
/// An inverse square root.
const ROOT: u64 = 10;
/// A pair in all fits: its share in both centroids, then in the matrix and the spread; before each
/// further fit how far off it is and what it still counts.
const PAIR: u64 = FITS * (6 + 15) + REFITS as u64 * (9 + 3 + 1);
/// Pairs that hold a part besides its markers, and where the parent takes them.
const HELD_PAIRS: u64 = HELD as u64 * (PAIR + 9) + 1;
/// Jacobi rotations of a fit: each an angle, two columns of the matrix, two vectors.
const ROTATIONS: u64 = JACOBI_ROTATIONS as u64;
const ROTATION: u64 = 4 + 2 * ROOT + 1 + 2 * 4 + 4 * 4;
/// An eigenproblem; then the unit quaternion, its matrix, the translation.
const EIGEN: u64 = ROTATIONS * ROTATION + (4 + ROOT + 4) + 9 + 9 + 1;
/// The matrix that further fits measure by.
const REFIT: u64 = 9 + 1;
/// The parent's frame, and a part's own as a dual quaternion, a matrix, and to be kept.
const PART: u64 = 16 + 9 + 19 + 9 + 16;
/// A marker carried back by its frame, the residual cut to its limit, put forth again.
const MARKER: u64 = 33 + (3 + 1) + (ROOT + 1 + 3) + 9;
/// A blended dual quaternion as a matrix.
const BLEND: u64 = (4 + ROOT + 8) + 16 + 9;
/// A part's frame blended into a marker's.
const CARRIER: u64 = 12;

/// Bounds a frame of a skin that markers drive, [`follow_cost`] and a stream of vertices with
/// normals, for any input. O(1); usable in a `const`.
#[must_use]
pub const fn parts_cost(dims: &Dims, budget: Budget) -> Cost {
    if dims.marker_skin.marker_count == 0 {
        return Cost::NONE;
    }
    follow_cost(dims).plus(stream(dims, budget))
}

/// Bounds [`MarkerRig::follow`], for any input: three fits of every part, of which the second and
/// the third come about only where markers are out of place. O(1); usable in a `const`.
///
/// [`MarkerRig::follow`]: crate::deform::parts::MarkerRig::follow
#[must_use]
pub const fn follow_cost(dims: &Dims) -> Cost {
    let counts = &dims.marker_skin;
    let (markers, parts) = (counts.marker_count as u64, counts.part_count as u64);
    let (members, carriers) = (counts.member_count as u64, counts.carrier_count as u64);
    // What one part carries alone is not blended.
    let blended = fewest(markers, carriers.saturating_sub(markers));
    let blends = if counts.mode == LINEAR_HYBRID {
        0
    } else {
        BLEND * blended
    };
    Cost {
        mul_adds: PAIR * members
            + (PART + HELD_PAIRS + FITS * EIGEN + REFITS as u64 * REFIT) * parts
            + MARKER * markers
            + blends
            + CARRIER * (carriers + blended).saturating_sub(markers),
        divisions: REFITS as u64 * (members + HELD as u64 * parts)
            + FITS * (2 * ROTATIONS + 6) * parts
            + markers,
        bytes_read: members * 6 + carriers * 6 + markers * 16 + parts * 22,
        bytes_written: 0,
    }
}

const fn stream(dims: &Dims, budget: Budget) -> Cost {
    let counts = &dims.marker_skin;
    let all = dims.block_count as u64;
    let blocks = budget.blocks_of(all);
    let lanes = LANES as u64;
    let parts = counts.part_slot_count as u64;
    let (markers, tangents) = (
        counts.marker_slot_count as u64,
        counts.tangent_slot_count as u64,
    );
    let members = counts.exact_member_count as u64;
    let (mul_adds, divisions) = match counts.mode {
        // Each member of a slot's part adds to a position and to its slope.
        EXACT => (
            (counts.exact_cube_count as u64).div_ceil(6)
                + 20 * counts.exact_square_count as u64
                + 150 * members
                + lanes * (170 * parts + 40 * counts.exact_pair_count as u64 + 60 * blocks),
            // Kernels of two lanes ask for the reach of a part four times a block.
            lanes * blocks + lanes / 2 * parts + members,
        ),
        // Three sums of three numbers; their cross product at unit length.
        COLLAPSED => (lanes * (3 * markers + 6 * tangents + 21 * blocks), 0),
        // The same sums, then a skin by the parts' frames: a slot's weight and sum, with dual
        // quaternions its side but for the first, and the blend's matrix; a vertex's tangents and
        // their cross product, position and normal. A block of one part needs no sums.
        mode => {
            let rigid = fewest(counts.rigid_block_count as u64, blocks);
            let (blended, slots) = (blocks - rigid, parts - rigid);
            let (sums, divided) = if mode == LINEAR_HYBRID {
                ((1 + 12) * slots, 0)
            } else {
                let matrices = (4 + 12 + 15) * blended;
                ((1 + 4 + 8) * slots - 4 * blended + matrices, blended)
            };
            let moved = (9 + 6 + 9 + 9 + 15) * blocks;
            (
                lanes * (3 * markers + 6 * tangents + sums + moved),
                lanes * (blocks + divided),
            )
        }
    };
    Cost {
        mul_adds,
        divisions,
        bytes_read: parts * 18 + markers * 34 + tangents * 66 + blocks * (2 * 96 + 4 * lanes + 8),
        bytes_written: blocks * lanes * 24,
    }
}
