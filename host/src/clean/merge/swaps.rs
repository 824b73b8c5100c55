//! Frames in which a trajectory goes over to another marker.
//!
//! A swap is a step that the skin around it does not make. Seen from the neighbours, which share
//! the motion of the body, it stands out even where the trajectory itself hardly jumps.

use glam::DVec3;

use super::super::fill::in_parallel;
use super::carry::carry;
use super::fragments::Fragment;
use super::rings::Ring;
use super::tracks::Tracks;

/// Neighbours whose acceleration is compared, and those that carry.
const COMPARED: usize = 4;
const CARRYING: usize = 10;
/// Least departure from the neighbours' acceleration, metres a frame squared: a marker's width.
const WIDTH: f64 = 2e-3;
/// Least step over its deviation.
const TIMES: f64 = 4.0;

/// Frames (fragment, frame) at which unnamed fragments begin to follow another marker, ascending.
///
/// About samples times neighbours.
pub(super) fn find(
    tracks: &Tracks<'_>,
    touches: &[Vec<usize>],
    unnamed: usize,
) -> Vec<(usize, usize)> {
    let all: Vec<usize> = (0..unnamed).collect();
    let found = in_parallel(&all, |fragment| of(tracks, fragment, &touches[fragment]));
    let each = found.into_iter().enumerate();
    each.flat_map(|(at, frames)| frames.into_iter().map(move |frame| (at, frame)))
        .collect()
}

fn of(tracks: &Tracks<'_>, fragment: usize, touched: &[usize]) -> Vec<usize> {
    let Fragment { start, end, .. } = tracks.fragments[fragment];
    let mut frames = Vec::new();
    let place = |at: usize, frame: usize| {
        let Fragment { start, end, .. } = tracks.fragments[at];
        (start..end)
            .contains(&frame)
            .then(|| tracks.sample(at, frame))
    };
    let bend = |at: usize, frame: usize| {
        let (before, after) = (place(at, frame - 1)?, place(at, frame + 1)?);
        Some(before - 2.0 * place(at, frame)? + after)
    };
    for frame in start + 1..end.saturating_sub(1) {
        let Some(own) = bend(fragment, frame) else {
            continue;
        };
        let here = tracks.sample(fragment, frame);
        let mut near: Vec<(f64, usize)> = touched
            .iter()
            .filter_map(|&at| Some((place(at, frame)?.distance_squared(here), at)))
            .collect();
        if near.len() < 3 {
            continue;
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let bends = near
            .iter()
            .filter_map(|one| bend(one.1, frame))
            .take(COMPARED);
        let (sum, count) = bends.fold((DVec3::ZERO, 0.0), |(sum, n), b| (sum + b, n + 1.0));
        if count > 0.0 && own.distance(sum / count) < WIDTH {
            continue;
        }
        near.truncate(CARRYING);
        // The step may lie before the frame or behind it.
        for to in [frame, frame + 1] {
            if frames.last() != Some(&to) && is_step(tracks, fragment, &near, to) {
                frames.push(to);
            }
        }
    }
    frames
}

/// Whether a fragment leaves its neighbours between the frame before `to` and `to`, for good.
fn is_step(tracks: &Tracks<'_>, fragment: usize, near: &[(f64, usize)], to: usize) -> bool {
    let Fragment { start, end, .. } = tracks.fragments[fragment];
    let spacing = near.iter().take(3).map(|one| one.0.sqrt()).sum::<f64>() / 3.0;
    let ring = Ring {
        members: near
            .iter()
            .map(|&(d, at)| (tracks.track_of[at], (d + 1e-12).recip()))
            .collect(),
        spacing,
    };
    let departs = |from: usize, to: usize| {
        let origin = tracks.sample(fragment, from);
        let Some(expected) = carry(tracks, &ring, origin, from, to) else {
            return false;
        };
        let step = expected.position.distance(tracks.sample(fragment, to));
        step > TIMES * expected.sigma && step > WIDTH
    };
    // A spike leaves and comes back; a swap stays.
    let stays = to + 1 >= end || departs(to - 1, to + 1);
    let was = to < start + 2 || departs(to - 2, to);
    departs(to - 1, to) && stays && was
}
