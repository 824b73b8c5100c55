//! The skin as one sparse matrix from markers to vertices, fitted to what another mode does in the
//! user's motion.
//!
//! A surface that skinning moves is linear in the markers: a rigid part is an affine combination
//! of its markers, a blend is a blend of such combinations. So each block takes the few markers
//! that explain it best (orthogonal matching pursuit), as many as are worth it, and least squares
//! finds the shares. The ridge is the noise that the markers are expected to have, doubled. What
//! turns normals is found in the same way for itself: it takes fewer.

use glam::DVec3;
use sinew_core::asset::LANES;

use super::hybrid::NOISE;
use super::spread::Skin;
use super::tables::SlotTables;
use crate::clean::linear::Cholesky;

/// Markers looked at for a block, nearest along the surface.
const CANDIDATES: usize = 40;
/// Markers whose mean counts as a block's place.
const MIDDLE: usize = 4;
/// Markers taken between two fits.
const STRIDE: usize = 2;
/// A marker is worth its place where it takes the square of this many metres off the mean square of
/// what is left of a position,
const LEAST_STEP: f64 = 0.3e-3;
/// or the square of this much off that of a tangent.
const LEAST_TURN: f64 = 0.02;
/// The ridge, in squares of the markers' noise: what a few candidates repeat of it adds up.
const CAUTION: f64 = 4.0;
/// Weight of the rest shape, turned any way, against all frames.
const REST: f64 = 0.5;

/// What a surface does in a frame, `[vertices]` each.
#[derive(Clone, Debug)]
pub struct Example {
    /// `[markers]`, metres.
    pub markers: Vec<DVec3>,
    /// Metres.
    pub positions: Vec<[f32; 3]>,
    /// Unit length.
    pub normals: Vec<[f32; 3]>,
}

/// Slots of at most `most` markers a block. `rest` is the example of the rest pose; `distances`:
/// `[markers][vertices]`, along the surface.
/// O(blocks candidates (frames candidates + most^3))
#[must_use]
pub fn slots(
    order: &[u32],
    skin: &Skin,
    rest: &Example,
    examples: &[Example],
    distances: &[Vec<f32>],
    most: usize,
) -> SlotTables {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let blocks: Vec<&[u32]> = order.chunks(LANES).collect();
    let mut fitted = vec![Fitted::default(); blocks.len()];
    let chunk = blocks.len().div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        for (blocks, fitted) in blocks.chunks(chunk).zip(fitted.chunks_mut(chunk)) {
            scope.spawn(move || {
                for (vertices, fitted) in blocks.iter().zip(fitted) {
                    let near = nearest(vertices, distances);
                    let fit = Fit::new(vertices, &near, skin, rest, examples);
                    *fitted = Fitted {
                        positions: fit.solve(&near, 0, (1.0, LEAST_STEP), most),
                        tangents: fit.solve(&near, LANES, (0.0, LEAST_TURN), most),
                    };
                }
            });
        }
    });
    let mut out = SlotTables::default();
    for block in fitted {
        out.positions.push(in_floats(block.positions));
        let tangents = in_floats::<{ 2 * LANES }>(block.tangents).into_iter();
        let halves = tangents.map(|(marker, row)| {
            let half = |axis: usize| std::array::from_fn(|lane| row[axis * LANES + lane]);
            (marker, [half(0), half(1)])
        });
        out.tangents.push(halves.collect());
    }
    out
}

/// (marker, shares) of a block.
type Row<const N: usize> = (usize, [f64; N]);

#[derive(Clone, Debug, Default)]
struct Fitted {
    positions: Vec<Row<LANES>>,
    /// Along one tangent, then along the other.
    tangents: Vec<Row<{ 2 * LANES }>>,
}

fn in_floats<const N: usize>(rows: Vec<Row<N>>) -> Vec<(usize, [f32; N])> {
    let rows = rows.into_iter();
    rows.map(|(marker, row)| (marker, row.map(|x| x as f32)))
        .collect()
}

