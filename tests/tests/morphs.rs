//! Morph targets: added before the skin, whatever the mode, the layout and the instructions.

use glam::{DVec3, Vec3};
use sinew_core::asset::AssetError;
use sinew_core::deform::{Level, Output, SkinMode};
use sinew_core::frame::{
    Avatar, Budget, Flags, FrameReport, Input, State, Workspace, any_mode_workspace_len, state_len,
};
use sinew_core::pose::Transform;
use sinew_host::bake::{AssetBytes, BakeOptions, bake};
use sinew_host::import::{Interpolation, RawClip, RawMorph};
use sinew_host::model;
use sinew_host::reference;
use sinew_tests::body::arm;

/// The arm with two targets: `swell` moves the middle ring and its normals, `shift` everything.
fn morphed_arm() -> model::Avatar {
    let mut raw = arm();
    let count = raw.mesh.positions.len();
    let mut swell = RawMorph {
        name: "swell".into(),
        positions: vec![DVec3::ZERO; count],
        normals: vec![DVec3::ZERO; count],
        rest_weight: 0.0,
    };
    for vertex in 40..50 {
        let outward = raw.mesh.positions[vertex].with_y(0.0);
        swell.positions[vertex] = 0.5 * outward;
        swell.normals[vertex] = DVec3::Y;
    }
    let shift = RawMorph {
        name: "shift".into(),
        positions: vec![DVec3::X; count],
        normals: Vec::new(),
        rest_weight: 0.25,
    };
    raw.mesh.morphs = vec![swell, shift];
    raw.clips.push(RawClip {
        name: "swelling".into(),
        morph_weights: Some((
            Interpolation::Linear,
            vec![0.0, 1.0],
            vec![0.0, 0.25, 1.0, 0.25],
        )),
        ..RawClip::default()
    });
    model::Avatar::new(raw, "arm").expect("sound").0
}

fn baked() -> AssetBytes {
    let options = BakeOptions {
        centres: true,
        ..BakeOptions::default()
    };
    bake(&morphed_arm(), &options).expect("bakes").bytes
}

fn step(input: &Input<'_>, mode: SkinMode, level: Level) -> (Vec<f32>, Vec<f32>, FrameReport) {
    let bytes = baked();
    let asset = bytes.asset().expect("sound");
    let dims = *asset.dims();
    let mut state = State::with(vec![0.0; state_len(&dims)]);
    let mut workspace = Workspace::with(vec![0.0; any_mode_workspace_len(&dims)]);
    let mut positions = vec![0.0; 3 * dims.vertex_count];
    let mut normals = positions.clone();
    let mut output = Output::separate(&dims, &mut positions, Some(&mut normals)).expect("fits");
    let avatar = Avatar::new(&asset, &mut state, &mut workspace).expect("fits");
    let mut avatar = avatar.with_mode(mode).expect("fits").with_level(level);
    let report = avatar.step(input, Budget::UNLIMITED, &mut output);
    (positions, normals, report)
}

fn swelling(seconds: f32) -> Input<'static> {
    Input::Clip {
        index: 2,
        seconds,
        looped: false,
    }
}

#[test]
fn offsets_of_a_clip_agree_with_the_oracle() {
    let body = morphed_arm();
    for seconds in [0.0, 0.25, 1.0, 9.0] {
        let (positions, normals, _) = step(&swelling(seconds), SkinMode::Linear, Level::best());
        let clip = &body.clips[2];
        let weights = reference::morph::sample(&body.mesh.morphs, clip, seconds.into());
        assert!((weights[0] - f64::from(seconds).min(1.0)).abs() < 1e-12);
        let mesh = reference::morph::morphed(&body.mesh, &weights);
        let model = body.skeleton.model(&body.skeleton.rest());
        let (points, directions) = reference::skin::linear_blend(&mesh, &body.skin, &model);
        for vertex in 0..points.len() {
            let of = |all: &[f32]| Vec3::from_slice(&all[3 * vertex..]).as_dvec3();
            assert!(of(&positions).distance(points[vertex]) < 1e-6, "{vertex}");
            assert!(of(&normals).distance(directions[vertex]) < 1e-5, "{vertex}");
        }
    }
}

#[test]
fn every_mode_and_level_adds_the_same_bits() {
    for mode in [
        SkinMode::Linear,
        SkinMode::DualQuaternion,
        SkinMode::CentresOfRotation,
    ] {
        let scalar = step(&swelling(0.5), mode, Level::Scalar);
        let best = step(&swelling(0.5), mode, Level::best());
        let bits = |all: &[f32]| all.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&scalar.0), bits(&best.0), "{mode:?}");
        assert_eq!(bits(&scalar.1), bits(&best.1), "{mode:?}");
    }
}

#[test]
fn a_caller_states_weights_and_unusable_ones_keep_theirs() {
    let pose = [Transform::IDENTITY; 3];
    let rest = step(&Input::Rest, SkinMode::Linear, Level::best());
    let given = |weights: &[f32]| {
        let pose = &pose;
        step(
            &Input::Morphed { pose, weights },
            SkinMode::Linear,
            Level::best(),
        )
    };
    let (positions, _, report) = given(&[0.0, 2.25]);
    assert!(report.flags.is_empty());
    // Vertex 0 hangs on the shoulder, which stands at the origin.
    assert!((positions[0] - rest.0[0] - 2.0).abs() < 1e-6);
    let (_, _, report) = given(&[f32::NAN, 1e9]);
    assert!(report.flags.contains(Flags::BAD_INPUT));
    assert_eq!(report.held_morphs, 2);
}

#[test]
fn rows_exist_only_where_a_target_moves_something() {
    let bytes = baked();
    let asset = bytes.asset().expect("sound");
    let dims = asset.dims();
    let rows = (0..dims.block_count).flat_map(|block| asset.morph_rows(block));
    let swell = rows.filter(|row| row.morph == 0).count();
    assert!((2..=10).contains(&swell), "{swell}");
    assert_eq!(dims.morph_row_count, swell + dims.block_count);
    assert_eq!(asset.morph(1).map(|morph| morph.rest_weight), Some(0.25));
    let unpacked = reference::unpack(&asset);
    let source = morphed_arm();
    assert_eq!(unpacked.clips[2].morph_track, source.clips[2].morph_track);
    assert!(matches!(
        AssetBytes::new(&bytes.as_slice()[..400]).asset(),
        Err(AssetError::TooShort { .. } | AssetError::Length { .. })
    ));
}
