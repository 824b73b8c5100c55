use std::f64::consts::FRAC_PI_2;

use super::*;
use crate::model::{Joint, Transform};

/// Name, parent, offset from it in a body whose arms hang `down` radians below the horizontal.
fn joints(down: f64) -> Vec<(&'static str, usize, DVec3)> {
    let arm = |x: f64| DVec3::new(x * down.cos(), -0.3 * down.sin(), 0.0);
    vec![
        ("Hips", 0, DVec3::new(0.0, 1.0, 0.0)),
        ("Chest", 0, DVec3::new(0.0, 0.4, -0.05)),
        ("Head", 1, DVec3::new(0.0, 0.3, 0.05)),
        ("LeftUpLeg", 0, DVec3::new(0.1, -0.05, 0.0)),
        ("LeftLeg", 3, DVec3::new(0.0, -0.45, 0.0)),
        ("LeftFoot", 4, DVec3::new(0.0, -0.4, 0.0)),
        ("LeftToeBase", 5, DVec3::new(0.0, -0.08, 0.15)),
        ("RightUpLeg", 0, DVec3::new(-0.1, -0.05, 0.0)),
        ("RightLeg", 7, DVec3::new(0.0, -0.45, 0.0)),
        ("RightFoot", 8, DVec3::new(0.0, -0.4, 0.0)),
        ("RightToeBase", 9, DVec3::new(0.0, -0.08, 0.15)),
        ("LeftShoulder", 1, DVec3::new(0.03, 0.2, 0.02)),
        ("LeftArm", 11, DVec3::new(0.15, 0.0, 0.0)),
        ("LeftForeArm", 12, arm(0.3)),
        ("LeftHand", 13, arm(0.3)),
        ("RightShoulder", 1, DVec3::new(-0.03, 0.2, 0.02)),
        ("RightArm", 15, DVec3::new(-0.15, 0.0, 0.0)),
        ("RightForeArm", 16, arm(-0.3)),
        ("RightHand", 17, arm(-0.3)),
    ]
}

/// The body above with every joint's frame turned in model space by `frame(joint)`.
fn body(down: f64, frame: impl Fn(usize) -> DQuat) -> Skeleton {
    let joint = |(at, &(name, parent, offset)): (usize, &(&str, usize, DVec3))| {
        let above = if at == 0 {
            DQuat::IDENTITY
        } else {
            frame(parent)
        };
        Joint {
            name: name.into(),
            parent: (at > 0).then_some(parent),
            rest: Transform {
                translation: above.inverse() * offset,
                rotation: above.inverse() * frame(at),
                scale: DVec3::ONE,
            },
        }
    };
    Skeleton {
        joints: joints(down).iter().enumerate().map(joint).collect(),
    }
}

fn plain(down: f64) -> Skeleton {
    body(down, |_| DQuat::IDENTITY)
}

/// A repeatable rotation of up to 40 degrees about some axis.
fn some_rotation(seed: usize) -> DQuat {
    let wave = |k: f64| (seed as f64 * k + 0.5 * k).sin();
    let axis = DVec3::new(wave(1.7), wave(2.3), wave(3.1) + 0.1).normalize();
    DQuat::from_axis_angle(axis, 0.7 * wave(5.3))
}

/// A motion of `frames` frames; `turn(frame, joint)` is the local rotation in the rest frame.
fn motion(skeleton: Skeleton, frames: usize, turn: impl Fn(usize, usize) -> DQuat) -> Motion {
    let times: Vec<f64> = (0..frames).map(|frame| frame as f64 / 30.0).collect();
    let mut tracks = Vec::new();
    for (at, joint) in skeleton.joints.iter().enumerate() {
        let track = |channel, values| Track {
            joint: at,
            channel,
            interpolation: Interpolation::Linear,
            times: times.clone(),
            values,
        };
        if at == 0 {
            let root = joint.rest.translation;
            let step = root.length() * DVec3::new(0.1, 0.01, 0.2);
            let place = |frame: usize| (root + frame as f64 * step).extend(0.0).to_array();
            tracks.push(track(
                Channel::Translation,
                (0..frames).map(place).collect(),
            ));
        }
        let value = |frame| (joint.rest.rotation * turn(frame, at)).to_array();
        tracks.push(track(Channel::Rotation, (0..frames).map(value).collect()));
    }
    let clip = Clip {
        name: "clip".into(),
        tracks,
        morph_track: None,
        duration: times[frames - 1],
        sample_period: Some(1.0 / 30.0),
    };
    Motion {
        skeleton,
        end_sites: Vec::new(),
        clip,
    }
}

