//! Skin that dense markers drive.

use super::header::count;
use super::{Asset, SectionKind};
use crate::deform::parts::{
    Collapsed, Exact, ExactTables, Hybrid, MarkerRig, MarkerRigTables, MarkerSlots, PartBlocks,
    PartsError, row,
};

/// Words of the group in the header.
pub(crate) const MARKER_SKIN_WORDS: [usize; 13] =
    [36, 37, 38, 39, 40, 41, 42, 43, 47, 28, 29, 30, 31];

/// Counts of a marker-driven skin; all 0 where the asset has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MarkerSkinDims {
    /// Markers.
    pub marker_count: usize,
    /// Near-rigid parts.
    pub part_count: usize,
    /// (part, marker) pairs that fix part frames.
    pub member_count: usize,
    /// (marker, part) pairs that carry markers.
    pub carrier_count: usize,
    /// Which mode: 0 none, 1 exact, 2 collapsed, 3 hybrid, 4 hybrid with a linear blend.
    pub mode: usize,
    /// (part, eight weights) slots of all blocks.
    pub part_slot_count: usize,
    /// (marker, eight shares) slots of all blocks.
    pub marker_slot_count: usize,
    /// (part, marker) pairs of the exact mode.
    pub exact_member_count: usize,
    /// (marker, twice eight shares) slots of tangents of all blocks.
    pub tangent_slot_count: usize,
    /// Blocks that one part moves.
    pub rigid_block_count: usize,
    /// Members of the exact mode over all part slots: each slot counts those of its part.
    pub exact_pair_count: usize,
    /// Squares of the exact mode's members of each part, summed.
    pub exact_square_count: usize,
    /// Cubes of them, summed: what solving costs.
    pub exact_cube_count: usize,
}

/// Mode numbers in the header.
pub(crate) const EXACT: usize = 1;
pub(crate) const COLLAPSED: usize = 2;
pub(crate) const HYBRID: usize = 3;
pub(crate) const LINEAR_HYBRID: usize = 4;

impl MarkerSkinDims {
    pub(crate) const fn read(bytes: &[u8]) -> Self {
        Self {
            marker_count: count(bytes, MARKER_SKIN_WORDS[0]),
            part_count: count(bytes, MARKER_SKIN_WORDS[1]),
            member_count: count(bytes, MARKER_SKIN_WORDS[2]),
            carrier_count: count(bytes, MARKER_SKIN_WORDS[3]),
            mode: count(bytes, MARKER_SKIN_WORDS[4]),
            part_slot_count: count(bytes, MARKER_SKIN_WORDS[5]),
            marker_slot_count: count(bytes, MARKER_SKIN_WORDS[6]),
            exact_member_count: count(bytes, MARKER_SKIN_WORDS[7]),
            tangent_slot_count: count(bytes, MARKER_SKIN_WORDS[8]),
            rigid_block_count: count(bytes, MARKER_SKIN_WORDS[9]),
            exact_pair_count: count(bytes, MARKER_SKIN_WORDS[10]),
            exact_square_count: count(bytes, MARKER_SKIN_WORDS[11]),
            exact_cube_count: count(bytes, MARKER_SKIN_WORDS[12]),
        }
    }

    /// The words of [`MARKER_SKIN_WORDS`].
    pub(crate) const fn words(&self) -> [usize; MARKER_SKIN_WORDS.len()] {
        [
            self.marker_count,
            self.part_count,
            self.member_count,
            self.carrier_count,
            self.mode,
            self.part_slot_count,
            self.marker_slot_count,
            self.exact_member_count,
            self.tangent_slot_count,
            self.rigid_block_count,
            self.exact_pair_count,
            self.exact_square_count,
            self.exact_cube_count,
        ]
    }

    /// Length of a section of this group in an asset of so many blocks and vertices; `None` beyond
    /// the address space.
    pub(crate) const fn bytes(
        &self,
        kind: SectionKind,
        blocks: usize,
        vertices: usize,
    ) -> Option<usize> {
        use SectionKind as K;
        let parts_move = matches!(self.mode, EXACT | HYBRID | LINEAR_HYBRID);
        let markers_move = matches!(self.mode, COLLAPSED | HYBRID | LINEAR_HYBRID);
        let (rows, width) = match kind {
            K::MarkerRest => (self.marker_count, 12),
            K::MarkerNames => (self.marker_count, 8),
            K::PartParents => (self.part_count, 2),
            K::PartPivots => (self.part_count, 16),
            K::MemberStarts => (starts(self.part_count), 4),
            K::MemberMarkers => (self.member_count, 2),
            K::MemberWeights => (self.member_count, 4),
            K::CarrierStarts => (starts(self.marker_count), 4),
            K::CarrierParts => (self.carrier_count, 2),
            K::CarrierWeights => (self.carrier_count, 4),
            K::MarkerNumbers => (if self.marker_count > 0 { 2 } else { 0 }, 4),
            K::MarkerSkinOrder => (if self.mode > 0 { vertices } else { 0 }, 4),
            K::PartPositions | K::PartNormals => (if parts_move { blocks } else { 0 }, 96),
            K::PartSlotStarts => (if parts_move { starts(blocks) } else { 0 }, 4),
            K::PartSlotParts => (self.part_slot_count, 2),
            K::PartSlotWeights => (self.part_slot_count, 16),
            K::PartSlotGradients => (
                if self.mode == EXACT {
                    self.part_slot_count
                } else {
                    0
                },
                64,
            ),
            K::MarkerSlotStarts => (if markers_move { starts(blocks) } else { 0 }, 4),
            K::MarkerSlotMarkers => (self.marker_slot_count, 2),
            K::MarkerSlotShares => (self.marker_slot_count, 32),
            K::TangentSlotStarts => (if markers_move { starts(blocks) } else { 0 }, 4),
            K::TangentSlotMarkers => (self.tangent_slot_count, 2),
            K::TangentSlotShares => (self.tangent_slot_count, 64),
            K::PartToLocal | K::PartFromLocal => (self.exact_parts(), 48),
            K::PartDilations => (self.exact_parts(), 4),
            K::ExactStarts => (starts(self.exact_parts()), 4),
            K::ExactMarkers => (self.exact_member_count, 2),
            K::ExactLocal => (self.exact_member_count, 16),
            K::ExactInverse => (self.exact_member_count, 40),
            _ => (0, 0),
        };
        rows.checked_mul(width)
    }

