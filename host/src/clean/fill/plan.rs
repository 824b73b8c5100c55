//! Which gaps are filled when, from which neighbours.
//!
//! Gaps with enough measured neighbours come first; what they give then helps the others, with
//! the weight that its uncertainty leaves it.

use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;

use super::super::neighbours::{Neighbour, rank};
use super::drift::Drift;
use super::regression::Model;
use super::trust::Trust;
use super::view::View;
use super::window::{Sources, clusters, solve};
use super::{Cluster, Filled};

/// Neighbours in a regression.
const SET: usize = 8;
/// Candidates for them.
const CANDIDATES: usize = 24;
/// Rounds: from measured neighbours, then from estimated ones too.
const ROUNDS: usize = 3;
/// A set of neighbours for a whole gap is kept if it is this good, over the best of each frame.
const ENOUGH: f64 = 0.5;

/// A filled sample: frame, metres, standard deviation an axis, and whether only measured
/// neighbours stand behind it.
type Sample = (usize, DVec3, f64, bool);

/// Fills `markers`, in rounds; within a round no marker sees another's new samples, so that the
/// order of the threads does not matter.
pub(super) fn run(
    filled: &mut Filled,
    markers: &[usize],
    limit: f64,
    progress: &(dyn Fn() + Sync),
) {
    let mut open: Vec<usize> = markers.to_vec();
    open.retain(|&marker| filled.take.missing_count(marker) > 0);
    for _ in open.len()..markers.len() {
        progress();
    }
    let trust = Trust::learn(&filled.view(), &open);
    for round in 0..ROUNDS {
        let last = round + 1 == ROUNDS;
        let found = in_parallel(&open, |marker| {
            let mut samples = fill_marker(&filled.view(), marker, round > 0);
            trusted(&mut samples, trust);
            let settled = samples.iter().all(|sample| sample.3);
            if settled || last {
                progress();
            }
            (samples, settled)
        });
        let mut unsettled = Vec::new();
        for (&marker, (samples, settled)) in open.iter().zip(found) {
            for (frame, position, sigma, _) in samples {
                if sigma <= limit {
                    filled.set(marker, frame, position, sigma.max(1e-6));
                }
            }
            if !settled {
                unsettled.push(marker);
            }
        }
        open = unsettled;
    }
}

/// Applies `work` to each item on all processors; results in the order of the items.
pub(crate) fn in_parallel<T: Send>(items: &[usize], work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let next = AtomicUsize::new(0);
    let run = || {
        let mut done = Vec::new();
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(&item) = items.get(at) else {
                return done;
            };
            done.push((at, work(item)));
        }
    };
    let mut all: Vec<(usize, T)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.min(items.len()))
            .map(|_| scope.spawn(run))
            .collect();
        let joined = workers.into_iter().flat_map(|worker| {
            worker
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        });
        joined.collect()
    });
    all.sort_by_key(|(at, _)| *at);
    all.into_iter().map(|(_, value)| value).collect()
}

/// Widens the deviations of samples, which ascend, by what those of their gap are short of.
fn trusted(samples: &mut [Sample], trust: Trust) {
    for gap in samples.chunk_by_mut(|a, b| a.0 + 1 == b.0) {
        let factor = trust.factor(gap.len());
        for sample in gap {
            sample.2 *= factor;
        }
    }
}

pub(super) fn fill_marker(view: &View<'_>, marker: usize, estimates: bool) -> Vec<Sample> {
    let mut ranked = rank(view, marker);
    ranked.truncate(CANDIDATES);
    let mut bench = Bench {
        view,
        marker,
        ranked,
        models: Vec::new(),
        known: HashMap::new(),
        course: None,
    };
    let mut samples = Vec::new();
    for cluster in clusters(view, marker) {
        samples.extend(bench.fill(cluster, estimates));
    }
    samples
}

/// The models of one marker.
struct Bench<'a> {
    view: &'a View<'a>,
    marker: usize,
    ranked: Vec<Neighbour>,
    models: Vec<(Model, Drift)>,
    /// Sets (as bits over `ranked`) that were tried: which model came of it.
    known: HashMap<u32, Option<usize>>,
    /// Course of the error over time, from the first model learned, a unit of variance.
    course: Option<Drift>,
}

