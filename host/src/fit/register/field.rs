//! An affine map for each vertex, smooth along the surface, that pulls it to targets.
//!
//! Vertex `i` at `u_i` goes to `p_i` and takes along what is around it by `A_i`. Of all fields the
//! one is found that minimises (Allen et al. 2003, with the difference of two maps measured where
//! it matters, in the middle of their edge, so that nothing depends on the origin)
//!
//! `sum_edges w |p_i - p_j + (A_i + A_j) e / 2|^2 + L^2 w |A_i - A_j|^2
//!  + sum_pulls k |sum_corners b p - target|^2 + sum_vertices r area |A_i - S_i|^2`
//!
//! with cotangent weights `w`, so that the result does not depend on how finely the mesh is cut.
//! An affine map of the whole costs nothing. The normal equations have four rows a vertex and the
//! pattern of the mesh's edges; the targets' three coordinates are right-hand sides.

use glam::{DMat3, DVec3};

use crate::fit::laplace::LaplaceError;
use crate::fit::laplace::cholesky::Cholesky;
use crate::fit::laplace::graph::Graph;
use crate::fit::laplace::operator::Laplacian;
use crate::spatial::Tree;

/// Cotangent weights are at least this: negative ones would make the energy unbounded.
const LEAST_WEIGHT: f64 = 0.05;
/// Over the mean diagonal: keeps vertices in place that nothing else holds.
const ANCHOR: f64 = 1e-8;

/// A point of the surface that is pulled to a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    /// Corners of its triangle, as nodes of the field.
    pub corners: [usize; 3],
    /// Their weights.
    pub barycentric: [f64; 3],
    /// Metres.
    pub target: DVec3,
    /// Against smoothness.
    pub weight: f64,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    ends: [usize; 2],
    weight: f64,
}

/// The field and the surface it lives on.
#[derive(Clone, Debug)]
pub(super) struct Field {
    /// `[nodes]`: before.
    rest: Vec<DVec3>,
    /// Sorted by their ends.
    edges: Vec<Edge>,
    /// `[nodes]`: square metres.
    pub area: Vec<f64>,
    /// `[nodes]`: how much stiffer than usual.
    pub stiffness: Vec<f64>,
    /// `[nodes]`: how strongly a map is held near a given one, and that one.
    pub held: Vec<(f64, DMat3)>,
    /// `[nodes]`: after, metres.
    pub positions: Vec<DVec3>,
    /// `[nodes]`: linear parts of the maps.
    pub maps: Vec<DMat3>,
    /// Maps vary over this length, metres.
    length: f64,
    /// `[4 nodes]`: order of elimination.
    order: Vec<u32>,
}

type Block = [[f64; 4]; 4];

/// A block's entries at a place of the matrix.
fn entries(block: &Block, row: usize, column: usize) -> impl Iterator<Item = (u32, u32, f64)> {
    block.iter().zip(row..).flat_map(move |(values, row)| {
        let cell = move |(value, column): (&f64, usize)| (row as u32, column as u32, *value);
        values.iter().zip(column..).map(cell)
    })
}

impl Field {
    /// The field that changes nothing. Triangles name nodes. Components other than the largest are
    /// tied to it where they are nearest. O(fill of the mesh)
    ///
    /// # Errors
    /// A mesh that is too large to be factored.
    pub fn new(
        rest: Vec<DVec3>,
        triangles: &[[u32; 3]],
        length: f64,
    ) -> Result<Self, LaplaceError> {
        let laplacian = Laplacian::new(&rest, triangles);
        let mut edges = Vec::new();
        for a in 0..rest.len() {
            let after = laplacian.row(a).filter(|&(b, _)| b > a);
            edges.extend(after.map(|(b, weight)| Edge {
                ends: [a, b],
                weight: weight.max(LEAST_WEIGHT),
            }));
        }
        edges.extend(ties(&rest, triangles, &edges));
        edges.sort_by_key(|edge| edge.ends);
        edges.dedup_by_key(|edge| edge.ends);
        let mut area = vec![0.0; rest.len()];
        for triangle in triangles {
            let [a, b, c] = triangle.map(|at| rest[at as usize]);
            let third = (b - a).cross(c - a).length() / 6.0;
            triangle.iter().for_each(|&at| area[at as usize] += third);
        }
        let mut scalar: Vec<(u32, u32, f64)> =
            (0..rest.len() as u32).map(|at| (at, at, 1.0)).collect();
        for edge in &edges {
            let [a, b] = edge.ends;
            scalar.push((b as u32, a as u32, -edge.weight));
            scalar[a].2 += edge.weight;
            scalar[b].2 += edge.weight;
        }
        let order = Cholesky::new(rest.len(), &scalar, None)?.order();
        let order = order
            .iter()
            .flat_map(|&node| (0..4).map(move |row| 4 * node + row));
        Ok(Self {
            order: order.collect(),
            stiffness: vec![1.0; rest.len()],
            held: vec![(0.0, DMat3::IDENTITY); rest.len()],
            positions: rest.clone(),
            maps: vec![DMat3::IDENTITY; rest.len()],
            area,
            edges,
            length,
            rest,
        })
    }

