//! 16-bit shapes, tangents, bounds, single vertices and levels of detail.

use glam::{DQuat, DVec3};
use sinew_core::asset::{Asset, crc32};
use sinew_core::deform::{Attribute, Level, NormalMode, Output, SizeError, SkinMode};
use sinew_core::frame::{
    Avatar, Budget, Fingerprint, Input, State, Workspace, any_mode_workspace_len, state_len,
};
use sinew_core::pose;
use sinew_host::bake::{AssetBytes, BakeOptions, bake};
use sinew_host::import::RawMorph;
use sinew_host::model::{self, Transform};
use sinew_host::play::Player;
use sinew_host::simplify::simplify;
use sinew_host::{reference, verify};
use sinew_tests::limb::MODES;
use sinew_tests::{Random, body::arm, human};

/// The arm with tangents up the tube, every other one mirrored, and a morph target that swells it.
fn dressed_arm() -> model::Avatar {
    let mut raw = arm();
    let count = raw.mesh.positions.len();
    let signs = [1.0, -1.0];
    let tangents = (0..count).map(|vertex| [0.0, 1.0, 0.0, signs[vertex % 2]]);
    raw.mesh.tangents = Some(tangents.collect());
    let outward = |position: &DVec3| 0.2 * position.with_y(0.0);
    raw.mesh.morphs = vec![RawMorph {
        name: "swell".into(),
        positions: raw.mesh.positions.iter().map(outward).collect(),
        normals: vec![0.3 * DVec3::Y; count],
        rest_weight: 0.0,
    }];
    model::Avatar::new(raw, "arm").expect("sound").0
}

fn options(quantised: bool, levels: &[usize]) -> BakeOptions {
    BakeOptions {
        centres: true,
        quantised,
        levels: levels.to_vec(),
        ..BakeOptions::default()
    }
}

fn narrow(local: &Transform) -> pose::Transform {
    pose::Transform {
        rotation: local.rotation.as_quat(),
        translation: local.translation.as_vec3(),
        scale: local.scale.as_vec3(),
    }
}

/// Every joint turned by up to a radian either way.
fn random_pose(body: &model::Avatar, random: &mut Random) -> Vec<pose::Transform> {
    let mut local = body.skeleton.rest();
    for local in &mut local {
        let mut signed = || 2.0 * random.unit() - 1.0;
        let axis = DVec3::new(signed(), signed(), signed()).normalize_or(DVec3::X);
        local.rotation *= DQuat::from_axis_angle(axis, signed());
    }
    local.iter().map(narrow).collect()
}

fn levels() -> Vec<Level> {
    let mut levels = vec![Level::Scalar, Level::best()];
    #[cfg(target_arch = "x86_64")]
    {
        let here = fearless_simd::Level::new();
        let sse2 = here.as_sse2().map(fearless_simd::Level::Sse2);
        let avx2 = here.as_avx2().map(fearless_simd::Level::Avx2);
        levels.extend([sse2, avx2].into_iter().flatten().map(Level::Simd));
    }
    levels
}

fn hash(player: &Player<'_>) -> u64 {
    let mut hash = Fingerprint::new();
    hash.update(player.positions().as_flattened());
    hash.update(player.normals().as_flattened());
    hash.update(player.tangents().as_flattened());
    hash.value()
}

#[test]
fn packed_bodies_stay_within_a_tenth_of_a_millimetre_in_every_mode() {
    let body = human::body();
    let exact = bake(&body, &options(false, &[])).expect("bakes");
    let packed = bake(&body, &options(true, &[])).expect("bakes");
    let stated = packed.report.pack_error.expect("an error is stated");
    let size = |baked: &sinew_host::bake::Baked| baked.bytes.as_slice().len();
    println!(
        "stated {:.1e} m, {:.1e} rad; {} bytes instead of {}",
        stated.position,
        stated.normal,
        size(&packed),
        size(&exact)
    );
    assert!(stated.position < 5e-5 && stated.normal < 1e-4);
    let mut random = Random(3);
    for _ in 0..3 {
        let pose = random_pose(&body, &mut random);
        for (name, mode) in MODES {
            let play = |baked: &sinew_host::bake::Baked| {
                let player = Player::new(baked.bytes.asset().expect("sound"));
                let mut player = player.with_modes(mode, NormalMode::Fast).expect("centres");
                player.step(&Input::Pose(&pose));
                (player.positions().to_vec(), player.normals().to_vec())
            };
            let (wanted, found) = (play(&exact), play(&packed));
            let far = |a: &[[f32; 3]], b: &[[f32; 3]]| {
                let wide = |v: &[f32; 3]| DVec3::from(v.map(f64::from));
                let pairs = a.iter().zip(b);
                pairs
                    .map(|(a, b)| wide(a).distance(wide(b)))
                    .fold(0.0, f64::max)
            };
            let (position, normal) = (far(&wanted.0, &found.0), far(&wanted.1, &found.1));
            println!("{name}: {position:.1e} m, normals {normal:.1e}");
            assert!(position < 1e-4 && normal < 1e-3);
        }
    }
}

