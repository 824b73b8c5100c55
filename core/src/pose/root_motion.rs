//! Root motion: what moves the whole body over the floor, taken out of a pose.

use super::Local;
use crate::math::{Quat4, affine, conjugate, normalise, quaternion_product, transform_vector};

/// A place on the floor and a heading: the part of a root's motion that moves a character.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Turn about the vertical, unit length.
    pub heading: Quat4,
    /// x and z, metres; y is 0.
    pub place: [f32; 3],
}

impl Ground {
    /// The origin, unturned.
    pub const ORIGIN: Self = Self {
        heading: [0.0, 0.0, 0.0, 1.0],
        place: [0.0; 3],
    };

    /// Where a root joint stands: its turn since `rest` about the vertical, and its place.
    ///
    /// A body upside down about a horizontal axis has no heading; it counts as unturned.
    #[must_use]
    pub fn of(root: &Local, rest: &Local) -> Self {
        let &[x, y, z, w, tx, _, tz, ..] = root;
        let &[rx, ry, rz, rw, ..] = rest;
        let [_, y, _, w] = quaternion_product([x, y, z, w], conjugate([rx, ry, rz, rw]));
        Self {
            heading: normalise([0.0, y, 0.0, w]).unwrap_or([0.0, 0.0, 0.0, 1.0]),
            place: [tx, 0.0, tz],
        }
    }

    /// This, moved on by a step in its own axes.
    #[must_use]
    pub fn then(&self, step: &Self) -> Self {
        let [x, y, z] = turned(self.heading, step.place);
        let [px, py, pz] = self.place;
        let heading = quaternion_product(self.heading, step.heading);
        Self {
            heading: normalise(heading).unwrap_or(self.heading),
            place: [px + x, py + y, pz + z],
        }
    }

    /// The step from `self` to `other`, in the axes of `self`.
    #[must_use]
    pub fn step_to(&self, other: &Self) -> Self {
        let back = conjugate(self.heading);
        let ([ax, ay, az], [bx, by, bz]) = (self.place, other.place);
        let heading = quaternion_product(back, other.heading);
        Self {
            heading: normalise(heading).unwrap_or([0.0, 0.0, 0.0, 1.0]),
            place: turned(back, [bx - ax, by - ay, bz - az]),
        }
    }
}

/// The step of a loop from one time to a later one; `wrapped` says that the loop began again between
/// them, and then `start` and `end` are where its first and last pose stand.
#[must_use]
pub fn loop_step(
    before: &Ground,
    now: &Ground,
    wrapped: bool,
    start: &Ground,
    end: &Ground,
) -> Ground {
    if wrapped {
        before.step_to(end).then(&start.step_to(now))
    } else {
        before.step_to(now)
    }
}

/// Takes the root's motion over the floor out of its transform and returns it: the pose stays in
/// place, and [`Ground`] carries the character. `rest` is the root's rest pose.
///
/// `Ground::then`-ing the steps between frames and putting the pose there gives the motion back.
pub fn extract(root: &mut Local, rest: &Local) -> Ground {
    let ground = Ground::of(root, rest);
    let &mut [x, y, z, w, ..] = root;
    let turn = quaternion_product(conjugate(ground.heading), [x, y, z, w]);
    if let Some([x, y, z, w]) = normalise(turn) {
        let [_, _, _, _, _, ty, _, sx, sy, sz] = *root;
        *root = [x, y, z, w, 0.0, ty, 0.0, sx, sy, sz];
    }
    ground
}

fn turned(turn: Quat4, v: [f32; 3]) -> [f32; 3] {
    transform_vector(&affine(turn, [0.0; 3], [1.0; 3]), v)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root(degrees: f32, lean: f32, at: [f32; 3]) -> Local {
        let half = degrees.to_radians() / 2.0;
        let yaw = [0.0, libm::sinf(half), 0.0, libm::cosf(half)];
        let tilt = [libm::sinf(lean / 2.0), 0.0, 0.0, libm::cosf(lean / 2.0)];
        let [x, y, z, w] = quaternion_product(yaw, tilt);
        let [tx, ty, tz] = at;
        [x, y, z, w, tx, ty, tz, 1.0, 1.0, 1.0]
    }

    const REST: Local = [0.0, 0.0, 0.0, 1.0, 0.0, 0.9, 0.0, 1.0, 1.0, 1.0];

    fn apart(a: &Ground, b: &Ground) -> f32 {
        let places = a.place.iter().zip(b.place).map(|(a, b)| (a - b).abs());
        let turns = a.heading.iter().zip(b.heading).map(|(a, b)| (a - b).abs());
        places.chain(turns).fold(0.0, f32::max)
    }

    #[test]
    fn steps_add_up_to_the_whole_way() {
        let mut at = Ground::of(&root(0.0, 0.2, [1.0, 0.9, 2.0]), &REST);
        let mut last = at;
        for step in 1..=20 {
            let step = step as f32;
            let pose = root(7.0 * step, 0.2, [1.0 + 0.1 * step, 0.9, 2.0 - 0.05 * step]);
            let now = Ground::of(&pose, &REST);
            at = at.then(&last.step_to(&now));
            last = now;
        }
        assert!(apart(&at, &last) < 1e-5);
        // A loop that walks a metre ahead goes on from there.
        let (start, end) = (
            Ground::ORIGIN,
            Ground {
                place: [0.0, 0.0, 1.0],
                ..Ground::ORIGIN
            },
        );
        let near_end = Ground {
            place: [0.0, 0.0, 0.9],
            ..Ground::ORIGIN
        };
        let after = Ground {
            place: [0.0, 0.0, 0.05],
            ..Ground::ORIGIN
        };
        let step = loop_step(&near_end, &after, true, &start, &end);
        assert!((step.place[2] - 0.15).abs() < 1e-6);
    }

    #[test]
    fn what_is_left_stands_in_place_and_leans_as_before() {
        let mut pose = root(60.0, 0.3, [4.0, 0.8, -3.0]);
        let ground = extract(&mut pose, &REST);
        assert_eq!((pose[4], pose[5], pose[6]), (0.0, 0.8, 0.0));
        let left = Ground::of(&pose, &REST);
        assert!(apart(&left, &Ground::ORIGIN) < 1e-6);
        let [x, y, z, w, ..] = pose;
        let [a, b, c, d] = quaternion_product(ground.heading, [x, y, z, w]);
        let source = root(60.0, 0.3, [0.0; 3]);
        for (back, source) in [a, b, c, d].iter().zip(source) {
            assert!((back - source).abs() < 1e-6);
        }
        // Half a turn about x has no heading.
        let mut over = [1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(extract(&mut over, &REST).heading, [0.0, 0.0, 0.0, 1.0]);
    }
}