/// Markers nearest to any vertex of a block.
fn nearest(vertices: &[u32], distances: &[Vec<f32>]) -> Vec<usize> {
    let near = |marker: &usize| {
        let of = vertices.iter().map(|&v| distances[*marker][v as usize]);
        of.fold(f32::INFINITY, f32::min)
    };
    let mut markers: Vec<usize> = (0..distances.len()).collect();
    markers.sort_by(|a, b| near(a).total_cmp(&near(b)).then(a.cmp(b)));
    markers.truncate(CANDIDATES);
    markers
}

/// Normal equations of a block over its candidates.
struct Fit {
    n: usize,
    middle: usize,
    /// `[n x n]`
    gram: Vec<f64>,
    /// `[n][positions, two tangents]`
    right: Vec<[f64; 3 * LANES]>,
    /// Sum of the weights of frames.
    frames: f64,
}

impl Fit {
    fn new(
        vertices: &[u32],
        near: &[usize],
        skin: &Skin,
        rest: &Example,
        examples: &[Example],
    ) -> Self {
        let n = near.len();
        let middle = n.min(MIDDLE);
        let mut fit = Self {
            n,
            middle,
            gram: vec![0.0; n * n],
            right: vec![[0.0; 3 * LANES]; n],
            frames: examples.len() as f64 + REST * examples.len().max(1) as f64,
        };
        let tilts = tilts(vertices, skin, rest);
        let weight = REST * examples.len().max(1) as f64;
        fit.add(vertices, near, skin, rest, &tilts, weight);
        for example in examples {
            fit.add(vertices, near, skin, example, &tilts, 1.0);
        }
        let ridge = CAUTION * NOISE * NOISE * 3.0 * (examples.len() as f64 + weight);
        for at in 0..n {
            fit.gram[at * n + at] += ridge;
        }
        fit
    }

    fn add(
        &mut self,
        vertices: &[u32],
        near: &[usize],
        skin: &Skin,
        example: &Example,
        tilts: &[[f64; 2]; LANES],
        weight: f64,
    ) {
        let place = near[..self.middle]
            .iter()
            .map(|&marker| example.markers[marker])
            .sum::<DVec3>()
            / self.middle.max(1) as f64;
        let handles: Vec<DVec3> = near
            .iter()
            .map(|&marker| example.markers[marker] - place)
            .collect();
        let mut targets = [DVec3::ZERO; 3 * LANES];
        for lane in 0..LANES {
            let vertex = vertices[lane.min(vertices.len() - 1)] as usize;
            targets[lane] = point(example, vertex) - place;
            let tangents = tangents(skin, example, vertex);
            let normal = DVec3::from_array(example.normals[vertex].map(f64::from));
            for axis in 0..2 {
                targets[(axis + 1) * LANES + lane] = tangents[axis] - tilts[lane][axis] * normal;
            }
        }
        for (at, a) in handles.iter().enumerate() {
            let scaled = weight * *a;
            for (b, sum) in handles.iter().zip(&mut self.gram[at * self.n..]) {
                *sum += scaled.dot(*b);
            }
            for (target, sum) in targets.iter().zip(&mut self.right[at]) {
                *sum += scaled.dot(*target);
            }
        }
    }

