//! From when to when two trajectories are exchanged: the likeliest course of two states (Viterbi
//! 1967), as labelled and exchanged.

use std::ops::Range;

use glam::DVec3;

use super::place::{Place, Places};
use super::{Exchange, log_density};
use crate::take::Take;

/// Logarithm of the odds against an exchange, each time.
const COST: f64 = 10.0;
/// What one frame may say at most.
const MOST: f64 = 12.0;
/// Seconds within which frames say the same.
const ALIKE: f64 = 0.05;
/// Least gain of a frame on average, and largest distance left over what was.
const GAIN: f64 = 1.5;
const LEFT: f64 = 0.5;
/// Seconds by which an end may move to where the trajectories go on most evenly, and what that may
/// cost of the odds.
const SHIFT: f64 = 0.1;
const GIVEN: f64 = 6.0;

/// What a frame says.
#[derive(Clone, Copy, Default)]
struct Word {
    /// Log odds of exchanged against labelled; 0 where nothing is known.
    gain: f64,
    /// Mean distances from the expected places, as labelled and exchanged.
    distances: Option<[f64; 2]>,
}

/// Where a pair is exchanged. Linear in frames.
pub(super) fn follow(take: &Take, places: &Places, [a, b]: [usize; 2]) -> Vec<Exchange> {
    let frames = take.frame_count();
    let words: Vec<Word> = (0..frames).map(|f| word(take, places, a, b, f)).collect();
    let unit = (ALIKE * take.rate()).max(1.0).recip();
    let gains: Vec<f64> = words.iter().map(|word| unit * word.gain).collect();
    let each = exchanged(&gains).into_iter().filter_map(|run| {
        let run = settle(take, a, b, &gains, run);
        let told: Vec<&Word> = words[run.clone()]
            .iter()
            .filter(|w| w.distances.is_some())
            .collect();
        let count = told.len() as f64;
        let mean = |of: usize| {
            let each = told.iter().filter_map(|word| Some(word.distances?[of]));
            each.sum::<f64>() / count
        };
        let sum: f64 = told.iter().map(|word| word.gain).sum();
        let (before, after) = (mean(0), mean(1));
        (sum > GAIN * count && after < LEFT * before).then_some(Exchange {
            columns: [a, b],
            frames: run,
            before,
            after,
            odds: unit * sum,
        })
    });
    each.collect()
}

fn word(take: &Take, places: &Places, a: usize, b: usize, frame: usize) -> Word {
    let seen = [take.position(a, frame), take.position(b, frame)];
    if seen == [None, None] {
        return Word::default();
    }
    let place = |marker, other| places.expect(take, marker, frame, other);
    let (Some(at_a), Some(at_b)) = (place(a, b), place(b, a)) else {
        return Word::default();
    };
    let sum = |of: &dyn Fn(&Place, DVec3) -> f64, first: &Place, second: &Place| {
        let each = [first, second].into_iter().zip(seen);
        each.filter_map(|(place, seen)| Some(of(place, seen?)))
            .sum::<f64>()
    };
    let count = seen.iter().flatten().count() as f64;
    let far = |place: &Place, seen: DVec3| place.position.distance(seen) / count;
    let gain = sum(&log_density, &at_b, &at_a) - sum(&log_density, &at_a, &at_b);
    Word {
        gain: gain.clamp(-MOST, MOST),
        distances: Some([sum(&far, &at_a, &at_b), sum(&far, &at_b, &at_a)]),
    }
}

/// Runs of frames in the second state.
fn exchanged(gains: &[f64]) -> Vec<Range<usize>> {
    // Best sums that end as labelled and exchanged; for each frame whether they came from there.
    let mut best = [0.0, -COST];
    let mut came = Vec::with_capacity(gains.len());
    for gain in gains {
        let from = [best[1] - COST > best[0], best[1] >= best[0] - COST];
        best = [
            best[0].max(best[1] - COST),
            best[1].max(best[0] - COST) + gain,
        ];
        came.push(from);
    }
    let mut state = usize::from(best[1] > best[0]);
    let mut runs: Vec<Range<usize>> = Vec::new();
    for frame in (0..gains.len()).rev() {
        if state == 1 {
            match runs.last_mut() {
                Some(run) if run.start == frame + 1 => run.start = frame,
                _ => runs.push(frame..frame + 1),
            }
        }
        state = usize::from(came[frame][state]);
    }
    runs.reverse();
    runs
}

/// Moves both ends to where the exchanged trajectories go on most evenly.
fn settle(take: &Take, a: usize, b: usize, gains: &[f64], run: Range<usize>) -> Range<usize> {
    let shift = (SHIFT * take.rate()).ceil() as usize;
    let end_of = |end: usize| {
        if end == 0 || end == gains.len() {
            return end;
        }
        let mut best = (step(take, a, b, end), end);
        for direction in [true, false] {
            let mut said: f64 = 0.0;
            for far in 1..=shift {
                let at = if direction {
                    end + far
                } else {
                    end.wrapping_sub(far)
                };
                if at == 0 || at >= gains.len() {
                    break;
                }
                said += gains[if direction { at - 1 } else { at }];
                if said.abs() > GIVEN {
                    break;
                }
                let here = step(take, a, b, at);
                if here < best.0 {
                    best = (here, at);
                }
            }
        }
        best.1
    };
    let (start, end) = (end_of(run.start), end_of(run.end));
    if start < end { start..end } else { run }
}

/// How far the trajectories jump if they are exchanged from frame `at` on, less how far they jump
/// as they are, metres.
fn step(take: &Take, a: usize, b: usize, at: usize) -> f64 {
    let (a, b) = (take.trajectory(a), take.trajectory(b));
    let before = |path: &[DVec3]| {
        path[..at]
            .iter()
            .rev()
            .take(64)
            .find(|p| !p.is_nan())
            .copied()
    };
    let after = |path: &[DVec3]| path[at..].iter().take(64).find(|p| !p.is_nan()).copied();
    let jump = |from: &[DVec3], to: &[DVec3]| match (before(from), after(to)) {
        (Some(from), Some(to)) => from.distance(to),
        _ => 0.0,
    };
    jump(a, b) + jump(b, a) - jump(a, a) - jump(b, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_pay_for_both_ends() {
        let mut gains = vec![-3.0; 40];
        gains[10..20].fill(4.0);
        gains[30..32].fill(4.0);
        assert_eq!(exchanged(&gains), vec![10..20; 1], "two frames do not pay");
        gains[28..].fill(4.0);
        assert_eq!(exchanged(&gains), [10..20, 28..40]);
        assert_eq!(exchanged(&[]), []);
    }
}
