//! Meshes as scanners deliver them: welded, cleared of what is no surface, every change counted.
//!
//! In: positions and triangles in any state. Out: positions and triangles that [`super::Surface`]
//! takes, with the way back to the source's vertices.

use std::collections::HashMap;

use glam::DVec3;

use super::graph::Graph;
use super::surface::component;
use super::{Component, LaplaceError};

/// What to do with a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RepairOptions {
    /// Vertices at most this far apart become one, metres; 0 welds equal positions only.
    pub weld_distance: f64,
    /// Components with fewer vertices are removed: dust of a scan.
    pub smallest_component: usize,
}

/// What was done, and what was found and left.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RepairReport {
    /// Vertices that were joined to another.
    pub welded: usize,
    /// Vertices of no triangle, removed.
    pub unreferenced: usize,
    /// Triangles with a corner twice (after welding), removed.
    pub collapsed_triangles: usize,
    /// Triangles that stood there already, in either winding, removed.
    pub duplicate_triangles: usize,
    /// Triangles removed so that no edge has more than two.
    pub non_manifold_triangles: usize,
    /// Triangles whose corners lie on a line; kept, the weights survive them.
    pub flat_triangles: usize,
    /// Components removed as dust, and their vertices.
    pub dust: (usize, usize),
    /// Closed loops of edges with one triangle; kept open.
    pub holes: usize,
    /// Edges with one triangle.
    pub boundary_edges: usize,
    /// What is left, largest first.
    pub components: Vec<Component>,
}

impl RepairReport {
    /// One sentence for each change and each finding.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let (dust, dust_vertices) = self.dust;
        let all = [
            (self.welded, "vertices welded to one at the same place"),
            (self.unreferenced, "vertices of no triangle removed"),
            (
                self.collapsed_triangles,
                "triangles with a corner twice removed",
            ),
            (
                self.duplicate_triangles,
                "triangles that stood there twice removed",
            ),
            (
                self.non_manifold_triangles,
                "triangles removed from edges that more than two share",
            ),
            (self.flat_triangles, "triangles without area kept"),
            (dust, "components removed as dust"),
            (dust_vertices, "vertices in components removed as dust"),
            (self.holes, "holes left open"),
        ];
        let mut lines: Vec<String> = all
            .iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("{count} {what}"))
            .collect();
        if self.components.len() > 1 {
            lines.push(format!("{} separate components", self.components.len()));
        }
        lines
    }
}

/// A mesh that can be driven.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Repaired {
    /// `[vertices]`, metres.
    pub positions: Vec<DVec3>,
    /// Counter-clockwise as in the source.
    pub triangles: Vec<[u32; 3]>,
    /// `[source vertices]`: what each has become; `None` where it was removed.
    pub vertex_of: Vec<Option<u32>>,
    /// `[vertices]`: one source vertex of each.
    pub source_of: Vec<u32>,
    /// What was done.
    pub report: RepairReport,
}

/// Repairs a mesh. O(vertices + triangles) but for sorting.
///
/// # Errors
/// [`LaplaceError::BadTriangle`], [`LaplaceError::BadPosition`] on a vertex that a triangle uses,
/// [`LaplaceError::NoSurface`] where nothing is left.
pub fn repair(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    options: &RepairOptions,
) -> Result<Repaired, LaplaceError> {
    let mut report = RepairReport::default();
    let count = positions.len();
    for (triangle, corners) in triangles.iter().enumerate() {
        for &vertex in corners {
            let place = positions.get(vertex as usize);
            let position = *place.ok_or(LaplaceError::BadTriangle {
                triangle,
                vertex,
                count,
            })?;
            if !position.is_finite() {
                let vertex = vertex as usize;
                return Err(LaplaceError::BadPosition { vertex, position });
            }
        }
    }
    let welded = weld(positions, options.weld_distance);
    report.welded = welded.iter().zip(0..).filter(|&(&to, at)| to != at).count();
    let mut kept = remove_faulty(triangles, &welded, &mut report);
    remove_dust(
        positions,
        &mut kept,
        options.smallest_component,
        &mut report,
    );
    if kept.is_empty() {
        return Err(LaplaceError::NoSurface);
    }
    Ok(renumber(positions, &kept, &welded, report))
}

/// What each vertex is welded to: itself, or an earlier one.
fn weld(positions: &[DVec3], distance: f64) -> Vec<u32> {
    let cell_size = if distance > 0.0 { distance } else { 1.0 };
    // Exact welding hashes bits; the other looks into the 27 cells around.
    let exact = |p: DVec3| {
        (p + DVec3::ZERO)
            .to_array()
            .map(f64::to_bits)
            .map(|b| b as i64)
    };
    let cell = |p: DVec3| (p / cell_size).floor().to_array().map(|x| x as i64);
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut welded = Vec::with_capacity(positions.len());
    for (at, &position) in (0_u32..).zip(positions) {
        let mut target = at;
        if distance > 0.0 && position.is_finite() {
            let [x, y, z] = cell(position);
            let around = (-1..=1)
                .flat_map(move |i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [i, j, k])));
            for [i, j, k] in around {
                let near = cells.get(&[
                    x.saturating_add(i),
                    y.saturating_add(j),
                    z.saturating_add(k),
                ]);
                let near = near.into_iter().flatten();
                let found = near
                    .filter(|&&v| positions[v as usize].distance(position) <= distance)
                    .min();
                target = found.map_or(target, |&v| v.min(target));
            }
            if target == at {
                cells.entry([x, y, z]).or_default().push(at);
            }
        } else if distance <= 0.0 {
            let same = cells.entry(exact(position)).or_default();
            match same.first() {
                Some(&first) => target = first,
                None => same.push(at),
            }
        }
        welded.push(target);
    }
    welded
}

