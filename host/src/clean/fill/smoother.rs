//! What was measured, what neighbours predict, and inertia, weighed in one pass over time.
//!
//! The state an axis is the marker's position, velocity and acceleration (driven by white jerk:
//! the quintic smoothing spline) and the prediction's wandering error ([`Drift`]). A Kalman filter
//! forward and the smoother of Rauch, Tung and Striebel (1965) backward give the position in every
//! frame and its variance; near measured samples inertia decides, far from them the neighbours.
//! The three axes share their covariance, as every noise is the same along each.

use glam::{DMat3, DVec3};

use super::super::linear::Cholesky;
use super::drift::Drift;

const STATES: usize = 6;
/// Position, velocity, acceleration; slow error; fast error and its rate.
const POSITION: usize = 0;
const SLOW: usize = 3;
const FAST: usize = 4;

type Matrix = [[f64; STATES]; STATES];

/// What is known of one frame.
#[derive(Clone, Copy)]
pub(super) struct Step {
    /// The measured position and its variance an axis.
    pub measured: Option<(DVec3, f64)>,
    /// What the neighbours predict.
    pub predicted: Option<Predicted>,
}

/// A prediction and its error.
#[derive(Clone, Copy)]
pub(super) struct Predicted {
    pub position: DVec3,
    /// From the local frame, with which errors turn, to the take's space.
    pub rotation: DMat3,
    /// How the error wanders.
    pub drift: Drift,
    /// Further variance an axis.
    pub inherited: f64,
    /// Which model it comes from: the error of another one starts anew.
    pub model: usize,
}

struct Filtered {
    mean: [DVec3; STATES],
    covariance: Matrix,
    /// From the frame before: expected mean and covariance, transition, turn of the error.
    expected: ([DVec3; STATES], Matrix, Matrix, DMat3),
}

/// Position and variance an axis in every frame. `jerk`: intensity of the white jerk, square
/// metres a frame to the fifth. Linear in frames.
pub(super) fn smooth(steps: &[Step], jerk: f64) -> Vec<(DVec3, f64)> {
    let Some(first) = steps.iter().find_map(|step| {
        step.measured
            .map(|at| at.0)
            .or(step.predicted.map(|p| p.position))
    }) else {
        return vec![(DVec3::NAN, f64::INFINITY); steps.len()];
    };
    let forward = filter(steps, jerk, first);
    backward(&forward)
}

fn filter(steps: &[Step], jerk: f64, first: DVec3) -> Vec<Filtered> {
    let mut mean = [DVec3::ZERO; STATES];
    mean[POSITION] = first;
    let mut covariance = [[0.0; STATES]; STATES];
    // Nothing is known: a metre, and speeds and accelerations beyond any body's.
    for (at, variance) in [1.0, 1e-1, 1e-2].into_iter().enumerate() {
        covariance[at][at] = variance;
    }
    let mut last: Option<Predicted> = steps.iter().find_map(|step| step.predicted);
    set_stationary(&mut covariance, last.map(|last| last.drift));
    let mut filtered: Vec<Filtered> = Vec::with_capacity(steps.len());
    for (at, step) in steps.iter().enumerate() {
        let mut expected = (mean, covariance, identity(), DMat3::IDENTITY);
        if at > 0 {
            let current = step.predicted.or(last);
            let (transition, noise, turn) = transition(jerk, last, current);
            for row in &mut mean[SLOW..] {
                *row = turn * *row;
            }
            mean = apply(&transition, &mean);
            covariance = add(&sandwich(&transition, &covariance), &noise);
            expected = (mean, covariance, transition, turn);
            last = current;
        }
        if let Some((position, variance)) = step.measured {
            let mut row = [0.0; STATES];
            row[POSITION] = 1.0;
            update(&mut mean, &mut covariance, &row, position, variance);
        }
        if let Some(predicted) = step.predicted {
            let mut row = [0.0; STATES];
            (row[POSITION], row[SLOW], row[FAST]) = (1.0, 1.0, 1.0);
            let variance = predicted.drift.white + predicted.inherited;
            update(
                &mut mean,
                &mut covariance,
                &row,
                predicted.position,
                variance,
            );
        }
        filtered.push(Filtered {
            mean,
            covariance,
            expected,
        });
    }
    filtered
}

