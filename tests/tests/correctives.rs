//! Correctives: flesh that follows a skeleton, from learning to the asset and back.

use glam::{DAffine3, DQuat, DVec3};
use sinew_core::Level;
use sinew_core::asset::crc32;
use sinew_core::frame::Input;
use sinew_core::pose::Transform;
use sinew_host::bake::{Additions, AssetBytes, BakeOptions, bake, bake_adding};
use sinew_host::fit::correctives::{Correctives, Performed, learn, pose::pose};
use sinew_host::fit::parts::{Glued, PartsFitError};
use sinew_host::model::Avatar;
use sinew_host::play::Player;
use sinew_host::reference::correctives::Flesh;
use sinew_tests::Random;
use sinew_tests::laplacian::{baseline, jointed_tube, on_tube};

const RINGS: u32 = 31;
const SIDES: u32 = 16;
const RATE: f64 = 60.0;

/// A tube of 0.6 m with an elbow; its lower half bulges with the bend, its upper half swings.
struct Arm {
    body: Avatar,
    glued: Vec<Glued>,
    rest: Vec<DVec3>,
}

/// How an arm moves: phases of bend and shake.
#[derive(Clone, Copy)]
struct Motion {
    bend: f64,
    shake: f64,
}

const LEARNT: Motion = Motion {
    bend: 1.3,
    shake: 7.0,
};
const HELD_OUT: Motion = Motion {
    bend: 2.1,
    shake: 9.5,
};

impl Arm {
    fn new() -> Self {
        let body = jointed_tube(RINGS, SIDES, 0.25, 0.1);
        let markers = (0..RINGS - 1).step_by(2).flat_map(|ring| {
            // Rows of four, every second row turned by half.
            (0..4).map(move |side| ring * SIDES + (4 * side + 2 * (ring / 2 % 2)) % SIDES)
        });
        let glued: Vec<Glued> = markers.map(|vertex| on_tube(vertex, SIDES)).collect();
        let positions = &body.mesh.positions;
        let rest = glued.iter().map(|marker| marker.on(positions)).collect();
        Self { body, glued, rest }
    }

    /// `[frames]`: poses and true surfaces.
    fn perform(&self, motion: Motion, seconds: f64) -> (Vec<Vec<DAffine3>>, Vec<Vec<DVec3>>) {
        let (mut poses, mut surfaces) = (Vec::new(), Vec::new());
        let (mut swing, mut speed, mut places) = (0.0, 0.0, [0.0; 2]);
        for frame in 0..(seconds * RATE) as usize {
            let time = frame as f64 / RATE;
            // It begins at rest.
            let fade = (time / 0.5).min(1.0);
            let angle = fade * (0.9 * (motion.bend * time).sin() + 0.3 * (0.7 * time).cos());
            let place = fade * 0.04 * (motion.shake * time).sin();
            let acceleration = (place - 2.0 * places[1] + places[0]) * RATE * RATE;
            places = [places[1], place];
            let acceleration = if frame < 2 { 0.0 } else { acceleration };
            // Four steps a frame of a spring of 4 Hz.
            for _ in 0..4 {
                let (step, w) = (0.25 / RATE, 25.0);
                speed += step * (-acceleration - w * w * swing - 2.0 * 0.2 * w * speed);
                swing += step * speed;
            }
            let root = DAffine3::from_translation(DVec3::X * place);
            let elbow =
                DAffine3::from_rotation_translation(DQuat::from_rotation_z(angle), DVec3::Y * 0.3);
            let pose = vec![root, root * elbow];
            let bulge = 0.012 * (angle / 2.0).sin().powi(2);
            let mesh = self.body.mesh.positions.iter().zip(&self.body.mesh.normals);
            let surface = mesh.zip(&self.body.skin.influences).map(|((&p, &n), row)| {
                let near = |height: f64| (-((p.y - height) / 0.07).powi(2)).exp();
                let p = p + n * (bulge * near(0.13)) + DVec3::X * (swing * near(0.45));
                let of = |&(bind, weight): &(u32, f64)| {
                    let bind = &self.body.skin.binds[bind as usize];
                    weight * (pose[bind.joint] * bind.inverse_bind).transform_point3(p)
                };
                row.iter().map(of).sum::<DVec3>()
            });
            surfaces.push(surface.collect());
            poses.push(pose);
        }
        (poses, surfaces)
    }

    fn performed(&self, motion: Motion, seconds: f64) -> Performed {
        let (poses, surfaces) = self.perform(motion, seconds);
        let markers = |surface: &Vec<DVec3>| self.glued.iter().map(|m| m.on(surface)).collect();
        Performed {
            rate: RATE,
            poses,
            markers: surfaces.iter().map(markers).collect(),
        }
    }

    fn glued(&self) -> (&[Glued], &[DVec3]) {
        (&self.glued, &self.rest)
    }

    fn learnt(&self) -> Correctives {
        let performed = self.performed(LEARNT, 14.0);
        learn(&self.body, self.glued(), &[performed]).expect("learns")
    }