    /// (marker, shares) of some right-hand sides, from `first` on. Markers are taken, at most `most`,
    /// as long as each takes the square of `least` off the mean square of what is left; `whole` is
    /// what shares sum to.
    fn solve<const N: usize>(
        &self,
        near: &[usize],
        first: usize,
        (whole, least): (f64, f64),
        most: usize,
    ) -> Vec<Row<N>> {
        let rows = self.right.iter();
        let right: Vec<[f64; N]> = rows
            .map(|row| std::array::from_fn(|at| row[first + at]))
            .collect();
        let worth = least * least * self.frames * N as f64;
        let most = most.min(self.n);
        let mut chosen: Vec<usize> = (0..self.middle.min(most)).collect();
        let mut shares = self.over(&chosen, &right);
        let mut before = explained(&chosen, &shares, &right);
        while chosen.len() < most {
            let mut best: Vec<(f64, usize)> = (0..self.n)
                .filter(|at| !chosen.contains(at))
                .map(|at| (self.gain(at, &chosen, &shares, &right), at))
                .collect();
            best.sort_by(|a, b| b.0.total_cmp(&a.0));
            let room = (most - chosen.len()).min(STRIDE);
            let mut more = chosen.clone();
            more.extend(best.iter().take(room).map(|found| found.1));
            let next = self.over(&more, &right);
            let now = explained(&more, &next, &right);
            if now - before < worth * room as f64 {
                break;
            }
            (chosen, shares, before) = (more, next, now);
        }
        // What the shares lack to the whole belongs to the middle.
        let mut sums = [0.0; N];
        for row in &shares {
            for (sum, share) in sums.iter_mut().zip(row) {
                *sum += share;
            }
        }
        for row in &mut shares[..self.middle] {
            for (share, sum) in row.iter_mut().zip(&sums) {
                *share += (whole - sum) / self.middle as f64;
            }
        }
        let markers = chosen.iter().map(|&at| near[at]);
        markers.zip(shares).collect()
    }

    /// How much a marker would explain of what is left.
    fn gain<const N: usize>(
        &self,
        at: usize,
        chosen: &[usize],
        shares: &[[f64; N]],
        right: &[[f64; N]],
    ) -> f64 {
        let mut left = right[at];
        for (&other, row) in chosen.iter().zip(shares) {
            let shared = self.gram[at * self.n + other];
            for (left, share) in left.iter_mut().zip(row) {
                *left -= shared * share;
            }
        }
        let squares: f64 = left.iter().map(|x| x * x).sum();
        squares / self.gram[at * self.n + at]
    }

    fn over<const N: usize>(&self, chosen: &[usize], right: &[[f64; N]]) -> Vec<[f64; N]> {
        let n = chosen.len();
        let pair = |at: usize| self.gram[chosen[at / n] * self.n + chosen[at % n]];
        let matrix: Vec<f64> = (0..n * n).map(pair).collect();
        let mut right: Vec<f64> = chosen.iter().flat_map(|&at| right[at]).collect();
        if let Some(factor) = Cholesky::new(n, matrix) {
            factor.solve(&mut right, N);
        } else {
            right.fill(0.0);
        }
        right.as_chunks::<N>().0.to_vec()
    }
}

/// What a least-squares solution takes off the squares, ridge included.
fn explained<const N: usize>(chosen: &[usize], shares: &[[f64; N]], right: &[[f64; N]]) -> f64 {
    let of = |(&at, row): (&usize, &[f64; N])| -> f64 {
        row.iter().zip(&right[at]).map(|(a, b)| a * b).sum()
    };
    chosen.iter().zip(shares).map(of).sum()
}

fn point(example: &Example, vertex: usize) -> DVec3 {
    DVec3::from_array(example.positions[vertex].map(f64::from))
}

/// What the surface's tangents have become, over the ring of a vertex.
fn tangents(skin: &Skin, example: &Example, vertex: usize) -> [DVec3; 2] {
    let axes =
        [0, 1, 2].map(|axis| skin.derivative(vertex, |at| f64::from(example.positions[at][axis])));
    [0, 1].map(|tangent| DVec3::from_array(axes.map(|slopes| slopes[tangent])))
}

/// How far the ring of each vertex leans out of the plane that its normal stands on, at rest.
fn tilts(vertices: &[u32], skin: &Skin, rest: &Example) -> [[f64; 2]; LANES] {
    std::array::from_fn(|lane| {
        let vertex = vertices[lane.min(vertices.len() - 1)] as usize;
        let normal = DVec3::from_array(rest.normals[vertex].map(f64::from));
        tangents(skin, rest, vertex).map(|tangent| tangent.dot(normal))
    })
}
