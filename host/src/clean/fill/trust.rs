//! Whether filled samples are as sure as they say: measured stretches are hidden, filled, compared.
//!
//! Deviations follow from models of motion and noise that no take quite obeys, least of all one
//! that was smoothed before. What they are short of is learned from the take itself, for gaps of
//! a few lengths, and evened out towards what ten recordings gave.

use super::plan::{fill_marker, in_parallel};
use super::view::View;
use crate::take::Take;

/// Lengths of gaps in frames, and what deviations are short of by experience.
const LENGTHS: [usize; 6] = [1, 3, 10, 30, 100, 300];
const USUAL: [f64; 6] = [2.0, 1.9, 1.5, 1.25, 1.1, 1.1];
/// Markers tried, and stretches of each length in each.
const MARKERS: usize = 24;
const EACH: usize = 2;
/// Frames kept between hidden stretches.
const APART: usize = 40;
/// Share of a trajectory that may be hidden.
const HIDDEN: f64 = 0.25;
/// Stretches that outweigh experience.
const ENOUGH: f64 = 6.0;
/// Bounds of a factor.
const BOUNDS: [f64; 2] = [0.7, 12.0];

/// Factors on deviations by length of gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Trust([f64; 6]);

impl Trust {
    /// Learns from some of `markers`. As filling them, once more.
    pub fn learn(view: &View<'_>, markers: &[usize]) -> Self {
        let step = markers.len().div_ceil(MARKERS).max(1);
        let tried: Vec<usize> = markers.iter().copied().step_by(step).collect();
        let found = in_parallel(&tried, |marker| scores(view.take, marker));
        let mut scores: [Vec<f64>; 6] = Default::default();
        let mut stretches = [0.0; 6];
        for (kind, score) in found.into_iter().flatten() {
            stretches[kind] += 1.0;
            scores[kind].extend(score);
        }
        let mut factors = USUAL;
        for (kind, factor) in factors.iter_mut().enumerate() {
            if let Some(found) = short(&mut scores[kind]) {
                let weight = stretches[kind] / (stretches[kind] + ENOUGH);
                *factor *= (found.clamp(BOUNDS[0], BOUNDS[1]) / *factor).powf(weight);
            }
        }
        Self(factors)
    }

    /// The factor for a gap of so many frames.
    pub fn factor(&self, frames: usize) -> f64 {
        let next = LENGTHS.partition_point(|&length| length < frames);
        if next == 0 || next == LENGTHS.len() {
            return self.0[next.min(LENGTHS.len() - 1)];
        }
        let [low, high] = [next - 1, next].map(|at| (LENGTHS[at] as f64).ln());
        let share = ((frames as f64).ln() - low) / (high - low);
        self.0[next - 1].powf(1.0 - share) * self.0[next].powf(share)
    }
}

/// By what factor deviations must grow for errors to be normal: the mean of what the share within
/// one and that within two deviations ask for.
fn short(scores: &mut [f64]) -> Option<f64> {
    scores.sort_by(f64::total_cmp);
    let at = |share: f64| scores.get(((scores.len() as f64 - 1.0) * share) as usize);
    Some((at(0.683)? * at(0.954)? / 2.0).sqrt())
}

/// Hides stretches of a marker and fills them: (which length, errors of the coordinates over their
/// deviation) of each.
fn scores(take: &Take, marker: usize) -> Vec<(usize, Vec<f64>)> {
    let mut broken = take.clone();
    let mut hidden: Vec<(usize, usize)> = Vec::new();
    let seen = take.frame_count() - take.missing_count(marker);
    let mut left = (HIDDEN * seen as f64) as usize;
    for turn in 0..EACH {
        for (kind, &length) in LENGTHS.iter().enumerate() {
            let is_free = |start: &usize| {
                hidden.iter().all(|&(other, at)| {
                    start + length + APART <= at || at + LENGTHS[other] + APART <= *start
                })
            };
            let starts: Vec<usize> = take
                .traces(marker)
                .flat_map(|trace| trace.start + 1..trace.end.saturating_sub(length))
                .filter(is_free)
                .collect();
            if length <= left && !starts.is_empty() {
                left -= length;
                // Anywhere, but the same in every run.
                let chance = (marker + 1) * 7919 + kind * 104_729 + turn * 1_299_709;
                hidden.push((kind, starts[chance % starts.len()]));
            }
        }
    }
    let stretch = |&(kind, start): &(usize, usize)| start..start + LENGTHS[kind];
    for frame in hidden.iter().flat_map(stretch) {
        broken.set_position(marker, frame, None);
    }
    let sigma = super::measured_sigma(&broken);
    let view = View {
        take: &broken,
        sigma: &sigma,
    };
    let filled = fill_marker(&view, marker, false);
    let each = hidden.iter().map(|one| {
        let range = stretch(one);
        let inside = filled.iter().filter(|sample| range.contains(&sample.0));
        let errors = inside.flat_map(|&(frame, position, sigma, _)| {
            ((position - take.trajectory(marker)[frame]) / sigma)
                .abs()
                .to_array()
        });
        (one.0, errors.filter(|error| error.is_finite()).collect())
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_lie_between_those_of_the_lengths() {
        let trust = Trust([2.0, 2.0, 1.0, 1.0, 4.0, 8.0]);
        assert_eq!(trust.factor(1), 2.0);
        assert_eq!(trust.factor(30), 1.0);
        assert!(
            (trust.factor(55) - 2.0).abs() < 0.02,
            "{}",
            trust.factor(55)
        );
        assert_eq!(trust.factor(5000), 8.0);
    }

    #[test]
    fn normal_errors_are_short_of_nothing() {
        // Quantiles of a half-normal distribution, twice as wide.
        let mut scores: Vec<f64> = (1..1000)
            .map(|at| {
                let share = f64::from(at) / 1000.0;
                // Winitzki's approximation of the inverse error function.
                let log = (1.0 - share * share).ln();
                let half = 2.0 / (std::f64::consts::PI * 0.147) + log / 2.0;
                2.0 * 2f64.sqrt() * ((half * half - log / 0.147).sqrt() - half).sqrt()
            })
            .collect();
        assert!((short(&mut scores).unwrap() - 2.0).abs() < 0.02);
        assert_eq!(short(&mut []), None);
    }
}
