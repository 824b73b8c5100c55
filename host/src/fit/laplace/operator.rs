//! The cotangent Laplacian and the mass of a triangle mesh.
//!
//! `L v` at vertex i is `sum_j w_ij (v_i - v_j)`, `w_ij` half the sum of the cotangents opposite
//! the edge (Pinkall & Polthier 1993; the `L` of de Aguiar et al. 2007, section 3.3). The mass is
//! a third of the adjacent area, scaled to a mean of one, so that weights of constraints mean the
//! same on every mesh.

use std::collections::BTreeMap;

use glam::DVec3;
use sinew_core::deform::laplacian::LEAST_CONDUCTION;

/// Edge lengths are grown by this part of their mean before angles are taken, which gives
/// degenerate triangles cotangents of at most about twenty, so that 32-bit solves bear slivers, and
/// changes the others by a thousandth (intrinsic mollification, Sharp & Crane 2020).
const MOLLIFICATION: f64 = 1e-3;

/// Mass of a vertex is at least this part of the mean: its inverse enters the system.
const SMALLEST_MASS: f64 = 0.05;

/// Cotangent Laplacian of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Laplacian {
    /// `[vertices + 1]`: where each vertex's neighbours start.
    pub starts: Vec<u32>,
    /// Neighbours of each vertex, ascending.
    pub neighbours: Vec<u32>,
    /// Weight of each neighbour; negative across obtuse angles.
    pub weights: Vec<f64>,
    /// `[vertices]`: mass, mean one.
    pub mass: Vec<f64>,
}

impl Laplacian {
    /// The operator of a mesh: `positions` `[vertices]` in metres, `triangles` with indices in
    /// range. Vertices of no triangle have no neighbour. O(triangles log triangles)
    #[must_use]
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let corners = |&[a, b, c]: &[u32; 3]| [a, b, c].map(|v| positions[v as usize]);
        let lengths = |triangle: &[u32; 3]| {
            let [a, b, c] = corners(triangle);
            [b.distance(c), c.distance(a), a.distance(b)]
        };
        let total: f64 = triangles.iter().flat_map(lengths).sum();
        let growth = MOLLIFICATION * total / (3 * triangles.len().max(1)) as f64;
        let mut edges: BTreeMap<(u32, u32), f64> = BTreeMap::new();
        let mut mass = vec![0.0; positions.len()];
        for triangle in triangles {
            let sides = lengths(triangle).map(|length| length + growth);
            let area = area(sides);
            for corner in 0..3 {
                let (from, to) = (triangle[(corner + 1) % 3], triangle[(corner + 2) % 3]);
                mass[triangle[corner] as usize] += area / 3.0;
                if from == to || area <= 0.0 {
                    continue;
                }
                let [opposite, p, q] = [0, 1, 2].map(|k| sides[(corner + k) % 3]);
                let cotangent = (p * p + q * q - opposite * opposite) / (4.0 * area);
                for edge in [(from, to), (to, from)] {
                    *edges.entry(edge).or_default() += cotangent / 2.0;
                }
            }
        }
        let mut starts = vec![0; positions.len() + 1];
        for &(from, _) in edges.keys() {
            starts[from as usize + 1] += 1;
        }
        for vertex in 0..positions.len() {
            starts[vertex + 1] += starts[vertex];
        }
        let mean = mass.iter().sum::<f64>() / mass.len().max(1) as f64;
        for mass in &mut mass {
            *mass = if mean > 0.0 {
                (*mass / mean).max(SMALLEST_MASS)
            } else {
                1.0
            };
        }
        Self {
            starts,
            neighbours: edges.keys().map(|&(_, to)| to).collect(),
            weights: edges.into_values().collect(),
            mass,
        }
    }

    /// Number of vertices.
    #[must_use]
    pub fn size(&self) -> usize {
        self.mass.len()
    }

    /// Neighbours of a vertex with their weights.
    pub fn row(&self, vertex: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
        let neighbours = &self.neighbours[range.clone()];
        neighbours
            .iter()
            .zip(&self.weights[range])
            .map(|(&to, &weight)| (to as usize, weight))
    }

    /// `L v`. O(edges)
    #[must_use]
    pub fn apply(&self, v: &[DVec3]) -> Vec<DVec3> {
        (0..self.size())
            .map(|i| self.row(i).map(|(j, weight)| weight * (v[i] - v[j])).sum())
            .collect()
    }

    /// Sum of the weights of a vertex: its diagonal entry.
    #[must_use]
    pub fn diagonal(&self, vertex: usize) -> f64 {
        self.row(vertex).map(|(_, weight)| weight).sum()
    }

    /// Lower triangle of `L' M^-1 L`: the matrix of equation 2 of de Aguiar et al. with each
    /// equation weighted by its vertex's share of the surface. (row, column, value), sorted, no
    /// pair twice. O(sum of squared valences)
    #[must_use]
    pub fn squared(&self) -> Vec<(u32, u32, f64)> {
        let mut entries = Vec::new();
        let mut row_of = Vec::new();
        for vertex in 0..self.size() {
            row_of.clear();
            row_of.push((vertex as u32, self.diagonal(vertex)));
            row_of.extend(self.row(vertex).map(|(to, weight)| (to as u32, -weight)));
            for &(row, a) in &row_of {
                for &(column, b) in row_of.iter().filter(|&&(column, _)| column <= row) {
                    entries.push((row, column, a * b / self.mass[vertex]));
                }
            }
        }
        sum_duplicates(entries)
    }

    /// Lower triangle of `L` without the rows and columns of fixed vertices, whose diagonal is
    /// one. Positive definite where every component has a fixed vertex.
    #[must_use]
    pub fn harmonic(&self, fixed: &[bool]) -> Vec<(u32, u32, f64)> {
        self.fixed(fixed, |_, (_, weight)| weight)
    }

    /// How well an edge of this weight conducts rotations: as the core has it.
    #[must_use]
    pub fn conducts(weight: f64) -> f64 {
        weight.max(f64::from(LEAST_CONDUCTION))
    }

    /// The same by [`Self::conducts`] instead of weights, multiplied by the geometric mean of
    /// `conduction` `[vertices]` at both ends, but for edges of fixed vertices.
    #[must_use]
    pub fn conducting(&self, fixed: &[bool], conduction: &[f64]) -> Vec<(u32, u32, f64)> {
        self.fixed(fixed, |vertex, (to, weight)| {
            let both = if fixed[to] {
                1.0
            } else {
                (conduction[vertex] * conduction[to]).sqrt()
            };
            Self::conducts(weight) * both
        })
    }

    fn fixed(
        &self,
        fixed: &[bool],
        conducted: impl Fn(usize, (usize, f64)) -> f64,
    ) -> Vec<(u32, u32, f64)> {
        let mut entries = Vec::new();
        for vertex in 0..self.size() {
            if fixed[vertex] {
                entries.push((vertex as u32, vertex as u32, 1.0));
                continue;
            }
            let mut diagonal = 0.0;
            for edge in self.row(vertex) {
                let (to, weight) = (edge.0, conducted(vertex, edge));
                diagonal += weight;
                if to < vertex && !fixed[to] {
                    entries.push((vertex as u32, to as u32, -weight));
                }
            }
            entries.push((vertex as u32, vertex as u32, diagonal));
        }
        entries
    }
}

