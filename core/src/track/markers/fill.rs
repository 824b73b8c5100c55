//! A marker's place from its neighbours: a local frame, then what the host's regression adds.
//!
//! The frame is the weighted rigid motion of the neighbours (absolute orientation, Horn 1987),
//! found from the frame's last rotation by Gauss-Newton steps. Estimated neighbours weigh less by
//! their variance. Directions that the neighbours leave open, such as the turn about a line, stay
//! as they were.

use glam::{Mat3, Vec3, Vec3Swizzles};

use super::model::Model;
use super::state::Trace;
use crate::math::{Quat4, affine, inverse_sqrt, quaternion_product};

/// Steps from the last rotation, and from one built from three neighbours.
const WARM: usize = 2;
const COLD: usize = 6;

/// Share of the neighbours' spread that a right rotation never leaves.
const ASTRAY: f32 = 0.1;
/// Most by which departures move a marker, metres.
const FARTHEST: f32 = 0.1;

/// The local frame of a marker and what its neighbours expect in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Expectation {
    pub turn: Quat4,
    rotation: Mat3,
    /// Weighted mean of the neighbours in the world and in the local frame.
    centre: Vec3,
    middle: Vec3,
    /// The marker's place in the local frame, from regression.
    pub local: Vec3,
    /// Share of the neighbours' full weight that stands behind it, 0 to 1.
    pub share: f32,
    /// Mean variance of the neighbours themselves, square metres.
    pub inherited: f32,
    /// Variance because rigid neighbours are not measured, square metres.
    pub loose: f32,
    /// How much less rigid the neighbours are than learned: their mean square departure over its
    /// variance, at least 1.
    pub bent: f32,
}

impl Expectation {
    pub fn to_world(self, local: Vec3) -> Vec3 {
        self.rotation * (local - self.middle) + self.centre
    }

    pub fn to_local(self, world: Vec3) -> Vec3 {
        self.rotation.transpose() * (world - self.centre) + self.middle
    }
}

/// Most inner steps of one expectation, in the unit of [`super::work_bound`].
pub(super) const fn work(neighbours: usize) -> u32 {
    8 + 8 * neighbours as u32
}

impl Model<'_> {
    /// Where a marker's neighbours alone expect it, metres; `None` where they are fewer than three
    /// or on a line. `place`: of a marker that is measured.
    ///
    /// Linear in the neighbours.
    pub fn expect(
        &self,
        marker: usize,
        place: impl Fn(usize) -> Option<[f32; 3]>,
    ) -> Option<[f32; 3]> {
        let place = |index| Some((Vec3::from_array(place(index)?), 0.0));
        let found = expect(self, place, marker, None)?;
        Some(found.to_world(found.local).to_array())
    }
}

/// Where a marker is and how sure, as its neighbours need it; `None` where it has no place.
pub(super) fn placed(traces: &[Trace]) -> impl Fn(usize) -> Option<(Vec3, f32)> {
    |index| {
        let trace = traces.get(index).filter(|trace| trace.is_placed)?;
        Some((trace.position, trace.sigma))
    }
}

