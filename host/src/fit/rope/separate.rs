//! The rope as marker trajectories, and everybody else's without it.

use glam::DVec3;

use super::{PointFrames, Trace};
use crate::take::{Take, TakeError};

/// A capture in two.
#[derive(Clone, Debug, PartialEq)]
pub struct Separated {
    /// The ropes' markers, complete: `rope_01` and so on; of several ropes `rope2_01`.
    pub rope: Take,
    /// All samples that are no rope's, in the take's own columns; columns without a sample left
    /// are gone.
    pub others: Take,
}

/// Names of a rope's markers, for rope `rope` of several.
#[must_use]
pub fn marker_names(rope: usize, markers: usize) -> Vec<String> {
    let which = if rope == 0 {
        String::new()
    } else {
        (rope + 1).to_string()
    };
    let width = markers.to_string().len().max(2);
    let name = |marker: usize| format!("rope{which}_{:0width$}", marker + 1);
    (0..markers).map(name).collect()
}

/// Splits a take by the points that the traces have measured. O(frames x markers)
///
/// # Errors
/// Never for traces of this take: their numbers are finite and their lengths agree.
pub fn separate(
    take: &Take,
    points: &PointFrames,
    traces: &[Trace],
) -> Result<Separated, TakeError> {
    let (mut labels, mut trajectories) = (Vec::new(), Vec::new());
    let mut others = take.clone();
    for (rope, trace) in traces.iter().enumerate() {
        labels.extend(marker_names(rope, trace.marker_count()));
        for marker in 0..trace.marker_count() {
            let samples = trace.frames.iter().map(|frame| frame[marker].position);
            trajectories.extend(samples);
        }
        for (frame, samples) in trace.frames.iter().enumerate() {
            for point in samples.iter().filter_map(super::RopeSample::point) {
                others.set_position(points.columns[frame][point], frame, None);
            }
        }
    }
    let rope = take.with_trajectories(labels, trajectories)?;
    let left: Vec<usize> = (0..others.marker_count())
        .filter(|&column| others.missing_count(column) < others.frame_count())
        .collect();
    let labels = left.iter().map(|&c| others.labels()[c].clone()).collect();
    let samples: Vec<DVec3> = left
        .iter()
        .flat_map(|&column| others.trajectory(column).iter().copied())
        .collect();
    let others = others.with_trajectories(labels, samples)?;
    Ok(Separated { rope, others })
}
