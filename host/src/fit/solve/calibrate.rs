//! Bone lengths, joint centres and marker places of the subject, from chosen frames together with
//! their poses.
//!
//! One least-squares problem over everything (bundle adjustment): a joint centre is where the
//! markers on both of its sides turn about a common point, so joints that move are found from
//! their motion alone; expectations of the template, scaled by one common factor, decide what the
//! motion leaves open. Poses are eliminated frame by frame (Schur complement; Triggs et al.,
//! *Bundle Adjustment, a Modern Synthesis*, 2000).

use std::ops::Range;

use glam::DVec3;

use super::body::{Body, Pose};
use super::equations::{Layout, Normal, Sample, cost, expectations, loss, parent_axes};
use crate::clean::linear::Cholesky;

/// Share of a neighbouring segment in a marker near its joint: usual, spread, most of all together.
pub const SHARE: f64 = 0.15;
const SHARE_SPREAD: f64 = 0.25;
const MOST_SHARED: f64 = 0.8;

/// A frame with its markers and its pose so far.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Seen markers.
    pub samples: Vec<Sample>,
    /// Pose.
    pub pose: Pose,
}

/// How expectations weigh.
#[derive(Clone, Copy, Debug)]
pub struct Weighing {
    /// Standard deviation of the subject's size from the first guess, as a factor.
    pub scale_spread: f64,
    /// Standard deviation of left from right bones, metres.
    pub mirror_spread: f64,
    /// As many frames as count as independent: skin slides alike in like poses.
    pub independent_frames: f64,
}

impl Default for Weighing {
    fn default() -> Self {
        Self {
            scale_spread: 0.15,
            mirror_spread: 0.003,
            independent_frames: 30.0,
        }
    }
}

/// Where the unknowns of the body stand.
struct Unknowns {
    segments: usize,
    /// `[markers + 1]`: first column of a marker's shares, and the end.
    shares: Vec<usize>,
    count: usize,
}

impl Unknowns {
    fn new(body: &Body) -> Self {
        let segments = body.segments.len();
        let mut end = 3 * (segments - 1) + 3 * body.markers.len();
        let mut shares = vec![end];
        for marker in &body.markers {
            end += marker.shares.len();
            shares.push(end);
        }
        Self {
            segments,
            shares,
            count: end + 1,
        }
    }

    /// First column of a joint's offset; the root has none.
    fn segment(&self, at: usize) -> Option<usize> {
        at.checked_sub(1).map(|at| 3 * at)
    }

    fn marker(&self, at: usize) -> usize {
        3 * (self.segments - 1) + 3 * at
    }

    /// Columns of a marker's shares.
    fn shares(&self, at: usize) -> Range<usize> {
        self.shares[at]..self.shares[at + 1]
    }

    fn scale(&self) -> usize {
        self.count - 1
    }
}

/// Betters body and poses together; returns the root mean square of marker residuals, metres.
/// O(steps x frames x unknowns of the body^2 x unknowns of a pose)
pub fn calibrate(body: &mut Body, frames: &mut [Frame], weighing: Weighing, steps: usize) -> f64 {
    let layout = Layout::new(body);
    let first_scale = body.scale;
    let total = |body: &Body, frames: &[Frame]| -> f64 {
        let poses = frames
            .iter()
            .map(|frame| cost(body, &layout, &frame.samples, &frame.pose, None));
        poses.sum::<f64>() + shape(body, first_scale, frames.len(), weighing, None)
    };
    let mut now = total(body, frames);
    let mut damping = 1e-3;
    for _ in 0..steps {
        let Some(system) = System::new(body, &layout, frames, first_scale, weighing) else {
            break;
        };
        let before = now;
        let mut accepted = false;
        for _ in 0..6 {
            if let Some((tried, moved)) = system.step(body, &layout, frames, damping) {
                let then = total(&tried, &moved);
                if then <= now {
                    *body = tried;
                    frames.clone_from_slice(&moved);
                    (now, accepted) = (then, true);
                    damping = (damping * 0.2_f64).max(1e-8);
                    break;
                }
            }
            damping *= 8.0;
        }
        if !accepted || before - now <= 1e-5 * before {
            break;
        }
    }
    residual(body, frames)
}

/// Root mean square of marker residuals over frames, metres.
pub fn residual(body: &Body, frames: &[Frame]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for frame in frames {
        let placed = body.place(&frame.pose);
        for sample in &frame.samples {
            let at = body.marker(&body.markers[sample.marker], &placed);
            sum += sample.weight * at.distance_squared(sample.at);
            count += sample.weight;
        }
    }
    (sum / f64::max(count, 1.0)).sqrt()
}

