//! Triangles put between facing borders.

use std::collections::BTreeSet;

use glam::DVec3;

use super::Shell;
use super::borders::{Border, Face};

/// Vertices and triangles to be added to a shell. New vertices are numbered on from the shell's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Patch {
    /// Metres.
    pub positions: Vec<DVec3>,
    /// `[vertices]`.
    pub part_of: Vec<u32>,
    /// Facing outward.
    pub triangles: Vec<[u32; 3]>,
}

/// Bridges all faces; gives the directed edges of what was put in. O(sum of vertices of both sides,
/// multiplied, over all faces)
pub fn join_faces(shell: &mut Shell, faces: &[Face]) -> BTreeSet<[u32; 2]> {
    let outward = outward(shell);
    let mut edges = BTreeSet::new();
    for face in faces {
        let patch = strip(shell, face, &outward);
        for &[a, b, c] in &patch.triangles {
            edges.extend([[a, b], [b, c], [c, a]]);
        }
        shell.add(patch);
    }
    edges
}

/// `[vertices]`: along the surface, away from the triangles of a vertex; of no use inside a part.
fn outward(shell: &Shell) -> Vec<DVec3> {
    let mut outward = vec![DVec3::ZERO; shell.positions.len()];
    for corners in &shell.triangles {
        let places = corners.map(|v| shell.positions[v as usize]);
        let middle = places.iter().sum::<DVec3>() / 3.0;
        for (&vertex, place) in corners.iter().zip(places) {
            outward[vertex as usize] += place - middle;
        }
    }
    outward.iter().map(|sum| sum.normalize_or_zero()).collect()
}

/// Rows of triangles between two lines, about as long as those of the lines themselves; rows bulge as
/// the surfaces on both sides do.
fn strip(shell: &Shell, face: &Face, outward: &[DVec3]) -> Patch {
    /// More rows than this blend no better.
    const MOST_ROWS: f64 = 8.0;
    let [first, second] = &face.sides;
    let at = |v: u32| shell.positions[v as usize];
    let path = align(
        &first.iter().map(|&v| at(v)).collect::<Vec<_>>(),
        &second.iter().map(|&v| at(v)).collect::<Vec<_>>(),
    );
    let width = path
        .iter()
        .map(|&(i, j)| at(first[i]).distance(at(second[j])))
        .sum::<f64>()
        / path.len() as f64;
    let edges = face.sides.iter().flat_map(|side| side.windows(2));
    let (mut length, mut count) = (0.0, 0.0);
    for pair in edges {
        length += at(pair[0]).distance(at(pair[1]));
        count += 1.0;
    }
    let rows = (width * count / length.max(f64::MIN_POSITIVE) - 1.0).round();
    let rows = rows.clamp(0.0, MOST_ROWS) as usize;

    let mut patch = Patch::default();
    let part = |v: u32| shell.part_of[v as usize];
    let mut below = first.clone();
    let targets = targets(first.len(), &path, |j| {
        (at(second[j]), outward[second[j] as usize])
    });
    for row in 1..=rows {
        let t = row as f64 / (rows + 1) as f64;
        let mut above = Vec::with_capacity(first.len());
        for (i, &vertex) in first.iter().enumerate() {
            if face.is_closed() && i + 1 == first.len() {
                above.push(above[0]);
                continue;
            }
            let (place, away) = targets[i];
            let number = shell.positions.len() + patch.positions.len();
            above.push(number as u32);
            let own = (at(vertex), outward[vertex as usize]);
            patch.positions.push(between(own, (place, away), t));
            patch
                .part_of
                .push(part(if t < 0.5 { vertex } else { second[0] }));
        }
        for (low, high) in below.windows(2).zip(above.windows(2)) {
            patch
                .triangles
                .extend([[low[1], low[0], high[0]], [high[0], high[1], low[1]]]);
        }
        below = above;
    }
    for step in path.windows(2) {
        let ((i, j), (next, onward)) = (step[0], step[1]);
        patch.triangles.push(if next > i {
            [below[next], below[i], second[j]]
        } else {
            [second[j], second[onward], below[i]]
        });
    }
    patch
}

