//! Muscles that swell with the angle of a joint.

use glam::{DAffine3, DVec3};

use super::mode::{Region, bump};
use crate::fit::{Part, Side};
use crate::model::Avatar;
use crate::studio::anatomy::Anatomy;
use crate::studio::performance::rotation;

/// What a muscle answers to. Each is 0 in the rest pose.
#[derive(Clone, Debug)]
enum Driver {
    /// Angle at the middle one of three joints, radians more than at rest.
    Bend { joints: [usize; 3], rest: f64 },
    /// How far a limb (from its first joint to its second) points along `axis` of the trunk's
    /// mesh-space axes, from -1 to 1, more than at rest.
    Swing {
        trunk: usize,
        /// The trunk's bind pose, turned back.
        unbind: DAffine3,
        limb: [usize; 2],
        axis: DVec3,
        rest: f64,
    },
}

/// A muscle: driver and size.
#[derive(Clone, Debug)]
pub(super) struct Muscle {
    pub name: String,
    driver: Driver,
    /// Metres for each unit of the driver.
    gain: f64,
    /// Metres.
    limit: f64,
}

impl Muscle {
    pub fn resize(&mut self, factor: f64) {
        self.gain *= factor;
        self.limit *= factor;
    }

    /// Metres, between minus and plus the limit.
    pub fn amplitude(&self, pose: &[DAffine3]) -> f64 {
        let by = match &self.driver {
            Driver::Bend { joints, rest } => angle(joints.map(|at| pose[at].translation)) - rest,
            Driver::Swing {
                trunk,
                unbind,
                limb,
                axis,
                rest,
            } => {
                let [from, to] = limb.map(|at| pose[at].translation);
                let turn = rotation(&(pose[*trunk] * *unbind));
                (turn.inverse() * (to - from))
                    .normalize_or_zero()
                    .dot(*axis)
                    - rest
            }
        };
        if self.limit > 0.0 {
            self.limit * (self.gain * by / self.limit).tanh()
        } else {
            0.0
        }
    }
}

/// How far the way through three points turns at the middle one; 0 for a straight way.
fn angle([a, b, c]: [DVec3; 3]) -> f64 {
    if a == b || b == c {
        0.0
    } else {
        (b - a).angle_between(c - b)
    }
}

/// Where a muscle sits on a segment between two joints.
struct Belly {
    /// From the first joint to the second.
    segment: [usize; 2],
    /// Middle and half length, in lengths of the segment.
    centre: f64,
    half: f64,
    /// The side that swells.
    side: DVec3,
}

impl Belly {
    /// Radially outward from the segment, on the skin that its first joint moves.
    fn region(&self, anatomy: &Anatomy, avatar: &Avatar) -> Region {
        let [from, to] = self.segment;
        let (start, axis) = (anatomy.at(from), anatomy.at(to) - anatomy.at(from));
        let length = axis.length();
        if length == 0.0 {
            return Region::over(avatar, |_, _, _| DVec3::ZERO);
        }
        let along = axis / length;
        let side = self.side.reject_from(along).normalize_or_zero();
        let on = anatomy.membership(avatar, |joint| {
            anatomy.is_below(joint, from) && !anatomy.is_below(joint, to)
        });
        Region::over(avatar, |vertex, position, _| {
            let offset = position - start;
            let radial = offset.reject_from(along).normalize_or_zero();
            let share = (offset.dot(along) / length - self.centre) / self.half;
            // Wraps a little more than half of the limb, strongest in the middle.
            let around = ((radial.dot(side) + 0.25) / 1.25).max(0.0);
            radial * (bump(share) * around * around * on[vertex])
        })
    }
}

/// A ball on the trunk's skin that moves along `direction`.
fn patch(
    anatomy: &Anatomy,
    avatar: &Avatar,
    on: &[f64],
    centre: DVec3,
    radius: f64,
    direction: DVec3,
) -> Region {
    Region::over(avatar, |vertex, position, normal| {
        let away = position.distance(centre) / (radius * anatomy.scale);
        let facing = normal.dot(direction).max(0.0);
        direction * (bump(away) * facing.sqrt() * on[vertex])
    })
}

