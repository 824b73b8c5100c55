//! The asset's bytes, as `core/SPEC.md` describes them.

mod clips;
mod correctives;
mod laplacian;
mod marker_skin;
mod markers;
mod morphs;
mod shape;

pub use marker_skin::MarkerSkinData;

use std::collections::HashMap;

use glam::{DAffine3, DVec3};
use sinew_core::asset::{
    ALIGNMENT, Dims, HEADER_BYTES, LANES, LARGEST, MAGIC, NO_PARENT, SECTION_ROW_BYTES,
    SectionKind, VERSION, crc32,
};

use super::BakeError;
use super::blocks::Blocks;
use super::bounds::RestBounds;
use super::clips::SparseClips;
use super::quantise::Packed;
use crate::fit::correctives::CorrectiveData;
use crate::fit::laplace::rig::Tables;
use crate::fit::live::MarkerModel;
use crate::model::Avatar;

pub use shape::Level;

/// What an asset may hold besides a skinned body and its clips.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extras<'e> {
    /// `[vertices]`: centres of rotation, for the mode of that name.
    pub centres: Option<&'e [DVec3]>,
    /// A surface that follows the joints as markers.
    pub laplacian: Option<&'e Tables>,
    /// A marker set for live labelling.
    pub markers: Option<&'e MarkerModel>,
    /// A skin that markers drive.
    pub marker_skin: Option<&'e MarkerSkinData>,
    /// What predicts the weights of the last morph targets.
    pub correctives: Option<&'e CorrectiveData>,
    /// Positions and normals in 16-bit numbers instead of 32-bit ones.
    pub packed: Option<&'e Packed>,
    /// Boxes at rest.
    pub bounds: Option<&'e RestBounds>,
    /// Coarser meshes, each coarser than the one before.
    pub levels: &'e [Level],
}

/// What every level of detail has.
struct Surface<'s> {
    avatar: &'s Avatar,
    blocks: &'s Blocks,
    centres: Option<&'s [DVec3]>,
    packed: Option<&'s Packed>,
}

/// All sections, in file order, then header and table in front of them.
///
/// # Errors
/// [`BakeError`] where the body exceeds the format.
pub fn write(
    avatar: &Avatar,
    blocks: &Blocks,
    clips: &SparseClips,
    extras: &Extras<'_>,
) -> Result<Vec<u8>, BakeError> {
    let mut writer = Writer::default();
    writer.surface(&Surface {
        avatar,
        blocks,
        centres: extras.centres,
        packed: extras.packed,
    })?;
    if let Some(bounds) = extras.bounds {
        writer.bounds(bounds)?;
    }
    writer.clips(clips, &avatar.mesh.morphs)?;
    if let Some(tables) = extras.laplacian {
        writer.laplacian(tables)?;
    }
    if let Some(markers) = extras.markers {
        writer.markers(markers);
    }
    if let Some(skin) = extras.marker_skin {
        writer.marker_skin(skin)?;
    }
    if let Some(data) = extras.correctives {
        writer.correctives(data)?;
    }
    writer.levels(extras.levels)?;
    writer.finish()
}

/// Sections under construction.
#[derive(Default)]
struct Writer {
    dims: Dims,
    sections: HashMap<u32, Vec<u8>>,
    names: Vec<u8>,
}

impl Writer {
    fn surface(&mut self, surface: &Surface<'_>) -> Result<(), BakeError> {
        let &Surface { avatar, blocks, .. } = surface;
        self.skeleton(avatar)?;
        self.blocks(avatar, blocks, surface.packed)?;
        self.tangents(&avatar.mesh, blocks);
        if let Some(centres) = surface.centres {
            self.centres(blocks, centres)?;
        }
        self.triangles(avatar, blocks)?;
        self.morphs(&avatar.mesh.morphs, blocks)
    }

    fn put<T: bytemuck::NoUninit>(&mut self, kind: SectionKind, values: &[T]) {
        // A cast would be wrong on a big-endian machine, which the core refuses to build for.
        self.sections
            .insert(kind as u32, bytemuck::cast_slice(values).to_vec());
    }

    /// Offset and length of a name, stored once however often it is used.
    fn name(&mut self, name: &str) -> [u32; 2] {
        let bytes = name.as_bytes();
        let length = bytes.len();
        let found = (length > 0)
            .then(|| self.names.windows(length).position(|w| w == bytes))
            .flatten();
        let offset = found.unwrap_or_else(|| {
            self.names.extend_from_slice(bytes);
            self.names.len() - length
        });
        [offset as u32, length as u32]
    }

