//! Triangles in fixed point in, the nearest one at each sample out.

use super::assemble::{Triangle, UNIT, Vertex, doubled_area};

/// No triangle here.
pub(super) const NONE: u32 = u32::MAX;

/// Where the samples of a picture lie.
///
/// Each cell of the sample grid holds one sample. Within a pixel, no two of its `side * side`
/// samples share a column or a row, so that an edge near the vertical or horizontal passes through
/// as many shades as there are samples.
#[derive(Clone, Copy)]
pub(super) struct Pattern {
    side: usize,
}

impl Pattern {
    /// `side` is a power of two, at most 4.
    pub fn new(side: usize) -> Self {
        Self { side }
    }

    /// Offset right of the cell's left edge, in fixed point.
    fn right(self, row: usize) -> i64 {
        let rank = self.side - 1 - row % self.side;
        UNIT * (2 * rank as i64 + 1) / (2 * self.side as i64)
    }

    /// Offset below the cell's top edge, in fixed point.
    fn down(self, column: usize) -> i64 {
        let rank = column % self.side;
        UNIT * (2 * rank as i64 + 1) / (2 * self.side as i64)
    }

    /// Position of a sample in fixed point.
    pub fn position(self, column: usize, row: usize) -> [i64; 2] {
        [
            column as i64 * UNIT + self.right(row),
            row as i64 * UNIT + self.down(column),
        ]
    }
}

/// The samples of some consecutive rows.
pub(super) struct Band {
    pub pattern: Pattern,
    pub columns: usize,
    pub first_row: usize,
    pub rows: usize,
    /// `[rows x columns]`; the largest [`Vertex::inverse_w`] so far, 0 where there is none.
    pub nearness: Vec<f32>,
    /// `[rows x columns]`; index of the nearest triangle, or [`NONE`].
    pub nearest: Vec<u32>,
}

impl Band {
    pub fn new(pattern: Pattern, columns: usize) -> Self {
        Self {
            pattern,
            columns,
            first_row: 0,
            rows: 0,
            nearness: Vec::new(),
            nearest: Vec::new(),
        }
    }

    /// Empties the band and moves it to other rows.
    pub fn reset(&mut self, first_row: usize, rows: usize) {
        self.first_row = first_row;
        self.rows = rows;
        self.nearness.clear();
        self.nearness.resize(self.columns * rows, 0.0);
        self.nearest.clear();
        self.nearest.resize(self.columns * rows, NONE);
    }

    /// Rows and columns, cut to the band, of the cells that the box `[left, top, right, bottom]`
    /// in fixed point touches.
    pub fn cells(&self, bounds: [i64; 4]) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let range = |low: i64, high: i64, first: usize, count: usize| {
            let clamp = |cell: i64| cell.clamp(first as i64, (first + count) as i64) as usize;
            clamp(low.div_euclid(UNIT))..clamp(high.div_euclid(UNIT) + 1)
        };
        let [left, top, right, bottom] = bounds;
        (
            range(top, bottom, self.first_row, self.rows),
            range(left, right, 0, self.columns),
        )
    }

    /// Draws triangle number `id`, with the top-left rule: two triangles that share an edge share
    /// no sample and leave none out. Of two at the same depth the first stays.
    pub fn draw(&mut self, id: u32, triangle: &Triangle, vertices: &[Vertex]) {
        let corners = triangle.vertices.map(|vertex| &vertices[vertex as usize]);
        let [a, b, c] = corners;
        let (left, right) = extent(corners.map(|v| v.x));
        let (top, bottom) = extent(corners.map(|v| v.y));
        let (rows, columns) = self.cells([left, top, right, bottom]);
        if rows.is_empty() || columns.is_empty() {
            return;
        }
        let edges = [Edge::new(a, b), Edge::new(b, c), Edge::new(c, a)];
        let depth = Depth::new(corners);
        for row in rows {
            let x = columns.start as i64 * UNIT + self.pattern.right(row);
            let y = row as i64 * UNIT;
            // Value at the first cell with the sample at the cell's top; `down` is added below.
            let mut values = edges.each_ref().map(|edge| edge.at(x, y));
            let start = (row - self.first_row) * self.columns;
            for column in columns.clone() {
                let down = self.pattern.down(column);
                let inside = (values[0] + edges[0].dx * down)
                    | (values[1] + edges[1].dx * down)
                    | (values[2] + edges[2].dx * down);
                if inside >= 0 {
                    let [x, y] = self.pattern.position(column, row);
                    let nearness = depth.at(x, y);
                    let cell = start + column;
                    if nearness > self.nearness[cell] {
                        self.nearness[cell] = nearness;
                        self.nearest[cell] = id;
                    }
                }
                for (value, edge) in values.iter_mut().zip(&edges) {
                    *value -= edge.dy * UNIT;
                }
            }
        }
    }
}