/// Steps along two lines from start to end that keep them as near as can be: pairs of indices, one of
/// which grows by one each time (dynamic time warping without diagonal steps).
fn align(a: &[DVec3], b: &[DVec3]) -> Vec<(usize, usize)> {
    let width = b.len();
    let mut cost = vec![f64::INFINITY; a.len() * width];
    for i in 0..a.len() {
        for j in 0..width {
            let before = match (i, j) {
                (0, 0) => 0.0,
                (0, _) => cost[j - 1],
                (_, 0) => cost[(i - 1) * width],
                _ => cost[(i - 1) * width + j].min(cost[i * width + j - 1]),
            };
            cost[i * width + j] = before + a[i].distance_squared(b[j]);
        }
    }
    let (mut i, mut j) = (a.len() - 1, width - 1);
    let mut path = vec![(i, j)];
    while (i, j) != (0, 0) {
        let up = i
            .checked_sub(1)
            .map_or(f64::INFINITY, |i| cost[i * width + j]);
        let left = j
            .checked_sub(1)
            .map_or(f64::INFINITY, |j| cost[i * width + j]);
        if up < left {
            i -= 1;
        } else {
            j -= 1;
        }
        path.push((i, j));
    }
    path.reverse();
    path
}

/// For each vertex of the first line: the mean of what it was aligned with.
fn targets(
    count: usize,
    path: &[(usize, usize)],
    of: impl Fn(usize) -> (DVec3, DVec3),
) -> Vec<(DVec3, DVec3)> {
    let mut sums = vec![(DVec3::ZERO, DVec3::ZERO, 0.0); count];
    for &(i, j) in path {
        let (place, away) = of(j);
        let sum = &mut sums[i];
        *sum = (sum.0 + place, sum.1 + away, sum.2 + 1.0);
    }
    let mean =
        |(place, away, count): (DVec3, DVec3, f64)| (place / count, away.normalize_or_zero());
    sums.into_iter().map(mean).collect()
}

/// A point between two borders on the curve that leaves both along their surfaces (Hermite).
fn between((from, out): (DVec3, DVec3), (to, back): (DVec3, DVec3), t: f64) -> DVec3 {
    let way = to - from;
    let tangent = |direction: DVec3| {
        // Ragged borders have directions that mean nothing.
        if direction.dot(way) > 0.5 * way.length() {
            direction * way.length()
        } else {
            way
        }
    };
    let (start, end) = (tangent(out), tangent(-back));
    let (t2, t3) = (t * t, t * t * t);
    (2.0 * t3 - 3.0 * t2 + 1.0) * from
        + (t3 - 2.0 * t2 + t) * start
        + (3.0 * t2 - 2.0 * t3) * to
        + (t3 - t2) * end
}

/// Closes a hole. Small ones with the triangles of least area (Barequet & Sharir 1995), large ones as a
/// fan around their middle. O(vertices^3), of small ones.
#[must_use]
pub fn fill(shell: &Shell, border: &Border) -> Patch {
    const SMALL: usize = 60;
    let line: Vec<u32> = border.vertices.iter().rev().copied().collect();
    if line.len() > SMALL {
        let middle = shell.positions.len() as u32;
        let next = line.iter().cycle().skip(1);
        return Patch {
            positions: vec![border.centre(shell)],
            part_of: vec![shell.part_of[line[0] as usize]],
            triangles: line
                .iter()
                .zip(next)
                .map(|(&a, &b)| [a, b, middle])
                .collect(),
        };
    }
    let count = line.len();
    let at = |k: usize| shell.positions[line[k] as usize];
    let area = |i: usize, k: usize, j: usize| (at(k) - at(i)).cross(at(j) - at(i)).length();
    // best[i][j]: least area between i and j, and the corner in between.
    let mut best = vec![(0.0, 0); count * count];
    for span in 2..count {
        for i in 0..count - span {
            let j = i + span;
            let through = |k: usize| best[i * count + k].0 + best[k * count + j].0 + area(i, k, j);
            let k = (i + 1..j).min_by(|&a, &b| through(a).total_cmp(&through(b)));
            let k = k.unwrap_or(i + 1);
            best[i * count + j] = (through(k), k);
        }
    }
    let mut triangles = Vec::with_capacity(count);
    let mut open = vec![(0, count - 1)];
    while let Some((i, j)) = open.pop() {
        if j < i + 2 {
            continue;
        }
        let k = best[i * count + j].1;
        triangles.push([line[i], line[k], line[j]]);
        open.extend([(i, k), (k, j)]);
    }
    Patch {
        triangles,
        ..Patch::default()
    }
}
