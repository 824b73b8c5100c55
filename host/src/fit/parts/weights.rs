//! Which parts a marker belongs to, by how it moves (section 5.2).

use glam::DVec3;

use super::segments::normalised;
use super::{Glued, Segments};
use crate::clean::rigid::Rigid;

/// A marker with at least this weight is fully inside its part.
const INSIDE: f64 = 0.9;
/// Parts with less are no neighbours of a marker.
const NEIGHBOUR: f64 = 0.03;
/// Memberships below this are dropped, as in the paper.
const THRESHOLD: f64 = 0.2;
/// Least standard deviation of a rigid marker, metres: noise alone.
const LEAST_DEVIATION: f64 = 1e-3;
/// Frames looked at.
const MOST_FRAMES: usize = 120;

/// Memberships `[markers]` of (part, weight), heaviest first, from the Gaussian likelihood that a
/// marker moves with each of its neighbouring parts. `frames`: `[frames][markers]`, metres.
/// O(frames markers)
#[must_use]
pub fn of_markers(
    segments: &Segments,
    markers: &[Glued],
    rest: &[DVec3],
    frames: &[Vec<DVec3>],
) -> Vec<Vec<(u32, f64)>> {
    let rows: Vec<Vec<(u32, f64)>> = markers.iter().map(|marker| segments.at(marker)).collect();
    let parts = segments.part_count();
    let inside = |part: usize, least: f64| -> Vec<usize> {
        (0..markers.len())
            .filter(|&at| {
                rows[at]
                    .iter()
                    .any(|&(p, w)| p as usize == part && w >= least)
            })
            .collect()
    };
    let cores: Vec<Vec<usize>> = (0..parts)
        .map(|part| {
            let strict = inside(part, INSIDE);
            if strict.len() >= 4 {
                strict
            } else {
                inside(part, 0.5)
            }
        })
        .collect();
    let step = frames.len().div_ceil(MOST_FRAMES).max(1);
    let mut errors: Vec<Vec<f64>> = rows.iter().map(|row| vec![0.0; row.len()]).collect();
    let (mut variance, mut count) = (0.0, 0.0);
    let mut seen = 0.0;
    for frame in frames.iter().step_by(step) {
        seen += 1.0;
        let motions: Vec<Option<Rigid>> = cores
            .iter()
            .map(|core| Rigid::fit(core.iter().map(|&at| (rest[at], frame[at], 1.0))))
            .collect();
        for (at, row) in rows.iter().enumerate() {
            for (slot, &(part, weight)) in row.iter().enumerate() {
                let Some(motion) = &motions[part as usize] else {
                    errors[at][slot] = f64::INFINITY;
                    continue;
                };
                let error = motion.apply(rest[at]).distance_squared(frame[at]);
                errors[at][slot] += error;
                if weight >= INSIDE {
                    variance += error;
                    count += 1.0;
                }
            }
        }
    }
    let variance = (variance / f64::max(count, 1.0)).max(LEAST_DEVIATION * LEAST_DEVIATION);
    let memberships = rows.iter().zip(&errors).map(|(row, errors)| {
        let near: Vec<(u32, f64)> = row
            .iter()
            .zip(errors)
            .filter(|(row, _)| row.1 >= NEIGHBOUR)
            .map(|(&(part, _), error)| (part, error / f64::max(seen, 1.0)))
            .collect();
        let least = near.iter().map(|n| n.1).fold(f64::INFINITY, f64::min);
        if !least.is_finite() {
            return row[..1].iter().map(|&(part, _)| (part, 1.0)).collect();
        }
        // Relative to the best, so that a far marker's likelihoods do not all vanish.
        let likelihood =
            |&(part, error): &(u32, f64)| (part, (-(error - least) / (2.0 * variance)).exp());
        let all = normalised(near.iter().map(likelihood));
        normalised(all.into_iter().filter(|&(_, weight)| weight >= THRESHOLD))
    });
    memberships.collect()
}
