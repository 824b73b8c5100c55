//! Correctives: morph targets whose weights follow from how the skeleton moves.

use super::header::count;
use super::{Asset, SectionKind};
use crate::deform::parts::Corrective;

/// Counts of the correctives; all 0 where the asset has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CorrectiveDims {
    /// Near-rigid parts.
    pub part_count: usize,
    /// Modes: the last morph targets.
    pub mode_count: usize,
    /// (mode, feature) pairs.
    pub term_count: usize,
}

impl CorrectiveDims {
    /// Its first word in the header.
    pub(super) const WORD: usize = 44;

    pub(super) const fn read(bytes: &[u8]) -> Self {
        Self {
            part_count: count(bytes, Self::WORD),
            mode_count: count(bytes, Self::WORD + 1),
            term_count: count(bytes, Self::WORD + 2),
        }
    }

    pub(super) const fn to_words(self) -> [usize; 3] {
        [self.part_count, self.mode_count, self.term_count]
    }

    /// Length of a section of this group; `None` beyond the address space.
    pub(super) const fn bytes(&self, kind: SectionKind) -> Option<usize> {
        use SectionKind as K;
        let (rows, width) = match kind {
            K::CorrectiveParents | K::CorrectiveBinds => (self.part_count, 2),
            K::CorrectivePivots => (self.part_count, 12),
            K::CorrectiveSprings => (self.part_count, 16),
            K::CorrectiveStarts if self.mode_count == 0 => (0, 4),
            K::CorrectiveStarts => (self.mode_count.saturating_add(1), 4),
            K::CorrectiveFeatures => (self.term_count, 2),
            K::CorrectiveCoefficients => (self.term_count, 4),
            K::CorrectiveRanges => (self.mode_count, 8),
            _ => (0, 0),
        };
        rows.checked_mul(width)
    }
}

impl<'a> Asset<'a> {
    /// What predicts the weights of the last morph targets; `None` for an asset without.
    #[must_use]
    pub fn corrective(&self) -> Option<Corrective<'a>> {
        self.corrective
    }
}
