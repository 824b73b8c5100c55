//! A surface with its markers: the systems of de Aguiar et al. 2007, section 3.3, factored.

use glam::DVec3;

use super::cholesky::{Cholesky, PackedFactor};
use super::graph::Graph;
use super::operator::Laplacian;
use super::shares::{guide, harmonic_weights, rotation_system, rule};
use super::{Component, LaplaceError};
use sinew_core::asset::Lanes3;
use sinew_core::deform::laplacian::{Exact, ExactParts, LaplacianError};

/// How a surface follows its markers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceOptions {
    /// Weight of marker positions, as a part of the system's mean diagonal. Larger values pull
    /// harder, up to a dimple at the marker.
    pub stiffness: f64,
    /// How strongly each marker holds what surrounds it, against bending over the distance to the
    /// next marker: rotations then change half-way between markers, and the rigid motion of the
    /// marker around pulls at places. 0 leaves the paper's equations, where a harmonic field has a
    /// spike at each marker and changes everywhere else.
    pub hold: f64,
}

impl SurfaceOptions {
    /// The equations of the paper.
    pub const PAPER: Self = Self {
        stiffness: 0.1,
        hold: 0.0,
    };
}

impl Default for SurfaceOptions {
    fn default() -> Self {
        Self {
            hold: 100.0,
            ..Self::PAPER
        }
    }
}

/// A surface, its markers and the factored systems, in `f64`.
#[derive(Debug)]
pub struct Surface {
    /// `[vertices]`, metres, at rest.
    pub positions: Vec<DVec3>,
    /// Cotangent weights and masses.
    pub laplacian: Laplacian,
    /// Vertex of each marker.
    pub markers: Vec<u32>,
    /// Pairs of neighbouring markers: the minimal spanning tree by distance along the surface,
    /// parents first.
    pub marker_edges: Vec<[u16; 2]>,
    /// `[markers x vertices]`: distance of each vertex from each marker along edges, metres;
    /// infinite across components.
    pub distances: Vec<Vec<f32>>,
    /// `[markers x vertices]`: shares of the markers in rotations, which sum to one at each vertex.
    pub weights: Vec<Vec<f64>>,
    /// Weight of a marker's position.
    pub stiffness: f64,
    /// `[vertices]`: the four markers with the largest share in each and their weights, which sum to
    /// one: the vertex is about where its rotation puts it from their mean place.
    pub guides: Vec<([u16; 4], [f64; 4])>,
    /// `[vertices]`: weight of that guess.
    pub pull: Vec<f64>,
    /// `L` with the markers fixed, conducting best where one marker rules.
    pub harmonic: Cholesky,
    /// `L' M^-1 L + stiffness A + pull` (equation 2, mass-weighted).
    pub bilaplacian: Cholesky,
}