    fn baked(&self, learnt: &Correctives, levels: &[usize]) -> AssetBytes {
        let additions = Additions {
            correctives: Some(&learnt.data),
            ..Additions::default()
        };
        let options = BakeOptions {
            levels: levels.to_vec(),
            ..BakeOptions::default()
        };
        let body = learnt.on(&self.body);
        bake_adding(&body, &options, &additions)
            .expect("bakes")
            .bytes
    }
}

/// Local transforms of an arm.
fn local(pose: &[DAffine3]) -> Vec<Transform> {
    let upper = pose[0].inverse() * pose[1];
    let all = [pose[0], upper].map(|matrix| {
        let (_, rotation, translation) = matrix.to_scale_rotation_translation();
        Transform {
            rotation: rotation.as_quat(),
            translation: translation.as_vec3(),
            ..Transform::IDENTITY
        }
    });
    all.to_vec()
}

fn mean_distance(found: &[[f32; 3]], truth: &[DVec3]) -> f64 {
    let off = found
        .iter()
        .zip(truth)
        .map(|(a, b)| DVec3::from_array(a.map(f64::from)).distance(*b));
    off.sum::<f64>() / truth.len() as f64
}

#[test]
fn flesh_is_learnt_and_follows_motion_that_was_not() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    let [before, after] = learnt.held_out;
    println!("at markers, held out: {before:.6} m, {after:.6} m left");
    assert!(after < 0.4 * before);
    let bytes = arm.baked(&learnt, &[]);
    let plain = bake(&arm.body, &BakeOptions::default())
        .expect("bakes")
        .bytes;
    let mut player = Player::new(bytes.asset().expect("sound"));
    let mut skeleton = Player::new(plain.asset().expect("sound"));
    let (poses, surfaces) = arm.perform(HELD_OUT, 6.0);
    let (mut with, mut alone, mut normals) = (0.0, 0.0, 0.0);
    for (pose, surface) in poses.iter().zip(&surfaces) {
        let pose = local(pose);
        player.set_elapsed(1.0 / RATE);
        player.step(&Input::Pose(&pose));
        skeleton.step(&Input::Pose(&pose));
        with += mean_distance(player.positions(), surface);
        alone += mean_distance(skeleton.positions(), surface);
        normals += normal_error(&player, &arm.body.mesh.triangles) / poses.len() as f64;
    }
    println!("skeleton alone {alone}, with correctives {with}; normals {normals:.2} degrees off");
    assert!(with < 0.4 * alone, "{with} {alone}");
    assert!(normals < 2.0, "{normals}");
}

/// Mean angle between normals and those of the triangles around, without the rims; degrees.
fn normal_error(player: &Player<'_>, triangles: &[[u32; 3]]) -> f64 {
    let at = |v: u32| DVec3::from_array(player.positions()[v as usize].map(f64::from));
    let mut sums = vec![DVec3::ZERO; player.positions().len()];
    for &[a, b, c] in triangles {
        let normal = (at(b) - at(a)).cross(at(c) - at(a));
        for v in [a, b, c] {
            sums[v as usize] += normal;
        }
    }
    let inner = (2 * SIDES) as usize..((RINGS - 2) * SIDES) as usize;
    let count = inner.len() as f64;
    let angle = |v: usize| {
        let normal = DVec3::from_array(player.normals()[v].map(f64::from));
        normal.angle_between(sums[v]).to_degrees()
    };
    inner.map(angle).sum::<f64>() / count
}

#[test]
fn the_core_agrees_with_the_oracle_and_with_itself_at_every_level() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    let bytes = arm.baked(&learnt, &[]);
    let asset = bytes.asset().expect("sound");
    let mut flesh = Flesh::new(asset.corrective().expect("has correctives"));
    let levels = [Level::best(), Level::Scalar, Level::Simd(baseline())];
    let mut players = levels.map(|level| Player::new(asset).with_level(level));
    let (poses, _) = arm.perform(HELD_OUT, 3.0);
    let mut worst = 0.0_f64;
    for pose in &poses {
        let palette: Vec<DAffine3> = arm
            .body
            .skin
            .binds
            .iter()
            .map(|bind| pose[bind.joint] * bind.inverse_bind)
            .collect();
        let expected = flesh.step(&palette, 1.0 / RATE);
        let pose = local(pose);
        for player in &mut players {
            player.set_elapsed(1.0 / RATE);
            player.step(&Input::Pose(&pose));
        }
        let weights = players[0].morph_weights();
        assert_eq!(weights.len(), expected.len());
        for (found, expected) in weights.iter().zip(&expected) {
            worst = worst.max((f64::from(*found) - expected).abs());
        }
        let bits = |player: &Player<'_>| -> Vec<u32> {
            let rows = player.positions().iter().chain(player.normals()).flatten();
            rows.map(|x| x.to_bits()).collect()
        };
        assert_eq!(bits(&players[0]), bits(&players[1]));
        assert_eq!(bits(&players[0]), bits(&players[2]));
    }
    println!("weights within {worst:e}");
    // Weights of one are offsets of millimetres.
    assert!(worst < 2e-3, "{worst}");
}

