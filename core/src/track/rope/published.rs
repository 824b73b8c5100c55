//! Porter's own method (2012, section 3.5), as the baseline.
//!
//! Where the text leaves a choice: a point belongs to the first trace that takes it; a neighbour
//! counts as known when it was measured in this frame and in the one before; the nearer neighbour
//! weighs more (`beta` by distance along the rope); the three neighbours of eq. 3.4 lie on one
//! side, the side whose first is nearer; without three, `N` is left out of eq. 3.6.

use glam::Vec3;

use super::Config;
use super::points::Points;
use super::state::Track;
use super::vector::{length, unit};
use crate::row::Row;

/// One frame of the published tracker.
pub(super) fn step<const TRACES: usize, const POINTS: usize>(
    config: &Config,
    track: &mut Track<TRACES>,
    points: &mut Points<POINTS>,
) {
    let steady = track.pose.known;
    track.open();
    let count = track.measures.count;
    // Eq. 3.1 and 3.2: the marker's own last velocity, for traces without a gap.
    for i in 0..count {
        if track.gap.at(i) == 0 {
            let predicted = track.pose.before.at(i) + track.pose.velocity.at(i);
            take(config, track, points, i, predicted);
        }
    }
    for i in 0..count {
        if track.pose.known.at(i) {
            continue;
        }
        let gap = track.gap.at(i).saturating_add(1);
        let by_velocity = track.pose.before.at(i) + neighbour_velocity(track, &steady, i);
        let mut estimate = by_velocity;
        if gap > config.neighbour_after
            && let Some(by_position) = neighbour_position(track, i)
        {
            // Eq. 3.6.
            let alpha = 1.0 / f32::from(gap);
            estimate = by_velocity * alpha + by_position * (1.0 - alpha);
        }
        if !take(config, track, points, i, estimate) {
            track.pose.now.set(i, estimate);
            track.gap.set(i, gap);
            track.doubt.set(i, config.gamma * f32::from(gap));
        }
    }
    for i in 0..count {
        let moved = track.pose.now.at(i) - track.pose.before.at(i);
        track.pose.velocity.set(i, moved);
        let confidence = 1.0 / (1.0 + f32::from(track.gap.at(i)));
        track.confidence.set(i, confidence);
    }
}

/// Gives trace `i` the nearest free point within gamma of `expected`.
fn take<const TRACES: usize, const POINTS: usize>(
    config: &Config,
    track: &mut Track<TRACES>,
    points: &mut Points<POINTS>,
    i: usize,
    expected: Vec3,
) -> bool {
    let Some(point) = points.nearest(expected, config.gamma) else {
        return false;
    };
    points.claim(point);
    track.pose.now.set(i, points.at(usize::from(point)));
    track.pose.known.set(i, true);
    track.point.set(i, point);
    track.gap.set(i, 0);
    track.doubt.set(i, 0.0);
    true
}

/// Eq. 3.3: the weighted velocities of the nearest known neighbours, a frame.
///
/// `steady`: measured in the frame before, so that no velocity comes from a temporary marker.
fn neighbour_velocity<const TRACES: usize>(
    track: &Track<TRACES>,
    steady: &Row<bool, TRACES>,
    i: usize,
) -> Vec3 {
    let usable = |j: &usize| track.pose.known.at(*j) && steady.at(*j);
    let velocity = |j: usize| track.pose.now.at(j) - track.pose.before.at(j);
    let distance = |j: usize| (track.measures.arc.at(j) - track.measures.arc.at(i)).abs();
    let left = (0..i).rev().find(usable);
    let right = (i + 1..track.measures.count).find(usable);
    match (left, right) {
        (Some(left), Some(right)) => {
            let beta = distance(right) / (distance(left) + distance(right));
            velocity(left) * beta + velocity(right) * (1.0 - beta)
        }
        (Some(one), None) | (None, Some(one)) => velocity(one),
        (None, None) => track.pose.velocity.at(i),
    }
}

/// Eq. 3.4 and 3.5: from the nearest of three known neighbours on one side, along their direction,
/// by the distance measured at the start.
fn neighbour_position<const TRACES: usize>(track: &Track<TRACES>, i: usize) -> Option<Vec3> {
    let known = |j: &usize| track.pose.known.at(*j);
    let mut left = (0..i).rev().filter(known);
    let mut right = (i + 1..track.measures.count).filter(known);
    let three =
        |side: &mut dyn Iterator<Item = usize>| Some((side.next()?, side.next()?, side.next()?));
    let (left, right) = (three(&mut left), three(&mut right));
    let (j1, j2, j3) = match (left, right) {
        (Some(l), Some(r)) => {
            if i - l.0 <= r.0 - i {
                l
            } else {
                r
            }
        }
        (one, other) => one.or(other)?,
    };
    let at = |j: usize| track.pose.now.at(j);
    let direction = unit(((at(j1) - at(j2)) + (at(j2) - at(j3))) * 0.5);
    let distance = length(track.pose.slow.at(i) - track.pose.slow.at(j1));
    Some(at(j1) + direction * distance)
}