impl Bench<'_> {
    fn fill(&mut self, cluster: Cluster, estimates: bool) -> Vec<Sample> {
        let missing: Vec<usize> = cluster
            .filter(|&frame| !self.view.is_measured(self.marker, frame))
            .collect();
        let sets = self.sets(&missing, estimates);
        let mut models = Vec::with_capacity(missing.len());
        for set in sets {
            models.push(self.model(set));
        }
        let sources = Sources {
            view: self.view,
            marker: self.marker,
            models: &self.models,
        };
        solve(&sources, &missing, &models)
            .into_iter()
            .zip(models)
            .map(|((frame, position, sigma), model)| {
                (frame, position, sigma, model.is_some() && !estimates)
            })
            .collect()
    }

    /// Bits over `ranked` of the neighbours that are known in a frame.
    fn available(&self, frame: usize, estimates: bool) -> u32 {
        let known = |neighbour: &Neighbour| {
            let sigma = self.view.sigma(neighbour.marker, frame);
            sigma == 0.0 || estimates && sigma.is_finite()
        };
        let each = self.ranked.iter().enumerate();
        each.fold(0, |bits, (at, neighbour)| {
            bits | u32::from(known(neighbour)) << at
        })
    }

    fn precision(&self, set: u32) -> f64 {
        let each = self.ranked.iter().enumerate();
        each.filter(|(at, _)| set >> at & 1 == 1)
            .map(|(_, neighbour)| (neighbour.variance + 1e-6).recip())
            .sum()
    }

    /// A set for each missing frame: as few different ones as the visibility allows.
    fn sets(&self, missing: &[usize], estimates: bool) -> Vec<u32> {
        let available: Vec<u32> = missing
            .iter()
            .map(|&frame| self.available(frame, estimates))
            .collect();
        let mut sets = Vec::with_capacity(missing.len());
        while sets.len() < missing.len() {
            // The longest stretch from here on for which one set is good enough everywhere.
            let from = sets.len();
            let mut common = available[from];
            let mut best = self.precision(lowest(common));
            let mut end = from + 1;
            while end < missing.len() {
                let next = common & available[end];
                let wanted = best.max(self.precision(lowest(available[end])));
                let set = lowest(next);
                let poorer = set.count_ones() < 4 && set != lowest(available[end]);
                if self.precision(set) < ENOUGH * wanted || poorer {
                    break;
                }
                (common, best) = (next, wanted);
                end += 1;
            }
            sets.resize(end, lowest(common));
        }
        sets
    }

    /// The model of a set, learned when first asked for. Where too few frames show all of the set,
    /// its worst members are left out.
    fn model(&mut self, set: u32) -> Option<usize> {
        if let Some(&known) = self.known.get(&set) {
            return known;
        }
        let chosen = self.ranked.iter().enumerate();
        let mut members: Vec<Neighbour> = chosen
            .filter(|(at, _)| set >> at & 1 == 1)
            .map(|(_, neighbour)| *neighbour)
            .collect();
        let mut found = None;
        while !members.is_empty() {
            let model = Model::learn(self.view, self.marker, &members);
            if let Some(model) = model.filter(|model| model.residuals.len() >= LEAST_FRAMES) {
                found = Some(model);
                break;
            }
            members.pop();
        }
        let index = found.map(|model| {
            let variance = model.variance.max(1e-12);
            let rate = self.view.take.rate();
            let course = *self.course.get_or_insert_with(|| {
                Drift::fit(&model.residuals, variance, rate).scaled_unit(variance)
            });
            self.models.push((model, course.scaled(variance)));
            self.models.len() - 1
        });
        self.known.insert(set, index);
        index
    }
}

/// Frames that a model must have been tested on.
const LEAST_FRAMES: usize = 20;

/// The first [`SET`] bits that are set.
fn lowest(mut bits: u32) -> u32 {
    let mut set = 0;
    for _ in 0..SET {
        let bit = bits & bits.wrapping_neg();
        set |= bit;
        bits ^= bit;
    }
    set
}
