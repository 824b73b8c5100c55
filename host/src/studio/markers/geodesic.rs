//! Distances along a surface, by shortest paths over its edges and across its edges.
//!
//! A path may also step over an edge to the opposite corner, which takes most of the detour out of
//! edge paths.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use glam::DVec3;

/// Vertices and the ways between them.
#[derive(Clone, Debug)]
pub(super) struct Ways {
    /// Start of each vertex's ways; one more than vertices.
    starts: Vec<u32>,
    ends: Vec<u32>,
    lengths: Vec<f64>,
}

/// A distance that sorts.
#[derive(Clone, Copy, PartialEq)]
struct Metres(f64);

impl Eq for Metres {}

impl PartialOrd for Metres {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Metres {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl Ways {
    /// The ways of a mesh; `welded` names the vertex that stands for each, `stretch` scales
    /// lengths at each vertex.
    pub fn new(
        triangles: &[[u32; 3]],
        positions: &[DVec3],
        welded: &[u32],
        stretch: &[f64],
    ) -> Self {
        let mut opposite: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        for triangle in triangles {
            let corners = triangle.map(|at| welded[at as usize]);
            for at in 0..3 {
                let (a, b, c) = (corners[at], corners[(at + 1) % 3], corners[(at + 2) % 3]);
                opposite.entry([a.min(b), a.max(b)]).or_default().push(c);
            }
        }
        let mut pairs: BTreeMap<[u32; 2], f64> = BTreeMap::new();
        let mut join = |a: u32, b: u32, length: f64| {
            if a != b {
                let scale = (stretch[a as usize] + stretch[b as usize]) / 2.0;
                let kept = pairs.entry([a.min(b), a.max(b)]).or_insert(f64::INFINITY);
                *kept = kept.min(length * scale);
            }
        };
        let at = |vertex: u32| positions[vertex as usize];
        for (&[a, b], across) in &opposite {
            join(a, b, at(a).distance(at(b)));
            if let [c, d] = across[..]
                && let Some(length) = unfolded(at(a), at(b), at(c), at(d))
            {
                join(c, d, length);
            }
        }
        let mut counts = vec![0u32; positions.len() + 1];
        for [a, b] in pairs.keys() {
            counts[*a as usize + 1] += 1;
            counts[*b as usize + 1] += 1;
        }
        for at in 1..counts.len() {
            counts[at] += counts[at - 1];
        }
        let mut next = counts.clone();
        let mut ends = vec![0; pairs.len() * 2];
        let mut lengths = vec![0.0; pairs.len() * 2];
        for (&[a, b], &length) in &pairs {
            for (from, to) in [(a, b), (b, a)] {
                let slot = next[from as usize] as usize;
                (ends[slot], lengths[slot]) = (to, length);
                next[from as usize] += 1;
            }
        }
        Self {
            starts: counts,
            ends,
            lengths,
        }
    }

    /// Lowers `distances` to those from `sources`, and `nearest` to the source's number. Only what
    /// gets nearer is visited (Dijkstra 1959).
    pub fn spread(
        &self,
        sources: impl IntoIterator<Item = (u32, u32)>,
        distances: &mut [f64],
        nearest: &mut [u32],
    ) {
        let mut heap = BinaryHeap::new();
        for (vertex, number) in sources {
            distances[vertex as usize] = 0.0;
            nearest[vertex as usize] = number;
            heap.push(Reverse((Metres(0.0), vertex)));
        }
        while let Some(Reverse((Metres(distance), vertex))) = heap.pop() {
            let vertex = vertex as usize;
            if distance > distances[vertex] {
                continue;
            }
            let range = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
            for way in range {
                let (to, length) = (self.ends[way], distance + self.lengths[way]);
                if length < distances[to as usize] {
                    distances[to as usize] = length;
                    nearest[to as usize] = nearest[vertex];
                    heap.push(Reverse((Metres(length), to)));
                }
            }
        }
    }
}

/// Distance of `c` and `d` in the plane into which their triangles over `ab` unfold; `None` where
/// the straight line passes beside the edge.
fn unfolded(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> Option<f64> {
    let along = (b - a).try_normalize()?;
    let flat = |p: DVec3| {
        let x = (p - a).dot(along);
        (x, (p - a - x * along).length())
    };
    let ((cx, cy), (dx, dy)) = (flat(c), flat(d));
    let cross = cx + (dx - cx) * cy / (cy + dy);
    ((0.0..=a.distance(b)).contains(&cross)).then(|| (cx - dx).hypot(cy + dy))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_may_cross_an_edge_but_not_leave_the_surface() {
        // A unit square cut along the diagonal 0-2, folded upright along it does not matter.
        let positions = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        let triangles = [[0, 1, 2], [0, 2, 3]];
        let ways = Ways::new(&triangles, &positions, &[0, 1, 2, 3], &[1.0; 4]);
        let (mut distances, mut nearest) = ([f64::INFINITY; 4], [9; 4]);
        ways.spread([(1, 0)], &mut distances, &mut nearest);
        let diagonal = 2f64.sqrt();
        assert_eq!((distances[0], distances[2]), (1.0, 1.0));
        assert!(
            (distances[3] - diagonal).abs() < 1e-12,
            "across the diagonal"
        );
        ways.spread([(3, 1)], &mut distances, &mut nearest);
        assert_eq!((distances[3], nearest[3], nearest[1]), (0.0, 1, 0));
    }

    #[test]
    fn separate_pieces_stay_unreached() {
        let positions: Vec<DVec3> = (0..6)
            .map(|at| DVec3::new(f64::from(at), f64::from(at % 2), 0.0))
            .collect();
        let ways = Ways::new(
            &[[0, 1, 2], [3, 4, 5]],
            &positions,
            &[0, 1, 2, 3, 4, 5],
            &[1.0; 6],
        );
        let (mut distances, mut nearest) = ([f64::INFINITY; 6], [9; 6]);
        ways.spread([(0, 0)], &mut distances, &mut nearest);
        assert!(distances[2].is_finite() && distances[4].is_infinite());
    }
}