/// The muscles of a body whose joints are there, with their places.
pub(super) fn of(anatomy: &Anatomy, avatar: &Avatar) -> Vec<(Muscle, Region)> {
    let mut out = Vec::new();
    let mut add = |name: String, driver: Driver, gain: f64, limit: f64, region: Region| {
        if !region.is_empty() {
            out.push((
                Muscle {
                    name,
                    driver,
                    gain,
                    limit,
                },
                region,
            ));
        }
    };
    let (front, up) = (anatomy.front, anatomy.up);
    let trunk_share = anatomy.trunk(avatar);
    let hips = anatomy.human.hips;
    let thorax = anatomy.thorax();
    let bend = |joints: [usize; 3]| Driver::Bend {
        joints,
        rest: angle(joints.map(|at| anatomy.at(at))),
    };
    let swing = |trunk: usize, limb: [usize; 2], axis: DVec3| {
        let [from, to] = limb.map(|at| anatomy.at(at));
        Driver::Swing {
            trunk,
            unbind: anatomy.bind[trunk].inverse(),
            limb,
            axis,
            rest: (to - from).normalize_or_zero().dot(axis),
        }
    };
    let length = (anatomy.at(thorax) - anatomy.at(hips)).dot(up);
    let on_trunk = |height: f64, across: DVec3, depth: f64| {
        anatomy.at(hips)
            + up * (height * length)
            + across * anatomy.scale
            + front * (depth * anatomy.scale)
    };
    for side in [Side::Left, Side::Right] {
        let out_side = anatomy.outward(side);
        let joint = |part| anatomy.limb(side, part);
        let name = |text: &str| format!("{side:?} {text}").to_lowercase();
        let belly = |segment, centre, half, side| {
            Belly {
                segment,
                centre,
                half,
                side,
            }
            .region(anatomy, avatar)
        };
        if let (Some(arm), Some(elbow)) = (joint(Part::UpperArm), joint(Part::LowerArm)) {
            if let Some(hand) = joint(Part::Hand) {
                let at = || bend([arm, elbow, hand]);
                let [arm_part, fore_part] = [[arm, elbow], [elbow, hand]];
                add(
                    name("biceps"),
                    at(),
                    0.013,
                    0.020,
                    belly(arm_part, 0.55, 0.45, front),
                );
                add(
                    name("triceps"),
                    at(),
                    -0.006,
                    0.010,
                    belly(arm_part, 0.45, 0.45, -front),
                );
                add(
                    name("forearm"),
                    at(),
                    0.005,
                    0.008,
                    belly(fore_part, 0.25, 0.30, front),
                );
            }
            let raise = swing(thorax, [arm, elbow], up);
            add(
                name("deltoid"),
                raise.clone(),
                0.010,
                0.012,
                belly([arm, elbow], 0.12, 0.35, out_side + up),
            );
            let shoulder = anatomy.at(arm);
            let trapezius = shoulder.lerp(anatomy.at(thorax), 0.45) + up * (0.08 * anatomy.scale);
            add(
                name("trapezius"),
                raise,
                0.012,
                0.014,
                patch(anatomy, avatar, &trunk_share, trapezius, 0.13, up),
            );
            let chest = on_trunk(1.0, out_side * 0.09, 0.11);
            add(
                name("pectoral"),
                swing(thorax, [arm, elbow], -out_side),
                0.010,
                0.012,
                patch(anatomy, avatar, &trunk_share, chest, 0.13, front),
            );
        }
        if let (Some(leg), Some(knee), Some(foot)) = (
            joint(Part::UpperLeg),
            joint(Part::LowerLeg),
            joint(Part::Foot),
        ) {
            let at = || bend([leg, knee, foot]);
            let [thigh, shank] = [[leg, knee], [knee, foot]];
            add(
                name("quadriceps"),
                at(),
                -0.008,
                0.012,
                belly(thigh, 0.50, 0.45, front),
            );
            add(
                name("hamstrings"),
                at(),
                0.010,
                0.014,
                belly(thigh, 0.60, 0.40, -front),
            );
            add(
                name("calf"),
                at(),
                0.008,
                0.012,
                belly(shank, 0.27, 0.30, -front),
            );
            if let Some(toes) = joint(Part::Toes) {
                add(
                    name("soleus"),
                    bend([knee, foot, toes]),
                    -0.016,
                    0.012,
                    belly(shank, 0.32, 0.34, -front),
                );
            }
            let seat = anatomy.at(leg) + out_side * (-0.01 * anatomy.scale)
                - front * (0.13 * anatomy.scale);
            let on = anatomy.membership(avatar, |joint| {
                joint == hips || anatomy.is_below(joint, leg) || !anatomy.is_limb(joint)
            });
            add(
                name("gluteus"),
                swing(hips, thigh, -front),
                0.012,
                0.014,
                patch(anatomy, avatar, &on, seat, 0.15, -front),
            );
        }
    }
    let belly = on_trunk(0.3, DVec3::ZERO, 0.12);
    add(
        "fold of the belly".into(),
        swing(hips, [hips, thorax], front),
        0.014,
        0.014,
        patch(anatomy, avatar, &trunk_share, belly, 0.18, front),
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bend_is_counted_from_rest_and_saturates() {
        let muscle = Muscle {
            name: String::new(),
            driver: Driver::Bend {
                joints: [0, 1, 2],
                rest: 0.0,
            },
            gain: 0.01,
            limit: 0.02,
        };
        let pose = |x: f64, y: f64| {
            [DVec3::ZERO, DVec3::X, DVec3::new(1.0 + x, y, 0.0)].map(DAffine3::from_translation)
        };
        assert_eq!(muscle.amplitude(&pose(1.0, 0.0)), 0.0);
        let right_angle = muscle.amplitude(&pose(0.0, 1.0));
        let expected = 0.02 * (0.01 * std::f64::consts::FRAC_PI_2 / 0.02).tanh();
        assert!((right_angle - expected).abs() < 1e-15);
    }

    #[test]
    fn a_swing_does_not_see_the_turn_of_the_whole_body() {
        let driver = Driver::Swing {
            trunk: 0,
            unbind: DAffine3::IDENTITY,
            limb: [0, 1],
            axis: DVec3::Y,
            rest: 0.0,
        };
        let muscle = Muscle {
            name: String::new(),
            driver,
            gain: 0.01,
            limit: 0.5,
        };
        let pose = [DAffine3::IDENTITY, DAffine3::from_translation(DVec3::Y)];
        let turned = pose.map(|m| DAffine3::from_rotation_z(1.0) * m);
        let (a, b) = (muscle.amplitude(&pose), muscle.amplitude(&turned));
        assert!((a - b).abs() < 1e-12 && (a - 0.01).abs() < 1e-4);
    }
}
