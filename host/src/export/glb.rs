//! A skinned mesh with its clips as a binary glTF 2.0 file, which every viewer opens.
//!
//! A [`GlbScene`] enters, the bytes of a `.glb` leave. They hold no time stamp: the same scene
//! gives the same bytes. What [`crate::import::gltf::read_gltf`] reads back is the same to `f32`,
//! up to the joints that the format itself demands: one above several roots, and one below a
//! joint for each further bind of it.
//!
//! Source: Khronos Group, *glTF 2.0 Specification* (ISO/IEC 12113:2022).

mod animation;
mod binary;
mod check;
mod surface;

use glam::{DAffine3, DVec3};
use serde_json::{Map, Value, json};

use self::binary::Binary;
use crate::import::{RawClip, RawJoint, RawMorph, Transform};

/// What a `.glb` file is made of; metres, seconds, Y up.
///
/// Leave lists empty that do not apply: a mesh without `influences` stays where it is, joints and
/// clips without a mesh are a skeleton in motion.
#[derive(Clone, Copy, Debug, Default)]
pub struct GlbScene<'a> {
    /// Name of the mesh.
    pub name: &'a str,
    /// `[vertices]`, in the bind pose.
    pub positions: &'a [DVec3],
    /// `[vertices]`; made unit length, +Y where zero.
    pub normals: Option<&'a [DVec3]>,
    /// `[triangles]`, vertex indices.
    pub triangles: &'a [[u32; 3]],
    /// `[joints]`, in any order.
    pub joints: &'a [RawJoint],
    /// `[binds]`, joint of each bind.
    pub bind_joints: &'a [usize],
    /// `[binds]`, from mesh space to the joint's space in the bind pose.
    pub inverse_bind: &'a [DAffine3],
    /// `[vertices]`, (bind, weight) pairs in any order and number; sums are scaled to one.
    pub influences: &'a [Vec<(u32, f64)>],
    /// Morph targets; their normals are written only where the mesh has normals.
    pub morphs: &'a [RawMorph],
    /// One animation each; clips without keys are left out.
    pub clips: &'a [RawClip],
}

/// A scene that does not fit together, or does not fit into the format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GlbError {
    /// Two lists that must be equally long.
    #[error("{what}: {found} given, {expected} needed")]
    Count {
        /// The list.
        what: String,
        /// Its length.
        found: usize,
        /// What the other lists ask for.
        expected: usize,
    },
    /// A reference to something that does not exist.
    #[error("{what} {index} does not exist: there are {count}")]
    BadIndex {
        /// What is referred to, and from where.
        what: String,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// NaN, infinity, or beyond the range of `f32`.
    #[error("{what} is not finite in single precision")]
    NotFinite {
        /// Which value.
        what: String,
    },
    /// A vertex of a skinned mesh without any positive weight.
    #[error("vertex {vertex} has no weight: every vertex of a skinned mesh needs a joint")]
    Unweighted {
        /// The vertex.
        vertex: usize,
    },
    /// Vertices without a surface.
    #[error("the mesh has {vertices} vertices and no triangle")]
    NoTriangles {
        /// How many vertices.
        vertices: usize,
    },
    /// Key times that go back, or start before zero.
    #[error("clip {clip:?}: key times must ascend from zero or later")]
    BadTimes {
        /// The clip's name.
        clip: String,
    },
    /// A parent chain that returns to itself.
    #[error("the hierarchy has a cycle")]
    Cycle,
    /// More than the format can number.
    #[error("{what}: {count}, the format holds at most {limit}")]
    TooMany {
        /// What is counted.
        what: String,
        /// How many.
        count: u64,
        /// The format's limit.
        limit: u64,
    },
}

