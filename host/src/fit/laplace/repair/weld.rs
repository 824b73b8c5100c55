//! Vertices at the same place become one.

use std::collections::HashMap;

use glam::DVec3;

/// What each vertex is welded to: itself, or an earlier one.
pub(super) fn weld(positions: &[DVec3], distance: f64) -> Vec<u32> {
    let cell_size = if distance > 0.0 { distance } else { 1.0 };
    // Exact welding hashes bits; the other looks into the 27 cells around.
    let exact = |p: DVec3| {
        (p + DVec3::ZERO)
            .to_array()
            .map(f64::to_bits)
            .map(|b| b as i64)
    };
    let cell = |p: DVec3| (p / cell_size).floor().to_array().map(|x| x as i64);
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut welded = Vec::with_capacity(positions.len());
    for (at, &position) in (0_u32..).zip(positions) {
        let mut target = at;
        if distance > 0.0 && position.is_finite() {
            let [x, y, z] = cell(position);
            let around = (-1..=1)
                .flat_map(move |i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [i, j, k])));
            for [i, j, k] in around {
                let near = cells.get(&[
                    x.saturating_add(i),
                    y.saturating_add(j),
                    z.saturating_add(k),
                ]);
                let near = near.into_iter().flatten();
                let found = near
                    .filter(|&&v| positions[v as usize].distance(position) <= distance)
                    .min();
                target = found.map_or(target, |&v| v.min(target));
            }
            if target == at {
                cells.entry([x, y, z]).or_default().push(at);
            }
        } else if distance <= 0.0 {
            let same = cells.entry(exact(position)).or_default();
            match same.first() {
                Some(&first) => target = first,
                None => same.push(at),
            }
        }
        welded.push(target);
    }
    welded
}
