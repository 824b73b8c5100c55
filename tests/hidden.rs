//! Stretches that were measured, hidden and filled again: how far off is what was filled?

use sinew_host::clean::fill::{FillMethod, FillOptions, fill_markers};
use sinew_host::import::take::{TakeOptions, read_take};
use sinew_host::take::Take;

use crate::{Random, shared};

/// The default, and what it is compared with.
pub const METHODS: [FillMethod; 4] = [
    FillMethod::Regression,
    FillMethod::Pca,
    FillMethod::Spline,
    FillMethod::Linear,
];

/// A recording of `../shared/data`, or `None` (after saying so) where it is absent.
///
/// # Panics
/// When it is no capture.
#[must_use]
pub fn take(file: &str) -> Option<Take> {
    let raw = read_take(shared(file)?, &TakeOptions::default()).expect("a capture");
    Some(Take::from_raw(&raw).expect("a sound capture").0)
}

/// A stretch of one marker: index, first frame.
pub type Stretch = (usize, usize);

/// Up to `placements` random stretches of each marker, measured throughout and on either side.
#[must_use]
pub fn stretches(take: &Take, length: usize, placements: usize, seed: u64) -> Vec<Stretch> {
    let mut random = Random(seed);
    let mut chosen = Vec::new();
    for marker in 0..take.marker_count() {
        let starts: Vec<usize> = take
            .traces(marker)
            .flat_map(|trace| {
                // A sample stays measured on either side.
                (trace.start + 1)..(trace.end.saturating_sub(length + 1)).max(trace.start + 1)
            })
            .collect();
        if starts.is_empty() {
            continue;
        }
        for _ in 0..placements {
            chosen.push((marker, starts[random.below(starts.len())]));
        }
    }
    chosen
}

/// Errors of one method.
#[derive(Clone, Debug, Default)]
pub struct Errors {
    /// Metres, every hidden sample.
    pub metres: Vec<f64>,
    /// The same over the mean distance of markers to their nearest neighbour.
    pub relative: Vec<f64>,
    /// Error over stated deviation, squared, an axis.
    pub calibration: Vec<f64>,
}

impl Errors {
    /// Mean error in metres.
    #[must_use]
    pub fn mean(&self) -> f64 {
        mean(&self.metres)
    }

    /// Error in metres that this share of the samples stays below.
    #[must_use]
    pub fn quantile(&self, share: f64) -> f64 {
        quantile(&self.metres, share)
    }
}

/// Arithmetic mean.
#[must_use]
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The value that this share of `values` stays below; NaN without any.
#[must_use]
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = (sorted.len().saturating_sub(1)) as f64 * share;
    sorted.get(at as usize).copied().unwrap_or(f64::NAN)
}

/// Hides each stretch alone and fills it with each of [`METHODS`], on all processors.
///
/// # Panics
/// When a method leaves a sample missing.
#[must_use]
pub fn judge(take: &Take, hidden: &[Stretch], length: usize) -> Vec<Errors> {
    judge_against(take, take, hidden, length)
}

/// [`judge`], against another take of the same markers: the truth of a virtual capture.
///
/// # Panics
/// When a method leaves a sample missing.
#[must_use]
pub fn judge_against(take: &Take, truth: &Take, hidden: &[Stretch], length: usize) -> Vec<Errors> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let parts: Vec<Vec<Errors>> = std::thread::scope(|scope| {
        let chunks = hidden.chunks(hidden.len().div_ceil(threads).max(1));
        let workers: Vec<_> = chunks
            .map(|part| scope.spawn(move || judge_part(take, truth, part, length)))
            .collect();
        let joined = workers.into_iter().map(|worker| worker.join());
        joined.map(|part| part.expect("a judge")).collect()
    });
    let mut all = vec![Errors::default(); METHODS.len()];
    for (whole, part) in parts
        .into_iter()
        .flat_map(|part| part.into_iter().enumerate())
    {
        all[whole].append(part);
    }
    all
}

impl Errors {
    /// Takes over all of `other`.
    pub fn append(&mut self, mut other: Self) {
        self.metres.append(&mut other.metres);
        self.relative.append(&mut other.relative);
        self.calibration.append(&mut other.calibration);
    }
}

fn judge_part(take: &Take, truth: &Take, hidden: &[Stretch], length: usize) -> Vec<Errors> {
    let mut all = vec![Errors::default(); METHODS.len()];
    let mut broken = take.clone();
    for &(marker, start) in hidden {
        let frames = start..start + length;
        let spacing = truth.mean_neighbour_distance(start).unwrap_or(f64::NAN);
        for frame in frames.clone() {
            broken.set_position(marker, frame, None);
        }
        for (errors, method) in all.iter_mut().zip(METHODS) {
            let options = FillOptions {
                method,
                limit: f64::INFINITY,
            };
            let filled = fill_markers(&broken, &[marker], &options, &|| {});
            for frame in frames.clone() {
                let position = filled.take.position(marker, frame).expect("filled");
                let error = position.distance(truth.trajectory(marker)[frame]);
                errors.metres.push(error);
                errors.relative.push(error / spacing);
                let sigma = f64::from(filled.sigma(marker, frame));
                errors
                    .calibration
                    .push(error * error / (3.0 * sigma * sigma));
            }
        }
        for frame in frames {
            broken.set_position(marker, frame, take.position(marker, frame));
        }
    }
    all
}
