//! Constellations of four markers by which a set is recognised in any pose.
//!
//! Good ones keep their six distances closely, are large, and are not flat, so that their mirror
//! image is told apart. The expected number of wrong matches decides between them.

use glam::DVec3;
use sinew_core::asset::SEED_NUMBERS;

use super::pairs::Pairs;
use crate::clean::fill::View;

/// Four markers and their geometry.
#[derive(Clone, Debug)]
pub(super) struct Seed {
    pub markers: [usize; 4],
    pub numbers: [f32; SEED_NUMBERS],
    /// Logarithm of the wrong matches to be expected; lower is better.
    score: f64,
}

/// Rigid partners of a marker from which the other three are taken.
const POOL: usize = 12;
/// Shortest distance within a seed, metres.
const SHORT: f64 = 0.03;
/// Distances are looked for within this many deviations and metres more, but no further than the
/// third figure.
const DEVIATIONS: f64 = 3.5;
const SLACK: f64 = 0.0025;
const WIDEST: f64 = 0.025;
/// Frames in which wrong matches are counted, and what they weigh.
const TRIALS: usize = 8;
const LIKENESS: f64 = 4.0;
/// Seeds in which one marker may stand.
const USES: usize = 4;
/// Frames looked at for handedness.
const FRAMES: usize = 300;

/// The best seeds, spread over the set.
pub(super) fn choose(view: &View<'_>, pairs: &Pairs, count: usize) -> Vec<Seed> {
    let mut candidates = Vec::new();
    for a in 0..view.marker_count() {
        let far = pairs.rank(a).iter().filter(|n| n.distance >= SHORT);
        let pool: Vec<usize> = far.take(POOL).map(|n| n.marker).collect();
        let mut own = Vec::new();
        for (i, &b) in pool.iter().enumerate() {
            for (j, &c) in pool.iter().enumerate().skip(i + 1) {
                for &d in &pool[j + 1..] {
                    own.extend(candidate(pairs, [a, b, c, d]));
                }
            }
        }
        own.sort_by(|x, y| x.score.total_cmp(&y.score));
        own.truncate(12);
        candidates.extend(own);
    }
    let trials = trials(view);
    for seed in &mut candidates {
        seed.set_handedness(view);
    }
    candidates.sort_by(|x, y| x.score.total_cmp(&y.score).then(x.markers.cmp(&y.markers)));
    candidates.dedup_by(|x, y| sorted(x.markers) == sorted(y.markers));
    candidates.truncate(8 * count);
    for seed in &mut candidates {
        let wrong: usize = trials.iter().map(|points| seed.wrong_matches(points)).sum();
        seed.score += LIKENESS * (1.0 + wrong as f64 / trials.len().max(1) as f64).ln();
    }
    candidates.sort_by(|x, y| x.score.total_cmp(&y.score).then(x.markers.cmp(&y.markers)));
    let mut uses = vec![0; view.marker_count()];
    let mut chosen: Vec<Seed> = Vec::new();
    for seed in candidates {
        let is_known = |other: &Seed| sorted(other.markers) == sorted(seed.markers);
        if chosen.len() < count
            && seed.markers.iter().all(|&marker| uses[marker] < USES)
            && !chosen.iter().any(is_known)
        {
            for marker in seed.markers {
                uses[marker] += 1;
            }
            chosen.push(seed);
        }
    }
    chosen
}

fn sorted(mut markers: [usize; 4]) -> [usize; 4] {
    markers.sort_unstable();
    markers
}

/// Markers and their places in frames that show many, spread over the take.
fn trials(view: &View<'_>) -> Vec<Vec<(usize, DVec3)>> {
    let frames = view.take.frame_count();
    let part = frames.div_ceil(TRIALS).max(1);
    let richest = |start: usize| {
        let range = start..(start + part).min(frames);
        let frame = range.max_by_key(|&frame| view.take.seen(frame).count())?;
        Some(view.take.seen(frame).collect())
    };
    (0..frames).step_by(part).filter_map(richest).collect()
}

fn candidate(pairs: &Pairs, markers: [usize; 4]) -> Option<Seed> {
    let [a, b, c, d] = markers;
    let mut numbers = [0.0; SEED_NUMBERS];
    let (mut worst, mut size): (f64, f64) = (0.0, 0.0);
    for (number, (from, to)) in
        numbers
            .iter_mut()
            .zip([(a, b), (a, c), (b, c), (a, d), (b, d), (c, d)])
    {
        let (distance, variance) = pairs.between(from, to);
        if distance.is_nan() || distance < SHORT {
            return None;
        }
        *number = distance as f32;
        worst = worst.max(variance);
        size += distance.ln() / 6.0;
    }
    let tolerance = DEVIATIONS * worst.sqrt() + SLACK;
    if tolerance > WIDEST {
        return None;
    }
    numbers[6] = tolerance as f32;
    // Six distances hold by chance with a probability that falls with each tolerance over size.
    let score = 6.0 * (tolerance.ln() - size);
    Some(Seed {
        markers,
        numbers,
        score,
    })
}

impl Seed {
    /// How many other fours match it: another group, or itself turned over.
    fn wrong_matches(&self, points: &[(usize, DVec3)]) -> usize {
        let [ab, ac, bc, ad, bd, cd, tolerance, volume] = self.numbers.map(f64::from);
        let holds =
            |a: DVec3, b: DVec3, distance: f64| (a.distance(b) - distance).abs() <= tolerance;
        let mut count = 0;
        for &(a, pa) in points {
            for &(b, pb) in points.iter().filter(|(_, p)| holds(pa, *p, ab)) {
                for &(c, pc) in points.iter().filter(|(_, p)| holds(pa, *p, ac)) {
                    if !holds(pb, pc, bc) {
                        continue;
                    }
                    for &(d, pd) in points.iter().filter(|(_, p)| holds(pa, *p, ad)) {
                        let found = (pb - pa).cross(pc - pa).dot(pd - pa);
                        let is_handed = volume == 0.0 || 3.0 * found * volume > volume * volume;
                        if holds(pb, pd, bd)
                            && holds(pc, pd, cd)
                            && is_handed
                            && a != b
                            && [a, b, c, d] != self.markers
                        {
                            count += 1;
                        }
                    }
                }
            }
        }
        count
    }

    /// The mean signed volume where it keeps its sign, else 0.
    fn set_handedness(&mut self, view: &View<'_>) {
        let [a, b, c, d] = self.markers.map(|marker| view.trajectory(marker));
        let volume = |frame: usize| {
            let edges: [DVec3; 3] = [b, c, d].map(|other| other[frame] - a[frame]);
            edges[0].cross(edges[1]).dot(edges[2])
        };
        let known: Vec<f64> = (0..a.len()).map(volume).filter(|v| v.is_finite()).collect();
        let stride = known.len().div_ceil(FRAMES).max(1);
        let values: Vec<f64> = known.into_iter().step_by(stride).collect();
        let count = values.len().max(1) as f64;
        let mean = values.iter().sum::<f64>() / count;
        let spread = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
        if mean.abs() > 5.0 * spread.sqrt() && mean.abs() > 1e-6 {
            self.numbers[7] = mean as f32;
        } else {
            // Either image matches, and errors along the thin direction go unnoticed.
            self.score += 4.0;
        }
    }
}
