//! The parts of a primitive: attributes, influences, corners (glTF 2.0, section 3.7.2).

use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::{Reader, Storage};
use super::item_fault;
use crate::import::{ImportError, ImportErrorKind};

/// Rounding may leave a weight this far below zero.
const NEGATIVE_WEIGHT_TOLERANCE: f64 = 1e-3;

/// First vertex and number of vertices in the merged mesh.
pub(super) type Range = (usize, usize);

/// What decides the vertices of a primitive: its attributes and morph targets by accessor.
pub(super) type VertexKey = (Vec<(String, usize)>, Vec<[Option<usize>; 2]>);

pub(super) fn vertex_key(primitive: &Primitive) -> VertexKey {
    let attributes = primitive.attributes.iter();
    let targets = primitive.targets.iter().flatten();
    (
        attributes
            .map(|(name, accessor)| (name.to_string(), accessor.value()))
            .collect(),
        targets
            .map(|t| [t.positions.map(|a| a.value()), t.normals.map(|a| a.value())])
            .collect(),
    )
}

/// The accessor of an attribute.
pub(super) fn attribute(primitive: &Primitive, name: Semantic) -> Option<usize> {
    let accessor = primitive.attributes.get(&Checked::Valid(name));
    accessor.map(|accessor| accessor.value())
}

/// An attribute that the surface does not depend on: exporters write NaN into it, and then it is
/// dropped.
pub(super) fn decoration(
    reader: &mut Reader<'_>,
    index: usize,
    shape: Type,
    what: &str,
    item: &str,
) -> Result<Option<Vec<f64>>, ImportError> {
    match reader.read(index, shape, Storage::Quantised, what, item) {
        Ok(numbers) => Ok(Some(numbers)),
        Err(error) if matches!(error.kind, ImportErrorKind::NotFinite { .. }) => {
            reader.notice(item, format!("{what} dropped: {}", error.kind));
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

/// Fails unless an attribute has one element a vertex.
pub(super) fn same_count(
    vertices: usize,
    elements: usize,
    what: &str,
    item: &str,
) -> Result<(), ImportError> {
    if vertices == elements {
        return Ok(());
    }
    let what = format!("{vertices} elements in POSITION, {elements} in {what}");
    Err(item_fault(ImportErrorKind::Contradiction { what }, item))
}

/// (bind, weight) pairs of all sets, as stated; weights of zero are left out, and so may be their
/// joints, which some exporters leave at random.
pub(super) fn influences(
    reader: &mut Reader<'_>,
    primitive: &Primitive,
    (first_bind, joint_count): (u32, u32),
    vertex_count: usize,
    item: &str,
) -> Result<Vec<Vec<(u32, f64)>>, ImportError> {
    let attribute = |name| attribute(primitive, name);
    let mut influences = vec![Vec::new(); vertex_count];
    let mut negative = 0;
    for set in 0.. {
        let (joints_name, weights_name) = (format!("JOINTS_{set}"), format!("WEIGHTS_{set}"));
        let (joints_index, weights_index) = match (
            attribute(Semantic::Joints(set)),
            attribute(Semantic::Weights(set)),
        ) {
            (Some(joints), Some(weights)) => (joints, weights),
            (None, None) if set == 0 => {
                reader.notice(item, "the mesh has a skin, this primitive no weights");
                break;
            }
            (None, None) => break,
            (joints, _) => {
                let missing = if joints.is_none() {
                    joints_name
                } else {
                    weights_name
                };
                let what = format!("the attribute {missing}");
                return Err(item_fault(ImportErrorKind::Missing { what }, item));
            }
        };
        let joints = reader.read_indices(joints_index, Type::Vec4, &joints_name, item)?;
        let weights = reader.read(
            weights_index,
            Type::Vec4,
            Storage::Fraction,
            &weights_name,
            item,
        )?;
        same_count(vertex_count, joints.len() / 4, &joints_name, item)?;
        same_count(vertex_count, weights.len() / 4, &weights_name, item)?;
        for (i, (&joint, &weight)) in joints.iter().zip(&weights).enumerate() {
            let vertex = i / 4;
            if weight <= 0.0 {
                if weight < -NEGATIVE_WEIGHT_TOLERANCE {
                    let kind = ImportErrorKind::OutOfRange {
                        what: format!("{weights_name} of vertex {vertex}"),
                        value: weight.to_string(),
                        expected: "0 or more".into(),
                    };
                    return Err(item_fault(kind, format!("accessors[{weights_index}]")));
                }
                negative += usize::from(weight < 0.0);
                continue;
            }
            if joint >= joint_count {
                let kind = ImportErrorKind::BadIndex {
                    what: format!("joint ({joints_name} of vertex {vertex})"),
                    index: joint.into(),
                    count: joint_count.into(),
                };
                return Err(item_fault(kind, format!("accessors[{joints_index}]")));
            }
            influences[vertex].push((first_bind + joint, weight));
        }
    }
    if negative > 0 {
        reader.notice(
            item,
            format!("{negative} weights just below zero taken as zero"),
        );
    }
    Ok(influences)
}

/// Vertex indices of a primitive's triangles (section 3.7.2.1, "Topology types").
pub(super) fn corners(
    reader: &mut Reader<'_>,
    primitive: &Primitive,
    mode: Mode,
    (first, count): Range,
    item: &str,
) -> Result<Vec<u32>, ImportError> {
    let indices = match primitive.indices {
        None => (0..count as u32).collect(),
        Some(index) => {
            let index = index.value();
            let indices = reader.read_indices(index, Type::Scalar, "indices", item)?;
            if let Some(at) = indices.iter().position(|&i| i as usize >= count) {
                let kind = ImportErrorKind::BadIndex {
                    what: format!("vertex (index {at} of the list)"),
                    index: indices[at].into(),
                    count: count as u64,
                };
                return Err(item_fault(kind, format!("accessors[{index}]")));
            }
            indices
        }
    };
    let first = first as u32;
    if mode == Mode::Triangles {
        let (triangles, rest) = indices.as_chunks::<3>();
        if !rest.is_empty() {
            let text = format!(
                "{} corners after the last whole triangle dropped",
                rest.len()
            );
            reader.notice(item, text);
        }
        return Ok(triangles.iter().flatten().map(|i| first + i).collect());
    }
    let triangle = |i: usize| match mode {
        Mode::TriangleStrip => [i, i + 1 + i % 2, i + 2 - i % 2],
        _ => [i + 1, i + 2, 0],
    };
    let triangles = (0..indices.len().saturating_sub(2)).flat_map(triangle);
    Ok(triangles.map(|corner| first + indices[corner]).collect())
}
