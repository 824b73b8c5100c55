//! Triangles that can lose vertices.
//!
//! A *point* is a place on the surface; several vertices share it where texture coordinates or
//! normals differ on either side. Triangles know their vertices, collapses are between points.

use std::collections::HashMap;

use glam::DVec3;

use crate::model::{Mesh, Skin};

/// A triangle may turn so far in a collapse: the cosine.
const LEAST_COSINE: f64 = 0.2;

/// A mesh under simplification.
pub(super) struct Surface {
    /// Corners; `None` once collapsed away.
    triangles: Vec<Option<[u32; 3]>>,
    /// Part of each triangle.
    parts: Vec<usize>,
    /// `[vertices]`
    points: Vec<u32>,
    /// `[points]`: the first vertex there.
    vertices: Vec<u32>,
    /// `[points]`: triangles.
    around: Vec<Vec<u32>>,
    /// Vertices that triangles use.
    used: usize,
}

impl Surface {
    pub fn new(mesh: &Mesh, skin: &Skin) -> Self {
        let mut ids: HashMap<_, u32> = HashMap::new();
        let mut vertices = Vec::new();
        let mut points = Vec::with_capacity(mesh.positions.len());
        for vertex in 0..mesh.positions.len() {
            // Vertices that move apart are no seam.
            let bits = |at: DVec3| at.to_array().map(|x| (x + 0.0).to_bits());
            let weights = skin.influences[vertex].iter();
            let weights: Vec<_> = weights.map(|&(bind, w)| (bind, w.to_bits())).collect();
            let morphs = mesh.morphs.iter();
            let morphs: Vec<_> = morphs.map(|morph| bits(morph.positions[vertex])).collect();
            let key = (bits(mesh.positions[vertex]), weights, morphs);
            points.push(*ids.entry(key).or_insert_with(|| {
                vertices.push(vertex as u32);
                vertices.len() as u32 - 1
            }));
        }
        let mut part_of = vec![0; mesh.triangles.len()];
        for (index, part) in mesh.parts.iter().enumerate() {
            part_of[part.triangles.clone()].fill(index);
        }
        let mut around = vec![Vec::new(); vertices.len()];
        let mut triangles = Vec::with_capacity(mesh.triangles.len());
        let mut used = vec![false; mesh.positions.len()];
        for (index, corners) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|vertex| points[vertex as usize]);
            let whole = a != b && b != c && c != a;
            triangles.push(whole.then_some(*corners));
            if whole {
                for (point, &vertex) in [a, b, c].into_iter().zip(corners) {
                    around[point as usize].push(index as u32);
                    used[vertex as usize] = true;
                }
            }
        }
        Self {
            triangles,
            parts: part_of,
            points,
            vertices,
            around,
            used: used.into_iter().filter(|&used| used).count(),
        }
    }

    pub fn point_count(&self) -> usize {
        self.vertices.len()
    }

    /// Vertices that triangles use.
    pub fn vertex_count(&self) -> usize {
        self.used
    }

    pub fn point(&self, vertex: u32) -> u32 {
        self.points[vertex as usize]
    }

    pub fn vertex_at(&self, point: u32) -> u32 {
        self.vertices[point as usize]
    }

    /// Corners and part of every triangle that is left, in the source's order.
    pub fn triangles(&self) -> impl Iterator<Item = ([u32; 3], usize)> {
        let parts = self.parts.iter();
        let all = self.triangles.iter().zip(parts);
        all.filter_map(|(triangle, &part)| Some(((*triangle)?, part)))
    }

    fn around(&self, point: u32) -> impl Iterator<Item = (u32, [u32; 3])> {
        let triangles = self.around[point as usize].iter();
        triangles.filter_map(|&index| Some((index, self.triangles[index as usize]?)))
    }

    /// Points that share a triangle with this one, ascending.
    pub fn neighbours(&self, point: u32) -> Vec<u32> {
        let corners = self.around(point).flat_map(|(_, corners)| corners);
        let mut points: Vec<u32> = corners.map(|vertex| self.point(vertex)).collect();
        points.retain(|&other| other != point);
        points.sort_unstable();
        points.dedup();
        points
    }

    /// Whether an edge of a triangle is a border, or separates parts or seams.
    pub fn is_crease(&self, from: u32, to: u32) -> bool {
        let (start, end) = (self.point(from), self.point(to));
        let sides: Vec<_> = self.edge(start, end).collect();
        let part = |index: u32| self.parts[index as usize];
        let whole = sides.len() == 2
            && part(sides[0].0) == part(sides[1].0)
            && sides
                .iter()
                .all(|(_, corners)| corners.contains(&from) && corners.contains(&to));
        !whole
    }

    /// Triangles that have both points.
    fn edge(&self, from: u32, to: u32) -> impl Iterator<Item = (u32, [u32; 3])> {
        let has = move |corners: &[u32; 3]| corners.iter().any(|&v| self.point(v) == to);
        self.around(from).filter(move |(_, corners)| has(corners))
    }

    /// For every vertex at `from` the one at `to` that takes its place; `None` where a triangle on
    /// either side would say otherwise, or where a vertex or a part has no triangle on the edge.
    fn heirs(&self, from: u32, to: u32) -> Option<Vec<(u32, u32)>> {
        let mut heirs: Vec<(u32, u32)> = Vec::new();
        let mut parts = Vec::new();
        let at = |corners: &[u32; 3], point: u32| {
            corners
                .iter()
                .copied()
                .find(|&vertex| self.point(vertex) == point)
        };
        for (index, corners) in self.edge(from, to) {
            let pair = (at(&corners, from)?, at(&corners, to)?);
            match heirs.iter().find(|(old, _)| *old == pair.0) {
                Some(known) if *known != pair => return None,
                Some(_) => {}
                None => heirs.push(pair),
            }
            parts.push(self.parts[index as usize]);
        }
        for (index, corners) in self.around(from) {
            let vertex = at(&corners, from)?;
            if !heirs.iter().any(|&(old, _)| old == vertex)
                || !parts.contains(&self.parts[index as usize])
            {
                return None;
            }
        }
        Some(heirs)
    }

    /// Whether `from` can move onto `to` without tearing, folding or filling the surface.
    pub fn can_collapse(&self, from: u32, to: u32, poses: &[Vec<DVec3>]) -> bool {
        let sides = self.edge(from, to).count();
        let (near, far) = (self.neighbours(from), self.neighbours(to));
        // A border only shrinks along itself.
        let on_border = near
            .iter()
            .any(|&other| self.edge(from, other).count() != 2);
        if sides == 0 || sides > 2 || (on_border && sides != 1) {
            return false;
        }
        // The link condition: what both touch are the tips of the triangles between them.
        let common = near.iter().filter(|point| far.contains(point)).count();
        if common != sides || near.len() <= sides || self.heirs(from, to).is_none() {
            return false;
        }
        let target = self.vertex_at(to) as usize;
        self.around(from).all(|(_, corners)| {
            if corners.iter().any(|&vertex| self.point(vertex) == to) {
                return true;
            }
            // The rest pose decides; in others folds are allowed to be.
            let pose = &poses[0];
            let old = corners.map(|vertex| pose[vertex as usize]);
            let new = corners.map(|vertex| {
                let moved = self.point(vertex) == from;
                pose[if moved { target } else { vertex as usize }]
            });
            let normal = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a);
            let (before, after) = (normal(old), normal(new));
            let cosine = before.dot(after);
            cosine > 0.0 && cosine >= LEAST_COSINE * before.length() * after.length()
        })
    }

    /// Moves `from` onto `to`; [`Self::can_collapse`] said that it can.
    pub fn collapse(&mut self, from: u32, to: u32) {
        let heirs = self.heirs(from, to).unwrap_or_default();
        for index in std::mem::take(&mut self.around[from as usize]) {
            let Some(corners) = self.triangles[index as usize] else {
                continue;
            };
            if corners.iter().any(|&vertex| self.point(vertex) == to) {
                self.triangles[index as usize] = None;
                continue;
            }
            let moved = corners.map(|vertex| {
                let heir = heirs.iter().find(|(old, _)| *old == vertex);
                heir.map_or(vertex, |&(_, heir)| heir)
            });
            self.triangles[index as usize] = Some(moved);
            self.around[to as usize].push(index);
        }
        self.used -= heirs.len();
        let triangles = &self.triangles;
        self.around[to as usize].retain(|&index| triangles[index as usize].is_some());
    }
}