fn run(motion: &Motion, target: &Skeleton, options: &Options) -> Result<Retargeted, FitError> {
    let both = Correspondence::new(&motion.skeleton, target, &[])?;
    retarget(motion, target, &both, options)
}

fn origin() -> Options {
    Options {
        keep_origin: true,
        ..Options::default()
    }
}

/// Model-space pose at a frame.
fn at(skeleton: &Skeleton, clip: &Clip, frame: usize) -> Pose {
    Pose::new(skeleton, &sample(skeleton, clip, frame as f64 / 30.0))
}

const LIMBS: [(usize, usize); 8] = [
    (3, 4),
    (4, 5),
    (7, 8),
    (8, 9),
    (12, 13),
    (13, 14),
    (16, 17),
    (17, 18),
];

#[test]
fn a_motion_onto_its_own_skeleton_is_unchanged() {
    for frame in [|_| DQuat::IDENTITY, some_rotation] {
        let source = motion(body(0.3, frame), 5, |frame, joint| {
            some_rotation(31 * frame + joint)
        });
        let result = run(&source, &source.skeleton, &origin()).unwrap();
        assert!((result.scale - 1.0).abs() < 1e-15 && result.yaw == 0.0);
        assert_eq!(result.clip.tracks.len(), source.clip.tracks.len());
        for (new, old) in result.clip.tracks.iter().zip(&source.clip.tracks) {
            assert_eq!(
                (new.joint, new.channel, &new.times),
                (old.joint, old.channel, &old.times)
            );
            for (&new, &old) in new.values.iter().zip(&old.values) {
                let (new, old) = (glam::DVec4::from(new), glam::DVec4::from(old));
                let apart = (new - old).length().min((new + old).length());
                assert!(apart < 1e-12, "{apart}");
            }
        }
    }
}

#[test]
fn a_t_pose_becomes_the_rest_of_an_a_pose_without_twist() {
    // Frame 0: the T pose itself. Frame 1: the left arm hangs.
    let hang = DQuat::from_rotation_z(-FRAC_PI_2);
    let source = motion(plain(0.0), 2, |frame, joint| {
        if frame == 1 && joint == 12 {
            hang
        } else {
            DQuat::IDENTITY
        }
    });
    let quarter = FRAC_PI_2 / 2.0;
    let target = plain(quarter);
    let result = run(&source, &target, &origin()).unwrap();
    let (first, second) = (at(&target, &result.clip, 0), at(&target, &result.clip, 1));
    // The A pose is raised by 45 degrees, then lowered by 90: about z alone.
    for joint in [12, 13, 14] {
        assert!(first.rotations[joint].angle_between(DQuat::from_rotation_z(quarter)) < 1e-7);
        assert!(second.rotations[joint].angle_between(DQuat::from_rotation_z(-quarter)) < 1e-7);
    }
    assert!(
        first.rotations[11].angle_between(DQuat::IDENTITY) < 1e-7,
        "the clavicle"
    );
    let elbow = second.positions[13] - second.positions[12];
    assert!(
        elbow.distance(DVec3::new(0.0, -0.3, 0.0)) < 1e-12,
        "{elbow}"
    );
}

#[test]
fn limbs_point_where_the_source_points() {
    for (from, to) in [(0.0, 0.8), (0.8, 0.0), (1.5, 0.3)] {
        let source = motion(plain(from), 9, |frame, joint| {
            some_rotation(17 * frame + 5 * joint)
        });
        let target = body(to, some_rotation);
        let result = run(&source, &target, &origin()).unwrap();
        for frame in 0..9 {
            let (old, new) = (
                at(&source.skeleton, &source.clip, frame),
                at(&target, &result.clip, frame),
            );
            for (joint, next) in LIMBS {
                let bone = |pose: &Pose| (pose.positions[next] - pose.positions[joint]).normalize();
                assert!(
                    bone(&old).distance(bone(&new)) < 1e-9,
                    "frame {frame}, joint {joint}"
                );
            }
        }
    }
}

