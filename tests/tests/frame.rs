//! A frame of the core: right, bounded, the same at every level, unharmed by bad input.

use glam::{DVec3, Quat, Vec3};
use sinew_core::deform::{Attribute, Level, Output, SizeError, VertexOrder};
use sinew_core::frame::{Avatar, Budget, Flags, Input, State, Workspace, state_len, workspace_len};
use sinew_core::pose::Transform;
use sinew_host::bake::{AssetBytes, BakeOptions, bake};
use sinew_host::reference;
use sinew_tests::{Random, body::checked_arm};

fn baked() -> AssetBytes {
    bake(&checked_arm(), &BakeOptions::default())
        .expect("bakes")
        .bytes
}

/// Everything a frame needs, on the heap.
struct Rig {
    bytes: AssetBytes,
    state: State<Vec<f32>>,
    workspace: Workspace<Vec<f32>>,
    positions: Vec<f32>,
    normals: Vec<f32>,
}

impl Rig {
    fn new() -> Self {
        let bytes = baked();
        let dims = *bytes.asset().expect("sound").dims();
        Self {
            bytes,
            state: State::with(vec![0.0; state_len(&dims)]),
            workspace: Workspace::with(vec![0.0; workspace_len(&dims)]),
            positions: vec![0.0; 3 * dims.vertex_count],
            normals: vec![0.0; 3 * dims.vertex_count],
        }
    }

    fn step(
        &mut self,
        input: &Input<'_>,
        budget: Budget,
        level: Level,
    ) -> sinew_core::frame::FrameReport {
        let asset = self.bytes.asset().expect("sound");
        let mut output =
            Output::separate(asset.dims(), &mut self.positions, Some(&mut self.normals))
                .expect("sizes fit");
        Avatar::new(&asset, &mut self.state, &mut self.workspace)
            .expect("sizes fit")
            .with_level(level)
            .step(input, budget, &mut output)
    }
}

fn clip(index: usize, seconds: f32) -> Input<'static> {
    Input::Clip {
        index,
        seconds,
        looped: false,
    }
}

#[test]
fn a_frame_agrees_with_the_oracle() {
    let body = checked_arm();
    let mut rig = Rig::new();
    let (mut worst, mut worst_normal) = (0.0_f64, 0.0_f64);
    for index in 0..2 {
        for step in 0..=40 {
            let seconds = step as f32 / 40.0;
            rig.step(&clip(index, seconds), Budget::UNLIMITED, Level::best());
            let local = reference::pose::sample(&body.skeleton, &body.clips[index], seconds.into());
            let model = reference::pose::model(&body.skeleton, &local);
            let (points, normals) = reference::skin::linear_blend(&body.mesh, &body.skin, &model);
            for (at, (point, normal)) in points.iter().zip(&normals).enumerate() {
                let vector = |all: &[f32]| {
                    DVec3::from_array(
                        [all[3 * at], all[3 * at + 1], all[3 * at + 2]].map(f64::from),
                    )
                };
                worst = worst.max(vector(&rig.positions).distance(*point));
                worst_normal = worst_normal.max(vector(&rig.normals).distance(*normal));
            }
        }
    }
    // The weights of the arm are rounded to 1/32768 over a reach of half a metre.
    assert!(worst < 1e-5, "{worst} m");
    assert!(worst_normal < 1e-4, "{worst_normal}");
}

#[test]
fn every_level_gives_the_same_bits() {
    let mut levels = vec![Level::best()];
    #[cfg(target_arch = "x86_64")]
    {
        let best = fearless_simd::Level::new();
        levels.extend(
            best.as_sse2()
                .map(|l| Level::Simd(fearless_simd::Level::Sse2(l))),
        );
        levels.extend(
            best.as_sse4_2()
                .map(|l| Level::Simd(fearless_simd::Level::Sse4_2(l))),
        );
        levels.extend(
            best.as_avx2()
                .map(|l| Level::Simd(fearless_simd::Level::Avx2(l))),
        );
    }
    let mut scalar = Rig::new();
    for index in 0..2 {
        scalar.step(&clip(index, 0.37), Budget::UNLIMITED, Level::Scalar);
        for &level in &levels {
            let mut rig = Rig::new();
            rig.step(&clip(index, 0.37), Budget::UNLIMITED, level);
            let bits = |all: &[f32]| all.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&rig.positions), bits(&scalar.positions), "{level:?}");
            assert_eq!(bits(&rig.normals), bits(&scalar.normals), "{level:?}");
        }
    }
}

#[test]
fn unusable_input_keeps_the_last_good_pose() {
    let mut rig = Rig::new();
    rig.step(&clip(0, 0.5), Budget::UNLIMITED, Level::best());
    let good = rig.positions.clone();
    let report = rig.step(&clip(0, f32::INFINITY), Budget::UNLIMITED, Level::best());
    assert!(report.flags.contains(Flags::BAD_INPUT));
    assert_eq!(report.held_joints, 3);
    assert_eq!(rig.positions, good);
    let report = rig.step(&clip(9, 0.0), Budget::UNLIMITED, Level::best());
    assert!(report.flags.contains(Flags::UNKNOWN_CLIP));
    assert_eq!(rig.positions, good);
    let bad = Transform {
        rotation: Quat::NAN,
        ..Transform::IDENTITY
    };
    let report = rig.step(&Input::Pose(&[bad]), Budget::UNLIMITED, Level::best());
    assert!(report.flags.contains(Flags::BAD_INPUT) && report.flags.contains(Flags::SHORT_POSE));
    assert_eq!(rig.positions, good);
}