fn extent([a, b, c]: [i32; 3]) -> (i64, i64) {
    (i64::from(a.min(b).min(c)), i64::from(a.max(b).max(c)))
}

/// `dx (y - from.y) - dy (x - from.x)`: positive on the inner side (Pineda 1988).
struct Edge {
    dx: i64,
    dy: i64,
    constant: i64,
}

impl Edge {
    fn new(from: &Vertex, to: &Vertex) -> Self {
        let dx = i64::from(to.x) - i64::from(from.x);
        let dy = i64::from(to.y) - i64::from(from.y);
        // A sample exactly on the edge belongs to the triangle only at its top and left edges.
        let owned = dy < 0 || (dy == 0 && dx > 0);
        Self {
            dx,
            dy,
            constant: dy * i64::from(from.x) - dx * i64::from(from.y) - i64::from(!owned),
        }
    }

    fn at(&self, x: i64, y: i64) -> i64 {
        self.dx * y - self.dy * x + self.constant
    }
}

/// Nearness across a triangle, which is linear on the picture.
struct Depth {
    x: i64,
    y: i64,
    value: f32,
    right: f32,
    down: f32,
    least: f32,
    most: f32,
}

impl Depth {
    fn new([a, b, c]: [&Vertex; 3]) -> Self {
        let area = doubled_area([a, b, c]) as f64;
        let edge = |v: &Vertex| {
            (
                f64::from(v.x) - f64::from(a.x),
                f64::from(v.y) - f64::from(a.y),
                f64::from(v.inverse_w) - f64::from(a.inverse_w),
            )
        };
        let ((bx, by, bn), (cx, cy, cn)) = (edge(b), edge(c));
        Self {
            x: i64::from(a.x),
            y: i64::from(a.y),
            value: a.inverse_w,
            right: ((bn * cy - cn * by) / area) as f32,
            down: ((cn * bx - bn * cx) / area) as f32,
            least: a.inverse_w.min(b.inverse_w).min(c.inverse_w),
            most: a.inverse_w.max(b.inverse_w).max(c.inverse_w),
        }
    }

    /// Always the same at the same sample, whichever band it is drawn in; never outside the range
    /// of the corners, however thin the triangle.
    fn at(&self, x: i64, y: i64) -> f32 {
        let value =
            self.value + (x - self.x) as f32 * self.right + (y - self.y) as f32 * self.down;
        value.max(self.least).min(self.most)
    }
}

#[cfg(test)]
mod tests {
    use super::super::assemble::Paint;
    use super::*;
    use glam::Vec3;

    fn vertex(x: f64, y: f64, inverse_w: f32) -> Vertex {
        Vertex {
            x: (x * UNIT as f64) as i32,
            y: (y * UNIT as f64) as i32,
            inverse_w,
            world: Vec3::ZERO,
            normal: Vec3::ZERO,
            color: Vec3::ZERO,
        }
    }

    fn triangle(vertices: [u32; 3]) -> Triangle {
        Triangle {
            vertices,
            flipped: false,
            paint: Paint::Mixed,
        }
    }

    /// Rows of a `size` x `size` picture as text, `.` for none, else the triangle's number.
    fn picture(side: usize, size: usize, vertices: &[Vertex], triangles: &[[u32; 3]]) -> String {
        let mut band = Band::new(Pattern::new(side), size);
        band.reset(0, size);
        for (id, &corners) in triangles.iter().enumerate() {
            band.draw(id as u32, &triangle(corners), vertices);
        }
        let glyph = |&id: &u32| char::from_digit(id, 10).unwrap_or('.');
        let rows = band.nearest.chunks(size);
        let rows: Vec<String> = rows.map(|row| row.iter().map(glyph).collect()).collect();
        rows.join("/")
    }

