use glam::{DAffine3, DVec3};

use super::*;
use crate::import::Transform;
use crate::model::{Bind, Joint, Skeleton};

/// A flat grid in two parts that hang on one joint, `side` vertices wide.
fn sheet(side: u32) -> Avatar {
    let (mut positions, mut texcoords, mut triangles) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..side {
        for column in 0..side {
            positions.push(DVec3::new(f64::from(column), 0.0, f64::from(row)));
            texcoords.push([f64::from(column), f64::from(row)]);
        }
    }
    let square = |row: u32, column: u32| {
        let a = row * side + column;
        [[a, a + side, a + 1], [a + 1, a + side, a + side + 1]]
    };
    for row in 0..side - 1 {
        triangles.extend((0..side - 1).flat_map(|column| square(row, column)));
    }
    let half = triangles.len() / 2;
    let part = |name: &str, triangles| Part {
        name: name.into(),
        triangles,
    };
    let count = positions.len();
    Avatar {
        mesh: Mesh {
            name: "sheet".into(),
            normals: vec![DVec3::Y; count],
            tangents: None,
            texcoords: Some(texcoords),
            parts: vec![part("a", 0..half), part("b", half..triangles.len())],
            triangles,
            morphs: Vec::new(),
            positions,
        },
        skeleton: Skeleton {
            joints: vec![Joint {
                name: "root".into(),
                parent: None,
                rest: Transform::IDENTITY,
            }],
        },
        skin: Skin {
            binds: vec![Bind {
                joint: 0,
                inverse_bind: DAffine3::IDENTITY,
            }],
            influences: vec![vec![(0, 1.0)]; count],
        },
        clips: Vec::new(),
    }
}

fn area(mesh: &Mesh, part: usize) -> f64 {
    let of = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|vertex| mesh.positions[vertex as usize]);
        (b - a).cross(c - a).y / 2.0
    };
    mesh.triangles[mesh.parts[part].triangles.clone()]
        .iter()
        .map(of)
        .sum()
}

#[test]
fn a_flat_sheet_keeps_its_outline_and_its_parts() {
    let coarse = simplify(&sheet(9), 6);
    // Four corners and the two ends of the border between the parts.
    assert_eq!(coarse.mesh.positions.len(), 6);
    assert!(coarse.error < 1e-6, "{}", coarse.error);
    for part in 0..2 {
        assert!((area(&coarse.mesh, part) - 32.0).abs() < 1e-9);
    }
    for (vertex, position) in coarse.mesh.positions.iter().enumerate() {
        let texcoord = coarse.mesh.texcoords.as_ref().unwrap()[vertex];
        assert_eq!(texcoord, [position.x, position.z]);
    }
}

#[test]
fn a_seam_stays_closed() {
    // Vertices of the middle column once more, with other texture coordinates to their right.
    let mut body = sheet(9);
    let doubled: Vec<u32> = (0..9).map(|row| 9 * row + 4).collect();
    let mesh = &mut body.mesh;
    for &vertex in &doubled {
        mesh.positions.push(mesh.positions[vertex as usize]);
        mesh.normals.push(DVec3::Y);
        mesh.texcoords.as_mut().unwrap().push([100.0, 0.0]);
        body.skin.influences.push(vec![(0, 1.0)]);
    }
    let is_right = |corners: &[u32; 3], mesh: &Mesh| {
        corners
            .iter()
            .map(|&c| mesh.positions[c as usize].x)
            .sum::<f64>()
            > 12.0
    };
    let positions = mesh.clone();
    for corners in &mut mesh.triangles {
        if is_right(corners, &positions) {
            for corner in corners {
                if let Some(row) = doubled.iter().position(|other| other == corner) {
                    *corner = 81 + row as u32;
                }
            }
        }
    }
    let coarse = simplify(&body, 12);
    assert_eq!(coarse.mesh.positions.len(), 12);
    let total = area(&coarse.mesh, 0) + area(&coarse.mesh, 1);
    assert!((total - 64.0).abs() < 1e-9, "{total}");
    let texcoords = coarse.mesh.texcoords.unwrap();
    for corners in &coarse.mesh.triangles {
        let right = corners
            .iter()
            .any(|&c| coarse.mesh.positions[c as usize].x > 4.5);
        for &corner in corners {
            let on_seam = coarse.mesh.positions[corner as usize].x == 4.0;
            assert_eq!(texcoords[corner as usize][0] == 100.0, on_seam && right);
        }
    }
}

#[test]
fn nothing_happens_to_a_body_that_is_coarse_enough() {
    let body = sheet(4);
    let same = simplify(&body, 16);
    assert_eq!(same.mesh, body.mesh);
    assert_eq!(same.source, (0..16).collect::<Vec<_>>());
}
