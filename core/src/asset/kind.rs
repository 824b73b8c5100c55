//! What sections there are, in which order they stand, and how long the counts make them.

use super::Dims;

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
    /// `u32 [packed tracks x 4]`: joint and channel; first frame; keys; first value.
    PackedTracks = u32::from_le_bytes(*b"KPTK"),
    /// `u16 [frames]`: frames of the keys of packed tracks.
    PackedFrames = u32::from_le_bytes(*b"KPFR"),
    /// `u16 [values]`: ranges and keys of packed tracks.
    PackedValues = u32::from_le_bytes(*b"KPVL"),
    /// `u32 [joints x 2]`: offset and bytes of each joint's name.
    JointNames = u32::from_le_bytes(*b"JNAM"),
    /// `f32 [markers x 3]`: rest positions of markers.
    MarkerRest = u32::from_le_bytes(*b"PRST"),
    /// `u32 [markers x 2]`: offset and bytes of each marker's name.
    MarkerNames = u32::from_le_bytes(*b"PNAM"),
    /// `u16 [parts]`: parent of each near-rigid part, or [`NO_PARENT`].
    PartParents = u32::from_le_bytes(*b"PPAR"),
    /// `f32 [parts x 4]`: the joint that holds each part to its parent, and its weight.
    PartPivots = u32::from_le_bytes(*b"PPIV"),
    /// `u32 [parts + 1]`: first member of each part.
    MemberStarts = u32::from_le_bytes(*b"PMST"),
    /// `u16 [members]`: markers that fix part frames.
    MemberMarkers = u32::from_le_bytes(*b"PMMK"),
    /// `f32 [members]`: how much each counts.
    MemberWeights = u32::from_le_bytes(*b"PMWT"),
    /// `u32 [markers + 1]`: first carrier of each marker.
    CarrierStarts = u32::from_le_bytes(*b"PCST"),
    /// `u16 [carriers]`: parts that carry markers.
    CarrierParts = u32::from_le_bytes(*b"PCPT"),
    /// `f32 [carriers]`: their weights.
    CarrierWeights = u32::from_le_bytes(*b"PCWT"),
    /// `f32 [2]`: longest residual, smoothing of the radial basis.
    MarkerNumbers = u32::from_le_bytes(*b"PNUM"),
    /// `u32 [vertices]`: source vertex of each lane of the marker-driven blocks.
    MarkerSkinOrder = u32::from_le_bytes(*b"PORD"),
    /// `f32 [blocks x 3 x 8]`: rest positions in that order.
    PartPositions = u32::from_le_bytes(*b"PPOS"),
    /// `f32 [blocks x 3 x 8]`: rest normals.
    PartNormals = u32::from_le_bytes(*b"PNRM"),
    /// `u32 [blocks + 1]`: first part slot of each block.
    PartSlotStarts = u32::from_le_bytes(*b"PSST"),
    /// `u16 [part slots]`: part of each.
    PartSlotParts = u32::from_le_bytes(*b"PSPT"),
    /// `u16 [part slots x 8]`: weight of each lane.
    PartSlotWeights = u32::from_le_bytes(*b"PSWT"),
    /// `f32 [part slots x 2 x 8]`: change of the weights along two tangents.
    PartSlotGradients = u32::from_le_bytes(*b"PSGR"),
    /// `u32 [blocks + 1]`: first marker slot of each block.
    MarkerSlotStarts = u32::from_le_bytes(*b"PKST"),
    /// `u16 [marker slots]`: marker of each.
    MarkerSlotMarkers = u32::from_le_bytes(*b"PKMK"),
    /// `f32 [marker slots x 3 x 8]`: shares of position and two tangents.
    MarkerSlotShares = u32::from_le_bytes(*b"PKSH"),
    /// `f32 [parts x 12]`: rest pose to reference frames.
    PartToLocal = u32::from_le_bytes(*b"PTOL"),
    /// `f32 [parts x 12]`: the inverse.
    PartFromLocal = u32::from_le_bytes(*b"PFRL"),
    /// `f32 [parts]`: two over the support of the radial basis.
    PartDilations = u32::from_le_bytes(*b"PDIL"),
    /// `u32 [parts + 1]`: first member of each part in the exact mode.
    ExactStarts = u32::from_le_bytes(*b"PEST"),
    /// `u16 [exact members]`: markers.
    ExactMarkers = u32::from_le_bytes(*b"PEMK"),
    /// `f32 [exact members x 3]`: positions in reference frames.
    ExactLocal = u32::from_le_bytes(*b"PELO"),
    /// `f32 [exact members x 10]`: pseudo-inverse of each part's transformation.
    ExactInverse = u32::from_le_bytes(*b"PEIN"),
    /// `u8 [name bytes]`: UTF-8.
    Names = u32::from_le_bytes(*b"NAME"),
}

impl SectionKind {
    /// All kinds, in the order in which they stand in the file. Empty sections are left out there.
    pub const ALL: [Self; 56] = [
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
        Self::PackedTracks,
        Self::PackedFrames,
        Self::PackedValues,
        Self::JointNames,
        Self::MarkerRest,
        Self::MarkerNames,
        Self::PartParents,
        Self::PartPivots,
        Self::MemberStarts,
        Self::MemberMarkers,
        Self::MemberWeights,
        Self::CarrierStarts,
        Self::CarrierParts,
        Self::CarrierWeights,
        Self::MarkerNumbers,
        Self::MarkerSkinOrder,
        Self::PartPositions,
        Self::PartNormals,
        Self::PartSlotStarts,
        Self::PartSlotParts,
        Self::PartSlotWeights,
        Self::PartSlotGradients,
        Self::MarkerSlotStarts,
        Self::MarkerSlotMarkers,
        Self::MarkerSlotShares,
        Self::PartToLocal,
        Self::PartFromLocal,
        Self::PartDilations,
        Self::ExactStarts,
        Self::ExactMarkers,
        Self::ExactLocal,
        Self::ExactInverse,
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
            Self::PackedTracks => dims.packed.track_count.checked_mul(16),
            Self::PackedFrames => dims.packed.frame_count.checked_mul(2),
            Self::PackedValues => dims.packed.value_count.checked_mul(2),
            Self::JointNames => dims.joint_count.checked_mul(8),
            Self::Names => Some(dims.name_bytes),
            group => dims
                .marker_skin
                .bytes(group, dims.block_count, dims.vertex_count),
        }
    }
}
