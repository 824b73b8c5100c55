//! Rotations of markers from what is known about the template.
//!
//! The paper turns each marker as its edges in a spanning tree turn; two edges along a limb know
//! nothing of its twist. Better, where it can be had: the rotation of what carries the marker.

use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

/// Where a marker shall be and how it has turned since the rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerTarget {
    /// Metres.
    pub position: DVec3,
    /// Unit quaternion.
    pub rotation: DQuat,
}

/// Weight of staying as it was, against edges of the same length: decides what edges leave open.
const INERTIA: f64 = 1e-4;

/// The rotation that best takes `rest` edges to `posed` ones, as pairs with weights
/// (Davenport's q-method; Horn 1987). Where the edges leave a turn open, such as the one about a
/// single edge, it is the smallest.
#[must_use]
pub fn fit_rotation(edges: impl IntoIterator<Item = (DVec3, DVec3, f64)>) -> DQuat {
    let mut sum = DMat3::ZERO;
    let mut scale = 0.0;
    for (rest, posed, weight) in edges {
        sum += DMat3::from_cols(posed * rest.x, posed * rest.y, posed * rest.z) * weight;
        scale += weight * rest.length() * posed.length();
    }
    if scale <= 0.0 || !scale.is_finite() {
        return DQuat::IDENTITY;
    }
    let m = sum * (1.0 / scale) + DMat3::IDENTITY * INERTIA;
    let [c0, c1, c2] = m.to_cols_array_2d();
    let s = |row: usize, column: usize| [c0, c1, c2][column][row];
    let (trace, z) = (
        s(0, 0) + s(1, 1) + s(2, 2),
        DVec3::new(s(2, 1) - s(1, 2), s(0, 2) - s(2, 0), s(1, 0) - s(0, 1)),
    );
    let row = |k: usize| {
        let mut row = [0, 1, 2].map(|c| s(k, c) + s(c, k));
        row[k] -= trace;
        DVec4::new(row[0], row[1], row[2], z[k])
    };
    let matrix = DMat4::from_cols(row(0), row(1), row(2), z.extend(trace));
    let vector = largest_eigenvector(matrix);
    DQuat::from_array(vector.to_array()).normalize()
}

