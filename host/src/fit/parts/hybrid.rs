//! Tables of the hybrid mode: part weights, and biharmonic weights of marker residuals cut to a
//! few markers a block and refitted to the residuals of the user's motion.

use glam::DVec3;
use sinew_core::asset::LANES;

use super::spread::Skin;
use super::tables::SlotTables;
use crate::clean::linear::Cholesky;

/// Standard deviation of marker noise that a fit must bear, metres.
pub(super) const NOISE: f64 = 0.5e-3;
/// Markers with less weight in every vertex of a block are left out of it, and those that move it
/// by less than this on average, metres.
const LEAST: f64 = 0.02;
const LEAST_MOVE: f64 = 0.02e-3;
/// Those that tilt its tangents by less than this on average are left out of its normals, radians.
const LEAST_TURN: f64 = 0.005;

/// Markers `[blocks]` of at most `most` each and their shares in eight vertices.
///
/// `weights`: biharmonic, `[markers][vertices]`; `residuals`: `[frames][markers]`, metres.
/// O(markers^2 (frames + vertices))
#[must_use]
pub fn slots(
    order: &[u32],
    skin: &Skin,
    weights: &[Vec<f64>],
    residuals: &[Vec<DVec3>],
    most: usize,
) -> SlotTables {
    let markers = weights.len();
    let gram = gram(residuals, markers);
    let frames = residuals.len().max(1) as f64;
    let ridge = NOISE * NOISE * 3.0 * residuals.len().max(1) as f64;
    let mut out = SlotTables::default();
    for vertices in order.chunks(LANES) {
        // Shares of all markers: of the position and along both tangents, vertex by vertex.
        let full: Vec<[f64; 3 * LANES]> = (0..markers)
            .map(|marker| {
                let field = |vertex: usize| weights[marker][vertex];
                let mut row = [0.0; 3 * LANES];
                for lane in 0..LANES {
                    let vertex = vertices[lane.min(vertices.len() - 1)] as usize;
                    let [u, v] = skin.derivative(vertex, field);
                    row[lane] = field(vertex);
                    row[LANES + lane] = u;
                    row[2 * LANES + lane] = v;
                }
                row
            })
            .collect();
        let strength = |marker: usize| {
            let shares = full[marker][..LANES].iter();
            shares.map(|share| share.abs()).fold(0.0, f64::max)
        };
        let mut near: Vec<usize> = (0..markers).filter(|&m| strength(m) >= LEAST).collect();
        // What a marker moves in the user's motion decides, not its weight alone.
        let effect = |marker: usize| {
            let moved = (gram[marker * markers + marker] + ridge).sqrt();
            let shares = full[marker][..LANES].iter();
            moved * shares.map(|share| share * share).sum::<f64>().sqrt()
        };
        near.retain(|&marker| {
            let moved = (gram[marker * markers + marker] / frames).sqrt();
            moved * strength(marker) >= LEAST_MOVE
        });
        near.sort_by(|&a, &b| effect(b).total_cmp(&effect(a)).then(a.cmp(&b)));
        near.truncate(most);
        let axis = |row: &[f64; 3 * LANES], axis: usize| {
            std::array::from_fn(|lane| row[axis * LANES + lane] as f32)
        };
        let rows = near.iter().zip(refit(&near, &full, &gram, ridge));
        let positions = rows.map(|(&marker, row)| (marker, axis(&row, 0)));
        out.positions.push(positions.collect());
        near.retain(|&marker| {
            let moved = (gram[marker * markers + marker] / frames).sqrt();
            let slopes = full[marker][LANES..].iter();
            let steepest = slopes.map(|slope| slope.abs()).fold(0.0, f64::max);
            moved * steepest >= LEAST_TURN
        });
        let rows = near.iter().zip(refit(&near, &full, &gram, ridge));
        let tangents = rows.map(|(&marker, row)| (marker, [axis(&row, 1), axis(&row, 2)]));
        out.tangents.push(tangents.collect());
    }
    out
}

/// Least squares over the residuals seen, with the cut weights as the prior: what the markers left
/// out would have added is given to those that move alike.
fn refit(
    near: &[usize],
    full: &[[f64; 3 * LANES]],
    gram: &[f64],
    ridge: f64,
) -> Vec<[f64; 3 * LANES]> {
    let (n, markers) = (near.len(), full.len());
    let mut matrix = vec![0.0; n * n];
    let mut right = vec![0.0; n * 3 * LANES];
    for (at, &marker) in near.iter().enumerate() {
        for (other_at, &other) in near.iter().enumerate() {
            matrix[at * n + other_at] = gram[marker * markers + other];
        }
        matrix[at * n + at] += ridge;
        let to = &mut right[at * 3 * LANES..][..3 * LANES];
        for (other, row) in full.iter().enumerate() {
            let shared = gram[marker * markers + other];
            for (to, value) in to.iter_mut().zip(row) {
                *to += shared * value;
            }
        }
        for (to, value) in to.iter_mut().zip(&full[marker]) {
            *to += ridge * value;
        }
    }
    match Cholesky::new(n, matrix) {
        Some(factor) => factor.solve(&mut right, 3 * LANES),
        None => return near.iter().map(|&marker| full[marker]).collect(),
    }
    right.as_chunks::<{ 3 * LANES }>().0.to_vec()
}

/// `[markers x markers]`: sums of products of residuals.
fn gram(residuals: &[Vec<DVec3>], markers: usize) -> Vec<f64> {
    let mut gram = vec![0.0; markers * markers];
    for frame in residuals {
        for (a, row) in frame.iter().zip(gram.chunks_exact_mut(markers.max(1))) {
            for (b, sum) in frame.iter().zip(row) {
                *sum += a.dot(*b);
            }
        }
    }
    gram
}