#[test]
fn unusable_input_holds_and_what_follows_is_not_spoilt() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    let bytes = arm.baked(&learnt, &[]);
    let mut player = Player::new(bytes.asset().expect("sound"));
    let (poses, surfaces) = arm.perform(LEARNT, 2.0);
    let hostile = [f32::NAN, 1e30, f32::INFINITY, -1e9];
    for (at, pose) in poses.iter().enumerate() {
        let mut pose = local(pose);
        if at < 60 {
            pose[at % 2].translation.x = hostile[at % 4];
            player.set_elapsed([1.0 / RATE, f64::NAN, 1e9, -1.0][at / 2 % 4]);
        } else {
            player.set_elapsed(1.0 / RATE);
        }
        player.step(&Input::Pose(&pose));
        let all = player.positions().iter().chain(player.normals()).flatten();
        assert!(all.clone().all(|x| x.is_finite()), "{at}");
    }
    let error = mean_distance(player.positions(), &surfaces[surfaces.len() - 1]);
    assert!(error < 1e-3, "{error}");
}

#[test]
fn coarser_levels_have_correctives_too() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    let bytes = arm.baked(&learnt, &[200]);
    let whole = bytes.asset().expect("sound");
    let level = whole.level(1).expect("two levels");
    assert_eq!(level.dims().correctives, whole.dims().correctives);
    let (poses, _) = arm.perform(HELD_OUT, 1.5);
    let [mut fine, mut coarse] = [whole, level].map(Player::new);
    for pose in &poses {
        for player in [&mut fine, &mut coarse] {
            player.step(&Input::Pose(&local(pose)));
        }
        assert_eq!(fine.morph_weights(), coarse.morph_weights());
    }
    assert!(
        fine.morph_weights()
            .iter()
            .any(|weight| weight.abs() > 0.05)
    );
}

#[test]
fn flipped_bits_of_correctives_are_refused_or_harmless() {
    let arm = Arm::new();
    let learnt = arm.learnt();
    let sound = arm.baked(&learnt, &[]).as_slice().to_vec();
    assert_eq!(
        sound,
        arm.baked(&learnt, &[]).as_slice(),
        "the same input, the same bytes"
    );
    let (poses, _) = arm.perform(LEARNT, 0.1);
    let tables = bake(&arm.body, &BakeOptions::default())
        .expect("bakes")
        .bytes;
    let mut random = Random(5);
    for round in 0..200 {
        let mut bytes = sound.clone();
        // Half of them where the correctives' tables are: behind all else.
        let from = if round % 2 == 0 {
            32
        } else {
            tables.as_slice().len()
        };
        let at = from + random.below(bytes.len() - from);
        bytes[at] ^= 1 << random.below(8);
        let checksum = crc32(&bytes[20..]);
        bytes[16..20].copy_from_slice(&checksum.to_le_bytes());
        let bytes = AssetBytes::new(&bytes);
        if let Ok(asset) = bytes.asset() {
            let mut player = Player::new(asset);
            for pose in &poses {
                player.step(&Input::Pose(&local(pose)));
            }
            let all = player.positions().iter().flatten();
            assert!(all.clone().all(|x| x.is_finite()), "byte {at}");
        }
    }
}

#[test]
fn the_skeleton_is_found_under_the_markers() {
    let arm = Arm::new();
    let performed = arm.performed(LEARNT, 4.0);
    let found = pose(&arm.body, arm.glued(), &performed.markers);
    let mut worst = (0.0_f64, 0.0_f64);
    for (found, truth) in found.poses.iter().zip(&performed.poses) {
        for (a, b) in found.iter().zip(truth) {
            let off = a.translation.distance(b.translation);
            let turn = (a.inverse() * *b).to_scale_rotation_translation().1;
            let turn = turn.to_axis_angle().1.to_degrees();
            worst = (worst.0.max(off), worst.1.max(turn.min(360.0 - turn)));
        }
    }
    println!(
        "joints within {:.2} mm and {:.2} degrees",
        1e3 * worst.0,
        worst.1
    );
    // The flesh moves by up to 12 mm.
    assert!(worst.0 < 3e-3 && worst.1 < 2.0, "{worst:?}");
}

#[test]
fn too_little_is_said() {
    let arm = Arm::new();
    let short = arm.performed(LEARNT, 2.0);
    let error = learn(&arm.body, arm.glued(), &[short]).expect_err("too short");
    assert!(
        matches!(error, PartsFitError::TooFew { found: 2, .. }),
        "{error}"
    );
    let few = (&arm.glued[..5], &arm.rest[..5]);
    let error = learn(&arm.body, few, &[]).expect_err("too few");
    assert!(
        matches!(error, PartsFitError::TooFew { found: 5, .. }),
        "{error}"
    );
}
