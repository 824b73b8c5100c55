//! Positions of markers on a body of other proportions.
//!
//! Every edge between neighbouring markers turns and stretches as it does on the template, but
//! starts from the scan's own length and direction; markers are where all edges fit best. The
//! template's scaled way holds the whole in its place, weakly, and planted feet, strongly.

use glam::{DQuat, DVec3};

use crate::fit::laplace::collapse::least_squares::{factor, substitute};

/// Neighbours of a marker.
const NEIGHBOURS: usize = 5;
/// Weight of a marker's scaled way against one edge of mean length.
const WAY: f64 = 1e-3;
/// Weight of a foot that stands.
const STAND: f64 = 1e3;

/// Markers of a scan and the edges between them.
#[derive(Debug)]
pub(super) struct Body<'b> {
    rest: &'b [DVec3],
    /// The template's markers in the reference pose, brought onto the scan.
    reference: &'b [DVec3],
    /// (one, other, weight)
    edges: Vec<(usize, usize, f64)>,
    /// Edges keep the scan's length: nobody knows how long they are on the template at rest.
    rigid: bool,
}

/// A marker that must be at a place, this strongly (0 to 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hold {
    pub marker: usize,
    pub place: DVec3,
    pub strength: f64,
}

impl<'b> Body<'b> {
    /// O(markers^2 log markers)
    pub fn new(rest: &'b [DVec3], reference: &'b [DVec3], rigid: bool) -> Self {
        let mut edges: Vec<(usize, usize)> = spanning_tree(rest)
            .iter()
            .map(|&[a, b]| (usize::from(a), usize::from(b)))
            .collect();
        for (at, place) in rest.iter().enumerate() {
            let mut others: Vec<usize> = (0..rest.len()).filter(|&other| other != at).collect();
            let distance = |other: usize| rest[other].distance_squared(*place);
            others.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)));
            edges.extend(others.into_iter().take(NEIGHBOURS).map(|other| (at, other)));
        }
        for edge in &mut edges {
            *edge = (edge.0.min(edge.1), edge.0.max(edge.1));
        }
        edges.sort_unstable();
        edges.dedup();
        let length = |&(a, b): &(usize, usize)| rest[a].distance(rest[b]).max(1e-3);
        let mean = edges.iter().map(length).sum::<f64>() / edges.len().max(1) as f64;
        let weighted = edges.iter().map(|edge| {
            let ratio = mean / length(edge);
            (edge.0, edge.1, ratio * ratio)
        });
        Self {
            rest,
            reference,
            edges: weighted.collect(),
            rigid,
        }
    }

    /// Places of all markers. `now`: the template's, brought onto the scan; `turns`: of markers
    /// since the reference pose. O(markers^3)
    pub fn place(&self, now: &[DVec3], turns: &[DQuat], holds: &[Hold]) -> Vec<DVec3> {
        let count = self.rest.len();
        let mut matrix = vec![0.0; count * count];
        let mut right = vec![DVec3::ZERO; count];
        for &(a, b, weight) in &self.edges {
            let edge = self.edge(a, b, now, turns);
            matrix[a * count + a] += weight;
            matrix[b * count + b] += weight;
            matrix[b * count + a] -= weight;
            right[a] -= weight * edge;
            right[b] += weight * edge;
        }
        let pull = holds.iter().map(|hold| {
            let weight = STAND * hold.strength;
            (hold.marker, weight, hold.place)
        });
        let way = (0..count).map(|marker| (marker, WAY, now[marker]));
        for (marker, weight, place) in way.chain(pull) {
            matrix[marker * count + marker] += weight;
            right[marker] += weight * place;
        }
        factor(&mut matrix, count);
        let mut columns = [0, 1, 2].map(|axis| right.iter().map(|p| p[axis]).collect::<Vec<_>>());
        columns
            .iter_mut()
            .for_each(|column| substitute(&matrix, column));
        let [x, y, z] = &columns;
        let rows = x.iter().zip(y).zip(z);
        rows.map(|((&x, &y), &z)| DVec3::new(x, y, z)).collect()
    }

    /// The scan's edge, turned and stretched as the template's.
    fn edge(&self, a: usize, b: usize, now: &[DVec3], turns: &[DQuat]) -> DVec3 {
        let (before, after) = (self.reference[b] - self.reference[a], now[b] - now[a]);
        let other = if turns[a].dot(turns[b]) < 0.0 {
            -turns[b]
        } else {
            turns[b]
        };
        let turn = (turns[a] + other).normalize();
        let (Some(from), Some(to)) = ((turn * before).try_normalize(), after.try_normalize())
        else {
            return turn * (self.rest[b] - self.rest[a]);
        };
        let swing = DQuat::from_rotation_arc(from, to);
        let stretch = if self.rigid {
            1.0
        } else {
            after.length() / before.length()
        };
        stretch * (swing * (turn * (self.rest[b] - self.rest[a])))
    }
}

/// Minimal spanning tree by straight distance (Prim), parents first.
pub(super) fn spanning_tree(places: &[DVec3]) -> Vec<[u16; 2]> {
    let distance = |a: usize, b: usize| places[a].distance_squared(places[b]);
    let mut nearest: Vec<(f64, usize)> = (0..places.len()).map(|b| (distance(0, b), 0)).collect();
    let mut open: Vec<usize> = (1..places.len()).collect();
    let mut edges = Vec::new();
    while let Some(at) =
        (0..open.len()).min_by(|&a, &b| nearest[open[a]].0.total_cmp(&nearest[open[b]].0))
    {
        let next = open.swap_remove(at);
        edges.push([nearest[next].1 as u16, next as u16]);
        for &other in &open {
            if distance(next, other) < nearest[other].0 {
                nearest[other] = (distance(next, other), next);
            }
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A bent arm of four markers, twice as long below the elbow as the template's.
    #[test]
    fn a_longer_forearm_bends_as_far_and_keeps_its_length() {
        let reference = [0.0, 0.1, 0.2, 0.3].map(|x| DVec3::new(x, 0.0, 0.0));
        let rest = [0.0, 0.1, 0.3, 0.5].map(|x| DVec3::new(x, 0.0, 0.0));
        let bend = DQuat::from_rotation_z(1.0);
        let turn = [DQuat::IDENTITY, DQuat::IDENTITY, bend, bend];
        let elbow = reference[1];
        let now = [0, 1, 2, 3].map(|k| elbow + turn[k] * (reference[k] - elbow));
        let body = Body::new(&rest, &reference, false);
        let placed = body.place(&now, &turn, &[]);
        let forearm = placed[3] - placed[2];
        assert!((forearm.length() - 0.2).abs() < 0.01, "{placed:?}");
        assert!(forearm.angle_between(DVec3::new(1.0_f64.cos(), 1.0_f64.sin(), 0.0)) < 0.1);
        // The same body goes where the template goes.
        let same = Body::new(&reference, &reference, false).place(&now, &turn, &[]);
        assert!(same.iter().zip(&now).all(|(a, b)| a.distance(*b) < 1e-9));
        let hold = Hold {
            marker: 3,
            place: DVec3::Y,
            strength: 1.0,
        };
        let held = body.place(&now, &turn, &[hold]);
        assert!(held[3].distance(DVec3::Y) < 1e-3);
    }
}
