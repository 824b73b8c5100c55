//! A marker's position from its neighbours: a local frame, then ridge regression.
//!
//! The frame follows the most rigid neighbours; in it, what is left of the neighbours' motion
//! predicts what is left of the marker's. The ridge weight is chosen, and the error is measured,
//! on stretches of time that the regression has not seen.

use glam::DVec3;

use super::super::linear::Cholesky;
use super::super::neighbours::Neighbour;
use super::super::rigid::Rigid;
use super::view::View;

/// Frames to learn from, at most.
const FRAMES: usize = 1200;
/// Frames in a row where not all are taken, so that the course of the error over short times
/// shows as well.
const RUN: usize = 8;
/// Stretches of time that take turns at being left out.
const FOLDS: usize = 6;
/// Ridge weights that are tried, over the mean variance of a feature.
const RIDGES: [f64; 7] = [1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 100.0];
/// Seconds within which frames repeat each other.
const CORRELATED: f64 = 0.25;
/// Variance, square metres, by which a rigid distance is expected to vary anyhow.
const NOISE: f64 = 1e-6;

/// Frame, fold, and what was left of the marker's position in the local frame.
pub(crate) type Residual = (usize, usize, DVec3);

/// Predicts one marker from a set of neighbours.
pub(crate) struct Model {
    pub set: Vec<usize>,
    /// `[set]`: weight of each neighbour in the local frame.
    pub weights: Vec<f64>,
    /// `[set]`: the neighbours' mean positions in the local frame.
    pub shape: Vec<DVec3>,
    /// Mean position of the marker in the local frame.
    pub home: DVec3,
    /// `[3 set x 3]`: from the neighbours' departures to the marker's.
    pub coefficients: Vec<f64>,
    /// Normal matrix with its ridge, factored, over the number of independent frames: how far a
    /// frame is from those learned.
    familiar: Option<(Cholesky, f64)>,
    /// Residuals of frames left out when predicting them: (frame, fold, local residual), in order.
    pub residuals: Vec<Residual>,
    /// Mean square of the residuals an axis, square metres.
    pub variance: f64,
}

/// A prediction in one frame.
pub(crate) struct Prediction {
    /// Metres, the take's space.
    pub position: DVec3,
    /// From the local frame to the take's space.
    pub pose: Rigid,
    /// Variance an axis that comes from neighbours which are themselves estimated, and from a pose
    /// unlike those learned.
    pub inherited: f64,
}

impl Model {
    /// Learns from the frames in which `marker` is measured and all of `set` is known; `None` if
    /// there are fewer than four of them. Linear in frames, cubic in the set.
    pub fn learn(view: &View<'_>, marker: usize, set: &[Neighbour]) -> Option<Self> {
        let members: Vec<usize> = set.iter().map(|neighbour| neighbour.marker).collect();
        let known = |&frame: &usize| {
            view.is_measured(marker, frame)
                && members
                    .iter()
                    .all(|&member| view.is_measured(member, frame))
        };
        let all: Vec<usize> = (0..view.take.frame_count()).filter(known).collect();
        if all.len() < 4 || members.is_empty() {
            return None;
        }
        let stride = all.len().div_ceil(FRAMES);
        let runs = all.chunks(RUN * stride);
        let frames: Vec<usize> = runs.flat_map(|run| run.iter().take(RUN)).copied().collect();
        let weights: Vec<f64> = if set.len() < 3 {
            vec![1.0; set.len()]
        } else {
            let weigh = |neighbour: &Neighbour| (neighbour.variance + NOISE).recip();
            set.iter().map(weigh).collect()
        };
        let mut model = Self {
            shape: mean_shape(view, &members, &weights, &frames),
            set: members,
            weights,
            home: DVec3::ZERO,
            coefficients: Vec::new(),
            familiar: None,
            residuals: Vec::new(),
            variance: 0.0,
        };
        model.regress(view, marker, &frames);
        Some(model)
    }

