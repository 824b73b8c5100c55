//! Landmarks: markers that stay with one point of the surface while the rest is brought near.

use glam::DVec3;

use super::figure::{Figure, Placed};
use super::matching::Match;

/// Markers that each joint of a rig contributes.
const PER_NODE: usize = 3;

/// A marker and the vertex it belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Landmark {
    /// Index of the marker.
    pub marker: usize,
    /// Index of the vertex.
    pub vertex: usize,
}

/// The markers nearest to the joints of a posed rig: elbows, knees, wrists. Those that lie far from
/// the skin, against the others, are no landmarks. O(nodes markers)
pub(super) fn near_joints(
    figure: &Figure,
    placed: &Placed,
    markers: &[DVec3],
    matches: &[Option<Match>],
) -> Vec<usize> {
    let mut distances: Vec<f64> = matches.iter().flatten().map(|at| at.distance).collect();
    distances.sort_by(f64::total_cmp);
    let far = 2.0 * distances.get(distances.len() / 2).copied().unwrap_or(0.0);
    let mut chosen = Vec::new();
    for origin in &placed.origins[..figure.origins.len()] {
        let mut near: Vec<usize> = (0..markers.len())
            .filter(|&marker| matches[marker].is_some_and(|at| at.distance <= far))
            .collect();
        near.sort_by(|&a, &b| {
            let away = |marker: usize| markers[marker].distance_squared(*origin);
            away(a).total_cmp(&away(b))
        });
        chosen.extend(near.into_iter().take(PER_NODE));
    }
    chosen.sort_unstable();
    chosen.dedup();
    chosen
}
