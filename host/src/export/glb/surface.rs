//! Mesh, morph targets, skin and material.

use glam::{DMat4, DVec3};
use serde_json::{Map, Value, json};

use super::GlbScene;
use super::binary::{Binary, Target};
use crate::import::RawMorph;

/// Largest number of vertices whose indices fit `u16`: 65535 itself means "restart".
const U16_VERTICES: usize = 65_535;
const INFLUENCES_PER_SET: usize = 4;

/// A neutral warm grey, matt, seen from both sides.
pub(super) fn material() -> Value {
    json!({
        "name": "skin",
        "doubleSided": true,
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.60, 0.52, 0.48, 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.65,
        },
    })
}

/// The mesh with all its accessors.
pub(super) fn mesh(scene: &GlbScene<'_>, binary: &mut Binary) -> Value {
    let mut attributes = Map::new();
    let positions = vectors(scene.positions);
    let accessor = binary.push_bounded(Target::Vertices, &positions);
    attributes.insert("POSITION".into(), json!(accessor));
    if let Some(normals) = scene.normals {
        let unit = |n: &DVec3| n.normalize_or(DVec3::Y).as_vec3().to_array();
        let normals: Vec<[f32; 3]> = normals.iter().map(unit).collect();
        let accessor = binary.push(Target::Vertices, &normals);
        attributes.insert("NORMAL".into(), json!(accessor));
    }
    if !scene.bind_joints.is_empty() {
        influence_sets(scene, binary, &mut attributes);
    }
    let indices = if scene.positions.len() <= U16_VERTICES {
        let narrow = |index: &u32| [*index as u16];
        let indices: Vec<[u16; 1]> = scene.triangles.iter().flatten().map(narrow).collect();
        binary.push(Target::Indices, &indices)
    } else {
        let indices: Vec<[u32; 1]> = scene.triangles.iter().flatten().map(|&i| [i]).collect();
        binary.push(Target::Indices, &indices)
    };
    let mut primitive = json!({ "attributes": attributes, "indices": indices, "material": 0 });
    let mut mesh = json!({ "name": scene.name });
    if !scene.morphs.is_empty() {
        primitive["targets"] = targets(scene, binary);
        let weights = scene.morphs.iter().map(|morph| json!(morph.rest_weight));
        mesh["weights"] = weights.collect();
        let names: Vec<&str> = scene.morphs.iter().map(|morph| &*morph.name).collect();
        mesh["extras"] = json!({ "targetNames": names });
    }
    mesh["primitives"] = json!([primitive]);
    mesh
}

fn vectors(vectors: &[DVec3]) -> Vec<[f32; 3]> {
    vectors.iter().map(|v| v.as_vec3().to_array()).collect()
}

/// Readers expect the same attributes in all targets, so that one target with normals gives
/// normals to all.
fn targets(scene: &GlbScene<'_>, binary: &mut Binary) -> Value {
    let has_normals = |morph: &RawMorph| !morph.normals.is_empty();
    let normals = scene.normals.is_some() && scene.morphs.iter().any(has_normals);
    let mut target = |morph: &RawMorph| {
        let offsets = vectors(&morph.positions);
        let mut target = json!({ "POSITION": binary.push_bounded(Target::Vertices, &offsets) });
        if normals {
            let mut offsets = vectors(&morph.normals);
            offsets.resize(scene.positions.len(), [0.0; 3]);
            target["NORMAL"] = json!(binary.push(Target::Vertices, &offsets));
        }
        target
    };
    scene.morphs.iter().map(&mut target).collect()
}

/// Column-major matrices whose last row is exactly 0 0 0 1.
pub(super) fn inverse_bind(scene: &GlbScene<'_>, binary: &mut Binary) -> usize {
    let matrix = |m: &glam::DAffine3| DMat4::from(*m).as_mat4().to_cols_array();
    let matrices: Vec<[f32; 16]> = scene.inverse_bind.iter().map(matrix).collect();
    binary.push(Target::Other, &matrices)
}

fn influence_sets(scene: &GlbScene<'_>, binary: &mut Binary, attributes: &mut Map<String, Value>) {
    let influences = scene.influences.iter().map(|list| normalised(list));
    let influences: Vec<Vec<(u32, f32)>> = influences.collect();
    let most = influences.iter().map(Vec::len).max().unwrap_or(0);
    for set in 0..most.div_ceil(INFLUENCES_PER_SET) {
        let pair = |list: &[(u32, f32)], i: usize| {
            let pair = list.get(set * INFLUENCES_PER_SET + i);
            pair.copied().unwrap_or((0, 0.0))
        };
        let lists = influences.iter();
        let weights: Vec<[f32; 4]> = lists
            .clone()
            .map(|list| std::array::from_fn(|i| pair(list, i).1))
            .collect();
        let accessor = binary.push(Target::Vertices, &weights);
        attributes.insert(format!("WEIGHTS_{set}"), json!(accessor));

        let accessor = if scene.bind_joints.len() <= 256 {
            let joints = lists.map(|list| std::array::from_fn(|i| pair(list, i).0 as u8));
            binary.push::<u8, 4>(Target::Vertices, &joints.collect::<Vec<_>>())
        } else {
            let joints = lists.map(|list| std::array::from_fn(|i| pair(list, i).0 as u16));
            binary.push::<u16, 4>(Target::Vertices, &joints.collect::<Vec<_>>())
        };
        attributes.insert(format!("JOINTS_{set}"), json!(accessor));
    }
}

/// One entry a bind, largest first, none zero; the sum is one to the last bit that `f32` keeps.
fn normalised(list: &[(u32, f64)]) -> Vec<(u32, f32)> {
    let mut list: Vec<(u32, f64)> = list.to_vec();
    list.sort_by_key(|&(bind, _)| bind);
    list.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        kept.1 += if same { next.1 } else { 0.0 };
        same
    });
    list.retain(|&(_, weight)| weight > 0.0);
    list.sort_by(|a, b| b.1.total_cmp(&a.1));
    let sum: f64 = list.iter().map(|&(_, weight)| weight).sum();
    let scaled = list
        .iter()
        .map(|&(bind, weight)| (bind, (weight / sum) as f32));
    let mut scaled: Vec<(u32, f32)> = scaled.filter(|&(_, weight)| weight > 0.0).collect();
    let rest: f32 = scaled.iter().skip(1).map(|&(_, weight)| weight).sum();
    if let Some(first) = scaled.first_mut() {
        first.1 = 1.0 - rest;
    }
    scaled
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_merged_sorted_and_sum_to_one() {
        let list = [(3, 0.5), (1, 2.0), (7, 0.0), (3, 0.5), (9, 1.0), (2, -0.1)];
        assert_eq!(normalised(&list), [(1, 0.5), (3, 0.25), (9, 0.25)]);
        let thirds = normalised(&[(0, 1.0), (1, 1.0), (2, 1.0)]);
        let sum: f32 = thirds.iter().map(|&(_, weight)| weight).sum();
        assert_eq!(sum, 1.0);
        // The second weight is below the smallest `f32`.
        assert_eq!(normalised(&[(4, 1.0), (5, 1e-60)]), [(4, 1.0)]);
    }
}
