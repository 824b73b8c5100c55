//! Skins and rigid meshes into binds (glTF 2.0, section 3.7.3 "Skins").

use std::collections::BTreeMap;

use glam::DAffine3;
use gltf::json::accessor::Type;

use super::accessor::{Reader, Storage};
use super::document::Document;
use super::hierarchy::affine_matrix;
use super::mesh::Instance;
use super::{checked, item_fault};
use crate::import::{ImportError, ImportErrorKind};

/// All (node, inverse bind matrix) pairs that vertices refer to: those of the used skins in file
/// order, then one for every node with a rigid mesh.
pub(super) struct Binds {
    pub nodes: Vec<usize>,
    pub inverse: Vec<DAffine3>,
    /// First bind and joint count of each used skin.
    skins: BTreeMap<usize, (u32, u32)>,
    rigid: BTreeMap<usize, u32>,
}

impl Binds {
    pub fn read(reader: &mut Reader<'_>, instances: &[Instance]) -> Result<Self, ImportError> {
        let mut binds = Self {
            nodes: Vec::new(),
            inverse: Vec::new(),
            skins: instances
                .iter()
                .filter_map(|i| i.skin)
                .map(|s| (s, (0, 0)))
                .collect(),
            rigid: BTreeMap::new(),
        };
        let used: Vec<usize> = binds.skins.keys().copied().collect();
        for skin in used {
            let first = binds.nodes.len() as u32;
            binds.read_skin(reader, skin)?;
            let count = binds.nodes.len() as u32 - first;
            binds.skins.insert(skin, (first, count));
        }
        for instance in instances.iter().filter(|i| i.skin.is_none()) {
            binds.rigid.insert(instance.node, binds.nodes.len() as u32);
            binds.nodes.push(instance.node);
            binds.inverse.push(DAffine3::IDENTITY);
        }
        Ok(binds)
    }

    /// First bind and joint count of a used skin.
    pub fn of_skin(&self, skin: usize) -> (u32, u32) {
        self.skins[&skin]
    }

    /// Bind of a node with a rigid mesh.
    pub fn of_node(&self, node: usize) -> u32 {
        self.rigid[&node]
    }

    fn read_skin(&mut self, reader: &mut Reader<'_>, index: usize) -> Result<(), ImportError> {
        let document = reader.document;
        let skin = &document.skins[index];
        let item = format!("skins[{index}]");
        let joints = joints(document, index)?;
        if joints.is_empty() {
            let what = "a joint".into();
            return Err(item_fault(ImportErrorKind::Missing { what }, item));
        }
        let Some(accessor) = skin.inverse_bind_matrices else {
            self.inverse
                .extend(joints.iter().map(|_| DAffine3::IDENTITY));
            self.nodes.extend(joints);
            return Ok(());
        };
        let accessor = accessor.value();
        let what = "inverse bind matrices";
        let numbers = reader.read(accessor, Type::Mat4, Storage::Fraction, what, &item)?;
        let (matrices, _) = numbers.as_chunks::<16>();
        if matrices.len() < joints.len() {
            let kind = ImportErrorKind::Truncated {
                what: what.into(),
                needed: joints.len() as u64,
                found: matrices.len() as u64,
            };
            return Err(item_fault(kind, item));
        }
        for (i, columns) in matrices.iter().take(joints.len()).enumerate() {
            let place = format!("accessors[{accessor}][{i}]");
            let matrix = affine_matrix(*columns, &place)?;
            self.inverse.push(DAffine3::from_mat4(matrix));
        }
        self.nodes.extend(joints);
        Ok(())
    }
}

/// The nodes that skin `index` lists.
fn joints(document: &Document, index: usize) -> Result<Vec<usize>, ImportError> {
    let list = document.skins[index].joints.iter().enumerate();
    let read = |(i, node): (usize, &gltf::json::Index<_>)| {
        let item = format!("skins[{index}].joints[{i}]");
        checked(&document.nodes, node.value(), "node", &item)
    };
    list.map(read).collect()
}

/// Marks the joints of every skin, for a file without meshes.
pub(super) fn mark_joints(document: &Document, used: &mut [bool]) -> Result<(), ImportError> {
    for skin in 0..document.skins.len() {
        for node in joints(document, skin)? {
            used[node] = true;
        }
    }
    Ok(())
}