    #[test]
    fn two_halves_of_a_square_cover_it_once() {
        let corners = [
            vertex(0.5, 0.5, 1.0),
            vertex(3.5, 0.5, 1.0),
            vertex(3.5, 3.5, 1.0),
            vertex(0.5, 3.5, 1.0),
        ];
        // Samples lie at cell centres, so the outline runs through samples: the top and left ones
        // belong to the square, those at its right and bottom do not. The diagonal belongs to the
        // triangle on its right, whose left edge it is.
        assert_eq!(picture(1, 4, &corners, &[[0, 1, 2]]), "000./.00./..0./....");
        assert_eq!(picture(1, 4, &corners, &[[0, 2, 3]]), "..../0.../00../....");
        let both = picture(1, 4, &corners, &[[0, 1, 2], [0, 2, 3]]);
        assert_eq!(both, "000./100./110./....");
    }

    #[test]
    fn nearer_wins_in_either_order_and_crossing_planes_split() {
        let vertices = [
            vertex(0.0, 0.0, 1.0),
            vertex(8.0, 0.0, 1.0),
            vertex(0.0, 8.0, 1.0),
            vertex(0.0, 0.0, 3.0),
            vertex(8.0, 0.0, 0.0),
            vertex(0.0, 8.0, 3.0),
        ];
        let near_first = picture(1, 4, &vertices, &[[3, 4, 5], [0, 1, 2]]);
        let far_first = picture(1, 4, &vertices, &[[0, 1, 2], [3, 4, 5]]);
        // 3 - 3 x / 8 falls below 1 at x = 5.33, outside these four columns.
        assert_eq!(near_first, "0000/0000/0000/0000");
        assert_eq!(far_first, "1111/1111/1111/1111");
        let wide = picture(1, 8, &vertices, &[[0, 1, 2], [3, 4, 5]]);
        assert!(wide.starts_with("1111100./111110../11111.../1111...."), "{wide}");
        let tie = picture(1, 4, &vertices[..3], &[[0, 1, 2], [0, 1, 2]]);
        assert!(!tie.contains('1'), "of two equal ones the first stays");
    }

    #[test]
    fn samples_of_a_pixel_share_no_row_or_column() {
        for side in [1, 2, 4] {
            let pattern = Pattern::new(side);
            let mut xs = Vec::new();
            let mut ys = Vec::new();
            for row in 0..side {
                for column in 0..side {
                    let [x, y] = pattern.position(column, row);
                    assert_eq!(x / UNIT, column as i64);
                    assert_eq!(y / UNIT, row as i64);
                    xs.push(x);
                    ys.push(y);
                }
            }
            for list in [&mut xs, &mut ys] {
                list.sort_unstable();
                list.dedup();
                assert_eq!(list.len(), side * side);
            }
        }
        assert_eq!(Pattern::new(1).position(3, 2), [3 * 256 + 128, 2 * 256 + 128]);
    }

    #[test]
    fn a_fan_covers_every_sample_exactly_once() {
        // Random fan around an inner point: counts must add up to the square's cells.
        let mut corners = vec![vertex(7.3, 8.1, 1.0)];
        let mut state = 1u32;
        for k in 0..64 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let along = (k % 16) as f64;
            let jitter = f64::from(state >> 24) / 256.0;
            corners.push(match k / 16 {
                0 => vertex(along + jitter, 0.0, 1.0),
                1 => vertex(16.0, along + jitter, 1.0),
                2 => vertex(16.0 - along - jitter, 16.0, 1.0),
                _ => vertex(0.0, 16.0 - along - jitter, 1.0),
            });
        }
        corners.extend([(0.0, 0.0), (16.0, 0.0), (16.0, 16.0), (0.0, 16.0)].map(|(x, y)| vertex(x, y, 1.0)));
        let mut ring: Vec<u32> = Vec::new();
        for side in 0..4u32 {
            ring.push(65 + side);
            ring.extend(1 + side * 16..1 + side * 16 + 16);
        }
        let mut counts = vec![0; 256];
        for k in 0..ring.len() {
            let corners_of = [0, ring[k], ring[(k + 1) % ring.len()]];
            if doubled_area(corners_of.map(|v| &corners[v as usize])) == 0 {
                continue;
            }
            let mut band = Band::new(Pattern::new(2), 16);
            band.reset(0, 16);
            band.draw(0, &triangle(corners_of), &corners);
            for (count, &id) in counts.iter_mut().zip(&band.nearest) {
                *count += u32::from(id == 0);
            }
        }
        assert!(counts.iter().all(|&count| count == 1), "{counts:?}");
    }
}
