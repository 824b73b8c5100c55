//! Triangles turned to face outward.

use glam::DVec3;

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