    fn skeleton(&mut self, avatar: &Avatar) -> Result<(), BakeError> {
        let joints = &avatar.skeleton.joints;
        self.dims.joint_count = limit("joints", joints.len(), usize::from(NO_PARENT) - 1)?;
        let binds = &avatar.skin.binds;
        self.dims.bind_count = limit("skin joints", binds.len(), usize::from(NO_PARENT) - 1)?;
        let parents = joints
            .iter()
            .map(|joint| joint.parent.map_or(NO_PARENT, |parent| parent as u16));
        self.put(SectionKind::Parents, &parents.collect::<Vec<_>>());
        let mut rest = Vec::with_capacity(joints.len());
        for joint in joints {
            let pose = &joint.rest;
            let numbers = pose.rotation.to_array().into_iter();
            let numbers = numbers
                .chain(pose.translation.to_array())
                .chain(pose.scale.to_array());
            for number in numbers {
                rest.push(fits(number, || format!("rest pose of {:?}", joint.name))?);
            }
        }
        self.put(SectionKind::Rest, &rest);
        let bind_joints: Vec<u16> = binds.iter().map(|bind| bind.joint as u16).collect();
        self.put(SectionKind::BindJoints, &bind_joints);
        let mut inverse = Vec::with_capacity(binds.len() * 12);
        for bind in binds {
            for number in rows(&bind.inverse_bind) {
                let what = || format!("inverse bind matrix of {:?}", joints[bind.joint].name);
                inverse.push(fits(number, what)?);
            }
        }
        self.put(SectionKind::InverseBind, &inverse);
        let rotations = binds.iter().map(|bind| {
            let rotation = crate::model::nearest_rotation(&bind.inverse_bind.matrix3);
            rotation.as_quat().to_array()
        });
        let rotations: Vec<[f32; 4]> = rotations.collect();
        self.put(SectionKind::BindRotations, rotations.as_flattened());
        let names: Vec<[u32; 2]> = joints.iter().map(|joint| self.name(&joint.name)).collect();
        self.put(SectionKind::JointNames, names.as_flattened());
        Ok(())
    }

    fn blocks(
        &mut self,
        avatar: &Avatar,
        blocks: &Blocks,
        packed: Option<&Packed>,
    ) -> Result<(), BakeError> {
        let mesh = &avatar.mesh;
        self.dims.vertex_count = limit("vertices", mesh.positions.len(), u32::MAX as usize / 2)?;
        self.dims.block_count = blocks.blocks.len();
        self.dims.slot_count = blocks.blocks.iter().map(Vec::len).sum();
        self.dims.rigid_block_count = blocks.blocks.iter().filter(|b| b.len() == 1).count();
        let runs = blocks.runs();
        self.dims.run_count = runs.len();
        self.put(SectionKind::Runs, runs.as_flattened());
        let slots = || blocks.blocks.iter().flatten();
        let slot_binds: Vec<u16> = slots().map(|slot| slot.bind).collect();
        self.put(SectionKind::SlotBinds, &slot_binds);
        let weights: Vec<[u16; LANES]> = slots().map(|slot| slot.weights).collect();
        self.put(SectionKind::SlotWeights, weights.as_flattened());
        self.put(SectionKind::Order, &blocks.order);
        let all = blocks.order.chunks(LANES);
        let position = |vertex: usize| mesh.positions[vertex];
        let positions = lanes(all.clone(), position, "position")?;
        if let Some(packed) = packed {
            self.packed(packed);
            return Ok(());
        }
        self.put(SectionKind::Positions, &positions);
        let normals = lanes(all, |vertex| mesh.normals[vertex], "normal")?;
        self.put(SectionKind::Normals, &normals);
        Ok(())
    }

    /// Of blocks with two or more slots.
    fn centres(&mut self, blocks: &Blocks, centres: &[DVec3]) -> Result<(), BakeError> {
        let vertices = blocks.order.chunks(LANES).zip(&blocks.blocks);
        let blended = vertices.filter(|(_, slots)| slots.len() > 1);
        let blended = blended.map(|(vertices, _)| vertices);
        let numbers = lanes(blended, |vertex| centres[vertex], "centre")?;
        self.dims.centre_block_count = numbers.len() / (3 * LANES);
        self.put(SectionKind::Centres, &numbers);
        Ok(())
    }

