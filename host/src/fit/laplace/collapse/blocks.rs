//! Which vertices share a block, and which handles move it.

use glam::DVec3;
use sinew_core::asset::LANES;

/// Vertices in an order whose blocks of eight are small patches: grouped by their nearest handle,
/// then halved across the longest side until a block is left. O(vertices (handles + log^2))
pub(super) fn order(positions: &[DVec3], distances: &[Vec<f32>]) -> Vec<u32> {
    let mut groups = vec![Vec::new(); distances.len().max(1)];
    for vertex in 0..positions.len() {
        let nearest = (0..distances.len())
            .min_by(|&a, &b| distances[a][vertex].total_cmp(&distances[b][vertex]));
        groups[nearest.unwrap_or(0)].push(vertex as u32);
    }
    for group in &mut groups {
        let mut open = vec![&mut group[..]];
        while let Some(part) = open.pop() {
            if part.len() <= LANES {
                continue;
            }
            let places = || part.iter().map(|&v| positions[v as usize]);
            let size = places().fold(DVec3::NEG_INFINITY, DVec3::max)
                - places().fold(DVec3::INFINITY, DVec3::min);
            let axis = size.max_position();
            let key = |&v: &u32| positions[v as usize][axis];
            part.sort_by(|a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
            let middle = (part.len() / LANES).div_ceil(2) * LANES;
            let (low, high) = part.split_at_mut(middle);
            open.extend([low, high]);
        }
    }
    groups.concat()
}

/// The `count` handles nearest to some vertices, ascending by index; fewer where there are not as
/// many, and none of another component unless all are.
pub(super) fn nearest(vertices: &[u32], distances: &[Vec<f32>], count: usize) -> Vec<usize> {
    // The distance to the nearest vertex, lest a block that spans two parts loses one of them.
    let distance = |handle: usize| {
        let to = vertices.iter().map(|&v| distances[handle][v as usize]);
        let near = to.clone().fold(f32::INFINITY, f32::min);
        let mean = to.filter(|d| d.is_finite()).sum::<f32>() / vertices.len() as f32;
        near + mean
    };
    let mut handles: Vec<(f32, usize)> = (0..distances.len()).map(|h| (distance(h), h)).collect();
    handles.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    handles.truncate(count.max(1));
    let mut handles: Vec<usize> = handles.into_iter().map(|(_, handle)| handle).collect();
    handles.sort_unstable();
    handles
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
