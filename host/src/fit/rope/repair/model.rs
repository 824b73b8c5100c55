//! What a marker's neighbours tell about it.

use glam::DVec3;

use super::super::median;
use super::{ANCHORS, Gap, Grid, RepairOptions};
use crate::clean::linear::Cholesky;

/// A marker as a sum of its neighbours, and the statistics of what they leave open.
pub(super) struct Model {
    marker: usize,
    supports: Vec<usize>,
    stride: usize,
    weights: Vec<f64>,
    /// `[lags]`: autocovariance of one coordinate of the residual, square metres.
    covariance: Vec<f64>,
}

/// Metres a unit of the constant that stands for gravity.
const SAG: f64 = 0.02;

impl Model {
    pub(super) fn learn(
        grid: &Grid,
        gap: &Gap,
        supports: Vec<usize>,
        stride: usize,
        options: &RepairOptions,
    ) -> Option<Self> {
        let memory = (options.memory * grid.rate) as usize;
        let window =
            gap.frames.start.saturating_sub(memory)..(gap.frames.end + memory).min(grid.frames);
        let mut model = Self {
            marker: gap.marker,
            supports,
            stride,
            weights: Vec::new(),
            covariance: Vec::new(),
        };
        model.weights = model.curve(&grid.arc);
        let usable: Vec<usize> = window
            .clone()
            .filter(|&frame| grid.known[gap.marker][frame] && model.is_supported(grid, frame))
            .collect();
        if usable.len() > model.weights.len() {
            model.regress(grid, &usable);
        }
        model.covariance = model.residual_covariance(grid, &usable, gap.frames.len() + 2 * ANCHORS);
        Some(model)
    }

    fn is_supported(&self, grid: &Grid, frame: usize) -> bool {
        let from = frame.saturating_sub(self.stride);
        let to = (frame + self.stride).min(grid.frames - 1);
        let known = |&support: &usize| {
            let known = &grid.known[support];
            known[from] && known[frame] && known[to]
        };
        self.supports.iter().all(known)
    }

    /// The middle of the two nearest supports, or the nearest.
    fn anchor(&self, grid: &Grid, frame: usize) -> DVec3 {
        let near = &self.supports[..self.supports.len().min(2)];
        near.iter().map(|&s| grid.position[s][frame]).sum::<DVec3>() / near.len() as f64
    }

    /// Features of a frame, each a vector: supports now, before, after; gravity's direction.
    fn features(&self, grid: &Grid, frame: usize, out: &mut Vec<DVec3>) -> DVec3 {
        let anchor = self.anchor(grid, frame);
        let before = frame.saturating_sub(self.stride);
        let after = (frame + self.stride).min(grid.frames - 1);
        out.clear();
        out.extend(
            self.supports
                .iter()
                .map(|&s| grid.position[s][frame] - anchor),
        );
        for &support in &self.supports {
            let track = &grid.position[support];
            // Velocity and bend in time, rather than past and future: less alike.
            out.push(track[after] - track[before]);
            out.push(track[after] - 2.0 * track[frame] + track[before]);
        }
        out.push(DVec3::Y * SAG);
        anchor
    }

    /// Weights of the polynomial through the supports (Lagrange), which sum to one; zero for all
    /// but the present.
    fn curve(&self, arc: &[f64]) -> Vec<f64> {
        let place = arc[self.marker];
        let is_inside = self.supports.iter().any(|&s| s < self.marker)
            && self.supports.iter().any(|&s| s > self.marker);
        let mut weights = vec![0.0; 3 * self.supports.len() + 1];
        // A polynomial beyond its last point runs away: there, a straight line.
        let used = if is_inside {
            self.supports.len()
        } else {
            self.supports.len().min(2)
        };
        for (k, &own) in self.supports[..used].iter().enumerate() {
            let others = self.supports[..used].iter().filter(|&&s| s != own);
            weights[k] = others
                .map(|&other| (place - arc[other]) / (arc[own] - arc[other]))
                .product();
        }
        weights
    }

