//! Marker-driven surfaces: the core against the `f64` oracle and against the known body.

mod assets;
mod dirty;
mod retarget;
mod rigs;
mod tables;
mod turns;

use glam::{DQuat, DVec3};
use sinew_core::Level;
use sinew_host::fit::laplace::{LaplaceError, MarkerTarget, Surface, SurfaceOptions};
use sinew_host::reference;
use sinew_tests::laplacian::tube;

use rigs::{
    CollapsedRig, ExactRig, distances, fit_tube, marked_tube, poses, tube_poses, twisted, vertices,
};

#[test]
fn the_core_agrees_with_the_oracle() {
    let (surface, triangles, normals) = marked_tube();
    let exact = surface.exact().expect("packs");
    let collapsed = fit_tube(&surface, &triangles, &normals);
    for targets in &tube_poses(&surface)[..8] {
        let mut rig = ExactRig::new(&exact);
        rig.step(&poses(targets));
        let oracle = reference::laplacian::positions(&surface, targets);
        let error = distances(&rig.vertices(), &oracle);
        assert!(error.max < 5e-6, "{error:?}");
        let mut rig = CollapsedRig::new(&collapsed);
        rig.step(&poses(targets));
        let error = distances(
            &vertices(&rig.positions),
            &collapsed.positions(&surface, targets),
        );
        assert!(error.max < 2e-6, "{error:?}");
    }
}

#[test]
fn every_level_gives_the_same_bits() {
    let (surface, triangles, normals) = marked_tube();
    let exact = surface.exact().expect("packs");
    let collapsed = fit_tube(&surface, &triangles, &normals);
    let bits = |numbers: &[f32]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    let mut exact_bits = Vec::new();
    let mut collapsed_bits = Vec::new();
    let mut levels = vec![Level::Scalar, Level::best()];
    levels.push(Level::Simd(sinew_tests::laplacian::baseline()));
    for level in levels {
        let mut one = ExactRig::new(&exact);
        let mut two = CollapsedRig::new(&collapsed);
        (one.level, two.level) = (level, level);
        for targets in &tube_poses(&surface)[..3] {
            one.step(&poses(targets));
            two.step(&poses(targets));
        }
        exact_bits.push(bits(&one.positions));
        collapsed_bits.push([bits(&two.positions), bits(&two.normals)]);
    }
    assert!(exact_bits.windows(2).all(|pair| pair[0] == pair[1]));
    assert!(collapsed_bits.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn markers_without_usable_input_keep_their_last_pose() {
    let (surface, triangles, normals) = marked_tube();
    let tables = surface.exact().expect("packs");
    let collapsed = fit_tube(&surface, &triangles, &normals);
    let mut one = ExactRig::new(&tables);
    let mut two = CollapsedRig::new(&collapsed);
    let good = poses(&twisted(&surface, 0.5, 0.4));
    one.step(&good);
    two.step(&good);
    let before = (one.positions.clone(), two.positions.clone());
    let mut bad = good.clone();
    bad[0].position[1] = f32::NAN;
    bad[3].rotation = [0.0; 4];
    bad[5].rotation[2] = f32::INFINITY;
    bad[6].position[0] = 1e30;
    bad.truncate(7);
    assert_eq!(one.step(&bad).held_markers, 5);
    assert_eq!(two.step(&bad).held_markers, 5);
    assert_eq!((one.positions, two.positions), before);
}

#[test]
fn collapsed_surfaces_reproduce_rigid_motion_and_the_rest_pose() {
    let (surface, triangles, normals) = marked_tube();
    let collapsed = fit_tube(&surface, &triangles, &normals);
    let turn = DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 2.5);
    let shift = DVec3::new(1.0, -2.0, 0.5);
    let targets = surface.marker_rest().into_iter().map(|p| MarkerTarget {
        position: turn * p + shift,
        rotation: turn,
    });
    let targets: Vec<_> = targets.collect();
    let mut rig = CollapsedRig::new(&collapsed);
    rig.step(&poses(&targets));
    let truth: Vec<_> = surface
        .positions
        .iter()
        .map(|&p| turn * p + shift)
        .collect();
    let error = distances(&vertices(&rig.positions), &truth);
    assert!(error.max < 1e-5, "{error:?}");
    for (found, &normal) in vertices(&rig.normals).iter().zip(&normals) {
        assert!(found.distance(turn * normal) < 1e-3);
    }
}

#[test]
fn a_component_without_a_marker_is_named() {
    let (mut positions, mut triangles, _) = tube(5, 16);
    let first = positions.len() as u32;
    positions.extend([DVec3::X, DVec3::X * 1.2, DVec3::X + DVec3::Y * 0.2]);
    triangles.push([first, first + 1, first + 2]);
    let options = SurfaceOptions::default();
    let error = Surface::new(positions, &triangles, vec![0], &options).expect_err("refused");
    assert!(matches!(&error, LaplaceError::Unmarked { components }
        if components.len() == 1 && components[0].vertex == first));
    assert!(
        error.to_string().contains("3 vertices from vertex 80 on"),
        "{error}"
    );
}
