//! Puts captured markers onto a mesh: the frame in which the subject stands as the mesh does.
//!
//! Turn about the vertical and place are found by closest points (Besl & McKay 1992); then each
//! marker is glued to its nearest triangle. Where it stood off the skin in that frame (its own
//! radius) it stays off: residuals count from there.

use glam::{DMat3, DVec3};

use super::{Glued, PartsFitError};
use crate::model::Mesh;
use crate::spatial::Tree;

/// Turns tried at first.
const TURNS: usize = 12;
/// Rounds of closest points.
const ROUNDS: usize = 25;
/// Mean distance from markers to skin above which the pose is another one, metres.
const FURTHEST_MEAN: f64 = 0.04;

/// Markers on a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// `[markers]`: where each is glued.
    pub glued: Vec<Glued>,
    /// `[markers]`: where each is in mesh space at rest, metres.
    pub rest: Vec<DVec3>,
    /// Mean distance from markers to skin, metres.
    pub mean_distance: f64,
}

/// Glues markers `[markers]` of one frame, metres, to a mesh in the same pose.
/// O(triangles log triangles + markers log triangles)
///
/// # Errors
/// Markers that are nowhere near the skin.
pub fn fit(mesh: &Mesh, markers: &[DVec3]) -> Result<Fitted, PartsFitError> {
    let tree = Tree::new(&mesh.triangles, &mesh.positions);
    let mut best: Option<(f64, Motion)> = None;
    for turn in 0..TURNS {
        let yaw = std::f64::consts::TAU * turn as f64 / TURNS as f64;
        let mut motion = Motion::start(mesh, markers, yaw);
        let mut error = f64::INFINITY;
        for _ in 0..ROUNDS {
            let at: Vec<DVec3> = markers.iter().map(|&p| motion.to_mesh(p)).collect();
            let near = at
                .iter()
                .map(|&p| nearest(&tree, p).map_or(p, |near| near.0));
            let near: Vec<DVec3> = near.collect();
            let now = mean(at.iter().zip(&near).map(|(a, b)| a.distance(*b)));
            if now > error - 1e-6 {
                break;
            }
            error = now;
            motion = Motion::between(markers, &near);
        }
        if best.is_none_or(|(least, _)| error < least) {
            best = Some((error, motion));
        }
    }
    let motion = best.map_or_else(|| Motion::start(mesh, markers, 0.0), |found| found.1);
    let rest: Vec<DVec3> = markers.iter().map(|&p| motion.to_mesh(p)).collect();
    let glue = |&p: &DVec3| {
        let (_, triangle, weights) = nearest(&tree, p)?;
        let vertices = *mesh.triangles.get(triangle)?;
        Some(Glued { vertices, weights })
    };
    let glued: Option<Vec<Glued>> = rest.iter().map(glue).collect();
    let glued = glued.unwrap_or_default();
    let off: Vec<f64> = rest
        .iter()
        .zip(&glued)
        .map(|(p, glued)| p.distance(glued.on(&mesh.positions)))
        .collect();
    let mean_distance = mean(off.iter().copied());
    if glued.len() < markers.len() || !(0.0..=FURTHEST_MEAN).contains(&mean_distance) {
        let worst = (0..off.len()).max_by(|&a, &b| off[a].total_cmp(&off[b]));
        return Err(PartsFitError::OtherPose {
            mean_mm: 1e3 * mean_distance,
            marker: worst.unwrap_or(0),
            worst_mm: 1e3 * worst.map_or(0.0, |at| off[at]),
        });
    }
    Ok(Fitted {
        glued,
        rest,
        mean_distance,
    })
}

/// A turn about the vertical, then a shift, from mesh space to the capture's.
#[derive(Clone, Copy)]
struct Motion {
    turn: DMat3,
    shift: DVec3,
}

impl Motion {
    fn start(mesh: &Mesh, markers: &[DVec3], yaw: f64) -> Self {
        let turn = DMat3::from_rotation_y(yaw);
        let middle = |points: &[DVec3]| {
            let (low, high) = points
                .iter()
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| {
                    (low.min(p), high.max(p))
                });
            (low + high) / 2.0
        };
        let shift = middle(markers) - turn * middle(&mesh.positions);
        Self { turn, shift }
    }

    /// The least-squares motion from mesh points to markers.
    fn between(markers: &[DVec3], points: &[DVec3]) -> Self {
        let count = markers.len().max(1) as f64;
        let (to, from) = (
            markers.iter().sum::<DVec3>() / count,
            points.iter().sum::<DVec3>() / count,
        );
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (marker, point) in markers.iter().zip(points) {
            let (a, b) = (*point - from, *marker - to);
            sine += a.z * b.x - a.x * b.z;
            cosine += a.x * b.x + a.z * b.z;
        }
        let turn = DMat3::from_rotation_y(sine.atan2(cosine));
        Self {
            turn,
            shift: to - turn * from,
        }
    }

    fn to_mesh(self, point: DVec3) -> DVec3 {
        self.turn.transpose() * (point - self.shift)
    }
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}

/// The nearest point of the surface, its triangle and the weights of the corners.
fn nearest(tree: &Tree, point: DVec3) -> Option<(DVec3, usize, [f64; 3])> {
    let near = tree.closest(point, |_| true)?;
    Some((near.position, near.triangle, near.barycentric))
}
