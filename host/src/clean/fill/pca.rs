//! Filling by principal components of each neighbourhood, as published (Park & Hodgins 2006, 4.3).

use glam::DVec3;

use super::super::linear::{Cholesky, symmetric_eigen};
use super::super::neighbours::rank;
use super::super::rigid::Rigid;
use super::view::View;

/// Markers in a ring.
const RING: usize = 6;
/// Share of the variance that the components keep.
const KEPT: f64 = 0.99;
/// Frames to learn from, at most.
const FRAMES: usize = 1500;

/// The neighbourhood of one marker in its own frame.
struct Ring {
    centre: usize,
    members: Vec<usize>,
    /// `[members]`: reference positions about the centre.
    reference: Vec<DVec3>,
    /// `[members]`: means.
    mean: Vec<DVec3>,
    /// `[components x 3 members]`.
    components: Vec<Vec<f64>>,
}

/// The marker in each of `frames` as the rings of its neighbours reconstruct it, `None` where no
/// ring can: a ring needs its centre, three members in the frame, and frames in which it is
/// complete.
pub(super) fn estimate(view: &View<'_>, marker: usize, frames: &[usize]) -> Vec<Option<DVec3>> {
    let rings: Vec<Ring> = rank(view, marker)
        .iter()
        .take(RING)
        .filter_map(|neighbour| Ring::learn(view, neighbour.marker, marker))
        .collect();
    let one = |&frame: &usize| {
        let found = rings
            .iter()
            .filter_map(|ring| ring.reconstruct(view, marker, frame));
        let (sum, count) = found.fold((DVec3::ZERO, 0.0), |(sum, count), position| {
            (sum + position, count + 1.0)
        });
        (count > 0.0).then(|| sum / count)
    };
    frames.iter().map(one).collect()
}

impl Ring {
    /// The ring about `centre`, which holds `wanted`.
    fn learn(view: &View<'_>, centre: usize, wanted: usize) -> Option<Self> {
        let mut members: Vec<usize> = rank(view, centre)
            .iter()
            .map(|neighbour| neighbour.marker)
            .take(RING)
            .collect();
        if !members.contains(&wanted) {
            members.pop();
            members.push(wanted);
        }
        let complete = |&frame: &usize| {
            view.is_measured(centre, frame)
                && members
                    .iter()
                    .all(|&member| view.is_measured(member, frame))
        };
        let all: Vec<usize> = (0..view.take.frame_count()).filter(complete).collect();
        let stride = all.len().div_ceil(FRAMES).max(1);
        let frames: Vec<usize> = all.into_iter().step_by(stride).collect();
        let about = |frame: usize| {
            let origin = view.trajectory(centre)[frame];
            members
                .iter()
                .map(|&member| view.trajectory(member)[frame] - origin)
                .collect::<Vec<_>>()
        };
        let reference = about(*frames.get(frames.len() / 2)?);
        let mut ring = Self {
            centre,
            mean: Vec::new(),
            components: Vec::new(),
            members: members.clone(),
            reference,
        };
        let locals: Vec<Vec<DVec3>> = frames
            .iter()
            .map(|&frame| {
                let current = about(frame);
                let turn = ring.turn(current.iter().enumerate().map(|(at, p)| (at, *p)));
                current
                    .iter()
                    .map(|position| turn.rotation * *position)
                    .collect()
            })
            .collect();
        let count = locals.len() as f64;
        ring.mean = (0..members.len())
            .map(|at| locals.iter().map(|local| local[at]).sum::<DVec3>() / count)
            .collect();
        let width = 3 * members.len();
        let mut covariance = vec![0.0; width * width];
        for local in &locals {
            let row = local.iter().zip(&ring.mean);
            let row: Vec<f64> = row.flat_map(|(a, b)| (*a - *b).to_array()).collect();
            for i in 0..width {
                for j in 0..width {
                    covariance[i * width + j] += row[i] * row[j] / count;
                }
            }
        }
        let (values, vectors) = symmetric_eigen(width, covariance);
        let total: f64 = values.iter().sum();
        let mut sum = 0.0;
        for (value, vector) in values.iter().zip(vectors.chunks_exact(width)) {
            if sum >= KEPT * total {
                break;
            }
            sum += value;
            ring.components.push(vector.to_vec());
        }
        Some(ring)
    }

    /// The turn about the centre that brings visible members to their reference (equation 5).
    fn turn(&self, current: impl Iterator<Item = (usize, DVec3)> + Clone) -> Rigid {
        // The origin weighs so much that only a rotation about it is left.
        let members = current.map(|(at, position)| (position, self.reference[at], 1.0));
        let origin = std::iter::once((DVec3::ZERO, DVec3::ZERO, 1e6));
        Rigid::fit(members.chain(origin)).unwrap_or(Rigid::IDENTITY)
    }

    fn reconstruct(&self, view: &View<'_>, marker: usize, frame: usize) -> Option<DVec3> {
        if !view.is_measured(self.centre, frame) {
            return None;
        }
        let origin = view.trajectory(self.centre)[frame];
        let seen: Vec<(usize, DVec3)> = self
            .members
            .iter()
            .enumerate()
            .filter(|&(_, &member)| member != marker && view.is_measured(member, frame))
            .map(|(at, &member)| (at, view.trajectory(member)[frame] - origin))
            .collect();
        if seen.len() < 3 {
            return None;
        }
        let turn = self.turn(seen.iter().copied());
        let n = self.components.len();
        let mut gram = vec![0.0; n * n];
        let mut right = vec![0.0; n];
        for &(at, position) in &seen {
            let departure = (turn.rotation * position - self.mean[at]).to_array();
            for (axis, value) in departure.into_iter().enumerate() {
                let row = 3 * at + axis;
                for (i, a) in self.components.iter().enumerate() {
                    right[i] += a[row] * value;
                    for (j, b) in self.components.iter().enumerate() {
                        gram[i * n + j] += a[row] * b[row];
                    }
                }
            }
        }
        for at in 0..n {
            // Only so much that more components than coordinates have a solution.
            gram[at * n + at] += 1e-6;
        }
        Cholesky::new(n, gram)?.solve(&mut right, 1);
        let slot = self.members.iter().position(|&member| member == marker)?;
        let mut local = self.mean[slot];
        for (component, factor) in self.components.iter().zip(right) {
            local += factor * DVec3::from_slice(&component[3 * slot..3 * slot + 3]);
        }
        Some(origin + turn.rotation.transpose() * local)
    }
}
