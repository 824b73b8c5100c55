//! Which markers move with a marker: neighbourhoods by rigidity over time.

use super::fill::View;

/// Another marker, and how its distance varies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Neighbour {
    pub marker: usize,
    /// Mean distance, metres.
    pub distance: f64,
    /// Variance of the distance, square metres.
    pub variance: f64,
}

impl Neighbour {
    /// Lower is the better neighbour. Distances vary by noise as well, and a short one says more
    /// about the skin around the marker than a long one.
    fn score(&self) -> f64 {
        self.variance + (0.02 * self.distance).powi(2)
    }
}

/// Frames looked at for rigidity.
const SAMPLES: usize = 600;

/// Markers ranked by how rigidly they move with `marker`, best first.
///
/// Markers that share too few frames with it to judge are left out. Linear in markers and frames.
pub(crate) fn rank(view: &View<'_>, marker: usize) -> Vec<Neighbour> {
    let own = view.trajectory(marker);
    let seen: Vec<usize> = (0..own.len())
        .filter(|&frame| view.is_measured(marker, frame))
        .collect();
    let stride = seen.len().div_ceil(SAMPLES).max(1);
    let frames: Vec<usize> = seen.iter().copied().step_by(stride).collect();
    let need = (frames.len() / 20).max(3);
    let mut ranked: Vec<Neighbour> = (0..view.marker_count())
        .filter(|&other| other != marker)
        .filter_map(|other| {
            let trajectory = view.trajectory(other);
            let (mut count, mut mean, mut spread) = (0.0, 0.0, 0.0);
            for &frame in &frames {
                if !view.is_measured(other, frame) {
                    continue;
                }
                let distance = own[frame].distance(trajectory[frame]);
                count += 1.0;
                let step = distance - mean;
                mean += step / count;
                spread += step * (distance - mean);
            }
            // Few shared frames make a distance look steadier than it is.
            let variance = spread / count * (1.0 + 10.0 / count);
            let neighbour = Neighbour {
                marker: other,
                distance: mean,
                variance,
            };
            (count >= need as f64).then_some(neighbour)
        })
        .collect();
    ranked.sort_by(|a, b| {
        a.score()
            .total_cmp(&b.score())
            .then(a.marker.cmp(&b.marker))
    });
    ranked
}