#[test]
fn every_level_of_instructions_gives_the_same_bits_of_packed_morphed_and_tangent_shapes() {
    let body = dressed_arm();
    let mut random = Random(8);
    for quantised in [false, true] {
        let bytes = bake(&body, &options(quantised, &[40]))
            .expect("bakes")
            .bytes;
        let whole = bytes.asset().expect("sound");
        for detail in 0..whole.level_count() {
            let asset = whole.level(detail).expect("exists");
            for (_, mode) in MODES {
                for normals in [NormalMode::Fast, NormalMode::InverseTranspose] {
                    let pose = random_pose(&body, &mut random);
                    let weight = [random.unit() as f32];
                    let input = Input::Morphed {
                        pose: &pose,
                        weights: &weight,
                    };
                    let hashes = levels().into_iter().map(|level| {
                        let player = Player::new(asset).with_modes(mode, normals);
                        let mut player = player.expect("centres").with_level(level);
                        player.step(&input);
                        hash(&player)
                    });
                    let hashes: Vec<u64> = hashes.collect();
                    assert!(
                        hashes.windows(2).all(|pair| pair[0] == pair[1]),
                        "{hashes:x?}"
                    );
                }
            }
        }
    }
}

#[test]
fn tangents_follow_the_surface_and_keep_their_handedness() {
    let body = dressed_arm();
    let bytes = bake(&body, &options(false, &[])).expect("bakes").bytes;
    let mut player = Player::new(bytes.asset().expect("sound"));
    let mut local = body.skeleton.rest();
    local[1].rotation = DQuat::from_rotation_x(0.7);
    let pose: Vec<pose::Transform> = local.iter().map(narrow).collect();
    player.step(&Input::Pose(&pose));
    let model = body.skeleton.model(&local);
    for (vertex, found) in player.tangents().iter().enumerate() {
        let influences = body.skin.influences[vertex].iter();
        let moved = influences.map(|&(bind, weight)| {
            let bind = body.skin.binds[bind as usize];
            weight * (model[bind.joint] * bind.inverse_bind).transform_vector3(DVec3::Y)
        });
        let wanted = moved.sum::<DVec3>().normalize();
        let [x, y, z, w] = found.map(f64::from);
        assert!(
            wanted.distance(DVec3::new(x, y, z)) < 1e-4,
            "vertex {vertex}"
        );
        assert_eq!(w, if vertex % 2 == 0 { 1.0 } else { -1.0 });
    }
}

#[test]
fn interleaved_tangents_are_those_of_separate_buffers() {
    let body = dressed_arm();
    let bytes = bake(&body, &options(true, &[])).expect("bakes").bytes;
    let asset = bytes.asset().expect("sound");
    let dims = *asset.dims();
    let mut player = Player::new(asset);
    let input = Input::Clip {
        index: 0,
        seconds: 0.4,
        looped: false,
    };
    player.step(&input);
    let at = |offset| Attribute { stride: 12, offset };
    let mut vertices = vec![7.0; 12 * dims.vertex_count];
    let mut state = State::with(vec![0.0; state_len(&dims)]);
    let mut workspace = Workspace::with(vec![0.0; any_mode_workspace_len(&dims)]);
    let mut output = Output::interleaved(&dims, &mut vertices, at(0), Some(at(3)))
        .and_then(|output| output.with_interleaved_tangents(at(6)))
        .expect("fits");
    let mut avatar = Avatar::new(&asset, &mut state, &mut workspace).expect("fits");
    avatar.step(&input, Budget::UNLIMITED, &mut output);
    for (vertex, numbers) in vertices.chunks(12).enumerate() {
        assert_eq!(numbers[..3], player.positions()[vertex]);
        assert_eq!(numbers[3..6], player.normals()[vertex]);
        assert_eq!(numbers[6..10], player.tangents()[vertex]);
        assert_eq!(numbers[10..], [7.0, 7.0]);
    }
    for offset in [1, 5, 9] {
        let output = Output::interleaved(&dims, &mut vertices, at(0), Some(at(3)));
        let error = output.and_then(|output| output.with_interleaved_tangents(at(offset)));
        assert!(matches!(error, Err(SizeError::Layout { .. })), "{offset}");
    }
    let output = Output::separate(&dims, &mut vertices, None).expect("fits");
    assert!(output.with_tangents(&mut [0.0; 8]).is_err());
}

