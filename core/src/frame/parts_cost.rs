//! What a frame of a skin that markers drive costs.

use super::{Budget, Cost};
use crate::asset::{Dims, LANES};

/// Fits of a part's frame: the first, and those after markers that are out of place.
const FITS: u64 = 3;
/// Pairs that hold a part besides its markers: a pivot, and three for the parent's turn.
const HELD: u64 = 4;
/// A pair in one fit: its share in both centroids, then in the matrix; how far off it is, twice.
const PAIR: u64 = 7 + 12 + 2 * 12;
/// An eigenproblem: its rotations, and the quaternion's matrix and translation.
const PART: u64 = 1_500;
/// A marker carried back by blended frames, its residual measured, and put forth again.
const MARKER: u64 = 90;
/// A part's frame blended into a marker's.
const CARRIER: u64 = 12;

/// Bounds a frame of [`MarkerRig::follow`] and its stream of vertices with normals, for any input.
/// O(1); usable in a `const`.
///
/// The exact mode's bound takes all its members for those of one part, since the counts do not say
/// how they are spread; [`Exact::multiply_adds`] knows, once the asset is loaded.
///
/// [`MarkerRig::follow`]: crate::deform::parts::MarkerRig::follow
/// [`Exact::multiply_adds`]: crate::deform::parts::Exact::multiply_adds
#[must_use]
pub const fn parts_cost(dims: &Dims, budget: Budget) -> Cost {
    let counts = &dims.marker_skin;
    if counts.marker_count == 0 {
        return Cost::NONE;
    }
    let (markers, parts) = (counts.marker_count as u64, counts.part_count as u64);
    let (members, carriers) = (counts.member_count as u64, counts.carrier_count as u64);
    let follow = Cost {
        mul_adds: FITS * (PAIR * (members + HELD * parts) + PART * parts)
            + MARKER * markers
            + CARRIER * carriers,
        divisions: FITS * (members + 60 * parts) + markers,
        bytes_read: members * 6 + carriers * 6 + markers * 16 + parts * 22,
        bytes_written: 0,
    };
    follow.plus(stream(dims, budget))
}

const fn stream(dims: &Dims, budget: Budget) -> Cost {
    let counts = &dims.marker_skin;
    let all = dims.block_count as u64;
    let blocks = if (budget.blocks as u64) < all {
        budget.blocks as u64
    } else {
        all
    };
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
        // The same sums, then a skin by dual quaternions.
        _ => (
            lanes * (9 * markers + (1 + 12 + 17) * parts + 110 * blocks),
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
