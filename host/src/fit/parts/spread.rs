//! How what is known at markers spreads over a surface.
//!
//! *Biharmonic* weights spread residuals: they interpolate the markers, are as smooth as can be
//! between them, and fade where there is none (hands, face), so that nothing is extrapolated. The
//! same weights spread memberships in parts where no rig gives them. (Harmonic weights were tried:
//! they have spikes at the markers.)

use glam::DVec3;

use super::{Glued, PartsFitError};
use crate::fit::laplace::cholesky::Cholesky;
use crate::fit::laplace::graph::Graph;
use crate::fit::laplace::operator::Laplacian;
use crate::spatial::weld;
use sinew_core::deform::parts::tangents_of;

/// Weight of markers against smoothness, as a part of the mean diagonal.
const HOLD: f64 = 100.0;
/// Weights fade over this many marker spacings where there is no marker.
const REACH: f64 = 2.5;
/// Local weights fade out below twice this,
const RIPPLE: f64 = 0.03;
/// and between so many marker spacings from the nearest marker.
const EXTENT: [f64; 2] = [1.0, 2.0];

/// A surface prepared for spreading; vertices in one place count as one.
#[derive(Debug)]
pub struct Skin {
    /// `[vertices]`: the first vertex in the same place.
    welded: Vec<u32>,
    laplacian: Laplacian,
    graph: Graph,
    /// `[vertices]`: neighbours with their shares in the derivative along two tangents.
    slopes: Vec<Vec<(u32, [f64; 2])>>,
    /// Mean distance between neighbouring markers, metres.
    spacing: f64,
    /// Mean area of a vertex, square metres.
    area: f64,
}

impl Skin {
    /// Prepares a mesh: positions and unit normals `[vertices]`. O(triangles log triangles)
    #[must_use]
    pub fn new(
        positions: &[DVec3],
        normals: &[DVec3],
        triangles: &[[u32; 3]],
        markers: &[Glued],
    ) -> Self {
        let welded = weld(positions);
        let triangles: Vec<[u32; 3]> = triangles
            .iter()
            .map(|t| t.map(|at| welded[at as usize]))
            .filter(|[a, b, c]| a != b && b != c && c != a)
            .collect();
        let graph = Graph::new(positions, &triangles);
        let area: f64 = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|at| positions[at as usize]);
                (b - a).cross(c - a).length() / 2.0
            })
            .sum();
        let places = (0..positions.len()).filter(|&v| welded[v] as usize == v);
        let places = places.count().max(1);
        let slopes = (0..positions.len())
            .map(|vertex| slope(vertex, positions, normals, &graph, &welded))
            .collect();
        let at: Vec<DVec3> = markers.iter().map(|marker| marker.on(positions)).collect();
        Self {
            laplacian: Laplacian::new(positions, &triangles),
            graph,
            slopes,
            spacing: mean_spacing(&at),
            area: area / places as f64,
            welded,
        }
    }

    /// Mean distance from a marker to the nearest other one, metres.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Derivatives of a field `[vertices]` along both tangents of a vertex, a metre.
    #[must_use]
    pub fn derivative(&self, vertex: usize, field: impl Fn(usize) -> f64) -> [f64; 2] {
        let here = field(vertex);
        let mut sums = [0.0; 2];
        for &(to, shares) in &self.slopes[vertex] {
            let step = field(to as usize) - here;
            sums[0] += shares[0] * step;
            sums[1] += shares[1] * step;
        }
        sums
    }

    /// Distances `[markers][vertices]` along the surface, metres. O(markers edges log vertices)
    #[must_use]
    pub fn distances(&self, markers: &[Glued]) -> Vec<Vec<f32>> {
        let one = |marker: &Glued| {
            let corners = marker.vertices.iter().zip(marker.weights);
            let nearest = corners.max_by(|a, b| a.1.total_cmp(&b.1));
            let nearest = nearest.map_or(0, |(&vertex, _)| self.welded[vertex as usize]);
            let distances = self.graph.distances(&[nearest]);
            let all = self.welded.iter();
            all.map(|&vertex| distances[vertex as usize]).collect()
        };
        markers.iter().map(one).collect()
    }

    /// Biharmonic weights `[markers][vertices]`. One factorisation, a solve a marker.
    ///
    /// # Errors
    /// A surface that cannot be factored.
    pub fn biharmonic(&self, markers: &[Glued]) -> Result<Vec<Vec<f64>>, PartsFitError> {
        let reach = REACH * self.spacing;
        let fade = (self.area / (reach * reach)).powi(2);
        let mut lower = self.laplacian.squared();
        let mass = self.laplacian.mass.iter().enumerate();
        lower.extend(mass.map(|(at, mass)| (at as u32, at as u32, fade * mass)));
        let ones: Vec<Vec<f64>> = (0..markers.len())
            .map(|at| {
                let mut column = vec![0.0; markers.len()];
                column[at] = 1.0;
                column
            })
            .collect();
        self.hold(lower, markers, &ones)
    }

    /// Biharmonic weights `[markers][vertices]` without their ripples and without what they
    /// extrapolate: flesh is alike near a marker, and no marker tells what lies far from all.
    /// O(markers vertices)
    #[must_use]
    pub fn local(&self, mut weights: Vec<Vec<f64>>, markers: &[Glued]) -> Vec<Vec<f64>> {
        let distances = self.distances(markers);
        let [near, far] = EXTENT.map(|extent| extent * self.spacing);
        for vertex in 0..self.welded.len() {
            let whole: f64 = weights.iter().map(|field| field[vertex]).sum();
            for field in &mut weights {
                let weight = &mut field[vertex];
                *weight *= smooth_step((weight.abs() - RIPPLE) / RIPPLE);
            }
            let kept: f64 = weights.iter().map(|field| field[vertex]).sum();
            let nearest = distances.iter().map(|d| f64::from(d[vertex]));
            let away = nearest.fold(f64::INFINITY, f64::min);
            let fade = smooth_step((far - away) / (far - near));
            let share = fade * (whole / kept.max(1e-3)).clamp(0.0, 1.5);
            for field in &mut weights {
                field[vertex] *= share;
            }
        }
        weights
    }

    fn hold(
        &self,
        mut lower: Vec<(u32, u32, f64)>,
        markers: &[Glued],
        values: &[Vec<f64>],
    ) -> Result<Vec<Vec<f64>>, PartsFitError> {
        let size = self.laplacian.size();
        let diagonal: f64 = lower.iter().filter(|e| e.0 == e.1).map(|e| e.2).sum();
        let hold = HOLD * diagonal / size.max(1) as f64;
        let corners = |marker: &Glued| {
            let vertices = marker.vertices.map(|vertex| self.welded[vertex as usize]);
            let mut corners: Vec<(u32, f64)> = Vec::with_capacity(3);
            for (vertex, weight) in vertices.into_iter().zip(marker.weights) {
                match corners.iter_mut().find(|(other, _)| *other == vertex) {
                    Some((_, sum)) => *sum += weight,
                    None => corners.push((vertex, weight)),
                }
            }
            corners
        };
        let glue: Vec<Vec<(u32, f64)>> = markers.iter().map(corners).collect();
        for row in &glue {
            for &(i, a) in row {
                for &(j, b) in row.iter().filter(|&&(j, _)| j <= i) {
                    lower.push((i, j, hold * a * b));
                }
            }
        }
        lower.sort_by_key(|&(row, column, _)| (row, column));
        lower.dedup_by(|next, kept| {
            let same = (next.0, next.1) == (kept.0, kept.1);
            if same {
                kept.2 += next.2;
            }
            same
        });
        // Vertices that others stand for touch nothing and would leave the system singular.
        for entry in lower.iter_mut().filter(|entry| entry.0 == entry.1) {
            if entry.2 <= 0.0 {
                entry.2 = 1.0;
            }
        }
        let factor = Cholesky::new(size, &lower, None)?;
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let mut fields = vec![Vec::new(); values.len()];
        let chunk = values.len().div_ceil(threads).max(1);
        std::thread::scope(|scope| {
            for (values, fields) in values.chunks(chunk).zip(fields.chunks_mut(chunk)) {
                let (factor, glue, welded) = (&factor, &glue, &self.welded);
                scope.spawn(move || {
                    for (values, field) in values.iter().zip(fields) {
                        let mut right = vec![0.0; size];
                        for (row, value) in glue.iter().zip(values) {
                            for &(vertex, weight) in row {
                                right[vertex as usize] += hold * weight * value;
                            }
                        }
                        factor.solve(&mut right);
                        *field = welded.iter().map(|&at| right[at as usize]).collect();
                    }
                });
            }
        });
        Ok(fields)
    }
}

