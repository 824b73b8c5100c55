//! Rounds of merging: the surest pairs of marker and fragment first.

use std::collections::HashMap;

use glam::DVec3;

use super::super::fill::in_parallel;
use super::carry::{Labelled, carry};
use super::choose::{Pair, choose};
use super::fragments::Fragment;
use super::{Decision, MergeOptions};
use crate::take::Take;

/// Neighbours that carry a marker.
const RING: usize = 10;
/// Frames looked at for neighbours.
const RING_FRAMES: usize = 240;
/// Frames of a fragment that must have been compared, at least.
const JUDGED: usize = 3;
/// Seconds that an unexplained fragment must last to be a marker of its own.
const OWN_LIFE: f64 = 0.25;

/// How strict a round is: factors on both thresholds, and by how much the second best must be
/// worse.
struct Level {
    factor: f64,
    margin: f64,
    doubtful: bool,
}

const LEVELS: [Level; 5] = [
    level(0.4, 2.0, false),
    level(0.7, 1.7, false),
    level(1.0, 1.4, false),
    level(1.0, 1.0, true),
    level(1.7, 1.3, true),
];

const fn level(factor: f64, margin: f64, doubtful: bool) -> Level {
    Level {
        factor,
        margin,
        doubtful,
    }
}

/// The state between rounds.
pub(super) struct Work<'a> {
    take: &'a Take,
    pub fragments: Vec<Fragment>,
    pub owners: Vec<Option<usize>>,
    pub labels: Vec<String>,
    /// `[markers x frames]`, NaN where missing.
    pub positions: Vec<DVec3>,
    pub decisions: Vec<Decision>,
}

impl<'a> Work<'a> {
    pub fn new(take: &'a Take, named: &[usize], fragments: Vec<Fragment>) -> Self {
        let labels = named.iter().map(|&column| take.labels()[column].clone());
        let paths = named.iter().flat_map(|&column| take.trajectory(column));
        Self {
            take,
            labels: labels.collect(),
            positions: paths.copied().collect(),
            owners: vec![None; fragments.len()],
            fragments,
            decisions: Vec::new(),
        }
    }

    fn frames(&self) -> usize {
        self.take.frame_count()
    }

    fn least_life(&self) -> usize {
        (0.1 * self.take.rate()).ceil() as usize
    }

    fn sample(&self, fragment: usize, frame: usize) -> DVec3 {
        self.take.trajectory(self.fragments[fragment].column)[frame]
    }

    /// The frame with the most fragments that live a tenth of a second, the first of several.
    pub fn fullest_frame(&self) -> Option<usize> {
        let mut change = vec![0_isize; self.frames() + 1];
        let least = self.least_life().min(self.frames());
        for fragment in &self.fragments {
            if fragment.frame_count() >= least {
                change[fragment.start] += 1;
                change[fragment.end] -= 1;
            }
        }
        let (mut alive, mut best) = (0, (0, None));
        for (frame, change) in change.iter().enumerate().take(self.frames()) {
            alive += change;
            if alive > best.0 {
                best = (alive, Some(frame));
            }
        }
        best.1
    }

    /// Makes each fragment that is alive in a frame a marker.
    pub fn name_markers_of(&mut self, frame: usize) {
        assert!(
            frame < self.frames(),
            "reference frame {frame} does not exist"
        );
        for fragment in 0..self.fragments.len() {
            let Fragment { start, end, .. } = self.fragments[fragment];
            if (start..end).contains(&frame) {
                self.add_marker(fragment);
            }
        }
    }

    fn add_marker(&mut self, fragment: usize) {
        let marker = self.labels.len();
        let mut number = marker + 1;
        while self.labels.contains(&format!("M{number}")) {
            number += 1;
        }
        self.labels.push(format!("M{number}"));
        let count = self.frames();
        self.positions
            .extend(std::iter::repeat_n(DVec3::NAN, count));
        self.give(fragment, marker);
    }

    fn give(&mut self, fragment: usize, marker: usize) {
        self.owners[fragment] = Some(marker);
        let Fragment { column, start, end } = self.fragments[fragment];
        let path = &self.take.trajectory(column)[start..end];
        let frames = self.frames();
        self.positions[marker * frames..][start..end].copy_from_slice(path);
    }

    /// Merges until nothing more can be decided.
    pub fn run(&mut self, options: &MergeOptions) {
        if self.fragments.is_empty() {
            return;
        }
        loop {
            for level in &LEVELS {
                while self.round(options, level) {}
            }
            if !self.found_markers() {
                break;
            }
        }
    }