impl Surface {
    /// Factors the systems of a mesh: `positions` `[vertices]` in metres, `markers` vertex
    /// indices. O(fill); seconds for 50 k vertices.
    ///
    /// # Errors
    /// Positions that are not finite, indices that do not exist, a component of the surface (a
    /// vertex of no triangle is one) without a marker, a system that cannot be factored.
    pub fn new(
        positions: Vec<DVec3>,
        triangles: &[[u32; 3]],
        markers: Vec<u32>,
        options: &SurfaceOptions,
    ) -> Result<Self, LaplaceError> {
        check(&positions, triangles, &markers)?;
        let graph = Graph::new(&positions, triangles);
        let mut marked = vec![false; positions.len()];
        markers.iter().for_each(|&v| marked[v as usize] = true);
        let unmarked: Vec<Component> = graph
            .components()
            .iter()
            .filter(|vertices| !vertices.iter().any(|&v| marked[v as usize]))
            .map(|vertices| component(vertices, &positions))
            .collect();
        if !unmarked.is_empty() {
            let components = unmarked;
            return Err(LaplaceError::Unmarked { components });
        }
        let laplacian = Laplacian::new(&positions, triangles);
        let size = positions.len();
        let even = rotation_system(&laplacian, &vec![0.0; size], &markers, None)?;
        let mut weights = harmonic_weights(&laplacian, &even, &markers);
        let distances: Vec<_> = markers.iter().map(|&v| graph.distances(&[v])).collect();
        // Bending over the distance between markers weighs (markers / vertices)^2.
        let density = (markers.len() as f64 / size as f64).powi(2);
        let pull: Vec<f64> = rule(&weights, &distances, &markers)
            .iter()
            .zip(&laplacian.mass)
            .map(|(rule, mass)| options.hold * density * mass * rule)
            .collect();
        if options.hold > 0.0 {
            let held = rotation_system(&laplacian, &pull, &markers, Some(&even.order()))?;
            weights = harmonic_weights(&laplacian, &held, &markers);
        }
        drop(even);
        let mut squared = laplacian.squared();
        let diagonal = squared.iter().filter(|entry| entry.0 == entry.1);
        let mean = diagonal.map(|entry| entry.2).sum::<f64>() / size as f64;
        let stiffness = options.stiffness * mean;
        for entry in squared.iter_mut().filter(|entry| entry.0 == entry.1) {
            let vertex = entry.0 as usize;
            entry.2 += pull[vertex] + if marked[vertex] { stiffness } else { 0.0 };
        }
        let bilaplacian = Cholesky::new(size, &squared, None)?;
        drop(squared);
        // The harmonic system's pattern lies inside the other one's, so one order serves both.
        let order = bilaplacian.order();
        let harmonic = rotation_system(&laplacian, &pull, &markers, Some(&order))?;
        let guides = (0..size).map(|vertex| guide(&weights, vertex)).collect();
        let marker_edges = spanning_tree(&markers, &distances, &positions);
        Ok(Self {
            positions,
            laplacian,
            markers,
            marker_edges,
            distances,
            weights,
            stiffness,
            guides,
            pull,
            harmonic,
            bilaplacian,
        })
    }

    /// Rest positions of the markers, metres.
    #[must_use]
    pub fn marker_rest(&self) -> Vec<DVec3> {
        let positions = self.markers.iter();
        positions.map(|&v| self.positions[v as usize]).collect()
    }

    /// Tables of the core's exact deformer: vertex after vertex, without normals. O(fill)
    ///
    /// # Errors
    /// [`LaplaceError::TooLarge`].
    pub fn exact(&self) -> Result<ExactTables, LaplaceError> {
        let order = self.bilaplacian.order();
        let mut row_of = vec![0_u32; order.len()];
        for (row, &vertex) in order.iter().enumerate() {
            row_of[vertex as usize] = row as u32;
        }
        let differential = self.laplacian.apply(&self.positions);
        let mut tables = ExactTables {
            rest: order
                .iter()
                .map(|&v| {
                    row4(
                        self.positions[v as usize],
                        1.0 / self.laplacian.mass[v as usize],
                    )
                })
                .collect(),
            differential: order
                .iter()
                .map(|&v| row4(differential[v as usize], self.pull[v as usize]))
                .collect(),
            starts: vec![0],
            lane_rows: row_of.clone(),
            marker_rows: self.markers.iter().map(|&v| row_of[v as usize]).collect(),
            marker_edges: self.marker_edges.clone(),
            stiffness: self.stiffness as f32,
            harmonic: self.harmonic.pack()?,
            bilaplacian: self.bilaplacian.pack()?,
            ..ExactTables::default()
        };
        for &vertex in &order {
            for (neighbour, weight) in self.laplacian.row(vertex as usize) {
                tables.neighbours.push(row_of[neighbour]);
                tables.weights.push(weight as f32);
            }
            tables.starts.push(tables.neighbours.len() as u32);
            let (markers, weights) = self.guides[vertex as usize];
            tables.guide_markers.push(markers);
            tables
                .guide_weights
                .push(weights.map(|weight| weight as f32));
        }
        tables.order = (0..order.len() as u32).collect();
        Ok(tables)
    }
}

/// Owned tables of [`Exact`]; the fields are those of [`ExactParts`].
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(missing_docs, reason = "each field is documented in ExactParts")]
pub struct ExactTables {
    pub order: Vec<u32>,
    pub lane_rows: Vec<u32>,
    pub rest_normals: Vec<Lanes3>,
    pub rest: Vec<[f32; 4]>,
    pub differential: Vec<[f32; 4]>,
    pub starts: Vec<u32>,
    pub neighbours: Vec<u32>,
    pub weights: Vec<f32>,
    pub marker_rows: Vec<u32>,
    pub marker_edges: Vec<[u16; 2]>,
    pub stiffness: f32,
    pub guide_markers: Vec<[u16; 4]>,
    pub guide_weights: Vec<[f32; 4]>,
    pub harmonic: PackedFactor,
    pub bilaplacian: PackedFactor,
}

