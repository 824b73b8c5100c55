//! Skin weights for a body that has none.
//!
//! In: a mesh and a skeleton that stands in it. Out: a [`Skin`]. Two ways:
//!
//! - [`Method::Smooth`], the default: every vertex belongs to the joint whose bone is nearest *through
//!   the inside* (after Dionne & de Lasa, *Geodesic Voxel Binding for Production Character Meshes*,
//!   2013), so that an arm beside a hip does not pull it; then memberships spread over the surface as
//!   heat does (Baran & Popović, *Automatic Rigging and Animation of 3D Characters*, 2007), the
//!   farther the thicker the body is. Weights are never negative and never above one.
//! - [`Method::Simple`]: the parametric relation of points and bones of Mažrimas & Beinaravičius,
//!   sections 4 and 8.2. It needs no inside, so it works on any set of triangles.
//!
//! [`bones`] says what a joint's bone is.

pub mod bones;
mod error;
mod simple;
mod smooth;
#[cfg(test)]
mod tests;

use super::Which;
use super::humanoid::Humanoid;
use super::inside::{CELLS, Inside};
use super::laplace::LaplaceError;
use super::laplace::nearest::Nearest;
use crate::model::{Bind, Mesh, Skeleton, Skin};
use bones::Bones;
pub use error::WeightsError;

/// How weights are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Where the vertex projects onto its nearest bone.
    Simple,
    /// Bounded and smooth, by distance through the inside.
    #[default]
    Smooth,
}

/// How to weigh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightOptions {
    /// The way.
    pub method: Method,
    /// Most influences of a vertex, 1 to 8.
    pub influences: usize,
    /// Of the smooth way: the width over which neighbouring joints share the skin falls with its
    /// square root.
    pub sharpness: f64,
}

impl Default for WeightOptions {
    fn default() -> Self {
        Self {
            method: Method::default(),
            influences: 4,
            sharpness: 6.0,
        }
    }
}

/// Most influences that can be asked for.
pub const MOST_INFLUENCES: usize = 8;

/// Weights, and what was noticed.
#[derive(Clone, Debug, PartialEq)]
pub struct Weighed {
    /// One bind a joint.
    pub skin: Skin,
    /// Joints that move no vertex.
    pub idle: Vec<usize>,
    /// Vertices of parts without an inside, which move as the nearest vertex does.
    pub attached: usize,
}

/// Weights of a mesh for a skeleton in its rest pose, both in metres in one space.
/// O(cells log cells + joints x fill)
///
/// # Errors
/// [`WeightsError`]: a count of influences out of range, no triangle, a skeleton without joints or
/// beside the mesh, for smooth weights a surface that encloses nothing.
pub fn weigh(
    mesh: &Mesh,
    skeleton: &Skeleton,
    options: &WeightOptions,
) -> Result<Weighed, WeightsError> {
    let inside = Inside::new(mesh, CELLS).map_err(|_| WeightsError::NoSurface)?;
    weigh_inside(mesh, &inside, skeleton, options)
}

/// The same for a mesh whose inside is known.
///
/// # Errors
/// As [`weigh`].
pub fn weigh_inside(
    mesh: &Mesh,
    inside: &Inside,
    skeleton: &Skeleton,
    options: &WeightOptions,
) -> Result<Weighed, WeightsError> {
    let bones = bones_of(inside, skeleton, options)?;
    let (rows, attached) = match options.method {
        Method::Simple => (simple::weights(inside, skeleton, &bones), 0),
        Method::Smooth => {
            let near = smooth::nearest(inside, &bones)?;
            let rows = smooth::spread(inside, &near.joints, &near.distance, options.sharpness)?;
            (rows, near.attached)
        }
    };
    Ok(weighed(mesh, inside, skeleton, rows, attached, options))
}

/// Weights where it is known which joint every vertex belongs to: `members` `[vertices of the mesh]`.
/// The simple way does not need to know.
///
/// # Errors
/// As [`weigh`].
pub fn weigh_members(
    mesh: &Mesh,
    inside: &Inside,
    skeleton: &Skeleton,
    members: &[u32],
    options: &WeightOptions,
) -> Result<Weighed, WeightsError> {
    if options.method == Method::Simple {
        return weigh_inside(mesh, inside, skeleton, options);
    }
    let bones = bones_of(inside, skeleton, options)?;
    let near = smooth::nearest(inside, &bones)?;
    let joints = inside.surface.source_of.iter();
    let joints: Vec<u32> = joints.map(|&vertex| members[vertex as usize]).collect();
    let rows = smooth::spread(inside, &joints, &near.distance, options.sharpness)?;
    Ok(weighed(
        mesh,
        inside,
        skeleton,
        rows,
        near.attached,
        options,
    ))
}

fn bones_of(
    inside: &Inside,
    skeleton: &Skeleton,
    options: &WeightOptions,
) -> Result<Bones, WeightsError> {
    if !(1..=MOST_INFLUENCES).contains(&options.influences) {
        let found = options.influences;
        return Err(WeightsError::Influences { found });
    }
    if skeleton.joints.is_empty() {
        return Err(WeightsError::NoJoints);
    }
    // What is no human has bones all the same.
    let human = Humanoid::new(skeleton, Which::Target).ok();
    Ok(Bones::new(skeleton, human.as_ref(), &inside.solid))
}

fn weighed(
    mesh: &Mesh,
    inside: &Inside,
    skeleton: &Skeleton,
    rows: Vec<Vec<(u32, f64)>>,
    attached: usize,
    options: &WeightOptions,
) -> Weighed {
    let skin = skin_of(mesh, inside, skeleton, rows, options.influences);
    let mut used = vec![false; skeleton.joints.len()];
    for &(bind, _) in skin.influences.iter().flatten() {
        used[bind as usize] = true;
    }
    Weighed {
        idle: (0..used.len()).filter(|&joint| !used[joint]).collect(),
        skin,
        attached,
    }
}

/// Rows of the welded surface as a skin of the mesh: heaviest first, few, summing to one.
fn skin_of(
    mesh: &Mesh,
    inside: &Inside,
    skeleton: &Skeleton,
    mut rows: Vec<Vec<(u32, f64)>>,
    influences: usize,
) -> Skin {
    /// Weights below this part move nothing that can be seen.
    const LEAST: f64 = 2e-3;
    for row in &mut rows {
        row.retain(|&(_, weight)| weight > LEAST);
        row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    }
    let nearest = Nearest::new(&inside.surface.positions);
    let row_of = inside.surface.vertex_of.iter().zip(&mesh.positions);
    let row_of = row_of.map(|(&own, &at)| {
        // Vertices of no triangle are not on the surface.
        let own = own.or_else(|| nearest.find(at).map(|(near, _)| near));
        own.map_or_else(Vec::new, |own| rows[own as usize].clone())
    });
    let mut skin = Skin {
        binds: binds(skeleton),
        influences: row_of.collect(),
    };
    skin.limit(influences);
    skin
}

/// A bind for each joint, in its rest pose.
fn binds(skeleton: &Skeleton) -> Vec<Bind> {
    let model = skeleton.model(&skeleton.rest());
    let bind = |(joint, place): (usize, &glam::DAffine3)| Bind {
        joint,
        inverse_bind: place.inverse(),
    };
    model.iter().enumerate().map(bind).collect()
}

impl From<LaplaceError> for WeightsError {
    fn from(error: LaplaceError) -> Self {
        match error {
            LaplaceError::NoSurface => Self::NoSurface,
            other => Self::Solve(other.to_string()),
        }
    }
}