#[test]
fn hostile_poses_never_give_a_number_that_is_not_finite() {
    let mut rig = Rig::new();
    let mut random = Random(3);
    for _ in 0..20_000 {
        let mut number = |largest: f32| match random.below(8) {
            0 => f32::from_bits(random.bits() as u32),
            1 => largest,
            2 => -largest,
            3 => 1e-40,
            _ => (random.unit() as f32 - 0.5) * 2.0,
        };
        let pose: [Transform; 3] = std::array::from_fn(|_| Transform {
            rotation: Quat::from_xyzw(number(1e9), number(1.0), number(1.0), number(1.0)),
            translation: Vec3::new(number(1e6), number(1e6), number(1e6)),
            scale: Vec3::new(number(1e3), number(1e3), number(1e3)),
        });
        rig.step(&Input::Pose(&pose), Budget::UNLIMITED, Level::best());
        assert!(
            rig.positions
                .iter()
                .chain(&rig.normals)
                .all(|x| x.is_finite()),
            "{pose:?}"
        );
    }
}

#[test]
fn a_small_budget_reaches_every_block_in_turn() {
    let mut full = Rig::new();
    full.step(&clip(0, 0.5), Budget::UNLIMITED, Level::best());
    let mut rig = Rig::new();
    rig.step(&clip(0, 0.0), Budget::UNLIMITED, Level::best());
    let blocks = 90_usize.div_ceil(8);
    let mut frames = 0;
    while rig.positions != full.positions {
        let report = rig.step(&clip(0, 0.5), Budget::blocks(5), Level::best());
        assert_eq!((report.blocks_done, report.blocks_left), (5, blocks - 5));
        frames += 1;
        assert!(
            frames <= blocks.div_ceil(5),
            "not done after {frames} frames"
        );
    }
    let report = rig.step(&clip(0, 0.0), Budget::blocks(0), Level::best());
    assert_eq!((report.blocks_done, report.blocks_left), (0, blocks));
    assert_eq!(rig.positions, full.positions);
}

#[test]
fn interleaved_output_writes_nothing_else() {
    let bytes = baked();
    let asset = bytes.asset().expect("sound");
    let dims = *asset.dims();
    let mut plain = Rig::new();
    plain.step(&clip(0, 0.25), Budget::UNLIMITED, Level::best());
    let mut vertices = vec![7.0; 8 * dims.vertex_count];
    let at = |offset| Attribute { stride: 8, offset };
    let mut output = Output::interleaved(&dims, &mut vertices, at(1), Some(at(4))).expect("fits");
    let mut state = State::with(vec![0.0; state_len(&dims)]);
    let mut workspace = Workspace::with(vec![0.0; workspace_len(&dims)]);
    let mut avatar = Avatar::new(&asset, &mut state, &mut workspace).expect("fits");
    avatar.step(&clip(0, 0.25), Budget::UNLIMITED, &mut output);
    for (vertex, row) in vertices.chunks(8).enumerate() {
        assert_eq!(row[0], 7.0);
        assert_eq!(row[7], 7.0);
        assert_eq!(row[1..4], plain.positions[3 * vertex..][..3]);
        assert_eq!(row[4..7], plain.normals[3 * vertex..][..3]);
    }
    let mut blocks = vec![0.0; 3 * dims.vertex_count];
    let output = Output::separate(&dims, &mut blocks, None).expect("fits");
    avatar.step(
        &clip(0, 0.25),
        Budget::UNLIMITED,
        &mut output.in_order(VertexOrder::Block),
    );
    for (at, &source) in asset.source_order().iter().enumerate() {
        assert_eq!(
            blocks[3 * at..][..3],
            plain.positions[3 * source as usize..][..3]
        );
    }
}

#[test]
fn buffers_that_do_not_fit_are_refused() {
    let bytes = baked();
    let asset = bytes.asset().expect("sound");
    let dims = *asset.dims();
    let mut short = vec![0.0; 3 * dims.vertex_count - 1];
    let error = Output::separate(&dims, &mut short, None).expect_err("too short");
    assert!(matches!(
        error,
        SizeError::TooSmall {
            buffer: "positions",
            needed: 270,
            found: 269
        }
    ));
    let mut room = vec![0.0; 8 * dims.vertex_count];
    for (stride, position, normal) in [(2, 0, 0), (6, 0, 2), (6, 4, 0), (usize::MAX, 0, 3)] {
        let at = |offset| Attribute { stride, offset };
        assert!(
            Output::interleaved(&dims, &mut room, at(position), Some(at(normal))).is_err(),
            "{stride} {position} {normal}"
        );
    }
    let mut state = State::<[f32; 29]>::new();
    let mut workspace = Workspace::with(vec![0.0; workspace_len(&dims)]);
    assert!(Avatar::new(&asset, &mut state, &mut workspace).is_err());
}