impl ExactTables {
    /// The core's view, checked.
    ///
    /// # Errors
    /// What the core refuses.
    pub fn exact(&self) -> Result<Exact<'_>, LaplacianError> {
        Exact::new_checked(self.parts())
    }

    /// The core's view.
    #[must_use]
    pub fn parts(&self) -> ExactParts<'_> {
        ExactParts {
            order: &self.order,
            lane_rows: &self.lane_rows,
            rest_normals: &self.rest_normals,
            rest: &self.rest,
            differential: &self.differential,
            starts: &self.starts,
            neighbours: &self.neighbours,
            weights: &self.weights,
            marker_rows: &self.marker_rows,
            marker_edges: &self.marker_edges,
            stiffness: self.stiffness,
            guide_markers: &self.guide_markers,
            guide_weights: &self.guide_weights,
            harmonic: self.harmonic.parts(),
            bilaplacian: self.bilaplacian.parts(),
        }
    }
}

fn row4(v: DVec3, last: f64) -> [f32; 4] {
    [v.x as f32, v.y as f32, v.z as f32, last as f32]
}

fn check(positions: &[DVec3], triangles: &[[u32; 3]], markers: &[u32]) -> Result<(), LaplaceError> {
    const FAR: f64 = 1e6;
    let count = positions.len();
    if let Some(vertex) = positions
        .iter()
        .position(|p| p.abs().max_element() > FAR || !p.is_finite())
    {
        let position = positions[vertex];
        return Err(LaplaceError::BadPosition { vertex, position });
    }
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= count) {
            return Err(LaplaceError::BadTriangle {
                triangle,
                vertex,
                count,
            });
        }
    }
    if triangles.is_empty() {
        return Err(LaplaceError::NoSurface);
    }
    let limit = usize::from(u16::MAX / 2);
    if markers.is_empty() || markers.len() > limit {
        let count = markers.len();
        return Err(LaplaceError::MarkerCount { count, limit });
    }
    let mut seen = std::collections::HashSet::new();
    for (marker, &vertex) in markers.iter().enumerate() {
        let why = match vertex {
            _ if vertex as usize >= count => "which does not exist",
            _ if !seen.insert(vertex) => "where another marker is already",
            _ => continue,
        };
        return Err(LaplaceError::BadMarker {
            marker,
            vertex,
            why,
        });
    }
    Ok(())
}

pub(super) fn component(vertices: &[u32], positions: &[DVec3]) -> Component {
    let places = || vertices.iter().map(|&v| positions[v as usize]);
    let low = places().fold(DVec3::INFINITY, DVec3::min);
    let high = places().fold(DVec3::NEG_INFINITY, DVec3::max);
    Component {
        vertex: vertices.iter().copied().min().unwrap_or(0),
        vertices: vertices.len(),
        centre: (low + high) / 2.0,
    }
}

/// Prim's algorithm from marker 0; markers of other components join by straight distance.
fn spanning_tree(markers: &[u32], distances: &[Vec<f32>], positions: &[DVec3]) -> Vec<[u16; 2]> {
    let length = |a: usize, b: usize| {
        let along = f64::from(distances[a][markers[b] as usize]);
        let straight = positions[markers[a] as usize].distance(positions[markers[b] as usize]);
        // Bodies are a few metres: whatever is connected comes first.
        if along.is_finite() {
            along
        } else {
            1e7 + straight
        }
    };
    let mut nearest: Vec<(f64, usize)> = (0..markers.len()).map(|b| (length(0, b), 0)).collect();
    let mut outside: Vec<usize> = (1..markers.len()).collect();
    let mut edges = Vec::new();
    while let Some(at) =
        (0..outside.len()).min_by(|&a, &b| nearest[outside[a]].0.total_cmp(&nearest[outside[b]].0))
    {
        let next = outside.swap_remove(at);
        edges.push([nearest[next].1 as u16, next as u16]);
        for &other in &outside {
            let candidate = length(next, other);
            if candidate < nearest[other].0 {
                nearest[other] = (candidate, next);
            }
        }
    }
    edges
}