#[test]
fn single_vertices_are_those_of_the_whole_frame() {
    let body = dressed_arm();
    let mut random = Random(21);
    for quantised in [false, true] {
        let bytes = bake(&body, &options(quantised, &[])).expect("bakes").bytes;
        let asset = bytes.asset().expect("sound");
        let dims = *asset.dims();
        for (_, mode) in MODES {
            let pose = random_pose(&body, &mut random);
            let mut state = State::with(vec![0.0; state_len(&dims)]);
            let mut workspace = Workspace::with(vec![0.0; any_mode_workspace_len(&dims)]);
            let mut all = vec![[0.0; 3]; dims.vertex_count];
            let mut all_normals = all.clone();
            let mut output = Output::separate(
                &dims,
                all.as_flattened_mut(),
                Some(all_normals.as_flattened_mut()),
            )
            .expect("fits");
            let avatar = Avatar::new(&asset, &mut state, &mut workspace).expect("fits");
            let mut avatar = avatar.with_mode(mode).expect("fits");
            let input = Input::Morphed {
                pose: &pose,
                weights: &[0.5],
            };
            avatar.step(&input, Budget::UNLIMITED, &mut output);
            let count = dims.vertex_count as u32;
            let ids: Vec<u32> = (0..count).rev().chain([count, u32::MAX]).collect();
            let mut some = vec![[9.0; 3]; ids.len()];
            let mut normals = some.clone();
            let found = avatar.skin_vertices(&ids, &mut some, Some(&mut normals));
            assert_eq!(found, Ok(()));
            for (at, &id) in ids.iter().enumerate() {
                match asset.source_order().get(id as usize) {
                    Some(&source) => {
                        assert_eq!(some[at], all[source as usize], "{mode:?}");
                        assert_eq!(normals[at], all_normals[source as usize], "{mode:?}");
                    }
                    None => assert_eq!(some[at], [9.0; 3]),
                }
            }
            assert!(avatar.skin_vertices(&ids, &mut some[1..], None).is_err());
        }
    }
}

#[test]
fn bounds_hold_every_vertex_and_little_more_at_rest() {
    let (body, dressed) = (human::body(), dressed_arm());
    let mut random = Random(40);
    for (body, rounds) in [(&body, 6), (&dressed, 200)] {
        let bytes = bake(body, &options(true, &[])).expect("bakes").bytes;
        let asset = bytes.asset().expect("sound");
        let dims = *asset.dims();
        let mut state = State::with(vec![0.0; state_len(&dims)]);
        let mut workspace = Workspace::with(vec![0.0; any_mode_workspace_len(&dims)]);
        let mut positions = vec![0.0; 3 * dims.vertex_count];
        for round in 0..rounds {
            let pose = random_pose(body, &mut random);
            let weights = vec![random.unit() as f32; dims.morph_count];
            let input = match round {
                0 => Input::Rest,
                _ => Input::Morphed {
                    pose: &pose,
                    weights: &weights,
                },
            };
            for (name, mode) in MODES {
                let avatar = Avatar::new(&asset, &mut state, &mut workspace).expect("fits");
                let mut avatar = avatar.with_mode(mode).expect("fits");
                let mut output = Output::separate(&dims, &mut positions, None).expect("fits");
                avatar.step(&input, Budget::UNLIMITED, &mut output);
                let bounds = avatar.bounds().expect("baked with boxes");
                let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
                for position in positions.as_chunks::<3>().0 {
                    for axis in 0..3 {
                        low[axis] = low[axis].min(position[axis]);
                        high[axis] = high[axis].max(position[axis]);
                    }
                }
                for axis in 0..3 {
                    assert!(
                        bounds.low[axis] <= low[axis] && bounds.high[axis] >= high[axis],
                        "{name}, round {round}: {bounds:?} {low:?} {high:?}"
                    );
                    let loose = bounds.high[axis] - bounds.low[axis] - high[axis] + low[axis];
                    assert!(round > 0 || loose < 0.03, "{name}: {loose} m wider");
                }
            }
        }
    }
}