#[test]
fn joint_frames_do_not_matter() {
    let turn = |frame: usize, joint: usize| some_rotation(13 * frame + 3 * joint);
    let straight = motion(plain(0.2), 4, turn);
    // The same motion, told in turned frames.
    let turned = motion(body(0.2, some_rotation), 4, |frame, joint| {
        let own = some_rotation(joint);
        own.inverse() * turn(frame, joint) * own
    });
    let (target, other) = (plain(0.9), body(0.9, |joint| some_rotation(joint + 100)));
    let a = run(&straight, &target, &origin()).unwrap();
    let b = run(&turned, &other, &origin()).unwrap();
    for frame in 0..4 {
        let (a, b) = (at(&target, &a.clip, frame), at(&other, &b.clip, frame));
        for (a, b) in a.positions.iter().zip(&b.positions) {
            assert!(a.distance(*b) < 1e-12, "{a} {b}");
        }
    }
}

#[test]
fn neither_size_nor_heading_of_the_source_matters() {
    let turn = |frame: usize, joint: usize| some_rotation(7 * frame + joint);
    let source = motion(plain(0.0), 4, turn);
    let target = plain(0.9);
    let expected = run(&source, &target, &Options::default()).unwrap();
    assert!((expected.scale - 1.0).abs() < 1e-12);

    let mut large = source.clone();
    large
        .skeleton
        .joints
        .iter_mut()
        .for_each(|joint| joint.rest.translation *= 100.0);
    for track in large
        .clip
        .tracks
        .iter_mut()
        .filter(|t| t.channel == Channel::Translation)
    {
        track
            .values
            .iter_mut()
            .flatten()
            .for_each(|value| *value *= 100.0);
    }
    // A node above the hips turns the whole source to face +X.
    let mut sideways = source.clone();
    let mut stage = Joint {
        name: "Stage".into(),
        parent: None,
        rest: Transform::IDENTITY,
    };
    stage.rest.rotation = DQuat::from_rotation_y(FRAC_PI_2);
    for joint in &mut sideways.skeleton.joints {
        joint.parent = Some(joint.parent.map_or(0, |parent| parent + 1));
    }
    sideways.skeleton.joints.insert(0, stage);
    sideways
        .clip
        .tracks
        .iter_mut()
        .for_each(|track| track.joint += 1);

    for (other, scale, yaw) in [(large, 0.01, 0.0), (sideways, 1.0, -FRAC_PI_2)] {
        let result = run(&other, &target, &Options::default()).unwrap();
        assert!((result.scale - scale).abs() < 1e-12 && (result.yaw - yaw).abs() < 1e-12);
        for frame in 0..4 {
            let (a, b) = (
                at(&target, &expected.clip, frame),
                at(&target, &result.clip, frame),
            );
            for (a, b) in a.positions.iter().zip(&b.positions) {
                assert!(a.distance(*b) < 1e-12, "{a} {b}");
            }
        }
    }
}

#[test]
fn the_root_moves_by_leg_length() {
    let source = motion(plain(0.0), 3, |_, _| DQuat::IDENTITY);
    let mut target = plain(0.0);
    for joint in [4, 5, 8, 9] {
        target.joints[joint].rest.translation *= 2.0;
    }
    // The source's sockets start at (0, 0.95, 0) and move by (0.1, 0.01, 0.2) a frame.
    let kept = run(&source, &target, &origin()).unwrap();
    assert!((kept.scale - 2.0).abs() < 1e-12);
    let hips = |result: &Retargeted, frame| at(&target, &result.clip, frame).positions[0];
    assert!(hips(&kept, 2).distance(DVec3::new(0.4, 1.94 + 0.05, 0.8)) < 1e-12);
    let options = Options {
        lift: 0.5,
        ..Options::default()
    };
    let lifted = run(&source, &target, &options).unwrap();
    assert!(hips(&lifted, 0).distance(DVec3::new(0.0, 1.9 + 0.05 + 0.5, 0.0)) < 1e-12);
    assert!(hips(&lifted, 1).distance(DVec3::new(0.2, 1.92 + 0.05 + 0.5, 0.4)) < 1e-12);
    // Nothing but the root moves, so nothing else has a track.
    assert_eq!(lifted.clip.tracks.len(), 1);
}

