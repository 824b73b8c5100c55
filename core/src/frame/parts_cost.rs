//! What a frame of a skin that markers drive costs.

use super::{Budget, Cost};
use crate::asset::{Dims, LANES};

/// Fits of a part's frame: the first, and those after markers that are out of place.
const FITS: u64 = 3;
/// A pair in all fits: its share in both centroids, then in the matrix; before each further fit how
/// far off it is, once to decide and in each of two passes to weigh it.
const PAIR: u64 = FITS * (6 + 12) + (FITS - 1) * (12 + 2 * 14);
/// Pairs that hold a part besides its markers: a pivot, and three for the parent's turn. The
/// parent's motion of each is found anew in every pass.
const HELD: u64 = 4 * (PAIR + 9 * (2 + 3 + 3));
/// An eigenproblem: six sweeps over six pairs of rows of a matrix of four, with the vectors'; then
/// the quaternion's matrix.
const EIGEN: u64 = 6 * 6 * (26 + 3 * 16) + 60;
/// A marker carried back by blended frames, its residual measured, and put forth again.
const MARKER: u64 = 90;
/// A part's frame blended into a marker's.
const CARRIER: u64 = 12;

/// Bounds a frame of a skin that markers drive, [`follow_cost`] and a stream of vertices with
/// normals, for any input. O(1); usable in a `const`.
///
/// The exact mode's bound takes all its members for those of one part, since the counts do not say
/// how they are spread; [`Exact::multiply_adds`] knows, once the asset is loaded.
///
/// [`Exact::multiply_adds`]: crate::deform::parts::Exact::multiply_adds
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
    Cost {
        mul_adds: PAIR * members
            + (HELD + FITS * EIGEN) * parts
            + MARKER * markers
            + CARRIER * carriers,
        divisions: FITS * (members + (4 + 6 * 6 * 2 + 2) * parts) + markers,
        bytes_read: members * 6 + carriers * 6 + markers * 16 + parts * 22,
        bytes_written: 0,
    }
}

const fn stream(dims: &Dims, budget: Budget) -> Cost {
    let counts = &dims.marker_skin;
    let all = dims.block_count as u64;
    let blocks = budget.blocks_of(all);
    let lanes = LANES as u64;
    let (parts, markers) = (
        counts.part_slot_count as u64,
        counts.marker_slot_count as u64,
    );
    let members = counts.exact_member_count as u64;
    let (mul_adds, divisions) = match counts.mode {
        // Each member of a slot's part adds to a position and to its slope.
        1 => (
            members * members * (members / 6 + 20)
                + 150 * members
                + lanes * (parts * (170 + 40 * members) + 60 * blocks),
            lanes * blocks + members,
        ),
        // Three sums of three numbers; their cross product at unit length.
        2 => (lanes * (9 * markers + 21 * blocks), 0),
        // The same sums, then a skin by dual quaternions without stretch: a slot's weight, side and
        // sum; a vertex's tangents and their cross product, matrix, position and normal.
        _ => (
            lanes
                * (9 * markers
                    + (1 + 4 + 8) * parts
                    + (10 + 6 + (4 + 12 + 15) + 9 + 9 + 15) * blocks),
            2 * lanes * blocks,
        ),
    };
    Cost {
        mul_adds,
        divisions,
        bytes_read: parts * 18 + markers * 98 + blocks * (2 * 96 + 4 * lanes + 8),
        bytes_written: blocks * lanes * 24,
    }
}
