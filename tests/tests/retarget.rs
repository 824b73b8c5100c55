//! Captured motions on the bundled body.

use std::path::Path;

use glam::{DQuat, DVec3};
use sinew_host::fit::{
    Correspondence, Drive, FitError, Humanoid, Options, Part, Retargeted, Role, Side, Which, floor,
    retarget,
};
use sinew_host::import::{BvhOptions, gltf::read_gltf, read_bvh_with};
use sinew_host::model::{Avatar, Channel, Clip, Motion, Skeleton};
use sinew_host::reference::pose::{model, sample};
use sinew_host::reference::skin::linear_blend;
use sinew_tests::{root, shared};

fn avatar(name: &str) -> Avatar {
    let path = root().join("examples/data").join(name);
    let bytes = std::fs::read(&path).unwrap();
    let raw = read_gltf(&bytes, name, path.parent().unwrap()).unwrap();
    Avatar::new(raw, name).unwrap().0
}

fn motion(path: &Path, options: &BvhOptions) -> Motion {
    let bytes = std::fs::read(path).unwrap();
    let name = path.file_name().unwrap().to_string_lossy();
    Motion::new(read_bvh_with(&bytes, &name, options).unwrap(), &name)
        .unwrap()
        .0
}

fn bundled(name: &str) -> Motion {
    motion(
        &root().join("examples/data").join(name),
        &BvhOptions::default(),
    )
}

fn carry(motion: &Motion, target: &Skeleton, options: &Options) -> (Correspondence, Retargeted) {
    let both = Correspondence::new(&motion.skeleton, target, &[]).unwrap();
    let result = retarget(motion, target, &both, options).unwrap();
    (both, result)
}

/// Model-space rotations and positions at a time.
fn pose(skeleton: &Skeleton, clip: &Clip, seconds: f64) -> (Vec<DQuat>, Vec<DVec3>) {
    let local = sample(skeleton, clip, seconds);
    let mut rotations: Vec<DQuat> = Vec::new();
    for (joint, local) in skeleton.joints.iter().zip(&local) {
        let above = joint
            .parent
            .map_or(DQuat::IDENTITY, |parent| rotations[parent]);
        rotations.push(above * local.rotation);
    }
    let positions = skeleton
        .model(&local)
        .iter()
        .map(|affine| affine.translation)
        .collect();
    (rotations, positions)
}

fn times(clip: &Clip) -> Vec<f64> {
    clip.tracks
        .iter()
        .max_by_key(|track| track.times.len())
        .unwrap()
        .times
        .clone()
}

/// Signed angle of the part of `rotation` that turns about `axis`, degrees from -180 to 180.
fn twist(rotation: DQuat, axis: DVec3) -> f64 {
    let angle = 2.0 * rotation.xyz().dot(axis).atan2(rotation.w);
    (angle.to_degrees() + 180.0).rem_euclid(360.0) - 180.0
}

/// How far the shoulders of the bundled body (whose rest rotations are all the identity) turn in
/// a clip, degrees: the upper arm about itself relative to the clavicle, inward positive; and the
/// clavicle relative to the chest.
fn shoulders(skeleton: &Skeleton, clip: &Clip) -> [(f64, f64); 2] {
    assert!(
        skeleton
            .joints
            .iter()
            .all(|joint| joint.rest.rotation == DQuat::IDENTITY)
    );
    let human = Humanoid::new(skeleton, Which::Target).unwrap();
    let mut ranges = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    for time in times(clip) {
        let (rotations, _) = pose(skeleton, clip, time);
        for (side, inward) in [(Side::Left, 1.0), (Side::Right, -1.0)] {
            let [clavicle, arm, elbow] = [Part::Shoulder, Part::UpperArm, Part::LowerArm]
                .map(|part| human.limb(side, part).unwrap());
            let chest = skeleton.joints[clavicle].parent.unwrap();
            let relative = |a: usize, b: usize| rotations[a].inverse() * rotations[b];
            let axis = skeleton.joints[elbow].rest.translation.normalize();
            let turn = relative(chest, clavicle).angle_between(DQuat::IDENTITY);
            let values = [
                inward * twist(relative(clavicle, arm), axis),
                turn.to_degrees(),
            ];
            for (range, value) in ranges.iter_mut().zip(values) {
                *range = (range.0.min(value), range.1.max(value));
            }
        }
    }
    ranges
}