#[test]
fn levels_of_detail_share_the_state_and_a_budget_picks_one() {
    let body = human::body();
    let baked = bake(&body, &options(true, &[4000, 2000])).expect("bakes");
    let whole = baked.bytes.asset().expect("sound");
    assert_eq!(whole.level_count(), 3);
    assert!(whole.level(3).is_none());
    let blocks = [0, 1, 2].map(|level| whole.level(level).unwrap().dims().block_count);
    assert!(blocks[0] > blocks[1] && blocks[1] > blocks[2] && blocks[2] <= 250);
    assert_eq!(whole.level_within(usize::MAX), 0);
    assert_eq!(whole.level_within(blocks[1]), 1);
    assert_eq!(whole.level_within(blocks[1] - 1), 2);
    assert_eq!(whole.level_within(0), 2);
    let mut random = Random(2);
    let pose = random_pose(&body, &mut random);
    let mut state = State::with(vec![0.0; state_len(whole.dims())]);
    let mut workspace = Workspace::with(vec![0.0; any_mode_workspace_len(whole.dims())]);
    let mut finest = Vec::new();
    for (index, budget) in [blocks[0], blocks[1], blocks[2]].into_iter().enumerate() {
        let level = Budget::blocks(budget).level(&whole);
        let dims = *level.dims();
        let mut positions = vec![[0.0; 3]; dims.vertex_count];
        let mut output = Output::separate(&dims, positions.as_flattened_mut(), None).expect("fits");
        let report = Avatar::new(&level, &mut state, &mut workspace)
            .expect("fits")
            .step(&Input::Pose(&pose), Budget::blocks(budget), &mut output);
        assert!(report.flags.is_empty() && report.blocks_left == 0);
        if index == 0 {
            finest = positions;
            continue;
        }
        // Every vertex of a coarser level is one of the finest.
        for (found, &source) in positions.iter().zip(level.level_sources()) {
            let (found, wanted) = (found.map(f64::from), finest[source as usize].map(f64::from));
            assert!(DVec3::from(found).distance(DVec3::from(wanted)) < 2e-5);
        }
        let report = baked.report.levels[index - 1];
        println!("{report:?}");
        assert!(report.error < 0.01);
    }
}

#[test]
fn a_coarser_body_stays_near_the_finer_one_in_motion() {
    let body = human::body();
    let coarse = simplify(&body, 2000);
    assert!(coarse.mesh.positions.len() <= 2000);
    let height = verify::height(&body.mesh.positions);
    let lower = verify::height(&coarse.mesh.positions);
    assert!((height - lower).abs() < 0.01);
    let mut random = Random(77);
    let mut local = body.skeleton.rest();
    for local in &mut local {
        local.rotation *= DQuat::from_rotation_x(random.unit() - 0.5);
    }
    let model = body.skeleton.model(&local);
    let (fine, _) = reference::skin::linear_blend(&body.mesh, &body.skin, &model);
    let (coarse_points, _) = reference::skin::linear_blend(&coarse.mesh, &coarse.skin, &model);
    // Volumes by the divergence theorem: what simplification shrank.
    let volume = |points: &[DVec3], triangles: &[[u32; 3]]| -> f64 {
        let of = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            a.cross(b).dot(c) / 6.0
        };
        triangles.iter().map(of).sum()
    };
    let (before, after) = (
        volume(&fine, &body.mesh.triangles),
        volume(&coarse_points, &coarse.mesh.triangles),
    );
    println!(
        "volume {before:.5} to {after:.5} m3, {:.2} mm",
        1e3 * coarse.error
    );
    assert!((before - after).abs() < 0.02 * before.abs());
    for influences in &coarse.skin.influences {
        let sum: f64 = influences.iter().map(|&(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-9);
    }
}

/// Damage that the checksum would hide, in an asset with everything.
#[test]
fn flips_in_packed_assets_with_levels_are_refused_or_harmless() {
    let bytes = bake(&dressed_arm(), &options(true, &[40]))
        .expect("bakes")
        .bytes;
    let mut random = Random(13);
    let (mut refused, mut harmless) = (0, 0);
    for _ in 0..3000 {
        let mut damaged = bytes.as_slice().to_vec();
        let at = 20 + random.below(damaged.len() - 20);
        damaged[at] ^= 1 << random.below(8);
        let checksum = crc32(&damaged[20..]);
        damaged[16..20].copy_from_slice(&checksum.to_le_bytes());
        match AssetBytes::new(&damaged).asset() {
            Err(_) => refused += 1,
            Ok(asset) => {
                all_finite(&asset);
                harmless += 1;
            }
        }
    }
    assert!(refused > 300 && harmless > 300, "{refused} {harmless}");
}

fn all_finite(asset: &Asset<'_>) {
    for index in 0..asset.level_count() {
        let level = asset.level(index).expect("a checked level");
        for mode in [SkinMode::Linear, SkinMode::DualQuaternion] {
            let mut player = Player::new(level)
                .with_modes(mode, NormalMode::InverseTranspose)
                .expect("no centres needed");
            player.step(&Input::Clip {
                index: 0,
                seconds: 0.3,
                looped: true,
            });
            let numbers = player.positions().iter().chain(player.normals()).flatten();
            assert!(
                numbers
                    .chain(player.tangents().as_flattened())
                    .all(|x| x.is_finite())
            );
        }
    }
}
