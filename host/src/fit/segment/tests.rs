//! Three boxes in a row that bend at two hinges.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};

use super::*;

/// A tube along x, 3 m long, and how far along each point is.
fn tube(rings: u32, sides: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let mut points = Vec::new();
    for ring in 0..rings {
        for side in 0..sides {
            let angle = TAU * f64::from(side) / f64::from(sides);
            let x = 3.0 * f64::from(ring) / f64::from(rings - 1);
            points.push(DVec3::new(x, 0.2 * angle.cos(), 0.25 * angle.sin()));
        }
    }
    let mut triangles = Vec::new();
    for ring in 0..rings - 1 {
        for side in 0..sides {
            let [a, b] = [side, (side + 1) % sides].map(|side| ring * sides + side);
            triangles.extend([[a, a + sides, b], [b, a + sides, b + sides]]);
        }
    }
    (points, triangles)
}

/// Bends at x = 1 and x = 2 by different amounts in each frame.
fn bend(points: &[DVec3], frame: usize) -> Vec<DVec3> {
    let at = frame as f64;
    let first = DQuat::from_rotation_z(0.8 * (at * 0.7).sin());
    let second = DQuat::from_rotation_y(0.9 * (at * 0.4).cos());
    let whole = DQuat::from_rotation_y(0.3 * at);
    let elbow = |p: DVec3, hinge: f64, turn: DQuat| {
        let origin = DVec3::X * hinge;
        if p.x > hinge {
            origin + turn * (p - origin)
        } else {
            p
        }
    };
    let moved = points
        .iter()
        .map(|&p| elbow(elbow(p, 2.0, second), 1.0, first));
    // A rigid motion of the whole tells nothing.
    moved.map(|p| whole * p + DVec3::Y * at).collect()
}

fn third(points: &[DVec3], triangle: [u32; 3]) -> u32 {
    let middle: f64 = triangle
        .iter()
        .map(|&at| points[at as usize].x)
        .sum::<f64>()
        / 3.0;
    middle as u32
}

fn agreement(points: &[DVec3], triangles: &[[u32; 3]], found: &Segmentation) -> Agreement {
    let truth: Vec<u32> = triangles.iter().map(|t| third(points, *t)).collect();
    Agreement::new(&found.triangle_parts, &truth, &vec![1.0; triangles.len()])
}

#[test]
fn three_links_are_three_parts_in_a_chain() {
    // A small surface, each triangle by itself, and a large one in patches.
    for (rings, sides) in [(22, 8), (100, 32)] {
        let (points, triangles) = tube(rings, sides);
        let frames: Vec<Vec<DVec3>> = (0..40).map(|frame| bend(&points, frame)).collect();
        let options = SegmentOptions::default();
        let found = segment(&points, &triangles, &frames, &options, &|_| ()).unwrap();
        assert_eq!(found.part_count(), 3, "{:?}", found.report);
        let agreement = agreement(&points, &triangles, &found);
        assert!(agreement.matched > 0.96, "{agreement:?}");
        assert_eq!(found.parents[0], None);
        let middle = third(
            &points,
            triangles[found.triangle_parts.iter().position(|&p| p == 0).unwrap()],
        );
        let chain: &[Option<usize>] = if middle == 1 {
            &[None, Some(0), Some(0)]
        } else {
            &[None, Some(0), Some(1)]
        };
        assert_eq!(found.parents, chain);
        assert_eq!(found.point_parts.len(), points.len());
    }
}

#[test]
fn a_number_of_parts_is_kept_and_gaps_are_borne() {
    let (points, triangles) = tube(22, 8);
    let mut frames: Vec<Vec<DVec3>> = (0..40).map(|frame| bend(&points, frame)).collect();
    for (at, frame) in frames.iter_mut().enumerate() {
        for missing in 0..20 {
            let index = (at * 31 + missing * 7) % points.len();
            frame[index] = DVec3::NAN;
        }
    }
    for wanted in [1, 2, 3] {
        let options = SegmentOptions {
            parts: Some(wanted),
            ..SegmentOptions::default()
        };
        let found = segment(&points, &triangles, &frames, &options, &|_| ()).unwrap();
        assert_eq!(found.part_count(), wanted);
        if wanted == 3 {
            let agreement = agreement(&points, &triangles, &found);
            assert!(agreement.matched > 0.9, "{agreement:?}");
        }
    }
}

#[test]
fn what_cannot_be_segmented_is_refused() {
    let (points, triangles) = tube(6, 6);
    let frames: Vec<Vec<DVec3>> = (0..5).map(|frame| bend(&points, frame)).collect();
    let options = SegmentOptions::default();
    let run = |points: &[DVec3], triangles: &[[u32; 3]], frames: &[Vec<DVec3>], options| {
        segment(points, triangles, frames, options, &|_| ()).unwrap_err()
    };
    let few = run(&points, &triangles[..2], &frames, &options);
    assert!(matches!(few, SegmentError::NoSurface { triangles: 2, .. }));
    let beyond = run(&points, &[[0, 1, 99]; 4], &frames, &options);
    assert!(matches!(
        beyond,
        SegmentError::BadTriangle { point: 99, .. }
    ));
    let short = run(&points, &triangles, &[vec![DVec3::ZERO; 3]], &options);
    assert!(matches!(
        short,
        SegmentError::FrameLength {
            frame: 0,
            found: 3,
            ..
        }
    ));
    let unseen = vec![vec![DVec3::NAN; points.len()]; 9];
    let unseen = run(&points, &triangles, &unseen, &options);
    assert!(matches!(unseen, SegmentError::FewFrames { frames: 0, .. }));
    let many = SegmentOptions {
        parts: Some(9999),
        ..options
    };
    let many = run(&points, &triangles, &frames, &many);
    assert!(matches!(many, SegmentError::PartCount { wanted: 9999, .. }));
    let mut bad = points.clone();
    bad[0] = DVec3::NAN;
    let bad = run(&bad, &triangles, &frames, &options);
    assert!(matches!(bad, SegmentError::BadPoint { point: 0 }));
}
