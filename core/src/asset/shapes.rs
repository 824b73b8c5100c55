//! Rest shapes in 16-bit numbers, and tangents.

use super::LANES;

/// Counts of what is stored in 16-bit numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ShapeDims {
    /// Blocks whose positions and normals are packed: all or none.
    pub block_count: usize,
    /// Blocks with tangents: all or none.
    pub tangent_block_count: usize,
}

/// Positions of a block in its box: `origin + step * number`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackedBox {
    /// x, y, z in metres.
    pub origin: [f32; 3],
    /// Metres, not negative.
    pub step: [f32; 3],
}

/// The group's sections.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shapes<'a> {
    /// `[blocks]`: origin, then step.
    pub boxes: &'a [[f32; 6]],
    /// `[blocks]`
    pub positions: &'a [[[u16; LANES]; 3]],
    /// `[blocks]`: octahedral.
    pub normals: &'a [[[i16; LANES]; 2]],
    /// `[blocks]`: octahedral.
    pub tangents: &'a [[[i16; LANES]; 2]],
    /// `[blocks]`: bit of a lane set where the handedness is negative.
    pub tangent_signs: &'a [u8],
}

impl Shapes<'_> {
    pub fn packed_box(&self, block: usize) -> PackedBox {
        let &[ox, oy, oz, sx, sy, sz] = self.boxes.get(block).unwrap_or(&[0.0; 6]);
        PackedBox {
            origin: [ox, oy, oz],
            step: [sx, sy, sz],
        }
    }
}
