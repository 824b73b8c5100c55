//! Validated meshes, skeletons, skins and clips: what every stage after import works on.
//!
//! `Raw…` values enter through [`Avatar::new`] and [`Motion::new`], which check everything once
//! and repair what has one obvious repair, saying so. After that: indices are in range, parents
//! precede children, numbers are finite, weights sum to one, key times ascend.

mod check_clip;
mod check_mesh;
mod check_skeleton;
pub mod graph;

use glam::{DAffine3, DMat3, DQuat, DVec3};

pub use check_mesh::vertex_normals;

pub use crate::import::{Channel, Interpolation, Notice, Transform};
use crate::import::{ImportError, ImportErrorKind, RawAvatar, RawMesh, RawMotion};

/// A triangle mesh in its rest shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Name in the source file.
    pub name: String,
    /// `[vertices]`, metres, in the source's order.
    pub positions: Vec<DVec3>,
    /// `[vertices]`, unit length.
    pub normals: Vec<DVec3>,
    /// `[vertices]`: direction and handedness.
    pub tangents: Option<Vec<[f64; 4]>>,
    /// `[vertices]`: texture coordinates.
    pub texcoords: Option<Vec<[f64; 2]>>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Consecutive ranges of `triangles`.
    pub parts: Vec<Part>,
    /// Offsets that can be blended in.
    pub morphs: Vec<Morph>,
}

/// A named range of triangles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Group, primitive or material name.
    pub name: String,
    /// Range in [`Mesh::triangles`].
    pub triangles: std::ops::Range<usize>,
}

/// A morph target.
#[derive(Clone, Debug, PartialEq)]
pub struct Morph {
    /// Name in the source file.
    pub name: String,
    /// `[vertices]`, metres.
    pub positions: Vec<DVec3>,
    /// `[vertices]`, or empty.
    pub normals: Vec<DVec3>,
    /// Weight when nothing animates it.
    pub rest_weight: f64,
}

/// A joint of a [`Skeleton`].
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique in its skeleton, never empty.
    pub name: String,
    /// Smaller than the joint's own index.
    pub parent: Option<usize>,
    /// Relative to the parent.
    pub rest: Transform,
}

/// Joints, parents before children.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skeleton {
    /// All joints.
    pub joints: Vec<Joint>,
}

impl Skeleton {
    /// Index of the joint called `name`.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// Model-space transforms `[joints]` from local ones. O(joints).
    #[must_use]
    pub fn model(&self, local: &[Transform]) -> Vec<DAffine3> {
        let mut model: Vec<DAffine3> = Vec::with_capacity(self.joints.len());
        for (joint, local) in self.joints.iter().zip(local) {
            let affine = local.affine();
            model.push(match joint.parent {
                Some(parent) => model[parent] * affine,
                None => affine,
            });
        }
        model
    }

    /// The rest pose, local.
    #[must_use]
    pub fn rest(&self) -> Vec<Transform> {
        self.joints.iter().map(|joint| joint.rest).collect()
    }
}

/// A joint together with the mesh's pose relative to it when they were bound.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bind {
    /// Index into the skeleton.
    pub joint: usize,
    /// From mesh space to the joint's space.
    pub inverse_bind: DAffine3,
}

/// The rotation nearest to a matrix: its polar factor, of a mirroring matrix the opposite of it, of
/// one that cannot be inverted none (Higham, *Computing the Polar Decomposition*, 1986).
#[must_use]
pub fn nearest_rotation(matrix: &DMat3) -> DQuat {
    let mut factor = *matrix;
    if factor.determinant() < 0.0 {
        factor *= -1.0;
    }
    for _ in 0..40 {
        let inverse = factor.transpose().inverse();
        if !inverse.is_finite() {
            return DQuat::IDENTITY;
        }
        // Balanced, so that large scales converge as fast as small ones.
        let norm = |m: &DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>();
        let scale = (norm(&inverse) / norm(&factor)).sqrt().sqrt();
        factor = (factor * scale + inverse * (1.0 / scale)) * 0.5;
    }
    if !factor.is_finite() {
        return DQuat::IDENTITY;
    }
    DQuat::from_mat3(&factor).normalize()
}

/// Which joints move a vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// All binds.
    pub binds: Vec<Bind>,
    /// `[vertices]`: (bind, weight), heaviest first; weights are positive and sum to one.
    pub influences: Vec<Vec<(u32, f64)>>,
}

impl Skin {
    /// Keeps the `most` heaviest influences of each vertex, weights summing to one again.
    pub fn limit(&mut self, most: usize) {
        for row in &mut self.influences {
            row.truncate(most.max(1));
            let sum: f64 = row.iter().map(|&(_, weight)| weight).sum();
            row.iter_mut().for_each(|(_, weight)| *weight /= sum);
        }
    }
}

/// One animated channel of one joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Index into the skeleton.
    pub joint: usize,
    /// What it moves.
    pub channel: Channel,
    /// Between keys.
    pub interpolation: Interpolation,
    /// Seconds, strictly ascending, at least one.
    pub times: Vec<f64>,
    /// One a key, three (in-tangent, value, out-tangent) a key for splines. Rotations of
    /// step and linear keys are unit quaternions.
    pub values: Vec<[f64; 4]>,
}

