//! What sections there are, in which order they stand, and how long the counts make them.

use super::{Dims, LINK_NUMBERS, MARKER_NUMBERS, SEED_NUMBERS};

/// What a section holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u32)]
pub enum SectionKind {
    /// `u16 [joints]`: parent of each joint, or [`NO_PARENT`](super::NO_PARENT).
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
    /// `f32 [packed blocks x 6]`: origin and step of each block's box.
    PackedBoxes = u32::from_le_bytes(*b"QBOX"),
    /// `u16 [packed blocks x 3 x 8]`: positions in steps from the origin, instead of `VPOS`.
    PackedPositions = u32::from_le_bytes(*b"QPOS"),
    /// `i16 [packed blocks x 2 x 8]`: octahedral normals, instead of `VNRM`.
    PackedNormals = u32::from_le_bytes(*b"QNRM"),
    /// `i16 [tangent blocks x 2 x 8]`: octahedral tangents.
    Tangents = u32::from_le_bytes(*b"QTAN"),
    /// `u8 [tangent blocks]`: a bit for each lane, set where the handedness is negative.
    TangentSigns = u32::from_le_bytes(*b"QTSG"),
    /// `f32 [boxes x 6]`: low and high corner of what each bind moves, at rest.
    BindBoxes = u32::from_le_bytes(*b"BBOX"),
    /// `u16 [pairs x 2]`: binds that move a vertex together.
    BindPairs = u32::from_le_bytes(*b"BPAR"),
    /// `f32 [pairs x 6]`: low and high corner of what both move, at rest.
    PairBoxes = u32::from_le_bytes(*b"BPBX"),
    /// `u32 [levels x 4]`: offset and bytes in `LDAT`, vertices, blocks.
    Levels = u32::from_le_bytes(*b"LEVL"),
    /// `u8 [level bytes]`: coarser levels, each an asset.
    LevelData = u32::from_le_bytes(*b"LDAT"),
    /// `u32 [level sources]`: of a coarser level, the vertex of the finest that each vertex is.
    LevelSources = u32::from_le_bytes(*b"LSRC"),
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
    /// `f32 [markers x 8]`: home, deviation, memory, zeros, see [`super::MarkerTables`].
    LiveMarkers = u32::from_le_bytes(*b"TMRK"),
    /// `u16 [markers x neighbours]`: most rigid first.
    LiveNeighbours = u32::from_le_bytes(*b"TNBR"),
    /// `f32 [markers x neighbours x 16]`: shape, weight, coefficients, distance, spread, zero.
    LiveLinks = u32::from_le_bytes(*b"TLNK"),
    /// `u16 [seeds x 4]`: markers.
    LiveSeeds = u32::from_le_bytes(*b"TSED"),
    /// `f32 [seeds x 8]`: six distances, tolerance, six times the volume.
    LiveSeedShapes = u32::from_le_bytes(*b"TSHP"),
    /// `u32 [markers x 2]`: offset and bytes of each marker's name.
    LiveNames = u32::from_le_bytes(*b"TNAM"),
    /// `f32 [4]`, or empty without markers: frames a second learned from, three zeros.
    LiveRate = u32::from_le_bytes(*b"TRAT"),
    /// `f32 [markers x 3]`: rest positions of markers.
    MarkerRest = u32::from_le_bytes(*b"PRST"),
    /// `u32 [markers x 2]`: offset and bytes of each marker's name.
    MarkerNames = u32::from_le_bytes(*b"PNAM"),
    /// `u16 [parts]`: parent of each near-rigid part, or [`NO_PARENT`](super::NO_PARENT).
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
    /// `f32 [marker slots x 8]`: shares of eight positions.
    MarkerSlotShares = u32::from_le_bytes(*b"PKSH"),
    /// `u32 [blocks + 1]`: first tangent slot of each block.
    TangentSlotStarts = u32::from_le_bytes(*b"PTST"),
    /// `u16 [tangent slots]`: marker of each.
    TangentSlotMarkers = u32::from_le_bytes(*b"PTMK"),
    /// `f32 [tangent slots x 2 x 8]`: shares along two tangents.
    TangentSlotShares = u32::from_le_bytes(*b"PTSH"),
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
    /// `f32 [exact members x 4]`: position in the reference frame, share in the surface.
    ExactLocal = u32::from_le_bytes(*b"PELO"),
    /// `f32 [exact members x 10]`: pseudo-inverse of each part's transformation.
    ExactInverse = u32::from_le_bytes(*b"PEIN"),
    /// `u8 [name bytes]`: UTF-8.
    Names = u32::from_le_bytes(*b"NAME"),
    /// `f32 [joints x 3]`: rest position of each marker.
    SurfaceMarkers = u32::from_le_bytes(*b"LMRK"),
    /// `u16 [joints - 1][2]`: pairs of neighbouring markers, a tree.
    MarkerEdges = u32::from_le_bytes(*b"LEDG"),
    /// `u32 [virtual handles + 1]`: first entry of each.
    VirtualStarts = u32::from_le_bytes(*b"LVST"),
    /// `u16 [entries]`: marker of each entry.
    VirtualMarkers = u32::from_le_bytes(*b"LVMK"),
    /// `f32 [entries]`: share in the handle's rotation.
    VirtualTurns = u32::from_le_bytes(*b"LVTN"),
    /// `f32 [entries x 4]`: `b` and `n` of the handle's position.
    VirtualCoefficients = u32::from_le_bytes(*b"LVCF"),
    /// `u32 [blocks + 1]`: first slot of each block.
    HandleStarts = u32::from_le_bytes(*b"LSTA"),
    /// `u16 [slots]`: handle, markers first.
    SlotHandles = u32::from_le_bytes(*b"LHND"),
    /// `f32 [slots x 4 x 8]`: `b` and `n` of eight vertices.
    SlotCoefficients = u32::from_le_bytes(*b"LCOF"),
    /// `u32 [vertices]`: row of each vertex in block order.
    LaneRows = u32::from_le_bytes(*b"LROW"),
    /// `f32 [rows x 4]`: rest position, inverse mass.
    RowRest = u32::from_le_bytes(*b"LRES"),
    /// `f32 [rows x 4]`: differential coordinates at rest, 0.
    Differential = u32::from_le_bytes(*b"LDIF"),
    /// `u32 [rows + 1]`: first neighbour of each row.
    RowStarts = u32::from_le_bytes(*b"LNST"),
    /// `u32 [edges]`: neighbours.
    Neighbours = u32::from_le_bytes(*b"LNBR"),
    /// `f32 [edges]`: cotangent weights.
    NeighbourWeights = u32::from_le_bytes(*b"LNWT"),
    /// `u32 [joints]`: row of each marker.
    MarkerRows = u32::from_le_bytes(*b"LMRW"),
    /// `u16 [rows x 4]`: markers that guess a row's position.
    GuideMarkers = u32::from_le_bytes(*b"LGMK"),
    /// `f32 [rows x 4]`: their weights.
    GuideWeights = u32::from_le_bytes(*b"LGWT"),
    /// `u32 [4]`: supernodes, panels and quads of the harmonic factor; stiffness (f32).
    FactorSplit = u32::from_le_bytes(*b"LSPL"),
    /// `u32 [supernodes + 2]`: columns of the harmonic factor, then of the other.
    FactorColumns = u32::from_le_bytes(*b"LFCO"),
    /// `u32 [supernodes + 2]`: panels, likewise.
    FactorPanels = u32::from_le_bytes(*b"LFPN"),
    /// `u32 [panels x 4]`: rows of the panels, likewise.
    FactorRows = u32::from_le_bytes(*b"LFRW"),
    /// `f32 [quads x 4]`: values, likewise.
    FactorValues = u32::from_le_bytes(*b"LFVA"),
    /// `u16 [parts]`: parent of each part of the correctives, or [`NO_PARENT`](super::NO_PARENT).
    CorrectiveParents = u32::from_le_bytes(*b"CPAR"),
    /// `u16 [parts]`: bind of each.
    CorrectiveBinds = u32::from_le_bytes(*b"CBND"),
    /// `f32 [parts x 3]`: the place whose acceleration shakes its springs.
    CorrectivePivots = u32::from_le_bytes(*b"CPIV"),
    /// `f32 [parts x 2 x 2]`: angular frequency and damping ratio of two springs.
    CorrectiveSprings = u32::from_le_bytes(*b"CSPR"),
    /// `u32 [modes + 1]`: first term of each mode.
    CorrectiveStarts = u32::from_le_bytes(*b"CSTA"),
    /// `u16 [terms]`: feature.
    CorrectiveFeatures = u32::from_le_bytes(*b"CFEA"),
    /// `f32 [terms]`: what it adds to the mode's weight.
    CorrectiveCoefficients = u32::from_le_bytes(*b"CCOF"),
    /// `f32 [modes x 2]`: least and largest weight.
    CorrectiveRanges = u32::from_le_bytes(*b"CRNG"),
}

