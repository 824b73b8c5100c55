//! glTF files played through the core against the glTF equations in `f64`.

use std::collections::BTreeSet;

use glam::DVec3;
use sinew_core::frame::Input;
use sinew_host::bake::{BakeOptions, bake};
use sinew_host::import::gltf::read_gltf;
use sinew_host::model::Avatar;
use sinew_host::play::Player;
use sinew_tests::{gltf_oracle, root, shared};

/// Largest distance over all vertices, metres, at every key of the first clip and halfway between.
fn worst_error(path: &std::path::Path) -> f64 {
    let bytes = std::fs::read(path).expect("readable");
    let raw = read_gltf(&bytes, "file", path.parent().expect("a folder")).expect("sound");
    let (body, _) = Avatar::new(raw.clone(), "file").expect("sound");
    let baked = bake(&body, &BakeOptions::default()).expect("bakes");
    let mut player = Player::new(baked.bytes.asset().expect("sound"));
    let clip = raw.clips.first();
    let keys = clip
        .iter()
        .flat_map(|clip| &clip.tracks)
        .flat_map(|track| &track.times);
    let weights = clip.iter().filter_map(|clip| clip.morph_weights.as_ref());
    let keys = keys.chain(weights.flat_map(|(_, times, _)| times));
    let keys: BTreeSet<u64> = keys.map(|time| time.to_bits()).chain([0]).collect();
    let keys: Vec<f64> = keys.into_iter().map(f64::from_bits).collect();
    let middles = keys.windows(2).map(|pair| f64::midpoint(pair[0], pair[1]));
    let mut worst = 0.0_f64;
    for time in middles.chain(keys.iter().copied()) {
        // The core is asked for the nearest `f32`, so the equations are too.
        let seconds = time as f32;
        let input = match clip {
            Some(_) => Input::Clip {
                index: 0,
                seconds,
                looped: false,
            },
            None => Input::Rest,
        };
        player.step(&input);
        let (points, _) = gltf_oracle::skinned(&raw, clip, seconds.into());
        for (point, got) in points.iter().zip(player.positions()) {
            worst = worst.max(point.distance(DVec3::from_array(got.map(f64::from))));
        }
    }
    worst
}

#[test]
fn cesium_man_follows_the_equations_in_every_key_frame() {
    let Some(path) = shared("mesh/cesium_man.gltf") else {
        return;
    };
    let worst = worst_error(&path);
    assert!(worst <= 1e-5, "{worst} m");
}

#[test]
fn a_rig_of_two_joints_follows_the_equations() {
    let Some(path) = shared("mesh/rigged_simple.gltf") else {
        return;
    };
    // Ten metres tall.
    let worst = worst_error(&path);
    assert!(worst <= 5e-5, "{worst} m");
}

#[test]
fn the_bundled_hand_follows_the_equations() {
    let worst = worst_error(&root().join("examples/data/hand.glb"));
    assert!(worst <= 1e-6, "{worst} m");
}

#[test]
fn morph_targets_follow_the_equations() {
    let Some(path) = shared("mesh/MorphStressTest.gltf") else {
        return;
    };
    let worst = worst_error(&path);
    assert!(worst <= 1e-5, "{worst} m");
}