/// Triangles with welded corners, without those that are no surface.
fn remove_faulty(
    triangles: &[[u32; 3]],
    welded: &[u32],
    report: &mut RepairReport,
) -> Vec<[u32; 3]> {
    let mut seen = std::collections::HashSet::new();
    let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
    let mut kept = Vec::with_capacity(triangles.len());
    for corners in triangles {
        let [a, b, c] = corners.map(|v| welded[v as usize]);
        if a == b || b == c || c == a {
            report.collapsed_triangles += 1;
            continue;
        }
        let mut sorted = [a, b, c];
        sorted.sort_unstable();
        if !seen.insert(sorted) {
            report.duplicate_triangles += 1;
            continue;
        }
        let sides = [(a, b), (b, c), (c, a)].map(|(a, b)| (a.min(b), a.max(b)));
        if sides
            .iter()
            .any(|side| edges.get(side).is_some_and(|&n| n >= 2))
        {
            report.non_manifold_triangles += 1;
            continue;
        }
        for side in sides {
            *edges.entry(side).or_default() += 1;
        }
        kept.push([a, b, c]);
    }
    let boundary: Vec<(u32, u32)> = edges
        .into_iter()
        .filter(|&(_, count)| count == 1)
        .map(|(edge, _)| edge)
        .collect();
    report.boundary_edges = boundary.len();
    report.holes = loops(&boundary);
    kept
}

/// Connected sets of edges.
fn loops(edges: &[(u32, u32)]) -> usize {
    let mut parent: HashMap<u32, u32> = HashMap::new();
    let mut sets = 0_usize;
    for &(a, b) in edges {
        for v in [a, b] {
            if let std::collections::hash_map::Entry::Vacant(entry) = parent.entry(v) {
                entry.insert(v);
                sets += 1;
            }
        }
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        if a != b {
            parent.insert(a, b);
            sets -= 1;
        }
    }
    sets
}

fn root(parent: &mut HashMap<u32, u32>, mut at: u32) -> u32 {
    while parent[&at] != at {
        let grandparent = parent[&parent[&at]];
        parent.insert(at, grandparent);
        at = grandparent;
    }
    at
}

fn remove_dust(
    positions: &[DVec3],
    triangles: &mut Vec<[u32; 3]>,
    smallest: usize,
    report: &mut RepairReport,
) {
    let graph = Graph::new(positions, triangles);
    let mut used = vec![false; positions.len()];
    triangles
        .as_flattened()
        .iter()
        .for_each(|&v| used[v as usize] = true);
    let mut remove = vec![false; positions.len()];
    for vertices in graph.components() {
        if !used[vertices[0] as usize] {
            continue;
        }
        if vertices.len() < smallest {
            report.dust.0 += 1;
            report.dust.1 += vertices.len();
            vertices.iter().for_each(|&v| remove[v as usize] = true);
        } else {
            report.components.push(component(&vertices, positions));
        }
    }
    report
        .components
        .sort_by_key(|component| (std::cmp::Reverse(component.vertices), component.vertex));
    triangles.retain(|&[a, _, _]| !remove[a as usize]);
    let flat = |&&[a, b, c]: &&[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|v| positions[v as usize]);
        let longest = (b - a).length_squared().max((c - a).length_squared());
        (b - a).cross(c - a).length() <= 1e-12 * longest
    };
    report.flat_triangles = triangles.iter().filter(flat).count();
}

fn renumber(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    welded: &[u32],
    mut report: RepairReport,
) -> Repaired {
    let mut used = vec![false; positions.len()];
    triangles
        .as_flattened()
        .iter()
        .for_each(|&v| used[v as usize] = true);
    let mut new_of = vec![None; positions.len()];
    let mut source_of = Vec::new();
    for (vertex, _) in used.iter().enumerate().filter(|(_, used)| **used) {
        new_of[vertex] = Some(source_of.len() as u32);
        source_of.push(vertex as u32);
    }
    let vertex_of: Vec<Option<u32>> = welded.iter().map(|&to| new_of[to as usize]).collect();
    let gone = vertex_of.iter().filter(|to| to.is_none()).count();
    report.unreferenced = gone - report.dust.1.min(gone);
    Repaired {
        positions: source_of.iter().map(|&v| positions[v as usize]).collect(),
        triangles: triangles
            .iter()
            .map(|corners| corners.map(|v| new_of[v as usize].unwrap_or(0)))
            .collect(),
        vertex_of,
        source_of,
        report,
    }
}

