//! Morph targets of all meshes into targets over the whole surface (glTF 2.0, section 3.7.2.2).

use std::collections::BTreeMap;

use glam::DVec3;
use gltf::json::mesh::{Mesh, Primitive};
use serde_json::Value;

use super::accessor::{Reader, Storage};
use super::item_fault;
use super::mesh::Instance;
use super::primitive::same_count;
use crate::import::{ImportError, ImportErrorKind, RawMorph};

/// The targets of one mesh on one node.
pub(super) struct MorphRange {
    /// First target among all targets of the surface.
    pub first: usize,
    pub rest_weights: Vec<f64>,
    names: Vec<String>,
}

impl MorphRange {
    pub fn count(&self) -> usize {
        self.rest_weights.len()
    }
}

/// Offsets that one target gives the vertices of one primitive.
struct Piece {
    morph: usize,
    first_vertex: usize,
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
}

/// The targets of all meshes, one mesh after another.
#[derive(Default)]
pub(super) struct Morphs {
    ranges: Vec<MorphRange>,
    range_of_node: BTreeMap<usize, usize>,
    /// Targets of all ranges.
    count: usize,
    pieces: Vec<Piece>,
}

impl Morphs {
    /// The targets of the mesh on a node, if there are any.
    pub fn of_node(&self, node: usize) -> Option<&MorphRange> {
        let range = &self.ranges[*self.range_of_node.get(&node)?];
        (range.count() > 0).then_some(range)
    }

    /// Weights of all targets when nothing animates them.
    pub fn rest_weights(&self) -> Vec<f64> {
        let ranges = self.ranges.iter();
        ranges
            .flat_map(|range| &range.rest_weights)
            .copied()
            .collect()
    }

    /// Opens the range of the next mesh.
    pub fn begin(
        &mut self,
        reader: &mut Reader<'_>,
        instance: &Instance,
    ) -> Result<(), ImportError> {
        let document = reader.document;
        let mesh = &document.meshes[instance.mesh];
        let item = format!("meshes[{}]", instance.mesh);
        let count_of = |primitive: &Primitive| primitive.targets.as_ref().map_or(0, Vec::len);
        let count = mesh.primitives.first().map_or(0, count_of);
        if let Some(other) = mesh.primitives.iter().map(count_of).find(|&c| c != count) {
            let what = format!("primitives with {count} and with {other} morph targets");
            return Err(item_fault(ImportErrorKind::Contradiction { what }, item));
        }
        let stated = document.nodes[instance.node].weights.as_ref();
        let stated = stated.or(mesh.weights.as_ref());
        let stated = stated.map_or(&[][..], Vec::as_slice);
        if !stated.is_empty() && stated.len() != count {
            let text = format!(
                "{} weights for {count} morph targets; missing ones are 0",
                stated.len()
            );
            reader.notice(&item, text);
        }
        let mut rest_weights: Vec<f64> = stated.iter().map(|&weight| weight.into()).collect();
        rest_weights.resize(count, 0.0);
        if rest_weights.iter().any(|weight| !weight.is_finite()) {
            let what = "a morph target weight".into();
            return Err(item_fault(ImportErrorKind::NotFinite { what }, item));
        }
        self.range_of_node.insert(instance.node, self.ranges.len());
        self.ranges.push(MorphRange {
            first: self.count,
            rest_weights,
            names: target_names(mesh, count),
        });
        self.count += count;
        Ok(())
    }

    /// Reads the targets of a primitive of the mesh that was opened last.
    pub fn targets(
        &mut self,
        reader: &mut Reader<'_>,
        primitive: &Primitive,
        (first_vertex, vertex_count): (usize, usize),
        item: &str,
    ) -> Result<(), ImportError> {
        let first = self.ranges.last().map_or(0, |range| range.first);
        for (i, target) in primitive.targets.iter().flatten().enumerate() {
            let item = format!("{item}.targets[{i}]");
            let mut offsets = |accessor: Option<gltf::json::Index<_>>, what: &str| match accessor {
                None => Ok(Vec::new()),
                Some(accessor) => {
                    let index = accessor.value();
                    let offsets = reader.read_vectors(index, Storage::Quantised, what, &item)?;
                    same_count(vertex_count, offsets.len(), what, &item)?;
                    Ok(offsets)
                }
            };
            self.pieces.push(Piece {
                morph: first + i,
                first_vertex,
                positions: offsets(target.positions, "POSITION")?,
                normals: offsets(target.normals, "NORMAL")?,
            });
        }
        Ok(())
    }

    /// Spreads what was read over all vertices of the surface.
    pub fn merge(
        &mut self,
        reader: &mut Reader<'_>,
        vertex_count: usize,
    ) -> Result<Vec<RawMorph>, ImportError> {
        let names = self.ranges.iter().flat_map(|range| &range.names);
        let weights = self.rest_weights();
        let mut morphs: Vec<RawMorph> = names
            .zip(weights)
            .map(|(name, rest_weight)| RawMorph {
                name: name.clone(),
                positions: Vec::new(),
                normals: Vec::new(),
                rest_weight,
            })
            .collect();
        let numbers = (morphs.len() as u64).saturating_mul(6 * vertex_count as u64);
        reader.charge(numbers, "meshes")?;
        for morph in &mut morphs {
            morph.positions = vec![DVec3::ZERO; vertex_count];
        }
        for piece in self.pieces.drain(..) {
            let morph = &mut morphs[piece.morph];
            if !piece.normals.is_empty() {
                morph.normals.resize(vertex_count, DVec3::ZERO);
            }
            let pairs = [
                (&mut morph.positions, &piece.positions),
                (&mut morph.normals, &piece.normals),
            ];
            for (all, part) in pairs {
                all.iter_mut()
                    .skip(piece.first_vertex)
                    .zip(part)
                    .for_each(|(a, p)| *a = *p);
            }
        }
        Ok(morphs)
    }
}

/// Names from `extras.targetNames`, the convention of exporters; else numbers.
fn target_names(mesh: &Mesh, count: usize) -> Vec<String> {
    let extras = mesh.extras.as_ref();
    let extras: Option<Value> = extras.and_then(|raw| serde_json::from_str(raw.get()).ok());
    let list = extras
        .as_ref()
        .and_then(|extras| extras["targetNames"].as_array());
    let stated = |i: usize| list.and_then(|list| list.get(i)?.as_str());
    (0..count)
        .map(|i| stated(i).map_or_else(|| i.to_string(), str::to_owned))
        .collect()
}
