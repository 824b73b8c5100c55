//! Meshes as scanners deliver them: welded, cleared of what is no surface, every change counted.
//!
//! In: positions and triangles in any state. Out: positions and triangles that [`super::Surface`]
//! takes, with the way back to the source's vertices.

mod attach;
mod faults;
#[cfg(test)]
mod tests;
mod weld;

use glam::DVec3;

use super::graph::Graph;
use super::surface::component;
use super::{Component, LaplaceError};
pub use attach::attachments;
use faults::{count_holes, remove_faulty};
use weld::weld;

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
    count_holes(&kept, &mut report);
    if kept.is_empty() {
        return Err(LaplaceError::NoSurface);
    }
    Ok(renumber(positions, &kept, &welded, report))
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