/// From 0 to 1 without a kink.
fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Least-squares derivative over the neighbours of a vertex.
fn slope(
    vertex: usize,
    positions: &[DVec3],
    normals: &[DVec3],
    graph: &Graph,
    welded: &[u32],
) -> Vec<(u32, [f64; 2])> {
    let [along, across] = tangents_of(normals[vertex].as_vec3().to_array())
        .map(|t| DVec3::from_array(t.map(f64::from)));
    let (mut aa, mut ab, mut bb) = (0.0, 0.0, 0.0);
    let ring = graph.row(welded[vertex]);
    let steps: Vec<(u32, f64, f64)> = ring
        .iter()
        .map(|&(to, _)| {
            let step = positions[to as usize] - positions[vertex];
            (to, step.dot(along), step.dot(across))
        })
        .collect();
    for &(_, a, b) in &steps {
        aa += a * a;
        ab += a * b;
        bb += b * b;
    }
    let determinant = aa * bb - ab * ab;
    if determinant <= 1e-6 * (aa + bb) * (aa + bb) {
        return Vec::new();
    }
    let shares = |&(to, a, b): &(u32, f64, f64)| {
        let u = (bb * a - ab * b) / determinant;
        let v = (aa * b - ab * a) / determinant;
        (to, [u, v])
    };
    steps.iter().map(shares).collect()
}

fn mean_spacing(points: &[DVec3]) -> f64 {
    let nearest = |(at, point): (usize, &DVec3)| {
        let others = points.iter().enumerate().filter(|(other, _)| *other != at);
        others
            .map(|(_, other)| point.distance(*other))
            .fold(f64::INFINITY, f64::min)
    };
    let sum: f64 = points.iter().enumerate().map(nearest).sum();
    if points.len() < 2 {
        return 0.1;
    }
    (sum / points.len() as f64).max(1e-4)
}