/// Where a marker's neighbours expect it; `None` without any. `place`: position and standard
/// deviation of a marker; `turn`: the frame's last rotation, if known.
pub(super) fn expect(
    model: &Model<'_>,
    place: impl Fn(usize) -> Option<(Vec3, f32)>,
    marker: usize,
    turn: Option<Quat4>,
) -> Option<Expectation> {
    let trust = |index: usize, full: f32| -> Option<(Vec3, f32, f32)> {
        let (position, sigma) = place(index)?;
        let variance = sigma * sigma;
        let weight = if variance > 0.0 {
            full / (1.0 + full * variance)
        } else {
            full
        };
        Some((position, weight, variance))
    };
    let (mut total, mut full, mut inherited) = (0.0, 0.0, 0.0);
    let (mut centre, mut middle) = (Vec3::ZERO, Vec3::ZERO);
    let (mut tight, mut tightest) = (Three([UNKNOWN; 3]), Three([UNKNOWN; 3]));
    for (index, link) in model.links(marker) {
        full += link.weight();
        tightest.insert(link.spread());
        let Some((position, weight, variance)) = trust(index, link.weight()) else {
            continue;
        };
        total += weight;
        centre += position * weight;
        middle += link.shape() * weight;
        inherited += link.weight() * variance;
        if variance == 0.0 {
            tight.insert(link.spread());
        }
    }
    if total <= 0.0 {
        return None;
    }
    let per_weight = 1.0 / total;
    centre *= per_weight;
    middle *= per_weight;
    // Columns of the sum of weight * world * local^T, and the local scatter.
    let (mut bx, mut by, mut bz) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
    let (mut squares, mut mixed) = (Vec3::ZERO, Vec3::ZERO);
    let (mut spread, mut known) = (0.0, 0.0);
    for (index, link) in model.links(marker) {
        let Some((position, weight, _)) = trust(index, link.weight()) else {
            continue;
        };
        let local = link.shape() - middle;
        let arm = position - centre;
        let world = arm * weight;
        spread += world.dot(arm);
        known += 1.0;
        bx += world * local.x;
        by += world * local.y;
        bz += world * local.z;
        let weighted = local * weight;
        squares += weighted * local;
        mixed += weighted.yzx() * local;
    }
    let cross = Mat3::from_cols(bx, by, bz);
    let scatter = Scatter { squares, mixed };
    let size = spread + squares.x + squares.y + squares.z;
    // What the rotation leaves: the sum of weight * |world - turned local|^2.
    let left = |turn: Quat4| {
        let rotation = matrix(turn);
        let met = rotation.x_axis.dot(bx) + rotation.y_axis.dot(by) + rotation.z_axis.dot(bz);
        (size - 2.0 * met).max(0.0)
    };
    let turn = turn.map(|turn| refine(turn, &cross, &scatter, WARM));
    let turn = match turn.filter(|turn| left(*turn) < ASTRAY * size) {
        Some(turn) => turn,
        // Steps stay where they are half a turn from the right place.
        None => match start(model, &place, marker) {
            Some(new) => {
                let new = refine(new, &cross, &scatter, COLD);
                turn.filter(|turn| left(*turn) <= left(new)).unwrap_or(new)
            }
            None => turn?,
        },
    };
    let rotation = matrix(turn);
    let bent = left(turn) / (3.0 * f32::max(known - 2.0, 1.0));
    let back = rotation.transpose();
    let mut local = model.marker(marker).home;
    let mut moved = Vec3::ZERO;
    for (index, link) in model.links(marker) {
        let Some((position, weight, _)) = trust(index, link.weight()) else {
            continue;
        };
        let departure = back * (position - centre) + middle - link.shape();
        let trusted = if weight < link.weight() {
            weight / link.weight()
        } else {
            1.0
        };
        moved += link.gain(departure * trusted);
    }
    // In poses far from all that were learned a regression says anything.
    if moved.length_squared() < FARTHEST * FARTHEST {
        local += moved;
    }
    Some(Expectation {
        turn,
        rotation,
        centre,
        middle,
        local,
        share: total / full,
        inherited: inherited / full,
        bent: bent.max(1.0),
        loose: tight.0[2] * tight.0[2] - tightest.0[2] * tightest.0[2],
    })
}

/// Spread of a distance that is not there, metres.
const UNKNOWN: f32 = 0.06;

/// The smallest three, ascending: so many distances fix a place.
struct Three([f32; 3]);

impl Three {
    #[inline]
    fn insert(&mut self, mut carried: f32) {
        for slot in &mut self.0 {
            if carried < *slot {
                core::mem::swap(slot, &mut carried);
            }
        }
    }
}

/// Symmetric 3 x 3: xx, yy, zz and xy, yz, zx.
#[derive(Clone, Copy, Debug)]
struct Scatter {
    squares: Vec3,
    mixed: Vec3,
}

fn matrix(turn: Quat4) -> Mat3 {
    let m = affine(turn, [0.0; 3], [1.0; 3]);
    Mat3::from_cols(
        Vec3::new(m[0], m[4], m[8]),
        Vec3::new(m[1], m[5], m[9]),
        Vec3::new(m[2], m[6], m[10]),
    )
}

/// Gauss-Newton steps on the rotation: cubic on rigid points, and bounded on any.
fn refine(mut turn: Quat4, cross: &Mat3, scatter: &Scatter, steps: usize) -> Quat4 {
    let Scatter { squares, mixed } = scatter;
    let trace = squares.x + squares.y + squares.z;
    // A grain of stiffness keeps what the points leave open where it was.
    let stiff = 1e-3 * trace + 1e-12;
    let (a, b, c) = (
        trace - squares.x + stiff,
        trace - squares.y + stiff,
        trace - squares.z + stiff,
    );
    let (xy, yz, zx) = (-mixed.x, -mixed.y, -mixed.z);
    let (c00, c01, c02) = (b * c - yz * yz, zx * yz - xy * c, xy * yz - b * zx);
    let (c11, c12, c22) = (a * c - zx * zx, xy * zx - a * yz, a * b - xy * xy);
    let determinant = a * c00 + xy * c01 + zx * c02;
    let inverse = if determinant > 1e-30 {
        1.0 / determinant
    } else {
        0.0
    };
    for _ in 0..steps {
        let turned = matrix(turn).transpose() * *cross;
        // Torque: sum of local x (world turned back).
        let torque = Vec3::new(
            turned.y_axis.z - turned.z_axis.y,
            turned.z_axis.x - turned.x_axis.z,
            turned.x_axis.y - turned.y_axis.x,
        );
        let step = Vec3::new(
            c00 * torque.x + c01 * torque.y + c02 * torque.z,
            c01 * torque.x + c11 * torque.y + c12 * torque.z,
            c02 * torque.x + c12 * torque.y + c22 * torque.z,
        ) * (0.5 * inverse);
        let length2 = 1.0 + step.length_squared();
        if length2.is_nan() || length2 > 1e6 {
            break;
        }
        let scale = inverse_sqrt(length2);
        let small = [step.x * scale, step.y * scale, step.z * scale, scale];
        turn = quaternion_product(turn, small);
        let length2 = crate::math::dot4(turn, turn);
        // One Newton step towards unit length is enough each time.
        let scale = 1.5 - 0.5 * length2;
        turn = turn.map(|x| x * scale);
    }
    turn
}

