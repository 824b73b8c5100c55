//! Components without a marker.

use glam::DVec3;

use super::Graph;

/// A marker for each component without one: the vertex nearest to a given marker, and which marker
/// that is. The component then follows it rigidly.
/// O(components x markers x vertices) at worst
#[must_use]
pub fn attachments(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    markers: &[u32],
) -> Vec<(u32, usize)> {
    let graph = Graph::new(positions, triangles);
    let components = graph.components().into_iter();
    let unmarked = components.filter(|vertices| !vertices.iter().any(|v| markers.contains(v)));
    let tie = |vertices: Vec<u32>| {
        let pairs = vertices
            .iter()
            .flat_map(|&v| markers.iter().enumerate().map(move |(at, &m)| (v, m, at)));
        let distance = |&(v, m, _): &(u32, u32, usize)| {
            positions[v as usize].distance_squared(positions[m as usize])
        };
        pairs
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .map(|(vertex, _, marker)| (vertex, marker))
    };
    unmarked.filter_map(tie).collect()
}
