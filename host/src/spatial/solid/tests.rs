use glam::DVec3;

use super::Solid;
use crate::spatial::face_outward;

/// A box between two corners, facing outward.
fn block(low: DVec3, high: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let corner = |at: u32| {
        let pick = |axis: usize| {
            if at >> axis & 1 == 0 {
                low[axis]
            } else {
                high[axis]
            }
        };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    ((0..8).map(corner).collect(), triangles.collect())
}

fn join(parts: &[(Vec<DVec3>, Vec<[u32; 3]>)]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for (at, of) in parts {
        let first = positions.len() as u32;
        positions.extend(at);
        triangles.extend(of.iter().map(|corners| corners.map(|v| v + first)));
    }
    (positions, triangles)
}

#[test]
fn a_box_has_its_volume_and_straight_ways() {
    let (positions, triangles) = block(DVec3::ZERO, DVec3::new(1.0, 0.5, 0.25));
    let solid = Solid::new(&positions, &triangles, 40);
    let volume = solid.len() as f64 * solid.size().powi(3);
    assert!((volume - 0.125).abs() < 0.015, "{volume}");
    let (from, _) = solid.nearest(DVec3::new(0.1, 0.1, 0.1), 2).expect("inside");
    let (distances, marks) = solid.march(&[(from, 0.0, 7)]);
    assert!(marks.iter().all(|&mark| mark == 7));
    for (cell, &found) in distances.iter().enumerate() {
        let straight = solid.centre(cell as u32).distance(solid.centre(from));
        assert!(
            (f64::from(found) - straight).abs() < 1.5 * solid.size(),
            "{found} {straight}"
        );
    }
    let depth = solid.depth().into_iter().fold(0.0, f32::max);
    assert!((depth - 0.125).abs() < 0.03, "{depth}");
}

#[test]
fn a_hole_does_not_empty_the_rest() {
    let (positions, mut triangles) = block(DVec3::ZERO, DVec3::ONE);
    let whole = Solid::new(&positions, &triangles, 20).len();
    triangles.retain(|corners| corners.iter().any(|&v| positions[v as usize].y < 0.5));
    let open = Solid::new(&positions, &triangles, 20);
    assert_eq!(open.len(), whole);
    assert!(!open.contains(DVec3::new(0.5, 1.3, 0.5)));
}

#[test]
fn a_gap_thinner_than_a_cell_keeps_parts_apart() {
    let left = block(DVec3::ZERO, DVec3::ONE);
    let right = block(DVec3::new(1.002, 0.0, 0.0), DVec3::new(2.0, 1.0, 1.0));
    let (positions, triangles) = join(&[left, right]);
    let solid = Solid::new(&positions, &triangles, 40);
    let (from, _) = solid.nearest(DVec3::splat(0.5), 2).expect("inside");
    let (distances, _) = solid.march(&[(from, 0.0, 0)]);
    for (cell, distance) in distances.iter().enumerate() {
        let is_left = solid.centre(cell as u32).x < 1.001;
        assert_eq!(distance.is_finite(), is_left);
    }
}

#[test]
fn what_lies_inside_another_part_is_no_wall() {
    let outer = block(DVec3::ZERO, DVec3::ONE);
    let inner = block(DVec3::splat(0.3), DVec3::splat(0.6));
    let (positions, triangles) = join(&[outer, inner]);
    let solid = Solid::new(&positions, &triangles, 30);
    let (from, _) = solid.nearest(DVec3::splat(0.9), 2).expect("inside");
    let (distances, _) = solid.march(&[(from, 0.0, 0)]);
    assert!(distances.iter().all(|distance| distance.is_finite()));
}

#[test]
fn triangles_are_turned_to_face_outward() {
    let (positions, triangles) = block(DVec3::ZERO, DVec3::ONE);
    let vertex_of: Vec<u32> = (0..8).collect();
    let mut mixed = triangles.clone();
    for at in [1, 4, 5, 9] {
        mixed[at].swap(0, 1);
    }
    let turned = face_outward(&positions, &mixed, &vertex_of);
    let same =
        |a: &[u32; 3], b: &[u32; 3]| (0..3).any(|k| [b[k], b[(k + 1) % 3], b[(k + 2) % 3]] == *a);
    assert!(triangles.iter().zip(&turned).all(|(a, b)| same(a, b)));
    let inverted: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let turned = face_outward(&positions, &inverted, &vertex_of);
    assert!(triangles.iter().zip(&turned).all(|(a, b)| same(a, b)));
}

#[test]
fn nothing_is_inside_nothing() {
    assert!(Solid::new(&[], &[], 64).is_empty());
    let flat = [DVec3::ZERO, DVec3::X, DVec3::Y];
    assert!(Solid::new(&flat, &[[0, 1, 2]], 64).is_empty());
    let point = [DVec3::ONE; 3];
    assert!(Solid::new(&point, &[[0, 1, 2]], 64).is_empty());
}
