//! A skeleton fitted into a body that has none.
//!
//! In: a mesh that stands upright (Y up) in a T- or A-pose, open or closed, and any human skeleton,
//! whose hierarchy and proportions it takes. Out: the skeleton with its joints inside the mesh.
//!
//! 1. [`Figure`] finds the landmarks of the body from its inside.
//! 2. `place` puts the joints there: limbs at their roots, bends and ends; spine and neck by the
//!    skeleton's own proportions between hips, shoulders and skull; all others as they stand
//!    relative to these.
//!
//! Joint frames of the result are parallel to the model's axes; motion comes onto it as onto any body
//! ([`retarget`](mod@super::retarget)).

mod error;
pub mod figure;
mod limbs;
mod place;
#[cfg(test)]
mod tests;
mod trunk;

use glam::{DQuat, DVec3};

use super::Which;
use super::humanoid::Humanoid;
use super::inside::{CELLS, Inside};
use super::retarget::facing;
use crate::model::{Joint, Mesh, Skeleton, Transform};
pub use error::RigError;
pub use figure::Figure;

/// A skeleton in its body.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// Hierarchy and names of the source; joints inside the mesh.
    pub skeleton: Skeleton,
    /// What was found of the body.
    pub figure: Figure,
}

/// Fits a human skeleton into a mesh.
///
/// `end_sites` are the ends of the source's last joints, relative to them ([`Motion`]); they tell how
/// far toes and head reach, and may be empty. O(cells log cells)
///
/// [`Motion`]: crate::model::Motion
///
/// # Errors
/// [`RigError`]: a mesh without triangles or inside; a skeleton that is no upright human's; a limb that
/// cannot be found.
pub fn fit_skeleton(
    mesh: &Mesh,
    source: &Skeleton,
    end_sites: &[(usize, DVec3)],
) -> Result<Fitted, RigError> {
    let inside = Inside::new(mesh, CELLS).map_err(|_| RigError::NoSurface)?;
    fit_inside(&inside, source, end_sites)
}

/// The same for a mesh whose inside is known.
///
/// # Errors
/// As [`fit_skeleton`].
pub fn fit_inside(
    inside: &Inside,
    source: &Skeleton,
    end_sites: &[(usize, DVec3)],
) -> Result<Fitted, RigError> {
    let human = Humanoid::new(source, Which::Source)?;
    let model = source.model(&source.rest());
    let at: Vec<DVec3> = model.iter().map(|joint| joint.translation).collect();
    let front = facing(&human, &at, Which::Source)?;
    let front = front.try_normalize().ok_or(RigError::NoDirections)?;
    let ends: Vec<(usize, DVec3)> = end_sites
        .iter()
        .filter_map(|&(joint, offset)| Some((joint, model.get(joint)?.transform_point3(offset))))
        .collect();
    let figure = Figure::new(&inside.solid)?;
    let source_body = place::Source {
        skeleton: source,
        human: &human,
        at: &at,
        ends: &ends,
        axes: figure::Axes::of_left(DVec3::Y.cross(front)),
    };
    let places = place::place(&source_body, &figure, &inside.solid);
    Ok(Fitted {
        skeleton: parallel(source, &places),
        figure,
    })
}

/// A skeleton whose joints stand at model-space `places`, with frames parallel to the model's axes.
#[must_use]
pub fn parallel(source: &Skeleton, places: &[DVec3]) -> Skeleton {
    let joints = source.joints.iter().zip(places).map(|(joint, &at)| Joint {
        rest: Transform {
            translation: at - joint.parent.map_or(DVec3::ZERO, |parent| places[parent]),
            rotation: DQuat::IDENTITY,
            scale: DVec3::ONE,
        },
        ..joint.clone()
    });
    Skeleton {
        joints: joints.collect(),
    }
}