    /// Solves for the field under these pulls. O(fill)
    ///
    /// # Errors
    /// Triangles too distorted to be factored.
    pub fn solve(&mut self, pulls: &[Pull]) -> Result<(), LaplaceError> {
        let (lower, right) = self.equations(pulls);
        let factor = Cholesky::new(right.len(), &lower, Some(&self.order))?;
        let mut solution: Vec<[f64; 3]> = right.iter().map(DVec3::to_array).collect();
        factor.solve_vectors(&mut solution);
        for (node, rows) in solution.as_chunks::<4>().0.iter().enumerate() {
            let [p, x, y, z] = rows.map(DVec3::from_array);
            self.positions[node] = p;
            self.maps[node] = DMat3::from_cols(x, y, z) * (1.0 / self.length);
        }
        Ok(())
    }

    /// The lower triangle of the normal equations, (row, column, value), and their right-hand sides
    /// `[4 nodes]`: a place and the three columns of a map for each node. Maps are counted in
    /// lengths, so that all unknowns are metres.
    fn equations(&self, pulls: &[Pull]) -> (Vec<(u32, u32, f64)>, Vec<DVec3>) {
        let nodes = self.rest.len();
        let mut diagonal: Vec<Block> = vec![[[0.0; 4]; 4]; nodes];
        let mut across: Vec<Block> = vec![[[0.0; 4]; 4]; self.edges.len()];
        let mut right = vec![DVec3::ZERO; 4 * nodes];
        for (edge, across) in self.edges.iter().zip(&mut across) {
            self.smooth(edge, &mut diagonal, across);
        }
        for pull in pulls {
            for (&at, share) in pull.corners.iter().zip(pull.barycentric) {
                for (&to, other) in pull.corners.iter().zip(pull.barycentric) {
                    let value = pull.weight * share * other;
                    let between = |edge: &Edge| edge.ends;
                    if at == to {
                        diagonal[at][0][0] += value;
                    } else if at > to
                        && let Ok(edge) = self.edges.binary_search_by_key(&[to, at], between)
                    {
                        across[edge][0][0] += value;
                    }
                }
                right[4 * at] += pull.weight * share * pull.target;
            }
        }
        let trace: f64 = diagonal.iter().map(|block| block[0][0] + block[1][1]).sum();
        let anchor = ANCHOR * trace / (2 * nodes).max(1) as f64;
        for node in 0..nodes {
            let (held, kept) = self.held[node];
            let held = held * self.area[node] / (self.length * self.length);
            right[4 * node] += anchor * self.positions[node];
            diagonal[node][0][0] += anchor;
            for row in 1..4 {
                diagonal[node][row][row] += anchor + held;
                let wanted = anchor * self.maps[node].col(row - 1) + held * kept.col(row - 1);
                right[4 * node + row] += wanted * self.length;
            }
        }
        let mut lower = Vec::with_capacity(10 * nodes + 16 * self.edges.len());
        for (node, block) in diagonal.iter().enumerate() {
            let entries = entries(block, 4 * node, 4 * node);
            lower.extend(entries.filter(|(row, column, _)| column <= row));
        }
        for (edge, block) in self.edges.iter().zip(&across) {
            lower.extend(entries(block, 4 * edge.ends[1], 4 * edge.ends[0]));
        }
        (lower, right)
    }

    /// The terms of one edge.
    fn smooth(&self, edge: &Edge, diagonal: &mut [Block], across: &mut Block) {
        let [a, b] = edge.ends;
        let weight = edge.weight * f64::midpoint(self.stiffness[a], self.stiffness[b]);
        let half = (self.rest[b] - self.rest[a]) / (2.0 * self.length);
        let of_a = [1.0, half.x, half.y, half.z];
        let of_b = [-1.0, half.x, half.y, half.z];
        let add = |block: &mut Block, rows: [f64; 4], columns: [f64; 4]| {
            for (row, x) in block.iter_mut().zip(rows) {
                row.iter_mut()
                    .zip(columns)
                    .for_each(|(value, y)| *value += weight * x * y);
            }
        };
        add(&mut diagonal[a], of_a, of_a);
        add(&mut diagonal[b], of_b, of_b);
        add(across, of_b, of_a);
        for at in 1..4 {
            diagonal[a][at][at] += weight;
            diagonal[b][at][at] += weight;
            across[at][at] -= weight;
        }
    }

    /// Where a pulled point is now.
    pub fn at(&self, corners: [usize; 3], barycentric: [f64; 3]) -> DVec3 {
        let parts = corners.iter().zip(barycentric);
        parts.map(|(&at, share)| self.positions[at] * share).sum()
    }

