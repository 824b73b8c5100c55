//! What `write_glb` writes, read back by the importer, by pygltflib and by the format's own
//! validator.

mod scenes;

use std::path::Path;
use std::process::Command;

use glam::DVec3;
use sinew_host::export::glb::{GlbError, GlbScene, write_glb};
use sinew_host::import::RawAvatar;
use sinew_host::import::gltf::read_gltf;
use sinew_tests::{gltf_oracle, root};

use scenes::{Owned, bare, everything, still, wide};

fn near(a: &[DVec3], b: &[DVec3], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    let errors = a.iter().zip(b).map(|(a, b)| (*a - *b).length());
    let worst = errors.fold(0.0, f64::max);
    assert!(worst <= tolerance, "{worst:.2e} above {tolerance:.0e}");
}

/// Both give the same surface at several times of every clip.
fn same_motion(a: &RawAvatar, b: &RawAvatar, tolerance: f64) {
    near(
        &gltf_oracle::skinned(a, None, 0.0).0,
        &gltf_oracle::skinned(b, None, 0.0).0,
        tolerance,
    );
    assert_eq!(a.clips.len(), b.clips.len());
    for (clip_a, clip_b) in a.clips.iter().zip(&b.clips) {
        assert_eq!(clip_a.name, clip_b.name);
        for time in [0.0, 0.2, 0.31, 0.5, 1.7] {
            let (positions_a, normals_a) = gltf_oracle::skinned(a, Some(clip_a), time);
            let (positions_b, normals_b) = gltf_oracle::skinned(b, Some(clip_b), time);
            near(&positions_a, &positions_b, tolerance);
            near(&normals_a, &normals_b, tolerance);
        }
    }
}

#[test]
fn everything_survives_the_round_trip() {
    let owned = everything();
    let again = owned.round_trip();
    assert_eq!(again.mesh.name, "patch");
    assert_eq!(again.mesh.positions, owned.avatar.mesh.positions);
    assert_eq!(
        again.mesh.normals.as_deref(),
        Some(&[DVec3::Z, DVec3::Z, DVec3::Y][..])
    );
    assert_eq!(again.mesh.primitives[0].corners, [0, 1, 2, 0, 0, 1]);
    let names: Vec<&str> = again.skeleton.joints.iter().map(|j| &*j.name).collect();
    let expected = [
        "j0", "j1", "j2", "j3", "j4", "j5", "j6", "j7", "j8", "root", "j3.bind",
    ];
    assert_eq!(names, expected);
    assert_eq!(again.skin.joints, [0, 1, 2, 3, 4, 5, 6, 7, 8, 10]);
    assert_eq!(again.skin.inverse_bind, owned.avatar.skin.inverse_bind);
    // Nine influences fill three sets, the largest first.
    let first: Vec<u32> = again.skin.influences[0]
        .iter()
        .map(|&(bind, _)| bind)
        .collect();
    assert_eq!(first, [8, 7, 6, 5, 4, 3, 2, 1, 0]);
    assert!((again.skin.influences[0][0].1 - 9.0 / 45.0).abs() < 1e-7);
    assert_eq!(again.skin.influences[1], [(3, 0.5), (9, 0.5)]);
    assert_eq!(again.mesh.morphs[1].normals, vec![DVec3::X; 3]);
    assert_eq!(again.mesh.morphs[0].rest_weight, 0.25);
    assert_eq!(again.clips[0].tracks.len(), 4);
    assert_eq!(
        again.clips[0].morph_weights,
        owned.avatar.clips[0].morph_weights
    );
    // The normals of the source are not unit length.
    let mut unit = owned.avatar.clone();
    unit.mesh.normals = again.mesh.normals.clone();
    same_motion(&unit, &again, 2e-6);
}

#[test]
fn real_files_survive_the_round_trip() {
    for (name, owned) in scenes::real() {
        let again = owned.round_trip();
        assert_eq!(again.mesh.positions, owned.avatar.mesh.positions, "{name}");
        let joints = (
            again.skeleton.joints.len(),
            owned.avatar.skeleton.joints.len(),
        );
        assert_eq!(joints.0, joints.1, "{name}");
        for (a, b) in owned.avatar.mesh.morphs.iter().zip(&again.mesh.morphs) {
            assert_eq!((&a.name, &a.positions), (&b.name, &b.positions));
        }
        same_motion(&owned.avatar, &again, 2e-6);
    }
}

#[test]
fn wide_indices_and_joints() {
    let owned = wide();
    let again = owned.round_trip();
    assert_eq!(again.mesh.primitives[0].corners.last(), Some(&69_999));
    assert_eq!(again.skin.influences[299][0].0, 299);
    near(&again.mesh.positions, &owned.avatar.mesh.positions, 1e-7);
}

#[test]
fn parts_that_are_absent() {
    let again = still().round_trip();
    assert_eq!(again.skin.influences, vec![vec![(0, 1.0)]; 3]);
    assert!(again.mesh.normals.is_none() && again.mesh.morphs[1].normals.is_empty());
    let again = bare().round_trip();
    assert!(again.mesh.positions.is_empty());
    assert_eq!(again.clips[0].tracks.len(), 4);
    let nothing = write_glb(&GlbScene::default()).expect("an empty scene is valid");
    let error = read_gltf(&nothing, "nothing.glb", Path::new(".")).expect_err("but useless");
    assert!(error.to_string().contains("is missing"), "{error}");
}

