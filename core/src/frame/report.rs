//! What a frame did.

use core::ops::BitOr;

/// What was odd about a frame. Several can hold at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Flags(u8);

impl Flags {
    /// Nothing odd.
    pub const NONE: Self = Self(0);
    /// Some joint's input was not finite or out of range; it kept its last good transform.
    pub const BAD_INPUT: Self = Self(1);
    /// The input names a clip that the asset does not have; the last pose was kept.
    pub const UNKNOWN_CLIP: Self = Self(2);
    /// A pose of fewer joints than the skeleton has; the others kept theirs.
    pub const SHORT_POSE: Self = Self(4);
    /// A joint's matrix left the range of numbers; it took its parent's.
    pub const OVERFLOW: Self = Self(8);
    /// The output was made for another asset; nothing was written.
    pub const WRONG_OUTPUT: Self = Self(16);

    /// Whether all of `other` hold.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether nothing was odd.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// All as bits, for other languages.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }
}

impl BitOr for Flags {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl core::ops::BitOrAssign for Flags {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

/// What a frame did and what it left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct FrameReport {
    /// What was odd.
    pub flags: Flags,
    /// Joints that kept an older transform because their input was unusable.
    pub held_joints: usize,
    /// Morph targets that kept an older weight because theirs was unusable.
    pub held_morphs: usize,
    /// Blocks of vertices that this frame brought up to date.
    pub blocks_done: usize,
    /// Blocks that still show an older frame because the budget ran out.
    pub blocks_left: usize,
}
