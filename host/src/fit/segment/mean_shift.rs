//! Patches that turn alike, by mean shift (Comaniciu & Meer 2002; James & Twigg 2005, section 3).

/// Rounds at most.
const ROUNDS: usize = 60;
/// Components that are kept of all turns.
const DIMENSIONS: usize = 24;
/// Rounds of finding them.
const SUBSPACE_ROUNDS: usize = 6;

/// Clusters of weighted points `[points][dimensions]`: `[points]` cluster of each, numbered from
/// the heaviest on. Points within `bandwidth` count alike (Epanechnikov's kernel).
/// O(rounds points^2)
pub(super) fn mean_shift(points: &[Vec<f64>], weights: &[f64], bandwidth: f64) -> Vec<u32> {
    let squared = bandwidth * bandwidth;
    let mut modes: Vec<Vec<f64>> = points.to_vec();
    let mut still = vec![false; points.len()];
    for _ in 0..ROUNDS {
        let mut moved = false;
        for (mode, still) in modes.iter_mut().zip(&mut still) {
            if *still {
                continue;
            }
            let mut sum = vec![0.0; mode.len()];
            let mut total = 0.0;
            for (point, &weight) in points.iter().zip(weights) {
                if distance_squared(point, mode, squared) < squared {
                    total += weight;
                    sum.iter_mut()
                        .zip(point)
                        .for_each(|(sum, x)| *sum += weight * x);
                }
            }
            if total <= 0.0 {
                *still = true;
                continue;
            }
            sum.iter_mut().for_each(|x| *x /= total);
            *still = distance_squared(&sum, mode, squared) < 1e-6 * squared;
            moved |= !*still;
            *mode = sum;
        }
        if !moved {
            break;
        }
    }
    // Modes within half a bandwidth are one.
    let mut centres: Vec<(Vec<f64>, f64)> = Vec::new();
    let mut cluster = Vec::with_capacity(points.len());
    for (mode, &weight) in modes.iter().zip(weights) {
        let near = centres
            .iter()
            .position(|(centre, _)| distance_squared(centre, mode, squared) < squared / 4.0);
        let at = near.unwrap_or(centres.len());
        if near.is_none() {
            centres.push((mode.clone(), 0.0));
        }
        centres[at].1 += weight;
        cluster.push(at);
    }
    let mut rank: Vec<usize> = (0..centres.len()).collect();
    rank.sort_by(|&a, &b| centres[b].1.total_cmp(&centres[a].1));
    let mut place = vec![0; rank.len()];
    for (at, &centre) in rank.iter().enumerate() {
        place[centre] = at as u32;
    }
    cluster.into_iter().map(|at| place[at]).collect()
}

/// Stops counting beyond `enough`.
fn distance_squared(a: &[f64], b: &[f64], enough: f64) -> f64 {
    let mut sum = 0.0;
    for (a, b) in a.chunks(8).zip(b.chunks(8)) {
        sum += a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        if sum > enough {
            break;
        }
    }
    sum
}

/// Points in the few directions in which they differ most, by subspace iteration; distances hardly
/// change, and are never longer. O(points dimensions)
pub(super) fn reduce(points: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let width = points.first().map_or(0, Vec::len);
    if width <= DIMENSIONS || points.is_empty() {
        return points.to_vec();
    }
    let mut mean = vec![0.0; width];
    for point in points {
        mean.iter_mut()
            .zip(point)
            .for_each(|(mean, x)| *mean += x / points.len() as f64);
    }
    let centred: Vec<Vec<f64>> = points
        .iter()
        .map(|point| point.iter().zip(&mean).map(|(x, mean)| x - mean).collect())
        .collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // Begins with points spread over the list: they span what there is to span.
    let mut basis: Vec<Vec<f64>> = (0..DIMENSIONS)
        .map(|at| centred[at * centred.len() / DIMENSIONS].clone())
        .collect();
    for _ in 0..SUBSPACE_ROUNDS {
        orthonormalise(&mut basis);
        let mut next = vec![vec![0.0; width]; DIMENSIONS];
        for point in &centred {
            for (axis, next) in basis.iter().zip(&mut next) {
                let along = dot(point, axis);
                next.iter_mut()
                    .zip(point)
                    .for_each(|(sum, x)| *sum += along * x);
            }
        }
        basis = next;
    }
    orthonormalise(&mut basis);
    let project = |point: &Vec<f64>| basis.iter().map(|axis| dot(point, axis)).collect();
    centred.iter().map(project).collect()
}

/// Gram and Schmidt; directions that are none become zero.
fn orthonormalise(basis: &mut [Vec<f64>]) {
    for at in 0..basis.len() {
        let (before, rest) = basis.split_at_mut(at);
        let axis = &mut rest[0];
        let first: f64 = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        for other in before.iter() {
            let along: f64 = axis.iter().zip(other).map(|(a, b)| a * b).sum();
            axis.iter_mut()
                .zip(other)
                .for_each(|(a, b)| *a -= along * b);
        }
        let length: f64 = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        let factor = if length > 1e-9 * first {
            1.0 / length
        } else {
            0.0
        };
        axis.iter_mut().for_each(|x| *x *= factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_heaps_are_two_clusters_and_the_heavier_is_first() {
        let points: Vec<Vec<f64>> = (0..30)
            .map(|at| {
                let heap = if at % 3 == 0 { 5.0 } else { 0.0 };
                vec![
                    heap + 0.1 * f64::from(at % 7),
                    heap - 0.05 * f64::from(at % 5),
                ]
            })
            .collect();
        let found = mean_shift(&points, &[1.0; 30], 1.5);
        for (at, cluster) in found.iter().enumerate() {
            assert_eq!(*cluster, u32::from(at % 3 == 0));
        }
    }

    #[test]
    fn reduction_keeps_distances_of_points_in_a_subspace() {
        let points: Vec<Vec<f64>> = (0..40)
            .map(|at| {
                let (a, b) = (f64::from(at % 8), f64::from(at / 8));
                (0..50)
                    .map(|k| a * f64::from(k % 3) - b * f64::from(k % 7))
                    .collect()
            })
            .collect();
        let reduced = reduce(&points);
        assert_eq!(reduced[0].len(), DIMENSIONS);
        let far = |points: &[Vec<f64>], a: usize, b: usize| {
            distance_squared(&points[a], &points[b], f64::INFINITY).sqrt()
        };
        for at in 1..40 {
            assert!((far(&points, 0, at) - far(&reduced, 0, at)).abs() < 1e-9);
        }
    }
}