impl Track {
    /// Straight lines between keys. `times`, `values`: `[keys]`.
    #[must_use]
    pub fn linear(joint: usize, channel: Channel, times: &[f64], values: Vec<[f64; 4]>) -> Self {
        Self {
            joint,
            channel,
            interpolation: Interpolation::Linear,
            times: times.to_vec(),
            values,
        }
    }

    /// Adds a value on the side of the last one, so that interpolation takes the shorter arc.
    pub fn push_rotation(&mut self, rotation: DQuat) {
        let last = self.values.last().map(|&last| DQuat::from_array(last));
        let flip = last.is_some_and(|last| last.dot(rotation) < 0.0);
        let value = if flip { -rotation } else { rotation };
        self.values.push(value.to_array());
    }
}

/// Animated morph weights of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct MorphTrack {
    /// Between keys.
    pub interpolation: Interpolation,
    /// Seconds, strictly ascending.
    pub times: Vec<f64>,
    /// `[keys x morphs]`, or `[keys x 3 x morphs]` for splines.
    pub values: Vec<f64>,
}

/// A piece of motion for one skeleton.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clip {
    /// Name in the source file.
    pub name: String,
    /// At most one for each joint and channel, sorted by joint, then channel.
    pub tracks: Vec<Track>,
    /// Weights of the mesh's morphs.
    pub morph_track: Option<MorphTrack>,
    /// Time of the last key, seconds.
    pub duration: f64,
    /// Seconds between samples where the source is sampled evenly.
    pub sample_period: Option<f64>,
}

/// A body: surface, skeleton, weights and motion that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Avatar {
    /// Surface.
    pub mesh: Mesh,
    /// Hierarchy.
    pub skeleton: Skeleton,
    /// Weights.
    pub skin: Skin,
    /// Motions.
    pub clips: Vec<Clip>,
}

impl Avatar {
    /// Checks the parts of a body against each other.
    ///
    /// # Errors
    /// The first fault that has no obvious repair: a cyclic hierarchy, indices out of range,
    /// numbers that are not finite, a mesh on which no vertex has a weight.
    pub fn new(raw: RawAvatar, file: &str) -> Result<(Self, Vec<Notice>), ImportError> {
        let mut notices = raw.notices;
        let (skeleton, order) = check_skeleton::check(raw.skeleton, file, &mut notices)?;
        let mesh = check_mesh::check(raw.mesh, file, &mut notices)?;
        let skin = check_mesh::check_skin(raw.skin, &mesh, &order, file, &mut notices)?;
        let mut clips = Vec::with_capacity(raw.clips.len());
        for clip in raw.clips {
            clips.push(check_clip::check(
                clip,
                &order,
                mesh.morphs.len(),
                file,
                &mut notices,
            )?);
        }
        let avatar = Self {
            mesh,
            skeleton,
            skin,
            clips,
        };
        Ok((avatar, notices))
    }
}

impl Mesh {
    /// Checks a mesh that stands alone.
    ///
    /// # Errors
    /// Indices out of range, numbers that are not finite, attributes of unequal length.
    pub fn new(raw: RawMesh, file: &str) -> Result<(Self, Vec<Notice>), ImportError> {
        let mut notices = Vec::new();
        let mesh = check_mesh::check(raw, file, &mut notices)?;
        Ok((mesh, notices))
    }
}

/// A skeleton with the motion that was captured for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Hierarchy with its rest pose.
    pub skeleton: Skeleton,
    /// End points of leaf joints, relative to the joint.
    pub end_sites: Vec<(usize, DVec3)>,
    /// The motion.
    pub clip: Clip,
}

impl Motion {
    /// Checks a captured motion.
    ///
    /// # Errors
    /// A cyclic hierarchy, indices out of range, numbers that are not finite.
    pub fn new(raw: RawMotion, file: &str) -> Result<(Self, Vec<Notice>), ImportError> {
        let mut notices = raw.notices;
        let (skeleton, order) = check_skeleton::check(raw.skeleton, file, &mut notices)?;
        let clip = check_clip::check(raw.clip, &order, 0, file, &mut notices)?;
        let mut end_sites = Vec::with_capacity(raw.end_sites.len());
        for (joint, offset) in raw.end_sites {
            let index = *order.get(joint).ok_or_else(|| {
                bad_index("end site of joint", joint, order.len())
                    .at(file, crate::import::Place::File)
            })?;
            end_sites.push((index, offset));
        }
        let motion = Self {
            skeleton,
            end_sites,
            clip,
        };
        Ok((motion, notices))
    }
}

fn bad_index(what: &str, index: usize, count: usize) -> ImportErrorKind {
    ImportErrorKind::BadIndex {
        what: what.to_owned(),
        index: i64::try_from(index).unwrap_or(i64::MAX),
        count: count as u64,
    }
}

fn not_finite(what: impl Into<String>) -> ImportErrorKind {
    ImportErrorKind::NotFinite { what: what.into() }
}
