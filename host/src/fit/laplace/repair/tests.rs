//! Each fault made on purpose.

use super::*;

fn places(xy: &[(f64, f64)]) -> Vec<DVec3> {
    xy.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect()
}

#[test]
fn each_fault_is_repaired_and_counted() {
    // A square whose second triangle has corners of its own; a stray vertex; dust.
    let mut positions = places(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]);
    positions.extend(places(&[(0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (9.0, 9.0)]));
    positions.extend(places(&[(5.0, 5.0), (5.1, 5.0), (5.0, 5.1)]));
    let triangles = [
        [0, 1, 2],
        [3, 4, 5],
        [0, 3, 1], // a corner twice once welded
        [2, 1, 0], // stands there already, turned over
        [7, 8, 9],
    ];
    let options = RepairOptions {
        smallest_component: 4,
        ..RepairOptions::default()
    };
    let repaired = repair(&positions, &triangles, &options).expect("repairs");
    assert_eq!(repaired.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(repaired.source_of, [0, 1, 2, 5]);
    assert_eq!(repaired.vertex_of[3], Some(0));
    assert_eq!(repaired.vertex_of[6], None);
    let report = &repaired.report;
    assert_eq!((report.welded, report.unreferenced), (2, 1));
    assert_eq!(
        (report.collapsed_triangles, report.duplicate_triangles),
        (1, 1)
    );
    assert_eq!((report.dust, report.holes), ((1, 3), 1));
    assert_eq!(report.components.len(), 1);
    assert_eq!(report.lines().len(), 7);
}

#[test]
fn a_third_triangle_on_an_edge_is_removed() {
    let mut positions = places(&[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]);
    positions.push(DVec3::Z);
    let triangles = [[0, 1, 2], [1, 0, 3], [0, 1, 4]];
    let repaired = repair(&positions, &triangles, &RepairOptions::default()).expect("repairs");
    assert_eq!(repaired.triangles.len(), 2);
    assert_eq!(repaired.report.non_manifold_triangles, 1);
    assert_eq!(repaired.report.unreferenced, 1);
}

#[test]
fn welding_by_distance_reaches_across_cells() {
    let positions = places(&[(0.0999, 0.0), (0.1001, 0.0), (0.5, 0.0), (0.0, 0.5)]);
    let triangles = [[0, 2, 3], [1, 2, 3]];
    let options = RepairOptions {
        weld_distance: 0.1,
        ..RepairOptions::default()
    };
    let repaired = repair(&positions, &triangles, &options).expect("repairs");
    assert_eq!((repaired.report.welded, repaired.triangles.len()), (1, 1));
}

#[test]
fn what_cannot_be_repaired_is_refused() {
    let positions = places(&[(0.0, 0.0), (1.0, 0.0), (f64::NAN, 0.0)]);
    let refused = |positions: &[DVec3], triangles: &[[u32; 3]]| {
        repair(positions, triangles, &RepairOptions::default()).expect_err("refused")
    };
    assert!(matches!(refused(&[], &[]), LaplaceError::NoSurface));
    let bad = refused(&positions, &[[0, 1, 7]]);
    assert!(matches!(bad, LaplaceError::BadTriangle { vertex: 7, .. }));
    let bad = refused(&positions, &[[0, 1, 2]]);
    assert!(matches!(bad, LaplaceError::BadPosition { vertex: 2, .. }));
    let flat = refused(&positions, &[[0, 1, 1]]);
    assert!(matches!(flat, LaplaceError::NoSurface));
}

#[test]
fn a_component_without_marker_follows_its_nearest_neighbour() {
    let mut positions = places(&[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]);
    positions.extend(places(&[(1.2, 0.0), (1.4, 0.0), (1.2, 0.2)]));
    let ties = attachments(&positions, &[[0, 1, 2], [3, 4, 5]], &[0, 1]);
    assert_eq!(ties, [(3, 1)]);
}
