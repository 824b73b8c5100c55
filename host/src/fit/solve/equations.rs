//! The least-squares equations of one frame: markers and expectations about turns against a pose.
//!
//! A joint's turn is varied by a small rotation vector in its parent's axes; all derivatives are
//! exact.

use glam::{DMat3, DQuat, DVec3};

use super::body::{Body, Marker, Placed, Pose};

/// One measured marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Index in [`Body::markers`].
    pub marker: usize,
    /// Metres.
    pub at: DVec3,
    /// Share of a full measurement, 0 to 1.
    pub weight: f64,
}

/// Residuals well beyond this are taken for faults and lose their weight (Cauchy's loss), metres.
const FAULT: f64 = 0.05;

/// A pull toward known turns, such as those of neighbouring frames.
#[derive(Clone, Debug)]
pub struct Pull {
    /// `[segments]`
    pub turns: Vec<DQuat>,
    /// Standard deviation, radians.
    pub spread: f64,
}

/// Where the unknowns of a pose stand: the root's place first, then turns.
#[derive(Clone, Debug)]
pub struct Layout {
    /// `[segments]`: first column of its turn; `None` where nothing shows it.
    pub columns: Vec<Option<usize>>,
    /// `[segments]`: the segment and all above it.
    pub lines: Vec<Vec<usize>>,
    /// Unknowns.
    pub count: usize,
}

impl Layout {
    pub fn new(body: &Body) -> Self {
        let mut count = 3;
        let columns = body.seen().into_iter().map(|seen| {
            seen.then(|| {
                count += 3;
                count - 3
            })
        });
        let columns = columns.collect();
        let lines = (0..body.segments.len()).map(|at| body.line(at).collect());
        Self {
            columns,
            lines: lines.collect(),
            count,
        }
    }

    /// Derivatives of a marker's place `at`, one column each.
    pub fn columns_of(
        &self,
        body: &Body,
        placed: &Placed,
        marker: &Marker,
        at: DVec3,
        out: &mut Vec<(usize, DVec3)>,
    ) {
        out.clear();
        out.extend([(0, DVec3::X), (1, DVec3::Y), (2, DVec3::Z)]);
        let mut turn = |joint: usize, arm: DVec3| {
            if let Some(column) = self.columns[joint] {
                let axes = parent_axes(body, placed, joint);
                out.extend((0..3).map(|axis| (column + axis, axes.col(axis).cross(arm))));
            }
        };
        let own = marker.segment;
        let mut arm = at - placed.joints[own];
        for of in &marker.shares {
            let carried =
                of.share * (body.carried(marker, of.segment, placed) - placed.joints[own]);
            if body.segments[own].parent == Some(of.segment) {
                // The parent's share does not turn with the segment.
                arm -= carried;
            } else {
                let from_own = of.share * (placed.joints[of.segment] - placed.joints[own]);
                turn(of.segment, carried - from_own);
            }
        }
        turn(own, arm);
        for &joint in self.lines[own].iter().skip(1) {
            turn(joint, at - placed.joints[joint]);
        }
    }

    /// The pose after a step of all unknowns.
    pub fn moved(&self, pose: &Pose, step: &[f64]) -> Pose {
        let mut pose = pose.clone();
        pose.root += DVec3::from_slice(step);
        for (turn, column) in pose.turns.iter_mut().zip(&self.columns) {
            if let Some(column) = *column {
                let by = DVec3::from_slice(&step[column..]);
                *turn = (DQuat::from_scaled_axis(by) * *turn).normalize();
            }
        }
        pose
    }
}

pub fn parent_axes(body: &Body, placed: &Placed, segment: usize) -> DMat3 {
    let parent = body.segments[segment].parent;
    parent.map_or(DMat3::IDENTITY, |parent| placed.rotations[parent])
}

/// Loss and weight of a squared residual, metres, of markers that stray by `noise`.
pub fn loss(length2: f64, weight: f64, noise: f64) -> (f64, f64) {
    let scale = weight / (noise * noise);
    let ratio = length2 / (FAULT * FAULT);
    (
        0.5 * scale * FAULT * FAULT * ratio.ln_1p(),
        scale / (1.0 + ratio),
    )
}

/// Normal equations: `matrix x = -gradient`, lower half, row-major `[n x n]`.
#[derive(Clone, Debug)]
pub struct Normal {
    pub n: usize,
    pub matrix: Vec<f64>,
    pub gradient: Vec<f64>,
}

impl Normal {
    pub fn new(n: usize) -> Self {
        Self {
            n,
            matrix: vec![0.0; n * n],
            gradient: vec![0.0; n],
        }
    }

    /// Adds a vector residual with its columns.
    pub fn add(&mut self, columns: &[(usize, DVec3)], residual: DVec3, weight: f64) {
        for &(row, a) in columns {
            self.gradient[row] += weight * a.dot(residual);
            for &(column, b) in columns {
                if column <= row {
                    self.matrix[row * self.n + column] += weight * a.dot(b);
                }
            }
        }
    }

    /// Adds a scalar residual whose derivatives along three neighbouring columns are `along`.
    fn add_scalar(&mut self, column: usize, along: DVec3, residual: f64, weight: f64) {
        let along = along.to_array();
        for (row, a) in along.iter().enumerate() {
            self.gradient[column + row] += weight * a * residual;
            for (other, b) in along.iter().enumerate().take(row + 1) {
                self.matrix[(column + row) * self.n + column + other] += weight * a * b;
            }
        }
    }
}

