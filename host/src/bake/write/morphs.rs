//! Morph targets, sparse: a block lists those that move one of its vertices.

use glam::DVec3;
use sinew_core::asset::{LANES, NO_PARENT, SectionKind};

use super::{BakeError, Blocks, Writer, fits, lanes, limit};
use crate::model::Morph;

impl Writer {
    pub(super) fn morphs(&mut self, morphs: &[Morph], blocks: &Blocks) -> Result<(), BakeError> {
        let count = limit("morph targets", morphs.len(), usize::from(NO_PARENT) - 1)?;
        if count == 0 {
            return Ok(());
        }
        self.dims.morph_count = count;
        let mut rows = Vec::with_capacity(count);
        for morph in morphs {
            let [offset, length] = self.name(&morph.name);
            let weight = fits(morph.rest_weight, || format!("weight of {:?}", morph.name))?;
            rows.push([offset, length, weight.to_bits(), 0]);
        }
        self.put(SectionKind::Morphs, rows.as_flattened());
        let with_normals = morphs.iter().any(|morph| !morph.normals.is_empty());
        let (mut starts, mut ids) = (vec![0_u32], Vec::new());
        let (mut offsets, mut normals) = (Vec::new(), Vec::new());
        for block in blocks.order.chunks(LANES) {
            for (index, morph) in morphs.iter().enumerate() {
                let normal = |vertex: usize| {
                    // Beyond this no two unit vectors differ.
                    let bound = DVec3::splat(2.0);
                    morph
                        .normals
                        .get(vertex)
                        .map_or(DVec3::ZERO, |n| n.clamp(-bound, bound))
                };
                let of = |vertex: usize| morph.positions[vertex];
                let block_offsets = lanes(std::iter::once(block), of, "offset")?;
                let block_normals = lanes(std::iter::once(block), normal, "normal offset")?;
                let still = |numbers: &[f32]| numbers.iter().all(|&number| number == 0.0);
                if still(&block_offsets) && still(&block_normals) {
                    continue;
                }
                ids.push(index as u16);
                offsets.extend(block_offsets);
                if with_normals {
                    normals.extend(block_normals);
                }
            }
            starts.push(ids.len() as u32);
        }
        self.dims.morph_row_count = ids.len();
        self.dims.morph_normal_count = normals.len() / (3 * LANES);
        self.put(SectionKind::MorphStarts, &starts);
        self.put(SectionKind::MorphIds, &ids);
        self.put(SectionKind::MorphOffsets, &offsets);
        self.put(SectionKind::MorphNormals, &normals);
        Ok(())
    }
}
