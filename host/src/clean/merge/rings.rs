//! Which tracks lie around a track, and how rigidly they move with it.

use glam::DVec3;

use super::super::fill::in_parallel;
use super::tracks::Tracks;

/// Fragments noted around a fragment in one frame.
const NEAR: usize = 24;
/// Seconds between frames that are looked at within a long fragment.
const EVERY: f64 = 0.5;
/// Frames of a track at which distances to its neighbours are compared.
const FRAMES: usize = 48;
/// Neighbours kept of a track.
const KEPT: usize = 40;
/// Nearest neighbours whose mean distance is the track's spacing.
const SPACING: usize = 6;

/// `[fragments]`: the fragments seen nearest to each at its ends and now and then between.
///
/// About fragments times fragments seen at once.
pub(super) fn touches(tracks: &Tracks<'_>) -> Vec<Vec<usize>> {
    let every = ((EVERY * tracks.take().rate()) as usize).max(1);
    let mut wanted: Vec<(usize, usize)> = Vec::new();
    for (at, fragment) in tracks.fragments.iter().enumerate() {
        let inner = (fragment.start / every + 1..).map(|step| step * every);
        let inner = inner.take_while(|frame| frame + 1 < fragment.end);
        wanted.extend(inner.map(|frame| (frame, at)));
        wanted.push((fragment.start, at));
        if fragment.frame_count() > 1 {
            wanted.push((fragment.end - 1, at));
        }
    }
    wanted.sort_unstable();
    let mut order: Vec<usize> = (0..tracks.fragments.len()).collect();
    order.sort_unstable_by_key(|&at| tracks.fragments[at].start);
    let mut coming = order.into_iter().peekable();
    let mut alive: Vec<usize> = Vec::new();
    let mut touched = vec![Vec::new(); tracks.fragments.len()];
    let mut near: Vec<(f64, usize)> = Vec::new();
    for group in wanted.chunk_by(|a, b| a.0 == b.0) {
        let frame = group[0].0;
        while let Some(next) = coming.next_if(|&at| tracks.fragments[at].start <= frame) {
            alive.push(next);
        }
        alive.retain(|&at| tracks.fragments[at].end > frame);
        let places: Vec<DVec3> = alive.iter().map(|&at| tracks.sample(at, frame)).collect();
        for &(_, own) in group {
            let here = tracks.sample(own, frame);
            near.clear();
            let others = alive.iter().zip(&places).filter(|(at, _)| **at != own);
            near.extend(others.map(|(&at, place)| (place.distance_squared(here), at)));
            if near.len() > NEAR {
                near.select_nth_unstable_by(NEAR, |a, b| a.partial_cmp(b).unwrap_or(a.1.cmp(&b.1)));
                near.truncate(NEAR);
            }
            touched[own].extend(near.iter().map(|one| one.1));
        }
    }
    for list in &mut touched {
        list.sort_unstable();
        list.dedup();
    }
    touched
}

/// What lies around a track.
#[derive(Clone, Debug, Default)]
pub(super) struct Ring {
    /// Neighbours and their weights, the most rigid first.
    pub members: Vec<(usize, f64)>,
    /// Mean distance to the nearest of them, metres; NaN without any.
    pub spacing: f64,
}

/// `[tracks]`: rings of those that have fragments.
pub(super) fn rings(tracks: &Tracks<'_>, touches: &[Vec<usize>]) -> Vec<Ring> {
    let all: Vec<usize> = (0..tracks.members.len()).collect();
    in_parallel(&all, |track| {
        let touched = tracks.members[track].iter().flat_map(|&at| &touches[at]);
        let mut others: Vec<usize> = touched.map(|&at| tracks.track_of[at]).collect();
        others.sort_unstable();
        others.dedup();
        ring(tracks, track, &others)
    })
}

fn ring(tracks: &Tracks<'_>, track: usize, others: &[usize]) -> Ring {
    let frames = tracks.spread_frames(track, FRAMES);
    let own: Vec<DVec3> = frames
        .iter()
        .filter_map(|&frame| tracks.position(track, frame))
        .collect();
    let mut near: Vec<(f64, f64, usize)> = others
        .iter()
        .filter(|&&other| other != track)
        .filter_map(|&other| {
            let (mut count, mut mean, mut spread) = (0.0, 0.0, 0.0);
            for (&frame, own) in frames.iter().zip(&own) {
                let Some(place) = tracks.position(other, frame) else {
                    continue;
                };
                let distance = own.distance(place);
                count += 1.0;
                let step = distance - mean;
                mean += step / count;
                spread += step * (distance - mean);
            }
            // A distance seen briefly may yet vary, a long one more than a short one.
            let trust = 0.01 * mean * mean * (1.0 + 3.0 / count);
            (count > 0.0).then(|| (spread / count + trust, mean, other))
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    near.truncate(KEPT);
    let mut distances: Vec<f64> = near.iter().map(|one| one.1).collect();
    distances.sort_by(f64::total_cmp);
    distances.truncate(SPACING);
    Ring {
        members: near
            .iter()
            .map(|one| (one.2, (one.0 + 1e-12).recip()))
            .collect(),
        spacing: distances.iter().sum::<f64>() / distances.len() as f64,
    }
}
