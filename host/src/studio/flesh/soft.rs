//! Soft parts: damped springs that the accelerations of the bones drive.

use glam::{DAffine3, DQuat, DVec3};

use super::mode::{Region, bump};
use crate::fit::{Part, Side};
use crate::model::Avatar;
use crate::studio::anatomy::Anatomy;
use crate::studio::performance::{Performance, rotation};

/// Metres a second squared, model space: Y is up.
const GRAVITY: DVec3 = DVec3::new(0.0, -9.81, 0.0);

/// A soft part hanging on a joint.
#[derive(Clone, Debug)]
pub(super) struct Soft {
    pub name: String,
    joint: usize,
    /// The joint's bind pose, turned back.
    unbind: DAffine3,
    /// Mesh space, metres.
    centre: DVec3,
    /// Natural frequency, radians a second, and share of critical damping.
    frequency: f64,
    damping: f64,
    /// Metres.
    limit: f64,
}

/// A soft part in motion.
#[derive(Clone, Debug)]
pub(super) struct Spring<'a> {
    soft: &'a Soft,
    /// Of the part against its bone, in mesh axes.
    offset: DVec3,
    velocity: DVec3,
    /// The bone's last two places and its last turn.
    places: [DVec3; 2],
    turn: DQuat,
}

impl Soft {
    /// A softer part swings slower and further.
    pub fn resize(&mut self, size: f64, softness: f64) {
        self.limit *= size * softness;
        self.frequency /= softness.max(1e-3).sqrt();
    }

    fn place(&self, pose: &[DAffine3]) -> (DVec3, DQuat) {
        let palette = pose[self.joint] * self.unbind;
        (palette.transform_point3(self.centre), rotation(&palette))
    }

    /// At rest at time 0.
    pub fn at_rest(&self, performance: &Performance<'_>) -> Spring<'_> {
        let (place, turn) = self.place(&performance.pose(0.0));
        Spring {
            soft: self,
            offset: DVec3::ZERO,
            velocity: DVec3::ZERO,
            places: [place; 2],
            turn,
        }
    }
}

impl Spring<'_> {
    /// Goes `step` seconds on, to a pose. Semi-implicit Euler: stable for steps below 2 over the
    /// frequency, which 1/480 s is.
    pub fn step(&mut self, pose: &[DAffine3], step: f64) {
        let soft = self.soft;
        if soft.limit <= 0.0 {
            return;
        }
        let (place, turn) = soft.place(pose);
        let [before, last] = self.places;
        let acceleration = (place - 2.0 * last + before) / (step * step);
        // What gravity does at rest is in the rest shape already.
        let load = self.turn.inverse() * (GRAVITY - acceleration) - GRAVITY;
        let w = soft.frequency;
        self.velocity +=
            step * (load - w * w * self.offset - 2.0 * soft.damping * w * self.velocity);
        self.offset += step * self.velocity;
        self.places = [last, place];
        self.turn = turn;
    }

    /// Metres in mesh axes, never as long as the limit.
    pub fn amplitude(&self) -> DVec3 {
        let limit = self.soft.limit;
        if limit <= 0.0 {
            return DVec3::ZERO;
        }
        let share = self.offset.length() / limit;
        self.offset / (1.0 + share.powi(4)).powf(0.25)
    }
}

