//! From a rope's markers to the joints that move its tube, live.
//!
//! The host bakes a rope as a skinned tube with a joint a marker, weighted by the natural cubic
//! B-spline. Each joint carries a straight piece of rope, and blended the pieces would cut the
//! corners: so the joints stand where the blend passes through the markers, which is a tridiagonal
//! system, and turn from one to the next without twist (parallel transport, Bishop 1975).

use glam::{Quat, Vec3};

use super::vector::{cross, dot, unit};
use crate::math::{Quat4, inverse_sqrt, normalise, quaternion_product};
use crate::pose::Transform;
use crate::row::Row;

/// A tube's joints, up to `TRACES` of them.
///
/// ```
/// use sinew_core::track::rope::TubeJoints;
/// let mut joints = TubeJoints::<8>::new(&[0.1; 3]);
/// let markers = [[0.0, 1.0, 0.0], [0.1, 1.0, 0.0], [0.2, 1.0, 0.0], [0.3, 1.0, 0.0]];
/// let pose: Vec<_> = joints.update(&markers).collect();
/// assert_eq!(pose.len(), 4);
/// assert!((pose[2].translation.x - 0.2).abs() < 1e-6);
/// ```
#[derive(Clone, Debug)]
pub struct TubeJoints<const TRACES: usize> {
    count: usize,
    /// Metres from each marker to the next.
    length: Row<f32, TRACES>,
    tangent: Row<Vec3, TRACES>,
    position: Row<Vec3, TRACES>,
    factor: Row<f32, TRACES>,
    /// The first joint's rotation in the frame before.
    start: Quat4,
}

impl<const TRACES: usize> TubeJoints<TRACES> {
    /// Joints for a rope with these distances between its markers, `[markers - 1]` metres, as
    /// [`segment_lengths`](super::RopeTracker::segment_lengths) gives them; the first
    /// `TRACES - 1` count.
    #[must_use]
    pub fn new(lengths: &[f32]) -> Self {
        let mut length = Row::new();
        let mut count = 1;
        for (i, &metres) in lengths.iter().take(TRACES.saturating_sub(1)).enumerate() {
            // NaN is no length either.
            length.set(i, if metres > 1e-4 { metres } else { 1e-4 });
            count = i + 2;
        }
        Self {
            count,
            length,
            tangent: Row::new(),
            position: Row::new(),
            factor: Row::new(),
            start: [0.0, 0.0, 0.0, 1.0],
        }
    }

    /// Local transforms of the joints for `markers`, `[markers x 3]` metres, in order along the
    /// rope; they belong at the rope's joints in [`Input::Pose`](crate::frame::Input::Pose).
    /// O(markers)
    pub fn update(&mut self, markers: &[[f32; 3]]) -> impl Iterator<Item = Transform> + '_ {
        let count = self.count.min(markers.len());
        for (i, &marker) in markers.iter().enumerate().take(count) {
            self.position.set(i, Vec3::from_array(marker));
        }
        self.find_tangents(count);
        self.solve(count);
        let mut turn = self.start;
        let mut start = self.start;
        let tangent = &self.tangent;
        let position = &self.position;
        if count > 0 {
            start = transported(turn, tangent.at(0));
            turn = start;
        }
        self.start = start;
        (0..count).map(move |i| {
            turn = transported(turn, tangent.at(i));
            Transform {
                rotation: Quat::from_array(turn),
                translation: position.at(i),
                scale: Vec3::ONE,
            }
        })
    }

    /// Central differences over the arc; at the ends the parabola through three markers.
    fn find_tangents(&mut self, count: usize) {
        let last = count.saturating_sub(1);
        let chord =
            |i: usize| (self.position.at(i + 1) - self.position.at(i)) * (1.0 / self.length.at(i));
        let mut before = Vec3::X;
        for i in 0..count {
            let tangent = if last == 0 {
                before
            } else if i == 0 || i == last {
                let (near, next) = if i == 0 {
                    (0, 1)
                } else {
                    (last - 1, last.saturating_sub(2))
                };
                if last > 1 {
                    let (a, b) = (self.length.at(near), self.length.at(next));
                    let far = (chord(near) * a + chord(next) * b) * (1.0 / (a + b));
                    chord(near) * 2.0 - far
                } else {
                    chord(near)
                }
            } else {
                let (a, b) = (self.length.at(i - 1), self.length.at(i));
                (chord(i - 1) * b + chord(i) * a) * (1.0 / (a + b))
            };
            let direction = unit(tangent);
            before = if dot(direction, direction) > 0.5 {
                direction
            } else {
                before
            };
            self.tangent.set(i, before);
        }
    }

    /// `q[i-1] + 4 q[i] + q[i+1] = 6 p[i] - back + ahead`, by elimination; the ends are the
    /// markers themselves.
    fn solve(&mut self, count: usize) {
        let last = count.saturating_sub(1);
        self.factor.set(0, 0.0);
        for i in 1..last {
            let back = self.tangent.at(i - 1) * self.length.at(i - 1);
            let ahead = self.tangent.at(i + 1) * self.length.at(i);
            let right = self.position.at(i) * 6.0 - back + ahead;
            let pivot = 1.0 / (4.0 - self.factor.at(i - 1));
            self.factor.set(i, pivot);
            let above = self.position.at(i - 1);
            self.position.set(i, (right - above) * pivot);
        }
        for i in (1..last).rev() {
            let after = self.position.at(i + 1) * self.factor.at(i);
            self.position.edit(i, |p| *p -= after);
        }
    }
}

