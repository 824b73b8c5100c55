//! A simple moving person: capsules that a rope touches and cameras look past, and 41 markers.

use glam::{DQuat, DVec3};

/// A line segment with a radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    /// One end of the axis, metres.
    pub a: DVec3,
    /// The other end, metres.
    pub b: DVec3,
    /// Metres.
    pub radius: f64,
}

impl Capsule {
    /// The point of the axis nearest to `point`.
    #[must_use]
    pub fn nearest_on_axis(&self, point: DVec3) -> DVec3 {
        let axis = self.b - self.a;
        let along = (point - self.a).dot(axis) / axis.length_squared().max(1e-12);
        self.a + axis * along.clamp(0.0, 1.0)
    }

    /// Whether the segment from `p` to `q` passes nearer to the axis than the radius.
    #[must_use]
    pub fn blocks(&self, p: DVec3, q: DVec3) -> bool {
        // Nearest points of two segments (Ericson, *Real-Time Collision Detection*, 5.1.9).
        let (d1, d2, r) = (q - p, self.b - self.a, p - self.a);
        let (a, e, f) = (d1.length_squared(), d2.length_squared(), d2.dot(r));
        let (b, c) = (d1.dot(d2), d1.dot(r));
        let denominator = a * e - b * b;
        let mut s = 0.0;
        if denominator > 1e-12 {
            s = ((b * f - c * e) / denominator).clamp(0.0, 1.0);
        }
        let t = ((b * s + f) / e.max(1e-12)).clamp(0.0, 1.0);
        let s = ((b * t - c) / a.max(1e-12)).clamp(0.0, 1.0);
        (p + d1 * s).distance_squared(self.a + d2 * t) < self.radius * self.radius
    }
}

/// Markers that [`Person::markers`] gives.
pub const BODY_MARKERS: usize = 41;

/// (capsule, place along the axis, angle about it in turns) of each marker.
const PLACES: [(usize, f64, f64); BODY_MARKERS] = [
    // Head.
    (2, 0.8, 0.10),
    (2, 0.8, 0.40),
    (2, 0.8, 0.60),
    (2, 0.8, 0.90),
    // Chest and belly.
    (1, 0.9, 0.0),
    (1, 0.9, 0.5),
    (1, 0.5, 0.02),
    (1, 0.5, 0.48),
    (1, 0.7, 0.6),
    (0, 0.5, 0.12),
    (0, 0.5, 0.38),
    (0, 0.5, 0.62),
    (0, 0.5, 0.88),
    // Upper arms, forearms, hands; left, then right.
    (3, 0.0, 0.25),
    (3, 0.5, 0.3),
    (3, 1.0, 0.2),
    (5, 0.5, 0.25),
    (5, 0.9, 0.0),
    (5, 0.9, 0.5),
    (5, 1.0, 0.3),
    (4, 0.0, 0.75),
    (4, 0.4, 0.7),
    (4, 1.0, 0.8),
    (6, 0.6, 0.75),
    (6, 0.9, 0.0),
    (6, 0.9, 0.5),
    (6, 1.0, 0.7),
    // Thighs, shins, feet.
    (7, 0.4, 0.2),
    (7, 1.0, 0.25),
    (9, 0.5, 0.2),
    (9, 1.0, 0.25),
    (11, 0.0, 0.5),
    (11, 1.0, 0.1),
    (11, 1.0, 0.3),
    (8, 0.5, 0.8),
    (8, 1.0, 0.75),
    (10, 0.6, 0.8),
    (10, 1.0, 0.75),
    (12, 0.0, 0.5),
    (12, 1.0, 0.1),
    (12, 1.0, 0.9),
];

/// Where a person stands and what moves it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stance {
    /// Middle of the feet on the floor.
    pub(super) ground: DVec3,
    /// How far the hips are above (jump) or below (crouch) standing height.
    pub(super) lift: f64,
    /// Palms, left and right.
    pub(super) hands: [DVec3; 2],
}

/// Thirteen capsules and 41 markers at one instant. The person faces +Z; left is +X.
#[derive(Clone, Debug, PartialEq)]
pub struct Person {
    /// Pelvis, chest, head, upper arms, forearms, thighs, shins, feet; left before right.
    pub capsules: Vec<Capsule>,
}

