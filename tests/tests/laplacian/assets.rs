//! Scans in assets: frames, budgets, checks, the same bits.

use glam::{DQuat, DVec3};
use sinew_core::Level;
use sinew_core::asset::{AssetError, crc32};
use sinew_core::deform::Output;
use sinew_core::frame::{Avatar, Budget, Input, State, Workspace, cost, state_len, workspace_len};
use sinew_host::bake::{AssetBytes, BakeOptions, bake_rig};
use sinew_host::fit::laplace::repair::{RepairOptions, repair};
use sinew_host::fit::laplace::rig::{Rig, RigOptions, Solve, rig};
use sinew_host::model::{Mesh, Part};
use sinew_host::play::Player;
use sinew_host::verify::{CORE_LIMIT, limit_of, verify};
use sinew_tests::laplacian::{driven_by, tube};

use crate::rigs::{marked_tube, tube_poses};

/// The tube with a seam (every vertex of one line twice), a stray vertex, and a loose triangle
/// beside it that has no marker.
fn scan(solve: Solve) -> Rig {
    let (mut positions, mut triangles, mut normals) = tube(41, 16);
    let count = positions.len() as u32;
    for ring in 0..41 {
        positions.push(positions[ring * 16]);
        normals.push(normals[ring * 16]);
    }
    for corners in &mut triangles {
        let on_seam = corners.iter().any(|v| v % 16 == 15);
        for vertex in corners.iter_mut().filter(|v| on_seam && **v % 16 == 0) {
            *vertex = count + *vertex / 16;
        }
    }
    positions.push(DVec3::splat(3.0));
    let loose = positions.len() as u32;
    positions.extend([0.0, 0.01, 0.02].map(|x| DVec3::new(0.1 + x, 0.6, 10.0 * x * x)));
    normals.extend([DVec3::Y; 4]);
    triangles.push([loose, loose + 1, loose + 2]);
    let mesh = Mesh {
        name: "tube".into(),
        parts: vec![Part {
            name: "all".into(),
            triangles: 0..triangles.len(),
        }],
        positions,
        normals,
        tangents: None,
        texcoords: None,
        triangles,
        morphs: Vec::new(),
    };
    let repaired = repair(&mesh.positions, &mesh.triangles, &RepairOptions::default());
    let repaired = repaired.expect("repairs");
    assert_eq!(
        (repaired.report.welded, repaired.report.unreferenced),
        (41, 1)
    );
    let (surface, ..) = marked_tube();
    let driven = driven_by(tube_poses(&surface), 30.0);
    let names: Vec<String> = (0..surface.markers.len())
        .map(|k| format!("m{k}"))
        .collect();
    let options = RigOptions {
        solve,
        attach: true,
        ..RigOptions::default()
    };
    rig(
        &mesh,
        &repaired,
        &surface.markers,
        &names,
        &driven,
        &options,
    )
    .expect("rigs")
}

const BOTH: [Solve; 2] = [Solve::Exact, Solve::Collapsed { tolerance: 1e-3 }];

#[test]
fn an_asset_plays_as_its_oracle_at_every_level() {
    for solve in BOTH {
        let rig = scan(solve);
        assert_eq!(rig.report.attached, 1);
        let baked = bake_rig(&rig, &BakeOptions::default()).expect("bakes");
        let asset = baked.bytes.asset().expect("sound");
        assert_eq!(asset.dims().vertex_count, rig.body.mesh.positions.len());
        let report = verify(&asset, &rig.body, |_, _| {});
        // A tube of 0.6 m: limits are those of a body of 1.8 m.
        assert!(
            report.passed(3.0 * limit_of(&asset, CORE_LIMIT)),
            "{report:?}"
        );
        assert!(
            report.frames > 40 && report.worst_normal < 1e-2,
            "{report:?}"
        );
        // Seams stay closed, and the loose triangle keeps its shape.
        let mut player = Player::new(asset);
        player.step(&Input::Clip {
            index: 0,
            seconds: 0.7,
            looped: false,
        });
        let at = |v: usize| DVec3::from_array(player.positions()[v].map(f64::from));
        assert!((0..41).all(|ring| at(656 + ring) == at(16 * ring)));
        let rest = |v: usize| rig.body.mesh.positions[v];
        let side = |a: usize, b: usize| at(a).distance(at(b)) - rest(a).distance(rest(b));
        assert!(side(698, 699).abs() < 1e-4 && side(698, 700).abs() < 1e-4);
    }
}

