//! Tables of the exact mode: reference frames, pseudo-inverses, supports (section 5.3).

use glam::{DMat3, DVec3};
use sinew_core::asset::LANES;

use super::spread::Skin;
use super::tables::{BlockTables, ModeTables};
use crate::clean::linear::{Cholesky, symmetric_eigen};

/// Pull of a part's transformation toward the identity, as a part of its weight: quadratic
/// columns, linear columns, the constant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ridge {
    /// Squares and products.
    pub quadratic: f64,
    /// Linear columns.
    pub linear: f64,
    /// The constant.
    pub constant: f64,
}

impl Default for Ridge {
    fn default() -> Self {
        Self {
            quadratic: 0.1,
            linear: 0.05,
            constant: 1e-3,
        }
    }
}

/// Markers needed for the ten columns of a quadratic part, and for the four of an affine one.
const QUADRATIC_MARKERS: usize = 14;
const AFFINE_MARKERS: usize = 5;
/// Least support of the radial basis, in marker spacings.
const LEAST_SUPPORT: f64 = 2.0;
/// Added to the diagonal of the radial-basis systems.
const SMOOTHING: f32 = 0.04;
const COLUMNS: usize = 10;

/// A part that a marker is a member of.
#[derive(Clone, Copy, Debug)]
pub struct Membership {
    /// Which.
    pub part: u32,
    /// How much the marker counts in the part's transformation.
    pub weight: f64,
    /// The part's share in the surface at the marker.
    pub share: f64,
}

/// Tables of all parts. `memberships`: `[markers]`; `rest`: `[markers]`, metres; `vertex_weights`: `[parts][vertices]`, the fields behind the weights of `blocks`.
#[must_use]
pub fn tables(
    blocks: &BlockTables,
    skin: &Skin,
    memberships: &[Vec<Membership>],
    rest: &[DVec3],
    vertex_weights: &[Vec<f64>],
    ridge: Ridge,
) -> ModeTables {
    let mut out = ModeTables {
        gradients: gradients(blocks, skin, vertex_weights),
        member_starts: vec![0],
        smoothing: SMOOTHING,
        ..ModeTables::default()
    };
    for part in 0..vertex_weights.len() {
        let members: Vec<(usize, Membership)> = memberships
            .iter()
            .enumerate()
            .flat_map(|(marker, row)| {
                let own = row.iter().filter(|own| own.part as usize == part);
                own.map(move |own| (marker, *own))
            })
            .collect();
        let points: Vec<DVec3> = members.iter().map(|&(marker, _)| rest[marker]).collect();
        let frame = Frame::new(&points);
        out.to_local.push(frame.to_local());
        out.from_local.push(frame.inverse());
        let support = support(&points).max(LEAST_SUPPORT * skin.spacing());
        out.dilations.push((2.0 / support) as f32);
        let local: Vec<DVec3> = points.iter().map(|&p| frame.local(p)).collect();
        let weights: Vec<f64> = members.iter().map(|m| m.1.weight).collect();
        let inverse = pseudo_inverse(&local, &weights, ridge);
        for ((&(marker, own), local), inverse) in members.iter().zip(&local).zip(inverse) {
            out.member_markers.push(marker as u16);
            let local = local.extend(own.share);
            out.member_local.push(local.as_vec4().to_array());
            out.member_inverse.push(inverse.map(|value| value as f32));
        }
        out.member_starts.push(out.member_markers.len() as u32);
    }
    out
}

/// How the weights of the blocks' vertices change along their tangents.
fn gradients(
    blocks: &BlockTables,
    skin: &Skin,
    vertex_weights: &[Vec<f64>],
) -> Vec<[[f32; LANES]; 2]> {
    let mut out = Vec::with_capacity(blocks.parts.len());
    for (block, vertices) in blocks.order.chunks(LANES).enumerate() {
        let slots = blocks.starts[block] as usize..blocks.starts[block + 1] as usize;
        let mut rows: Vec<[[f64; LANES]; 2]> = Vec::new();
        for &part in &blocks.parts[slots] {
            let field = &vertex_weights[usize::from(part)];
            let mut row = [[0.0; LANES]; 2];
            for lane in 0..LANES {
                let vertex = vertices[lane.min(vertices.len() - 1)] as usize;
                let slope = skin.derivative(vertex, |at| field[at]);
                (row[0][lane], row[1][lane]) = (slope[0], slope[1]);
            }
            rows.push(row);
        }
        // Weights sum to one everywhere, so their changes sum to nothing.
        let count = rows.len().max(1) as f64;
        for axis in 0..2 {
            for lane in 0..LANES {
                let mean = rows.iter().map(|row| row[axis][lane]).sum::<f64>() / count;
                for row in &mut rows {
                    row[axis][lane] -= mean;
                }
            }
        }
        out.extend(
            rows.iter()
                .map(|row| row.map(|lanes| lanes.map(|x| x as f32))),
        );
    }
    out
}

/// The local part reference frame, scaled to the part's size.
struct Frame {
    origin: DVec3,
    /// Rows are the axes.
    axes: DMat3,
    size: f64,
}

