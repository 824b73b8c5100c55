//! The skeleton of a body under markers that are glued to its skin.
//!
//! Gauss-Newton steps on the distance between markers and the skin that the skeleton moves: every
//! joint that moves a marker turns, the root is moved too, lengths stay. Markers on flesh, which stray
//! from the skin of the skeleton, count less than those over bone: by how far they do in some frames
//! spread over the take.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::blended;
use crate::clean::linear::Cholesky;
use crate::clean::rigid::Rigid;
use crate::fit::parts::Glued;
use crate::model::{Avatar, Transform};

/// Steps of the first frame, and of one that follows.
const STEPS: [usize; 2] = [40, 6];
/// A joint turns if it moves markers of this weight together.
const LEAST_WEIGHT: f64 = 1.5;
/// Distances beyond this count less (Cauchy's weights), metres.
const WIDTH: f64 = 0.03;
/// Frames from which markers are weighed, and how often.
const SAMPLES: usize = 100;
const WEIGHINGS: usize = 3;
/// A marker over bone strays this far, metres.
const STILL: f64 = 1e-3;
/// Turns are held by this, against one marker at a metre.
const HOLD: f64 = 1e-5;
/// No joint turns further in a step, radians.
const LARGEST_TURN: f64 = 0.5;
/// It is done when no joint turns further.
const DONE: f64 = 1e-5;

/// Poses of a skeleton under frames of markers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Posed {
    /// `[frames][joints]`: model space.
    pub poses: Vec<Vec<DAffine3>>,
    /// Root mean square distance of the markers from the skeleton's skin, metres.
    pub distance: f64,
}

/// Poses the skeleton under each frame. `markers`: where each is glued, and where it is at rest;
/// `frames`: `[frames][markers]`, metres; those that are not finite are left out.
/// O(frames (markers joints^2 + joints^3))
#[must_use]
pub fn pose(body: &Avatar, (markers, rest): (&[Glued], &[DVec3]), frames: &[Vec<DVec3>]) -> Posed {
    let mut figure = Figure::new(body, markers, rest);
    let step = frames.len().div_ceil(SAMPLES).max(1);
    let some: Vec<Vec<DVec3>> = frames.iter().step_by(step).cloned().collect();
    for _ in 0..WEIGHINGS {
        let (_, strays) = figure.follow(&some);
        let weights = strays.iter().map(|stray| {
            let (still, stray) = (STILL * STILL, stray / some.len().max(1) as f64);
            still / (still + stray)
        });
        figure.weights = weights.collect();
    }
    let (poses, strays) = figure.follow(frames);
    let samples = frames.len() * markers.len();
    Posed {
        poses,
        distance: f64::sqrt(strays.iter().sum::<f64>() / samples.max(1) as f64),
    }
}

/// Binds and weights.
type Carriers = Vec<(u32, f64)>;

struct Figure<'a> {
    body: &'a Avatar,
    rest: &'a [DVec3],
    /// `[markers]`: binds and weights.
    carried: Vec<Carriers>,
    /// Joints that turn, parents first; the root is the first.
    turning: Vec<usize>,
    /// `[markers]`: how much each counts.
    weights: Vec<f64>,
    /// `[markers]`: (place in `turning`, binds below that joint that carry the marker).
    above: Vec<Vec<(usize, Carriers)>>,
}

impl<'a> Figure<'a> {
    fn new(body: &'a Avatar, markers: &[Glued], rest: &'a [DVec3]) -> Self {
        let joints = &body.skeleton.joints;
        let carried: Vec<Carriers> = markers
            .iter()
            .map(|marker| marker.weights_of(&body.skin.influences))
            .collect();
        let is_below = |mut joint: usize, top: usize| loop {
            if joint == top {
                return true;
            }
            match joints[joint].parent {
                Some(parent) => joint = parent,
                None => return false,
            }
        };
        let below = |row: &Carriers, top: usize| -> Carriers {
            let own = row.iter();
            own.filter(|&&(bind, _)| is_below(body.skin.binds[bind as usize].joint, top))
                .copied()
                .collect()
        };
        let own = |joint: usize| -> f64 {
            let all = carried.iter().flatten();
            all.filter(|&&(bind, _)| body.skin.binds[bind as usize].joint == joint)
                .map(|&(_, weight)| weight)
                .sum()
        };
        let turning: Vec<usize> = (0..joints.len())
            .filter(|&joint| joints[joint].parent.is_none() || own(joint) >= LEAST_WEIGHT)
            .collect();
        let above = carried.iter().map(|row| {
            let of = turning.iter().enumerate();
            of.map(|(at, &joint)| (at, below(row, joint)))
                .filter(|(_, binds)| !binds.is_empty())
                .collect()
        });
        Self {
            body,
            rest,
            above: above.collect(),
            weights: vec![1.0; markers.len()],
            turning,
            carried,
        }
    }

    /// The pose of every frame, and the sum of each marker's squared distances.
    fn follow(&self, frames: &[Vec<DVec3>]) -> (Vec<Vec<DAffine3>>, Vec<f64>) {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let chunk = frames.len().div_ceil(threads).max(1);
        let mut poses = vec![Vec::new(); frames.len()];
        let mut strays = vec![vec![0.0; self.rest.len()]; threads];
        std::thread::scope(|scope| {
            let chunks = frames.chunks(chunk).zip(poses.chunks_mut(chunk));
            for ((frames, poses), strays) in chunks.zip(&mut strays) {
                scope.spawn(move || {
                    let mut local: Option<Vec<Transform>> = None;
                    for (frame, pose) in frames.iter().zip(poses) {
                        let [first, next] = STEPS;
                        let steps = if local.is_some() { next } else { first };
                        let start = local.take().unwrap_or_else(|| self.standing(frame));
                        let fitted = self.fit(start, frame, steps);
                        *pose = self.body.skeleton.model(&fitted);
                        self.stray(pose, frame, strays);
                        local = Some(fitted);
                    }
                });
            }
        });
        let sum = |marker: usize| strays.iter().map(|of| of[marker]).sum();
        (poses, (0..self.rest.len()).map(sum).collect())
    }