fn backward(forward: &[Filtered]) -> Vec<(DVec3, f64)> {
    let mut smoothed = vec![(DVec3::NAN, f64::INFINITY); forward.len()];
    let Some(last) = forward.last() else {
        return smoothed;
    };
    let (mut mean, mut covariance) = (last.mean, last.covariance);
    for at in (0..forward.len()).rev() {
        if at + 1 < forward.len() {
            let here = &forward[at];
            let (expected, spread, transition, turn) = &forward[at + 1].expected;
            let Some(gain) = gain(&here.covariance, transition, spread) else {
                (mean, covariance) = (here.mean, here.covariance);
                smoothed[at] = (mean[POSITION], covariance[POSITION][POSITION]);
                continue;
            };
            let mut difference = [DVec3::ZERO; STATES];
            for (row, value) in difference.iter_mut().enumerate() {
                *value = mean[row] - expected[row];
            }
            let mut correction = apply(&gain, &difference);
            for row in &mut correction[SLOW..] {
                *row = turn.transpose() * *row;
            }
            for (row, value) in mean.iter_mut().enumerate() {
                *value = here.mean[row] + correction[row];
            }
            let mut change = covariance;
            for (row, values) in change.iter_mut().enumerate() {
                for (column, value) in values.iter_mut().enumerate() {
                    *value -= spread[row][column];
                }
            }
            covariance = add(&here.covariance, &sandwich(&gain, &change));
        }
        let variance = covariance[POSITION][POSITION].max(0.0);
        smoothed[at] = (mean[POSITION], variance);
    }
    smoothed
}

/// Transition matrix, process noise, and the turn of the local frame between two frames.
fn transition(
    jerk: f64,
    from: Option<Predicted>,
    to: Option<Predicted>,
) -> (Matrix, Matrix, DMat3) {
    let mut matrix = identity();
    let mut noise = [[0.0; STATES]; STATES];
    (matrix[0][1], matrix[0][2], matrix[1][2]) = (1.0, 0.5, 1.0);
    let rows = [
        [1.0 / 20.0, 1.0 / 8.0, 1.0 / 6.0],
        [1.0 / 8.0, 1.0 / 3.0, 0.5],
        [1.0 / 6.0, 0.5, 1.0],
    ];
    for (row, values) in rows.iter().enumerate() {
        for (column, value) in values.iter().enumerate() {
            noise[row][column] = jerk * value;
        }
    }
    let (Some(from), Some(to)) = (from, to) else {
        for (at, row) in noise.iter_mut().enumerate().skip(SLOW) {
            row[at] = TINY;
        }
        return (matrix, noise, DMat3::IDENTITY);
    };
    let drift = to.drift;
    let mut stationary = [[0.0; STATES]; STATES];
    set_stationary(&mut stationary, Some(drift));
    for (at, row) in matrix.iter_mut().enumerate().skip(SLOW) {
        row[at] = 0.0;
    }
    if from.model == to.model {
        matrix[SLOW][SLOW] = (-drift.slow_time.recip()).exp();
        let rate = 3f64.sqrt() / drift.fast_time;
        let decay = (-rate).exp();
        matrix[FAST][FAST] = decay * (1.0 + rate);
        matrix[FAST][FAST + 1] = decay;
        matrix[FAST + 1][FAST] = -decay * rate * rate;
        matrix[FAST + 1][FAST + 1] = decay * (1.0 - rate);
    }
    // The noise that keeps the error at its stationary covariance.
    let kept = sandwich(&matrix, &stationary);
    for row in SLOW..STATES {
        for column in SLOW..STATES {
            noise[row][column] = stationary[row][column] - kept[row][column];
        }
        noise[row][row] = noise[row][row].max(TINY);
    }
    (matrix, noise, to.rotation * from.rotation.transpose())
}

/// Keeps covariances regular where there is nothing to estimate.
const TINY: f64 = 1e-20;

fn set_stationary(covariance: &mut Matrix, drift: Option<Drift>) {
    let (slow, fast, rate) = drift.map_or((TINY, TINY, 1.0), |drift| {
        (drift.slow, drift.fast, 3f64.sqrt() / drift.fast_time)
    });
    covariance[SLOW][SLOW] = slow;
    covariance[FAST][FAST] = fast;
    covariance[FAST + 1][FAST + 1] = fast * rate * rate;
}

fn update(
    mean: &mut [DVec3; STATES],
    covariance: &mut Matrix,
    row: &[f64; STATES],
    value: DVec3,
    variance: f64,
) {
    let mut cross = [0.0; STATES];
    for (sum, values) in cross.iter_mut().zip(covariance.iter()) {
        *sum = values.iter().zip(row).map(|(a, b)| a * b).sum();
    }
    let total: f64 = cross.iter().zip(row).map(|(a, b)| a * b).sum::<f64>() + variance;
    let seen: DVec3 = mean.iter().zip(row).map(|(a, b)| *a * *b).sum();
    let innovation = (value - seen) / total;
    for (state, cross) in mean.iter_mut().zip(cross) {
        *state += cross * innovation;
    }
    for (values, a) in covariance.iter_mut().zip(cross) {
        for (value, b) in values.iter_mut().zip(cross) {
            *value -= a * b / total;
        }
    }
}

