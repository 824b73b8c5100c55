//! Animations.

use super::*;
use crate::import::{Channel, Interpolation, RawClip};

/// Adds an animation with one channel; `output` is an accessor.
fn animate(file: &mut File, node: usize, path: &str, mode: &str, times: &[f32], output: usize) {
    let input = file.floats("SCALAR", times);
    file.push(
        "animations",
        json!({
            "samplers": [{ "input": input, "output": output, "interpolation": mode }],
            "channels": [{ "sampler": 0, "target": { "node": node, "path": path } }],
        }),
    );
}

fn clip(file: &File) -> RawClip {
    let mut clips = file.read().unwrap().clips;
    assert_eq!(clips.len(), 1);
    clips.remove(0)
}

#[test]
fn channels_of_every_kind() {
    let mut file = skinned();
    let shift = file.floats("VEC3", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    animate(&mut file, 1, "translation", "STEP", &[0.5, 1.0], shift);
    let clips = file.read().unwrap().clips;
    let track = &clips[0].tracks[0];
    assert_eq!(clips[0].name, "body");
    assert_eq!((track.joint, track.channel), (0, Channel::Translation));
    assert_eq!(track.interpolation, Interpolation::Step);
    assert_eq!(track.times, [0.5, 1.0]);
    assert_eq!(track.values, [[1.0, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 0.0]]);
    assert_eq!(clips[0].morph_weights, None);

    // A spline holds three elements a key; nothing of it is normalised.
    let spline: Vec<f32> = (0..24).map(|i| i as f32).collect();
    let spline = file.floats("VEC4", &spline);
    animate(&mut file, 3, "rotation", "CUBICSPLINE", &[0.0, 1.0], spline);
    let clips = file.read().unwrap().clips;
    assert_eq!((&*clips[0].name, &*clips[1].name), ("body.0", "body.1"));
    let track = &clips[1].tracks[0];
    assert_eq!((track.joint, track.channel), (2, Channel::Rotation));
    assert_eq!(track.values.len(), 6);
    assert_eq!(track.values[1], [4.0, 5.0, 6.0, 7.0]);
}

#[test]
fn integer_rotations_are_fractions_and_made_unit() {
    let mut file = skinned();
    let turns = file.fractions("VEC4", I16, &[0_i16, 0, 0, -32_768, 0, 0, 23_170, 23_170]);
    animate(&mut file, 1, "rotation", "LINEAR", &[0.0, 1.0], turns);
    let track = clip(&file).tracks.remove(0);
    assert_eq!(track.values[0], [0.0, 0.0, 0.0, -1.0]);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert!((track.values[1][2] - half).abs() < 1e-15 && (track.values[1][3] - half).abs() < 1e-15);
}

#[test]
fn animated_ancestors_are_kept_and_other_targets_left_out() {
    let mut file = one_triangle(|_| json!({}));
    file.push("nodes", json!({ "name": "above", "children": [0] }));
    file.push("nodes", json!({ "name": "camera" }));
    let scale = file.floats("VEC3", &[1.0, 1.0, 2.0]);
    let input = file.floats("SCALAR", &[0.0]);
    let channel =
        |node: usize, path: &str| json!({ "sampler": 0, "target": { "node": node, "path": path } });
    file.push(
        "animations",
        json!({
            "name": "stretch",
            "samplers": [{ "input": input, "output": scale }],
            "channels": [
                channel(1, "scale"), channel(2, "scale"), channel(0, "weights"),
                channel(1, "scale"), channel(1, "pointer"),
                { "sampler": 0, "target": { "path": "translation" } },
            ],
        }),
    );
    let avatar = file.read().unwrap();
    assert_eq!(avatar.clips[0].name, "stretch");
    assert_eq!(avatar.clips[0].tracks.len(), 1);
    assert_eq!(avatar.clips[0].tracks[0].joint, 1);
    assert_eq!(avatar.skeleton.joints[1].name, "above");
    for part in [
        "2 channels left out",
        "same target",
        "not one of glTF 2.0",
        "target no node",
    ] {
        assert!(notice(&avatar, part), "{part}: {:?}", avatar.notices);
    }
}

#[test]
fn a_file_without_meshes_gives_skeleton_and_clips() {
    let mut file = File::default();
    file.push("nodes", json!({ "name": "a", "children": [1] }));
    file.push("nodes", json!({ "name": "b" }));
    file.push("nodes", json!({ "name": "unused" }));
    let shift = file.floats("VEC3", &[1.0, 2.0, 3.0]);
    animate(&mut file, 1, "translation", "LINEAR", &[0.0], shift);
    let avatar = file.read().unwrap();
    assert!(avatar.mesh.positions.is_empty());
    assert_eq!(avatar.skeleton.joints.len(), 2);
    assert_eq!(avatar.clips[0].tracks[0].joint, 1);
}

/// Two triangles with two and one morph targets.
fn morphing() -> File {
    let mut file = File::default();
    let positions = file.triangle();
    let target = json!({ "POSITION": positions });
    let two = json!({ "attributes": target, "targets": [target, target] });
    let one = json!({ "attributes": target, "targets": [target] });
    file.push("meshes", json!({ "primitives": [two] }));
    file.push("meshes", json!({ "primitives": [one], "weights": [0.75] }));
    file.push("nodes", json!({ "mesh": 0 }));
    file.push("nodes", json!({ "mesh": 1 }));
    file
}

#[test]
fn weights_fill_up_with_the_rest_of_other_meshes() {
    let mut file = morphing();
    let weights = file.fractions("SCALAR", U8, &[0_u8, 255, 51, 0]);
    animate(&mut file, 0, "weights", "LINEAR", &[0.0, 2.0], weights);
    let (mode, times, values) = clip(&file).morph_weights.unwrap();
    assert_eq!((mode, times), (Interpolation::Linear, vec![0.0, 2.0]));
    assert_eq!(values, [0.0, 1.0, 0.75, 0.2, 0.0, 0.75]);
}

#[test]
fn weights_of_two_meshes_merge_exactly() {
    let mut file = morphing();
    let first = file.floats("SCALAR", &[0.0, 0.0, 1.0, 3.0]);
    animate(&mut file, 0, "weights", "LINEAR", &[0.0, 2.0], first);
    let second = file.floats("SCALAR", &[0.5, 0.25]);
    let input = file.floats("SCALAR", &[1.0, 3.0]);
    let sampler = json!({ "input": input, "output": second });
    let samplers = [file.root["animations"][0]["samplers"][0].clone(), sampler];
    file.set("/animations/0/samplers", json!(samplers));
    let second = json!({ "sampler": 1, "target": { "node": 1, "path": "weights" } });
    let channels = [file.root["animations"][0]["channels"][0].clone(), second];
    file.set("/animations/0/channels", json!(channels));
    let (mode, times, values) = clip(&file).morph_weights.unwrap();
    assert_eq!(
        (mode, times),
        (Interpolation::Linear, vec![0.0, 1.0, 2.0, 3.0])
    );
    let expected = [
        0.0, 0.0, 0.5, 0.5, 1.5, 0.5, 1.0, 3.0, 0.375, 1.0, 3.0, 0.25,
    ];
    assert_eq!(values, expected);

    // As a spline the line keeps its values; all tangents are its slope inside the track.
    let spline = file.floats("SCALAR", &[0.0, 0.5, 0.0, 0.0, 0.25, 0.0]);
    file.set("/animations/0/samplers/1/output", json!(spline));
    file.root["animations"][0]["samplers"][1]["interpolation"] = json!("CUBICSPLINE");
    let (mode, _, values) = clip(&file).morph_weights.unwrap();
    assert_eq!(mode, Interpolation::CubicSpline);
    // Key 1: in-tangents, values and out-tangents of three targets.
    assert_eq!(values[9..18], [0.5, 1.5, 0.0, 0.5, 1.5, 0.5, 0.5, 1.5, 0.0]);
    file.set("/animations/0/samplers/0/interpolation", json!("STEP"));
    let text = file.read().unwrap_err().to_string();
    assert!(
        text.contains("animations[0]: STEP for the morph weights"),
        "{text}"
    );
}

#[test]
fn keys_must_fit_and_ascend() {
    let error = |mode: &str, times: &[f32], values: &[f32]| {
        let mut file = skinned();
        let output = file.floats("VEC3", values);
        animate(&mut file, 1, "translation", mode, times, output);
        file.read().unwrap_err().to_string()
    };
    let two = [0.0; 6];
    for (text, part) in [
        (
            error("LINEAR", &[0.0, 1.0, 2.0], &two),
            "3 key times ask for 3 values, there are 2",
        ),
        (
            error("CUBICSPLINE", &[0.0, 1.0], &two),
            "2 key times ask for 6 values, there are 2",
        ),
        (
            error("LINEAR", &[1.0, 1.0], &two),
            "key time 1 is 1, which must be above the one before",
        ),
        (error("LINEAR", &[1.0, 0.5], &two), "key time 1 is 0.5"),
        (error("LINEAR", &[-1.0, 0.5], &two), "key time 0 is -1"),
        (
            error("LINEAR", &[0.0, f32::NAN], &two),
            "key times of element 1 is not finite",
        ),
        (
            error("LINEAR", &[0.0, 1.0], &[f32::NAN; 6]),
            "key values of element 0 is not finite",
        ),
        (
            error("SMOOTH", &[0.0, 1.0], &two),
            "an interpolation other than",
        ),
    ] {
        assert!(text.contains(part), "{text}");
        assert!(text.starts_with("dir/body.glb in a"), "{text}");
    }
}