#[test]
fn keys_that_single_precision_cannot_tell_apart_are_dropped() {
    let mut owned = everything();
    let track = &mut owned.avatar.clips[0].tracks[2];
    track.times = vec![1.0, 1.0 + 1e-12, 2.0];
    track.values = vec![[1.0; 4], [2.0; 4], [3.0; 4]];
    let again = owned.round_trip();
    let track = &again.clips[0].tracks[2];
    assert_eq!(track.times, [1.0, 2.0]);
    assert_eq!(track.values, [[1.0, 1.0, 1.0, 0.0], [3.0, 3.0, 3.0, 0.0]]);
}

#[test]
fn scenes_that_do_not_fit_together_are_refused() {
    let error = |change: &dyn Fn(&mut Owned)| {
        let mut owned = everything();
        change(&mut owned);
        write_glb(&owned.scene()).expect_err("the scene is broken")
    };
    let bad_index = |error: GlbError| matches!(error, GlbError::BadIndex { .. });
    let not_finite = |error: GlbError| matches!(error, GlbError::NotFinite { .. });
    let count = |error: GlbError| matches!(error, GlbError::Count { .. });
    assert!(bad_index(error(&|o| o.triangles[0][2] = 3)));
    assert!(bad_index(error(
        &|o| o.avatar.skeleton.joints[2].parent = Some(9)
    )));
    assert!(bad_index(error(&|o| o.avatar.skin.joints[0] = 9)));
    assert!(bad_index(error(&|o| o.avatar.skin.influences[0][0].0 = 10)));
    assert!(bad_index(error(&|o| o.avatar.clips[0].tracks[0].joint = 9)));
    assert!(not_finite(error(
        &|o| o.avatar.mesh.positions[0].x = f64::NAN
    )));
    assert!(not_finite(error(&|o| o.avatar.mesh.positions[0].x = 1e300)));
    assert!(not_finite(error(&|o| o.avatar.mesh.morphs[0].positions
        [0]
    .x = f64::INFINITY)));
    assert!(not_finite(error(
        &|o| o.avatar.skin.influences[0][0].1 = f64::NAN
    )));
    assert!(not_finite(error(&|o| o.avatar.skin.inverse_bind[0]
        .translation
        .x = f64::NAN)));
    assert!(not_finite(error(&|o| o.avatar.skeleton.joints[0]
        .rest
        .scale
        .x = f64::NAN)));
    assert!(not_finite(error(
        &|o| o.avatar.clips[0].tracks[0].values[0] = [0.0; 4]
    )));
    assert!(count(error(
        &|o| o.avatar.mesh.normals = Some(vec![DVec3::Z; 2])
    )));
    assert!(count(error(&|o| o.avatar.mesh.morphs[0]
        .positions
        .truncate(2))));
    assert!(count(error(&|o| o.avatar.skin.influences.truncate(2))));
    assert!(count(error(&|o| o.avatar.skin.inverse_bind.truncate(9))));
    assert!(count(error(&|o| o.avatar.clips[0].tracks[1]
        .values
        .truncate(5))));
    let unweighted = error(&|o| o.avatar.skin.influences[1] = vec![(0, 0.0)]);
    assert_eq!(unweighted, GlbError::Unweighted { vertex: 1 });
    let none = error(&|o| o.triangles.clear());
    assert_eq!(none, GlbError::NoTriangles { vertices: 3 });
    assert_eq!(
        error(&|o| o.avatar.skeleton.joints[1].parent = Some(8)),
        GlbError::Cycle
    );
    let times = error(&|o| o.avatar.clips[0].tracks[0].times = vec![0.5, 0.5]);
    assert_eq!(times, GlbError::BadTimes { clip: "all".into() });
}

/// Runs a checker on one file of each scene; its output is shown where it fails.
fn run_checker(program: &str, script: &str) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("glb-{program}"));
    std::fs::create_dir_all(&folder).expect("the build folder is writable");
    let made = [
        ("everything", everything()),
        ("still", still()),
        ("bare", bare()),
        ("wide", wide()),
    ];
    let mut command = Command::new(program);
    command.current_dir(root()).arg(script);
    for (name, scene) in made.into_iter().chain(scenes::real()) {
        let path = folder.join(format!("{name}.glb"));
        let bytes = write_glb(&scene.scene()).expect("the scene fits together");
        std::fs::write(&path, bytes).expect("the build folder is writable");
        command.arg(path);
    }
    let output = command.output().expect("the program was found before");
    let text = String::from_utf8_lossy(&output.stdout);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}\n{errors}");
}

#[test]
fn pygltflib_agrees() {
    let probe = Command::new("python3")
        .args(["-c", "import numpy, pygltflib"])
        .output();
    if probe.is_ok_and(|output| output.status.success()) {
        run_checker("python3", "tests/python/check_glb.py");
    } else {
        sinew_tests::skip("python3 with numpy and pygltflib");
    }
}

#[test]
fn the_khronos_validator_finds_nothing() {
    if root().join("out/node/node_modules/gltf-validator").exists() {
        run_checker("node", "tests/node/validate_glb.mjs");
    } else {
        sinew_tests::skip("`npm install --prefix out/node gltf-validator`");
    }
}
