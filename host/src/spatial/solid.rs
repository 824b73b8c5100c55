//! What lies inside a surface: cubic cells, and ways through them.
//!
//! A column of cell centres along each axis meets the surface in some places; counted with their
//! direction they give the winding number of every cell, seen from both ends (Nooruddin & Turk,
//! *Simplification and Repair of Polygonal Models Using Volumetric Techniques*, 2003). Four of the
//! six views decide, so that a hole leaks in one direction only. Cells beside each other are
//! neighbours unless the column between them leaves the solid: an arm that hangs closer to the hip
//! than a cell stays apart from it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;

/// Most cells of the box around a surface.
const MOST_CELLS: usize = 1 << 25;
/// Views, of six, that must see a cell inside.
const VIEWS: u8 = 4;
/// No cell.
const NONE: u32 = u32::MAX;

/// Cubic cells inside a surface.
#[derive(Clone, Debug)]
pub struct Solid {
    low: DVec3,
    size: f64,
    counts: [usize; 3],
    /// Of the whole box: index among the inside cells.
    index: Vec<u32>,
    /// `[cells]`: place in the box.
    place: Vec<u32>,
    /// `[cells]`: neighbours towards -x, +x, -y, +y, -z, +z.
    neighbours: Vec<[u32; 6]>,
}

/// Where a column meets the surface.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    column: u32,
    /// In cells, from the centre of the first.
    at: f64,
    /// +1 on the way in, -1 on the way out.
    turn: i8,
}

