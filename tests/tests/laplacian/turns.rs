//! Turns of two revolutions.

use glam::DVec3;
use sinew_core::deform::laplacian::{MarkerPose, TurnReport};
use sinew_host::fit::laplace::{Surface, SurfaceOptions};

use crate::rigs::{
    CollapsedRig, ExactRig, distances, fit_tube, marked_tube_with, poses, twisted, vertices,
};

/// Moves of a surface over a sequence: mean over frames of the largest, and the largest of all.
struct Moves {
    mean: f64,
    largest: f64,
    smallest_radius: f64,
}

/// Twists through 720 degrees and back, then the other way.
fn twist_moves(
    surface: &Surface,
    mut step: impl FnMut(&[MarkerPose]) -> (TurnReport, Vec<DVec3>),
) -> Moves {
    let mut last: Option<Vec<DVec3>> = None;
    let (mut largest, mut sum, mut frames, mut rebased) = (0.0_f64, 0.0, 0.0, 0);
    let mut smallest_radius = f64::INFINITY;
    for frame in 0..=720_i32 {
        let phase = 4 * (180 - (frame % 360 - 180).abs());
        let angle = f64::from(if frame < 360 { phase } else { -phase });
        let targets = twisted(surface, angle.to_radians(), 0.0);
        let (report, now) = step(&poses(&targets));
        rebased += usize::from(report.rebased);
        assert!(now.iter().all(|p| p.is_finite()));
        for ring in now.chunks(16) {
            let centre = ring.iter().sum::<DVec3>() / 16.0;
            let radius = ring.iter().map(|p| p.distance(centre)).sum::<f64>() / 16.0;
            smallest_radius = smallest_radius.min(radius);
        }
        if let Some(last) = &last {
            let moved = distances(&now, last).max;
            largest = largest.max(moved);
            sum += moved;
            frames += 1.0;
        }
        last = Some(now);
    }
    assert!(rebased >= 6, "the base moved {rebased} times");
    Moves {
        mean: sum / frames,
        largest,
        smallest_radius,
    }
}

/// Two revolutions on 0.6 m pinch a tube of 0.05 m, as they would cloth; a candy wrapper has no
/// radius. `least`: radius of the exact surface and of the collapsed one, metres.
fn twists(options: &SurfaceOptions, least: [f64; 2]) {
    let (surface, triangles, normals) = marked_tube_with(options);
    let exact = surface.exact().expect("packs");
    let mut rig = ExactRig::new(&exact);
    let of_exact = twist_moves(&surface, |poses| (rig.step(poses), rig.vertices()));
    let collapsed = fit_tube(&surface, &triangles, &normals);
    let mut rig = CollapsedRig::new(&collapsed);
    let of_collapsed = twist_moves(&surface, |poses| {
        let report = rig.step(poses);
        (report, vertices(&rig.positions))
    });
    for (what, moves) in [("exact", &of_exact), ("collapsed", &of_collapsed)] {
        println!(
            "{what}: largest {:.4} m, mean {:.4} m, radius {:.4} m of 0.05",
            moves.largest, moves.mean, moves.smallest_radius
        );
    }
    for (moves, least) in [of_exact, of_collapsed].iter().zip(least) {
        assert!(moves.largest <= 3.0 * moves.mean);
        assert!(moves.smallest_radius > least);
    }
}

#[test]
fn two_revolutions_each_way_neither_jump_nor_collapse() {
    twists(&SurfaceOptions::PAPER, [0.015, 0.01]);
}

/// Rotations that change half-way between markers pinch more.
#[test]
fn markers_that_hold_their_surroundings_neither_jump_nor_collapse() {
    twists(&SurfaceOptions::default(), [0.009, 0.005]);
}