/// The equations with the poses' blocks apart.
struct System {
    unknowns: Unknowns,
    /// Of the body's unknowns.
    body: Normal,
    /// Of each frame's pose, with `[pose unknowns x body unknowns]` between the two.
    frames: Vec<(Normal, Vec<f64>)>,
}

impl System {
    fn new(
        body: &Body,
        layout: &Layout,
        frames: &[Frame],
        first_scale: f64,
        weighing: Weighing,
    ) -> Option<Self> {
        let unknowns = Unknowns::new(body);
        let mut own = Normal::new(unknowns.count);
        shape(body, first_scale, frames.len(), weighing, Some(&mut own));
        let mut blocks = Vec::with_capacity(frames.len());
        let (mut columns, mut others) = (Vec::new(), Vec::new());
        for frame in frames {
            let placed = body.place(&frame.pose);
            let mut pose = Normal::new(layout.count);
            let mut between = vec![0.0; layout.count * unknowns.count];
            for sample in &frame.samples {
                let marker = &body.markers[sample.marker];
                let at = body.marker(marker, &placed);
                layout.columns_of(body, &placed, marker, at, &mut columns);
                others.clear();
                for &joint in &layout.lines[marker.segment] {
                    if let Some(column) = unknowns.segment(joint) {
                        let axes = parent_axes(body, &placed, joint);
                        others.extend((0..3).map(|axis| (column + axis, axes.col(axis))));
                    }
                }
                let turn = placed.rotations[marker.segment];
                let here = body.carried(marker, marker.segment, &placed);
                let mut axes = turn;
                for (column, of) in unknowns.shares(sample.marker).zip(&marker.shares) {
                    others.push((column, body.carried(marker, of.segment, &placed) - here));
                    let apart = (placed.rotations[of.segment] - turn) * of.share;
                    axes += apart;
                    // A child's joint moves against the point that it carries; with a parent's
                    // share both move alike.
                    let child = body.segments[of.segment].parent == Some(marker.segment);
                    if let Some(column) = unknowns.segment(of.segment).filter(|_| child) {
                        others.extend((0..3).map(|axis| (column + axis, -apart.col(axis))));
                    }
                }
                let column = unknowns.marker(sample.marker);
                others.extend((0..3).map(|axis| (column + axis, axes.col(axis))));
                let residual = at - sample.at;
                let (_, weight) = loss(residual.length_squared(), sample.weight, body.noise);
                pose.add(&columns, residual, weight);
                own.add(&others, residual, weight);
                for &(row, a) in &columns {
                    let line = &mut between[row * unknowns.count..][..unknowns.count];
                    for &(column, b) in &others {
                        line[column] += weight * a.dot(b);
                    }
                }
            }
            expectations(body, layout, &frame.pose, None, Some(&mut pose));
            blocks.push((pose, between));
        }
        own.gradient
            .iter()
            .all(|slope| slope.is_finite())
            .then_some(Self {
                unknowns,
                body: own,
                frames: blocks,
            })
    }

