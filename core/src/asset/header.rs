//! The first bytes of an asset: what it is, how large, and where its sections lie.

use super::bounds::BoundsDims;
use super::laplacian::LaplacianDims;
use super::levels::LevelDims;
use super::marker_skin::{MARKER_SKIN_WORDS, MarkerSkinDims};
use super::shapes::ShapeDims;
use super::{CorrectiveDims, MarkerDims, PackedDims};

/// First eight bytes of every asset. The line ends in it show a file mangled by text conversion.
pub const MAGIC: [u8; 8] = *b"\x89SNW\r\n\x1a\n";

/// The format that this version of the core reads.
pub const VERSION: u32 = 1;

/// Sections start at multiples of this many bytes.
pub const ALIGNMENT: usize = 16;

/// Bytes before the section table.
pub const HEADER_BYTES: usize = 288;

/// Bytes of one row of the section table.
pub const SECTION_ROW_BYTES: usize = 16;

/// Vertices in a block.
pub const LANES: usize = 8;

/// Skin weights are integers; those of a vertex sum to this.
pub const WEIGHT_ONE: u16 = u16::MAX;

/// "No parent" in the parents' section.
pub const NO_PARENT: u16 = 0xFFFF;

/// Numbers in the asset are at most this large, so that no product in a frame overflows.
pub const LARGEST: f32 = 1e6;

/// Morph weights are at most this large.
pub const LARGEST_WEIGHT: f32 = 1e3;

pub(crate) const AT_VERSION: usize = 8;
pub(crate) const AT_TOTAL_BYTES: usize = 12;
pub(crate) const AT_CHECKSUM: usize = 16;
/// The checksum covers everything from here on.
pub(crate) const AT_CHECKED: usize = 20;
pub(crate) const AT_SECTION_COUNT: usize = 20;
pub(crate) const AT_RESERVED: usize = 24;
pub(crate) const AT_DIMS: usize = 32;
pub(crate) const DIMS_WORDS: usize = 64;
/// First word of a group's counts.
pub(crate) const LAPLACIAN: usize = 48;

/// All counts of an asset. They size every buffer and bound the cost of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Dims {
    /// Joints of the skeleton, helpers included.
    pub joint_count: usize,
    /// (joint, inverse bind matrix) pairs: rows of the joint palette.
    pub bind_count: usize,
    /// Vertices of the mesh.
    pub vertex_count: usize,
    /// Blocks of eight vertices.
    pub block_count: usize,
    /// (bind, eight weights) slots of all blocks together.
    pub slot_count: usize,
    /// Blocks that have one slot and so need no blending.
    pub rigid_block_count: usize,
    /// Stretches of blocks that have the same number of slots.
    pub run_count: usize,
    /// Blocks with centres of rotation: all that need blending, or none.
    pub centre_block_count: usize,
    /// Morph targets.
    pub morph_count: usize,
    /// (morph, eight offsets) rows of all blocks together.
    pub morph_row_count: usize,
    /// Rows that move normals too: all or none.
    pub morph_normal_count: usize,
    /// What is stored in 16-bit numbers.
    pub shapes: ShapeDims,
    /// Boxes at rest.
    pub bounds: BoundsDims,
    /// Coarser levels.
    pub level: LevelDims,
    /// Triangles of the mesh.
    pub triangle_count: usize,
    /// Bytes of a vertex index, 2 or 4.
    pub index_bytes: usize,
    /// Named ranges of triangles.
    pub part_count: usize,
    /// Clips.
    pub clip_count: usize,
    /// Tracks of all clips.
    pub track_count: usize,
    /// Tracks of the clip that has most.
    pub max_clip_tracks: usize,
    /// Keys of the track that has most.
    pub max_track_keys: usize,
    /// Key times stored.
    pub key_time_count: usize,
    /// Numbers in all key values together.
    pub key_value_count: usize,
    /// Bytes of all names together.
    pub name_bytes: usize,
    /// A surface that follows its joints as markers.
    pub laplacian: LaplacianDims,
    /// The marker set; zeros without.
    pub markers: MarkerDims,
    /// The skin that markers drive.
    pub marker_skin: MarkerSkinDims,
    /// Compressed tracks.
    pub packed: PackedDims,
    /// Morph targets that follow the skeleton.
    pub correctives: CorrectiveDims,
}

impl Dims {
    /// The counts in an asset's header, for array sizes at compile time.
    ///
    /// ```
    /// use sinew_core::asset::Dims;
    /// # const BYTES: &[u8] = sinew_core::include_asset!("../../../tests/golden/arm.sinew");
    /// const DIMS: Dims = Dims::of(BYTES);
    /// static PALETTE: [[f32; 12]; DIMS.bind_count] = [[0.0; 12]; DIMS.bind_count];
    /// ```
    ///
    /// Only the magic and the version are looked at here; [`Asset::new_checked`] proves the rest.
    ///
    /// # Panics
    /// When the bytes are too short or are no asset of this version: in a `const`, the build fails.
    ///
    /// [`Asset::new_checked`]: super::Asset::new_checked
    #[must_use]
    pub const fn of(bytes: &[u8]) -> Self {
        assert!(bytes.len() >= HEADER_BYTES, "not a sinew asset: too short");
        let mut at = 0;
        while at < MAGIC.len() {
            assert!(bytes[at] == MAGIC[at], "not a sinew asset: wrong magic");
            at += 1;
        }
        let version = word(bytes, AT_VERSION);
        assert!(
            version == VERSION as usize,
            "an asset of another version: bake it again"
        );
        Self::read(bytes)
    }