    fn triangles(&mut self, avatar: &Avatar, blocks: &Blocks) -> Result<(), BakeError> {
        let mesh = &avatar.mesh;
        let mut place = vec![0_u32; mesh.positions.len()];
        for (at, &source) in blocks.order.iter().enumerate() {
            place[source as usize] = at as u32;
        }
        self.dims.triangle_count =
            limit("triangles", mesh.triangles.len(), u32::MAX as usize / 12)?;
        let corners = mesh.triangles.iter().flatten();
        let corners = corners.map(|&vertex| place[vertex as usize]);
        if mesh.positions.len() <= 1 << 16 {
            self.dims.index_bytes = 2;
            let corners: Vec<u16> = corners.map(|vertex| vertex as u16).collect();
            self.put(SectionKind::Triangles, &corners);
        } else {
            self.dims.index_bytes = 4;
            self.put(SectionKind::Triangles, &corners.collect::<Vec<_>>());
        }
        self.dims.part_count = mesh.parts.len();
        let mut parts = Vec::with_capacity(mesh.parts.len());
        for part in &mesh.parts {
            let [offset, length] = self.name(&part.name);
            let range = &part.triangles;
            parts.push([offset, length, range.start as u32, range.len() as u32]);
        }
        self.put(SectionKind::Parts, parts.as_flattened());
        Ok(())
    }

    fn finish(mut self) -> Result<Vec<u8>, BakeError> {
        self.dims.name_bytes = self.names.len();
        let names = std::mem::take(&mut self.names);
        self.put(SectionKind::Names, &names);
        let kinds = SectionKind::ALL.into_iter();
        let sections = kinds.filter_map(|kind| Some((kind, self.sections.remove(&(kind as u32))?)));
        let sections: Vec<_> = sections.filter(|(_, bytes)| !bytes.is_empty()).collect();
        let count = sections.len();
        let mut out = vec![0; HEADER_BYTES + count * SECTION_ROW_BYTES];
        for (row, (kind, section)) in sections.into_iter().enumerate() {
            out.resize(out.len().next_multiple_of(ALIGNMENT), 0);
            let words = [kind as u32, out.len() as u32, section.len() as u32, 0];
            let at = HEADER_BYTES + row * SECTION_ROW_BYTES;
            out[at..at + SECTION_ROW_BYTES].copy_from_slice(&words.map(u32::to_le_bytes).concat());
            out.extend_from_slice(&section);
        }
        out.resize(out.len().next_multiple_of(ALIGNMENT), 0);
        let total = limit("bytes", out.len(), u32::MAX as usize)?;
        let mut word = |at: usize, value: u32| {
            out[at..at + 4].copy_from_slice(&value.to_le_bytes());
        };
        word(8, VERSION);
        word(12, total as u32);
        word(20, count as u32);
        for (index, count) in self.dims.to_words().into_iter().enumerate() {
            word(32 + 4 * index, count as u32);
        }
        out[..MAGIC.len()].copy_from_slice(&MAGIC);
        let checksum = crc32(&out[20..]);
        out[16..20].copy_from_slice(&checksum.to_le_bytes());
        Ok(out)
    }
}

/// x of eight vertices, y, z, for each block; a short block repeats its last vertex.
fn lanes<'b>(
    blocks: impl Iterator<Item = &'b [u32]>,
    of: impl Fn(usize) -> DVec3,
    what: &str,
) -> Result<Vec<f32>, BakeError> {
    let mut numbers = Vec::new();
    for block in blocks {
        for axis in 0..3 {
            for lane in 0..LANES {
                let vertex = *block.get(lane).unwrap_or(&block[block.len() - 1]) as usize;
                let what = || format!("{what} of vertex {vertex}");
                numbers.push(fits(of(vertex)[axis], what)?);
            }
        }
    }
    Ok(numbers)
}

/// Rows of a 3 x 4 matrix.
pub(crate) fn rows(matrix: &DAffine3) -> [f64; 12] {
    let [x, y, z] = matrix.matrix3.transpose().to_cols_array_2d();
    let t = matrix.translation;
    [
        x[0], x[1], x[2], t.x, y[0], y[1], y[2], t.y, z[0], z[1], z[2], t.z,
    ]
}

fn limit(what: &'static str, count: usize, limit: usize) -> Result<usize, BakeError> {
    if count > limit {
        return Err(BakeError::TooMany { what, count, limit });
    }
    Ok(count)
}

fn fits(value: f64, what: impl Fn() -> String) -> Result<f32, BakeError> {
    if value.abs() <= f64::from(LARGEST) {
        return Ok(value as f32);
    }
    Err(BakeError::TooLarge {
        what: what(),
        value,
    })
}