impl Solid {
    /// The inside of a surface whose triangles face outward: positions in metres, all indices below
    /// `positions.len()`; `cells` along the longest side of its box (fewer where the box would get
    /// too large). Surfaces may overlap and may have holes. O(cells in the box + triangles)
    #[must_use]
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]], cells: usize) -> Self {
        let used = || {
            triangles
                .as_flattened()
                .iter()
                .map(|&v| positions[v as usize])
        };
        let low = used().fold(DVec3::INFINITY, DVec3::min);
        let high = used().fold(DVec3::NEG_INFINITY, DVec3::max);
        let span = high - low;
        let mut size = span.max_element() / cells.max(1) as f64;
        // A surface without thickness has cells of no use, but a finite number of them.
        if !(size.is_finite() && size > 0.0) {
            size = 1.0;
        }
        let along = |size: f64| {
            (span / size)
                .to_array()
                .map(|c| c.max(0.0).ceil() as usize + 5)
        };
        while along(size).iter().product::<usize>() > MOST_CELLS {
            size *= 1.26;
        }
        let counts = if triangles.is_empty() {
            [1; 3]
        } else {
            along(size)
        };
        let mut solid = Self {
            // Odd parts of a cell, so that columns miss the vertices of even models.
            low: if triangles.is_empty() {
                DVec3::ZERO
            } else {
                low - size * DVec3::new(2.137, 2.211, 2.173)
            },
            size,
            counts,
            index: Vec::new(),
            place: Vec::new(),
            neighbours: Vec::new(),
        };
        solid.fill(positions, triangles);
        solid
    }

    fn fill(&mut self, positions: &[DVec3], triangles: &[[u32; 3]]) {
        let all: usize = self.counts.iter().product();
        let columns = [0, 1, 2].map(|axis| self.crossings(axis, positions, triangles));
        let mut votes = vec![0_u8; all];
        // Winding number along each axis as seen from below, else from above.
        let mut winding = vec![[0_i8; 3]; all];
        for (axis, crossings) in columns.iter().enumerate() {
            for column in crossings.chunk_by(|a, b| a.column == b.column) {
                let total: i32 = column.iter().map(|c| i32::from(c.turn)).sum();
                let (mut next, mut below) = (0, 0);
                for step in 0..self.counts[axis] {
                    while column.get(next).is_some_and(|c| c.at < step as f64) {
                        below += i32::from(column[next].turn);
                        next += 1;
                    }
                    let above = below - total;
                    let at = self.along(axis, column[0].column as usize, step);
                    votes[at] += u8::from(below > 0) + u8::from(above > 0);
                    let seen = if below > 0 { below } else { above };
                    winding[at][axis] = seen.clamp(-100, 100) as i8;
                }
            }
        }
        self.index = vec![NONE; all];
        for (at, _) in votes
            .iter()
            .enumerate()
            .filter(|&(_, &votes)| votes >= VIEWS)
        {
            self.index[at] = self.place.len() as u32;
            self.place.push(at as u32);
        }
        self.neighbours = vec![[NONE; 6]; self.place.len()];
        for axis in 0..3 {
            let stride = self.stride(axis);
            for cell in 0..self.place.len() {
                let next = self.index[self.place[cell] as usize + stride];
                if next != NONE {
                    self.neighbours[cell][2 * axis + 1] = next;
                    self.neighbours[next as usize][2 * axis] = cell as u32;
                }
            }
            self.part(axis, &columns[axis], &winding);
        }
    }

    /// Parts neighbours where the way between their centres leaves the solid.
    fn part(&mut self, axis: usize, crossings: &[Crossing], winding: &[[i8; 3]]) {
        let step_of = |c: &Crossing| c.at.ceil() as usize;
        for between in crossings.chunk_by(|a, b| a.column == b.column && step_of(a) == step_of(b)) {
            let Some(below) = step_of(&between[0]).checked_sub(1) else {
                continue;
            };
            let at = self.along(axis, between[0].column as usize, below);
            let cell = self.index[at];
            let Some(&next) = self.neighbours.get(cell as usize).map(|n| &n[2 * axis + 1]) else {
                continue;
            };
            let mut inside = i32::from(winding[at][axis].max(1));
            let leaves = between.iter().any(|crossing| {
                inside += i32::from(crossing.turn);
                inside <= 0
            });
            if next != NONE && leaves {
                self.neighbours[cell as usize][2 * axis + 1] = NONE;
                self.neighbours[next as usize][2 * axis] = NONE;
            }
        }
    }

    /// Where columns along an axis meet triangles, by column, then along it.
    fn crossings(&self, axis: usize, positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Crossing> {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut found = Vec::new();
        for triangle in triangles {
            let corners = triangle.map(|at| (positions[at as usize] - self.low) / self.size);
            let flat = corners.map(|corner| [corner[u], corner[v]]);
            let edge = |to: usize| [flat[to][0] - flat[0][0], flat[to][1] - flat[0][1]];
            let (ab, ac) = (edge(1), edge(2));
            let area = ab[0] * ac[1] - ab[1] * ac[0];
            if area == 0.0 {
                continue;
            }
            let range = |k: usize| {
                let values = flat.map(|corner| corner[k]);
                let least = values.iter().copied().fold(f64::INFINITY, f64::min);
                let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                least.ceil() as usize..=most.floor() as usize
            };
            for i in range(0) {
                for j in range(1) {
                    let to = [i as f64 - flat[0][0], j as f64 - flat[0][1]];
                    let b = (to[0] * ac[1] - to[1] * ac[0]) / area;
                    let c = (ab[0] * to[1] - ab[1] * to[0]) / area;
                    if b < 0.0 || c < 0.0 || b + c > 1.0 {
                        continue;
                    }
                    let [x, y, z] = corners.map(|corner| corner[axis]);
                    found.push(Crossing {
                        column: (i * self.counts[v] + j) as u32,
                        at: x + b * (y - x) + c * (z - x),
                        // A triangle that faces against the axis lets the column in.
                        turn: if area < 0.0 { 1 } else { -1 },
                    });
                }
            }
        }
        found.sort_by(|a, b| a.column.cmp(&b.column).then(a.at.total_cmp(&b.at)));
        found
    }

    /// Place in the box of a step along a column.
    fn along(&self, axis: usize, column: usize, step: usize) -> usize {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let (i, j) = (column / self.counts[v], column % self.counts[v]);
        i * self.stride(u) + j * self.stride(v) + step * self.stride(axis)
    }

    fn stride(&self, axis: usize) -> usize {
        self.counts[..axis].iter().product()
    }

    /// Number of cells inside.
    #[must_use]
    pub fn len(&self) -> usize {
        self.place.len()
    }

    /// Whether nothing is inside.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.place.is_empty()
    }

    /// Side of a cell, metres.
    #[must_use]
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Layer of a cell along an axis: cells of one layer have one coordinate.
    #[must_use]
    pub fn layer(&self, cell: u32, axis: usize) -> usize {
        self.place[cell as usize] as usize / self.stride(axis) % self.counts[axis]
    }

    /// The layer in which a coordinate lies.
    #[must_use]
    pub fn layer_at(&self, coordinate: f64, axis: usize) -> usize {
        let steps = ((coordinate - self.low[axis]) / self.size).round();
        (steps.max(0.0) as usize).min(self.counts[axis] - 1)
    }

    /// Centre of a cell, metres.
    #[must_use]
    pub fn centre(&self, cell: u32) -> DVec3 {
        let layers = [0, 1, 2].map(|axis| self.layer(cell, axis) as f64);
        self.low + self.size * DVec3::from_array(layers)
    }

    /// Cells that share a face with this one, and no surface between.
    pub fn neighbours(&self, cell: u32) -> impl Iterator<Item = u32> + '_ {
        let all = self.neighbours[cell as usize].iter().copied();
        all.filter(|&next| next != NONE)
    }

    /// Whether a point lies in a cell that is inside.
    #[must_use]
    pub fn contains(&self, point: DVec3) -> bool {
        let steps = ((point - self.low) / self.size).round();
        self.cell(steps).is_some()
    }

    fn cell(&self, steps: DVec3) -> Option<u32> {
        let mut at = 0;
        for axis in 0..3 {
            let step = steps[axis];
            if !(step >= 0.0 && step < self.counts[axis] as f64) {
                return None;
            }
            at += step as usize * self.stride(axis);
        }
        Some(self.index[at]).filter(|&cell| cell != NONE)
    }

    /// Inside cells whose centres lie in the cube of `2 reach + 2` cells a side around a point, with
    /// their distances. O(reach^3)
    pub fn around(&self, point: DVec3, reach: i32) -> impl Iterator<Item = (u32, f64)> + '_ {
        let first = ((point - self.low) / self.size).floor();
        let range = -reach..=reach + 1;
        let all = range.clone().flat_map(move |x| {
            let range = range.clone();
            range
                .clone()
                .flat_map(move |y| range.clone().map(move |z| [x, y, z]))
        });
        all.filter_map(move |step| {
            let cell = self.cell(first + DVec3::from_array(step.map(f64::from)))?;
            Some((cell, self.centre(cell).distance(point)))
        })
    }

    /// The inside cell nearest to a point, no farther than about `reach` cells. O(reach^3)
    #[must_use]
    pub fn nearest(&self, point: DVec3, reach: i32) -> Option<(u32, f64)> {
        let mut at = 0;
        loop {
            let found = self.around(point, at).min_by(|a, b| a.1.total_cmp(&b.1));
            if found.is_some() || at >= reach {
                return found;
            }
            at = (2 * at + 1).min(reach);
        }
    }

    /// Distance through the inside from seeds (cell, metres already gone, mark), metres, with the
    /// mark of the nearest seed; infinite where no way leads. O(cells log cells)
    ///
    /// Fast marching with upwind differences (Sethian 1996): distances are those of straight lines
    /// where one is free, up to a part of a cell.
    #[must_use]
    pub fn march(&self, seeds: &[(u32, f64, u32)]) -> (Vec<f32>, Vec<u32>) {
        let mut distance = vec![f32::INFINITY; self.len()];
        let mut mark = vec![NONE; self.len()];
        let mut queue = BinaryHeap::new();
        for &(cell, gone, own) in seeds {
            let (gone, at) = (gone as f32, cell as usize);
            if gone < distance[at] {
                (distance[at], mark[at]) = (gone, own);
                queue.push(Reverse((gone.to_bits(), cell)));
            }
        }
        let mut done = vec![false; self.len()];
        while let Some(Reverse((_, cell))) = queue.pop() {
            if std::mem::replace(&mut done[cell as usize], true) {
                continue;
            }
            for next in self.neighbours(cell) {
                if done[next as usize] {
                    continue;
                }
                let candidate = self.upwind(next, &distance);
                if candidate < distance[next as usize] {
                    distance[next as usize] = candidate;
                    mark[next as usize] = mark[cell as usize];
                    queue.push(Reverse((candidate.to_bits(), next)));
                }
            }
        }
        (distance, mark)
    }

    /// The distance whose gradient over the nearest neighbour along each axis is one.
    fn upwind(&self, cell: u32, distance: &[f32]) -> f32 {
        let around = &self.neighbours[cell as usize];
        let of = |next: u32| {
            distance
                .get(next as usize)
                .copied()
                .unwrap_or(f32::INFINITY)
        };
        let mut near = [0, 1, 2].map(|axis| of(around[2 * axis]).min(of(around[2 * axis + 1])));
        near.sort_by(f32::total_cmp);
        let step = self.size as f32;
        let mut best = near[0] + step;
        let (mut sum, mut squares) = (near[0], near[0] * near[0]);
        for (count, &next) in [2.0, 3.0].iter().zip(&near[1..]) {
            if next >= best {
                break;
            }
            sum += next;
            squares += next * next;
            let under = sum * sum - count * (squares - step * step);
            if under < 0.0 {
                break;
            }
            best = (sum + under.sqrt()) / count;
        }
        best
    }

    /// Distance of every cell from the outside, metres. O(cells log cells)
    #[must_use]
    pub fn depth(&self) -> Vec<f32> {
        let outer = (0..self.len() as u32).filter(|&cell| self.neighbours(cell).count() < 6);
        let seeds: Vec<_> = outer.map(|cell| (cell, 0.5 * self.size, 0)).collect();
        self.march(&seeds).0
    }
}

