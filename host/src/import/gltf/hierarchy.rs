//! Nodes into joints (glTF 2.0, section 3.5 "Scenes").

use glam::{DMat3, DMat4, DQuat, DVec3};
use gltf::json::scene::Node;

use super::accessor::Reader;
use super::document::Document;
use super::{checked, item_fault};
use crate::import::{ImportError, ImportErrorKind, RawJoint, Transform};

/// Beyond this, relative to the largest scale, a matrix is said to hold shear. `f32` matrices
/// that were composed from rotations reach a tenth of it.
const SHEAR_TOLERANCE: f64 = 1e-5;
/// The last row of a transform may differ this much from 0 0 0 1.
const LAST_ROW_TOLERANCE: f64 = 1e-4;
/// Quaternions whose length differs more than this from 1 are worth a notice.
const UNIT_TOLERANCE: f64 = 1e-2;

/// The node tree: every node has at most one parent and there is no cycle.
pub(super) struct Hierarchy {
    parents: Vec<Option<usize>>,
    locals: Vec<Transform>,
    /// Whether the default scene contains the node.
    pub in_scene: Vec<bool>,
}

impl Hierarchy {
    pub fn read(reader: &mut Reader<'_>) -> Result<Self, ImportError> {
        let document = reader.document;
        let parents = parents(&document.nodes)?;
        let everything: Vec<usize> = roots(&parents);
        let reached = reach(&document.nodes, &everything);
        if let Some(node) = reached.iter().position(|&reached| !reached) {
            let joint = label(&document.nodes, node);
            let kind = ImportErrorKind::Cycle { joint };
            return Err(item_fault(kind, format!("nodes[{node}]")));
        }
        let mut in_scene = reached;
        if let Some(scene) = &document.scene {
            in_scene = reach(&document.nodes, scene);
            let mesh_in = |inside: bool| {
                let nodes = document.nodes.iter().zip(&in_scene);
                nodes
                    .into_iter()
                    .any(|(n, &i)| i == inside && n.mesh.is_some())
            };
            if !mesh_in(true) && mesh_in(false) {
                in_scene.fill(true);
                reader.notice("scene", "the default scene has no mesh; all nodes taken");
            }
        }
        let mut locals = Vec::with_capacity(document.nodes.len());
        for (i, node) in document.nodes.iter().enumerate() {
            locals.push(local(node, &format!("nodes[{i}]"), reader)?);
        }
        Ok(Self {
            parents,
            locals,
            in_scene,
        })
    }

    /// Joints for the used nodes and all their ancestors, in node order, and the joint of each
    /// node.
    pub fn joints(
        &self,
        document: &Document,
        mut used: Vec<bool>,
    ) -> (Vec<RawJoint>, Vec<Option<usize>>) {
        for node in 0..used.len() {
            let mut ancestor = self.parents[node].filter(|_| used[node]);
            while let Some(parent) = ancestor.filter(|&parent| !used[parent]) {
                used[parent] = true;
                ancestor = self.parents[parent];
            }
        }
        let mut joint_count = 0;
        let number = |&used: &bool| {
            used.then(|| {
                joint_count += 1;
                joint_count - 1
            })
        };
        let joint_of_node: Vec<Option<usize>> = used.iter().map(number).collect();
        let kept = (0..used.len()).filter(|&node| used[node]);
        let joint = |node: usize| RawJoint {
            name: document.nodes[node].name.clone().unwrap_or_default(),
            parent: self.parents[node].and_then(|parent| joint_of_node[parent]),
            rest: self.locals[node],
        };
        (kept.map(joint).collect(), joint_of_node)
    }
}

fn label(nodes: &[Node], node: usize) -> String {
    let name = nodes[node].name.clone();
    name.unwrap_or_else(|| format!("nodes[{node}]"))
}

fn children(node: &Node) -> impl Iterator<Item = usize> {
    node.children.iter().flatten().map(|child| child.value())
}

