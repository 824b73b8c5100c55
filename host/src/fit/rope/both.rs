//! A second pass, backwards in time: what comes out of a gap is easier to follow into it.
//!
//! Where the two passes disagree, the labelling whose segments fit the rope's lengths better is
//! taken for the whole stretch of disagreement; what only one of them has measured is kept. Then
//! whole tracklets are reconsidered.

use sinew_core::track::rope::Config;

use super::follow::{check_points, run};
use super::tracklets::reconsider;
use super::{PointFrames, RopeError, RopeSample, Trace};

/// Price of a marker without a point, against the square of a link's error in standard deviations.
const MISSING: f64 = 4.0;
/// Most that one link can cost.
const MOST: f64 = 25.0;
/// Standard deviation of a link's length, as a share of it: stretch, and the chord of a bend.
const SPREAD: f64 = 0.06;
/// The backward pass begins in the last frame in which this share of the rope is measured.
const COMPLETE: f64 = 0.9;

/// Follows the ropes backwards from the end and merges the passes, one rope after the other.
/// O(frames x points x markers)
///
/// # Errors
/// As [`follow`](super::follow::follow).
pub fn both_ways(frames: &PointFrames, forward: &[Trace]) -> Result<Vec<Trace>, RopeError> {
    check_points(frames)?;
    let mut merged = forward.to_vec();
    for rope in 0..forward.len() {
        let trace = {
            let others = || {
                merged
                    .iter()
                    .enumerate()
                    .filter(|(other, _)| *other != rope)
            };
            let taken = |frame: usize, point: usize| {
                let mut samples = others().flat_map(|(_, trace)| &trace.frames[frame]);
                samples.any(|sample| sample.point() == Some(point))
            };
            both_ways_of(frames, &forward[rope], &taken)?
        };
        merged[rope] = trace;
    }
    Ok(merged)
}

fn both_ways_of(
    frames: &PointFrames,
    forward: &Trace,
    taken: &dyn Fn(usize, usize) -> bool,
) -> Result<Trace, RopeError> {
    let markers = forward.marker_count();
    let is_complete = |samples: &Vec<RopeSample>| {
        let measured = samples.iter().filter(|s| s.point().is_some()).count();
        measured as f64 >= COMPLETE * markers as f64
    };
    let Some(from) = forward.frames.iter().rposition(is_complete) else {
        return Ok(forward.clone());
    };
    let rope: Vec<[f32; 3]> = forward.frames[from]
        .iter()
        .map(|sample| sample.position.as_vec3().to_array())
        .collect();
    let mut backward = forward.frames.clone();
    let config = Config::new(frames.rate as f32);
    let order = (forward.start..from).rev();
    run(config, frames, &rope, order, taken, |frame, samples| {
        backward[frame] = samples;
    })?;
    let lengths = forward.segment_lengths();
    let mut merged = forward.clone();
    let mut frame = 0;
    while frame < merged.frames.len() {
        let differ = |at: &usize| {
            let mut pairs = forward.frames[*at].iter().zip(&backward[*at]);
            pairs.any(|(a, b)| disagree(a, b))
        };
        let end = frame + (frame..merged.frames.len()).take_while(differ).count();
        let price = |of: &[Vec<RopeSample>]| -> f64 {
            of[frame..end].iter().map(|s| cost(s, &lengths)).sum()
        };
        if end > frame && price(&backward) < price(&forward.frames) {
            merged.frames[frame..end].clone_from_slice(&backward[frame..end]);
        }
        frame = end + 1;
    }
    for (at, samples) in merged.frames.iter_mut().enumerate() {
        complete(samples, &forward.frames[at]);
        complete(samples, &backward[at]);
    }
    reconsider(&mut merged, frames);
    Ok(merged)
}

/// Whether two passes give a marker two points.
fn disagree(a: &RopeSample, b: &RopeSample) -> bool {
    matches!((a.point(), b.point()), (Some(a), Some(b)) if a != b)
}

/// Price of one frame's labelling.
fn cost(samples: &[RopeSample], lengths: &[f64]) -> f64 {
    let missing = samples.iter().filter(|s| s.point().is_none()).count();
    let links = samples.windows(2).zip(lengths).map(|(pair, length)| {
        if pair[0].point().is_none() || pair[1].point().is_none() || length.is_nan() {
            return 0.0;
        }
        let off = pair[0].position.distance(pair[1].position) - length;
        (off / (SPREAD * length)).powi(2).min(MOST)
    });
    links.sum::<f64>() + MISSING * missing as f64
}

/// Adds points that only `other` has, and that nobody else has got.
fn complete(samples: &mut [RopeSample], other: &[RopeSample]) {
    for marker in 0..samples.len() {
        let Some(point) = other[marker].point() else {
            continue;
        };
        let is_free = samples.iter().all(|sample| sample.point() != Some(point));
        if samples[marker].point().is_none() && is_free {
            samples[marker] = other[marker];
        }
    }
}