    /// Body and frames after one damped step.
    fn step(
        &self,
        body: &Body,
        layout: &Layout,
        frames: &[Frame],
        damping: f64,
    ) -> Option<(Body, Vec<Frame>)> {
        let n = self.unknowns.count;
        let mut matrix = self.body.matrix.clone();
        for at in 0..n {
            let diagonal = &mut matrix[at * n + at];
            *diagonal += damping * *diagonal + 1e-9;
        }
        let mut right: Vec<f64> = self.body.gradient.iter().map(|slope| -slope).collect();
        // Of each frame: the pose block's inverse times [between | gradient].
        let width = n + 1;
        let mut solved = Vec::with_capacity(self.frames.len());
        for (pose, between) in &self.frames {
            let mut block = pose.matrix.clone();
            for at in 0..pose.n {
                let diagonal = &mut block[at * pose.n + at];
                *diagonal += damping * *diagonal + 1e-9;
            }
            let factor = Cholesky::new(pose.n, block)?;
            let mut wide = vec![0.0; pose.n * width];
            for (row, line) in wide.chunks_exact_mut(width).enumerate() {
                line[..n].copy_from_slice(&between[row * n..][..n]);
                line[n] = pose.gradient[row];
            }
            factor.solve(&mut wide, width);
            for (row, line) in wide.chunks_exact(width).enumerate() {
                for (at, &a) in between[row * n..][..n].iter().enumerate() {
                    if a == 0.0 {
                        continue;
                    }
                    right[at] += a * line[n];
                    let target = &mut matrix[at * n..=at * n + at];
                    for (to, b) in target.iter_mut().zip(line) {
                        *to -= a * b;
                    }
                }
            }
            solved.push(wide);
        }
        Cholesky::new(n, matrix)?.solve(&mut right, 1);
        let mut tried = body.clone();
        for (at, segment) in tried.segments.iter_mut().enumerate() {
            if let Some(column) = self.unknowns.segment(at) {
                segment.offset += DVec3::from_slice(&right[column..]);
            }
        }
        for (at, marker) in tried.markers.iter_mut().enumerate() {
            marker.offset += DVec3::from_slice(&right[self.unknowns.marker(at)..]);
            let columns = self.unknowns.shares(at);
            for (of, step) in marker.shares.iter_mut().zip(&right[columns]) {
                of.share = (of.share + step).max(0.0);
            }
            let all: f64 = marker.shares.iter().map(|of| of.share).sum();
            let fewer = MOST_SHARED / all.max(MOST_SHARED);
            marker.shares.iter_mut().for_each(|of| of.share *= fewer);
        }
        tried.scale += right[self.unknowns.scale()];
        let moved = frames.iter().zip(&solved).map(|(frame, wide)| {
            let of = |line: &[f64]| {
                let coupled: f64 = line.iter().zip(&right).map(|(a, b)| a * b).sum();
                -line[n] - coupled
            };
            let step: Vec<f64> = wide.chunks_exact(width).map(of).collect();
            Frame {
                samples: frame.samples.clone(),
                pose: layout.moved(&frame.pose, &step),
            }
        });
        Some((tried, moved.collect()))
    }
}

/// What is expected of the body's shape: adds it to `normal`, if any, and returns its loss.
fn shape(
    body: &Body,
    first_scale: f64,
    frame_count: usize,
    weighing: Weighing,
    mut normal: Option<&mut Normal>,
) -> f64 {
    let unknowns = Unknowns::new(body);
    let repeated = (frame_count as f64 / weighing.independent_frames).max(1.0);
    let mut cost = 0.0;
    // A scalar residual with at most three derivatives.
    let mut add = |columns: &[(usize, f64)], residual: f64, spread: f64| {
        let weight = repeated / (spread * spread);
        cost += 0.5 * weight * residual * residual;
        if let Some(normal) = normal.as_deref_mut() {
            for &(row, a) in columns {
                normal.gradient[row] += weight * a * residual;
                for &(column, b) in columns {
                    if column <= row {
                        normal.matrix[row * normal.n + column] += weight * a * b;
                    }
                }
            }
        }
    };
    let scale = unknowns.scale();
    for (at, segment) in body.segments.iter().enumerate() {
        let Some(column) = unknowns.segment(at) else {
            continue;
        };
        for axis in 0..3 {
            let expected = segment.expected[axis];
            add(
                &[(column + axis, 1.0), (scale, -expected)],
                segment.offset[axis] - body.scale * expected,
                segment.spread[axis],
            );
        }
        let Some(mirror) = segment.mirror.filter(|mirror| *mirror < at) else {
            continue;
        };
        let Some(other) = unknowns.segment(mirror) else {
            continue;
        };
        for axis in 0..3 {
            let sign = if axis == 0 { -1.0 } else { 1.0 };
            add(
                &[(column + axis, 1.0), (other + axis, -sign)],
                segment.offset[axis] - sign * body.segments[mirror].offset[axis],
                weighing.mirror_spread,
            );
        }
    }
    for (at, marker) in body.markers.iter().enumerate() {
        let column = unknowns.marker(at);
        for axis in 0..3 {
            let expected = marker.expected[axis];
            let anchor = marker.anchor.and_then(|at| {
                Some((unknowns.segment(at)? + axis, body.segments[at].offset[axis]))
            });
            // Without an anchor the column of the scale stands twice, once with nothing.
            let (beside, from) =
                anchor.map_or(((scale, 0.0), 0.0), |(at, from)| ((at, -1.0), from));
            add(
                &[(column + axis, 1.0), (scale, -expected), beside],
                marker.offset[axis] - from - body.scale * expected,
                marker.spread,
            );
        }
    }
    for (at, marker) in body.markers.iter().enumerate() {
        for (column, of) in unknowns.shares(at).zip(&marker.shares) {
            let usual = if marker.anchor == Some(of.segment) {
                SHARE
            } else {
                0.0
            };
            add(&[(column, 1.0)], of.share - usual, SHARE_SPREAD);
        }
    }
    add(
        &[(scale, 1.0)],
        body.scale - first_scale,
        weighing.scale_spread * first_scale,
    );
    cost
}
