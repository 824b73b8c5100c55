//! A mesh made ready for questions about its inside: welded, facing outward, filled with cells.

use glam::DVec3;

use super::laplace::LaplaceError;
use super::laplace::graph::Graph;
use super::laplace::nearest::Nearest;
use super::laplace::repair::{RepairOptions, Repaired, repair};
use crate::model::{Mesh, vertex_normals};
use crate::spatial::{Solid, face_outward};

/// Cells along the longest side of a body: 7 mm on a tall man, so that fingers have an inside.
pub const CELLS: usize = 256;

/// A surface and what lies inside.
#[derive(Debug)]
pub struct Inside {
    /// Vertices in one place are one; the way back is [`Repaired::vertex_of`].
    pub surface: Repaired,
    /// `[vertices of the surface]`, outward.
    pub normals: Vec<DVec3>,
    /// The cells.
    pub solid: Solid,
}

/// What a vertex takes from the cells.
#[derive(Clone, Debug)]
pub struct Marks {
    /// `[vertices of the surface]`: distance through the inside, metres.
    pub distance: Vec<f32>,
    /// `[vertices of the surface]`: mark of the nearest seed.
    pub mark: Vec<u32>,
    /// Vertices of components without an inside, which took what the nearest vertex has.
    pub attached: usize,
}

impl Inside {
    /// Welds, turns and fills a mesh. O(cells in its box + triangles log triangles)
    ///
    /// # Errors
    /// [`LaplaceError::NoSurface`].
    pub fn new(mesh: &Mesh, cells: usize) -> Result<Self, LaplaceError> {
        let mut surface = repair(&mesh.positions, &mesh.triangles, &RepairOptions::default())?;
        let own: Vec<u32> = (0..surface.positions.len() as u32).collect();
        surface.triangles = face_outward(&surface.positions, &surface.triangles, &own);
        let solid = Solid::new(&surface.positions, &surface.triangles, cells);
        Ok(Self {
            normals: vertex_normals(&surface.positions, &surface.triangles),
            surface,
            solid,
        })
    }

    /// Hands distances and marks of cells to the vertices: from cells under the vertex, else along
    /// the surface, else from the nearest vertex of another component; `None` where no vertex has a
    /// cell with a mark. O(edges log vertices)
    #[must_use]
    pub fn on_surface(&self, distances: &[f32], marks: &[u32]) -> Option<Marks> {
        let positions = &self.surface.positions;
        let mut distance = vec![f32::INFINITY; positions.len()];
        let mut mark = vec![u32::MAX; positions.len()];
        for (vertex, (&at, &normal)) in positions.iter().zip(&self.normals).enumerate() {
            let under = at - 0.5 * self.solid.size() * normal;
            // Thin parts have no cell right under each vertex.
            for reach in [0, 1] {
                for (cell, _) in self.solid.around(under, reach) {
                    let way = self.solid.centre(cell) - at;
                    // What lies before the surface is of another part.
                    if way.dot(normal) > 0.0 {
                        continue;
                    }
                    let gone = way.length() as f32;
                    let through = distances[cell as usize] + gone;
                    if through < distance[vertex] {
                        (distance[vertex], mark[vertex]) = (through, marks[cell as usize]);
                    }
                }
                if distance[vertex].is_finite() {
                    break;
                }
            }
        }
        let reached = |distance: &[f32]| -> Vec<u32> {
            let all = (0..positions.len() as u32).filter(|&v| distance[v as usize].is_finite());
            all.collect()
        };
        let seeds = reached(&distance);
        if seeds.is_empty() {
            return None;
        }
        if seeds.len() < positions.len() {
            let graph = Graph::new(positions, &self.surface.triangles);
            graph.relax(&mut distance, seeds.into_iter(), |vertex, from| {
                mark[vertex as usize] = mark[from as usize];
            });
        }
        let seeds = reached(&distance);
        let attached = positions.len() - seeds.len();
        if attached > 0 {
            let points: Vec<DVec3> = seeds.iter().map(|&v| positions[v as usize]).collect();
            let nearest = Nearest::new(&points);
            for vertex in 0..positions.len() {
                if distance[vertex].is_finite() {
                    continue;
                }
                if let Some((seed, _)) = nearest.find(positions[vertex]) {
                    let seed = seeds[seed as usize] as usize;
                    (distance[vertex], mark[vertex]) = (distance[seed], mark[seed]);
                }
            }
        }
        Some(Marks {
            distance,
            mark,
            attached,
        })
    }
}