    /// `bytes` holds at least [`HEADER_BYTES`].
    pub(crate) const fn read(bytes: &[u8]) -> Self {
        Self {
            joint_count: count(bytes, 0),
            bind_count: count(bytes, 1),
            vertex_count: count(bytes, 2),
            block_count: count(bytes, 3),
            slot_count: count(bytes, 4),
            rigid_block_count: count(bytes, 5),
            triangle_count: count(bytes, 6),
            index_bytes: count(bytes, 7),
            part_count: count(bytes, 8),
            clip_count: count(bytes, 9),
            track_count: count(bytes, 10),
            max_clip_tracks: count(bytes, 11),
            max_track_keys: count(bytes, 12),
            key_time_count: count(bytes, 13),
            key_value_count: count(bytes, 14),
            name_bytes: count(bytes, 15),
            run_count: count(bytes, 16),
            centre_block_count: count(bytes, 17),
            morph_count: count(bytes, 18),
            morph_row_count: count(bytes, 19),
            morph_normal_count: count(bytes, 20),
            laplacian: LaplacianDims::from_words(counts(bytes, LAPLACIAN)),
            shapes: ShapeDims {
                block_count: count(bytes, 21),
                tangent_block_count: count(bytes, 22),
            },
            bounds: BoundsDims {
                box_count: count(bytes, 23),
                pair_count: count(bytes, 24),
            },
            level: LevelDims {
                count: count(bytes, 25),
                bytes: count(bytes, 26),
                source_count: count(bytes, 27),
            },
            markers: MarkerDims::read(bytes),
            marker_skin: MarkerSkinDims::read(bytes),
            packed: PackedDims::read(bytes),
            correctives: CorrectiveDims::read(bytes),
        }
    }

    /// The counts as they stand in the header; words that no count uses are 0.
    #[must_use]
    pub const fn to_words(&self) -> [usize; DIMS_WORDS] {
        let counts = [
            self.joint_count,
            self.bind_count,
            self.vertex_count,
            self.block_count,
            self.slot_count,
            self.rigid_block_count,
            self.triangle_count,
            self.index_bytes,
            self.part_count,
            self.clip_count,
            self.track_count,
            self.max_clip_tracks,
            self.max_track_keys,
            self.key_time_count,
            self.key_value_count,
            self.name_bytes,
            self.run_count,
            self.centre_block_count,
            self.morph_count,
            self.morph_row_count,
            self.morph_normal_count,
            self.shapes.block_count,
            self.shapes.tangent_block_count,
            self.bounds.box_count,
            self.bounds.pair_count,
            self.level.count,
            self.level.bytes,
            self.level.source_count,
        ];
        let mut words = [0; DIMS_WORDS];
        let mut at = 0;
        while at < counts.len() {
            words[at] = counts[at];
            at += 1;
        }
        let counts = self.laplacian.to_words();
        at = 0;
        while at < counts.len() {
            words[LAPLACIAN + at] = counts[at];
            at += 1;
        }
        self.markers.write(&mut words);
        let counts = self.marker_skin.words();
        at = 0;
        while at < counts.len() {
            words[MARKER_SKIN_WORDS[at]] = counts[at];
            at += 1;
        }
        let packed = self.packed.to_words();
        at = 0;
        while at < packed.len() {
            words[PackedDims::WORD + at] = packed[at];
            at += 1;
        }
        let correctives = self.correctives.to_words();
        at = 0;
        while at < correctives.len() {
            words[CorrectiveDims::WORD + at] = correctives[at];
            at += 1;
        }
        words
    }
}

/// Counts that stand one after another from `first` on.
const fn counts<const N: usize>(bytes: &[u8], first: usize) -> [usize; N] {
    let mut counts = [0; N];
    let mut at = 0;
    while at < N {
        counts[at] = count(bytes, first + at);
        at += 1;
    }
    counts
}

/// A count of the header by its number in `SPEC.md`.
pub(crate) const fn count(bytes: &[u8], index: usize) -> usize {
    word(bytes, AT_DIMS + 4 * index)
}

/// A little-endian 32-bit word, or 0 beyond the end.
pub(crate) const fn word(bytes: &[u8], at: usize) -> usize {
    if let Some((_, from)) = bytes.split_at_checked(at)
        && let Some(word) = from.first_chunk()
    {
        u32::from_le_bytes(*word) as usize
    } else {
        0
    }
}