/// The soft parts of a body whose joints are there, with their places.
pub(super) fn of(anatomy: &Anatomy, avatar: &Avatar) -> Vec<(Soft, Region)> {
    let mut out = Vec::new();
    let (front, up, size) = (anatomy.front, anatomy.up, anatomy.scale);
    let mut add = |name: String,
                   joint: usize,
                   centre: DVec3,
                   radius: f64,
                   [hertz, damping, limit]: [f64; 3],
                   on: &[f64]| {
        let region = Region::over(avatar, |vertex, position, normal| {
            normal * (bump(position.distance(centre) / (radius * size)) * on[vertex])
        });
        if !region.is_empty() {
            let soft = Soft {
                name,
                joint,
                unbind: anatomy.bind[joint].inverse(),
                centre,
                frequency: std::f64::consts::TAU * hertz,
                damping,
                limit,
            };
            out.push((soft, region));
        }
    };
    let trunk = anatomy.trunk(avatar);
    let (hips, thorax) = (anatomy.human.hips, anatomy.thorax());
    let length = (anatomy.at(thorax) - anatomy.at(hips)).dot(up);
    let on_trunk = |height: f64, across: DVec3, depth: f64| {
        anatomy.at(hips) + up * (height * length) + size * (across + front * depth)
    };
    let waist = anatomy.human.spine.first().copied().unwrap_or(hips);
    let belly = on_trunk(0.35, DVec3::ZERO, 0.10);
    add(
        "belly".into(),
        waist,
        belly,
        0.21,
        [4.0, 0.18, 0.022],
        &trunk,
    );
    for side in [Side::Left, Side::Right] {
        let outward = anatomy.outward(side);
        let name = |text: &str| format!("{side:?} {text}").to_lowercase();
        let chest = on_trunk(0.92, outward * 0.09, 0.12);
        add(
            name("breast"),
            thorax,
            chest,
            0.12,
            [5.0, 0.2, 0.014],
            &trunk,
        );
        let flank = on_trunk(0.35, outward * 0.14, 0.0);
        add(name("flank"), waist, flank, 0.14, [4.5, 0.2, 0.014], &trunk);
        let joint = |part| anatomy.limb(side, part);
        let below = |top: usize| anatomy.membership(avatar, |at| anatomy.is_below(at, top));
        if let (Some(leg), Some(knee), Some(foot)) = (
            joint(Part::UpperLeg),
            joint(Part::LowerLeg),
            joint(Part::Foot),
        ) {
            let on = anatomy.membership(avatar, |at| {
                !anatomy.is_limb(at) || anatomy.is_below(at, leg)
            });
            let seat = anatomy.at(leg) - front * (0.12 * size);
            add(name("buttock"), hips, seat, 0.17, [4.5, 0.2, 0.020], &on);
            let on_leg = below(leg);
            let thigh = anatomy.at(leg).lerp(anatomy.at(knee), 0.45);
            add(name("thigh"), leg, thigh, 0.22, [6.0, 0.25, 0.014], &on_leg);
            let calf = anatomy.at(knee).lerp(anatomy.at(foot), 0.3) - front * (0.04 * size);
            add(name("calf"), knee, calf, 0.16, [7.5, 0.3, 0.010], &on_leg);
        }
        if let (Some(arm), Some(elbow)) = (joint(Part::UpperArm), joint(Part::LowerArm)) {
            let on_arm = below(arm);
            let middle = anatomy.at(arm).lerp(anatomy.at(elbow), 0.55) - front * (0.02 * size);
            add(
                name("upper arm"),
                arm,
                middle,
                0.13,
                [7.0, 0.3, 0.010],
                &on_arm,
            );
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn soft() -> Soft {
        Soft {
            name: String::new(),
            joint: 0,
            unbind: DAffine3::IDENTITY,
            centre: DVec3::ZERO,
            frequency: 30.0,
            damping: 0.2,
            limit: 0.02,
        }
    }

    fn resting(soft: &Soft) -> Spring<'_> {
        Spring {
            soft,
            offset: DVec3::ZERO,
            velocity: DVec3::ZERO,
            places: [DVec3::ZERO; 2],
            turn: DQuat::IDENTITY,
        }
    }

    #[test]
    fn steady_motion_moves_nothing() {
        let soft = soft();
        let mut spring = resting(&soft);
        spring.places = [DVec3::X * -2e-3, DVec3::X * -1e-3];
        for step in 0..500 {
            spring.step(
                &[DAffine3::from_translation(
                    DVec3::X * 1e-3 * f64::from(step),
                )],
                1e-3,
            );
        }
        assert!(spring.amplitude().length() < 1e-9, "{}", spring.amplitude());
    }

    #[test]
    fn steady_acceleration_pulls_the_part_back_by_the_spring_law() {
        let soft = soft();
        let mut spring = resting(&soft);
        let at = |step: i32| 0.5 * 4.0 * (f64::from(step) * 1e-3).powi(2);
        spring.places = [DVec3::X * at(-2), DVec3::X * at(-1)];
        for step in 0..3000 {
            spring.step(&[DAffine3::from_translation(DVec3::X * at(step))], 1e-3);
        }
        // 4 m/s2 over 30^2 is 4.4 mm.
        assert!(
            (spring.offset.x + 4.0 / 900.0).abs() < 1e-6,
            "{}",
            spring.offset.x
        );
    }

    #[test]
    fn a_bone_turned_over_lets_the_part_hang() {
        let soft = soft();
        let mut spring = resting(&soft);
        let over = DAffine3::from_rotation_z(std::f64::consts::PI);
        for _ in 0..3000 {
            spring.step(&[over], 1e-3);
        }
        // Twice the weight, along the mesh's up: 2 x 9.81 / 900 = 21.8 mm before the limit.
        assert!((spring.offset.y - 2.0 * 9.81 / 900.0).abs() < 1e-6);
        assert!(spring.amplitude().y < 0.02);
    }
}