/// Twice the vector part of a rotation's quaternion, and its scalar part: a rotation vector's sine.
fn half_sine(turn: DQuat) -> (DVec3, f64) {
    let turn = if turn.w < 0.0 { -turn } else { turn };
    (2.0 * turn.xyz(), turn.w)
}

/// What is expected of turns: adds it to `normal`, if any, and returns its loss.
pub fn expectations(
    body: &Body,
    layout: &Layout,
    pose: &Pose,
    pull: Option<&Pull>,
    mut normal: Option<&mut Normal>,
) -> f64 {
    let mut cost = 0.0;
    for (at, segment) in body.segments.iter().enumerate() {
        let Some(column) = layout.columns[at] else {
            continue;
        };
        let turn = pose.turns[at];
        let mut scalar = |along: DVec3, residual: f64, spread: f64| {
            let weight = 1.0 / (spread * spread);
            cost += 0.5 * weight * residual * residual;
            if let Some(normal) = normal.as_deref_mut() {
                normal.add_scalar(column, along, residual, weight);
            }
        };
        if let Some(hinge) = segment.hinge {
            let third = hinge.axis.cross(hinge.bone);
            for (arm, spread) in [(hinge.bone, hinge.sideways), (third, hinge.twist)] {
                let arm = turn * arm;
                scalar(arm.cross(hinge.axis), hinge.axis.dot(arm), spread);
            }
        }
        let mut toward = |turn: DQuat, spread: DVec3| {
            let (sine, w) = half_sine(turn);
            for axis in 0..3 {
                // Row `axis` of `w I - [sine / 2] x`.
                let unit = DVec3::AXES[axis];
                scalar(
                    w * unit + (0.5 * sine).cross(unit),
                    sine[axis],
                    spread[axis],
                );
            }
        };
        if segment.parent.is_some() {
            toward(turn, segment.turn_spread);
        }
        if let Some(pull) = pull {
            toward(turn * pull.turns[at].inverse(), DVec3::splat(pull.spread));
        }
    }
    cost
}

/// Loss of a pose.
pub fn cost(
    body: &Body,
    layout: &Layout,
    samples: &[Sample],
    pose: &Pose,
    pull: Option<&Pull>,
) -> f64 {
    let placed = body.place(pose);
    let of = |sample: &Sample| {
        let marker = &body.markers[sample.marker];
        let residual = body.marker(marker, &placed) - sample.at;
        loss(residual.length_squared(), sample.weight, body.noise).0
    };
    let markers: f64 = samples.iter().map(of).sum();
    markers + expectations(body, layout, pose, pull, None)
}

/// Normal equations of a pose.
pub fn normal(
    body: &Body,
    layout: &Layout,
    samples: &[Sample],
    pose: &Pose,
    pull: Option<&Pull>,
) -> Normal {
    let placed = body.place(pose);
    let mut normal = Normal::new(layout.count);
    let mut columns = Vec::new();
    for sample in samples {
        let marker = &body.markers[sample.marker];
        let at = body.marker(marker, &placed);
        layout.columns_of(body, &placed, marker, at, &mut columns);
        let residual = at - sample.at;
        let (_, weight) = loss(residual.length_squared(), sample.weight, body.noise);
        normal.add(&columns, residual, weight);
    }
    expectations(body, layout, pose, pull, Some(&mut normal));
    normal
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Side;
    use crate::fit::solve::labels::landmark;
    use crate::fit::solve::template::{self, Bone};

    #[test]
    fn derivatives_are_those_of_the_loss() {
        let labels = ["LFWT", "RFWT", "LBWT", "C7", "LELB", "LWRA", "RKNE", "RANK"];
        let known = labels.iter().enumerate();
        let known: Vec<_> = known
            .map(|(at, label)| (at, landmark(label).unwrap()))
            .collect();
        let mut body = template::body(&known, 0.0);
        let shares = body
            .markers
            .iter_mut()
            .flat_map(|marker| &mut marker.shares);
        shares.for_each(|of| of.share = 0.2);
        let layout = Layout::new(&body);
        assert_eq!(
            layout.columns[template::index(Bone::Toes, Some(Side::Left))],
            None
        );
        let mut pose = Pose::rest(body.segments.len());
        pose.root = DVec3::new(0.1, 1.0, -0.2);
        for (at, turn) in pose.turns.iter_mut().enumerate() {
            let at = at as f64;
            *turn = DQuat::from_scaled_axis(DVec3::new(at.sin(), (2.0 * at).cos(), 0.3) * 0.7);
        }
        let placed = body.place(&pose);
        let samples: Vec<Sample> = (0..labels.len())
            .map(|marker| Sample {
                marker,
                at: body.marker(&body.markers[marker], &placed) + DVec3::new(0.01, -0.02, 0.015),
                weight: 0.7,
            })
            .collect();
        let pull = Pull {
            turns: vec![DQuat::from_rotation_y(0.4); body.segments.len()],
            spread: 0.5,
        };
        let normal = normal(&body, &layout, &samples, &pose, Some(&pull));
        let h = 1e-6;
        for column in 0..layout.count {
            let mut step = vec![0.0; layout.count];
            step[column] = h;
            let up = cost(
                &body,
                &layout,
                &samples,
                &layout.moved(&pose, &step),
                Some(&pull),
            );
            step[column] = -h;
            let down = cost(
                &body,
                &layout,
                &samples,
                &layout.moved(&pose, &step),
                Some(&pull),
            );
            let slope = (up - down) / (2.0 * h);
            let found = normal.gradient[column];
            assert!(
                (slope - found).abs() < 1e-4 * (1.0 + slope.abs()),
                "{column}: {slope} {found}"
            );
        }
    }
}
