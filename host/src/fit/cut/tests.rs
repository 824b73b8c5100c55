use std::f64::consts::TAU;

use glam::swizzles::Vec3Swizzles as _;

use super::*;
use crate::import::{RawMesh, RawPrimitive};

const SIDES: u32 = 16;

/// Tubes along x, each from one place to another, open at both ends.
fn tubes(pieces: &[(&str, f64, f64)]) -> Mesh {
    let mut raw = RawMesh::default();
    for &(name, from, to) in pieces {
        let first = raw.positions.len() as u32;
        let rings = ((to - from) / 0.02).round() as u32 + 1;
        for ring in 0..rings {
            let x = from + (to - from) * f64::from(ring) / f64::from(rings - 1);
            for side in 0..SIDES {
                let angle = TAU * f64::from(side) / f64::from(SIDES);
                let at = DVec3::new(x, 0.05 * angle.cos(), 0.05 * angle.sin());
                raw.positions.push(at);
            }
        }
        let mut corners = Vec::new();
        for ring in 0..rings - 1 {
            for side in 0..SIDES {
                let [a, b] = [side, (side + 1) % SIDES].map(|s| first + ring * SIDES + s);
                corners.extend([a, b, b + SIDES, a + SIDES]);
            }
        }
        raw.primitives.push(RawPrimitive {
            name: name.into(),
            polygon_sizes: vec![4; corners.len() / 4],
            corners,
        });
    }
    Mesh::new(raw, "tubes").expect("sound").0
}

#[test]
fn a_gap_is_bridged_in_rows() {
    let mesh = tubes(&[("pelvis", 0.0, 0.3), ("thigh", 0.36, 0.7)]);
    // Wider than the borders' radius.
    let wide = JoinOptions {
        gap: Some(0.08),
        ..JoinOptions::default()
    };
    let (body, report) = join(&mesh, &wide).expect("joins");
    assert_eq!(report.gaps.len(), 1);
    let gap = report.gaps[0];
    assert!((gap.width - 0.06).abs() < 1e-9 && gap.centre.distance(DVec3::X * 0.33) < 1e-9);
    // Two rows of new vertices, three of quads; both outer ends stay open.
    assert_eq!(report.added, 3 * 2 * SIDES as usize);
    assert_eq!(report.open.len(), 2);
    let volume: f64 = body
        .mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| body.mesh.positions[v as usize]);
            a.cross(b).dot(c) / 6.0
        })
        .sum();
    assert!(volume > 0.0, "faces outward");
    let joints = &body.skeleton.joints;
    assert_eq!(
        (joints[0].name.as_str(), joints[1].name.as_str()),
        ("pelvis", "thigh")
    );
    for (at, row) in body.mesh.positions.iter().zip(&body.skin.influences) {
        assert!((at.yz().length() - 0.05).abs() < 0.004, "bulges at {at}");
        let thigh: f64 = row.iter().filter(|&&(j, _)| j == 1).map(|&(_, w)| w).sum();
        if (at.x - 0.33).abs() > 0.15 {
            assert_eq!(thigh > 0.5, at.x > 0.33);
            assert!(row[0].1 > 0.9, "{row:?} at {at}");
        } else if (at.x - 0.33).abs() < 0.02 {
            assert!((0.2..0.8).contains(&thigh), "{thigh} at {at}");
        }
    }
}

#[test]
fn borders_too_far_apart_stay_open() {
    let mesh = tubes(&[("a", 0.0, 0.3), ("b", 0.5, 0.8)]);
    let error = join(&mesh, &JoinOptions::default()).unwrap_err();
    assert_eq!(error, JoinError::NothingFaces { open: 4 });
    let wide = JoinOptions {
        gap: Some(0.3),
        ..JoinOptions::default()
    };
    assert_eq!(join(&mesh, &wide).expect("joins").1.gaps.len(), 1);
}

#[test]
fn parts_without_a_gap_are_welded() {
    let mesh = tubes(&[("a", 0.0, 0.3), ("b", 0.3, 0.6)]);
    let (body, report) = join(&mesh, &JoinOptions::default()).expect("joins");
    assert_eq!((report.added, report.gaps[0].width), (0, 0.0));
    assert_eq!(
        body.mesh.positions.len(),
        mesh.positions.len() - SIDES as usize
    );
}

#[test]
fn a_loose_part_hangs_on_the_nearest() {
    let mesh = tubes(&[("a", 0.0, 0.3), ("b", 0.32, 0.6), ("far", 2.0, 2.2)]);
    let (body, report) = join(&mesh, &JoinOptions::default()).expect("joins");
    assert_eq!(report.attached, [2]);
    let far = body.skeleton.find("far").expect("a joint");
    let above = body.skeleton.joints[far].parent.expect("a parent");
    assert_eq!(body.skeleton.joints[above].name, "b");
}

#[test]
fn what_has_no_parts_is_refused() {
    let join = |pieces: &[(&str, f64, f64)]| join(&tubes(pieces), &JoinOptions::default());
    assert_eq!(
        join(&[("a", 0.0, 0.3)]).unwrap_err(),
        JoinError::TooFewParts { count: 1 }
    );
    let name = "a".to_owned();
    let twice = join(&[("a", 0.0, 0.3), ("a", 0.32, 0.6)]).unwrap_err();
    assert_eq!(twice, JoinError::SameName { name });
}
