//! What lies inside a surface: cubic cells, and ways through them.
//!
//! A column of cell centres along each axis meets the surface in some places; counted with their
//! direction they give the winding number of every cell, seen from both ends (Nooruddin & Turk,
//! *Simplification and Repair of Polygonal Models Using Volumetric Techniques*, 2003). Four of the
//! six views decide, so that a hole leaks in one direction only. Cells beside each other are
//! neighbours unless the column between them leaves the solid: an arm that hangs closer to the hip
//! than a cell stays apart from it.

use glam::DVec3;

mod march;

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
        for (axis, crossings) in columns.iter().enumerate() {
            let stride = self.stride(axis);
            for cell in 0..self.place.len() {
                let next = self.index[self.place[cell] as usize + stride];
                if next != NONE {
                    self.neighbours[cell][2 * axis + 1] = next;
                    self.neighbours[next as usize][2 * axis] = cell as u32;
                }
            }
            self.part(axis, crossings, &winding);
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
}

#[cfg(test)]
mod tests;