/// Writes a scene as binary glTF 2.0.
///
/// Vertices keep their order. Positions, normals, weights, keys and inverse bind matrices become
/// `f32`; weights fill as many sets of four as the vertex with most influences needs, the largest
/// first. Takes time and memory linear in the scene's size.
///
/// # Errors
///
/// A [`GlbError`] where the parts contradict each other or the format cannot hold them.
pub fn write_glb(scene: &GlbScene<'_>) -> Result<Vec<u8>, GlbError> {
    check::check(scene)?;
    let mut binary = Binary::default();
    let mut nodes: Vec<Map<String, Value>> = scene.joints.iter().map(joint_node).collect();
    let mut roots = Vec::new();
    for (joint, parent) in scene.joints.iter().map(|joint| joint.parent).enumerate() {
        match parent {
            Some(parent) => add_child(&mut nodes[parent], joint),
            None => roots.push(joint),
        }
    }
    // Joints of a skin must have a common root.
    if roots.len() > 1 {
        nodes.push(object(json!({ "name": "root", "children": roots })));
        roots = vec![nodes.len() - 1];
    }

    let mut root = Map::new();
    let mut mesh_node = None;
    if !scene.positions.is_empty() {
        let mut node = object(json!({ "name": scene.name, "mesh": 0 }));
        if !scene.bind_joints.is_empty() {
            node.insert("skin".into(), json!(0));
            let skin_joints = skin_joints(scene.bind_joints, &mut nodes);
            let matrices = surface::inverse_bind(scene, &mut binary);
            let skin = json!({ "joints": skin_joints, "inverseBindMatrices": matrices });
            root.insert("skins".into(), json!([skin]));
        }
        nodes.push(node);
        mesh_node = Some(nodes.len() - 1);
        root.insert("meshes".into(), json!([surface::mesh(scene, &mut binary)]));
        root.insert("materials".into(), json!([surface::material()]));
    }
    roots.extend(mesh_node);
    let animations = animation::animations(scene, mesh_node, &mut binary);
    if !animations.is_empty() {
        root.insert("animations".into(), Value::Array(animations));
    }
    if !nodes.is_empty() {
        root.insert("nodes".into(), json!(nodes));
        root.insert("scenes".into(), json!([{ "nodes": roots }]));
        root.insert("scene".into(), json!(0));
    }
    let asset = json!({ "version": "2.0", "generator": "sinew" });
    root.insert("asset".into(), asset);
    binary.finish(root)
}

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

fn joint_node(joint: &RawJoint) -> Map<String, Value> {
    let mut node = Map::new();
    if !joint.name.is_empty() {
        node.insert("name".into(), json!(joint.name));
    }
    let Transform {
        translation,
        rotation,
        scale,
    } = joint.rest;
    let rotation = rotation.normalize();
    let identity = Transform::IDENTITY;
    if translation != identity.translation {
        node.insert("translation".into(), json!(translation.to_array()));
    }
    if rotation != identity.rotation {
        node.insert("rotation".into(), json!(rotation.to_array()));
    }
    if scale != identity.scale {
        node.insert("scale".into(), json!(scale.to_array()));
    }
    node
}

fn add_child(node: &mut Map<String, Value>, child: usize) {
    let children = node.entry("children").or_insert_with(|| json!([]));
    if let Value::Array(children) = children {
        children.push(json!(child));
    }
}

/// The node of each bind. A skin may list a node once only, so that every further bind of a joint
/// gets a node of its own that follows the joint.
fn skin_joints(bind_joints: &[usize], nodes: &mut Vec<Map<String, Value>>) -> Vec<usize> {
    let mut taken = vec![false; nodes.len()];
    let mut skin_joints = Vec::with_capacity(bind_joints.len());
    for &joint in bind_joints {
        if !std::mem::replace(&mut taken[joint], true) {
            skin_joints.push(joint);
            continue;
        }
        let mut follower = Map::new();
        if let Some(name) = nodes[joint].get("name").and_then(Value::as_str) {
            follower.insert("name".into(), json!(format!("{name}.bind")));
        }
        skin_joints.push(nodes.len());
        add_child(&mut nodes[joint], skin_joints[skin_joints.len() - 1]);
        nodes.push(follower);
    }
    skin_joints
}