    /// One round; false if it decided nothing.
    fn round(&mut self, options: &MergeOptions, level: &Level) -> bool {
        let open: Vec<usize> = (0..self.fragments.len())
            .filter(|&at| self.owners[at].is_none())
            .collect();
        let rings = self.rings();
        let all = Candidates::new(self, &rings);
        let pairs = in_parallel(&open, |fragment| all.of(fragment));
        let pairs: Vec<Pair> = pairs.into_iter().flatten().collect();
        let within = |pair: &Pair| {
            pair.mean <= level.factor * options.mean && pair.worst <= level.factor * options.every
        };
        let chosen = choose(&pairs, &self.fragments, within, level.margin);
        for pair in &chosen {
            self.give(pair.fragment, pair.marker);
            self.decisions.push(Decision {
                fragment: pair.fragment,
                marker: pair.marker,
                mean: pair.mean,
                worst: pair.worst,
                support: pair.support,
                other: pair.other,
                doubtful: level.doubtful,
            });
        }
        !chosen.is_empty()
    }

    /// Long fragments that no marker explains become markers: the longest, and those that live
    /// beside it. False if there is none.
    fn found_markers(&mut self) -> bool {
        let least = (OWN_LIFE * self.take.rate()).ceil() as usize;
        let open = (0..self.fragments.len()).filter(|&at| self.owners[at].is_none());
        let mut long: Vec<usize> = open
            .filter(|&at| self.fragments[at].frame_count() >= least)
            .collect();
        long.sort_by_key(|&at| (usize::MAX - self.fragments[at].frame_count(), at));
        let Some(&first) = long.first() else {
            return false;
        };
        let Fragment { start, end, .. } = self.fragments[first];
        let middle = (start + end) / 2;
        for fragment in long {
            let Fragment { start, end, .. } = self.fragments[fragment];
            if (start..end).contains(&middle) {
                self.add_marker(fragment);
            }
        }
        true
    }

    /// `[markers]`: the neighbours that move most rigidly with each and are near, with weights;
    /// and the mean distance to them.
    fn rings(&self) -> Vec<Ring> {
        let frames = self.frames();
        let markers: Vec<usize> = (0..self.labels.len()).collect();
        in_parallel(&markers, |marker| {
            let own = &self.positions[marker * frames..][..frames];
            let seen: Vec<usize> = (0..frames).filter(|&f| !own[f].is_nan()).collect();
            let stride = seen.len().div_ceil(RING_FRAMES).max(1);
            let mut near: Vec<(f64, f64, usize)> = markers
                .iter()
                .filter(|&&other| other != marker)
                .filter_map(|&other| {
                    let path = &self.positions[other * frames..][..frames];
                    let (mut count, mut mean, mut spread) = (0.0, 0.0, 0.0);
                    for &frame in seen.iter().step_by(stride) {
                        let distance = own[frame].distance(path[frame]);
                        if !distance.is_nan() {
                            count += 1.0;
                            let step = distance - mean;
                            mean += step / count;
                            spread += step * (distance - mean);
                        }
                    }
                    // A distance seen briefly may yet vary.
                    let trust = 0.01 * mean * mean * (1.0 + 3.0 / count);
                    (count > 0.0).then(|| (spread / count + trust, mean, other))
                })
                .collect();
            near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
            near.truncate(RING);
            let nearest = &near[..near.len().min(6)];
            let spacing = nearest.iter().map(|one| one.1).sum::<f64>() / nearest.len() as f64;
            Ring {
                members: near.iter().map(|one| (one.2, one.0.recip())).collect(),
                spacing,
                seen,
            }
        })
    }
}

/// Frames at which a fragment is compared: dense at its ends, where its marker was or will be seen
/// nearby, thin in between.
fn probes(start: usize, end: usize) -> Vec<usize> {
    let len = end - start;
    let steps = std::iter::successors(Some(1), |step| Some(2 * step));
    let steps = steps.take_while(|step| *step < len);
    let mut probes: Vec<usize> = steps
        .flat_map(|step| [start + step, end - 1 - step])
        .chain([start, end - 1])
        .collect();
    probes.sort_unstable();
    probes.dedup();
    probes
}

/// A marker's neighbourhood.
struct Ring {
    /// Neighbours and their weights.
    members: Vec<(usize, f64)>,
    /// Mean distance to the nearest of them, metres.
    spacing: f64,
    /// Frames in which the marker is labelled, ascending.
    seen: Vec<usize>,
}

