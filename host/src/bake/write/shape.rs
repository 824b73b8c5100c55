//! Packed shapes, tangents, boxes and coarser levels.

use glam::DVec3;
use sinew_core::asset::{ALIGNMENT, Dims, SectionKind};

use super::super::bounds::RestBounds;
use super::super::quantise::{self, Packed};
use super::{BakeError, Blocks, Writer, fits};
use crate::bake::clips::SparseClips;
use crate::model::{Avatar, Mesh};

/// A coarser mesh, ready to be written.
#[derive(Clone, Debug)]
pub struct Level {
    /// Its mesh and skin, with the skeleton of the whole and no clips.
    pub avatar: Avatar,
    /// Its blocks.
    pub blocks: Blocks,
    /// `[vertices]`: centres of rotation, where the whole has them.
    pub centres: Option<Vec<DVec3>>,
    /// Where the whole is packed.
    pub packed: Option<Packed>,
    /// `[vertices]`: vertex of the finest level.
    pub source: Vec<u32>,
}

impl Writer {
    pub(super) fn packed(&mut self, packed: &Packed) {
        self.dims.shapes.block_count = packed.boxes.len();
        self.put(SectionKind::PackedBoxes, packed.boxes.as_flattened());
        let positions = packed.positions.as_flattened().as_flattened();
        self.put(SectionKind::PackedPositions, positions);
        let normals = packed.normals.as_flattened().as_flattened();
        self.put(SectionKind::PackedNormals, normals);
    }

    pub(super) fn tangents(&mut self, mesh: &Mesh, blocks: &Blocks) {
        if let Some(tangents) = quantise::tangents(mesh, blocks) {
            self.dims.shapes.tangent_block_count = tangents.signs.len();
            let numbers = tangents.directions.as_flattened().as_flattened();
            self.put(SectionKind::Tangents, numbers);
            self.put(SectionKind::TangentSigns, &tangents.signs);
        }
    }

    /// Rounded outward.
    pub(super) fn bounds(&mut self, bounds: &RestBounds) -> Result<(), BakeError> {
        let rounded = |corners: &[f64; 6]| {
            let mut out = [0.0_f32; 6];
            for (at, (to, &corner)) in out.iter_mut().zip(corners).enumerate() {
                *to = fits(corner, || "a corner of a box".into())?;
                let beyond = if at < 3 {
                    f64::from(*to) > corner
                } else {
                    f64::from(*to) < corner
                };
                if beyond {
                    *to = if at < 3 { to.next_down() } else { to.next_up() };
                }
            }
            Ok::<_, BakeError>(out)
        };
        let boxes = bounds.boxes.iter().map(rounded);
        let boxes = boxes.collect::<Result<Vec<_>, _>>()?;
        let pair_boxes = bounds.pairs.iter().map(|(_, corners)| rounded(corners));
        let pair_boxes = pair_boxes.collect::<Result<Vec<_>, _>>()?;
        let pairs: Vec<[u16; 2]> = bounds.pairs.iter().map(|&(pair, _)| pair).collect();
        self.dims.bounds.box_count = boxes.len();
        self.dims.bounds.pair_count = pairs.len();
        self.put(SectionKind::BindBoxes, boxes.as_flattened());
        self.put(SectionKind::BindPairs, pairs.as_flattened());
        self.put(SectionKind::PairBoxes, pair_boxes.as_flattened());
        Ok(())
    }

    /// After everything that has a name: levels share the names of the whole.
    pub(super) fn levels(&mut self, levels: &[Level]) -> Result<(), BakeError> {
        let (mut table, mut data) = (Vec::new(), Vec::new());
        for level in levels {
            let mut writer = Writer {
                names: self.names.clone(),
                ..Writer::default()
            };
            let surface = super::Surface {
                avatar: &level.avatar,
                blocks: &level.blocks,
                centres: level.centres.as_deref(),
                packed: level.packed.as_ref(),
            };
            writer.surface(&surface)?;
            writer.clips(&SparseClips::default(), &level.avatar.mesh.morphs)?;
            writer.dims.level.source_count = level.source.len();
            writer.put(SectionKind::LevelSources, &level.source);
            let Dims {
                vertex_count,
                block_count,
                ..
            } = writer.dims;
            let bytes = writer.finish()?;
            debug_assert!(bytes.len().is_multiple_of(ALIGNMENT));
            let row = [data.len(), bytes.len(), vertex_count, block_count];
            table.push(row.map(|number| number as u32));
            data.extend(bytes);
        }
        self.dims.level.count = table.len();
        self.dims.level.bytes = super::limit("bytes of levels", data.len(), u32::MAX as usize)?;
        self.put(SectionKind::Levels, table.as_flattened());
        self.put(SectionKind::LevelData, &data);
        Ok(())
    }
}
