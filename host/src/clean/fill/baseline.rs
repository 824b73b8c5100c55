//! Interpolation in time alone: straight lines and cubic splines.

use glam::DVec3;

/// Frames and positions of the measured samples.
fn knots(trajectory: &[DVec3]) -> Vec<(usize, DVec3)> {
    let all = trajectory.iter().copied().enumerate();
    all.filter(|(_, position)| !position.is_nan()).collect()
}

/// Straight lines between measured samples; before the first and after the last the marker stands
/// still. Nothing is filled without any sample. Linear.
pub(super) fn linear(trajectory: &[DVec3]) -> Vec<DVec3> {
    let knots = knots(trajectory);
    interpolate(trajectory, &knots, |span, t| {
        knots[span].1.lerp(knots[span + 1].1, t)
    })
}

/// The natural cubic spline through all measured samples; before the first and after the last the
/// marker stands still. Linear.
pub(super) fn spline(trajectory: &[DVec3]) -> Vec<DVec3> {
    let knots = knots(trajectory);
    let second = second_derivatives(&knots);
    interpolate(trajectory, &knots, |span, t| {
        let (a, b) = (knots[span], knots[span + 1]);
        let h = (b.0 - a.0) as f64;
        let s = 1.0 - t;
        s * a.1
            + t * b.1
            + (h * h / 6.0) * ((s * s * s - s) * second[span] + (t * t * t - t) * second[span + 1])
    })
}

fn interpolate(
    trajectory: &[DVec3],
    knots: &[(usize, DVec3)],
    between: impl Fn(usize, f64) -> DVec3,
) -> Vec<DVec3> {
    let mut filled = trajectory.to_vec();
    let (Some(first), Some(last)) = (knots.first(), knots.last()) else {
        return filled;
    };
    filled[..first.0].fill(first.1);
    filled[last.0..].fill(last.1);
    for (span, pair) in knots.windows(2).enumerate() {
        let (a, b) = (pair[0].0, pair[1].0);
        for (at, position) in filled[a..b].iter_mut().enumerate().skip(1) {
            *position = between(span, at as f64 / (b - a) as f64);
        }
    }
    filled
}

/// Second derivatives at the knots, 0 at both ends (Thomas's algorithm).
fn second_derivatives(knots: &[(usize, DVec3)]) -> Vec<DVec3> {
    let count = knots.len();
    let mut second = vec![DVec3::ZERO; count];
    let mut ratio = vec![0.0; count];
    for at in 1..count.saturating_sub(1) {
        let before = (knots[at].0 - knots[at - 1].0) as f64;
        let after = (knots[at + 1].0 - knots[at].0) as f64;
        let bend =
            (knots[at + 1].1 - knots[at].1) / after - (knots[at].1 - knots[at - 1].1) / before;
        let pivot = 2.0 * (before + after) - before * ratio[at - 1];
        ratio[at] = after / pivot;
        second[at] = (6.0 * bend - before * second[at - 1]) / pivot;
    }
    for at in (1..count.saturating_sub(1)).rev() {
        let next = second[at + 1];
        second[at] -= ratio[at] * next;
    }
    second
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_a_wave_and_the_ends() {
        let nan = DVec3::NAN;
        let x = |value: f64| DVec3::X * value;
        let line = [nan, x(1.0), nan, nan, x(4.0), nan];
        let expected = [1.0, 1.0, 2.0, 3.0, 4.0, 4.0].map(x);
        assert_eq!(linear(&line), expected);
        assert_eq!(spline(&line), expected, "two knots: a line");
        assert!(spline(&[nan; 3]).iter().all(|position| position.is_nan()));

        let mut wave: Vec<DVec3> = (0..60).map(|frame| x((0.1 * frame as f64).sin())).collect();
        let truth = wave.clone();
        wave[25..31].fill(nan);
        let error = |filled: Vec<DVec3>| {
            let pairs = filled.iter().zip(&truth);
            pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
        };
        assert!(error(spline(&wave)) < 1e-3);
        assert!(error(linear(&wave)) > 1e-2);
    }
}