/// Finds the markers that a fragment may belong to.
struct Candidates<'a> {
    work: &'a Work<'a>,
    rings: &'a [Ring],
    labelled: Labelled<'a>,
}

impl<'a> Candidates<'a> {
    fn new(work: &'a Work<'a>, rings: &'a [Ring]) -> Self {
        let labelled = Labelled {
            positions: &work.positions,
            frames: work.frames(),
        };
        Self {
            work,
            rings,
            labelled,
        }
    }

    /// All markers that are missing throughout the fragment and expected near it.
    fn of(&self, fragment: usize) -> Vec<Pair> {
        let Fragment { start, end, .. } = self.work.fragments[fragment];
        let last = end - 1;
        let probes = probes(start, end);
        let ends = [start, last].map(|frame| (frame, self.work.sample(fragment, frame)));
        let mut known = HashMap::new();
        let mut pairs: Vec<Pair> = (0..self.rings.len())
            .filter(|&marker| self.is_free(marker, start, end) && self.is_near(marker, &ends))
            .filter_map(|marker| self.compare(marker, fragment, &probes, &mut known))
            .collect();
        pairs.sort_by(|a, b| a.mean.total_cmp(&b.mean).then(a.marker.cmp(&b.marker)));
        let second = pairs.get(1).map_or(f64::INFINITY, |pair| pair.mean);
        let first = pairs.first().map_or(f64::INFINITY, |pair| pair.mean);
        for (at, pair) in pairs.iter_mut().enumerate() {
            pair.other = if at == 0 { second } else { first };
        }
        pairs
    }

    fn is_free(&self, marker: usize, start: usize, end: usize) -> bool {
        let seen = &self.rings[marker].seen;
        seen.get(seen.partition_point(|&frame| frame < start))
            .is_none_or(|&frame| frame >= end)
    }

    fn is_near(&self, marker: usize, ends: &[(usize, DVec3); 2]) -> bool {
        let ring = &self.rings[marker];
        ends.iter().any(|&(frame, position)| {
            ring.members.iter().any(|&(neighbour, _)| {
                // NaN compares false: a neighbour out of sight is near nothing.
                self.labelled.at(neighbour, frame).distance(position) < 3.0 * ring.spacing
            })
        })
    }

    fn compare(
        &self,
        marker: usize,
        fragment: usize,
        probes: &[usize],
        known: &mut HashMap<(usize, usize), Option<(DVec3, usize)>>,
    ) -> Option<Pair> {
        let ring = &self.rings[marker];
        let (mut sum, mut worst, mut count, mut support) = (0.0, 0.0_f64, 0_usize, usize::MAX);
        for &frame in probes {
            let expected = known
                .entry((marker, frame))
                .or_insert_with(|| self.expect(marker, frame));
            let Some((expected, neighbours)) = *expected else {
                continue;
            };
            let departure = expected.distance(self.work.sample(fragment, frame)) / ring.spacing;
            if departure > 3.0 {
                return None;
            }
            sum += departure;
            worst = worst.max(departure);
            count += 1;
            support = support.min(neighbours);
        }
        (count >= JUDGED.min(probes.len())).then(|| Pair {
            fragment,
            marker,
            mean: sum / count as f64,
            worst,
            support,
            other: f64::INFINITY,
        })
    }

    /// Carried from the last and the next sight, the nearer counting more.
    fn expect(&self, marker: usize, frame: usize) -> Option<(DVec3, usize)> {
        let ring = &self.rings[marker];
        let next = ring.seen.partition_point(|&seen| seen < frame);
        let sights = [next.checked_sub(1), Some(next)];
        let mut found: Option<(DVec3, f64, usize)> = None;
        for sight in sights.into_iter().flatten() {
            let Some(&from) = ring.seen.get(sight) else {
                continue;
            };
            let Some((position, support)) =
                carry(&self.labelled, &ring.members, marker, from, frame)
            else {
                continue;
            };
            let weight = (from.abs_diff(frame) as f64 + 1.0).recip();
            let (sum, total, least) = found.unwrap_or((DVec3::ZERO, 0.0, usize::MAX));
            found = Some((sum + weight * position, total + weight, least.min(support)));
        }
        if found.is_none() {
            // Neither end shares three neighbours: the middle of its life may.
            let &from = ring.seen.get(ring.seen.len() / 2)?;
            return carry(&self.labelled, &ring.members, marker, from, frame);
        }
        found.map(|(sum, total, support)| (sum / total, support))
    }
}
