//! How the error of a prediction wanders over time.
//!
//! Soft tissue, and what the regression does not know, make the error drift; noise of the
//! neighbours makes it jump. The variogram of left-out residuals tells how much of each.

use glam::DVec3;

use super::super::linear::Cholesky;

/// An error an axis: white noise, a smooth fast part (Matern 3/2) and a slow one (exponential).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drift {
    /// Variance of the noise, square metres.
    pub white: f64,
    /// Variance of the fast part.
    pub fast: f64,
    /// Its length scale, frames.
    pub fast_time: f64,
    /// Variance of the slow part.
    pub slow: f64,
    /// Its length scale, frames.
    pub slow_time: f64,
}

/// Length scales that are tried, seconds.
const FAST_TIMES: [f64; 5] = [0.03, 0.06, 0.12, 0.25, 0.5];
const SLOW_TIMES: [f64; 4] = [0.5, 1.0, 3.0, 10.0];
/// Longest lag looked at, seconds.
const LONGEST: f64 = 3.0;
/// Least variance, square metres: a hundredth of a millimetre of noise.
const LEAST: f64 = 1e-10;

impl Drift {
    /// Fits residuals (frame, fold, residual; frames ascending) by weighted least squares on their
    /// variogram, with parts that are not negative. Linear in residuals and lags.
    pub fn fit(residuals: &[(usize, usize, DVec3)], variance: f64, rate: f64) -> Self {
        let lags = variogram(residuals, (LONGEST * rate) as usize);
        if lags.is_empty() {
            return Self::plain(variance, rate);
        }
        let mut best = (f64::INFINITY, Self::plain(variance, rate));
        for fast_time in FAST_TIMES.map(|time| time * rate) {
            for slow_time in SLOW_TIMES.map(|time| time * rate) {
                let rows: Vec<([f64; 3], f64, f64)> = lags
                    .iter()
                    .map(|&(lag, value)| {
                        let terms = [
                            1.0,
                            1.0 - matern(lag / fast_time),
                            1.0 - (-lag / slow_time).exp(),
                        ];
                        (terms, value, (value + LEAST).recip())
                    })
                    .chain([([1.0; 3], variance, 2.0 / (variance + LEAST))])
                    .collect();
                if let Some((error, [white, fast, slow])) = not_negative(&rows)
                    && error < best.0
                {
                    let drift = Self {
                        white,
                        fast,
                        fast_time,
                        slow,
                        slow_time,
                    };
                    best = (error, drift);
                }
            }
        }
        best.1.floored()
    }

    /// Half smooth, half slow: what is assumed without data.
    fn plain(variance: f64, rate: f64) -> Self {
        Self {
            white: 0.02 * variance,
            fast: 0.49 * variance,
            fast_time: 0.12 * rate,
            slow: 0.49 * variance,
            slow_time: rate,
        }
    }

    fn floored(self) -> Self {
        Self {
            white: self.white.max(LEAST),
            fast: self.fast.max(LEAST),
            slow: self.slow.max(LEAST),
            ..self
        }
    }

    /// The same course for a total of one.
    pub fn scaled_unit(self, variance: f64) -> Self {
        let factor = variance.recip();
        Self {
            white: self.white * factor,
            fast: self.fast * factor,
            slow: self.slow * factor,
            ..self
        }
    }

    /// The same course with another total variance.
    pub fn scaled(self, factor: f64) -> Self {
        Self {
            white: self.white * factor,
            fast: self.fast * factor,
            slow: self.slow * factor,
            ..self
        }
        .floored()
    }
}

fn matern(x: f64) -> f64 {
    let x = 3f64.sqrt() * x;
    (1.0 + x) * (-x).exp()
}

/// Half the mean squared difference an axis at lags 1, 2, 4, ... frames, within folds.
fn variogram(residuals: &[(usize, usize, DVec3)], longest: usize) -> Vec<(f64, f64)> {
    let mut lags = Vec::new();
    let mut lag = 1;
    while lag <= longest {
        let (mut sum, mut count, mut later) = (0.0, 0_usize, 0);
        for &(frame, fold, residual) in residuals {
            while later < residuals.len() && residuals[later].0 < frame + lag {
                later += 1;
            }
            // Long lags need not meet exactly where frames were left out.
            match residuals.get(later) {
                Some(&(at, other, value)) if other == fold && at <= frame + lag + lag / 8 => {
                    sum += residual.distance_squared(value);
                    count += 1;
                }
                _ => {}
            }
        }
        if count >= 10 {
            lags.push((lag as f64, sum / (6.0 * count as f64)));
        }
        lag *= 2;
    }
    lags
}

/// Weighted least squares with three unknowns none of which is negative: the best of the seven
/// ways to leave some at 0. Rows are (terms, value, weight).
fn not_negative(rows: &[([f64; 3], f64, f64)]) -> Option<(f64, [f64; 3])> {
    let mut best: Option<(f64, [f64; 3])> = None;
    for mask in 1..8_usize {
        let used: Vec<usize> = (0..3).filter(|at| mask >> at & 1 == 1).collect();
        let n = used.len();
        let mut gram = vec![0.0; n * n];
        let mut right = vec![0.0; n];
        for (terms, value, weight) in rows {
            let weight = weight * weight;
            for (a, &i) in used.iter().enumerate() {
                right[a] += weight * terms[i] * value;
                for (b, &j) in used.iter().enumerate() {
                    gram[a * n + b] += weight * terms[i] * terms[j];
                }
            }
        }
        let Some(factor) = Cholesky::new(n, gram) else {
            continue;
        };
        factor.solve(&mut right, 1);
        if right.iter().any(|value| value.is_nan() || *value < 0.0) {
            continue;
        }
        let mut found = [0.0; 3];
        for (value, &at) in right.iter().zip(&used) {
            found[at] = *value;
        }
        let error = rows.iter().map(|(terms, value, weight)| {
            let model: f64 = terms.iter().zip(found).map(|(a, b)| a * b).sum();
            (weight * (model - value)).powi(2)
        });
        let error: f64 = error.sum();
        if best.is_none_or(|best| error < best.0) {
            best = Some((error, found));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_told_from_drift() {
        // Alternating signs: jumps at lag 1, none at lag 2 and above.
        let jumps: Vec<_> = (0..400)
            .map(|frame| {
                (
                    frame,
                    0,
                    DVec3::ONE * if frame % 3 == 0 { 1e-3 } else { -1e-3 },
                )
            })
            .collect();
        let drift = Drift::fit(&jumps, 1e-6, 100.0);
        assert!(drift.white > 5e-7 && drift.slow < 2e-7, "{drift:?}");
        // A wave of two seconds.
        let wave: Vec<_> = (0..400)
            .map(|frame| {
                (
                    frame,
                    0,
                    DVec3::ONE * 1.4e-3 * (frame as f64 * 0.0314).sin(),
                )
            })
            .collect();
        let drift = Drift::fit(&wave, 1e-6, 100.0);
        assert!(drift.white < 1e-8, "{drift:?}");
        assert_eq!(Drift::fit(&[], 1.0, 100.0).fast, 0.49);
    }
}
