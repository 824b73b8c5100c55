//! The first bytes of an asset: what it is, how large, and where its sections lie.

/// First eight bytes of every asset. The line ends in it show a file mangled by text conversion.
pub const MAGIC: [u8; 8] = *b"\x89SNW\r\n\x1a\n";

/// The format that this version of the core reads.
pub const VERSION: u32 = 1;

/// Sections start at multiples of this many bytes.
pub const ALIGNMENT: usize = 16;

/// Bytes before the section table.
pub const HEADER_BYTES: usize = 160;

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
pub(crate) const DIMS_WORDS: usize = 32;
/// Words beyond these are zero.
pub(crate) const DIMS_USED: usize = 21;

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
            joint_count: word(bytes, AT_DIMS),
            bind_count: word(bytes, AT_DIMS + 4),
            vertex_count: word(bytes, AT_DIMS + 8),
            block_count: word(bytes, AT_DIMS + 12),
            slot_count: word(bytes, AT_DIMS + 16),
            rigid_block_count: word(bytes, AT_DIMS + 20),
            triangle_count: word(bytes, AT_DIMS + 24),
            index_bytes: word(bytes, AT_DIMS + 28),
            part_count: word(bytes, AT_DIMS + 32),
            clip_count: word(bytes, AT_DIMS + 36),
            track_count: word(bytes, AT_DIMS + 40),
            max_clip_tracks: word(bytes, AT_DIMS + 44),
            max_track_keys: word(bytes, AT_DIMS + 48),
            key_time_count: word(bytes, AT_DIMS + 52),
            key_value_count: word(bytes, AT_DIMS + 56),
            name_bytes: word(bytes, AT_DIMS + 60),
            run_count: word(bytes, AT_DIMS + 64),
            centre_block_count: word(bytes, AT_DIMS + 68),
            morph_count: word(bytes, AT_DIMS + 72),
            morph_row_count: word(bytes, AT_DIMS + 76),
            morph_normal_count: word(bytes, AT_DIMS + 80),
        }
    }

    /// The counts as they stand in the header.
    #[must_use]
    pub const fn to_words(&self) -> [usize; DIMS_WORDS] {
        let counts: [usize; DIMS_USED] = [
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
        ];
        let mut words = [0; DIMS_WORDS];
        let mut at = 0;
        while at < DIMS_USED {
            words[at] = counts[at];
            at += 1;
        }
        words
    }
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

/// What a section holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u32)]
pub enum SectionKind {
    /// `u16 [joints]`: parent of each joint, or [`NO_PARENT`].
    Parents = u32::from_le_bytes(*b"JPAR"),
    /// `f32 [joints x 10]`: rest rotation x y z w, translation, scale.
    Rest = u32::from_le_bytes(*b"JRST"),
    /// `u16 [binds]`: joint of each bind.
    BindJoints = u32::from_le_bytes(*b"BJNT"),
    /// `f32 [binds x 12]`: inverse bind matrices, rows of 3 x 4.
    InverseBind = u32::from_le_bytes(*b"BINV"),
    /// `f32 [binds x 4]`: rotation of each inverse bind matrix.
    BindRotations = u32::from_le_bytes(*b"BROT"),
    /// `u32 [runs x 4]`: first block, blocks, slots of each block, first slot.
    Runs = u32::from_le_bytes(*b"KRUN"),
    /// `u16 [slots]`: bind of each slot.
    SlotBinds = u32::from_le_bytes(*b"SBND"),
    /// `u16 [slots x 8]`: weight of each lane.
    SlotWeights = u32::from_le_bytes(*b"SWGT"),
    /// `f32 [blocks x 3 x 8]`: rest positions, x of all lanes, then y, then z.
    Positions = u32::from_le_bytes(*b"VPOS"),
    /// `f32 [blocks x 3 x 8]`: rest normals.
    Normals = u32::from_le_bytes(*b"VNRM"),
    /// `f32 [centre blocks x 3 x 8]`: centres of rotation of blocks with two or more slots.
    Centres = u32::from_le_bytes(*b"VCOR"),
    /// `u32 [morphs x 4]`: name offset, name bytes, weight at rest (f32), 0.
    Morphs = u32::from_le_bytes(*b"MORF"),
    /// `u32 [blocks + 1]`, or empty without morphs: first row of each block, then the row count.
    MorphStarts = u32::from_le_bytes(*b"MSTA"),
    /// `u16 [rows]`: morph of each row.
    MorphIds = u32::from_le_bytes(*b"MIDS"),
    /// `f32 [rows x 3 x 8]`: offsets of positions at weight one.
    MorphOffsets = u32::from_le_bytes(*b"MOFF"),
    /// `f32 [rows x 3 x 8]`, or empty: offsets of normals.
    MorphNormals = u32::from_le_bytes(*b"MNRM"),
    /// `u32 [vertices]`: index in the source mesh of each vertex in block order.
    Order = u32::from_le_bytes(*b"VORD"),
    /// `u16` or `u32 [triangles x 3]`: vertex indices in block order.
    Triangles = u32::from_le_bytes(*b"INDX"),
    /// `u32 [parts x 4]`: name offset, name bytes, first triangle, triangle count.
    Parts = u32::from_le_bytes(*b"PART"),
    /// `u32 [clips x 8]`, see [`super::Clip`].
    Clips = u32::from_le_bytes(*b"CLIP"),
    /// `u32 [tracks x 4]`: joint, channel and interpolation; first time; keys; first value.
    Tracks = u32::from_le_bytes(*b"TRAK"),
    /// `f32 [times]`: key times in seconds.
    KeyTimes = u32::from_le_bytes(*b"KTIM"),
    /// `f32 [values]`: key values.
    KeyValues = u32::from_le_bytes(*b"KVAL"),
    /// `u32 [joints x 2]`: offset and bytes of each joint's name.
    JointNames = u32::from_le_bytes(*b"JNAM"),
    /// `u8 [name bytes]`: UTF-8.
    Names = u32::from_le_bytes(*b"NAME"),
}