/// Ties each component without a marker to the nearest vertex of one with a marker: a list of
/// (vertex, its anchor) with one entry a vertex of such components, so that they can follow
/// rigidly. O(components x vertices)
#[must_use]
pub fn attachments(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    markers: &[u32],
) -> Vec<(u32, u32)> {
    let graph = Graph::new(positions, triangles);
    let (marked, unmarked): (Vec<_>, Vec<_>) = graph
        .components()
        .into_iter()
        .partition(|vertices| vertices.iter().any(|v| markers.contains(v)));
    let anchors: Vec<u32> = marked.concat();
    let mut ties = Vec::new();
    for vertices in unmarked {
        let place = vertices.iter().map(|&v| positions[v as usize]);
        let centre = place.sum::<DVec3>() / vertices.len() as f64;
        let nearest = anchors.iter().copied().min_by(|&a, &b| {
            let distance = |v: u32| positions[v as usize].distance_squared(centre);
            distance(a).total_cmp(&distance(b))
        });
        if let Some(nearest) = nearest {
            ties.extend(vertices.into_iter().map(|vertex| (vertex, nearest)));
        }
    }
    ties
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(xy: &[(f64, f64)]) -> Vec<DVec3> {
        xy.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect()
    }

    #[test]
    fn each_fault_is_repaired_and_counted() {
        // A square whose second triangle has corners of its own; a stray vertex; dust.
        let mut positions = places(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]);
        positions.extend(places(&[(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (9.0, 9.0)]));
        positions.extend(places(&[(5.0, 5.0), (5.1, 5.0), (5.0, 5.1)]));
        let triangles = [
            [0, 1, 2],
            [3, 4, 5],
            [0, 3, 1], // a corner twice once welded
            [2, 1, 0], // stands there already, turned over
            [7, 8, 9],
        ];
        let options = RepairOptions {
            smallest_component: 4,
            ..RepairOptions::default()
        };
        let repaired = repair(&positions, &triangles, &options).expect("repairs");
        assert_eq!(repaired.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(repaired.source_of, [0, 1, 2, 5]);
        assert_eq!(repaired.vertex_of[3], Some(0));
        assert_eq!(repaired.vertex_of[6], None);
        let report = &repaired.report;
        assert_eq!((report.welded, report.unreferenced), (2, 1));
        assert_eq!(
            (report.collapsed_triangles, report.duplicate_triangles),
            (1, 1)
        );
        assert_eq!((report.dust, report.holes), ((1, 3), 2));
        assert_eq!(report.components.len(), 1);
        assert_eq!(report.lines().len(), 7);
    }

    #[test]
    fn a_third_triangle_on_an_edge_is_removed() {
        let mut positions = places(&[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]);
        positions.push(DVec3::Z);
        let triangles = [[0, 1, 2], [1, 0, 3], [0, 1, 4]];
        let repaired = repair(&positions, &triangles, &RepairOptions::default()).expect("repairs");
        assert_eq!(repaired.triangles.len(), 2);
        assert_eq!(repaired.report.non_manifold_triangles, 1);
        assert_eq!(repaired.report.unreferenced, 1);
    }

    #[test]
    fn welding_by_distance_reaches_across_cells() {
        let positions = places(&[(0.0999, 0.0), (0.1001, 0.0), (0.5, 0.0), (0.0, 0.5)]);
        let triangles = [[0, 2, 3], [1, 2, 3]];
        let options = RepairOptions {
            weld_distance: 0.1,
            ..RepairOptions::default()
        };
        let repaired = repair(&positions, &triangles, &options).expect("repairs");
        assert_eq!((repaired.report.welded, repaired.triangles.len()), (1, 1));
    }

    #[test]
    fn what_cannot_be_repaired_is_refused() {
        let positions = places(&[(0.0, 0.0), (1.0, 0.0), (f64::NAN, 0.0)]);
        let refused = |positions: &[DVec3], triangles: &[[u32; 3]]| {
            repair(positions, triangles, &RepairOptions::default()).expect_err("refused")
        };
        assert!(matches!(refused(&[], &[]), LaplaceError::NoSurface));
        let bad = refused(&positions, &[[0, 1, 7]]);
        assert!(matches!(bad, LaplaceError::BadTriangle { vertex: 7, .. }));
        let bad = refused(&positions, &[[0, 1, 2]]);
        assert!(matches!(bad, LaplaceError::BadPosition { vertex: 2, .. }));
        let flat = refused(&positions, &[[0, 1, 1]]);
        assert!(matches!(flat, LaplaceError::NoSurface));
    }

    #[test]
    fn a_component_without_marker_follows_its_nearest_neighbour() {
        let mut positions = places(&[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]);
        positions.extend(places(&[(1.2, 0.0), (1.4, 0.0), (1.2, 0.2)]));
        let ties = attachments(&positions, &[[0, 1, 2], [3, 4, 5]], &[0]);
        assert_eq!(ties, [(3, 1), (4, 1), (5, 1)]);
    }
}