    /// Adds squared distances between markers and the skin of a pose.
    fn stray(&self, pose: &[DAffine3], frame: &[DVec3], strays: &mut [f64]) {
        let palette = super::palette(self.body, pose);
        let all = self.carried.iter().zip(self.rest).zip(frame).zip(strays);
        for (((row, &rest), &seen), stray) in all.filter(|marker| marker.0.1.is_finite()) {
            let there = blended(&palette, row).transform_point3(rest);
            *stray += there.distance_squared(seen);
        }
    }

    /// The rest pose, moved as a whole to where the markers are.
    fn standing(&self, frame: &[DVec3]) -> Vec<Transform> {
        let mut local = self.body.skeleton.rest();
        let seen = self
            .rest
            .iter()
            .zip(frame)
            .filter(|pair| pair.1.is_finite());
        let Some(motion) = Rigid::fit(seen.map(|(&a, &b)| (a, b, 1.0))) else {
            return local;
        };
        let turn = DQuat::from_mat3(&motion.rotation);
        for (local, joint) in local.iter_mut().zip(&self.body.skeleton.joints) {
            if joint.parent.is_none() {
                local.translation = motion.apply(local.translation);
                local.rotation = (turn * local.rotation).normalize();
            }
        }
        local
    }

    /// The local pose after so many steps from a start.
    fn fit(&self, mut local: Vec<Transform>, frame: &[DVec3], steps: usize) -> Vec<Transform> {
        for _ in 0..steps {
            let Some(change) = self.step(&local, frame) else {
                break;
            };
            if self.advance(&mut local, &change) < DONE {
                break;
            }
        }
        local
    }

    /// A move of the root, then a turn of each joint, in model space.
    fn step(&self, local: &[Transform], frame: &[DVec3]) -> Option<Vec<f64>> {
        let pose = self.body.skeleton.model(local);
        let palette = super::palette(self.body, &pose);
        let n = 3 + 3 * self.turning.len();
        let (mut matrix, mut right) = (vec![0.0; n * n], vec![0.0; n]);
        for (marker, (&rest, &seen)) in self.rest.iter().zip(frame).enumerate() {
            if !seen.is_finite() {
                continue;
            }
            let at = |row: &[(u32, f64)]| {
                let mut sum = (DVec3::ZERO, 0.0);
                for &(bind, weight) in row {
                    sum.0 += weight * palette[bind as usize].transform_point3(rest);
                    sum.1 += weight;
                }
                sum
            };
            let off = seen - at(&self.carried[marker]).0;
            let robust = self.weights[marker] / (1.0 + (off.length() / WIDTH).powi(2));
            // Columns: the move, then `turn x arm` of each joint above.
            let mut columns: Vec<(usize, DMat3)> = vec![(0, DMat3::IDENTITY)];
            columns.extend(self.above[marker].iter().map(|(place, binds)| {
                let (sum, weight) = at(binds);
                let arm = sum - weight * pose[self.turning[*place]].translation;
                (3 + 3 * place, against(arm))
            }));
            for (i, a) in &columns {
                let scaled = robust * a.transpose();
                let pull = scaled * off;
                for (axis, value) in pull.to_array().into_iter().enumerate() {
                    right[i + axis] += value;
                }
                for (j, b) in columns.iter().filter(|(j, _)| j <= i) {
                    let block = scaled * *b;
                    for row in 0..3 {
                        for column in 0..3 {
                            matrix[(i + row) * n + j + column] += block.col(column)[row];
                        }
                    }
                }
            }
        }
        for at in 0..n {
            matrix[at * n + at] += HOLD;
        }
        Cholesky::new(n, matrix)?.solve(&mut right, 1);
        Some(right)
    }

    /// Applies a step; the largest turn.
    fn advance(&self, local: &mut [Transform], change: &[f64]) -> f64 {
        let pose = self.body.skeleton.model(local);
        let joints = &self.body.skeleton.joints;
        let turn = |at: usize| DVec3::from_slice(&change[3 + 3 * at..]);
        let largest = (0..self.turning.len()).map(|at| turn(at).length());
        let largest = largest.fold(0.0, f64::max);
        let shorter = (LARGEST_TURN / largest.max(1e-12)).min(1.0);
        for (at, &joint) in self.turning.iter().enumerate() {
            let turn = DQuat::from_scaled_axis(shorter * turn(at));
            let above = joints[joint]
                .parent
                .map_or(DMat3::IDENTITY, |p| pose[p].matrix3);
            let above = crate::model::nearest_rotation(&above);
            let own = &mut local[joint];
            own.rotation = (above.inverse() * turn * above * own.rotation).normalize();
            if joints[joint].parent.is_none() {
                own.translation += shorter * DVec3::from_slice(change);
            }
        }
        largest
    }
}

/// The matrix that takes a small turn to how it moves the end of an arm.
fn against(arm: DVec3) -> DMat3 {
    DMat3::from_cols(
        DVec3::new(0.0, -arm.z, arm.y),
        DVec3::new(arm.z, 0.0, -arm.x),
        DVec3::new(-arm.y, arm.x, 0.0),
    )
}