impl SectionKind {
    /// All kinds, in the order in which they stand in the file.
    pub const ALL: [Self; 25] = [
        Self::Parents,
        Self::Rest,
        Self::BindJoints,
        Self::InverseBind,
        Self::BindRotations,
        Self::Runs,
        Self::SlotBinds,
        Self::SlotWeights,
        Self::Positions,
        Self::Normals,
        Self::Centres,
        Self::Morphs,
        Self::MorphStarts,
        Self::MorphIds,
        Self::MorphOffsets,
        Self::MorphNormals,
        Self::Order,
        Self::Triangles,
        Self::Parts,
        Self::Clips,
        Self::Tracks,
        Self::KeyTimes,
        Self::KeyValues,
        Self::JointNames,
        Self::Names,
    ];

    /// Length that the counts ask for; `None` where it exceeds the address space.
    #[must_use]
    pub const fn bytes(self, dims: &Dims) -> Option<usize> {
        match self {
            Self::Parents => dims.joint_count.checked_mul(2),
            Self::Rest => dims.joint_count.checked_mul(40),
            Self::BindJoints => dims.bind_count.checked_mul(2),
            Self::InverseBind => dims.bind_count.checked_mul(48),
            Self::BindRotations => dims.bind_count.checked_mul(16),
            Self::Centres => dims.centre_block_count.checked_mul(96),
            Self::Morphs => dims.morph_count.checked_mul(16),
            Self::MorphStarts if dims.morph_count == 0 => Some(0),
            Self::MorphStarts => match dims.block_count.checked_add(1) {
                Some(count) => count.checked_mul(4),
                None => None,
            },
            Self::MorphIds => dims.morph_row_count.checked_mul(2),
            Self::MorphOffsets => dims.morph_row_count.checked_mul(96),
            Self::MorphNormals => dims.morph_normal_count.checked_mul(96),
            Self::Runs => dims.run_count.checked_mul(16),
            Self::SlotBinds => dims.slot_count.checked_mul(2),
            Self::SlotWeights => dims.slot_count.checked_mul(16),
            Self::Positions | Self::Normals => dims.block_count.checked_mul(96),
            Self::Order => dims.vertex_count.checked_mul(4),
            Self::Triangles => match dims.triangle_count.checked_mul(3) {
                Some(count) => count.checked_mul(dims.index_bytes),
                None => None,
            },
            Self::Parts => dims.part_count.checked_mul(16),
            Self::Clips => dims.clip_count.checked_mul(32),
            Self::Tracks => dims.track_count.checked_mul(16),
            Self::KeyTimes => dims.key_time_count.checked_mul(4),
            Self::KeyValues => dims.key_value_count.checked_mul(4),
            Self::JointNames => dims.joint_count.checked_mul(8),
            Self::Names => Some(dims.name_bytes),
        }
    }
}