fn identity() -> Matrix {
    let mut matrix = [[0.0; STATES]; STATES];
    for (at, row) in matrix.iter_mut().enumerate() {
        row[at] = 1.0;
    }
    matrix
}

fn apply(matrix: &Matrix, state: &[DVec3; STATES]) -> [DVec3; STATES] {
    matrix.map(|row| row.iter().zip(state).map(|(a, b)| *a * *b).sum())
}

fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    let mut product = [[0.0; STATES]; STATES];
    for (row, left) in product.iter_mut().zip(a) {
        for (factor, right) in left.iter().zip(b) {
            for (sum, value) in row.iter_mut().zip(right) {
                *sum += factor * value;
            }
        }
    }
    product
}

fn transposed(matrix: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[column][row]))
}

/// `a b a'`.
fn sandwich(a: &Matrix, b: &Matrix) -> Matrix {
    multiply(&multiply(a, b), &transposed(a))
}

fn add(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|row| {
        std::array::from_fn(|column| {
            // Symmetric to the last bit, so that rounding cannot pile up.
            0.5 * (a[row][column] + a[column][row] + b[row][column] + b[column][row])
        })
    })
}

/// `covariance transition' expected^-1`.
fn gain(covariance: &Matrix, transition: &Matrix, expected: &Matrix) -> Option<Matrix> {
    // Position and error differ by powers of ten: scaled to a unit diagonal the factor is exact.
    let scale: [f64; STATES] = std::array::from_fn(|at| expected[at][at].sqrt().recip());
    if scale.iter().any(|scale| !scale.is_finite()) {
        return None;
    }
    let scaled = (0..STATES * STATES).map(|at| {
        let (row, column) = (at / STATES, at % STATES);
        let ridge = if row == column { 1e-13 } else { 0.0 };
        expected[row][column] * scale[row] * scale[column] + ridge
    });
    let factor = Cholesky::new(STATES, scaled.collect())?;
    // The transpose: expected^-1 (transition covariance).
    let cross = multiply(transition, covariance);
    let mut right: Vec<f64> = (0..STATES * STATES)
        .map(|at| cross[at / STATES][at % STATES] * scale[at / STATES])
        .collect();
    factor.solve(&mut right, STATES);
    Some(std::array::from_fn(|row| {
        std::array::from_fn(|column| right[column * STATES + row] * scale[column])
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIFT: Drift = Drift {
        white: 1e-10,
        fast: 1e-8,
        fast_time: 10.0,
        slow: 1e-6,
        slow_time: 100.0,
    };

    fn steps(predict: bool) -> Vec<Step> {
        let truth = |frame: usize| DVec3::new(0.01 * frame as f64, (0.2 * frame as f64).sin(), 0.0);
        let step = |frame: usize| Step {
            measured: (!(20..60).contains(&frame)).then(|| (truth(frame), 1e-10)),
            predicted: predict.then(|| Predicted {
                position: truth(frame) + DVec3::Z * 2e-3,
                rotation: DMat3::IDENTITY,
                drift: DRIFT,
                inherited: 0.0,
                model: 0,
            }),
        };
        (0..80).map(step).collect()
    }

    #[test]
    fn a_constant_error_of_the_neighbours_is_taken_off() {
        let smoothed = smooth(&steps(true), 1e-6);
        for (frame, (position, variance)) in smoothed.iter().enumerate() {
            let truth = DVec3::new(0.01 * frame as f64, (0.2 * frame as f64).sin(), 0.0);
            assert!(position.distance(truth) < 5e-4, "{frame}: {position}");
            assert!(*variance < 2e-6 && *variance >= 0.0);
        }
        assert!(smoothed[40].1 > smoothed[21].1, "surest near the ends");
    }

    #[test]
    fn inertia_alone_meets_both_ends() {
        let smoothed = smooth(&steps(false), 1e-3);
        assert!((smoothed[40].0.x - 0.4).abs() < 1e-3, "straight on");
        assert!(smoothed[20].0.distance(DVec3::new(0.2, 4f64.sin(), 0.0)) < 2e-2);
        assert!(smooth(&[], 1.0).is_empty());
    }
}