    /// Where node `node`'s map takes a point from before.
    pub fn carry(&self, node: usize, point: DVec3) -> DVec3 {
        self.positions[node] + self.maps[node] * (point - self.rest[node])
    }
}

/// Edges from each vertex of a smaller component to the nearest vertex of the largest.
fn ties(rest: &[DVec3], triangles: &[[u32; 3]], edges: &[Edge]) -> Vec<Edge> {
    let mut components = Graph::new(rest, triangles).components();
    components.retain(|component| component.len() > 1);
    components.sort_by_key(|component| std::cmp::Reverse(component.len()));
    let Some((largest, others)) = components.split_first() else {
        return Vec::new();
    };
    if others.is_empty() {
        return Vec::new();
    }
    let mut main = vec![false; rest.len()];
    largest.iter().for_each(|&at| main[at as usize] = true);
    let of_main: Vec<[u32; 3]> = triangles
        .iter()
        .copied()
        .filter(|t| main[t[0] as usize])
        .collect();
    let tree = Tree::new(&of_main, rest);
    let weight = edges.iter().map(|edge| edge.weight).sum::<f64>() / edges.len().max(1) as f64;
    let tie = |&at: &u32| {
        let at = at as usize;
        let near = tree.closest(rest[at], |_| true)?;
        let most = (0..3).max_by(|&a, &b| near.barycentric[a].total_cmp(&near.barycentric[b]))?;
        let to = of_main[near.triangle][most] as usize;
        Some(Edge {
            ends: [at.min(to), at.max(to)],
            weight,
        })
    };
    others.iter().flatten().filter_map(tie).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square grid in the plane z = 0, and a small triangle that floats over its middle.
    fn grid(side: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut positions = Vec::new();
        for y in 0..side {
            for x in 0..side {
                positions.push(DVec3::new(x as f64, y as f64, 0.0) * 0.1);
            }
        }
        let mut triangles = Vec::new();
        for y in 0..side - 1 {
            for x in 0..side - 1 {
                let a = (y * side + x) as u32;
                let b = a + side as u32;
                triangles.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
            }
        }
        let first = positions.len() as u32;
        let middle = DVec3::new(0.45, 0.45, 0.05);
        positions.extend([middle, middle + DVec3::X * 0.05, middle + DVec3::Y * 0.05]);
        triangles.push([first, first + 1, first + 2]);
        (positions, triangles)
    }

    fn pull(at: usize, target: DVec3) -> Pull {
        Pull {
            corners: [at; 3],
            barycentric: [1.0, 0.0, 0.0],
            target,
            weight: 1e4,
        }
    }

    #[test]
    fn an_affine_map_is_carried_to_every_vertex_and_every_component() {
        let (positions, triangles) = grid(10);
        let mut field = Field::new(positions.clone(), &triangles, 0.1).unwrap();
        let map = DMat3::from_rotation_y(1.2) * DMat3::from_diagonal(DVec3::new(1.3, 0.8, 1.0));
        let shift = DVec3::new(3.0, -1.0, 2.0);
        // In a plane the points do not say what becomes of its normal; the floating piece does.
        let last = positions.len() - 1;
        let pulls: Vec<Pull> = [0, 9, 90, 99, 44, last]
            .map(|at| pull(at, map * positions[at] + shift))
            .to_vec();
        field.solve(&pulls).unwrap();
        for (found, rest) in field.positions.iter().zip(&positions) {
            let away = found.distance(map * *rest + shift);
            assert!(away < 5e-4, "{away}");
        }
    }

    #[test]
    fn a_bump_is_smooth_and_stiffness_flattens_it() {
        let (positions, triangles) = grid(21);
        let middle = 10 * 21 + 10;
        let height = |field: &Field, at: usize| field.positions[at].z;
        let solve = |stiff: f64| {
            let mut field = Field::new(positions.clone(), &triangles, 0.1).unwrap();
            field.stiffness.iter_mut().for_each(|s| *s = stiff);
            let mut pulls: Vec<Pull> = [0, 20, 420, 440].map(|at| pull(at, positions[at])).to_vec();
            pulls.push(Pull {
                weight: 10.0,
                ..pull(middle, positions[middle] + DVec3::Z * 0.1)
            });
            field.solve(&pulls).unwrap();
            field
        };
        let soft = solve(1.0);
        assert!(height(&soft, middle) > 0.08);
        // No cusp: the first step down from the top is less than the second.
        let steps = [middle, middle + 1, middle + 2].map(|at| height(&soft, at));
        assert!(steps[0] - steps[1] < steps[1] - steps[2], "{steps:?}");
        assert!(height(&solve(1e4), middle) < 0.5 * height(&soft, middle));
    }
}