    /// Ridge regression toward the present weights.
    fn regress(&mut self, grid: &Grid, frames: &[usize]) {
        let count = self.weights.len();
        let mut normal = vec![0.0; count * count];
        let mut right = vec![0.0; count];
        let mut features = Vec::with_capacity(count);
        for &frame in frames {
            let anchor = self.features(grid, frame, &mut features);
            let target = grid.position[self.marker][frame] - anchor;
            let guess: DVec3 = features
                .iter()
                .zip(&self.weights)
                .map(|(f, w)| *f * *w)
                .sum();
            let off = target - guess;
            for (i, a) in features.iter().enumerate() {
                right[i] += a.dot(off);
                for (j, b) in features.iter().enumerate().take(i + 1) {
                    normal[i * count + j] += a.dot(*b);
                }
            }
        }
        // The noise of the features themselves is already in their squares; as much again keeps
        // directions that only noise has moved from gaining weight.
        let ridge = 3.0 * frames.len() as f64 * grid.noise.powi(2) + 1e-12;
        for i in 0..count {
            normal[i * count + i] += ridge;
        }
        if let Some(factor) = Cholesky::new(count, normal) {
            factor.solve(&mut right, 1);
            for (weight, change) in self.weights.iter_mut().zip(right) {
                *weight += change;
            }
        }
    }

    fn estimate(&self, grid: &Grid, frame: usize, features: &mut Vec<DVec3>) -> DVec3 {
        let anchor = self.features(grid, frame, features);
        let sum: DVec3 = features
            .iter()
            .zip(&self.weights)
            .map(|(f, w)| *f * *w)
            .sum();
        anchor + sum
    }

    /// Biased, so that it stays positive definite where samples are missing.
    fn residual_covariance(&self, grid: &Grid, frames: &[usize], lags: usize) -> Vec<f64> {
        let mut features = Vec::new();
        let mut residual = vec![None; grid.frames];
        for &frame in frames {
            let off = grid.position[self.marker][frame] - self.estimate(grid, frame, &mut features);
            residual[frame] = Some(off);
        }
        let mut covariance = vec![0.0; lags + 1];
        for &frame in frames {
            let Some(here) = residual[frame] else {
                continue;
            };
            for (lag, sum) in covariance.iter_mut().enumerate() {
                if let Some(Some(there)) = residual.get(frame + lag) {
                    *sum += here.dot(*there);
                }
            }
        }
        let count = 3.0 * frames.len().max(1) as f64;
        for sum in &mut covariance {
            *sum /= count;
        }
        // Without anything learned: an error of a tenth of the spacing that lasts.
        if frames.len() < 8 {
            let error = 0.1 * median(grid.arc.windows(2).map(|w| w[1] - w[0]).collect());
            for (lag, value) in covariance.iter_mut().enumerate() {
                let faded = (lag as f64 / (0.1 * grid.rate)).powi(2);
                *value = error * error * (-0.5 * faded).exp();
            }
        }
        covariance[0] = covariance[0].max(grid.noise.powi(2));
        covariance
    }

    fn covariance(&self, a: usize, b: usize) -> f64 {
        self.covariance.get(a.abs_diff(b)).copied().unwrap_or(0.0)
    }

    /// The gap's samples: (frame, position, standard deviation).
    pub(super) fn bridge(&self, grid: &Grid, gap: &Gap) -> Vec<(usize, DVec3, f64)> {
        let mut features = Vec::new();
        let is_anchor =
            |&frame: &usize| grid.known[gap.marker][frame] && self.is_supported(grid, frame);
        let before = gap.frames.start.saturating_sub(ANCHORS)..gap.frames.start;
        let after = gap.frames.end..(gap.frames.end + ANCHORS).min(grid.frames);
        let anchors: Vec<usize> = before.chain(after).filter(is_anchor).collect();
        let count = anchors.len();
        let mut matrix = vec![0.0; count * count];
        for (i, &a) in anchors.iter().enumerate() {
            for (j, &b) in anchors.iter().enumerate().take(i + 1) {
                matrix[i * count + j] = self.covariance(a, b);
            }
            matrix[i * count + i] += 0.01 * self.covariance[0] + grid.noise.powi(2) * 0.1;
        }
        let residuals: Vec<DVec3> = anchors
            .iter()
            .map(|&f| grid.position[self.marker][f] - self.estimate(grid, f, &mut features))
            .collect();
        let factor = if count > 0 {
            Cholesky::new(count, matrix)
        } else {
            None
        };
        gap.frames
            .clone()
            .map(|frame| {
                let mut position = self.estimate(grid, frame, &mut features);
                let mut variance = self.covariance[0];
                if let Some(factor) = &factor {
                    let lags: Vec<f64> =
                        anchors.iter().map(|&a| self.covariance(a, frame)).collect();
                    let mut gains = lags.clone();
                    factor.solve(&mut gains, 1);
                    for ((gain, lag), residual) in gains.iter().zip(&lags).zip(&residuals) {
                        position += *residual * *gain;
                        variance -= gain * lag;
                    }
                }
                (frame, position, (3.0 * variance.max(0.0)).sqrt())
            })
            .collect()
    }
}