impl Person {
    pub(super) fn new(stance: &Stance) -> Self {
        let base = stance.ground + DVec3::Y * stance.lift;
        let at = |x: f64, y: f64, z: f64| base + DVec3::new(x, y, z);
        let mut capsules = vec![
            Capsule {
                a: at(-0.08, 0.98, 0.0),
                b: at(0.08, 0.98, 0.0),
                radius: 0.13,
            },
            Capsule {
                a: at(0.0, 1.10, 0.0),
                b: at(0.0, 1.36, 0.0),
                radius: 0.13,
            },
            Capsule {
                a: at(0.0, 1.60, 0.02),
                b: at(0.0, 1.70, 0.02),
                radius: 0.09,
            },
        ];
        let mut fore = Vec::new();
        for (side, hand) in [(1.0, stance.hands[0]), (-1.0, stance.hands[1])] {
            let shoulder = at(0.19 * side, 1.43, 0.0);
            let (elbow, wrist) = two_bones(
                shoulder,
                hand,
                0.29,
                0.30,
                DVec3::new(0.3 * side, -0.5, -1.0),
            );
            capsules.push(Capsule {
                a: shoulder,
                b: elbow,
                radius: 0.05,
            });
            fore.push(Capsule {
                a: elbow,
                b: wrist,
                radius: 0.04,
            });
        }
        capsules.append(&mut fore);
        let (mut shins, mut feet) = (Vec::new(), Vec::new());
        for side in [1.0, -1.0] {
            let hip = at(0.10 * side, 0.93, 0.0);
            let sole = stance.ground + DVec3::Y * stance.lift.max(0.0);
            let ankle = sole + DVec3::new(0.10 * side, 0.09, -0.02);
            let (knee, ankle) = two_bones(hip, ankle, 0.43, 0.43, DVec3::Z);
            capsules.push(Capsule {
                a: hip,
                b: knee,
                radius: 0.07,
            });
            shins.push(Capsule {
                a: knee,
                b: ankle,
                radius: 0.05,
            });
            let toe = DVec3::new(ankle.x, sole.y + 0.04, ankle.z + 0.17);
            feet.push(Capsule {
                a: ankle - DVec3::new(0.0, 0.05, 0.04),
                b: toe,
                radius: 0.04,
            });
        }
        capsules.append(&mut shins);
        capsules.append(&mut feet);
        Self { capsules }
    }

    /// `[41]`, metres, on the capsules' surfaces.
    #[must_use]
    pub fn markers(&self) -> Vec<DVec3> {
        let place = |&(part, along, turn): &(usize, f64, f64)| {
            let capsule = self.capsules[part];
            let axis = (capsule.b - capsule.a).normalize_or(DVec3::Y);
            // The front (+Z) is turn 0; for capsules along Z the top is.
            let front = if axis.z.abs() > 0.9 {
                DVec3::Y
            } else {
                DVec3::Z
            };
            let zero = (front - axis * axis.dot(front)).normalize_or(DVec3::X);
            let around = DQuat::from_axis_angle(axis, turn * std::f64::consts::TAU);
            capsule.a.lerp(capsule.b, along) + around * zero * (capsule.radius + 0.01)
        };
        PLACES.iter().map(place).collect()
    }
}

/// Middle and end of a limb from `root` towards `goal`, bent towards `pole`.
pub(super) fn two_bones(
    root: DVec3,
    goal: DVec3,
    upper: f64,
    lower: f64,
    pole: DVec3,
) -> (DVec3, DVec3) {
    let to_goal = goal - root;
    let reach = to_goal.length().clamp(1e-6, upper + lower - 1e-4);
    let axis = to_goal.normalize_or(DVec3::NEG_Y);
    let along = (upper * upper - lower * lower + reach * reach) / (2.0 * reach);
    let out = (upper * upper - along * along).max(0.0).sqrt();
    let side = (pole - axis * axis.dot(pole)).normalize_or(DVec3::Z);
    (root + axis * along + side * out, root + axis * reach)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn capsule_blocks_what_passes_through_it() {
        let capsule = Capsule {
            a: DVec3::ZERO,
            b: DVec3::Y,
            radius: 0.1,
        };
        let line = |z: f64| (DVec3::new(-1.0, 0.5, z), DVec3::new(1.0, 0.5, z));
        let (p, q) = line(0.05);
        assert!(capsule.blocks(p, q));
        let (p, q) = line(0.15);
        assert!(!capsule.blocks(p, q));
        assert!(!capsule.blocks(DVec3::new(-1.0, 0.5, 0.0), DVec3::new(-0.5, 0.5, 0.0)));
    }

    #[test]
    fn limb_keeps_its_lengths() {
        let (middle, end) = two_bones(DVec3::ZERO, DVec3::new(0.3, -0.2, 0.1), 0.3, 0.25, DVec3::Z);
        assert!((middle.length() - 0.3).abs() < 1e-12);
        assert!((end.distance(middle) - 0.25).abs() < 1e-12);
        assert!(end.distance(DVec3::new(0.3, -0.2, 0.1)) < 1e-12);
    }

    #[test]
    fn every_marker_lies_on_the_body() {
        let hands = [DVec3::new(0.4, 1.0, 0.2), DVec3::new(-0.4, 1.0, 0.2)];
        let person = Person::new(&Stance {
            ground: DVec3::ZERO,
            lift: -0.05,
            hands,
        });
        for marker in person.markers() {
            let gap = person
                .capsules
                .iter()
                .map(|c| marker.distance(c.nearest_on_axis(marker)) - c.radius)
                .fold(f64::INFINITY, f64::min);
            assert!(gap < 0.0101 && gap > -0.06, "{gap}");
        }
    }
}
