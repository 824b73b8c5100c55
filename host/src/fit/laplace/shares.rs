//! Which markers rule where: their shares in the rotation of each vertex.

use super::LaplaceError;
use super::cholesky::Cholesky;
use super::operator::Laplacian;

/// The system of rotations: `L` with the markers fixed. Rotations are conducted well at markers,
/// worst half-way between them; how well follows from `pull`, which falls off as [`rule`]. O(fill)
///
/// # Errors
/// As [`Cholesky::new`].
pub(crate) fn rotation_system(
    laplacian: &Laplacian,
    pull: &[f64],
    markers: &[u32],
    order: Option<&[u32]>,
) -> Result<Cholesky, LaplaceError> {
    /// For a system that 32-bit numbers solve.
    const LEAST: f64 = 1e-5;
    let size = laplacian.size();
    let mut marked = vec![false; size];
    markers.iter().for_each(|&v| marked[v as usize] = true);
    let held = |vertex: usize| pull[vertex] / laplacian.mass[vertex];
    let at_marker = markers.first().map_or(0.0, |&marker| held(marker as usize));
    let conduction: Vec<f64> = if at_marker > 0.0 {
        (0..size)
            .map(|vertex| (held(vertex) / at_marker).powi(6).max(LEAST))
            .collect()
    } else {
        vec![1.0; size]
    };
    Cholesky::new(size, &laplacian.conducting(&marked, &conduction), order)
}

/// How much a vertex belongs to one side: `sum_kl h_k h_l (1 - d_kl / (d_k + d_l))` over its
/// strongest markers, with shares `h` and distances along the surface. 1 at a marker, and less the
/// more the vertex lies between markers; several markers on one side count as one. `[vertices]`
pub(super) fn rule(weights: &[Vec<f64>], distances: &[Vec<f32>], markers: &[u32]) -> Vec<f64> {
    /// Markers that count.
    const STRONGEST: usize = 8;
    let near = |vertex: usize| -> Vec<(f64, usize)> {
        let shares = weights.iter().map(|row| row[vertex].max(0.0));
        let mut shares: Vec<(f64, usize)> = shares.zip(0..).collect();
        shares.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        shares.truncate(STRONGEST);
        shares
    };
    let rule = |vertex: usize| {
        let near = near(vertex);
        let total: f64 = near.iter().map(|near| near.0).sum();
        let mut sum = 0.0;
        for &(share, marker) in &near {
            for &(other_share, other) in &near {
                let way = distances[marker][vertex] + distances[other][vertex];
                let apart = distances[marker][markers[other] as usize];
                let alike = if way > 0.0 && marker != other {
                    f64::from(1.0 - apart / way).max(0.0)
                } else {
                    1.0
                };
                sum += share * other_share * alike;
            }
        }
        (sum / (total * total).max(1e-18)).clamp(0.0, 1.0)
    };
    let count = weights.first().map_or(0, Vec::len);
    (0..count).map(rule).collect()
}

/// The four markers with the largest share in a vertex, by the squares of their shares.
pub(super) fn guide(weights: &[Vec<f64>], vertex: usize) -> ([u16; 4], [f64; 4]) {
    let mut heaviest: Vec<(f64, u16)> = weights
        .iter()
        .zip(0_u16..)
        .map(|(weights, marker)| (weights[vertex].max(0.0), marker))
        .collect();
    heaviest.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let at = |k: usize| heaviest.get(k).copied().unwrap_or_default();
    let squares = [0, 1, 2, 3].map(|k| at(k).0 * at(k).0);
    let sum: f64 = squares.iter().sum();
    (
        [0, 1, 2, 3].map(|k| at(k).1),
        squares.map(|square| square / sum.max(1e-18)),
    )
}

/// `L h_k = 0` with one at marker k and zero at the others (Zayer et al. 2005).
pub(super) fn harmonic_weights(
    laplacian: &Laplacian,
    harmonic: &Cholesky,
    markers: &[u32],
) -> Vec<Vec<f64>> {
    let mut columns = vec![0.0; markers.len() * laplacian.size()];
    for (column, &vertex) in columns.chunks_mut(laplacian.size()).zip(markers) {
        for (neighbour, weight) in laplacian.row(vertex as usize) {
            column[neighbour] = Laplacian::conducts(weight);
        }
        for &other in markers {
            column[other as usize] = 0.0;
        }
        column[vertex as usize] = 1.0;
    }
    harmonic.solve(&mut columns);
    columns
        .chunks(laplacian.size())
        .map(<[f64]>::to_vec)
        .collect()
}
