//! Boxes at rest, from which a posed avatar's bounds follow.

/// Counts of boxes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BoundsDims {
    /// Boxes of binds: as many as binds, or none.
    pub box_count: usize,
    /// Boxes of what two binds move together.
    pub pair_count: usize,
}

/// The group's sections. A box is its low corner, then its high corner, metres, mesh space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RestBounds<'a> {
    /// `[binds]`: vertices that the bind moves; low above high where there is none.
    pub boxes: &'a [[f32; 6]],
    /// `[pairs]`: two binds.
    pub pairs: &'a [[u16; 2]],
    /// `[pairs]`: vertices that both move.
    pub pair_boxes: &'a [[f32; 6]],
}
