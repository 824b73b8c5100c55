//! The surroundings of a gap, and the smoothing pass over them.

use glam::DVec3;

use super::Cluster;
use super::drift::Drift;
use super::regression::Model;
use super::smoother::{Predicted, Step, smooth};
use super::view::View;

/// Seconds looked at on each side of a gap.
const MARGIN: f64 = 0.5;

/// Seconds of gap for which third differences at half its length tell the jerk as it is.
const EVEN: f64 = 0.15;

/// Where estimates come from.
pub(super) struct Sources<'a> {
    pub view: &'a View<'a>,
    pub marker: usize,
    pub models: &'a [(Model, Drift)],
}

/// Gaps of a marker, joined where less than the margin lies between them.
pub(super) fn clusters(view: &View<'_>, marker: usize) -> Vec<Cluster> {
    let margin = margin(view);
    let mut clusters: Vec<Cluster> = Vec::new();
    let mut missing = (0..view.take.frame_count()).filter(|&f| !view.is_measured(marker, f));
    let Some(first) = missing.next() else {
        return clusters;
    };
    let mut current = first..first + 1;
    for frame in missing {
        if frame > current.end + margin {
            clusters.push(std::mem::replace(&mut current, frame..frame + 1));
        }
        current.end = frame + 1;
    }
    clusters.push(current);
    clusters
}

fn margin(view: &View<'_>) -> usize {
    (MARGIN * view.take.rate()).ceil().clamp(8.0, 500.0) as usize
}

/// Position and standard deviation an axis in each of `missing`, which is ascending, not empty and
/// of one cluster; `models`: which model serves each. Linear.
pub(super) fn solve(
    sources: &Sources<'_>,
    missing: &[usize],
    models: &[Option<usize>],
) -> Vec<(usize, DVec3, f64)> {
    let view = sources.view;
    let margin = margin(view);
    let (first, last) = (missing[0], missing[missing.len() - 1]);
    let from = first.saturating_sub(margin);
    let to = (last + 1 + margin).min(view.take.frame_count());
    let noise = noise(view, sources.marker, from, to);
    let mut at = 0;
    let steps: Vec<Step> = (from..to)
        .map(|frame| {
            // The model of the nearest missing frame.
            while at + 1 < missing.len()
                && missing[at + 1].abs_diff(frame) < missing[at].abs_diff(frame)
            {
                at += 1;
            }
            let measured = view.is_measured(sources.marker, frame);
            let position = view.trajectory(sources.marker)[frame];
            Step {
                measured: measured.then_some((position, noise)),
                predicted: models[at].and_then(|model| predicted(sources, model, frame)),
            }
        })
        .collect();
    let longest = view
        .take
        .gaps(sources.marker)
        .filter(|gap| gap.start >= from && gap.end <= to)
        .map(|gap| gap.len())
        .max()
        .unwrap_or(1);
    let jerk = jerk(&steps, longest, noise, view.take.rate());
    let smoothed = smooth(&steps, jerk);
    missing
        .iter()
        .map(|&frame| {
            let (position, variance) = smoothed[frame - from];
            (frame, position, variance.sqrt())
        })
        .collect()
}

fn predicted(sources: &Sources<'_>, model: usize, frame: usize) -> Option<Predicted> {
    let (regression, drift) = &sources.models[model];
    let prediction = regression.predict(sources.view, frame)?;
    Some(Predicted {
        position: prediction.position,
        rotation: prediction.pose.rotation,
        drift: *drift,
        inherited: prediction.inherited,
        model,
    })
}

/// Variance an axis of the marker's noise, from fourth differences: motion hardly reaches them.
fn noise(view: &View<'_>, marker: usize, from: usize, to: usize) -> f64 {
    let seen = |frame: usize| {
        view.is_measured(marker, frame)
            .then(|| view.trajectory(marker)[frame])
    };
    let mut squares: Vec<f64> = (from..to.saturating_sub(4))
        .filter_map(|f| {
            let outer = seen(f)? + seen(f + 4)?;
            let inner = seen(f + 1)? + seen(f + 3)?;
            Some((outer - 4.0 * inner + 6.0 * seen(f + 2)?).length_squared())
        })
        .collect();
    if squares.is_empty() {
        return 1e-8;
    }
    let middle = squares.len() / 2;
    let (_, median, _) = squares.select_nth_unstable_by(middle, f64::total_cmp);
    // Median of chi-square with three degrees of freedom, and the gain of the difference.
    (*median / 2.366 / 70.0).clamp(1e-10, 9e-8)
}

/// Intensity of the jerk at the scale of the gap: from third differences that span it, of measured
/// samples beside it, raised where the neighbours move more within it than beside it.
fn jerk(steps: &[Step], gap: usize, noise: f64, rate: f64) -> f64 {
    let span = (gap / 2).clamp(2, (0.2 * rate).max(2.0) as usize);
    let measured = |at: usize| steps[at].measured.map(|(position, _)| position);
    let predicted = |at: usize| steps[at].predicted.map(|p| p.position);
    let own = mean_third(steps.len(), span, &measured, |_| true);
    let scale = 0.55 * (span as f64).powi(5);
    let within = |at: usize| (0..=3).any(|k| steps[at + k * span].measured.is_none());
    let inside = mean_third(steps.len(), span, &predicted, within);
    let beside = mean_third(steps.len(), span, &predicted, |at| !within(at));
    let own = own.map(|value| (value - 20.0 * noise).max(noise));
    let value = match (own, inside, beside) {
        (Some(own), Some(inside), Some(beside)) => own * (inside / beside).clamp(0.3, 30.0),
        (Some(own), _, _) => own,
        (None, Some(inside), _) => inside,
        (None, None, _) => 1e-4,
    };
    // Real motion is smoother than white jerk over short times and rougher over long ones.
    let time = gap as f64 / rate;
    let rougher = (time / EVEN).powi(2).clamp(0.2, 10.0);
    (rougher * value / scale).max(1e-16)
}

/// Mean square an axis of third differences with `span` frames between samples.
fn mean_third(
    count: usize,
    span: usize,
    position: &dyn Fn(usize) -> Option<DVec3>,
    keep: impl Fn(usize) -> bool,
) -> Option<f64> {
    let (mut sum, mut terms) = (0.0, 0);
    for at in 0..count.saturating_sub(3 * span) {
        if !keep(at) {
            continue;
        }
        let samples = [0, 1, 2, 3].map(|k| position(at + k * span));
        if let [Some(a), Some(b), Some(c), Some(d)] = samples {
            sum += (d - a + 3.0 * (b - c)).length_squared();
            terms += 3;
        }
    }
    (terms > 0).then(|| sum / f64::from(terms))
}
