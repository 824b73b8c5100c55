use glam::DAffine3;

use super::*;

fn quad() -> RawMesh {
    RawMesh {
        name: "quad".into(),
        positions: vec![
            DVec3::ZERO,
            DVec3::new(1.0, 0.0, 0.0),
            DVec3::new(1.0, 1.0, 0.0),
            DVec3::new(0.12, 0.91, 0.0),
        ],
        primitives: vec![RawPrimitive {
            name: "front".into(),
            corners: vec![0, 1, 2, 3],
            polygon_sizes: vec![4],
        }],
        ..RawMesh::default()
    }
}

fn skin(influences: Vec<Vec<(u32, f64)>>) -> RawSkin {
    RawSkin {
        joints: vec![0, 1],
        inverse_bind: vec![DAffine3::IDENTITY; 2],
        influences,
    }
}

fn check_weights(influences: Vec<Vec<(u32, f64)>>) -> (Result<Skin, ImportError>, Vec<Notice>) {
    let mesh = check(quad(), "x", &mut Vec::new()).unwrap();
    let mut notices = Vec::new();
    let result = check_skin(skin(influences), &mesh, &[0, 1], "x", &mut notices);
    (result, notices)
}

#[test]
fn a_quad_is_split_along_its_shorter_diagonal_and_gets_normals() {
    let mut notices = Vec::new();
    let mesh = check(quad(), "x", &mut notices).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 3], [1, 2, 3]]);
    assert_eq!(mesh.parts[0].triangles, 0..2);
    assert!(
        mesh.normals
            .iter()
            .all(|n| (*n - DVec3::Z).length() < 1e-12)
    );
    assert_eq!(notices.len(), 1);
}

#[test]
fn bad_meshes_are_refused() {
    let mut raw = quad();
    raw.positions[2].x = f64::NAN;
    assert!(matches!(
        check(raw, "x", &mut Vec::new()).unwrap_err().kind,
        ImportErrorKind::NotFinite { .. }
    ));
    let mut raw = quad();
    raw.primitives[0].corners[0] = 9;
    assert!(matches!(
        check(raw, "x", &mut Vec::new()).unwrap_err().kind,
        ImportErrorKind::BadIndex { .. }
    ));
    for sizes in [vec![5], vec![2, 2], vec![3]] {
        let mut raw = quad();
        raw.primitives[0].polygon_sizes = sizes;
        assert!(matches!(
            check(raw, "x", &mut Vec::new()).unwrap_err().kind,
            ImportErrorKind::Contradiction { .. }
        ));
    }
}

#[test]
fn weights_are_merged_sorted_and_normalised() {
    let rows = vec![
        vec![(0, 0.5), (1, 1.0), (0, 0.5)],
        vec![(1, 1.0)],
        vec![(0, 3.0), (9, 0.0)],
        vec![(0, 1.0)],
    ];
    let (result, notices) = check_weights(rows);
    let skin = result.unwrap();
    assert_eq!(skin.influences[0], [(0, 0.5), (1, 0.5)]);
    assert_eq!(skin.influences[2], [(0, 1.0)]);
    assert_eq!(notices.len(), 1);
    assert!(notices[0].text.contains("worst 3.0000"), "{notices:?}");
}

#[test]
fn a_vertex_without_weights_takes_those_of_the_nearest() {
    // Vertex 3 lies 0.89 from vertex 2, 0.92 from vertex 0 and 1.19 from vertex 1.
    let (result, notices) =
        check_weights(vec![vec![(0, 1.0)], vec![(0, 1.0)], vec![(1, 1.0)], vec![]]);
    assert_eq!(result.unwrap().influences[3], [(1, 1.0)]);
    assert!(notices.iter().any(|n| n.text.contains("no weight")));
    let (result, _) = check_weights(vec![vec![]; 4]);
    assert!(matches!(
        result.unwrap_err().kind,
        ImportErrorKind::Missing { .. }
    ));
}

#[test]
fn bad_weights_are_refused() {
    for bad in [(0, f64::NAN), (0, -0.5), (7, 1.0)] {
        let (result, _) = check_weights(vec![vec![bad]; 4]);
        assert!(result.is_err(), "{bad:?}");
    }
    let (result, _) = check_weights(vec![vec![(0, 1.0)]; 3]);
    assert!(matches!(
        result.unwrap_err().kind,
        ImportErrorKind::Contradiction { .. }
    ));
}
