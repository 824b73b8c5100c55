//! A skin that markers drive: rig and one mode.

use sinew_core::asset::{MarkerSkinDims, SectionKind as K};

use super::{BakeError, Writer, limit};
use crate::fit::parts::{BlockTables, ModeData, RigTables, SlotTables};

/// A marker-driven skin as the asset holds it.
#[derive(Clone, Debug, PartialEq)]
pub struct MarkerSkinData {
    /// `[markers]`: names.
    pub names: Vec<String>,
    /// From markers to part frames.
    pub rig: RigTables,
    /// From both to vertices.
    pub mode: ModeData,
}

impl Writer {
    pub(super) fn marker_skin(&mut self, skin: &MarkerSkinData) -> Result<(), BakeError> {
        let rig = &skin.rig;
        let most = usize::from(u16::MAX) - 1;
        self.dims.marker_skin = MarkerSkinDims {
            marker_count: limit("markers", rig.rest.len(), most)?,
            part_count: limit("near-rigid parts", rig.parents.len(), most)?,
            member_count: rig.member_markers.len(),
            carrier_count: rig.carrier_parts.len(),
            mode: match &skin.mode {
                ModeData::Exact { .. } => 1,
                ModeData::Collapsed { .. } => 2,
                ModeData::Hybrid { linear, .. } => 3 + usize::from(*linear),
            },
            ..MarkerSkinDims::default()
        };
        let names: Vec<[u32; 2]> = skin.names.iter().map(|name| self.name(name)).collect();
        self.put(K::MarkerNames, names.as_flattened());
        self.put(K::MarkerRest, rig.rest.as_flattened());
        self.put(K::PartParents, &rig.parents);
        self.put(K::PartPivots, rig.pivots.as_flattened());
        self.put(K::MemberStarts, &rig.member_starts);
        self.put(K::MemberMarkers, &rig.member_markers);
        self.put(K::MemberWeights, &rig.member_weights);
        self.put(K::CarrierStarts, &rig.carrier_starts);
        self.put(K::CarrierParts, &rig.carrier_parts);
        self.put(K::CarrierWeights, &rig.carrier_weights);
        self.put(K::MarkerSkinOrder, skin.mode.order());
        let mut smoothing = 0.0;
        match &skin.mode {
            ModeData::Collapsed { slots, .. } => self.marker_slots(slots),
            ModeData::Hybrid { blocks, slots, .. } => {
                self.part_blocks(blocks);
                self.marker_slots(slots);
            }
            ModeData::Exact { blocks, modes } => {
                self.part_blocks(blocks);
                smoothing = modes.smoothing;
                let members = row_lengths(&modes.member_starts);
                let dims = &mut self.dims.marker_skin;
                dims.exact_member_count = modes.member_markers.len();
                let of_part = |&part: &u16| members[usize::from(part)];
                dims.exact_pair_count = blocks.parts.iter().map(of_part).sum();
                dims.exact_square_count = members.iter().map(|n| n * n).sum();
                dims.exact_cube_count = members.iter().map(|n| n * n * n).sum();
                let gradients = modes.gradients.as_flattened().as_flattened();
                self.put(K::PartSlotGradients, gradients);
                self.put(K::PartToLocal, modes.to_local.as_flattened());
                self.put(K::PartFromLocal, modes.from_local.as_flattened());
                self.put(K::PartDilations, &modes.dilations);
                self.put(K::ExactStarts, &modes.member_starts);
                self.put(K::ExactMarkers, &modes.member_markers);
                self.put(K::ExactLocal, modes.member_local.as_flattened());
                self.put(K::ExactInverse, modes.member_inverse.as_flattened());
            }
        }
        self.put(K::MarkerNumbers, &[rig.residual_limit, smoothing]);
        Ok(())
    }

    fn part_blocks(&mut self, blocks: &BlockTables) {
        self.dims.marker_skin.part_slot_count = blocks.parts.len();
        let rigid = row_lengths(&blocks.starts).into_iter().filter(|&n| n == 1);
        self.dims.marker_skin.rigid_block_count = rigid.count();
        let flat = |lanes: &[[[f32; 8]; 3]]| lanes.as_flattened().as_flattened().to_vec();
        self.put(K::PartPositions, &flat(&blocks.positions));
        self.put(K::PartNormals, &flat(&blocks.normals));
        self.put(K::PartSlotStarts, &blocks.starts);
        self.put(K::PartSlotParts, &blocks.parts);
        self.put(K::PartSlotWeights, blocks.weights.as_flattened());
    }

    fn marker_slots(
        &mut self,
        SlotTables {
            positions,
            tangents,
        }: &SlotTables,
    ) {
        self.dims.marker_skin.marker_slot_count = positions.markers.len();
        self.put(K::MarkerSlotStarts, &positions.starts);
        self.put(K::MarkerSlotMarkers, &positions.markers);
        self.put(K::MarkerSlotShares, positions.shares.as_flattened());
        self.dims.marker_skin.tangent_slot_count = tangents.markers.len();
        self.put(K::TangentSlotStarts, &tangents.starts);
        self.put(K::TangentSlotMarkers, &tangents.markers);
        let shares = tangents.shares.as_flattened().as_flattened();
        self.put(K::TangentSlotShares, shares);
    }
}

/// How many entries each row of a table has.
fn row_lengths(starts: &[u32]) -> Vec<usize> {
    let rows = starts.windows(2);
    rows.map(|ends| (ends[1] - ends[0]) as usize).collect()
}