    fn regress(&mut self, view: &View<'_>, marker: usize, frames: &[usize]) {
        let width = 3 * self.set.len();
        let mut rows = Vec::with_capacity(frames.len());
        for &frame in frames {
            let Some(pose) = self.pose(view, frame) else {
                continue;
            };
            let local = pose.inverse();
            let target = local.apply(view.trajectory(marker)[frame]);
            rows.push((frame, self.features(view, frame, &local), target));
        }
        let count = rows.len() as f64;
        self.home = rows.iter().map(|row| row.2).sum::<DVec3>() / count;
        let mut folds = vec![Normal::new(width); FOLDS];
        let fold_of = |at: usize| at * FOLDS / rows.len();
        for (at, (_, features, target)) in rows.iter().enumerate() {
            folds[fold_of(at)].add(features, *target - self.home);
        }
        let mut whole = Normal::new(width);
        for fold in &folds {
            whole.merge(fold, 1.0);
        }
        let unit = whole.mean_square().max(1e-12) * count;
        let mut best: Option<(f64, f64, Vec<Residual>)> = None;
        for ridge in RIDGES {
            let left_out: Vec<Option<Vec<f64>>> = folds
                .iter()
                .map(|fold| {
                    let mut rest = whole.clone();
                    rest.merge(fold, -1.0);
                    Some(rest.solve(ridge * unit)?.1)
                })
                .collect();
            let mut residuals = Vec::with_capacity(rows.len());
            for (at, (frame, features, target)) in rows.iter().enumerate() {
                let fold = fold_of(at);
                let Some(coefficients) = &left_out[fold] else {
                    continue;
                };
                let predicted = self.home + product(coefficients, features);
                residuals.push((*frame, fold, *target - predicted));
            }
            let sum: f64 = residuals.iter().map(|(_, _, r)| r.length_squared()).sum();
            let variance = sum / (3.0 * residuals.len() as f64);
            if variance.is_finite() && best.as_ref().is_none_or(|best| variance < best.0) {
                best = Some((variance, ridge, residuals));
            }
        }
        self.coefficients = vec![0.0; 3 * width];
        let Some((variance, ridge, residuals)) = best else {
            return;
        };
        (self.variance, self.residuals) = (variance, residuals);
        if let Some((factor, coefficients)) = whole.solve(ridge * unit) {
            self.coefficients = coefficients;
            // Frames of one quarter of a second say the same thing.
            let spanned = frames[frames.len() - 1] - frames[0] + 1;
            let density = (frames.len() as f64 / spanned as f64).min(1.0);
            self.familiar = Some((factor, (CORRELATED * view.take.rate() * density).max(1.0)));
        }
    }

    /// From the local frame to the take's space; `None` if a neighbour is missing.
    fn pose(&self, view: &View<'_>, frame: usize) -> Option<Rigid> {
        if self
            .set
            .iter()
            .any(|&member| view.sigma(member, frame).is_nan())
        {
            return None;
        }
        fit_pose(view, &self.set, &self.weights, &self.shape, frame)
    }

    fn features(&self, view: &View<'_>, frame: usize, local: &Rigid) -> Vec<f64> {
        let departures = self
            .set
            .iter()
            .zip(&self.shape)
            .flat_map(|(&member, home)| {
                (local.apply(view.trajectory(member)[frame]) - *home).to_array()
            });
        departures.collect()
    }

    /// Where the neighbours of one frame expect the marker; `None` if one is missing.
    pub fn predict(&self, view: &View<'_>, frame: usize) -> Option<Prediction> {
        let pose = self.pose(view, frame)?;
        let features = self.features(view, frame, &pose.inverse());
        let position = pose.apply(self.home + product(&self.coefficients, &features));
        let total: f64 = self.weights.iter().sum();
        let inherited = self.set.iter().enumerate().map(|(at, &member)| {
            let rows = &self.coefficients[9 * at..9 * at + 9];
            let gain = rows.iter().map(|value| value * value).sum::<f64>() / 3.0;
            let share = self.weights[at] / total;
            (gain + share) * view.sigma(member, frame).powi(2)
        });
        let unlike = self.familiar.as_ref().map_or(0.0, |(factor, correlated)| {
            let mut right = features.clone();
            factor.solve(&mut right, 1);
            let leverage: f64 = right.iter().zip(&features).map(|(a, b)| a * b).sum();
            leverage * correlated * self.variance
        });
        Some(Prediction {
            position,
            pose,
            inherited: inherited.sum::<f64>() + unlike,
        })
    }
}