#[test]
fn feet_turn_about_the_vertical_only() {
    let mut splayed = plain(0.0);
    let out = DQuat::from_rotation_y(0.2);
    splayed.joints[6].rest.translation = out * DVec3::new(0.0, -0.15, 0.1);
    let target = plain(0.0);
    let source = motion(splayed, 1, |_, _| DQuat::IDENTITY);
    let result = run(&source, &target, &origin()).unwrap();
    let first = at(&target, &result.clip, 0);
    assert!(
        first.rotations[5].angle_between(out) < 1e-7,
        "takes the heading, not the slope"
    );
    assert!(
        first.rotations[6].angle_between(out) < 1e-7,
        "the toes go along"
    );
    assert!(first.rotations[9].angle_between(DQuat::IDENTITY) < 1e-7);
    // An ankle that ends straight below itself has no heading.
    let mut source = source;
    source.skeleton.joints[6].rest.translation = DVec3::new(0.0, -0.1, 0.0);
    let result = run(&source, &target, &origin()).unwrap();
    let first = at(&target, &result.clip, 0);
    assert!(first.rotations[5].angle_between(DQuat::IDENTITY) < 1e-7);
}

#[test]
fn a_crooked_rest_pose_needs_a_reference_frame() {
    // At rest the body lies on its back; in frame 0 it stands.
    let mut lying = plain(0.0);
    lying.joints[0].rest.rotation = DQuat::from_rotation_x(-FRAC_PI_2);
    let stand = lying.joints[0].rest.rotation.inverse();
    let source = motion(lying, 3, |frame, joint| {
        let more = if frame == 0 {
            DQuat::IDENTITY
        } else {
            some_rotation(frame + 3 * joint)
        };
        if joint == 0 { stand * more } else { more }
    });
    let target = plain(0.0);
    let error = run(&source, &target, &Options::default()).unwrap_err();
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
    let options = Options {
        reference: Reference::Frame(0),
        ..origin()
    };
    let result = run(&source, &target, &options).unwrap();
    for frame in 0..3 {
        let (old, new) = (
            at(&source.skeleton, &source.clip, frame),
            at(&target, &result.clip, frame),
        );
        for (a, b) in old.positions.iter().zip(&new.positions) {
            assert!(a.distance(*b) < 1e-12, "frame {frame}: {a} {b}");
        }
    }
    let options = Options {
        reference: Reference::Frame(3),
        ..origin()
    };
    let error = run(&source, &target, &options).unwrap_err();
    assert_eq!(error, FitError::NoSuchFrame { frame: 3, count: 3 });
}

