//! The marker surface: which markers of a reference frame are neighbours along the body.
//!
//! Enters: the points of one frame, and a mesh of the body in that frame if there is one. Leaves:
//! for each point its nearest others by the way along the body, not straight through it (Park &
//! Hodgins 2006, section 4.1, where it was made by hand). Without a mesh the way leads over the
//! relative neighbourhood graph of the points (Toussaint 1980): an edge joins two points unless a
//! third lies nearer to both, as the points between two sides of a limb do.

use glam::DVec3;

use crate::model::graph::Graph;

/// Neighbours kept of a point: memory grows with points, not with their square.
const NEAREST: usize = 40;
/// Nearest points among which edges are sought.
const SOUGHT: usize = 16;
/// How much nearer a third point must be to keep two apart.
const NEARER: f64 = 0.95;
/// What a way to none of the nearest is at least, over the straight distance.
const FARTHER: f64 = 2.0;

/// Ways along the body between points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MarkerSurface {
    /// `[points]`: position, metres.
    pub points: Vec<DVec3>,
    /// `[points]`: the others nearest along the body, and the way to each in metres, nearest first.
    pub rings: Vec<Vec<(u32, f32)>>,
}

/// A mesh of the body in the reference frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyMesh<'a> {
    /// `[vertices]`: metres, Y up, in the space of the take.
    pub positions: &'a [DVec3],
    /// Vertices of each triangle.
    pub triangles: &'a [[u32; 3]],
}

/// Why a mesh is not the body of a frame.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// It has no vertices.
    #[error("the mesh has no vertices; give the body in the pose of the reference frame")]
    Empty,
    /// Its surface is not where the markers are.
    #[error(
        "half of the markers lie more than {distance:.3} m from the mesh's nearest vertex; give the \
         body in the place and pose of frame {frame}, as `sinew register` fits it"
    )]
    Elsewhere {
        /// Median distance, metres.
        distance: f64,
        /// The reference frame.
        frame: usize,
    },
}

/// Farthest that half of the markers may be from the nearest vertex, metres.
const CLOSE: f64 = 0.05;

impl MarkerSurface {
    /// From points alone. Quadratic in points, in time alone.
    #[must_use]
    pub fn of_points(points: &[DVec3]) -> Self {
        let near: Vec<Vec<(f64, usize)>> =
            (0..points.len()).map(|at| nearest(points, at)).collect();
        let mut edges = Vec::new();
        for (at, list) in near.iter().enumerate() {
            for &(length, other) in list {
                let between = |&&(d, third): &&(f64, usize)| {
                    third != other && d.max(points[third].distance(points[other])) < NEARER * length
                };
                if !list.iter().any(|third| between(&third)) {
                    edges.push([at as u32, other as u32, other as u32]);
                }
            }
        }
        let graph = Graph::new(points, &edges);
        let vertices: Vec<u32> = (0..points.len() as u32).collect();
        Self::over(&graph, &vertices, points)
    }

    /// Over a mesh: each point stands at the vertex nearest to it. Points times edges.
    ///
    /// # Errors
    /// The mesh is empty, or lies elsewhere than the points of `frame`.
    pub fn of_mesh(
        points: &[DVec3],
        mesh: BodyMesh<'_>,
        frame: usize,
    ) -> Result<Self, SurfaceError> {
        let vertex = |point: &DVec3| {
            let squared = |v: &DVec3| v.distance_squared(*point);
            let each = mesh.positions.iter().map(squared).enumerate();
            each.min_by(|a, b| a.1.total_cmp(&b.1))
        };
        let found: Option<Vec<(usize, f64)>> = points.iter().map(vertex).collect();
        let found = found.ok_or(SurfaceError::Empty)?;
        let mut distances: Vec<f64> = found.iter().map(|one| one.1.sqrt()).collect();
        distances.sort_by(f64::total_cmp);
        let distance = distances.get(distances.len() / 2).copied().unwrap_or(0.0);
        if distance.is_nan() || distance > CLOSE {
            return Err(SurfaceError::Elsewhere { distance, frame });
        }
        let graph = Graph::new(mesh.positions, mesh.triangles);
        let vertices: Vec<u32> = found.iter().map(|one| one.0 as u32).collect();
        Ok(Self::over(&graph, &vertices, points))
    }

