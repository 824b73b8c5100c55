use super::*;
use crate::model::{Joint, Transform};

/// A skeleton from "name" or "name parent" entries.
fn skeleton(joints: &[(&str, usize)]) -> Skeleton {
    let joint = |(at, &(name, parent)): (usize, &(&str, usize))| Joint {
        name: name.into(),
        parent: (at > 0).then_some(parent),
        rest: Transform::IDENTITY,
    };
    Skeleton {
        joints: joints.iter().enumerate().map(joint).collect(),
    }
}

const CMU: &[(&str, usize)] = &[
    ("Hips", 0),
    ("LHipJoint", 0),
    ("LeftUpLeg", 1),
    ("LeftLeg", 2),
    ("LeftFoot", 3),
    ("LeftToeBase", 4),
    ("RHipJoint", 0),
    ("RightUpLeg", 6),
    ("RightLeg", 7),
    ("RightFoot", 8),
    ("LowerBack", 0),
    ("Spine", 10),
    ("Spine1", 11),
    ("Neck", 12),
    ("Neck1", 13),
    ("Head", 14),
    ("LeftShoulder", 12),
    ("LeftArm", 16),
    ("LeftForeArm", 17),
    ("LeftHand", 18),
    ("RightShoulder", 12),
    ("RightArm", 20),
];

#[test]
fn cmu_calls_the_clavicle_shoulder() {
    let human = Humanoid::new(&skeleton(CMU), Which::Source).unwrap();
    assert_eq!(human.hips, 0);
    assert_eq!(human.spine, [10, 11, 12]);
    assert_eq!(human.neck, [13, 14, 15]);
    assert_eq!(human.limb(Side::Left, Part::Shoulder), Some(16));
    assert_eq!(human.limb(Side::Left, Part::UpperArm), Some(17));
    assert_eq!(human.limb(Side::Right, Part::LowerLeg), Some(8));
    assert_eq!(human.limb(Side::Right, Part::Toes), None);
}

#[test]
fn mocapbank_calls_the_upper_arm_shoulder() {
    let human = Humanoid::new(
        &skeleton(&[
            ("Hips", 0),
            ("Chest", 0),
            ("LeftCollar", 1),
            ("LeftShoulder", 2),
            ("LeftElbow", 3),
            ("RightCollar", 1),
            ("RightShoulder", 5),
            ("Neck", 1),
            ("LeftHip", 0),
            ("LeftKnee", 8),
            ("LeftAnkle", 9),
            ("RightHip", 0),
            ("RightKnee", 11),
            ("RightAnkle", 12),
        ]),
        Which::Source,
    )
    .unwrap();
    assert_eq!(human.limb(Side::Left, Part::Shoulder), Some(2));
    assert_eq!(human.limb(Side::Left, Part::UpperArm), Some(3));
    assert_eq!(human.limb(Side::Right, Part::UpperLeg), Some(11));
    assert_eq!(
        (human.hips, &human.spine[..], &human.neck[..]),
        (0, &[1][..], &[7][..])
    );
    assert_eq!(human.roles[&Role::Head], 7);
}

#[test]
fn two_actors_in_one_file_are_ambiguous() {
    let mut joints = CMU.to_vec();
    joints.push(("LeftFoot#2", 0));
    let error = Humanoid::new(&skeleton(&joints), Which::Source).unwrap_err();
    assert!(matches!(&error, FitError::Ambiguous { role, .. } if role == "leftFoot"));
    assert!(
        error.to_string().contains("--map \"LeftFoot=leftFoot\""),
        "{error}"
    );
}

#[test]
fn hips_can_be_named_if_everything_hangs_below_them() {
    let mut joints = vec![("Root", 0)];
    let below = |&(name, parent): &(&'static str, usize)| (name, parent + 1);
    joints.extend(CMU.iter().map(below));
    joints[1].1 = 0;
    let long = skeleton(&joints);
    let with = |hips| {
        let mut named = candidates(&long);
        named.insert(Role::Hips, vec![hips]);
        Humanoid::choose(&long, Which::Source, &named)
    };
    assert_eq!(Humanoid::new(&long, Which::Source).unwrap().hips, 1);
    let human = with(0).unwrap();
    assert_eq!((human.hips, &human.spine[..]), (0, &[1, 11, 12, 13][..]));
    assert!(!human.roles.contains_key(&Role::Hips));
    let which = Which::Source;
    assert_eq!(with(11).unwrap_err(), FitError::Apart { which });
}

#[test]
fn missing_legs_are_named() {
    let error = Humanoid::new(&skeleton(&CMU[..9]), Which::Target).unwrap_err();
    let FitError::MissingRole { roles, .. } = &error else {
        panic!("{error}");
    };
    assert_eq!(roles, &["head", "rightFoot"]);
}

#[test]
fn role_names_can_be_read_back() {
    for role in Role::all() {
        assert_eq!(Role::parse(&role.to_string()), Some(role));
    }
    assert_eq!(
        Role::parse("LEFTTHUMBDISTAL"),
        Some(Role::Finger(Side::Left, Finger::Thumb, 2))
    );
    assert_eq!(Role::parse("tail"), None);
}

#[test]
fn a_chain_of_many_feet_is_quick() {
    let joint = |at: usize| Joint {
        name: format!("LeftFoot_{at}"),
        parent: at.checked_sub(1),
        rest: Transform::IDENTITY,
    };
    let long = Skeleton {
        joints: (0..60_000).map(joint).collect(),
    };
    assert_eq!(candidates(&long)[&Role::Limb(Side::Left, Part::Foot)], [0]);
    assert_eq!(common(&long, &[59_999, 30_000, 59_000]), Some(30_000));
    let apart = Skeleton {
        joints: vec![long.joints[0].clone(); 2],
    };
    assert_eq!(common(&apart, &[0, 1]), None);
}