    const fn exact_parts(&self) -> usize {
        if self.mode == EXACT {
            self.part_count
        } else {
            0
        }
    }
}

/// Rows of a table of starts: none for an empty table.
const fn starts(rows: usize) -> usize {
    if rows == 0 { 0 } else { rows.saturating_add(1) }
}

/// The group's sections, not yet looked into.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MarkerSkinSections<'a> {
    pub rig: MarkerRigTables<'a>,
    pub blocks: PartBlocks<'a>,
    pub slots: MarkerSlots<'a>,
    pub exact: ExactTables<'a>,
}

/// A marker-driven skin of an asset, checked.
#[derive(Clone, Copy, Debug)]
pub struct MarkerSkin<'a> {
    /// From markers to part frames.
    pub rig: MarkerRig<'a>,
    /// From both to vertices.
    pub mode: MarkerMode<'a>,
}

/// How markers move vertices.
#[derive(Clone, Copy, Debug)]
pub enum MarkerMode<'a> {
    /// Quadratic parts with radial-basis residuals.
    Exact(Exact<'a>),
    /// A fixed sum over markers.
    Collapsed(Collapsed<'a>),
    /// Skinning on part frames, over a rest shape that residuals displace.
    Hybrid(Hybrid<'a>),
}

impl MarkerMode<'_> {
    /// The word for it.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Exact(_) => "parts",
            Self::Collapsed(_) => "collapsed",
            Self::Hybrid(_) => "hybrid",
        }
    }
}

impl<'a> MarkerSkinSections<'a> {
    /// Proves the sections sound.
    pub(crate) fn check(self, dims: &MarkerSkinDims) -> Result<MarkerSkin<'a>, PartsError> {
        let rig = MarkerRig::new_checked(self.rig)?;
        let rig = rig.with_linear_blend(dims.mode == LINEAR_HYBRID);
        let counts = (dims.part_count, dims.marker_count);
        let mode = match dims.mode {
            EXACT => MarkerMode::Exact(Exact::new_checked(self.exact, dims.marker_count)?),
            COLLAPSED => MarkerMode::Collapsed(Collapsed::new_checked(
                self.blocks.order,
                self.slots,
                dims.marker_count,
            )?),
            _ => MarkerMode::Hybrid(Hybrid::new_checked(self.blocks, self.slots, counts)?),
        };
        Ok(MarkerSkin { rig, mode })
    }
}

impl MarkerSkin<'_> {
    /// The counts that the tables give, of rigid blocks, exact pairs, squares and cubes; `None` for
    /// one beyond 32 bits. O(blocks + slots)
    pub(crate) fn spread(&self) -> Option<[usize; 4]> {
        let (blocks, members) = match &self.mode {
            MarkerMode::Exact(exact) => (exact.tables().blocks, exact.tables().member_starts),
            MarkerMode::Collapsed(_) => return Some([0; 4]),
            MarkerMode::Hybrid(hybrid) => (*hybrid.part_blocks(), &[][..]),
        };
        let length = |starts, at| row(starts, at).len() as u32;
        let rigid = (0..blocks.block_count()).filter(|&block| length(blocks.starts, block) == 1);
        let (mut pairs, mut squares, mut cubes) = (0_u32, 0_u32, 0_u32);
        for &part in blocks.parts {
            pairs = pairs.checked_add(length(members, usize::from(part)))?;
        }
        for part in 0..members.len().saturating_sub(1) {
            let count = length(members, part);
            let square = count.checked_mul(count)?;
            squares = squares.checked_add(square)?;
            cubes = cubes.checked_add(square.checked_mul(count)?)?;
        }
        let [pairs, squares, cubes] = [pairs, squares, cubes].map(|count| count as usize);
        Some([rigid.count(), pairs, squares, cubes])
    }
}

impl<'a> Asset<'a> {
    /// The marker-driven skin; `None` for an asset without.
    #[must_use]
    pub fn marker_skin(&self) -> Option<MarkerSkin<'a>> {
        self.marker_skin
    }

    /// Name of a marker; empty for one that does not exist.
    #[must_use]
    pub fn marker_name(&self, marker: usize) -> &'a str {
        match self.marker_names.get(marker) {
            Some(&[offset, length]) => self.name(offset, length),
            None => "",
        }
    }
}
