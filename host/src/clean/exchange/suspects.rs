//! Pairs of markers of which one is seen where the other is expected.

use std::collections::HashMap;

use super::super::fill::in_parallel;
use super::place::Places;
use crate::take::Take;

/// Seconds between frames looked at.
const EVERY: f64 = 0.04;
/// Distance from its place from which a marker is looked at: deviations, and metres.
const TIMES: f64 = 3.0;
const LEAST: f64 = 8e-3;
/// How much nearer the other must be.
const NEARER: f64 = 0.6;
/// Others that a marker may be in a frame.
const CHOICES: usize = 2;
/// Frames that speak for a pair, and pairs of one marker.
const VOTES: usize = 2;
const PARTNERS: usize = 6;

/// The pairs, the likeliest first.
pub(super) fn pairs(take: &Take, places: &Places) -> Vec<[usize; 2]> {
    let every = ((EVERY * take.rate()).round() as usize).max(1);
    let frames: Vec<usize> = (0..take.frame_count()).step_by(every).collect();
    let markers: Vec<usize> = places.markers().collect();
    let found = in_parallel(&frames, |frame| in_frame(take, places, &markers, frame));
    let mut votes: HashMap<[usize; 2], usize> = HashMap::new();
    for pair in found.into_iter().flatten() {
        *votes.entry(pair).or_default() += 1;
    }
    let mut ranked: Vec<([usize; 2], usize)> = votes.into_iter().collect();
    ranked.retain(|one| one.1 >= VOTES);
    ranked.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    let mut uses = vec![0; take.marker_count()];
    ranked.retain(|&([a, b], _)| {
        let fits = uses[a] < PARTNERS && uses[b] < PARTNERS;
        if fits {
            uses[a] += 1;
            uses[b] += 1;
        }
        fits
    });
    ranked.into_iter().map(|one| one.0).collect()
}

fn in_frame(take: &Take, places: &Places, markers: &[usize], frame: usize) -> Vec<[usize; 2]> {
    let expected: Vec<_> = markers
        .iter()
        .map(|&marker| places.expect(take, marker, frame, marker))
        .collect();
    let mut pairs = Vec::new();
    for (at, &marker) in markers.iter().enumerate() {
        let (Some(place), Some(seen)) = (expected[at], take.position(marker, frame)) else {
            continue;
        };
        let away = place.position.distance(seen);
        if away < LEAST || away < TIMES * place.sigma {
            continue;
        }
        let others = markers
            .iter()
            .zip(&expected)
            .filter(|(other, _)| **other != marker);
        let mut near: Vec<(f64, usize)> = others
            .filter_map(|(&other, theirs)| {
                let distance = match (take.position(other, frame), theirs) {
                    (Some(other), _) => other.distance(place.position),
                    (None, Some(theirs)) => theirs.position.distance(seen),
                    (None, None) => return None,
                };
                (distance < NEARER * away).then_some((distance, other))
            })
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.truncate(CHOICES);
        pairs.extend(
            near.iter()
                .map(|&(_, other)| [marker.min(other), marker.max(other)]),
        );
    }
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}