    fn over(graph: &Graph, vertices: &[u32], points: &[DVec3]) -> Self {
        let ring = |at: usize| {
            let ways = graph.distances(&[vertices[at]]);
            let each = vertices
                .iter()
                .enumerate()
                .filter(|(other, _)| *other != at);
            let mut ring: Vec<(u32, f32)> = each
                .map(|(other, &vertex)| (other as u32, ways[vertex as usize]))
                .filter(|one| one.1.is_finite())
                .collect();
            ring.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
            ring.truncate(NEAREST);
            ring
        };
        Self {
            points: points.to_vec(),
            rings: (0..points.len()).map(ring).collect(),
        }
    }

    /// The way between two points, metres; twice the straight distance at least where neither is
    /// among the other's nearest.
    ///
    /// # Panics
    /// If a point does not exist.
    #[must_use]
    pub fn way(&self, a: usize, b: usize) -> f64 {
        let listed = |from: usize, to: usize| {
            let found = self.rings[from].iter().find(|one| one.0 as usize == to);
            found.map(|one| f64::from(one.1))
        };
        listed(a, b)
            .or_else(|| listed(b, a))
            .unwrap_or_else(|| FARTHER * self.points[a].distance(self.points[b]))
    }
}

/// The nearest points and their distances.
fn nearest(points: &[DVec3], at: usize) -> Vec<(f64, usize)> {
    let others = points.iter().enumerate().filter(|(other, _)| *other != at);
    let mut near: Vec<(f64, usize)> = others
        .map(|(other, place)| (place.distance(points[at]), other))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(SOUGHT);
    near
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A limb of radius 3 cm with six points around it every 3 cm.
    fn limb() -> Vec<DVec3> {
        let at = |ring: i32, side: i32| {
            let angle = f64::from(side) * std::f64::consts::TAU / 6.0;
            DVec3::new(
                0.03 * angle.cos(),
                0.03 * f64::from(ring),
                0.03 * angle.sin(),
            )
        };
        (0..6)
            .flat_map(|ring| (0..6).map(move |side| at(ring, side)))
            .collect()
    }

    #[test]
    fn ways_lead_around_a_limb() {
        let points = limb();
        let surface = MarkerSurface::of_points(&points);
        // Opposite sides of one ring: 6 cm through, 9 cm over the points between.
        assert!(
            (surface.way(12, 15) - 0.09).abs() < 1e-6,
            "{}",
            surface.way(12, 15)
        );
        assert!((surface.way(12, 13) - 0.03).abs() < 1e-6);
        assert_eq!(surface.rings[12].len(), points.len() - 1);
        assert!(MarkerSurface::of_points(&[]).rings.is_empty());
        assert!(MarkerSurface::of_points(&[DVec3::ZERO; 3]).rings[0].len() <= 2);
    }

    #[test]
    fn a_mesh_says_more_than_points() {
        // Two sheets a centimetre apart that only meet at one end.
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        for step in 0..20_u32 {
            let x = if step < 10 { step } else { 19 - step };
            let y = if step < 10 { 0.0 } else { 0.01 };
            for side in 0..2 {
                positions.push(DVec3::new(0.02 * f64::from(x), y, 0.02 * f64::from(side)));
            }
            if step > 0 {
                let at = 2 * step;
                triangles.extend([[at - 2, at - 1, at], [at - 1, at + 1, at]]);
            }
        }
        let mesh = BodyMesh {
            positions: &positions,
            triangles: &triangles,
        };
        let points = [DVec3::ZERO, DVec3::new(0.0, 0.01, 0.0)];
        let surface = MarkerSurface::of_mesh(&points, mesh, 0).unwrap();
        assert!(
            (surface.way(0, 1) - 0.37).abs() < 1e-3,
            "{}",
            surface.way(0, 1)
        );
        let far = MarkerSurface::of_mesh(&[DVec3::X * 3.0], mesh, 7);
        assert!(matches!(far, Err(SurfaceError::Elsewhere { frame: 7, .. })));
        let none = BodyMesh {
            positions: &[],
            triangles: &[],
        };
        assert_eq!(
            MarkerSurface::of_mesh(&points, none, 0),
            Err(SurfaceError::Empty)
        );
    }
}
