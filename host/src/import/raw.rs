//! What a file states, before anything is checked against anything else.

use glam::{DAffine3, DQuat, DVec3};

use super::Notice;

/// Rotation, then translation, of a joint relative to its parent; scale first of all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// Metres.
    pub translation: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
    /// Factor along each axis.
    pub scale: DVec3,
}

impl Transform {
    /// No change.
    pub const IDENTITY: Self = Self {
        translation: DVec3::ZERO,
        rotation: DQuat::IDENTITY,
        scale: DVec3::ONE,
    };

    /// The same as a matrix: `T * R * S`.
    #[must_use]
    pub fn affine(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// A mesh as its file states it.
///
/// Vertices of all primitives stand one after another in file order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMesh {
    /// Name in the file, or the file's stem.
    pub name: String,
    /// `[vertices]`, metres.
    pub positions: Vec<DVec3>,
    /// `[vertices]`, unit length; absent where the file has none.
    pub normals: Option<Vec<DVec3>>,
    /// `[vertices]`, direction and handedness (+1 or -1).
    pub tangents: Option<Vec<[f64; 4]>>,
    /// `[vertices]`, texture coordinates from the image's upper left, as in glTF 2.0.
    pub texcoords: Option<Vec<[f64; 2]>>,
    /// Ranges of triangles or polygons; together they cover the surface.
    pub primitives: Vec<RawPrimitive>,
    /// Morph targets over all vertices.
    pub morphs: Vec<RawMorph>,
}

/// A part of a mesh: an OBJ group or a glTF primitive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawPrimitive {
    /// Group, mesh or material name.
    pub name: String,
    /// Vertex indices of all its polygons, one after another.
    pub corners: Vec<u32>,
    /// How many corners each polygon has, at least 3.
    pub polygon_sizes: Vec<u32>,
}

/// Offsets from the mesh's own positions and normals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMorph {
    /// Name, or its number.
    pub name: String,
    /// `[vertices]`, metres.
    pub positions: Vec<DVec3>,
    /// `[vertices]`; empty where the target leaves normals alone.
    pub normals: Vec<DVec3>,
    /// Weight when nothing animates it.
    pub rest_weight: f64,
}

/// A joint as its file states it.
#[derive(Clone, Debug, PartialEq)]
pub struct RawJoint {
    /// As in the file; may be empty or repeated.
    pub name: String,
    /// Index of the parent in the same list; `None` for a root.
    pub parent: Option<usize>,
    /// Relative to the parent.
    pub rest: Transform,
}

/// A joint hierarchy as its file states it, in any order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawSkeleton {
    /// All joints.
    pub joints: Vec<RawJoint>,
}

/// How a mesh hangs on a skeleton.
///
/// A bind is one (joint, inverse bind matrix) pair; weights refer to binds, so that one joint can
/// serve two skins with different bind poses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawSkin {
    /// Joint of each bind.
    pub joints: Vec<usize>,
    /// `[binds]`: from mesh space to the joint's space in the bind pose.
    pub inverse_bind: Vec<DAffine3>,
    /// `[vertices]`: (bind, weight) pairs as stated, not yet normalised.
    pub influences: Vec<Vec<(u32, f64)>>,
}

/// What part of a joint a track moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channel {
    /// Metres; three values a key.
    Translation,
    /// Quaternion x, y, z, w; four values a key.
    Rotation,
    /// Factors; three values a key.
    Scale,
}

/// How values between two keys are found (glTF 2.0, appendix C).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The earlier key holds.
    Step,
    /// Straight line; the shorter great arc for rotations.
    Linear,
    /// Hermite spline; every key holds in-tangent, value, out-tangent.
    CubicSpline,
}

/// One animated channel of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct RawTrack {
    /// Index into the skeleton's joints.
    pub joint: usize,
    /// What it moves.
    pub channel: Channel,
    /// Between keys.
    pub interpolation: Interpolation,
    /// Key times in seconds, ascending.
    pub times: Vec<f64>,
    /// One value a key, three a key for [`Interpolation::CubicSpline`]; unused components are 0.
    pub values: Vec<[f64; 4]>,
}

/// A piece of motion as its file states it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawClip {
    /// Name, or the file's stem.
    pub name: String,
    /// Joint channels.
    pub tracks: Vec<RawTrack>,
    /// Weights of the mesh's morph targets: key times and `[keys x morphs]` values (times three
    /// for splines); absent where the clip has none.
    pub morph_weights: Option<(Interpolation, Vec<f64>, Vec<f64>)>,
    /// Seconds between samples where the source is sampled evenly.
    pub sample_period: Option<f64>,
}

/// A skeleton and one clip for it: what a BVH file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawMotion {
    /// The hierarchy with its rest pose.
    pub skeleton: RawSkeleton,
    /// End point of leaf joints (BVH `End Site`), relative to the joint: (joint, offset).
    pub end_sites: Vec<(usize, DVec3)>,
    /// The motion.
    pub clip: RawClip,
    /// What the reader repaired.
    pub notices: Vec<Notice>,
}

/// A mesh with its skeleton, skin and clips: what a glTF file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RawAvatar {
    /// Surface.
    pub mesh: RawMesh,
    /// All nodes that move the surface, and their ancestors.
    pub skeleton: RawSkeleton,
    /// Weights; a mesh that hangs rigidly on a node has weight 1 on a bind of that node.
    pub skin: RawSkin,
    /// Animations.
    pub clips: Vec<RawClip>,
    /// What the reader repaired.
    pub notices: Vec<Notice>,
}