#[test]
fn signs_are_continuous_through_a_full_turn() {
    let source = motion(plain(0.0), 40, |frame, joint| {
        let angle = if joint == 0 { 0.2 * frame as f64 } else { 0.0 };
        DQuat::from_rotation_y(angle)
    });
    let result = run(&source, &plain(0.4), &Options::default()).unwrap();
    for track in result
        .clip
        .tracks
        .iter()
        .filter(|t| t.channel == Channel::Rotation)
    {
        for pair in track.values.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(DQuat::from_array);
            assert!(a.dot(b) > 0.9 && (a.length() - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn unevenly_keyed_motion_is_sampled_evenly() {
    let mut source = motion(plain(0.0), 2, |frame, joint| some_rotation(frame * joint));
    source.clip.sample_period = None;
    for track in &mut source.clip.tracks {
        track.times[1] = 0.09 + 0.01 * (track.joint % 2) as f64;
    }
    source.clip.duration = 0.1;
    let result = run(&source, &plain(0.5), &Options::default()).unwrap();
    let times = &result.clip.tracks[0].times;
    assert_eq!((times.len(), times[1], times[6]), (7, 1.0 / 60.0, 0.1));
    source.clip.duration = 1e9;
    let error = run(&source, &plain(0.5), &Options::default()).unwrap_err();
    assert!(matches!(error, FitError::TooLong { .. }));
    source.clip.tracks.clear();
    assert!(
        run(&source, &plain(0.5), &Options::default()).is_ok(),
        "no motion: one frame at rest"
    );
}

#[test]
fn impossible_bodies_are_refused() {
    let source = motion(plain(0.0), 1, |_, _| DQuat::IDENTITY);
    let mut point = plain(0.0);
    point
        .joints
        .iter_mut()
        .for_each(|joint| joint.rest.translation = DVec3::ZERO);
    let no_facing = FitError::NoFacing {
        which: Which::Target,
    };
    assert_eq!(
        run(&source, &point, &Options::default()).unwrap_err(),
        no_facing
    );
    let mut legless = plain(0.0);
    for joint in [4, 5, 8, 9] {
        legless.joints[joint].rest.translation = DVec3::ZERO;
    }
    let no_legs = FitError::NoLegs {
        which: Which::Target,
    };
    assert_eq!(
        run(&source, &legless, &Options::default()).unwrap_err(),
        no_legs
    );
    let options = Options {
        lift: f64::NAN,
        ..Options::default()
    };
    assert!(matches!(
        run(&source, &plain(0.0), &options),
        Err(FitError::NotFinite { .. })
    ));
}

#[test]
fn a_bone_in_two_pieces_is_followed_to_its_end() {
    // A joint halfway down the left upper arm bends by 0.5.
    let mut split = plain(0.0);
    for joint in &mut split.joints[13..] {
        joint.parent = joint.parent.map(|parent| parent + usize::from(parent > 12));
    }
    let mut half = split.joints[13].clone();
    half.name = "LeftArmLower half".into();
    half.parent = Some(12);
    half.rest.translation /= 2.0;
    split.joints[13].rest.translation /= 2.0;
    split.joints[13].parent = Some(13);
    split.joints.insert(13, half);
    let source = motion(split, 1, |_, joint| {
        DQuat::from_rotation_z(if joint == 13 { -0.5 } else { 0.0 })
    });
    let target = plain(0.7);
    let result = run(&source, &target, &origin()).unwrap();
    let pose = at(&target, &result.clip, 0);
    // Two halves of equal length bent by 0.5 point 0.25 down as a whole; the forearm points 0.5.
    for (joint, next, angle) in [(12, 13, -0.25_f64), (13, 14, -0.5), (16, 17, 0.0)] {
        let bone = (pose.positions[next] - pose.positions[joint]).normalize();
        let side = if joint < 15 { 1.0 } else { -1.0 };
        let expected = DVec3::new(side * angle.cos(), angle.sin(), 0.0);
        assert!(bone.distance(expected) < 1e-12, "joint {joint}: {bone}");
    }
}

#[test]
fn a_correspondence_of_other_skeletons_is_refused() {
    let source = motion(plain(0.0), 1, |_, _| DQuat::IDENTITY);
    let target = plain(0.5);
    let both = Correspondence::new(&source.skeleton, &target, &[]).unwrap();
    let mut longer = target.clone();
    longer.joints.push(target.joints[18].clone());
    let result = retarget(&source, &longer, &both, &Options::default());
    assert_eq!(result.unwrap_err(), FitError::OtherSkeletons);
}

#[test]
fn half_a_turn_swings_too() {
    for (from, to) in [
        (DVec3::X, -DVec3::X),
        (DVec3::Y, DVec3::Z),
        (DVec3::Z, DVec3::Z),
    ] {
        assert!((swing(from, to) * from).distance(to) < 1e-12);
    }
    let small = DVec3::new(1.0, 1e-9, 0.0).normalize();
    assert!((swing(DVec3::X, small) * DVec3::X).distance(small) < 1e-16);
}