/// A rotation from the first three placed neighbours that are not on a line: both triangles get
/// a frame (first edge, normal), and one is carried to the other.
fn start(
    model: &Model<'_>,
    place: impl Fn(usize) -> Option<(Vec3, f32)>,
    marker: usize,
) -> Option<Quat4> {
    let mut placed = model.links(marker).filter_map(|(index, link)| {
        let (position, _) = place(index)?;
        Some((position, link.shape()))
    });
    let (p0, s0) = placed.next()?;
    let (p1, s1) = placed.next()?;
    let (from, to) = (s1 - s0, p1 - p0);
    for (p2, s2) in placed {
        let (Some(local), Some(world)) = (triad(from, s2 - s0), triad(to, p2 - p0)) else {
            continue;
        };
        return quaternion(&(world * local.transpose()));
    }
    None
}

/// An orthonormal frame from two edges of a triangle; `None` where it is too thin.
fn triad(edge: Vec3, other: Vec3) -> Option<Mat3> {
    let normal = edge.cross(other);
    let (edge2, normal2) = (edge.length_squared(), normal.length_squared());
    // The height over the edge is at least a twentieth of it.
    if edge2 < 1e-8 || normal2 < 0.0025 * edge2 * edge2 {
        return None;
    }
    let x = edge * inverse_sqrt(edge2);
    let z = normal * inverse_sqrt(normal2);
    Some(Mat3::from_cols(x, z.cross(x), z))
}

/// The unit quaternion of a rotation matrix (Shepperd 1978).
fn quaternion(m: &Mat3) -> Option<Quat4> {
    let (x, y, z) = (m.x_axis, m.y_axis, m.z_axis);
    let trace = x.x + y.y + z.z;
    let q = if trace > 0.0 {
        [y.z - z.y, z.x - x.z, x.y - y.x, 1.0 + trace]
    } else if x.x >= y.y && x.x >= z.z {
        [1.0 + x.x - y.y - z.z, x.y + y.x, x.z + z.x, y.z - z.y]
    } else if y.y >= z.z {
        [x.y + y.x, 1.0 - x.x + y.y - z.z, y.z + z.y, z.x - x.z]
    } else {
        [x.z + z.x, y.z + z.y, 1.0 - x.x - y.y + z.z, x.y - y.x]
    };
    crate::math::normalise(q)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u32) -> f32 {
        *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*state >> 8) as f32 / (1 << 23) as f32 - 1.0
    }

    #[test]
    fn quaternions_and_matrices_agree() {
        let mut state = 7;
        for _ in 0..200 {
            let q = core::array::from_fn(|_| random(&mut state));
            let q = crate::math::normalise(q).unwrap();
            let back = quaternion(&matrix(q)).unwrap();
            assert!(
                crate::math::dot4(q, back).abs() > 1.0 - 1e-6,
                "{q:?} {back:?}"
            );
        }
    }

    #[test]
    fn steps_find_the_rotation() {
        let mut state = 3;
        for _ in 0..200 {
            let points: [Vec3; 5] =
                core::array::from_fn(|_| Vec3::from_array([(); 3].map(|()| random(&mut state))));
            let mean = points.iter().sum::<Vec3>() / 5.0;
            let axis = Vec3::new(random(&mut state), random(&mut state), random(&mut state));
            // Up to a third of a turn away from the start.
            let q = [axis.x * 0.5, axis.y * 0.5, axis.z * 0.5, 1.0];
            let q = crate::math::normalise(q).unwrap();
            let rotation = matrix(q);
            let mut cross = Mat3::ZERO;
            let mut scatter = Scatter {
                squares: Vec3::ZERO,
                mixed: Vec3::ZERO,
            };
            for point in points {
                let local = point - mean;
                let world = rotation * local;
                cross += Mat3::from_cols(world * local.x, world * local.y, world * local.z);
                scatter.squares += local * local;
                scatter.mixed += local.yzx() * local;
            }
            let found = refine([0.0, 0.0, 0.0, 1.0], &cross, &scatter, 8);
            let cosine = crate::math::dot4(found, q).abs();
            assert!(cosine > 1.0 - 1e-5, "{cosine}");
        }
    }
}
