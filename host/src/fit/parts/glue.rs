//! Puts captured markers onto a mesh: the frame in which the subject stands as the mesh does.
//!
//! Turn about the vertical and place are found by closest points (Besl & McKay 1992); then each
//! marker is glued to its nearest triangle. Where it stood off the skin in that frame (its own
//! radius) it stays off: residuals count from there.

use glam::{DMat3, DVec3};

use super::{Glued, PartsFitError};
use crate::model::Mesh;

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
/// O(markers (turns vertices + triangles))
///
/// # Errors
/// Markers that are nowhere near the skin.
pub fn fit(mesh: &Mesh, markers: &[DVec3]) -> Result<Fitted, PartsFitError> {
    let mut best: Option<(f64, Motion)> = None;
    for turn in 0..TURNS {
        let yaw = std::f64::consts::TAU * turn as f64 / TURNS as f64;
        let mut motion = Motion::start(mesh, markers, yaw);
        let mut error = f64::INFINITY;
        for _ in 0..ROUNDS {
            let at: Vec<DVec3> = markers.iter().map(|&p| motion.to_mesh(p)).collect();
            let near: Vec<DVec3> = at.iter().map(|&p| nearest_vertex(mesh, p)).collect();
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
    let glued: Vec<Glued> = rest.iter().map(|&p| nearest_triangle(mesh, p)).collect();
    let off: Vec<f64> = rest
        .iter()
        .zip(&glued)
        .map(|(p, glued)| p.distance(glued.on(&mesh.positions)))
        .collect();
    let mean_distance = mean(off.iter().copied());
    if mean_distance > FURTHEST_MEAN || !mean_distance.is_finite() {
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

fn nearest_vertex(mesh: &Mesh, point: DVec3) -> DVec3 {
    let (mut best, mut least) = (DVec3::ZERO, f64::INFINITY);
    for &at in &mesh.positions {
        let distance = at.distance_squared(point);
        if distance < least {
            (best, least) = (at, distance);
        }
    }
    best
}

fn nearest_triangle(mesh: &Mesh, point: DVec3) -> Glued {
    let (mut best, mut least) = (
        Glued {
            vertices: [0; 3],
            weights: [1.0, 0.0, 0.0],
        },
        f64::INFINITY,
    );
    for &vertices in &mesh.triangles {
        let [a, b, c] = vertices.map(|at| mesh.positions[at as usize]);
        let weights = nearest_weights(point, a, b, c);
        let at = a * weights[0] + b * weights[1] + c * weights[2];
        let distance = at.distance_squared(point);
        if distance < least {
            (best, least) = (Glued { vertices, weights }, distance);
        }
    }
    best
}

/// Corner weights of the point of a triangle nearest to another (Ericson, *Real-Time Collision
/// Detection*, section 5.1.5).
fn nearest_weights(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> [f64; 3] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return [1.0 - v, v, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    [va / sum, vb / sum, vc / sum]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_points_of_a_triangle_in_every_region() {
        let [a, b, c] = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let at = |x: f64, y: f64| nearest_weights(DVec3::new(x, y, 0.7), a, b, c);
        assert_eq!(at(-1.0, -1.0), [1.0, 0.0, 0.0]);
        assert_eq!(at(2.0, -0.5), [0.0, 1.0, 0.0]);
        assert_eq!(at(-0.5, 3.0), [0.0, 0.0, 1.0]);
        assert_eq!(at(0.25, -1.0), [0.75, 0.25, 0.0]);
        assert_eq!(at(-1.0, 0.25), [0.75, 0.0, 0.25]);
        assert_eq!(at(1.0, 1.0), [0.0, 0.5, 0.5]);
        let inside = at(0.25, 0.5);
        assert!(
            inside
                .iter()
                .zip([0.25, 0.25, 0.5])
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
    }
}