fn parents(nodes: &[Node]) -> Result<Vec<Option<usize>>, ImportError> {
    let mut parents = vec![None; nodes.len()];
    for (parent, node) in nodes.iter().enumerate() {
        for (i, child) in children(node).enumerate() {
            let item = format!("nodes[{parent}].children[{i}]");
            checked(nodes, child, "node", &item)?;
            if let Some(other) = parents[child].replace(parent) {
                let what = format!("node {child} is a child of both node {other} and {parent}");
                return Err(item_fault(ImportErrorKind::Contradiction { what }, item));
            }
        }
    }
    Ok(parents)
}

fn roots(parents: &[Option<usize>]) -> Vec<usize> {
    let nodes = 0..parents.len();
    nodes.filter(|&node| parents[node].is_none()).collect()
}

/// Which nodes hang below `from`.
fn reach(nodes: &[Node], from: &[usize]) -> Vec<bool> {
    let mut reached = vec![false; nodes.len()];
    let mut open = from.to_vec();
    while let Some(node) = open.pop() {
        if !std::mem::replace(&mut reached[node], true) {
            open.extend(children(&nodes[node]));
        }
    }
    reached
}

/// The transform of a node relative to its parent.
fn local(node: &Node, item: &str, reader: &mut Reader<'_>) -> Result<Transform, ImportError> {
    let properties = [
        node.translation.is_some(),
        node.rotation.is_some(),
        node.scale.is_some(),
    ];
    if let Some(matrix) = node.matrix {
        if properties.contains(&true) {
            reader.notice(
                item,
                "both a matrix and its parts are given; the matrix is used",
            );
        }
        let (transform, shear) = decompose(&affine_matrix(matrix.map(f64::from), item)?);
        if shear > SHEAR_TOLERANCE {
            let text = format!("shear of {shear:.2e} dropped from the matrix");
            reader.notice(item, text);
        }
        return Ok(transform);
    }
    let vector = |value: Option<[f32; 3]>, default| {
        value.map_or(default, |v| DVec3::from_array(v.map(f64::from)))
    };
    let translation = vector(node.translation, DVec3::ZERO);
    let scale = vector(node.scale, DVec3::ONE);
    let rotation = node
        .rotation
        .map_or(DQuat::IDENTITY, |q| DQuat::from_array(q.0.map(f64::from)));
    if !(translation.is_finite() && scale.is_finite() && rotation.is_finite()) {
        let what = "the node's transform".into();
        return Err(item_fault(ImportErrorKind::NotFinite { what }, item));
    }
    let length = rotation.length();
    if (length - 1.0).abs() > UNIT_TOLERANCE {
        let text = format!("rotation of length {length:.3} normalised");
        reader.notice(item, text);
    }
    Ok(Transform {
        translation,
        rotation: unit(rotation).map_err(|kind| item_fault(kind, item))?,
        scale,
    })
}

/// A finite quaternion made unit; one without direction is refused.
pub(super) fn unit(rotation: DQuat) -> Result<DQuat, ImportErrorKind> {
    let length = rotation.length();
    if length > 1e-6 {
        return Ok(rotation / length);
    }
    Err(ImportErrorKind::OutOfRange {
        what: "the length of a rotation".into(),
        value: length.to_string(),
        expected: "1".into(),
    })
}

/// A column-major 4 x 4 matrix that is finite and affine.
pub(super) fn affine_matrix(columns: [f64; 16], item: &str) -> Result<DMat4, ImportError> {
    let matrix = DMat4::from_cols_array(&columns);
    if !matrix.is_finite() {
        let what = "the matrix".into();
        return Err(item_fault(ImportErrorKind::NotFinite { what }, item));
    }
    let row = matrix.row(3);
    if !row.abs_diff_eq(glam::DVec4::W, LAST_ROW_TOLERANCE) {
        let kind = ImportErrorKind::OutOfRange {
            what: "the last row of the matrix".into(),
            value: row.to_string(),
            expected: "[0, 0, 0, 1]".into(),
        };
        return Err(item_fault(kind, item));
    }
    Ok(matrix)
}

