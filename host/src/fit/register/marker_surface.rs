//! The marker surface: triangles between markers (Park & Hodgins 2006, section 4.1, where people
//! drew it).
//!
//! Every vertex of the registered mesh belongs to the marker that is nearest along the skin;
//! where the cells of three markers meet, these make a triangle. So neighbours are neighbours on
//! the body, never across an armpit.

use std::collections::BTreeSet;

use glam::DVec3;

use super::Glue;
use crate::fit::laplace::graph::Graph;
use crate::spatial::weld;

/// Triangles `[..][3]` of markers, wound as the mesh is; markers without glue are in none.
/// O(edges log vertices)
#[must_use]
pub fn marker_surface(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    glue: &[Option<Glue>],
) -> Vec<[u32; 3]> {
    let owner = nearest_markers(positions, triangles, glue);
    let mut seen = BTreeSet::new();
    let mut out = Vec::new();
    for triangle in triangles {
        let [a, b, c] = triangle.map(|at| owner[at as usize]);
        let (Some(a), Some(b), Some(c)) = (a, b, c) else {
            continue;
        };
        if a == b || b == c || c == a {
            continue;
        }
        let mut key = [a, b, c];
        key.sort_unstable();
        if seen.insert(key) {
            out.push([a, b, c]);
        }
    }
    out
}

/// `[vertices]`: the marker nearest along the edges (Dijkstra 1959); `None` on components without
/// any. O(edges log vertices)
#[must_use]
pub fn nearest_markers(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    glue: &[Option<Glue>],
) -> Vec<Option<u32>> {
    let welded = weld(positions);
    let joined: Vec<[u32; 3]> = triangles
        .iter()
        .map(|t| t.map(|at| welded[at as usize]))
        .collect();
    let graph = Graph::new(positions, &joined);
    let mut distances = vec![f32::INFINITY; positions.len()];
    let mut owner = vec![None; positions.len()];
    let mut seeds = Vec::new();
    // A marker starts at all corners of its triangle, as far away as they are.
    for (marker, glue) in glue.iter().enumerate() {
        let Some(glue) = glue else { continue };
        let at = glue.on(positions);
        for &vertex in &glue.vertices {
            let vertex = welded[vertex as usize];
            let away = at.distance(positions[vertex as usize]) as f32;
            if away < distances[vertex as usize] {
                distances[vertex as usize] = away;
                owner[vertex as usize] = Some(marker as u32);
                seeds.push(vertex);
            }
        }
    }
    graph.relax(&mut distances, seeds.into_iter(), |next, from| {
        owner[next as usize] = owner[from as usize];
    });
    welded.iter().map(|&at| owner[at as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_markers_on_a_strip_make_two_triangles_wound_alike() {
        let side = 21;
        let positions: Vec<DVec3> = (0..side * side)
            .map(|at| DVec3::new(f64::from(at % side), f64::from(at / side), 0.0))
            .collect();
        let mut triangles = Vec::new();
        for y in 0..side as u32 - 1 {
            for x in 0..side as u32 - 1 {
                let a = y * side as u32 + x;
                let b = a + side as u32;
                triangles.extend([[a, a + 1, b + 1], [a, b + 1, b]]);
            }
        }
        let glue = |x: u32, y: u32| {
            let at = y * side as u32 + x;
            Some(Glue {
                triangle: 0,
                vertices: [at; 3],
                barycentric: [1.0, 0.0, 0.0],
            })
        };
        let markers = [glue(3, 2), glue(17, 4), glue(16, 17), None, glue(2, 16)];
        let surface = marker_surface(&positions, &triangles, &markers);
        assert_eq!(surface.len(), 2, "{surface:?}");
        for [a, b, c] in surface {
            let at = |m: u32| markers[m as usize].as_ref().unwrap().on(&positions);
            assert!((at(b) - at(a)).cross(at(c) - at(a)).z > 0.0);
        }
    }
}