impl SectionKind {
    /// All kinds, in the order in which they stand in the file. Empty sections are left out there.
    pub const ALL: [Self; 108] = [
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
        Self::PackedBoxes,
        Self::PackedPositions,
        Self::PackedNormals,
        Self::Tangents,
        Self::TangentSigns,
        Self::BindBoxes,
        Self::BindPairs,
        Self::PairBoxes,
        Self::Levels,
        Self::LevelData,
        Self::LevelSources,
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
        Self::LiveMarkers,
        Self::LiveNeighbours,
        Self::LiveLinks,
        Self::LiveSeeds,
        Self::LiveSeedShapes,
        Self::LiveNames,
        Self::LiveRate,
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
        Self::TangentSlotStarts,
        Self::TangentSlotMarkers,
        Self::TangentSlotShares,
        Self::PartToLocal,
        Self::PartFromLocal,
        Self::PartDilations,
        Self::ExactStarts,
        Self::ExactMarkers,
        Self::ExactLocal,
        Self::ExactInverse,
        Self::Names,
        Self::SurfaceMarkers,
        Self::MarkerEdges,
        Self::VirtualStarts,
        Self::VirtualMarkers,
        Self::VirtualTurns,
        Self::VirtualCoefficients,
        Self::HandleStarts,
        Self::SlotHandles,
        Self::SlotCoefficients,
        Self::LaneRows,
        Self::RowRest,
        Self::Differential,
        Self::RowStarts,
        Self::Neighbours,
        Self::NeighbourWeights,
        Self::MarkerRows,
        Self::GuideMarkers,
        Self::GuideWeights,
        Self::FactorSplit,
        Self::FactorColumns,
        Self::FactorPanels,
        Self::FactorRows,
        Self::FactorValues,
        Self::CorrectiveParents,
        Self::CorrectiveBinds,
        Self::CorrectivePivots,
        Self::CorrectiveSprings,
        Self::CorrectiveStarts,
        Self::CorrectiveFeatures,
        Self::CorrectiveCoefficients,
        Self::CorrectiveRanges,
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
            Self::PackedBoxes => dims.shapes.block_count.checked_mul(24),
            Self::PackedPositions => dims.shapes.block_count.checked_mul(48),
            Self::PackedNormals => dims.shapes.block_count.checked_mul(32),
            Self::Tangents => dims.shapes.tangent_block_count.checked_mul(32),
            Self::TangentSigns => Some(dims.shapes.tangent_block_count),
            Self::BindBoxes => dims.bounds.box_count.checked_mul(24),
            Self::BindPairs => dims.bounds.pair_count.checked_mul(4),
            Self::PairBoxes => dims.bounds.pair_count.checked_mul(24),
            Self::Levels => dims.level.count.checked_mul(16),
            Self::LevelData => Some(dims.level.bytes),
            Self::LevelSources => dims.level.source_count.checked_mul(4),
            Self::Positions | Self::Normals if dims.shapes.block_count > 0 => Some(0),
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
            Self::LiveMarkers => dims.markers.marker_count.checked_mul(4 * MARKER_NUMBERS),
            Self::LiveNeighbours => dims.markers.link_count(2),
            Self::LiveLinks => dims.markers.link_count(4 * LINK_NUMBERS),
            Self::LiveSeeds => dims.markers.seed_count.checked_mul(8),
            Self::LiveSeedShapes => dims.markers.seed_count.checked_mul(4 * SEED_NUMBERS),
            Self::LiveNames => dims.markers.marker_count.checked_mul(8),
            Self::LiveRate if dims.markers.marker_count == 0 => Some(0),
            Self::LiveRate => Some(16),
            Self::Names => Some(dims.name_bytes),
            Self::CorrectiveParents
            | Self::CorrectiveBinds
            | Self::CorrectivePivots
            | Self::CorrectiveSprings
            | Self::CorrectiveStarts
            | Self::CorrectiveFeatures
            | Self::CorrectiveCoefficients
            | Self::CorrectiveRanges => dims.correctives.bytes(self),
            group => match self.laplacian_bytes(dims) {
                Some(0) => {
                    let (blocks, vertices) = (dims.block_count, dims.vertex_count);
                    dims.marker_skin.bytes(group, blocks, vertices)
                }
                found => found,
            },
        }
    }

    const fn laplacian_bytes(self, dims: &Dims) -> Option<usize> {
        let counts = &dims.laplacian;
        let (all, collapsed, exact) = (counts.is_some(), counts.is_collapsed(), counts.is_exact());
        // Number of entries, of which there are none in an asset of another kind; bytes of each.
        let (wanted, count, bytes) = match self {
            Self::SurfaceMarkers => (all, dims.joint_count, 12),
            Self::MarkerEdges => (all, dims.joint_count.saturating_sub(1), 4),
            Self::VirtualStarts => (collapsed, counts.virtual_count.saturating_add(1), 4),
            Self::VirtualMarkers => (collapsed, counts.virtual_entry_count, 2),
            Self::VirtualTurns => (collapsed, counts.virtual_entry_count, 4),
            Self::VirtualCoefficients => (collapsed, counts.virtual_entry_count, 16),
            Self::HandleStarts => (collapsed, dims.block_count.saturating_add(1), 4),
            Self::SlotHandles => (collapsed, counts.slot_count, 2),
            Self::SlotCoefficients => (collapsed, counts.slot_count, 128),
            Self::LaneRows => (exact, dims.vertex_count, 4),
            Self::RowRest | Self::Differential | Self::GuideWeights => {
                (exact, counts.row_count, 16)
            }
            Self::RowStarts => (exact, counts.row_count.saturating_add(1), 4),
            Self::Neighbours | Self::NeighbourWeights => (exact, counts.edge_count, 4),
            Self::MarkerRows => (exact, dims.joint_count, 4),
            Self::GuideMarkers => (exact, counts.row_count, 8),
            Self::FactorSplit => (exact, 1, 16),
            Self::FactorColumns | Self::FactorPanels => {
                (exact, counts.supernode_count.saturating_add(2), 4)
            }
            Self::FactorRows => (exact, counts.panel_count, 16),
            Self::FactorValues => (exact, counts.quad_count, 16),
            _ => (false, 0, 0),
        };
        if wanted {
            count.checked_mul(bytes)
        } else {
            Some(0)
        }
    }
}
