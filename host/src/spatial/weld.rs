//! Vertices that stand in one place.

use std::collections::HashMap;

use glam::DVec3;

/// `[vertices]`: the first vertex at exactly the same position. O(vertices)
#[must_use]
pub fn weld(positions: &[DVec3]) -> Vec<u32> {
    let mut first: HashMap<[u64; 3], u32> = HashMap::with_capacity(positions.len());
    let key = |position: &DVec3| position.to_array().map(|c| (c + 0.0).to_bits());
    let places = positions.iter().enumerate();
    places
        .map(|(vertex, at)| *first.entry(key(at)).or_insert(vertex as u32))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_vertex_in_a_place_stands_for_all() {
        let at = [
            DVec3::ZERO,
            DVec3::X,
            DVec3::new(-0.0, 0.0, 0.0),
            DVec3::X,
            DVec3::Y,
        ];
        assert_eq!(weld(&at), [0, 1, 0, 1, 4]);
    }
}
