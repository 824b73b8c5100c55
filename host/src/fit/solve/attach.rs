//! Markers whose label says nothing, or the wrong thing, go to the segment on which they sit still.

use glam::DVec3;

use super::body::{Body, Marker, Placed};
use crate::take::Take;

/// A marker may move this much on its segment, metres.
const STILL: f64 = 0.025;
/// A known landmark stays where its label puts it unless it moves more than this there, metres...
const DOUBTFUL: f64 = 0.02;
/// ... and less than this share of it elsewhere.
const BETTER: f64 = 0.5;
/// Nothing is expected of where such a marker sits.
const OPEN: f64 = 1.0;

/// Attaches the take's other markers, moves doubtful ones, and returns the columns of those that
/// sit still nowhere. O(markers x segments x frames)
pub fn attach(body: &mut Body, take: &Take, frames: &[(usize, Placed)]) -> Vec<usize> {
    let mut left = Vec::new();
    let seen = body.seen();
    for column in 0..take.marker_count() {
        let own = body
            .markers
            .iter()
            .position(|marker| marker.column == column);
        let points: Vec<(&Placed, DVec3)> = frames
            .iter()
            .filter_map(|(frame, placed)| Some((placed, take.position(column, *frame)?)))
            .collect();
        let count = points.len() as f64;
        let sits = |segment: usize| {
            let local = points.iter().map(|(placed, at)| {
                placed.rotations[segment].transpose() * (*at - placed.joints[segment])
            });
            let middle = local.clone().sum::<DVec3>() / count;
            let square = local.map(|at| at.distance_squared(middle)).sum::<f64>() / count;
            (segment, middle, square.sqrt())
        };
        let best = (0..body.segments.len())
            .filter(|&segment| seen[segment])
            .map(sits)
            .min_by(|a, b| a.2.total_cmp(&b.2));
        let best = best.filter(|_| points.len() >= 5);
        match (own, best) {
            (Some(own), Some((segment, middle, moves))) => {
                let (_, _, here) = sits(body.markers[own].segment);
                if here > DOUBTFUL && moves < BETTER * here {
                    body.markers[own] = open(column, segment, middle, body.scale);
                }
            }
            (None, Some((segment, middle, moves))) if moves <= STILL => {
                body.markers.push(open(column, segment, middle, body.scale));
            }
            (None, _) => left.push(column),
            (Some(_), None) => {}
        }
    }
    left
}

fn open(column: usize, segment: usize, offset: DVec3, scale: f64) -> Marker {
    Marker {
        column,
        segment,
        offset,
        anchor: None,
        shares: Vec::new(),
        expected: offset / scale,
        spread: OPEN,
    }
}