/// Turns triangles so that neighbours agree and every closed part faces outward. `vertex_of` says
/// which vertices are one. O(triangles log triangles)
#[must_use]
pub fn face_outward(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    vertex_of: &[u32],
) -> Vec<[u32; 3]> {
    let mut turned: Vec<[u32; 3]> = triangles
        .iter()
        .map(|corners| corners.map(|v| vertex_of[v as usize]))
        .collect();
    // (edge, triangle, whether the triangle runs it upward)
    let mut edges: Vec<([u32; 2], u32, bool)> = Vec::with_capacity(3 * turned.len());
    for (at, &[a, b, c]) in turned.iter().enumerate() {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            edges.push(([from.min(to), from.max(to)], at as u32, from < to));
        }
    }
    edges.sort_unstable();
    let mut links: Vec<(u32, u32, bool)> = Vec::new();
    for shared in edges.chunk_by(|a, b| a.0 == b.0) {
        // Edges of more than two triangles do not say which side is out.
        if let [a, b] = *shared
            && a.1 != b.1
        {
            links.extend([(a.1, b.1, a.2 == b.2), (b.1, a.1, a.2 == b.2)]);
        }
    }
    links.sort_unstable();
    let mut flip: Vec<Option<bool>> = vec![None; turned.len()];
    for first in 0..turned.len() {
        if flip[first].is_some() {
            continue;
        }
        flip[first] = Some(false);
        let mut component = vec![first as u32];
        let mut at = 0;
        while let Some(&triangle) = component.get(at) {
            at += 1;
            let own = flip[triangle as usize] == Some(true);
            let start = links.partition_point(|link| link.0 < triangle);
            for &(_, next, against) in links[start..].iter().take_while(|l| l.0 == triangle) {
                if flip[next as usize].is_none() {
                    flip[next as usize] = Some(own != against);
                    component.push(next);
                }
            }
        }
        let middle = component
            .iter()
            .map(|&t| positions[turned[t as usize][0] as usize]);
        let middle = middle.sum::<DVec3>() / component.len() as f64;
        let mut volume = 0.0;
        for &triangle in &component {
            if flip[triangle as usize] == Some(true) {
                turned[triangle as usize].swap(1, 2);
            }
            let [a, b, c] = turned[triangle as usize].map(|v| positions[v as usize] - middle);
            volume += a.cross(b).dot(c);
        }
        if volume < 0.0 {
            component
                .iter()
                .for_each(|&t| turned[t as usize].swap(1, 2));
        }
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box between two corners, facing outward.
    fn block(low: DVec3, high: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let corner = |at: u32| {
            let pick = |axis: usize| {
                if at >> axis & 1 == 0 {
                    low[axis]
                } else {
                    high[axis]
                }
            };
            DVec3::new(pick(0), pick(1), pick(2))
        };
        let quads = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let triangles = quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        ((0..8).map(corner).collect(), triangles.collect())
    }

    fn join(parts: &[(Vec<DVec3>, Vec<[u32; 3]>)]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (at, of) in parts {
            let first = positions.len() as u32;
            positions.extend(at);
            triangles.extend(of.iter().map(|corners| corners.map(|v| v + first)));
        }
        (positions, triangles)
    }

    #[test]
    fn a_box_has_its_volume_and_straight_ways() {
        let (positions, triangles) = block(DVec3::ZERO, DVec3::new(1.0, 0.5, 0.25));
        let solid = Solid::new(&positions, &triangles, 40);
        let volume = solid.len() as f64 * solid.size().powi(3);
        assert!((volume - 0.125).abs() < 0.015, "{volume}");
        let (from, _) = solid.nearest(DVec3::new(0.1, 0.1, 0.1), 2).expect("inside");
        let (distances, marks) = solid.march(&[(from, 0.0, 7)]);
        assert!(marks.iter().all(|&mark| mark == 7));
        for (cell, &found) in distances.iter().enumerate() {
            let straight = solid.centre(cell as u32).distance(solid.centre(from));
            assert!(
                (f64::from(found) - straight).abs() < 1.2 * solid.size(),
                "{found} {straight}"
            );
        }
        let depth = solid.depth().into_iter().fold(0.0, f32::max);
        assert!((depth - 0.125).abs() < 0.03, "{depth}");
    }

    #[test]
    fn a_hole_does_not_empty_the_rest() {
        let (positions, mut triangles) = block(DVec3::ZERO, DVec3::ONE);
        let whole = Solid::new(&positions, &triangles, 20).len();
        triangles.retain(|corners| corners.iter().any(|&v| positions[v as usize].y < 0.5));
        let open = Solid::new(&positions, &triangles, 20);
        assert_eq!(open.len(), whole);
        assert!(!open.contains(DVec3::new(0.5, 1.3, 0.5)));
    }

    #[test]
    fn a_gap_thinner_than_a_cell_keeps_parts_apart() {
        let left = block(DVec3::ZERO, DVec3::ONE);
        let right = block(DVec3::new(1.002, 0.0, 0.0), DVec3::new(2.0, 1.0, 1.0));
        let (positions, triangles) = join(&[left, right]);
        let solid = Solid::new(&positions, &triangles, 40);
        let (from, _) = solid.nearest(DVec3::splat(0.5), 2).expect("inside");
        let (distances, _) = solid.march(&[(from, 0.0, 0)]);
        for (cell, distance) in distances.iter().enumerate() {
            let is_left = solid.centre(cell as u32).x < 1.001;
            assert_eq!(distance.is_finite(), is_left);
        }
    }

    #[test]
    fn what_lies_inside_another_part_is_no_wall() {
        let outer = block(DVec3::ZERO, DVec3::ONE);
        let inner = block(DVec3::splat(0.3), DVec3::splat(0.6));
        let (positions, triangles) = join(&[outer, inner]);
        let solid = Solid::new(&positions, &triangles, 30);
        let (from, _) = solid.nearest(DVec3::splat(0.9), 2).expect("inside");
        let (distances, _) = solid.march(&[(from, 0.0, 0)]);
        assert!(distances.iter().all(|distance| distance.is_finite()));
    }

    #[test]
    fn triangles_are_turned_to_face_outward() {
        let (positions, triangles) = block(DVec3::ZERO, DVec3::ONE);
        let vertex_of: Vec<u32> = (0..8).collect();
        let mut mixed = triangles.clone();
        for at in [1, 4, 5, 9] {
            mixed[at].swap(0, 1);
        }
        let turned = face_outward(&positions, &mixed, &vertex_of);
        let same = |a: &[u32; 3], b: &[u32; 3]| {
            (0..3).any(|k| [b[k], b[(k + 1) % 3], b[(k + 2) % 3]] == *a)
        };
        assert!(triangles.iter().zip(&turned).all(|(a, b)| same(a, b)));
        let inverted: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
        let turned = face_outward(&positions, &inverted, &vertex_of);
        assert!(triangles.iter().zip(&turned).all(|(a, b)| same(a, b)));
    }

    #[test]
    fn nothing_is_inside_nothing() {
        assert!(Solid::new(&[], &[], 64).is_empty());
        let flat = [DVec3::ZERO, DVec3::X, DVec3::Y];
        assert!(Solid::new(&flat, &[[0, 1, 2]], 64).is_empty());
        let point = [DVec3::ONE; 3];
        assert!(Solid::new(&point, &[[0, 1, 2]], 64).is_empty());
    }
}