/// `turn` followed by the smallest rotation that takes its X axis to `tangent`.
fn transported(turn: Quat4, tangent: Vec3) -> Quat4 {
    let [x, y, z, w] = turn;
    let axis = Vec3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y + w * z),
        2.0 * (x * z - w * y),
    );
    let cosine = dot(axis, tangent);
    let way = if cosine > -0.999_9 {
        let n = cross(axis, tangent);
        // Half angles: the quaternion (n, 1 + cos) at unit length.
        [n.x, n.y, n.z, 1.0 + cosine]
    } else {
        // Half a turn about any axis across.
        let side = if axis.x * axis.x < 0.5 {
            Vec3::X
        } else {
            Vec3::Y
        };
        let n = cross(axis, side);
        let factor = inverse_sqrt(dot(n, n));
        [n.x * factor, n.y * factor, n.z * factor, 0.0]
    };
    let product = normalise(way).map(|way| quaternion_product(way, turn));
    product.and_then(normalise).unwrap_or(turn)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 9;

    fn arch(phase: f32) -> [[f32; 3]; COUNT] {
        core::array::from_fn(|i| {
            let a = 0.25 * i as f32 + phase;
            [0.4 * libm::cosf(a), 1.0 + 0.4 * libm::sinf(a), 0.1 * phase]
        })
    }

    #[test]
    fn the_blend_passes_through_the_markers_without_twist() {
        let chord = 0.8 * libm::sinf(0.125);
        let mut joints = TubeJoints::<16>::new(&[chord; COUNT - 1]);
        for frame in 0..20 {
            let markers = arch(0.05 * frame as f32);
            let mut pose = [Transform::IDENTITY; COUNT];
            for (slot, joint) in pose.iter_mut().zip(joints.update(&markers)) {
                *slot = joint;
            }
            // What a joint's straight piece says about a place `s` metres along the rope from it.
            let says = |i: usize, s: f32| {
                let [x, y, z, w] = pose[i].rotation.to_array();
                let along = Vec3::new(
                    1.0 - 2.0 * (y * y + z * z),
                    2.0 * (x * y + w * z),
                    2.0 * (x * z - w * y),
                );
                pose[i].translation + along * s
            };
            for i in 1..COUNT - 1 {
                let sum = says(i - 1, chord) + says(i, 0.0) * 4.0 + says(i + 1, -chord);
                let off = sum * (1.0 / 6.0) - Vec3::from_array(markers[i]);
                assert!(off.length() < 2e-6, "frame {frame}, marker {i}: {off}");
                // The rope lies in a plane: its joints all turn about Z from one to the next.
                let [ax, ay, az, aw] = pose[i].rotation.to_array();
                let [bx, by, bz, bw] = pose[i + 1].rotation.to_array();
                let turned = ax * bx + ay * by + az * bz + aw * bw;
                assert!(turned.abs() > 0.98, "no jump from joint to joint");
            }
        }
    }

    #[test]
    fn degenerate_ropes_give_finite_joints() {
        let mut joints = TubeJoints::<4>::new(&[0.1, f32::NAN, 0.0, 0.1]);
        let finite = |pose: Transform| pose.rotation.is_finite() && pose.translation.is_finite();
        assert!(joints.update(&[[0.5; 3]; 4]).all(finite));
        assert!(
            joints
                .update(&[[1.0, 0.0, 0.0], [0.9, 0.0, 0.0], [1.0, 0.0, 0.0]])
                .all(finite)
        );
        assert_eq!(joints.update(&[]).count(), 0);
    }
}