impl Frame {
    /// Mean of the points and eigenvectors of their covariance.
    fn new(points: &[DVec3]) -> Self {
        let count = points.len().max(1) as f64;
        let origin = points.iter().sum::<DVec3>() / count;
        let mut covariance = vec![0.0; 9];
        for point in points {
            let d = (*point - origin).to_array();
            for (at, sum) in covariance.iter_mut().enumerate() {
                *sum += d[at / 3] * d[at % 3] / count;
            }
        }
        let size = (covariance[0] + covariance[4] + covariance[8]).sqrt();
        let (_, rows) = symmetric_eigen(3, covariance);
        let [x, y] = [0, 3].map(|at| DVec3::new(rows[at], rows[at + 1], rows[at + 2]));
        let axes = DMat3::from_cols(x, y, x.cross(y)).transpose();
        Self {
            origin,
            axes,
            size: size.max(1e-3),
        }
    }

    fn local(&self, point: DVec3) -> DVec3 {
        self.axes * (point - self.origin) / self.size
    }

    fn to_local(&self) -> [f32; 12] {
        let linear = self.axes * (1.0 / self.size);
        rows(linear, -(linear * self.origin))
    }

    fn inverse(&self) -> [f32; 12] {
        rows(self.axes.transpose() * self.size, self.origin)
    }
}

fn rows(linear: DMat3, shift: DVec3) -> [f32; 12] {
    std::array::from_fn(|at| match (at / 4, at % 4) {
        (row, 3) => shift[row] as f32,
        (row, column) => linear.col(column)[row] as f32,
    })
}

/// Twice the largest distance from a member to the nearest other one.
fn support(points: &[DVec3]) -> f64 {
    let nearest = |(at, point): (usize, &DVec3)| {
        let others = points.iter().enumerate().filter(|(other, _)| *other != at);
        others
            .map(|(_, other)| point.distance(*other))
            .fold(f64::INFINITY, f64::min)
    };
    let all = points.iter().enumerate().map(nearest);
    2.0 * all.filter(|d| d.is_finite()).fold(0.0, f64::max)
}

/// Rows `[members]` of `Q' (Q W Q' + ridge)^-1 W` (equation 6); zeros in columns that so few
/// markers cannot fix.
fn pseudo_inverse(local: &[DVec3], weights: &[f64], ridge: Ridge) -> Vec<[f64; COLUMNS]> {
    let columns: &[usize] = match local.len() {
        n if n >= QUADRATIC_MARKERS => &[9, 0, 1, 2, 3, 4, 5, 6, 7, 8],
        n if n >= AFFINE_MARKERS => &[9, 0, 1, 2],
        _ => return vec![[0.0; COLUMNS]; local.len()],
    };
    let n = columns.len();
    let total: f64 = weights.iter().sum();
    let mut matrix = vec![0.0; n * n];
    for (terms, weight) in local.iter().map(terms).zip(weights) {
        for (row, &i) in columns.iter().enumerate() {
            for (column, &j) in columns.iter().enumerate() {
                matrix[row * n + column] += weight * terms[i] * terms[j];
            }
        }
    }
    for (row, &i) in columns.iter().enumerate() {
        let pull = match i {
            9 => ridge.constant,
            0..=2 => ridge.linear,
            _ => ridge.quadratic,
        };
        matrix[row * n + row] += pull * total;
    }
    let Some(factor) = Cholesky::new(n, matrix) else {
        return vec![[0.0; COLUMNS]; local.len()];
    };
    let rows = local.iter().map(terms).zip(weights).map(|(terms, weight)| {
        let mut right: Vec<f64> = columns.iter().map(|&i| weight * terms[i]).collect();
        factor.solve(&mut right, 1);
        let mut row = [0.0; COLUMNS];
        for (&i, value) in columns.iter().zip(right) {
            row[i] = value;
        }
        row
    });
    rows.collect()
}

fn terms(p: &DVec3) -> [f64; COLUMNS] {
    let [x, y, z] = p.to_array();
    [x, y, z, x * x, y * y, z * z, x * y, y * z, z * x, 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quadratic_field_is_found_and_few_markers_fall_back() {
        let points: Vec<DVec3> = (0..40)
            .map(|k| {
                let k = f64::from(k);
                DVec3::new((1.3 * k).sin(), (2.1 * k).cos(), (0.7 * k + 1.0).sin())
            })
            .collect();
        let none = Ridge {
            quadratic: 1e-12,
            linear: 1e-12,
            constant: 1e-12,
        };
        let rows = pseudo_inverse(&points, &[1.0; 40], none);
        // x moves by 0.2 x y - 0.1.
        let moved: Vec<f64> = points.iter().map(|p| 0.2 * p.x * p.y - 0.1).collect();
        let column = |at: usize| -> f64 { rows.iter().zip(&moved).map(|(r, m)| r[at] * m).sum() };
        assert!((column(6) - 0.2).abs() < 1e-6 && (column(9) + 0.1).abs() < 1e-6);
        assert!(column(0).abs() < 1e-6 && column(3).abs() < 1e-6);
        let few = pseudo_inverse(&points[..6], &[1.0; 6], Ridge::default());
        assert!(few.iter().all(|row| row[3..9].iter().all(|x| *x == 0.0)));
        let fewer = pseudo_inverse(&points[..3], &[1.0; 3], Ridge::default());
        assert_eq!(fewer, vec![[0.0; COLUMNS]; 3]);
    }
}
