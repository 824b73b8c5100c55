//! Edges of a mesh: components, distances along the surface, evenly spread vertices.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;

/// Vertices and the edges between them.
#[derive(Clone, Debug)]
pub struct Graph {
    starts: Vec<u32>,
    edges: Vec<(u32, f32)>,
}

impl Graph {
    /// The edges of all triangles. O(triangles log triangles)
    #[must_use]
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut pairs: Vec<(u32, u32)> = triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)])
            .filter(|(a, b)| a != b)
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut starts = vec![0; positions.len() + 1];
        for &(from, _) in &pairs {
            starts[from as usize + 1] += 1;
        }
        for at in 0..positions.len() {
            starts[at + 1] += starts[at];
        }
        let length = |a: u32, b: u32| positions[a as usize].distance(positions[b as usize]) as f32;
        let edges = pairs.into_iter().map(|(a, b)| (b, length(a, b)));
        Self {
            starts,
            edges: edges.collect(),
        }
    }

    /// Neighbours of a vertex and their distances in metres.
    #[must_use]
    pub fn row(&self, vertex: u32) -> &[(u32, f32)] {
        let vertex = vertex as usize;
        &self.edges[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }

    /// Connected vertices, each component in ascending order of its first vertex. O(edges)
    #[must_use]
    pub fn components(&self) -> Vec<Vec<u32>> {
        let count = self.starts.len() - 1;
        let mut seen = vec![false; count];
        let mut components = Vec::new();
        for first in 0..count as u32 {
            if std::mem::replace(&mut seen[first as usize], true) {
                continue;
            }
            let mut component = vec![first];
            let mut at = 0;
            while let Some(&vertex) = component.get(at) {
                at += 1;
                for &(next, _) in self.row(vertex) {
                    if !std::mem::replace(&mut seen[next as usize], true) {
                        component.push(next);
                    }
                }
            }
            components.push(component);
        }
        components
    }

    /// Distance of every vertex from the nearest source along edges, metres (Dijkstra).
    /// O(edges log vertices)
    #[must_use]
    pub fn distances(&self, sources: &[u32]) -> Vec<f32> {
        let mut distances = vec![f32::INFINITY; self.starts.len() - 1];
        self.shorten(&mut distances, sources);
        distances
    }

    /// `count` more vertices, each as far as possible from all before it and from `sources`.
    /// Fewer where there are not as many vertices. O(count edges log vertices) at worst.
    #[must_use]
    pub fn spread(&self, sources: &[u32], count: usize) -> Vec<u32> {
        let mut distances = self.distances(sources);
        let mut chosen = Vec::new();
        while chosen.len() < count {
            let farthest = (0..distances.len())
                .max_by(|&a, &b| distances[a].total_cmp(&distances[b]).then(b.cmp(&a)));
            let Some(farthest) = farthest.filter(|&vertex| distances[vertex] > 0.0) else {
                break;
            };
            chosen.push(farthest as u32);
            self.shorten(&mut distances, &[farthest as u32]);
        }
        chosen
    }

    fn shorten(&self, distances: &mut [f32], sources: &[u32]) {
        for &source in sources {
            distances[source as usize] = 0.0;
        }
        self.relax(distances, sources.iter().copied(), |_, _| {});
    }

    /// Shortens distances along edges, nearest vertices first (Dijkstra 1959), from `seeds`, whose
    /// own distances are set. `reached(vertex, from)` hears of every distance that got shorter.
    /// O(edges log vertices)
    pub fn relax(
        &self,
        distances: &mut [f32],
        seeds: impl Iterator<Item = u32>,
        mut reached: impl FnMut(u32, u32),
    ) {
        // Distances are not negative, so their bits sort as they do.
        let mut queue: BinaryHeap<_> = seeds
            .map(|seed| Reverse((distances[seed as usize].to_bits(), seed)))
            .collect();
        while let Some(Reverse((bits, vertex))) = queue.pop() {
            let distance = f32::from_bits(bits);
            if distance > distances[vertex as usize] {
                continue;
            }
            for &(next, length) in self.row(vertex) {
                let candidate = distance + length;
                if candidate < distances[next as usize] {
                    distances[next as usize] = candidate;
                    reached(next, vertex);
                    queue.push(Reverse((candidate.to_bits(), next)));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_go_along_edges_and_stop_at_gaps() {
        let positions: Vec<_> = (0..5).map(|x| DVec3::new(f64::from(x), 0.0, 0.0)).collect();
        let mut positions = positions;
        positions.extend([DVec3::Y, DVec3::Y * 2.0, DVec3::Z]);
        let graph = Graph::new(&positions, &[[0, 1, 1], [1, 2, 2], [2, 3, 4], [5, 6, 7]]);
        assert_eq!(graph.distances(&[0])[..5], [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert_eq!(graph.distances(&[0])[5], f32::INFINITY);
        let sizes: Vec<_> = graph.components().iter().map(Vec::len).collect();
        assert_eq!(sizes, [5, 3]);
        // The other component first, then the far end of the first one.
        let spread = graph.spread(&[0], 2);
        assert_eq!(spread, [5, 4]);
        assert_eq!(graph.spread(&[0], 100).len(), 7);
    }
}