/// Area by side lengths, in the order of operations that thin triangles need (Kahan 2014).
fn area(sides: [f64; 3]) -> f64 {
    let mut sides = sides;
    sides.sort_by(f64::total_cmp);
    let [c, b, a] = sides;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    product.max(0.0).sqrt() / 4.0
}

fn sum_duplicates(mut entries: Vec<(u32, u32, f64)>) -> Vec<(u32, u32, f64)> {
    entries.sort_by_key(|&(row, column, _)| (row, column));
    entries.dedup_by(|next, kept| {
        let same = (next.0, next.1) == (kept.0, kept.1);
        if same {
            kept.2 += next.2;
        }
        same
    });
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        let positions = corners.map(|(x, y)| DVec3::new(x, y, 0.0)).to_vec();
        (positions, vec![[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn a_square_has_half_weights_on_its_sides_and_none_on_the_diagonal() {
        let (positions, triangles) = square();
        let laplacian = Laplacian::new(&positions, &triangles);
        let row: Vec<_> = laplacian.row(0).collect();
        assert_eq!(row.iter().map(|r| r.0).collect::<Vec<_>>(), [1, 2, 3]);
        for ((_, weight), want) in row.iter().zip([0.5, 0.0, 0.5]) {
            assert!((weight - want).abs() < 2e-3, "{weight}");
        }
        // Corners 0 and 2 touch both triangles.
        assert!((laplacian.mass[0] - 4.0 / 3.0).abs() < 2e-3);
        assert!((laplacian.mass[1] - 2.0 / 3.0).abs() < 2e-3);
    }

    #[test]
    fn linear_functions_are_harmonic_inside_a_plane() {
        // A ring of six around a point off its centre, so that some angles are obtuse.
        let mut positions = vec![DVec3::new(0.55, 0.3, 0.0)];
        positions.extend((0..6).map(|k| {
            let angle = f64::from(k) * std::f64::consts::FRAC_PI_3;
            DVec3::new(angle.cos(), angle.sin(), 0.0)
        }));
        let triangles: Vec<_> = (0..6).map(|k| [0, 1 + k, 1 + (k + 1) % 6]).collect();
        let laplacian = Laplacian::new(&positions, &triangles);
        assert!(laplacian.apply(&positions)[0].length() < 5e-3);
    }

    #[test]
    fn degenerate_triangles_give_finite_positive_semidefinite_weights() {
        let (mut positions, mut triangles) = square();
        positions.push(DVec3::new(0.5, 0.0, 0.0));
        // No area; a corner twice; all corners in one place.
        triangles.extend([[0, 4, 1], [0, 1, 1], [4, 4, 4]]);
        positions.push(positions[4]);
        triangles.push([4, 5, 4]);
        let laplacian = Laplacian::new(&positions, &triangles);
        assert!(laplacian.weights.iter().all(|weight| weight.is_finite()));
        for seed in 1..20_u32 {
            let v: Vec<_> = (0..6)
                .map(|k| f64::from(seed * (k + 3) * 7919 % 101))
                .collect();
            let energy: f64 = (0..6)
                .flat_map(|i| laplacian.row(i).map(move |(j, w)| (i, j, w)))
                .map(|(i, j, w)| w * (v[i] - v[j]).powi(2))
                .sum();
            assert!(energy > -1e-6, "{energy}");
        }
    }

    #[test]
    fn the_squared_operator_is_the_product() {
        let (positions, triangles) = square();
        let laplacian = Laplacian::new(&positions, &triangles);
        let dense = |i: usize, j: usize| {
            if i == j {
                laplacian.diagonal(i)
            } else {
                laplacian
                    .row(i)
                    .find(|&(to, _)| to == j)
                    .map_or(0.0, |(_, w)| -w)
            }
        };
        for (row, column, value) in laplacian.squared() {
            let (row, column) = (row as usize, column as usize);
            assert!(column <= row);
            let product: f64 = (0..4)
                .map(|k| dense(k, row) * dense(k, column) / laplacian.mass[k])
                .sum();
            assert!((product - value).abs() < 1e-12);
        }
    }
}
