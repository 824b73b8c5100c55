//! Triangles that are no surface; holes.

use std::collections::HashMap;

use super::RepairReport;

/// Triangles with welded corners, without those that are no surface.
pub(super) fn remove_faulty(
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
    kept
}

/// Counts edges with one triangle, and the loops they form.
pub(super) fn count_holes(triangles: &[[u32; 3]], report: &mut RepairReport) {
    let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
    for &[a, b, c] in triangles {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            *edges.entry((a.min(b), a.max(b))).or_default() += 1;
        }
    }
    let boundary: Vec<(u32, u32)> = edges
        .into_iter()
        .filter(|&(_, count)| count == 1)
        .map(|(edge, _)| edge)
        .collect();
    report.boundary_edges = boundary.len();
    report.holes = loops(&boundary);
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
