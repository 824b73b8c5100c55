//! Why an asset is refused.

use core::fmt;

use super::{SectionKind, VERSION};
use crate::deform::laplacian::LaplacianError;
use crate::deform::parts::PartsError;

/// Bytes that are not a usable asset. Each case carries the facts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AssetError {
    /// Fewer bytes than a header has.
    TooShort {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        found: usize,
    },
    /// The first eight bytes are not [`super::MAGIC`].
    NotAnAsset,
    /// A format version that this core does not read.
    Version {
        /// The version in the file.
        found: u32,
    },
    /// The header's total length is not the length of the bytes.
    Length {
        /// According to the header.
        stated: usize,
        /// Bytes given.
        found: usize,
    },
    /// The bytes were changed after the asset was written.
    Checksum {
        /// According to the header.
        stated: u32,
        /// Computed from the bytes.
        found: u32,
    },
    /// The bytes do not start at a multiple of [`super::ALIGNMENT`].
    Misaligned,
    /// A byte that must be zero is not.
    NotZero {
        /// Offset of the byte.
        at: usize,
    },
    /// Counts that contradict each other or exceed a limit.
    Counts {
        /// Index of the count in the header, see `SPEC.md`.
        index: usize,
        /// The count.
        value: usize,
    },
    /// A section table of another length than the counts ask for.
    SectionCount {
        /// Rows according to the header.
        stated: usize,
        /// Sections that are not empty, by the counts.
        expected: usize,
    },
    /// The section table does not hold the expected sections in order.
    SectionOrder {
        /// Row of the table.
        row: usize,
        /// What stands there.
        found: u32,
    },
    /// A section that does not lie where the ones before it end, or not inside the file.
    SectionPlace {
        /// The section.
        section: SectionKind,
        /// Offset according to the table.
        offset: usize,
    },
    /// A section whose length contradicts the counts.
    SectionLength {
        /// The section.
        section: SectionKind,
        /// Bytes that the counts ask for; `usize::MAX` beyond the address space.
        expected: usize,
        /// Bytes according to the table.
        found: usize,
    },
    /// An index that points at nothing, or a cyclic hierarchy.
    Index {
        /// The section.
        section: SectionKind,
        /// Which row of it.
        row: usize,
        /// The index.
        value: usize,
        /// It must be smaller than this.
        limit: usize,
    },
    /// NaN, infinite, or beyond the format's limit.
    Number {
        /// The section.
        section: SectionKind,
        /// Which number of it.
        at: usize,
    },
    /// Weights that do not sum to [`super::WEIGHT_ONE`].
    Weights {
        /// The block.
        block: usize,
        /// The vertex in the block.
        lane: usize,
        /// What they sum to.
        sum: u32,
    },
    /// A coarser level that does not fit the asset it is in.
    Level {
        /// Row of the level table.
        row: usize,
    },
    /// Tables of a marker-driven skin that are not sound.
    MarkerSkin(PartsError),
    /// Correctives whose tables contradict each other.
    Correctives(PartsError),
    /// A name that is not UTF-8.
    Name {
        /// The section that refers to it.
        section: SectionKind,
        /// Which row of it.
        row: usize,
    },
    /// Tables of a Laplacian deformer that are not usable.
    Laplacian(LaplacianError),
    /// The asset holds what this build of the core leaves out.
    NotBuilt {
        /// The feature of this crate that reads it.
        feature: &'static str,
    },
}

impl AssetError {
    /// One sentence on what to do about it.
    #[must_use]
    pub const fn hint(&self) -> &'static str {
        match self {
            Self::TooShort { .. } | Self::Length { .. } => "the file was cut short: copy it again",
            Self::NotAnAsset => "give a file that `sinew bake` wrote",
            Self::Version { .. } => "bake it again with the version that reads it",
            Self::Checksum { .. } => "the file is damaged: copy or bake it again",
            Self::NotBuilt { .. } => "build sinew-core with that feature",
            Self::Misaligned => {
                "load it to an address that is a multiple of 16, or use include_asset!"
            }
            _ => "the writer is at fault: bake it again with a current `sinew`",
        }
    }
}

impl fmt::Display for AssetError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooShort { needed, found } => {
                write!(f, "{found} bytes, where a header alone takes {needed}")
            }
            Self::NotAnAsset => write!(f, "the first bytes are not those of a sinew asset"),
            Self::Version { found } => {
                write!(f, "format version {found}, where this core reads {VERSION}")
            }
            Self::Length { stated, found } => {
                write!(f, "{found} bytes, where the header states {stated}")
            }
            Self::Checksum { stated, found } => {
                write!(
                    f,
                    "checksum {found:08x}, where the header states {stated:08x}"
                )
            }
            Self::Misaligned => write!(f, "the bytes do not start at a multiple of 16"),
            Self::NotZero { at } => write!(f, "byte {at} must be zero"),
            Self::Counts { index, value } => write!(f, "count {index} cannot be {value}"),
            Self::SectionCount { stated, expected } => {
                write!(f, "{stated} sections, where the counts ask for {expected}")
            }
            Self::SectionOrder { row, found } => {
                let name = found
                    .to_le_bytes()
                    .map(|c| if c.is_ascii_graphic() { c as char } else { '?' });
                write!(f, "section {row} is ")?;
                name.iter().try_for_each(|c| write!(f, "{c}"))?;
                write!(f, ", which does not belong there")
            }
            Self::SectionPlace { section, offset } => {
                write!(
                    f,
                    "section {section:?} lies at {offset}, which is not where it must"
                )
            }
            Self::SectionLength {
                section,
                expected,
                found,
            } => {
                write!(
                    f,
                    "section {section:?} has {found} bytes and needs {expected}"
                )
            }
            Self::Index {
                section,
                row,
                value,
                limit,
            } => {
                write!(
                    f,
                    "{section:?} {row} is {value}, which must be below {limit}"
                )
            }
            Self::Number { section, at } => {
                write!(f, "{section:?} number {at} is not finite or out of range")
            }
            Self::Weights { block, lane, sum } => {
                write!(
                    f,
                    "weights of block {block}, vertex {lane} sum to {sum}, not 65535"
                )
            }
            Self::Laplacian(error) => write!(f, "the Laplacian surface: {error}"),
            Self::Level { row } => write!(
                f,
                "coarser level {row} has another skeleton, other names or counts, or clips"
            ),
            Self::MarkerSkin(error) => write!(f, "marker-driven skin: {error}"),
            Self::Correctives(error) => write!(f, "correctives: {error}"),
            Self::NotBuilt { feature } => {
                write!(
                    f,
                    "the asset needs the feature `{feature}`, which was left out"
                )
            }
            Self::Name { section, row } => write!(f, "the name of {section:?} {row} is not UTF-8"),
        }?;
        write!(f, "; {}", self.hint())
    }
}

impl core::error::Error for AssetError {}