/// The rigid motion of a frame; fewer than three points fix no rotation, so none is assumed.
fn fit_pose(
    view: &View<'_>,
    set: &[usize],
    weights: &[f64],
    shape: &[DVec3],
    frame: usize,
) -> Option<Rigid> {
    let pairs = set
        .iter()
        .zip(weights)
        .zip(shape)
        .map(|((&member, &weight), &home)| (home, view.trajectory(member)[frame], weight));
    if set.len() >= 3 {
        return Rigid::fit(pairs);
    }
    let offsets = pairs.map(|(home, position, _)| position - home);
    Some(Rigid {
        translation: offsets.sum::<DVec3>() / set.len() as f64,
        ..Rigid::IDENTITY
    })
}

/// Mean positions of the set in its own frame (two rounds of Procrustes's alignment).
fn mean_shape(view: &View<'_>, set: &[usize], weights: &[f64], frames: &[usize]) -> Vec<DVec3> {
    let positions = |frame: usize| set.iter().map(move |&m| view.trajectory(m)[frame]);
    let middle = frames[frames.len() / 2];
    let mut shape: Vec<DVec3> = positions(middle).collect();
    for _ in 0..2 {
        let mut sums = vec![DVec3::ZERO; set.len()];
        for &frame in frames {
            let Some(pose) = fit_pose(view, set, weights, &shape, frame) else {
                continue;
            };
            let local = pose.inverse();
            for (sum, position) in sums.iter_mut().zip(positions(frame)) {
                *sum += local.apply(position);
            }
        }
        shape = sums.iter().map(|sum| *sum / frames.len() as f64).collect();
    }
    shape
}

/// `[width x 3]` coefficients times `[width]` features.
fn product(coefficients: &[f64], features: &[f64]) -> DVec3 {
    let rows = coefficients.chunks_exact(3).zip(features);
    rows.map(|(row, feature)| DVec3::from_slice(row) * *feature)
        .sum()
}

/// Normal equations of a regression onto three targets.
#[derive(Clone)]
struct Normal {
    width: usize,
    /// `[width x width]`, lower half.
    gram: Vec<f64>,
    /// `[width x 3]`.
    right: Vec<f64>,
    count: f64,
}

impl Normal {
    fn new(width: usize) -> Self {
        Self {
            width,
            gram: vec![0.0; width * width],
            right: vec![0.0; 3 * width],
            count: 0.0,
        }
    }

    fn add(&mut self, features: &[f64], target: DVec3) {
        self.count += 1.0;
        for (row, &feature) in features.iter().enumerate() {
            let gram = &mut self.gram[row * self.width..=row * self.width + row];
            for (sum, other) in gram.iter_mut().zip(features) {
                *sum += feature * other;
            }
            for (sum, value) in self.right[3 * row..].iter_mut().zip(target.to_array()) {
                *sum += feature * value;
            }
        }
    }

    fn merge(&mut self, other: &Self, sign: f64) {
        self.count += sign * other.count;
        for (sum, value) in self.gram.iter_mut().zip(&other.gram) {
            *sum += sign * value;
        }
        for (sum, value) in self.right.iter_mut().zip(&other.right) {
            *sum += sign * value;
        }
    }

    fn mean_square(&self) -> f64 {
        let trace = (0..self.width).map(|at| self.gram[at * self.width + at]);
        trace.sum::<f64>() / (self.width as f64 * self.count)
    }

    fn solve(mut self, ridge: f64) -> Option<(Cholesky, Vec<f64>)> {
        for at in 0..self.width {
            self.gram[at * self.width + at] += ridge;
        }
        let factor = Cholesky::new(self.width, self.gram)?;
        factor.solve(&mut self.right, 3);
        Some((factor, self.right))
    }
}