/// Splits an affine matrix into translation, rotation and scale, and says how much shear, relative
/// to the largest scale, the three leave out.
///
/// Gram-Schmidt on the columns, first column first, as in Thomas, "Decomposing a matrix into
/// simple transformations", Graphics Gems II (1991). A column without length keeps scale 0 and
/// gets any direction; a reflection becomes a negative x scale.
fn decompose(matrix: &DMat4) -> (Transform, f64) {
    let linear = DMat3::from_mat4(*matrix);
    let columns = [linear.x_axis, linear.y_axis, linear.z_axis];
    let largest = largest_entry(&linear);

    let mut axes: [Option<DVec3>; 3] = [None; 3];
    for i in 0..3 {
        let known = axes.iter().flatten();
        let rest = known.fold(columns[i], |v, axis| v - *axis * v.dot(*axis));
        axes[i] = (rest.length() > largest * 1e-12).then(|| rest.normalize());
    }
    for i in 0..3 {
        axes[i] = axes[i].or(match (axes[(i + 1) % 3], axes[(i + 2) % 3]) {
            (Some(next), Some(last)) => Some(next.cross(last)),
            (Some(one), None) | (None, Some(one)) => Some(one.any_orthonormal_vector()),
            (None, None) => Some(DVec3::X),
        });
    }
    let [mut x, y, z] = axes.map(|axis| axis.unwrap_or(DVec3::ZERO));
    if x.dot(y.cross(z)) < 0.0 {
        x = -x;
    }
    let rotation = DMat3::from_cols(x, y, z);
    let scale = DVec3::new(columns[0].dot(x), columns[1].dot(y), columns[2].dot(z));
    let left = largest_entry(&(linear - rotation * DMat3::from_diagonal(scale)));
    let transform = Transform {
        translation: matrix.w_axis.truncate(),
        rotation: DQuat::from_mat3(&rotation).normalize(),
        scale,
    };
    (transform, if largest > 0.0 { left / largest } else { 0.0 })
}

fn largest_entry(matrix: &DMat3) -> f64 {
    let entries = matrix.to_cols_array();
    entries.iter().fold(0.0, |largest, v| v.abs().max(largest))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rebuilt(matrix: DMat4) -> (DMat4, f64) {
        let (t, shear) = decompose(&matrix);
        assert!((t.rotation.length() - 1.0).abs() < 1e-12);
        (DMat4::from(t.affine()), shear)
    }

    #[test]
    fn matrices_without_shear_come_back_whole() {
        let turn = DQuat::from_xyzw(0.1, -0.7, 0.3, 0.5).normalize();
        let shift = DVec3::new(1.0, -2.0, 3.0);
        for scale in [
            DVec3::ONE,
            DVec3::new(2.0, 0.5, 3.0),
            DVec3::new(-1.0, 1.0, 1.0),
            DVec3::new(-2.0, -3.0, -4.0),
            DVec3::new(0.0, 2.0, 3.0),
            DVec3::new(1.0, 0.0, 3.0),
            DVec3::new(1.0, 2.0, 0.0),
            DVec3::new(0.0, 0.0, 3.0),
            DVec3::new(0.0, 2.0, 0.0),
            DVec3::new(1.0, 0.0, 0.0),
            DVec3::ZERO,
        ] {
            let matrix = DMat4::from_scale_rotation_translation(scale, turn, shift);
            let (again, shear) = rebuilt(matrix);
            assert!(again.abs_diff_eq(matrix, 1e-12), "{scale}: {again}");
            assert!(shear < 1e-12, "{scale}");
        }
    }

    #[test]
    fn shear_is_measured_and_dropped() {
        // x' = x + 0.5 y: the second column is (0.5, 1, 0).
        let mut matrix = DMat4::IDENTITY;
        matrix.y_axis.x = 0.5;
        let (again, shear) = rebuilt(matrix);
        assert!(again.abs_diff_eq(DMat4::IDENTITY, 1e-12));
        assert!((shear - 0.5).abs() < 1e-12);
    }
}