/// Largest distance between the unit directions of a limb bone in the source and in the target.
fn limb_difference(
    motion: &Motion,
    target: &Skeleton,
    both: &Correspondence,
    result: &Retargeted,
) -> f64 {
    let bones = [
        (Part::UpperArm, Part::LowerArm),
        (Part::LowerArm, Part::Hand),
        (Part::UpperLeg, Part::LowerLeg),
        (Part::LowerLeg, Part::Foot),
    ];
    let turn = DQuat::from_rotation_y(result.yaw);
    let mut worst: f64 = 0.0;
    for time in times(&result.clip).into_iter().step_by(7) {
        let (_, old) = pose(&motion.skeleton, &motion.clip, time);
        let (_, new) = pose(target, &result.clip, time);
        for (side, (part, next)) in [Side::Left, Side::Right]
            .into_iter()
            .flat_map(|s| bones.map(|b| (s, b)))
        {
            let bone = |human: &Humanoid, at: &[DVec3]| {
                Some((at[human.limb(side, next)?] - at[human.limb(side, part)?]).normalize())
            };
            let (Some(old), Some(new)) = (bone(&both.source, &old), bone(&both.target, &new))
            else {
                continue; // The walk's forearms end without a hand.
            };
            worst = worst.max((turn * old).distance(new));
        }
    }
    worst
}

#[test]
fn bundled_clips_keep_the_shoulders_straight() {
    let body = avatar("human.glb");
    // The knee is reached for with arms turned inward; walking turns them little.
    for (name, inward, outward) in [("walk.bvh", 30.0, -10.0), ("kneel.bvh", 90.0, 0.0)] {
        let motion = bundled(name);
        let (both, result) = carry(&motion, &body.skeleton, &Options::default());
        let [arm, clavicle] = shoulders(&body.skeleton, &result.clip);
        assert!(
            outward < arm.0 && arm.1 < inward,
            "{name}: upper arms turn {arm:?} degrees"
        );
        assert!(
            clavicle.1 < 5.0,
            "{name}: clavicles turn {clavicle:?} degrees"
        );
        assert!(
            limb_difference(&motion, &body.skeleton, &both, &result) < 1e-9,
            "{name}"
        );
    }
}

#[test]
fn the_walk_stays_on_the_floor() {
    let body = avatar("human.glb");
    let motion = bundled("walk.bvh");
    let (both, level) = carry(&motion, &body.skeleton, &Options::default());
    let lift = floor::lift(&body, &both.target, &level.clip).unwrap();
    let options = Options {
        lift,
        ..Options::default()
    };
    let (_, result) = carry(&motion, &body.skeleton, &options);
    let walked = times(&result.clip);
    let end = walked[walked.len() - 1];
    for &time in &walked {
        let palette = model(&body.skeleton, &sample(&body.skeleton, &result.clip, time));
        let (points, _) = linear_blend(&body.mesh, &body.skin, &palette);
        let lowest = points
            .iter()
            .fold(f64::INFINITY, |lowest, point| lowest.min(point.y));
        let highest = points
            .iter()
            .fold(f64::NEG_INFINITY, |highest, point| highest.max(point.y));
        assert!(
            lowest.abs() < 0.01,
            "at {time} s the lowest point is at {lowest} m"
        );
        assert!(highest > 1.6, "at {time} s the head is at {highest} m");
    }
    let hips = both.target.hips;
    let [start, end] = [0.0, end].map(|time| pose(&body.skeleton, &result.clip, time).1[hips]);
    assert!(
        (end - start).z > 4.0 && (end - start).x.abs() < 0.2,
        "from {start} to {end}"
    );
}

#[test]
fn every_humanoid_recording_moves_every_limb() {
    let body = avatar("human.glb");
    // File, whether Z is up in it, whether it has toes.
    for (name, z_up, toes) in [
        ("cmu_01_01.bvh", false, true),
        ("cmu_12_01_walk.bvh", false, true),
        ("mocapbank_crlf.bvh", false, false),
        ("mixamo_tabs_freebvh.bvh", false, true),
        ("yxz_test2.bvh", false, true),
        ("mh_benchmark_pose.bvh", true, false),
        ("mh_face_poseunits.bvh", true, false),
    ] {
        let Some(path) = shared(&format!("bvh/{name}")) else {
            continue;
        };
        let motion = motion(
            &path,
            &BvhOptions {
                z_up,
                ..BvhOptions::default()
            },
        );
        let (both, result) = carry(&motion, &body.skeleton, &Options::default());
        let missing: Vec<Role> = [Side::Left, Side::Right]
            .into_iter()
            .filter(|_| !toes)
            .map(|side| Role::Limb(side, Part::Toes))
            .collect();
        assert_eq!(both.unmapped_limbs(), missing, "{name}");
        for chain in [&both.target.spine, &both.target.neck] {
            assert!(
                chain.iter().all(|&joint| both.drives[joint].is_some()),
                "{name}"
            );
        }
        assert!(
            limb_difference(&motion, &body.skeleton, &both, &result) < 1e-9,
            "{name}"
        );
        let [arm, clavicle] = shoulders(&body.skeleton, &result.clip);
        assert!(
            -90.0 < arm.0 && arm.1 < 90.0,
            "{name}: upper arms turn {arm:?} degrees"
        );
        assert!(
            clavicle.1 < 45.0,
            "{name}: clavicles turn {clavicle:?} degrees"
        );
        assert!(
            (0.9..1.2).contains(&result.scale),
            "{name}: scale {}",
            result.scale
        );
        assert!(result.yaw.abs() < 0.02, "{name}: yaw {}", result.yaw);
    }
}

