//! A coarser body for far away or for small machines.
//!
//! A body and a number of vertices enter, a body with at most so many leaves, each vertex of it one
//! of the source's with all that it carries: skin weights, morph offsets, normal, tangent, texture
//! coordinates. Edges collapse onto one of their ends in the order of their quadric error (Garland
//! and Heckbert, *Surface Simplification Using Quadric Error Metrics*, 1997), summed over poses, so
//! that what bends keeps the vertices it needs (DeCoro and Rusinkiewicz, *Pose-independent
//! Simplification of Articulated Meshes*, 2005). Borders, the borders of parts and the seams of
//! texture coordinates only shrink along themselves.

mod poses;
mod quadric;
mod surface;

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::model::{Avatar, Mesh, Morph, Part, Skin};
use quadric::Quadrics;
use surface::Surface;

/// A mesh with its skin, made from vertices of another.
#[derive(Clone, Debug, PartialEq)]
pub struct Simplified {
    /// Fewer vertices and triangles, the same parts and morph targets.
    pub mesh: Mesh,
    /// The same binds.
    pub skin: Skin,
    /// Vertex of the source of each vertex, ascending.
    pub source: Vec<u32>,
    /// Metres: root mean square distance from the planes of the source's triangles, over poses, of
    /// the vertex where it is largest.
    pub error: f64,
}

/// Leaves at most `vertices` vertices, or as few as borders and seams allow.
///
/// O(vertices log vertices), times the poses. Vertices without a triangle are left out.
#[must_use]
pub fn simplify(avatar: &Avatar, vertices: usize) -> Simplified {
    let poses = poses::positions(avatar);
    let mut surface = Surface::new(&avatar.mesh, &avatar.skin);
    let mut quadrics = Quadrics::new(&surface, &poses);
    let mut queue = Queue::new(&surface, &quadrics);
    let mut error = 0.0_f64;
    while surface.vertex_count() > vertices
        && let Some((from, to)) = queue.next()
    {
        if !surface.can_collapse(from, to, &poses) {
            continue;
        }
        error = error.max(quadrics.mean_square(from, to));
        surface.collapse(from, to);
        quadrics.merge(from, to);
        queue.renew(&surface, &quadrics, to);
    }
    gather(avatar, &surface, error.sqrt())
}

/// Half-edges by what their collapse costs; those made stale by a collapse are skipped.
struct Queue {
    heap: BinaryHeap<Reverse<Candidate>>,
    /// `[points]`: how often what a point is surrounded by has changed.
    stamps: Vec<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    /// Bits of a cost that is not negative: they order as it does.
    cost: u64,
    from: u32,
    to: u32,
    stamps: [u32; 2],
}

impl Queue {
    fn new(surface: &Surface, quadrics: &Quadrics<'_>) -> Self {
        let mut queue = Self {
            heap: BinaryHeap::new(),
            stamps: vec![0; surface.point_count()],
        };
        for point in 0..surface.point_count() as u32 {
            for neighbour in surface.neighbours(point) {
                queue.push(quadrics, point, neighbour);
            }
        }
        queue
    }

    fn push(&mut self, quadrics: &Quadrics<'_>, from: u32, to: u32) {
        let stamps = [from, to].map(|point| self.stamps[point as usize]);
        self.heap.push(Reverse(Candidate {
            cost: quadrics.cost(from, to).max(0.0).to_bits(),
            from,
            to,
            stamps,
        }));
    }

    fn next(&mut self) -> Option<(u32, u32)> {
        while let Some(Reverse(candidate)) = self.heap.pop() {
            let Candidate { from, to, .. } = candidate;
            if candidate.stamps == [from, to].map(|point| self.stamps[point as usize]) {
                return Some((from, to));
            }
        }
        None
    }

    /// Around a point that took in another.
    fn renew(&mut self, surface: &Surface, quadrics: &Quadrics<'_>, point: u32) {
        let neighbours = surface.neighbours(point);
        // What a neighbour may collapse to has changed with its surroundings.
        for &changed in neighbours.iter().chain([&point]) {
            self.stamps[changed as usize] += 1;
        }
        for &near in neighbours.iter().chain([&point]) {
            for far in surface.neighbours(near) {
                self.push(quadrics, near, far);
                if far != point && !neighbours.contains(&far) {
                    self.push(quadrics, far, near);
                }
            }
        }
    }
}

/// What is left, in the source's order.
fn gather(avatar: &Avatar, surface: &Surface, error: f64) -> Simplified {
    let mesh = &avatar.mesh;
    let mut source: Vec<u32> = surface
        .triangles()
        .flat_map(|(corners, _)| corners)
        .collect();
    source.sort_unstable();
    source.dedup();
    let place = |vertex: u32| source.partition_point(|&other| other < vertex) as u32;
    let mut triangles = Vec::new();
    let mut parts = Vec::with_capacity(mesh.parts.len());
    for (index, part) in mesh.parts.iter().enumerate() {
        let start = triangles.len();
        let own = surface.triangles().filter(|&(_, part)| part == index);
        triangles.extend(own.map(|(corners, _)| corners.map(place)));
        parts.push(Part {
            name: part.name.clone(),
            triangles: start..triangles.len(),
        });
    }
    if mesh.parts.is_empty() {
        triangles.extend(surface.triangles().map(|(corners, _)| corners.map(place)));
    }
    let morphs = mesh.morphs.iter().map(|morph| Morph {
        name: morph.name.clone(),
        positions: pick(&morph.positions, &source),
        normals: if morph.normals.is_empty() {
            Vec::new()
        } else {
            pick(&morph.normals, &source)
        },
        rest_weight: morph.rest_weight,
    });
    Simplified {
        mesh: Mesh {
            name: mesh.name.clone(),
            positions: pick(&mesh.positions, &source),
            normals: pick(&mesh.normals, &source),
            tangents: mesh.tangents.as_ref().map(|all| pick(all, &source)),
            texcoords: mesh.texcoords.as_ref().map(|all| pick(all, &source)),
            triangles,
            parts,
            morphs: morphs.collect(),
        },
        skin: Skin {
            binds: avatar.skin.binds.clone(),
            influences: pick(&avatar.skin.influences, &source),
        },
        source,
        error,
    }
}

fn pick<T: Clone>(all: &[T], source: &[u32]) -> Vec<T> {
    let vertices = source.iter();
    vertices
        .map(|&vertex| all[vertex as usize].clone())
        .collect()
}

#[cfg(test)]
mod tests;
