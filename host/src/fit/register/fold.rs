//! Triangles that a deformation turned inside out.

use glam::DVec3;

use crate::fit::laplace::rotations::fit_rotation;

/// Triangles whose normal points away from where the turn of their surroundings (all triangles that
/// share a corner) brings it. Triangles without area before are not judged. O(triangles)
#[must_use]
pub fn folded(before: &[DVec3], after: &[DVec3], triangles: &[[u32; 3]]) -> Vec<usize> {
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); before.len()];
    for (at, triangle) in triangles.iter().enumerate() {
        triangle
            .iter()
            .for_each(|&corner| around[corner as usize].push(at as u32));
    }
    let normal = |positions: &[DVec3], triangle: [u32; 3]| {
        let [a, b, c] = triangle.map(|at| positions[at as usize]);
        (b - a).cross(c - a)
    };
    let mut found = Vec::new();
    for (at, &triangle) in triangles.iter().enumerate() {
        let (was, is) = (normal(before, triangle), normal(after, triangle));
        let longest = [(0, 1), (1, 2), (2, 0)]
            .map(|(a, b)| {
                before[triangle[a] as usize].distance_squared(before[triangle[b] as usize])
            })
            .into_iter()
            .fold(0.0, f64::max);
        if was.length() <= 1e-6 * longest {
            continue;
        }
        let patch = triangle.iter().flat_map(|&corner| &around[corner as usize]);
        let edges = patch.flat_map(|&near| {
            let [a, b, c] = triangles[near as usize].map(|at| at as usize);
            [(a, b), (b, c), (c, a)].map(|(a, b)| (before[b] - before[a], after[b] - after[a], 1.0))
        });
        let turn = fit_rotation(edges);
        if (turn * was).dot(is) <= 0.0 {
            found.push(at);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn a_turned_fan_is_whole_and_a_corner_pushed_across_its_edge_is_not() {
        // A hexagon around vertex 0.
        let mut before = vec![DVec3::ZERO];
        before.extend((0..6).map(|at| {
            DQuat::from_rotation_z(f64::from(at) * std::f64::consts::FRAC_PI_3) * DVec3::X
        }));
        let triangles: Vec<[u32; 3]> = (0..6).map(|at| [0, 1 + at, 1 + (at + 1) % 6]).collect();
        let turned: Vec<DVec3> = before
            .iter()
            .map(|p| DQuat::from_rotation_x(2.5) * *p)
            .collect();
        assert!(folded(&before, &turned, &triangles).is_empty());
        let mut pushed = turned.clone();
        pushed[0] = 1.5 * turned[1];
        assert_eq!(folded(&before, &pushed, &triangles), [0, 5]);
    }
}