#[test]
fn a_recording_onto_its_own_skeleton_is_unchanged() {
    for name in [
        "cmu_12_01_walk.bvh",
        "mixamo_tabs_freebvh.bvh",
        "mocapbank_crlf.bvh",
    ] {
        let Some(path) = shared(&format!("bvh/{name}")) else {
            continue;
        };
        let motion = motion(&path, &BvhOptions::default());
        let options = Options {
            keep_origin: true,
            ..Options::default()
        };
        let (both, result) = carry(&motion, &motion.skeleton, &options);
        let own = |(joint, drive): (usize, &Option<Drive>)| *drive == Some(Drive::Joint(joint));
        assert!(both.drives.iter().enumerate().all(own), "{name}");
        for time in times(&motion.clip) {
            let (old, old_places) = pose(&motion.skeleton, &motion.clip, time);
            let (new, new_places) = pose(&motion.skeleton, &result.clip, time);
            for (old, new) in old.iter().zip(&new) {
                assert!(1.0 - old.dot(*new).abs() < 1e-12, "{name} at {time} s");
            }
            for (old, new) in old_places.iter().zip(&new_places) {
                assert!(
                    old.distance(*new) < 1e-12,
                    "{name} at {time} s: {old} {new}"
                );
            }
        }
    }
}

#[test]
fn the_unit_of_the_recording_does_not_matter() {
    let body = avatar("human.glb");
    let path = root().join("examples/data/walk.bvh");
    let [small, large] = [0.01, 1.0].map(|unit| {
        let unit_metres = Some(unit);
        let motion = motion(
            &path,
            &BvhOptions {
                unit_metres,
                ..BvhOptions::default()
            },
        );
        carry(&motion, &body.skeleton, &Options::default()).1
    });
    assert!((small.scale - 100.0 * large.scale).abs() < 1e-10);
    assert_eq!(small.clip.tracks.len(), large.clip.tracks.len());
    for (a, b) in small.clip.tracks.iter().zip(&large.clip.tracks) {
        assert_eq!((a.joint, a.channel), (b.joint, b.channel));
        let values = a.values.iter().flatten().zip(b.values.iter().flatten());
        assert!(values.into_iter().all(|(a, b)| (a - b).abs() < 1e-12));
    }
    assert!(
        small
            .clip
            .tracks
            .iter()
            .any(|track| track.channel == Channel::Translation)
    );
}

#[test]
fn what_is_no_human_is_refused() {
    let body = avatar("human.glb");
    let hand = avatar("hand.glb");
    let walk = bundled("walk.bvh");
    let error = Correspondence::new(&walk.skeleton, &hand.skeleton, &[]).unwrap_err();
    assert!(
        matches!(
            error,
            FitError::MissingRole {
                which: Which::Target,
                ..
            }
        ),
        "{error}"
    );
    for name in ["rotation_first_root.bvh", "full_precision_frame_time.bvh"] {
        let Some(path) = shared(&format!("bvh/{name}")) else {
            continue;
        };
        let motion = motion(&path, &BvhOptions::default());
        let error = Correspondence::new(&motion.skeleton, &body.skeleton, &[]).unwrap_err();
        assert!(
            matches!(
                error,
                FitError::MissingRole {
                    which: Which::Source,
                    ..
                }
            ),
            "{error}"
        );
    }
    // Read with the wrong axis up, the body lies on the floor.
    let Some(path) = shared("bvh/mh_benchmark_pose.bvh") else {
        return;
    };
    let lying = motion(&path, &BvhOptions::default());
    let both = Correspondence::new(&lying.skeleton, &body.skeleton, &[]).unwrap();
    let error = retarget(&lying, &body.skeleton, &both, &Options::default()).unwrap_err();
    assert!(
        matches!(
            error,
            FitError::NotUpright {
                which: Which::Source,
                ..
            }
        ),
        "{error}"
    );
}