#[test]
fn budgets_leave_what_they_do_not_pay_for() {
    for solve in BOTH {
        let rig = scan(solve);
        let baked = bake_rig(&rig, &BakeOptions::default()).expect("bakes");
        let asset = baked.bytes.asset().expect("sound");
        let dims = *asset.dims();
        let mut state = State::with(vec![0.0; state_len(&dims)]);
        let mut workspace = Workspace::with(vec![0.0; workspace_len(&dims)]);
        let mut positions = vec![7.0; 3 * dims.vertex_count];
        let mut step = |seconds: f32, budget: Budget, positions: &mut Vec<f32>| {
            let mut output = Output::separate(&dims, positions, None).expect("fits");
            let mut avatar = Avatar::new(&asset, &mut state, &mut workspace).expect("fits");
            let input = Input::Clip {
                index: 0,
                seconds,
                looped: false,
            };
            avatar.step(&input, budget, &mut output)
        };
        let none = Budget::blocks(0).with_solves(0);
        let report = step(0.3, none, &mut positions);
        assert_eq!(report.blocks_left, dims.block_count);
        assert!(positions.iter().all(|&x| x == 7.0));
        assert!(cost(&dims, none).mul_adds < cost(&dims, Budget::UNLIMITED).mul_adds);
        let half = Budget::blocks(dims.block_count.div_ceil(2));
        let (first, second) = (
            step(0.3, half, &mut positions),
            step(0.3, half, &mut positions),
        );
        let by_halves = positions.clone();
        step(0.3, Budget::UNLIMITED, &mut positions);
        assert_eq!(by_halves, positions);
        match solve {
            // A solve is whole.
            Solve::Exact => assert_eq!((first.blocks_left, second.blocks_left), (0, 0)),
            Solve::Collapsed { .. } => assert!(first.blocks_left > 0 && second.blocks_left > 0),
        }
    }
}

#[test]
fn flipped_bytes_are_refused_or_harmless() {
    for solve in BOTH {
        let rig = scan(solve);
        let baked = bake_rig(&rig, &BakeOptions::default()).expect("bakes");
        let sound = baked.bytes.as_slice().to_vec();
        let mut random = sinew_tests::Random(11);
        let mut refused = 0;
        for _ in 0..400 {
            let mut bytes = sound.clone();
            // Among the counts and the surface's sections, which come last.
            let at = match random.below(4) {
                0 => 32 + random.below(256),
                _ => sound.len() / 4 + random.below(3 * sound.len() / 4),
            };
            bytes[at] ^= 1 << random.below(8);
            let checksum = crc32(&bytes[20..]);
            bytes[16..20].copy_from_slice(&checksum.to_le_bytes());
            let bytes = AssetBytes::new(&bytes);
            match bytes.asset() {
                Err(_) => refused += 1,
                Ok(asset) => {
                    let mut player = Player::new(asset);
                    player.step(&Input::Clip {
                        index: 0,
                        seconds: 0.4,
                        looped: true,
                    });
                }
            }
        }
        assert!(refused > 50, "{refused}");
        let mut bytes = sound.clone();
        bytes.truncate(sound.len() - 16);
        let bytes = AssetBytes::new(&bytes);
        assert!(matches!(bytes.asset(), Err(AssetError::Length { .. })));
    }
}

#[test]
fn a_cut_to_another_pose_starts_anew() {
    let rig = scan(Solve::Collapsed { tolerance: 1e-3 });
    let baked = bake_rig(&rig, &BakeOptions::default()).expect("bakes");
    let asset = baked.bytes.asset().expect("sound");
    let turned = |angle: f64| -> Vec<sinew_core::pose::Transform> {
        let turn = DQuat::from_rotation_x(angle);
        let joints = rig.body.skeleton.joints.iter();
        let pose = joints.map(|joint| {
            // Attached markers are children: they turn with the one they hang on.
            let (place, turn) = match joint.parent {
                None => (turn * joint.rest.translation, turn),
                Some(_) => (joint.rest.translation, DQuat::IDENTITY),
            };
            sinew_core::pose::Transform {
                rotation: turn.as_quat(),
                translation: place.as_vec3(),
                scale: glam::Vec3::ONE,
            }
        });
        pose.collect()
    };
    let mut player = Player::new(asset).with_level(Level::Scalar);
    player.step(&Input::Rest);
    player.step(&Input::Pose(&turned(2.8)));
    let jumped = player.positions().to_vec();
    let mut fresh = Player::new(asset).with_level(Level::Scalar);
    fresh.step(&Input::Pose(&turned(2.8)));
    assert_eq!(jumped, fresh.positions());
}
