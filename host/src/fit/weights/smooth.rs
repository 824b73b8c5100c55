//! Memberships by the way through the inside, spread over the surface.
//!
//! With `p` one for vertices whose nearest bone is the joint's and zero elsewhere, the weight `w` of a
//! joint solves `(L + M H) w = M H p`: the state that heat reaches which flows along the surface
//! (cotangent Laplacian `L`, areas `M`) and out of the bone (`H = sharpness / d^2`, `d` the distance
//! from the bone; Baran & Popović 2007, section 5). The weights of all joints sum to one.

use super::WeightsError;
use super::bones::{Bones, Segment, seeds};
use crate::fit::inside::Inside;
use crate::fit::laplace::LaplaceError;
use crate::fit::laplace::cholesky::Cholesky;
use crate::fit::laplace::operator::Laplacian;

/// Least distance from a bone, as a part of the size of a cell.
const NEAREST: f64 = 0.7;
/// Right-hand sides solved at once.
const AT_ONCE: usize = 16;

/// `[vertices of the surface]`: the joint whose bone is nearest through the inside.
pub(super) struct Near {
    pub joints: Vec<u32>,
    /// Metres.
    pub distance: Vec<f64>,
    /// Vertices that have no inside of their own.
    pub attached: usize,
}

/// Finds the nearest bone of every vertex. O(cells log cells)
pub(super) fn nearest(inside: &Inside, bones: &Bones) -> Result<Near, WeightsError> {
    let solid = &inside.solid;
    if solid.is_empty() {
        return Err(WeightsError::Hollow);
    }
    let segments: Vec<&Segment> = bones.all().collect();
    let (distances, mut marks) = solid.march(&seeds(solid, segments.iter().copied()));
    for mark in &mut marks {
        let segment = segments.get(*mark as usize);
        *mark = segment.map_or(u32::MAX, |segment| segment.joint as u32);
    }
    let found = inside
        .on_surface(&distances, &marks)
        .ok_or(WeightsError::Beside)?;
    Ok(Near {
        joints: found.mark,
        distance: found.distance.into_iter().map(f64::from).collect(),
        attached: found.attached,
    })
}

/// Spreads memberships: `joints` and `distance` `[vertices of the surface]`, the joint that each
/// vertex belongs to and its distance from that joint's bone in metres. Gives (joint, weight) a
/// vertex; weights are not negative and sum to one. O(fill x joints)
///
/// # Errors
/// A system that cannot be factored.
pub(super) fn spread(
    inside: &Inside,
    joints: &[u32],
    distance: &[f64],
    sharpness: f64,
) -> Result<Vec<Vec<(u32, f64)>>, LaplaceError> {
    let (positions, triangles) = (&inside.surface.positions, &inside.surface.triangles);
    let laplacian = Laplacian::new(positions, triangles);
    let area = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|v| positions[v as usize]);
        (b - a).cross(c - a).length() / 2.0
    };
    let mean_area = triangles.iter().map(area).sum::<f64>() / positions.len() as f64;
    let least = NEAREST * inside.solid.size();
    let pull: Vec<f64> = laplacian
        .mass
        .iter()
        .zip(distance)
        .map(|(mass, distance)| mass * mean_area * sharpness / distance.max(least).powi(2))
        .collect();
    let mut lower = Vec::with_capacity(laplacian.neighbours.len() / 2 + positions.len());
    for (vertex, pull) in pull.iter().enumerate() {
        lower.push((
            vertex as u32,
            vertex as u32,
            laplacian.diagonal(vertex) + pull,
        ));
        let before = laplacian.row(vertex).filter(|&(other, _)| other < vertex);
        lower.extend(before.map(|(other, weight)| (vertex as u32, other as u32, -weight)));
    }
    let system = Cholesky::new(positions.len(), &lower, None)?;
    let mut present: Vec<u32> = joints.to_vec();
    present.sort_unstable();
    present.dedup();
    let mut rows = vec![Vec::new(); positions.len()];
    for some in present.chunks(AT_ONCE) {
        let column = |&joint: &u32| {
            let own = joints.iter().zip(&pull);
            own.map(move |(&other, &pull)| if other == joint { pull } else { 0.0 })
        };
        let mut columns: Vec<f64> = some.iter().flat_map(column).collect();
        system.solve(&mut columns);
        for (&joint, column) in some.iter().zip(columns.chunks(positions.len())) {
            for (row, &weight) in rows.iter_mut().zip(column) {
                // Obtuse angles let the solution go below zero by a little.
                if weight > 0.0 {
                    row.push((joint, weight));
                }
            }
        }
    }
    for row in &mut rows {
        let sum: f64 = row.iter().map(|&(_, weight)| weight).sum();
        row.iter_mut().for_each(|(_, weight)| *weight /= sum);
    }
    Ok(rows)
}
