//! Components without a marker.

use glam::DVec3;

use super::Graph;

/// Ties each component without a marker to the nearest vertex of one with a marker: a list of
/// (vertex, its anchor) with one entry a vertex of such components, so that they can follow
/// rigidly. O(components x vertices)
#[must_use]
pub fn attachments(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    markers: &[u32],
) -> Vec<(u32, u32)> {
    let graph = Graph::new(positions, triangles);
    let (marked, unmarked): (Vec<_>, Vec<_>) = graph
        .components()
        .into_iter()
        .partition(|vertices| vertices.iter().any(|v| markers.contains(v)));
    let anchors: Vec<u32> = marked.concat();
    let mut ties = Vec::new();
    for vertices in unmarked {
        let place = vertices.iter().map(|&v| positions[v as usize]);
        let centre = place.sum::<DVec3>() / vertices.len() as f64;
        let nearest = anchors.iter().copied().min_by(|&a, &b| {
            let distance = |v: u32| positions[v as usize].distance_squared(centre);
            distance(a).total_cmp(&distance(b))
        });
        if let Some(nearest) = nearest {
            ties.extend(vertices.into_iter().map(|vertex| (vertex, nearest)));
        }
    }
    ties
}