/// Cyclic Jacobi sweeps; 4 x 4 symmetric matrices are diagonal after six.
fn largest_eigenvector(matrix: DMat4) -> DVec4 {
    let mut a = matrix.to_cols_array_2d();
    let mut vectors = DMat4::IDENTITY.to_cols_array_2d();
    for _ in 0..12 {
        for p in 0..3 {
            for q in p + 1..4 {
                if a[p][q].abs() < 1e-300 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let t = if theta == 0.0 { 1.0 } else { t };
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in &mut a {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                for k in 0..4 {
                    (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                    (vectors[p][k], vectors[q][k]) = (
                        c * vectors[p][k] - s * vectors[q][k],
                        s * vectors[p][k] + c * vectors[q][k],
                    );
                }
            }
        }
    }
    let best = (0..4)
        .max_by(|&i, &j| a[i][i].total_cmp(&a[j][j]))
        .unwrap_or(0);
    DVec4::from_array(vectors[best])
}

/// The paper's mode: each marker turns as its edges of the spanning tree do (section 3.3).
///
/// `rest`, `posed`: `[markers]`; `edges`: pairs of markers. O(edges)
#[must_use]
pub fn by_spanning_tree(rest: &[DVec3], posed: &[DVec3], edges: &[[u16; 2]]) -> Vec<DQuat> {
    let mut neighbours = vec![Vec::new(); rest.len()];
    for &[a, b] in edges {
        let (a, b) = (usize::from(a), usize::from(b));
        neighbours[a].push((b, 1.0));
        neighbours[b].push((a, 1.0));
    }
    by_neighbours(rest, posed, &neighbours)
}

/// Each marker turns as the markers around it do.
///
/// `neighbours`: `[markers]`, (marker, weight). O(neighbours)
#[must_use]
pub fn by_neighbours(
    rest: &[DVec3],
    posed: &[DVec3],
    neighbours: &[Vec<(usize, f64)>],
) -> Vec<DQuat> {
    let rotation = |(marker, around): (usize, &Vec<(usize, f64)>)| {
        fit_rotation(around.iter().map(|&(other, weight)| {
            (
                rest[other] - rest[marker],
                posed[other] - posed[marker],
                weight,
            )
        }))
    };
    neighbours.iter().enumerate().map(rotation).collect()
}

/// The `count` nearest markers of each, lighter with the square of their distance along the
/// surface. `distances`: `[markers x markers]`, metres. O(markers^2 log markers)
#[must_use]
pub fn nearest_markers(distances: &[Vec<f32>], count: usize) -> Vec<Vec<(usize, f64)>> {
    let nearest = |(marker, row): (usize, &Vec<f32>)| {
        let mut others: Vec<(f32, usize)> = row
            .iter()
            .zip(0..)
            .filter(|&(&distance, other)| other != marker && distance.is_finite())
            .map(|(&distance, other)| (distance, other))
            .collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        others.truncate(count);
        let weight = |distance: f32| 1.0 / f64::from(distance).powi(2).max(1e-8);
        others
            .iter()
            .map(|&(d, other)| (other, weight(d)))
            .collect()
    };
    distances.iter().enumerate().map(nearest).collect()
}

/// Standard deviation of a distance, metres, beyond which two markers do not move together, for
/// markers in the same place, and what is added a metre between them.
const RIGID: [f64; 2] = [0.004, 0.02];

/// The `count` markers that say most about the turn of each: near it, and keeping their distance
/// over a motion. Weights fall with the square of the distance and of how much it changes.
///
/// `rest`: `[markers]`; `frames`: `[frames][markers]`, metres. O(frames markers^2)
#[must_use]
pub fn rigid_neighbours(
    rest: &[DVec3],
    frames: &[&[DVec3]],
    count: usize,
) -> Vec<Vec<(usize, f64)>> {
    let weight = |a: usize, b: usize| {
        let apart = rest[a].distance(rest[b]);
        let distances = || frames.iter().map(|frame| frame[a].distance(frame[b]));
        let seen = frames.len().max(1) as f64;
        let mean = distances().sum::<f64>() / seen;
        let variance = distances().map(|d| (d - mean).powi(2)).sum::<f64>() / seen;
        let moved = variance / (RIGID[0] + RIGID[1] * apart).powi(2);
        1.0 / (apart.powi(2).max(1e-8) * (1.0 + moved))
    };
    let mut neighbours = vec![Vec::with_capacity(rest.len()); rest.len()];
    for a in 0..rest.len() {
        for b in 0..a {
            let weight = weight(a, b);
            neighbours[a].push((b, weight));
            neighbours[b].push((a, weight));
        }
    }
    for row in &mut neighbours {
        row.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        row.truncate(count);
    }
    neighbours
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: DQuat, b: DQuat) -> bool {
        a.dot(b).abs() > 1.0 - 1e-9
    }

    #[test]
    fn any_rotation_of_three_edges_is_found() {
        for seed in 0..50 {
            let angle = f64::from(seed) * 0.37;
            let axis = DVec3::new(angle.sin(), 0.3, (angle * 1.7).cos()).normalize();
            let turn = DQuat::from_axis_angle(axis, angle);
            let edges = [DVec3::X, DVec3::Y * 2.0, DVec3::new(0.3, 0.2, 0.9)];
            let found = fit_rotation(edges.map(|edge| (edge, turn * edge, 1.0)));
            // Inertia pulls it back a little.
            assert!(found.angle_between(turn).min(found.angle_between(-turn)) < 1e-3);
        }
    }

    #[test]
    fn a_single_edge_turns_the_shortest_way() {
        let found = fit_rotation([(DVec3::X, DVec3::Y, 1.0)]);
        assert!(
            close(found, DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2)) || {
                let (axis, angle) = found.to_axis_angle();
                (axis.z.abs() - 1.0).abs() < 1e-3
                    && (angle - std::f64::consts::FRAC_PI_2).abs() < 1e-2
            }
        );
        assert_eq!(fit_rotation([]), DQuat::IDENTITY);
        assert_eq!(fit_rotation([(DVec3::X, DVec3::NAN, 1.0)]), DQuat::IDENTITY);
    }

    #[test]
    fn a_spanning_tree_along_a_line_loses_the_twist_and_neighbours_keep_it() {
        let rest = [
            DVec3::ZERO,
            DVec3::X,
            DVec3::X * 2.0,
            DVec3::new(1.0, 0.3, 0.0),
        ];
        let turn = DQuat::from_rotation_x(1.0);
        let posed = rest.map(|p| turn * p);
        let tree = by_spanning_tree(&rest, &posed, &[[0, 1], [1, 2], [1, 3]]);
        assert!(close(tree[2], DQuat::IDENTITY));
        let around = vec![vec![(1, 1.0), (3, 1.0), (2, 1.0)]; 1];
        let found = by_neighbours(&rest, &posed, &around);
        assert!(found[0].angle_between(turn) < 0.1);
    }
}
