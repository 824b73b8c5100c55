//! Which vertices share a block, and which handles move it.

use sinew_core::asset::LANES;

/// Vertices in an order whose blocks of eight are small patches of the surface: halved, again and
/// again, by their distance from the marker whose distances differ most, so that places which are
/// near in space only (two thighs, hand and hip) part early.
/// O(vertices log vertices (markers + log vertices))
pub(crate) fn order(markers: &[Vec<f32>]) -> Vec<u32> {
    /// Stands for the distance to another component; farther than any body is long.
    const APART: f32 = 1e3;
    let count = markers.first().map_or(0, Vec::len);
    let mut order: Vec<u32> = (0..count as u32).collect();
    let mut open = vec![&mut order[..]];
    while let Some(part) = open.pop() {
        if part.len() <= LANES {
            continue;
        }
        let distance = |marker: &[f32], vertex: u32| marker[vertex as usize].min(APART);
        let spread = |marker: &Vec<f32>| {
            let all = || part.iter().map(|&vertex| distance(marker, vertex));
            all().fold(f32::NEG_INFINITY, f32::max) - all().fold(f32::INFINITY, f32::min)
        };
        let widest = markers
            .iter()
            .max_by(|a, b| spread(a).total_cmp(&spread(b)));
        let Some(widest) = widest else { break };
        part.sort_by(|&a, &b| {
            let by_distance = distance(widest, a).total_cmp(&distance(widest, b));
            by_distance.then(a.cmp(&b))
        });
        let middle = (part.len() / LANES).div_ceil(2) * LANES;
        let (low, high) = part.split_at_mut(middle);
        open.extend([low, high]);
    }
    order
}

/// Up to `count` handles for a block, ascending by index: first those that are nearest to one of
/// its vertices, then those that are second nearest, and so on.
pub(super) fn nearest(vertices: &[u32], distances: &[Vec<f32>], count: usize) -> Vec<usize> {
    let count = count.clamp(1, distances.len().max(1));
    // Best rank and sum of distances of each handle.
    let mut scores = vec![(usize::MAX, 0.0_f32); distances.len()];
    let mut ranked: Vec<usize> = (0..distances.len()).collect();
    for &vertex in vertices {
        let distance = |handle: usize| distances[handle][vertex as usize];
        ranked.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)).then(a.cmp(&b)));
        for (rank, &handle) in ranked.iter().enumerate() {
            let (best, sum) = &mut scores[handle];
            *best = rank.min(*best);
            *sum += distance(handle);
        }
    }
    ranked.sort_by(|&a, &b| {
        let (a_score, b_score) = (scores[a], scores[b]);
        let by_rank = a_score.0.cmp(&b_score.0);
        by_rank
            .then(a_score.1.total_cmp(&b_score.1))
            .then(a.cmp(&b))
    });
    ranked.truncate(count);
    ranked.sort_unstable();
    ranked
}

/// Weights of blended rigid motion: inverse squares of distances, summing to one.
pub(super) fn weights(vertex: u32, handles: &[usize], distances: &[Vec<f32>]) -> Vec<f64> {
    const NEAREST: f64 = 1e-3;
    let weight = |&handle: &usize| {
        let distance = f64::from(distances[handle][vertex as usize]).max(NEAREST);
        1.0 / (distance * distance)
    };
    let weights: Vec<f64> = handles.iter().map(weight).collect();
    let sum: f64 = weights.iter().sum();
    let even = 1.0 / handles.len().max(1) as f64;
    let share = |weight: f64| if sum > 0.0 { weight / sum } else { even };
    weights.into_iter().map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_patches_and_never_short_before_the_last() {
        // A line of 20 vertices with a marker at each end, and 3 vertices apart from it.
        let one: Vec<f32> = (0..20)
            .map(|v| v as f32)
            .chain([f32::INFINITY; 3])
            .collect();
        let other: Vec<f32> = (0..20)
            .map(|v| 19.0 - v as f32)
            .chain([f32::INFINITY; 3])
            .collect();
        let order = order(&[one, other]);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..23).collect::<Vec<u32>>());
        for block in order
            .chunks(LANES)
            .filter(|block| block.iter().all(|&v| v < 20))
        {
            let (low, high) = (block.iter().min(), block.iter().max());
            assert!(high.unwrap() - low.unwrap() < 8, "{order:?}");
        }
    }

    #[test]
    fn every_vertex_of_a_block_gets_its_nearest_handle() {
        let distances = [
            vec![0.0, 9.0],
            vec![1.0, 8.0],
            vec![2.0, 7.0],
            vec![9.0, 0.5],
        ];
        assert_eq!(nearest(&[0, 1], &distances, 2), [0, 3]);
        assert_eq!(nearest(&[0], &distances, 2), [0, 1]);
        assert_eq!(nearest(&[0], &distances, 9), [0, 1, 2, 3]);
    }

    #[test]
    fn weights_sum_to_one_even_where_nothing_is_near() {
        let distances = [vec![1.0], vec![2.0], vec![f32::INFINITY]];
        let found = weights(0, &[0, 1, 2], &distances);
        assert!((found[0] - 0.8).abs() < 1e-12 && found[2] == 0.0);
        assert_eq!(weights(0, &[2], &distances), [1.0]);
    }
}
