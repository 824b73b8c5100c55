//! The pose of one frame: a start in closed form, then damped Gauss-Newton over all joints.

use glam::{DQuat, DVec3};

use super::body::{Body, Pose};
use super::equations::{Layout, Pull, Sample, cost, normal};
use crate::clean::linear::Cholesky;
use crate::clean::rigid::Rigid;

/// Markers of a child segment this near its joint also show where the bone above it points, metres.
const NEAR_JOINT: f64 = 0.12;
/// Length at which the rest pose weighs in where markers leave a turn open, metres.
const REST_ARM: f64 = 0.03;
/// Segments this far below the root help to place it, with little weight.
const TRUNK_DEPTH: usize = 3;
const TRUNK_WEIGHT: f64 = 0.03;

/// A pose straight from the markers: the root by absolute orientation, then each joint's turn by
/// the markers beyond it (Horn 1987). `None` where too few markers show the root. O(samples x depth)
pub fn start(body: &Body, samples: &[Sample]) -> Option<Pose> {
    let rest = body.place(&Pose::rest(body.segments.len()));
    let trunk = |sample: &&Sample| {
        let segment = body.markers[sample.marker].segment;
        segment == 0
            || body.segments[segment].mirror.is_none() && body.line(segment).count() <= TRUNK_DEPTH
    };
    let pairs = samples.iter().filter(trunk).map(|sample| {
        let marker = &body.markers[sample.marker];
        let weight = if marker.segment == 0 {
            1.0
        } else {
            TRUNK_WEIGHT
        };
        (
            body.marker(marker, &rest),
            sample.at,
            weight * sample.weight,
        )
    });
    if pairs.clone().count() < 3 {
        return None;
    }
    let root = Rigid::fit(pairs)?;
    let mut pose = Pose::rest(body.segments.len());
    pose.root = root.translation;
    pose.turns[0] = DQuat::from_mat3(&root.rotation).normalize();
    let mut placed = body.place(&pose);
    for at in 1..body.segments.len() {
        let Some(parent) = body.segments[at].parent else {
            continue;
        };
        let above = placed.rotations[parent];
        let joint = placed.joints[parent] + above * body.segments[at].offset;
        let reach = |sample: &Sample| {
            let marker = &body.markers[sample.marker];
            let arm = if marker.segment == at {
                marker.offset
            } else if body.segments[marker.segment].parent == Some(at)
                && marker.offset.length() < NEAR_JOINT
            {
                body.segments[marker.segment].offset + marker.offset
            } else {
                return None;
            };
            Some((
                arm,
                above.transpose() * (sample.at - joint),
                sample.weight + 1e-3,
            ))
        };
        let rest = DVec3::AXES.map(|axis| (REST_ARM * axis, REST_ARM * axis, 1.0));
        let arms: Vec<(DVec3, DVec3, f64)> = samples.iter().filter_map(reach).chain(rest).collect();
        // Each arm and its opposite: their middle is the joint, which stays where it is.
        let both = arms.iter().flat_map(|&(a, b, w)| [(a, b, w), (-a, -b, w)]);
        let turn = Rigid::fit(both)?.rotation;
        pose.turns[at] = DQuat::from_mat3(&turn).normalize();
        placed.joints[at] = joint;
        placed.rotations[at] = above * turn;
    }
    Some(pose)
}

/// How often a pose is bettered at most.
#[derive(Clone, Copy, Debug)]
pub struct Effort {
    /// Steps.
    pub steps: usize,
    /// Stop when a step lowers the loss by less than this share.
    pub enough: f64,
}

/// Betters a pose by Levenberg and Marquardt's method; returns it with its loss.
/// O(steps x unknowns^3)
pub fn fit(
    body: &Body,
    layout: &Layout,
    samples: &[Sample],
    from: Pose,
    pull: Option<&Pull>,
    effort: Effort,
) -> (Pose, f64) {
    let mut pose = from;
    let mut now = cost(body, layout, samples, &pose, pull);
    let mut damping = 1e-4;
    for _ in 0..effort.steps {
        let equations = normal(body, layout, samples, &pose, pull);
        let before = now;
        let mut accepted = false;
        for _ in 0..6 {
            let mut matrix = equations.matrix.clone();
            for at in 0..equations.n {
                let diagonal = &mut matrix[at * equations.n + at];
                *diagonal += damping * *diagonal + 1e-9;
            }
            let mut step: Vec<f64> = equations.gradient.iter().map(|slope| -slope).collect();
            if let Some(factor) = Cholesky::new(equations.n, matrix) {
                factor.solve(&mut step, 1);
                let tried = layout.moved(&pose, &step);
                let then = cost(body, layout, samples, &tried, pull);
                if then <= now {
                    (pose, now, accepted) = (tried, then, true);
                    damping = (damping * 0.1).max(1e-9);
                    break;
                }
            }
            damping = (damping * 10.0).max(1e-6);
        }
        if !accepted || before - now <= effort.enough * before {
            break;
        }
    }
    (pose, now)
}
